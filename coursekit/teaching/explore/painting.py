"""From a scene and some values to pixels, and from pixels to the bytes of a picture."""

from __future__ import annotations

import base64
import sys
from collections.abc import Callable
from io import BytesIO
from typing import Any

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from coursekit.teaching.explore.sliders import Values

LIVE_DPI, STATIC_DPI, SWEEP_DPI = 100, 144, 40
# Each row as its difference from the one above, then runs of the same: half the time of trying every filter.
QUICK = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP,
         cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]  # fmt: skip
Picture = Callable[[Values, int], np.ndarray]
"""A frame (height, width, 3), uint8 RGB, from values and dots an inch."""
Words = Callable[[Values], str]
"""What the frame of some values shows, in words."""
Facts = Callable[[Values], dict[str, str]]
"""Numbers of a frame that the text may quote, by name, as the reader sees them."""


def painter(scene: Any, start: Values, dpi: int) -> Callable[[Values], np.ndarray]:
    """A function from values to pixels, for either kind of scene."""
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


LOSSLESS, LOSSY = {"lossless": True, "quality": 30, "method": 1}, {"quality": 70, "method": 3}


def is_drawing(picture: np.ndarray) -> bool:
    """True when lossless coding is the smaller one, or nearly: lines on white.  Photographs are not."""
    image = Image.fromarray(picture)
    return len(_encoded(image, LOSSLESS)) <= 1.5 * len(_encoded(image, LOSSY))


def webp(picture: np.ndarray, drawing: bool) -> str:
    """A frame as a data address: what a published page keeps of it."""
    image = Image.fromarray(picture)
    if drawing:
        # The smooth edges of a drawing have hundreds of colours; the nearest 256 look the same at 0.6 of the weight.
        image = image.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).convert("RGB")
    code = _encoded(image, LOSSLESS if drawing else LOSSY)
    return "data:image/webp;base64," + base64.b64encode(code).decode("ascii")


def _encoded(image: Image.Image, options: dict[str, Any]) -> bytes:
    image.save(buffer := BytesIO(), "WEBP", **options)
    return buffer.getvalue()


def png(picture: np.ndarray) -> bytes:
    """A frame as a PNG that is quick to make: a live picture travels a short way and is soon replaced."""
    ok, encoded = cv2.imencode(".png", picture[..., ::-1], QUICK)
    assert ok, "a uint8 RGB array always encodes"
    return bytes(encoded)
