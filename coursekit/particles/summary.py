"""What a cloud says (mean, covariance, how many bins it fills) and how to keep it varied."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from coursekit.doors import LARGEST, as_numbers, count, generator, number
from coursekit.gaussian import Gaussian, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.particles.cloud import Particles

_CANCELLED = 1e-12  # a mean unit vector so short is made of rounding errors


def mean(cloud: Particles) -> Array:
    """The weighted mean, (d,); along ``cloud.angles`` the direction of the mean unit vector, in (-π, π].

    Raises ValueError where that vector is zero, as of 0 and π with equal weights: headings that cancel out have no
    mean; and for three columns without ``angles``, see ``Particles``.  TypeError for what is not a cloud.

    >>> cloud = Particles([[0.0, 0.0, np.pi - 0.1], [2.0, 0.0, 0.1 - np.pi]], angles=(2,))
    >>> np.abs(mean(cloud)).round(3).tolist()  # ±π is one heading
    [1.0, 0.0, 3.142]
    """
    centre, lengths = _centre(cloud)
    for column, length in lengths.items():
        if length < _CANCELLED:
            raise ValueError(f"angles: the headings in column {column} cancel out, and have no mean direction: their "
                             f"mean unit vector has the length {length:.1g}")  # fmt: skip
    return centre


def covariance(cloud: Particles) -> Array:
    """Σ w⁽ⁱ⁾ e⁽ⁱ⁾ e⁽ⁱ⁾ᵀ with e = x - mean, angles wrapped: (d, d), symmetric, positive *semi*definite.

    Raises as ``mean`` does.

    >>> covariance(Particles([[0.0], [2.0]])).tolist()
    [[1.0]]
    """
    e = _deviations(cloud, mean(cloud))
    return symmetrize((cloud.weights * e.T) @ e)


def as_gaussian(cloud: Particles) -> Gaussian:
    """The Gaussian with the cloud's mean and covariance, to ask for its NEES.

    Raises ValueError when the cloud is too thin to have one, with fewer than d + 1 distinct states; else as ``mean``.

    >>> as_gaussian(Particles([[0.0], [2.0]])).mean.tolist()
    [1.0]
    """
    return Gaussian(mean(cloud), covariance(cloud))


def roughen(cloud: Particles, rng: np.random.Generator, scale: float = 0.2) -> Particles:
    """Roughening: add N(0, σⱼ²) to column j, σⱼ = scale · (its extent) · n^(-1/d), so that copies differ again.

    The noise comes from no model: it buys variety at the price of a wider belief.

    Raises ValueError for a scale that is negative or not finite; TypeError for what is not a cloud or a Generator.

    >>> cloud = roughen(Particles([[0.0], [0.0], [1.0]]), np.random.default_rng(1))
    >>> len(np.unique(cloud.states))
    3

    Source: Gordon, Salmond & Smith (1993), section 4.
    """
    generator(rng)
    if not 0 <= number(scale, "scale") < LARGEST:
        raise ValueError(f"scale: expected a number ≥ 0, got {scale}")
    centre, _ = _centre(cloud)
    n, d = cloud.states.shape
    sigma = scale * np.ptp(_deviations(cloud, centre), axis=0) * n ** (-1 / d)
    states = cloud.states + rng.standard_normal((n, d)) * sigma
    for column in _angles(cloud):
        states[:, column] = wrap_angle(states[:, column])
    return Particles(states, cloud.log_weights, angles=cloud.angles)


def kld_size(bins: int, error: float = 0.05, confidence: float = 0.99) -> int:
    """Particles needed so that, with probability ``confidence``, the cloud's histogram over ``bins`` occupied
    bins is within ``error`` nats (Kullback-Leibler) of the belief it was drawn from.

    bins : how many bins hold a particle, ≥ 1.     error : in nats, > 1e-9.     confidence : in (0, 1).

    Raises ValueError for others.

    >>> kld_size(1), kld_size(100)
    (1, 1347)

    Source: Fox (2003), eq. 7, the Wilson-Hilferty approximation of a chi-square quantile.
    """
    bins = count(bins, "bins")
    if not number(error, "error") > 1e-9 or not 0 < number(confidence, "confidence") < 1:
        raise ValueError(
            "expected bins ≥ 1, error > 1e-9 and confidence in (0, 1), "
            f"got bins={bins}, error={error}, confidence={confidence}"
        )
    if bins == 1:
        return 1
    spread = 2 / (9 * (bins - 1))
    needed = np.ceil((bins - 1) / (2 * error) * (1 - spread + np.sqrt(spread) * ndtri(confidence)) ** 3)
    return max(1, int(needed))


def occupied_bins(states: ArrayLike, bin_size: ArrayLike) -> int:
    """How many boxes of a grid hold a state.

    states : (n, d), finite.     bin_size : > 0, one for all or (d,), in the states' units.

    Raises ValueError for others.

    >>> occupied_bins([[0.1, 0.1], [0.2, 0.3], [5.0, 5.0]], 1.0)
    2
    """
    states, bin_size = as_numbers(states, "states"), as_numbers(bin_size, "bin_size")
    if not np.all((bin_size > 1 / LARGEST) & (bin_size < LARGEST)):
        raise ValueError(f"bin_size: expected finite numbers > 0, got {bin_size}")
    if states.ndim != 2 or not np.all(np.abs(states) < LARGEST):
        raise ValueError(f"states: expected finite numbers of shape (n, d), got {states} of shape {states.shape}")
    if bin_size.shape not in ((), states.shape[1:]):
        raise ValueError(f"bin_size: expected one number or shape {states.shape[1:]}, got {bin_size.shape}")
    return len(np.unique(np.floor(states / bin_size), axis=0))


def _angles(cloud: Any) -> tuple[int, ...]:
    if not isinstance(cloud, Particles):
        raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
    if cloud.angles is None:
        raise ValueError("angles: a cloud of three columns may hold poses [x, y, θ] or points [x, y, z], whose means "
                         "differ: give Particles angles=(2,) or angles=()")  # fmt: skip
    return cloud.angles


def _centre(cloud: Particles) -> tuple[Array, dict[int, float]]:
    """The mean, and for each column of angles the length of its mean unit vector, from 0 to 1."""
    columns, lengths = _angles(cloud), {}
    w, centre = cloud.weights, np.einsum("n,nd->d", cloud.weights, cloud.states)
    for column in columns:
        angle = cloud.states[:, column]
        sine, cosine = (w * np.sin(angle)).sum(), (w * np.cos(angle)).sum()
        centre[column], lengths[column] = np.arctan2(sine, cosine), float(np.hypot(sine, cosine))
    return centre, lengths


def _deviations(cloud: Particles, centre: Array) -> Array:
    e = cloud.states - centre
    for column in _angles(cloud):
        e[:, column] = wrap_angle(e[:, column])
    return e
