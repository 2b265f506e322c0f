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

import base64
import contextvars
import hashlib
import html
import itertools
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from io import BytesIO
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

Values = dict[str, Any]
LIVE_DPI, STATIC_DPI, SWEEP_DPI = 100, 144, 40

_listener: contextvars.ContextVar[list[Explorer] | None] = contextvars.ContextVar("explorers", default=None)


@dataclass(frozen=True)
class Slider:
    """The values that one parameter may take, in order.

    values : numbers (a slider), or strings or booleans (a set of buttons); at least two, all different.
    label : what the reader sees; the parameter's name by default.    unit : "m", "rad", "%".
    start : the value shown first; the middle one of the numbers, the first of anything else.
    play : True adds a button that runs through the values, for time.
    """

    values: Sequence[Any]
    label: str = ""
    unit: str = ""
    start: Any = None
    play: bool = False

    def __post_init__(self) -> None:
        values = tuple(v.item() if isinstance(v, np.generic) else v for v in self.values)
        if len(values) < 2 or len(set(values)) < len(values):
            raise ValueError(f"values: expected at least two different values, got {values}")
        start = self.start
        if start is None:
            start = values[0] if isinstance(values[0], (str, bool)) else values[(len(values) - 1) // 2]
        if start not in values:
            raise ValueError(f"start: expected one of {values}, got {start!r}")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "start", start)

    @property
    def is_choice(self) -> bool:
        """True when the values are names or yes/no: buttons say that better than a slider."""
        return any(isinstance(v, (str, bool)) for v in self.values)

    def text(self, value: Any) -> str:
        """A value as the reader sees it, with its unit."""
        if isinstance(value, bool):
            return "on" if value else "off"
        number = f"{value:.4g}".replace("-", "−") if isinstance(value, float) else str(value)
        return f"{number} {self.unit}".rstrip()


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
        return {name: slider.start for name, slider in self.parameters.items()}

    def grid(self) -> Iterator[Values]:
        """Every combination of values; the last parameter runs fastest."""
        for combination in itertools.product(*(s.values for s in self.parameters.values())):
            yield dict(zip(self.parameters, combination, strict=True))

    def __len__(self) -> int:
        return math.prod(len(s.values) for s in self.parameters.values())

    def picture(self, values: Values, dpi: int = LIVE_DPI) -> np.ndarray:
        """The frame for some values, (height, width, 3) uint8, RGB."""
        if dpi not in self._painters:
            # One resolution at a time: a scene has one figure, and its cached background has one size.
            self._painters = {dpi: _painter(self._scene, self.start, dpi)}
        return self._painters[dpi](values)

    def alt(self, values: Values) -> str:
        """What a frame shows, in words."""
        words = self._alt(**values) if callable(self._alt) else self._alt.format(**values)
        settings = ", ".join(f"{s.label or name} {s.text(values[name])}" for name, s in self.parameters.items())
        return f"{words} ({settings})" if words else settings

    def widget(self) -> Any:
        """The live form: ipywidgets around one image that follows them."""
        from coursekit._live import live_widget

        return live_widget(self)

    def html(self) -> str:
        """The static form: one self-contained piece of HTML with every frame in it."""
        return _static_html(self)

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
    for direction in (list(explorer.grid()), list(explorer.grid())[::-1]):
        for values in direction:
            try:
                picture = explorer.picture(values, SWEEP_DPI)
                explorer.alt(values)
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
    return list(dict.fromkeys(problems))


def _painter(scene: Any, start: Values, dpi: int) -> Callable[[Values], np.ndarray]:
    """A function from values to pixels, for either kind of scene."""
    if isinstance(scene, type):
        scene = scene()
    if not hasattr(scene, "update"):
        return lambda values: _paint_figure(scene(**values), dpi)
    return _Blitter(scene, start, dpi)


def _paint_figure(fig: Figure, dpi: int) -> np.ndarray:
    if not isinstance(fig, Figure):
        raise TypeError(f"a scene must return a matplotlib Figure, got {type(fig).__name__}")
    _expect_data(fig)
    fig.set_dpi(dpi)
    canvas = FigureCanvasAgg(fig)
    canvas.draw()
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close(fig)
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


class _Blitter:
    """Draws what moves over a cached picture of what does not."""

    def __init__(self, scene: Any, start: Values, dpi: int) -> None:
        self.scene = scene
        self.moving = sorted(getattr(scene, "moving", ()), key=lambda artist: artist.get_zorder())
        fig = scene.figure
        fig.set_dpi(dpi)
        self.canvas = FigureCanvasAgg(fig)
        # The layout is worked out once, at the start values, so that no frame depends on another's labels.
        scene.update(**start)
        _expect_data(fig)
        for artist in self.moving:
            artist.set_animated(False)
        self.canvas.draw()
        fig.set_layout_engine("none")
        for artist in self.moving:
            artist.set_animated(True)
        self.canvas.draw()
        self.background = self.canvas.copy_from_bbox(fig.bbox)

    def __call__(self, values: Values) -> np.ndarray:
        self.scene.update(**values)
        if self.moving:
            self.canvas.restore_region(self.background)
            renderer = self.canvas.get_renderer()
            for artist in self.moving:
                artist.draw(renderer)
        else:
            self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3].copy()


