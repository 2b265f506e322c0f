r"""Weights in, indices out: five ways to draw a cloud again, and how much a cloud of weights is worth.

Each method copies particle i  n·wᵢ  times *on average*; they differ in how far one draw strays from that.  Weights
need not be normalised.  All refuse, with a ValueError that says what and where, weights that are empty, negative,
not finite or all zero, and a ``size`` below one.

Source: Douc, Cappé & Moulines (2005) compare them; Hol, Schön & Gustafsson (2006) time them.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.geometry import Array

Indices = NDArray[np.intp]


class Resampler(Protocol):
    """Anything that turns n weights into ``size`` indices; ``particles.resample`` takes it as its method."""

    def __call__(self, weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices: ...


def effective_sample_size(weights: ArrayLike) -> float:
    """(Σw)²/Σw²: how many equally weighted particles would be as good.  From 1 to n.

    Source: Kong, Liu & Wong (1994).

    >>> round(effective_sample_size([0.5, 0.5, 0.0, 0.0]), 12)
    2.0
    """
    weights = _check_weights(weights)
    return float(weights.sum() ** 2 / np.square(weights).sum())


def systematic(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Lay one comb of evenly spaced teeth over the weights: particle i is copied ⌊nwᵢ⌋ or ⌊nwᵢ⌋+1 times.

    One random number for the whole draw, O(n).  Returns ``size`` ascending indices (default: as many as weights).

    Source: Carpenter, Clifford & Fearnhead (1999); Kitagawa (1996).
    """
    rim = _rim(weights)
    n = _places(rim, size)
    return _under((rim * n + rng.random()).astype(np.intp), n)


def stratified(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """The comb with each tooth placed at random within its own 1/n.  Source: Kitagawa (1996)."""
    rim = _rim(weights)
    n = _places(rim, size)
    whole = (rim * n).astype(np.intp)
    teeth = np.append(rng.random(n), 1.0)  # each within its own stratum; nothing lies beyond the last
    return _under(whole + (teeth[whole] < rim * n - whole), n)


def multinomial(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Independent draws, with replacement: the baseline that every other method improves on.

    Sorted uniforms come from the spacings of a Poisson process, which saves the sort.  Ascending indices.
    Source: Gordon, Salmond & Smith (1993); Devroye (1986), section V.3.
    """
    rim = _rim(weights)
    arrivals = np.cumsum(rng.standard_exponential(_places(rim, size) + 1))
    return _spin(rim, arrivals[:-1] / arrivals[-1])


def residual(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """⌊nwᵢ⌋ copies for certain; the places left over by independent draws from what was cut off.

    Source: Liu & Chen (1998), section 3.2.
    """
    weights = _check_weights(weights)
    expected = weights * (_places(weights, size) / weights.sum())
    certain = np.floor(expected)
    left = _places(weights, size) - int(certain.sum())
    copies = np.repeat(np.arange(weights.size), certain.astype(np.intp))
    return np.concatenate([copies, multinomial(expected - certain, rng, left)]) if left > 0 else copies


def wheel(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Roll along the rim of a wheel whose slices are the weights, by up to twice the largest at a time.

    Started anywhere on the rim, each stop is uniform on it, so the draw is unbiased.  (As commonly taught it
    starts at the edge of a random *slice*, and is not: Lab 7's exhibit.)  Its stops hang together, so its
    variance is not small: it is here because so many use it.  Source: Thrun (2012), Udacity CS373, unit 3.
    """
    weights = _check_weights(weights)
    step = 2 * weights.max() / weights.sum()
    travelled = np.cumsum(rng.random(_places(weights, size)) * step)
    return _spin(_rim(weights), np.mod(rng.random() + travelled, 1.0))


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
    "wheel": wheel,
}


def _under(below: Indices, n: int) -> Indices:
    """The slice under each of n teeth, from how many teeth lie below each slice's upper edge.

    Tooth k lies in slice i when i edges lie at or below it: counting edges costs a quarter of ``np.repeat``.
    Edges past the last tooth, where rounding may put those of the end, are not counted.
    """
    return np.cumsum(np.bincount(below, minlength=n + 1)[:n])


def _spin(rim: Array, stops: Array) -> Indices:
    """The slice that holds each stop in [0, 1); a slice of width zero holds none."""
    return np.searchsorted(rim, np.minimum(stops, np.nextafter(1.0, 0.0)), side="right")


def _rim(weights: ArrayLike) -> Array:
    """Cumulative weights, (n,), ending at exactly one *from the last positive weight on*."""
    rim = np.cumsum(_check_weights(weights))
    rim /= rim[-1]
    return rim


def _places(weights: Array, size: int | None) -> int:
    if size is not None and size < 1:
        raise ValueError(f"size: expected at least one place to fill, got {size}")
    return weights.size if size is None else size


def _check_weights(weights: ArrayLike) -> Array:
    weights = np.asarray(weights, dtype=float)
    if weights.ndim != 1 or weights.size == 0:
        raise ValueError(f"weights: expected shape (n,) with n ≥ 1, got {weights.shape}")
    low, high = weights.min(), weights.max()
    if not (low >= 0 and np.isfinite(high)):
        wrong = int(np.argmin((weights >= 0) & np.isfinite(weights)))
        raise ValueError(f"weights: expected finite numbers ≥ 0, got {weights[wrong]} at index {wrong}")
    if high == 0:
        raise ValueError(f"weights: expected a sum > 0, got {weights.size} weights that are all zero")
    # Far from one, sums and squares would over- or underflow.
    return weights if 1e-50 < high < 1e50 else weights / high
