"""The fine outline of a landmark, and what of it something nearer hides (see ``landmarks``)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array

Indices = NDArray[np.signedinteger]
Box = tuple[int, int, int, int]
_R = 4  # a fine edge is looked for this many pixels to either side of the rough one
_ALONG = np.array([-1.0, -0.6, 0.0, 0.6, 1.0])  # where on a rim points are given
_STEP = 1.5  # pixels off the ellipse: more is no noise but the end of one thing and the beginning of another


def outline(image: NDArray[np.uint8], mask: NDArray[np.uint8], other: NDArray[np.uint8], box: Box) -> Array:
    """Points of the outline of the piece of ``mask`` in ``box``, clockwise from its top left corner, (n, 2).

    ``other`` is 255 where the picture has another landmark's colour.
    """
    x, y, w, h = box
    height, width = mask.shape
    middle = slice(y + h // 4, y + h - h // 4)
    columns = x + np.flatnonzero(mask[middle, x : x + w].mean(axis=0) > 127)
    if not columns.size:
        return np.empty((0, 2))
    left, right = _sides(image[middle], int(columns[0]), int(columns[-1]))
    if right - left < 1:
        return np.empty((0, 2))
    u = columns[1:-1] if columns.size > 2 else columns[:1]
    inside = mask[y : y + h, u] > 0
    first, last = y + inside.argmax(axis=0), y + h - 1 - inside[::-1].argmax(axis=0)
    s = np.clip((2 * u - left - right) / (right - left), -1, 1)
    top = _Rim(s, _rows(image, u, first, 1), -1, right - left)
    bottom = _Rim(s, _rows(image, u, last, -1), 1, right - left)

    upper, lower = top.points(left, right), bottom.points(left, right)
    sides = [[u_side, (upper[i, 1] + lower[i, 1]) / 2] for i, u_side in ((0, left), (-1, right))]
    # Whatever stands nearer meets the floor lower down in the picture.
    floor = _floor(image, u, bottom(s))
    if _beside(other, left, bottom(s)[0], -1) or _edge_goes_on(image, left, bottom(s)[0], -1, floor):
        upper[0], lower[0], sides[0] = np.nan, np.nan, [np.nan, np.nan]
    if _beside(other, right, bottom(s)[-1], 1) or _edge_goes_on(image, right, bottom(s)[-1], 1, floor):
        upper[-1], lower[-1], sides[1] = np.nan, np.nan, [np.nan, np.nan]
    if _below(other, u, bottom(s)) or (bottom.steps and last.max() < height - 1):
        lower[:] = np.nan
    if top.steps and first.min() > 0:
        upper[:] = np.nan
    points = np.vstack([upper, sides[1:], lower[::-1], sides[:1]])
    # Where there is little to fit, a fit may run away: the piece itself says how far the outline can reach.
    low, high = np.maximum([x - 2, y - 2], -0.5), np.minimum([x + w + 1, y + h + 1], [width - 0.5, height - 0.5])
    return np.clip(points, low, high)


class _Rim:
    """A rim v(s) = a + b s ± c √(1 - s²), fitted to one row per column; ``sign`` is -1 for a top, 1 for a bottom.

    A far rim is a few columns wide and nearly straight: b and c are held near zero, the more so the fewer
    columns there are to tell them from noise.
    """

    def __init__(self, s: Array, v: Array, sign: int, width: float) -> None:
        self.sign = sign
        A = np.stack([np.ones_like(s), s, sign * np.sqrt(1 - s**2)], axis=-1)
        prior = 5.0 / width * np.array([[0, 1.0, 0], [0, 0, 1.0]])
        level, keep = np.median(v), np.ones(len(s), dtype=bool)
        for _ in range(3):
            self.abc = np.linalg.lstsq(np.vstack([A[keep], prior]), np.append(v[keep] - level, [0, 0]), rcond=None)[0]
            residual = np.abs(v - level - A @ self.abc)
            keep = residual <= max(0.4, 3 * float(np.median(residual)))
        self.abc[0] += level
        self.steps = bool(np.mean(residual > _STEP) > 0.08)

    def __call__(self, s: Array) -> Array:
        a, b, c = self.abc
        return np.asarray(a + b * s + self.sign * c * np.sqrt(1 - s**2))

    def points(self, left: float, right: float) -> Array:
        """Points from the left end to the right one, the rim's extreme among them."""
        _, b, c = self.abc
        extreme = self.sign * b / np.hypot(b, c) if c > 0 else np.sign(self.sign * b)
        s = np.sort(np.append(_ALONG, extreme))
        return np.stack([(left + right) / 2 + s * (right - left) / 2, self(s)], axis=-1)