def _expect_data(fig: Figure) -> None:
    if not any(ax.has_data() or ax.texts or ax.patches or ax.artists for ax in fig.axes) and not fig.texts:
        raise ValueError("the figure is empty: no axes with anything in them")


def _static_html(explorer: Explorer) -> str:
    """Render the grid and wrap it: labelled inputs, the first frame, every frame's address and words."""
    grid = list(explorer.grid())
    lossless = _is_drawing(explorer.picture(explorer.start, STATIC_DPI))
    with ThreadPoolExecutor(2) as pool:  # encoding leaves the interpreter free to draw the next frame
        frames = list(
            pool.map(lambda picture: _webp(picture, lossless), (explorer.picture(v, STATIC_DPI) for v in grid))
        )
    alts = [explorer.alt(values) for values in grid]
    first = grid.index(explorer.start)
    height, width = explorer.picture(explorer.start, STATIC_DPI).shape[:2]
    identity = "explorer-" + hashlib.sha256("".join(frames + alts).encode()).hexdigest()[:12]
    controls = "".join(_control_html(identity, name, slider) for name, slider in explorer.parameters.items())
    data = {"frames": frames, "alts": alts, "sizes": [len(s.values) for s in explorer.parameters.values()]}
    texts = [[s.text(v) for v in s.values] for s in explorer.parameters.values()]
    # "<" is escaped so that no text can end the script element early.
    payload = json.dumps(data | {"texts": texts}, ensure_ascii=False).replace("<", "\\u003c")
    script = files("coursekit").joinpath("explorer.js").read_text(encoding="utf-8")
    style = files("coursekit").joinpath("explorer.css").read_text(encoding="utf-8")
    shown_width = round(width * LIVE_DPI / STATIC_DPI)
    return (
        f'<div class="explorer" id="{identity}" role="group" aria-label="Interactive figure"'
        f' style="max-width:{shown_width}px">'
        f"<style>{style}</style>"
        f'<img src="{frames[first]}" alt="{html.escape(alts[first], quote=True)}"'
        f' width="{width}" height="{height}" decoding="sync">'
        f'<div class="explorer-controls">{controls}</div><p class="explorer-words" aria-live="polite"></p>'
        f"<noscript>The sliders need JavaScript; the picture shows {html.escape(alts[first])}.</noscript>"
        f'<script type="application/json" class="explorer-data">{payload}</script>'
        f'<script>({script.strip()})(document.getElementById("{identity}"));</script></div>'
    )


def _control_html(identity: str, name: str, slider: Slider) -> str:
    label, start = html.escape(slider.label or name), slider.values.index(slider.start)
    text = html.escape(slider.text(slider.start))
    if slider.is_choice:
        buttons = "".join(
            f'<label><input type="radio" name="{identity}-{name}" value="{i}"{" checked" if i == start else ""}>'
            f"<span>{html.escape(slider.text(v))}</span></label>"
            for i, v in enumerate(slider.values)
        )
        return f'<fieldset class="explorer-control" data-name="{name}"><legend>{label}</legend>{buttons}</fieldset>'
    play = f'<button type="button" class="explorer-play" aria-label="Play {label}">▶</button>' if slider.play else ""
    return (
        f'<div class="explorer-control" data-name="{name}"><label for="{identity}-{name}">{label}</label>{play}'
        f'<input type="range" id="{identity}-{name}" min="0" max="{len(slider.values) - 1}" step="1" value="{start}"'
        f' aria-valuetext="{text}" autocomplete="off"><output for="{identity}-{name}">{text}</output></div>'
    )


def _is_drawing(picture: np.ndarray) -> bool:
    """True when lossless coding is the smaller one, or nearly: lines on white.  Photographs are not."""
    return len(_webp(picture, lossless=True)) <= 1.5 * len(_webp(picture, lossless=False))


def _webp(picture: np.ndarray, lossless: bool) -> str:
    buffer = BytesIO()
    quality = {"quality": 30, "method": 1} if lossless else {"quality": 80, "method": 2}
    Image.fromarray(picture).save(buffer, "WEBP", lossless=lossless, **quality)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def png(picture: np.ndarray) -> bytes:
    """A frame as a PNG that is quick to make: a live picture travels a short way and is soon replaced."""
    import cv2

    ok, encoded = cv2.imencode(".png", picture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert ok, "a uint8 RGB array always encodes"
    return bytes(encoded)
