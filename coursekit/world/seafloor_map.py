"""The sea floor's map, painted from a seed: ripples, rocks, coral, weed, and sand on which nothing stands out.

``data/seafloor.jpg`` was made by ``python -m coursekit.world.seafloor_map data/seafloor.jpg``.
"""

from __future__ import annotations

import sys
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

HEIGHT, WIDTH = 800, 2560
SEED = 8
Pixels = Any  # float32 images: (h, w) or (h, w, 3)
BARE = (950.0, 1610.0)  # between these columns lies bare sand


def paint(seed: int = SEED, size: tuple[int, int] = (HEIGHT, WIDTH)) -> NDArray[np.uint8]:
    """The map: sand ripples, rocks, coral, weed, and a wide stretch of nearly featureless sand.

    Parameters
    ----------
    size : (height, width) in pixels; the bare stretch scales with the width.

    Returns (height, width, 3) uint8, BGR.  The same seed gives the same bytes.
    """
    rng = np.random.default_rng(seed)
    h, w = size
    v, u = np.mgrid[:h, :w].astype(np.float32)
    # 1 where things grow, 0 on the bare stretch, with a ragged border between them.
    ragged = u * WIDTH / w + 45 * _noise(rng, size, 160, 3)
    alive = np.clip(np.maximum(BARE[0] - ragged, ragged - BARE[1]) / 50, 0, 1)

    phase = (0.25 * u + v) / 3.6 + 3.5 * _noise(rng, size, 220, 2) + 0.5 * _noise(rng, size, 40, 2)
    patches = np.clip(1.2 * _noise(rng, size, 180, 2) + 0.5, 0, 1) * alive
    relief = 1.6 * patches * (np.abs(np.sin(phase)) - 0.6) + 0.22 * alive * _noise(rng, size, 3, 2)
    sand = np.array([150, 184, 196], np.float32) + 10 * _noise(rng, size, 350, 3)[..., None]
    colour = sand + (6 * alive * _noise(rng, size, 9, 2) + 0.5 * _noise(rng, size, 4, 1))[..., None]

    for _ in range(260):
        _rock(rng, relief, colour, alive)
    for _ in range(75):
        _coral(rng, relief, colour, alive)
    # Light from the upper left: a slope that faces it is bright, one that turns away lies in its own shade.
    slope = cv2.Sobel(relief, cv2.CV_32F, 1, 0, ksize=3) + cv2.Sobel(relief, cv2.CV_32F, 0, 1, ksize=3)
    colour *= np.clip(1 + 0.055 * slope, 0.35, 1.6)[..., None]
    for _ in range(170):
        _weed(rng, colour, alive)
    return np.clip(np.round(colour), 0, 255).astype(np.uint8)


def _noise(rng: np.random.Generator, size: tuple[int, int], cell: int, octaves: int) -> NDArray[np.float32]:
    """Smooth noise of about unit spread whose coarsest detail is ``cell`` pixels wide; each octave halves both."""
    h, w = size
    total = np.zeros(size, np.float32)
    for octave in range(octaves):
        step = max(cell / 2**octave, 1)
        coarse = rng.standard_normal((int(h / step) + 3, int(w / step) + 3)).astype(np.float32)
        # The whole coarse grid is stretched over the map, so nothing repeats.
        total += cv2.resize(coarse, (w, h), interpolation=cv2.INTER_CUBIC) / 2**octave
    return total / np.float32(np.sqrt(sum(0.25**k for k in range(octaves))) * 0.75)


def _spot(rng: np.random.Generator, alive: Pixels, radius: float) -> tuple[slice, slice, Pixels, Pixels] | None:
    """A place for something of this radius: its window of the map, and the window's coordinates; None on bare sand."""
    h, w = alive.shape
    cu, cv = rng.uniform(0, w), rng.uniform(0, h)
    reach = int(2 * radius) + 2
    rows = slice(max(int(cv) - reach, 0), min(int(cv) + reach, h))
    columns = slice(max(int(cu) - reach, 0), min(int(cu) + reach, w))
    if alive[rows, columns].min() < 0.9:
        return None
    v, u = np.mgrid[rows, columns].astype(np.float32)
    return rows, columns, u - np.float32(cu), v - np.float32(cv)


