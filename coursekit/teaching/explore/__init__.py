"""Sliders, live and static: one declaration, two lives.

``explore(scene, distance=Slider([1, 2, 4], unit="m"), method=["mean", "mid"])`` declares a picture and the
values that its parameters may take.  In a live notebook the kernel draws the picture that the slider asks for.
In the published book every combination has been rendered once, and a few lines of JavaScript swap the
frames: no kernel, no widget manager, no network.  Because the grid is declared, tests can sweep it.

A scene is either

* a function of the values that returns a new ``Figure``: the simple form, a full redraw each time; or
* an object with ``figure``, ``update(**values)`` and ``moving``, the artists that ``update`` touches.  Everything
  else is drawn once and kept as a background, which makes a redraw three to ten times cheaper.

``update`` must not depend on what came before: same values, same picture.  ``sweep`` checks that.
"""

from __future__ import annotations

import contextvars
import html
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import numpy as np

from coursekit.teaching.explore import sliders
from coursekit.teaching.explore.guess import Guess, guess
from coursekit.teaching.explore.live import LiveExplorer, remember
from coursekit.teaching.explore.painting import LIVE_DPI, SWEEP_DPI, painter, png
from coursekit.teaching.explore.sliders import Slider, Values
from coursekit.teaching.explore.static import static_html

__all__ = ["Explorer", "Guess", "Slider", "Values", "collecting", "explore", "guess", "png", "sweep"]

_listener: contextvars.ContextVar[list[Explorer] | None] = contextvars.ContextVar("explorers", default=None)


def explore(
    scene: Any, *, alt: str | Callable[..., str] = "", name: str = "", **parameters: Slider | Sequence[Any]
) -> Explorer:
    """Declare an explorer; the last line of a notebook cell shows it.

    Parameters
    ----------
    scene : ``f(**values) → Figure``, an object with ``figure`` and ``update(**values)``, or its class.
    alt : what a frame shows, for those who cannot see it: a format string over the values, or a function.
    name : what the text calls it, where the text sets it or reads from it.
    parameters : name → ``Slider``, or just the list of its values.

    Raises ValueError when there is no parameter, or a slider has fewer than two values.

    >>> def scene(power):
    ...     figure = plotting.figure(3.0, 2.0)  # inches
    ...     plotting.axes(figure).plot(np.linspace(0, 1, 50) ** power)
    ...     return figure
    >>> from coursekit.teaching import plotting
    >>> explorer = explore(scene, alt="x to the power {power}", power=Slider([1, 2, 3], label="Power"))
    >>> explorer, explorer.alt({"power": 2})
    (<explorer of Power (3): 3 pictures>, 'x to the power 2 (Power 2)')
    """
    explorer = Explorer(scene, parameters, alt, name)
    if (listening := _listener.get()) is not None:
        listening.append(explorer)
    return explorer


class Explorer:
    """A picture that is a pure function of values on a declared grid."""

    def __init__(
        self, scene: Any, parameters: dict[str, Slider | Sequence[Any]], alt: str | Callable[..., str], name: str = ""
    ) -> None:
        if not parameters:
            raise ValueError("expected at least one parameter, as in explore(scene, distance=[1, 2, 4])")
        self.parameters = {name: p if isinstance(p, Slider) else Slider(p) for name, p in parameters.items()}
        if name and not name.isidentifier():
            raise ValueError(f"name: expected letters, digits and _, got {name!r}")
        self.name = name
        self._declared, self._alt = scene, alt
        self._painters: dict[int, Callable[[Values], np.ndarray]] = {}
        self._widget: LiveExplorer | None = None

    @cached_property
    def scene(self) -> Any:
        """The scene, made when it is first looked at."""
        return self._declared() if isinstance(self._declared, type) else self._declared

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
            self._painters = {dpi: painter(self.scene, self.start, dpi)}
        return self._painters[dpi](values)

    def alt(self, values: Values) -> str:
        """What a frame shows, in words."""
        words = self._alt(**values) if callable(self._alt) else self._alt.format(**values)
        settings = ", ".join(f"{s.label or name} {s.text(values[name])}" for name, s in self.parameters.items())
        return f"{words} ({settings})" if words else settings

    def facts(self, values: Values) -> dict[str, str]:
        """Numbers of a frame that the text may quote, by name: what the scene's ``facts(**values)`` says."""
        return self.scene.facts(**values) if hasattr(self.scene, "facts") else {}

    def widget(self) -> LiveExplorer:
        """The live form.  It is made once: shown again, it is one more view of the same."""
        if self._widget is None:
            self._widget = LiveExplorer(self.parameters, self.picture, self.alt, self.facts, self.name)
        return self._widget

    def html(self) -> str:
        """The static form: one self-contained piece of HTML with every frame in it."""
        return static_html(self.parameters, self.picture, self.alt, self.facts, self.name)

    def close(self) -> None:
        """Free the live form and the drawn scene.  Shown again, the explorer draws both anew."""
        if self._widget is not None:
            self._widget.close()
            self._widget = None
        self._painters.clear()

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if os.environ.get("COURSEKIT_STATIC"):
            return {"text/html": self.html(), "text/plain": repr(self)}
        remember(self)
        widget = self.widget()
        # The picture is for those who show the saved notebook without a kernel: nbconvert, a file viewer.
        still = f'<img src="{widget.still}" alt="{html.escape(widget.words, quote=True)}">'
        live = widget._repr_mimebundle_(**kwargs)
        assert live is not None, "a widget that was just made is open"
        return live[0] | {"text/plain": repr(self), "text/html": still}

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
    """Visit the whole grid, and every third value on the way back; return what is wrong, in words (or nothing).

    Caught: a value that raises, an empty picture, one with ink at its edge (a title cut off), a picture that depends
    on the way the slider came, a slider that never changes anything, and a text alternative that fails or says the
    same everywhere.
    """
    problems: list[str] = []
    seen: dict[tuple, bytes] = {}
    said: set[str] = set()
    for direction in (list(explorer.grid()), list(explorer.grid())[::-3]):
        for values in direction:
            try:
                picture = explorer.picture(values, SWEEP_DPI)
                said.add(explorer.alt(values))
            except Exception as error:  # anything that a scene raises is what the sweep is looking for
                problems.append(f"{values} raises {type(error).__name__}: {error}")
                continue
            rim = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
            if (rim != picture[0, 0]).any():
                problems.append(f"{values} gives a picture with ink at its edge: something is cut off there")
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
