r"""Four parameters from pairs of points: a turn, a scale and a shift, with heavy-tailed residuals."""

from __future__ import annotations

import numpy as np

from coursekit.geometry import Array

FREEDOM = 4.0  # of the t-distribution that residuals follow: tails heavier than a Gaussian's
LEAST = 1e-12  # px²: exact pairs leave no residual at all


def fit_similarity(source: Array, target: Array, iterations: int = 8) -> tuple[Array, Array, float]:
    r"""The [a, b, x, y] of target = [[a, -b], [b, a]] source + [x, y], under t-distributed residuals.

    Expectation maximisation: w = (ν + 2)/(ν + r²/s²), then weighted least squares and s² = Σ w r²/2n.  The
    covariance is the inverse of the t-distribution's Fisher information, s² (ν + 4)/(ν + 2) (AᵀA)⁻¹.

    source, target (n, 2), n > 2.  Returns parameters (4,), covariance (4, 4), rms of the residuals.

    Source: Lange, Little & Taylor (1989), sections 3 and 4.
    """
    n = len(source)
    u, v = source.T
    one, zero = np.ones(n), np.zeros(n)
    A = np.stack([np.stack([u, -v, one, zero], axis=-1), np.stack([v, u, zero, one], axis=-1)], axis=1)
    w = np.ones(n)
    for _ in range(iterations):
        weighted = w[:, None, None] * A
        parameters = np.linalg.solve(np.einsum("nij,nik->jk", weighted, A), np.einsum("nij,ni->j", weighted, target))
        squared = np.sum((target - A @ parameters) ** 2, axis=1)
        s2 = max(np.mean(w * squared) / 2, LEAST)
        w = (FREEDOM + 2) / (FREEDOM + squared / s2)
    information = np.einsum("nij,nik->jk", A, A)
    cov = s2 * (FREEDOM + 4) / (FREEDOM + 2) * n / (n - 2) * np.linalg.solve(information, np.eye(4))
    return parameters, cov, float(np.sqrt(squared.mean()))


def scale_of(squared: Array, least: float = LEAST, iterations: int = 8) -> float:
    """s² that makes squared lengths (n,) of two-dimensional residuals likeliest under the t-distribution, px²."""
    s2 = max(float(np.mean(squared)) / 2, least)
    for _ in range(iterations):
        s2 = max(float(np.mean((FREEDOM + 2) / (FREEDOM + squared / s2) * squared)) / 2, least)
    return s2


def log_likelihood(squared: Array, least: float = LEAST) -> float:
    """log density, in nats, of residuals with these squared lengths (n,), for the best scale s² ≥ ``least``."""
    s2 = scale_of(squared, least)
    return float(-np.sum(np.log(2 * np.pi * s2) + (FREEDOM + 2) / 2 * np.log1p(squared / (FREEDOM * s2))))
