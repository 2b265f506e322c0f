"""What a cloud says (mean, covariance, how many bins it fills) and how to keep it varied."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm

from coursekit.gaussian import Gaussian, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.particles.cloud import Particles


def mean(cloud: Particles) -> Array:
    """The weighted mean, (d,); along ``cloud.angles`` the direction of the mean unit vector, in (-π, π]."""
    w, centre = cloud.weights, np.einsum("n,nd->d", cloud.weights, cloud.states)
    for column in cloud.angles:
        angle = cloud.states[:, column]
        centre[column] = np.arctan2((w * np.sin(angle)).sum(), (w * np.cos(angle)).sum())
    return centre


def covariance(cloud: Particles) -> Array:
    """Σ w⁽ⁱ⁾ e⁽ⁱ⁾ e⁽ⁱ⁾ᵀ with e = x - mean, angles wrapped: (d, d), symmetric, positive *semi*definite."""
    e = _deviations(cloud)
    return symmetrize((cloud.weights * e.T) @ e)


def as_gaussian(cloud: Particles) -> Gaussian:
    """The Gaussian with the cloud's mean and covariance, to ask for its NEES.

    Raises ValueError when the cloud is too thin to have one: fewer than d + 1 distinct states.
    """
    return Gaussian(mean(cloud), covariance(cloud))


def roughen(cloud: Particles, rng: np.random.Generator, scale: float = 0.2) -> Particles:
    """Shake the copies apart: N(0, σⱼ²) on column j, σⱼ = scale · (its extent) · n^(-1/d).

    It invents noise that no model asked for, in exchange for variety.  Source: Gordon et al. (1993), section 4.
    """
    if not (np.isfinite(scale) and scale >= 0):
        raise ValueError(f"scale: expected a number ≥ 0, got {scale}")
    n, d = cloud.states.shape
    sigma = scale * np.ptp(_deviations(cloud), axis=0) * n ** (-1 / d)
    states = cloud.states + rng.standard_normal((n, d)) * sigma
    for column in cloud.angles:
        states[:, column] = wrap_angle(states[:, column])
    return Particles(states, cloud.log_weights, angles=cloud.angles)


def kld_size(bins: int, error: float = 0.05, confidence: float = 0.99) -> int:
    """Particles needed so that, with probability ``confidence``, the cloud's histogram over ``bins`` occupied
    bins is within ``error`` nats (Kullback-Leibler) of the belief it was drawn from.

    Source: Fox (2003), eq. 7, the Wilson-Hilferty approximation of a chi-square quantile.
    """
    if not bins >= 1 or not error > 0 or not 0 < confidence < 1:
        raise ValueError(
            "expected bins ≥ 1, error > 0 and confidence in (0, 1), "
            f"got bins={bins}, error={error}, confidence={confidence}"
        )
    if bins == 1:
        return 1
    spread = 2 / (9 * (bins - 1))
    needed = np.ceil((bins - 1) / (2 * error) * (1 - spread + np.sqrt(spread) * norm.ppf(confidence)) ** 3)
    return max(1, int(needed))


def occupied_bins(states: ArrayLike, bin_size: ArrayLike) -> int:
    """How many boxes of a grid hold a state: states (n, d), bin_size (d,) or one for all, in the states' units."""
    states, bin_size = np.asarray(states, dtype=float), np.asarray(bin_size, dtype=float)
    if not np.all(bin_size > 0):
        raise ValueError(f"bin_size: expected numbers > 0, got {bin_size}")
    if states.ndim != 2 or not np.isfinite(states).all():
        raise ValueError(f"states: expected finite numbers of shape (n, d), got {states} of shape {states.shape}")
    return len(np.unique(np.floor(states / bin_size).astype(np.int64), axis=0))


def _deviations(cloud: Particles) -> Array:
    e = cloud.states - mean(cloud)
    for column in cloud.angles:
        e[:, column] = wrap_angle(e[:, column])
    return e