def _rock(rng: np.random.Generator, relief: Pixels, colour: Pixels, alive: Pixels) -> None:
    radius = 5 + 28 * rng.random() ** 2.5
    spot, shape, tint = _spot(rng, alive, radius), rng.uniform(0, 2 * np.pi, 4), rng.uniform(70, 130)
    if spot is None:
        return
    rows, columns, u, v = spot
    angle = np.arctan2(v, u)
    edge = radius * (1 + 0.22 * np.sin(2 * angle + shape[0]) + 0.12 * np.sin(3 * angle + shape[1])
                     + 0.07 * np.sin(5 * angle + shape[2]))  # fmt: skip
    dome: Pixels = np.clip(1 - np.hypot(u, v) / edge, 0, 1)
    body, shade = dome > 0, np.hypot(u - 0.25 * radius, v - 0.25 * radius) < edge
    colour[rows, columns][shade & ~body] *= 0.72
    rough = _noise(rng, dome.shape, 7, 3)
    relief[rows, columns] = np.where(body, 0.16 * radius * np.sqrt(dome) + 0.8 * rough, relief[rows, columns])
    stone = np.array([0.95, 1.0, 1.02]) * (tint + 12 * rough)[..., None]
    colour[rows, columns] = np.where(body[..., None], stone, colour[rows, columns])


def _coral(rng: np.random.Generator, relief: Pixels, colour: Pixels, alive: Pixels) -> None:
    radius = rng.uniform(9, 26)
    hues = np.array([[70, 110, 215], [150, 95, 205], [60, 165, 215], [165, 140, 120], [120, 190, 200]], np.float32)
    spot, hue = _spot(rng, alive, radius), hues[rng.integers(len(hues))]
    if spot is None:
        return
    rows, columns, u, v = spot
    folds = np.sin(2.2 * _noise(rng, u.shape, 9, 2) + np.hypot(u, v) / 1.9)
    edge = radius * (1 + 0.12 * np.sin(6 * np.arctan2(v, u) + rng.uniform(0, 6)))
    dome = np.clip(1 - np.hypot(u, v) / edge, 0, 1)
    body = dome > 0
    relief[rows, columns] = np.where(body, 0.14 * radius * np.sqrt(dome) + 0.7 * folds, relief[rows, columns])
    paint = hue * (0.9 + 0.14 * folds)[..., None]
    colour[rows, columns] = np.where(body[..., None], paint, colour[rows, columns])


def _weed(rng: np.random.Generator, colour: Pixels, alive: Pixels) -> None:
    spot, blades = _spot(rng, alive, 20.0), int(rng.integers(8, 22))
    lean, green = rng.normal(0.6, 0.5), rng.uniform(0.7, 1.2)
    if spot is None:
        return
    rows, columns, u, v = spot
    patch = np.ascontiguousarray(colour[rows, columns])
    foot = np.array([-u[0, 0], -v[0, 0]])
    for _ in range(blades):
        t = np.linspace(0, 1, 9) * rng.uniform(10, 34)
        bend, direction = rng.normal(0, 0.03), lean + rng.normal(0, 0.45)
        start = foot + rng.normal(0, 5, 2)
        blade = start + np.stack([t * np.cos(direction + bend * t), t * np.sin(direction + bend * t)], axis=-1)
        tint = green * np.array([40, 85, 55]) * rng.uniform(0.7, 1.3)
        points = np.round(blade * 16).astype(np.int32)
        cv2.polylines(patch, [points], False, tint.tolist(), int(rng.integers(1, 3)), cv2.LINE_8, shift=4)
    colour[rows, columns] = patch


if __name__ == "__main__":
    cv2.imwrite(sys.argv[1], paint(), [cv2.IMWRITE_JPEG_QUALITY, 90])
