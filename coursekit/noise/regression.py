"""Regression whose noise is part of the question: mean and spread fitted together, by maximum likelihood.

Source: Carroll & Ruppert (1988), chapters 2-3 (variance functions, joint maximum likelihood by scoring).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from coursekit.geometry import Array

STEEPEST = 4.0  # powers lie between 0 and this; a pixel of noise grows as the square
STARTS = (0.5, 2.0)  # powers; the spread may have more than one optimum


class Spread(NamedTuple):
    """A standard deviation that grows with x ≥ 0: σ(x)² = floor² + (scale · x^power)².

    >>> round(float(Spread(floor=3.0, scale=2.0, power=1.0)(2.0)), 6)
    5.0
    """

    floor: float
    scale: float
    power: float

    def __call__(self, x: ArrayLike) -> Array:
        """σ at x, in the unit of ``floor``, of x's shape."""
        return np.hypot(self.floor, self.scale * np.power(np.asarray(x, dtype=float), self.power))


class Fit(NamedTuple):
    """The maximum of a ``fit`` with k coefficients and m outputs of n samples."""

    beta: Array  # (k,)
    spreads: list[Spread]  # one for each output
    jitter: float
    residuals: Array  # (m, n): what is left, in units of its σ
    information: Array  # (m, k, k): what each output says about beta, Jᵀ diag(1/σ²) J, were its samples independent
    spread_errors: Array  # (3 m + 1,): standard errors of floor, scale, power, …, jitter, were the samples independent


class _Point(NamedTuple):
    value: float  # the negative log posterior
    gradient: Array
    information: Array  # Fisher's, plus the prior's
    z: Array  # (m, n)
    J: Array  # (m, n, k): the prediction's Jacobian, in units of σ


Mean = Callable[[Array], tuple[Array, Array]]


def fit(y: Array, mean: Mean, x: Array, rate: Array, least: Array, prior: Array) -> Fit:
    """Maximise Σ log N(y; mean(β), σ²) and the log of a Gaussian prior, over β and what makes up σ:

        σ² = least² + spread(x)² + (jitter · rate)²,     a ``Spread`` for each output, one jitter for all.

    The optimiser is SciPy's trust region, with the Fisher information as the Hessian, so that each step is weighted
    least squares.  It climbs from several starts, since a spread may have more than one optimum.

    Parameters
    ----------
    y : (m, n) outputs.     x : (m, n) what each output's spread grows with, ≥ 0.
    mean : β (k,) → prediction (m, n) and Jacobian (m, n, k); NaN where there is none; there must be one at β = 0.
    rate : (m, n) how fast the outputs change, per second.
    least : (m,) a spread that nothing goes below, in the unit of y.
    prior : (k + 3 m + 1, 2) mean and standard deviation of β, of each output's log floor, log scale and power's logit,
        and of the log jitter.

    Raises RuntimeError when no start comes within a hundredth of a nat per sample of a maximum.
    """
    m, n = y.shape
    k = len(prior) - 3 * m - 1
    log_x = np.log(np.where(x > 0, x, 1.0))
    center, width = prior.T

    def at(q: Array) -> _Point:
        """q (k + 3 m + 1,): the parameters in standard deviations of their prior."""
        p = center + width * q
        predicted, J = mean(p[:k])
        logs = np.clip(p[k:], -50, 50)
        log_floor, log_scale, logit = logs[:-1].reshape(m, 3).T[..., None]
        floor = np.exp(2 * log_floor) + 0 * x
        grown = np.where(x > 0, np.exp(np.clip(2 * (log_scale + _power(logit) * log_x), -500, 500)), 0.0)
        shaken = np.exp(2 * logs[-1]) * rate**2
        variance = least[:, None] ** 2 + floor + grown + shaken
        z, J = (y - predicted) / np.sqrt(variance), J / np.sqrt(variance)[..., None]
        L = np.zeros((m, n, len(p) - k))  # ∂ log σ
        for i in range(m):
            L[i, :, 3 * i : 3 * i + 3] = np.stack([floor[i], grown[i], grown[i] * log_x[i] * _slope(logit[i])], axis=-1)
        L[..., -1] = shaken
        L /= variance[..., None]
        value = 0.5 * float(np.sum(np.log(variance) + z**2) + q @ q)
        if not np.isfinite(value):
            return _Point(np.inf, q, np.eye(len(q)), z, J)
        flat_J, flat_L = J.reshape(m * n, k), L.reshape(m * n, len(p) - k)
        gradient = -np.concatenate([flat_J.T @ z.ravel(), flat_L.T @ (z**2 - 1).ravel()])
        information = np.zeros((len(p), len(p)))
        information[:k, :k], information[k:, k:] = flat_J.T @ flat_J, 2 * flat_L.T @ flat_L
        return _Point(value, width * gradient + q, np.outer(width, width) * information + np.eye(len(p)), z, J)

    rough = np.sqrt(np.mean((y - mean(np.zeros(k))[0]) ** 2, axis=1)) + least  # β still has everything to explain
    found: list[tuple[float, int, Array]] = []
    for power in STARTS:
        logit = np.full(m, np.log(power / (STEEPEST - power)))
        spreads = np.stack([np.log(0.3 * rough), np.log(rough) - power * np.mean(log_x, axis=1), logit], axis=-1)
        start = (np.concatenate([np.zeros(k), spreads.ravel(), center[-1:]]) - center) / width
        q = minimize(lambda q: at(q)[:2], start, jac=True, hess=lambda q: at(q).information, method="trust-exact",
                     options={"gtol": 1e-3, "maxiter": 300}).x  # fmt: skip
        best = at(q)
        if 0.5 * best.gradient @ np.linalg.solve(best.information, best.gradient) < 0.01 * n:  # what is left to gain
            found.append((best.value, len(found), q))
    if not found:
        raise RuntimeError(f"the fit did not converge from any start, on {n} samples")
    q = min(found)[2]
    best, p = at(q), center + width * q
    sizes, slopes = np.exp(p[k:]), np.exp(p[k:])
    sizes[2:-1:3], slopes[2:-1:3] = _power(p[k + 2 : -1 : 3]), _slope(p[k + 2 : -1 : 3])
    of_logs = (width * np.sqrt(np.diag(np.linalg.solve(best.information, np.eye(len(p))))))[k:]
    return Fit(
        p[:k],
        [Spread(*map(float, sizes[3 * i : 3 * i + 3])) for i in range(m)],
        float(sizes[-1]),
        best.z,
        best.J.transpose(0, 2, 1) @ best.J,
        slopes * of_logs,
    )


def fit_spread(residuals: Array, x: Array, rate: Array, least: Array, prior: Array) -> Fit:
    """The spread of residuals (m, n) around zero: ``fit`` with nothing to predict."""
    nothing = np.zeros(residuals.shape), np.zeros((*residuals.shape, 0))
    return fit(residuals, lambda beta: nothing, x, rate, least, prior)


def _power(logit: ArrayLike) -> Array:
    return STEEPEST / (1 + np.exp(-np.asarray(logit)))


def _slope(logit: ArrayLike) -> Array:
    """Of the power, by its logit."""
    power = _power(logit)
    return power * (1 - power / STEEPEST)
