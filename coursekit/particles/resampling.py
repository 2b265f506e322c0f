r"""Resampling: weights in, indices out; and the effective sample size of a set of weights.

Lay the weights end to end, as intervals of [0, 1].  Each method chooses n positions in [0, 1] and returns the index
of the interval under each.  All copy particle i  n·wᵢ  times *on average*; they differ in how far a single draw
strays from that.  Weights need not be normalised.  All raise ValueError, with what and where, for weights that are
empty, negative, not finite or all zero, and for a ``size`` below one; TypeError for what is no Generator.

Source: Douc, Cappé & Moulines (2005) compare them; Hol, Schön & Gustafsson (2006) time them.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.doors import as_numbers, count, generator
from coursekit.geometry import Array

Indices = NDArray[np.intp]


class Resampler(Protocol):
    """What ``particles.resample`` takes as its method: n weights → ``size`` indices."""

    def __call__(self, weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices: ...


def effective_sample_size(weights: ArrayLike) -> float:
    """(Σw)²/Σw²: how many equally weighted particles would be as good.  From 1 to n.

    weights : (n,), finite, ≥ 0, not all zero; they need not sum to one.  Raises ValueError for others.

    >>> round(effective_sample_size([0.5, 0.5, 0.0, 0.0]), 12)
    2.0

    Source: Kong, Liu & Wong (1994).
    """
    weights = _check_weights(weights)
    return float(weights.sum() ** 2 / np.square(weights).sum())


def systematic(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Systematic resampling: evenly spaced positions (k + u)/n, k = 0 … n-1, with one uniform u for all.

    Particle i is copied ⌊n wᵢ⌋ or ⌊n wᵢ⌋ + 1 times, the least spread that an unbiased draw can have.  O(n).

    Parameters
    ----------
    weights : (n,), finite, ≥ 0, not all zero; they need not sum to one.
    size : how many indices to draw; as many as weights by default.

    Returns ascending indices, (size,).  Raises ValueError for weights or a size that cannot be.

    >>> systematic([0.1, 0.2, 0.3, 0.4], np.random.default_rng(1)).tolist()
    [1, 2, 3, 3]

    Source: Carpenter, Clifford & Fearnhead (1999); Kitagawa (1996).
    """
    cumulative, rng = _cumulative(weights), generator(rng)
    n = _size(cumulative, size)
    return _interval_of_position((cumulative * n + rng.random()).astype(np.intp), n)


def stratified(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Stratified resampling: one independent uniform position in each of n equal parts of [0, 1].

    Parameters and result as for ``systematic``; raises as it does.

    >>> stratified([0.1, 0.2, 0.3, 0.4], np.random.default_rng(1)).tolist()
    [1, 2, 2, 3]

    Source: Kitagawa (1996).
    """
    cumulative, rng = _cumulative(weights), generator(rng)
    n = _size(cumulative, size)
    whole = (cumulative * n).astype(np.intp)
    positions = np.append(rng.random(n), 1.0)  # each within its own part; nothing lies beyond the last
    return _interval_of_position(whole + (positions[whole] < cumulative * n - whole), n)


def multinomial(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Multinomial resampling: independent draws with replacement, the baseline that the others improve on.

    Sorted uniforms come from the spacings of a Poisson process, which saves the sort.
    Parameters and result as for ``systematic``; raises as it does.

    >>> multinomial([0.0, 1.0], np.random.default_rng(1)).tolist()
    [1, 1]

    Source: Gordon, Salmond & Smith (1993); Devroye (1986), section V.3.
    """
    cumulative, rng = _cumulative(weights), generator(rng)
    arrivals = np.cumsum(rng.standard_exponential(_size(cumulative, size) + 1))
    return _interval_with(cumulative, arrivals[:-1] / arrivals[-1])


def residual(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Residual resampling: ⌊n wᵢ⌋ copies for certain, independent draws from n wᵢ - ⌊n wᵢ⌋ for the rest.

    Parameters as for ``systematic``, raises as it does; the indices are in two ascending runs.

    >>> residual([0.5, 0.5, 0.0, 0.0], np.random.default_rng(1)).tolist()
    [0, 0, 1, 1]

    Source: Liu & Chen (1998), section 3.2.
    """
    weights, rng = _check_weights(weights), generator(rng)
    expected = weights * (_size(weights, size) / weights.sum())
    certain = np.floor(expected)
    left = _size(weights, size) - int(certain.sum())
    copies = np.repeat(np.arange(weights.size), certain.astype(np.intp))
    return np.concatenate([copies, multinomial(expected - certain, rng, left)]) if left > 0 else copies


def wheel(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """The resampling wheel: uniform strides of up to twice the largest weight around a circle of weights.

    From a uniform start every position is uniform on the circle, so the draw is unbiased.  As commonly taught it
    starts at the edge of a random *interval*, and is biased: Lab 7 shows it.  Successive positions are correlated,
    so its variance is not small: it is here because it is widespread.
    Parameters as for ``systematic``, raises as it does; the indices come in the order of the positions.

    >>> wheel([0.0, 1.0], np.random.default_rng(1)).tolist()
    [1, 1]

    Source: Thrun (2012), Udacity CS373, unit 3.
    """
    weights, rng = _check_weights(weights), generator(rng)
    longest = 2 * weights.max() / weights.sum()
    travelled = np.cumsum(rng.random(_size(weights, size)) * longest)
    return _interval_with(_cumulative(weights), np.mod(rng.random() + travelled, 1.0))


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
    "wheel": wheel,
}
"""The five by name; ``particles.resample`` takes the names, too."""


def _interval_of_position(below: Indices, n: int) -> Indices:
    """For each of n ascending positions, the index of the weight interval that contains it.

    below : (weights,), how many positions lie below each interval's upper end.  The interval of position k is the
        number of upper ends at or below it; counting them costs a quarter of ``np.repeat``.  Ends past the last
        position, where rounding may put the final ones, are not counted.
    """
    return np.cumsum(np.bincount(below, minlength=n + 1)[:n])


def _interval_with(cumulative: Array, positions: Array) -> Indices:
    """The same for positions in [0, 1) in any order, by a search; an interval of width zero contains none."""
    return np.searchsorted(cumulative, np.minimum(positions, np.nextafter(1.0, 0.0)), side="right")


def _cumulative(weights: ArrayLike) -> Array:
    """Cumulative weights, (n,), ending at exactly one *from the last positive weight on*."""
    cumulative = np.cumsum(_check_weights(weights))
    cumulative /= cumulative[-1]
    return cumulative


def _size(weights: Array, size: Any) -> int:
    return weights.size if size is None else count(size, "size")


def _check_weights(weights: ArrayLike) -> Array:
    weights = as_numbers(weights, "weights")
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
