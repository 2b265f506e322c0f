"""Sliders, live and static: one declaration, two lives.

``explore(scene, distance=Slider([1, 2, 4], unit="m"), method=["mean", "mid"])`` declares a picture and the
values that its parameters may take.  In a live notebook it is a set of ipywidgets and the picture follows the
slider.  In the published book every combination has been rendered once, and a few lines of JavaScript swap the
frames: no kernel, no widget manager, no network.  Because the grid is declared, tests can sweep it.

A scene is either

* a function of the values that returns a new ``Figure``: the simple form, a full redraw each time; or
* an object with ``figure``, ``update(**values)`` and ``moving``, the artists that ``update`` touches.  Everything
  else is drawn once and kept as a background, which makes a redraw three to ten times cheaper.

``update`` must not depend on what came before: same values, same picture.  ``sweep`` checks that.
"""

from __future__ import annotations

import contextvars
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from coursekit.explore import sliders
from coursekit.explore.live import live_widget
from coursekit.explore.painting import LIVE_DPI, SWEEP_DPI, painter, png
from coursekit.explore.sliders import Slider, Values
from coursekit.explore.static import static_html

__all__ = ["Explorer", "Slider", "Values", "collecting", "explore", "png", "sweep"]

_listener: contextvars.ContextVar[list[Explorer] | None] = contextvars.ContextVar("explorers", default=None)


def explore(scene: Any, *, alt: str | Callable[..., str] = "", **parameters: Slider | Sequence[Any]) -> Explorer:
    """Declare an explorer; the last line of a notebook cell shows it.

    Parameters
    ----------
    scene : ``f(**values) → Figure``, an object with ``figure`` and ``update(**values)``, or its class.
    alt : what a frame shows, for those who cannot see it: a format string over the values, or a function.
    parameters : name → ``Slider``, or just the list of its values.

    Raises ValueError when there is no parameter, or a slider has fewer than two values.
    """
    explorer = Explorer(scene, parameters, alt)
    if (listening := _listener.get()) is not None:
        listening.append(explorer)
    return explorer


class Explorer:
    """A picture that is a pure function of values on a declared grid."""

    def __init__(
        self, scene: Any, parameters: dict[str, Slider | Sequence[Any]], alt: str | Callable[..., str]
    ) -> None:
        if not parameters:
            raise ValueError("expected at least one parameter, as in explore(scene, distance=[1, 2, 4])")
        self.parameters = {name: p if isinstance(p, Slider) else Slider(p) for name, p in parameters.items()}
        self._scene, self._alt = scene, alt
        self._painters: dict[int, Callable[[Values], np.ndarray]] = {}

    @property
    def start(self) -> Values:
        """The values shown first."""
        return sliders.start(self.parameters)

    def grid(self) -> Iterator[Values]:
        """Every combination of values; the last parameter runs fastest."""
        return sliders.grid(self.parameters)

    def __len__(self) -> int:
        return math.prod(len(s.values) for s in self.parameters.values())

    def picture(self, values: Values, dpi: int = LIVE_DPI) -> np.ndarray:
        """The frame for some values, (height, width, 3) uint8, RGB."""
        if dpi not in self._painters:
            # One resolution at a time: a scene has one figure, and its cached background has one size.
            self._painters = {dpi: painter(self._scene, self.start, dpi)}
        return self._painters[dpi](values)

    def alt(self, values: Values) -> str:
        """What a frame shows, in words."""
        words = self._alt(**values) if callable(self._alt) else self._alt.format(**values)
        settings = ", ".join(f"{s.label or name} {s.text(values[name])}" for name, s in self.parameters.items())
        return f"{words} ({settings})" if words else settings

    def widget(self) -> Any:
        """The live form: ipywidgets around one image that follows them."""
        return live_widget(self.parameters, self.picture, self.alt)

    def html(self) -> str:
        """The static form: one self-contained piece of HTML with every frame in it."""
        return static_html(self.parameters, self.picture, self.alt)

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if os.environ.get("COURSEKIT_STATIC"):
            return {"text/html": self.html(), "text/plain": repr(self)}
        return self.widget()._repr_mimebundle_(**kwargs)

    def __repr__(self) -> str:
        names = ", ".join(f"{s.label or name} ({len(s.values)})" for name, s in self.parameters.items())
        return f"<explorer of {names}: {len(self)} pictures>"


@contextmanager
def collecting() -> Iterator[list[Explorer]]:
    """Every explorer declared inside the ``with`` block: this is how the tests find a lab's sliders by themselves."""
    explorers: list[Explorer] = []
    token = _listener.set(explorers)
    try:
        yield explorers
    finally:
        _listener.reset(token)


def sweep(explorer: Explorer) -> list[str]:
    """Visit the whole grid, there and back; return what is wrong, in words (empty when nothing is).

    Caught: a value that raises, an empty picture, a picture that depends on the way the slider came, a slider
    that never changes anything, and a text alternative that fails or says the same everywhere.
    """
    problems: list[str] = []
    seen: dict[tuple, bytes] = {}
    said: set[str] = set()
    for direction in (list(explorer.grid()), list(explorer.grid())[::-1]):
        for values in direction:
            try:
                picture = explorer.picture(values, SWEEP_DPI)
                said.add(explorer.alt(values))
            except Exception as error:  # anything that a scene raises is what the sweep is looking for
                problems.append(f"{values} raises {type(error).__name__}: {error}")
                continue
            if (picture == picture[0, 0]).all():
                problems.append(f"{values} gives an empty picture")
            key = tuple(values.values())
            if seen.setdefault(key, picture.tobytes()) != picture.tobytes():
                problems.append(f"{values} gives a picture that depends on what was shown before")
    for i, name in enumerate(explorer.parameters):
        groups: dict[tuple, set[bytes]] = {}
        for key, picture_bytes in seen.items():
            groups.setdefault(key[:i] + key[i + 1 :], set()).add(picture_bytes)
        if seen and not any(len(g) > 1 for g in groups.values()):
            problems.append(f"the slider {name!r} never changes the picture")
    if len(said) == 1:
        problems.append(f"the text alternative says {said.pop()!r} everywhere")
    return list(dict.fromkeys(problems))
