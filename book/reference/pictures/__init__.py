"""What each failure looks like: one function a failure, of its name; its docstring is the picture's caption.

In every picture the mistake is orange, the sound version blue and the truth black.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module

from matplotlib.figure import Figure


def of(name: str) -> tuple[Callable[[], Figure], str]:
    """The picture of a failure such as "lab04.hard_gate": the function that draws it, and its caption.

    Raises LookupError for a failure without a picture, or a picture without a caption.
    """
    lab, _, failure = name.partition(".")
    draw = getattr(import_module(f"reference.pictures.{lab}"), failure, None)
    if draw is None or not draw.__doc__:
        raise LookupError(f"{name}: expected a function {failure} with a docstring in book/reference/pictures/{lab}.py")
    return draw, " ".join((inspect.getdoc(draw) or "").split())
