"""What a measurement may hand back instead of a value: a rejection with its reason."""

from dataclasses import dataclass

__all__ = ["Rejected"]


@dataclass(frozen=True)
class Rejected:
    """A measurement that cannot be trusted, and why.

    A rejection is a result, not an exception: the camera worked, the picture was read, and the honest answer is
    "nothing usable here". It counts as false, so that ``if fix := matcher.locate(image):`` reads as it should; a
    measurement that succeeded is an ordinary dataclass and counts as true.

    Parameters
    ----------
    reason : str
        One sentence for the person who reads the log: what was found, and which limit it broke.
    """

    reason: str

    def __bool__(self) -> bool:
        return False