def _sides(band: NDArray[np.uint8], first: int, last: int) -> tuple[float, float]:
    """The two vertical edges, from the mean of a band of rows, near its first and last coloured column."""
    profile = band.mean(axis=0)
    end = len(profile) - 1
    reach = np.arange(-_R, _R + 1)
    lines = profile[np.clip([first + reach, last - reach], 0, end)]
    fine = _crossing(lines)
    return (-0.5 if first == 0 else first + fine[0]), (end + 0.5 if last == end else last - fine[1])


def _rows(image: NDArray[np.uint8], u: Indices, rough: Indices, inward: int) -> Array:
    """The row of the edge in each column u, near the rough one; at the picture's edge, that edge."""
    end = len(image) - 1
    index = np.clip(rough[:, None] + inward * np.arange(-_R, _R + 1), 0, end)
    fine = rough + inward * _crossing(image[index, u[:, None]].astype(float))
    return np.where(rough == (0 if inward == 1 else end), rough - 0.5 * inward, fine)


def _crossing(lines: Array) -> Array:
    """Where lines of colours (n, 2 R + 1, 3) change from their outer to their inner end; 0 is their middle sample.

    The share of inner colour, summed up, tells how far the inside reaches: exact for any symmetric blur.
    """
    outer, inner = lines[:, :2].mean(axis=1), lines[:, _R + 2 : _R + 4].mean(axis=1)
    change = inner - outer
    scale = np.maximum(np.einsum("ni,ni->n", change, change), 1e-9)
    share = np.einsum("nki,ni->nk", lines - outer[:, None], change) / scale[:, None]
    return 2.5 - share[:, 1 : _R + 3].clip(-0.2, 1.2).sum(axis=1)


def _beside(other: NDArray[np.uint8], u: float, bottom: float, outward: int) -> bool:
    """Does another landmark stand right beside the edge at column u, as low as this one's bottom or lower?"""
    columns = round(u) + outward * np.array([2, 3])
    rows = np.clip(round(bottom) - np.arange(3), 0, len(other) - 1)
    columns = columns[(columns >= 0) & (columns < other.shape[1])]
    return bool(columns.size and other[np.ix_(rows, columns)].mean() > 0.3 * 255)


def _below(other: NDArray[np.uint8], u: Indices, bottom: Array) -> bool:
    """Does another landmark show just below this one's bottom?  It cannot be behind."""
    rows = np.floor(bottom).astype(int)[:, None] + [2, 3]
    seen = rows < len(other)
    return bool(np.any(seen)) and float(np.mean(other[np.clip(rows, 0, len(other) - 1), u[:, None]][seen])) > 0.1 * 255


def _floor(image: NDArray[np.uint8], u: Indices, bottom: Array) -> Array:
    """The mean colour just below the bottom, (3,)."""
    rows = np.floor(bottom).astype(int)[:, None] + [2, 3, 4]
    return np.asarray(image[np.clip(rows, 0, len(image) - 1), u[:, None]].mean(axis=(0, 1)))


def _edge_goes_on(image: NDArray[np.uint8], u: float, bottom: float, outward: int, floor: Array) -> bool:
    """Does a side go on below the bottom, where on both sides of it there should be floor?"""
    columns = round(u) + outward * np.array([2, 3])
    rows = round(bottom) + np.array([2, 3, 4, 5])
    columns, rows = columns[(columns >= 0) & (columns < image.shape[1])], rows[rows < len(image)]
    if not columns.size or not rows.size:
        return False
    change = image[np.ix_(rows, columns)].mean(axis=(0, 1)) - floor
    return bool(np.abs(change).max() > 0.25 * floor.mean() + 3)
