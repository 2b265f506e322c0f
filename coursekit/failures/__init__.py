"""The gallery of classic mistakes: each can be switched on, and each is caught by a check that has a name.

An ``Exhibit`` holds a mistake somebody published, the sound version beside it, and the check that tells them
apart.  The test suite runs every check on both: an exhibit that goes uncaught turns it red.  The exhibits of lab
NN live in ``coursekit.failures.labNN``.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

_gallery: dict[str, Exhibit] = {}


@dataclass(frozen=True)
class Exhibit:
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
            raise ValueError(f"two exhibits are named {self.name!r}")
        _gallery[self.name] = self


def gallery() -> dict[str, Exhibit]:
    """Every exhibit of every lab, by name."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return dict(sorted(_gallery.items()))
