"""The gallery of classic mistakes: each can be switched on, and each is caught by a check that has a name.

A ``Failure`` holds a mistake somebody published, the sound version beside it, and the check that tells them
apart.  The test suite runs every check on both: a failure that goes uncaught turns it red.  The failures of lab
NN live in ``coursekit.labs.labNN.failures``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from coursekit.teaching._labs import import_each

_gallery: dict[str, Failure] = {}


@dataclass(frozen=True)
class Failure:
    """One mistake.

    name : "lab04.unwrapped_bearing".     source : who published it, so that it can be looked up.
    wrong, right : the two implementations, interchangeable.
    check : ``check(implementation) → bool``, True for a sound one; its name is the check that catches the mistake.
    lesson : one sentence, what the picture of it shows.
    """

    name: str
    source: str
    wrong: Callable[..., Any]
    right: Callable[..., Any]
    check: Callable[[Callable[..., Any]], bool]
    lesson: str

    def __post_init__(self) -> None:
        if self.name in _gallery:
            raise ValueError(f"two failures are named {self.name!r}")
        _gallery[self.name] = self


def gallery() -> dict[str, Failure]:
    """Every failure of every lab, by name."""
    import_each("failures")
    return dict(sorted(_gallery.items()))
