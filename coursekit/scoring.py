"""Regression whose noise is part of the question: mean and spread fitted together, by maximum likelihood.

Source: Carroll & Ruppert (1988), chapters 2-3; Efron & Hinkley (1978) for the observed information.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array

STEEPEST = 4.0  # powers lie between 0 and this; a pixel of noise grows as the square


class Spread(NamedTuple):
    """A standard deviation that grows with x ≥ 0: σ(x)² = floor² + (scale · x^power)²."""

    floor: float
    scale: float
    power: float

    def __call__(self, x: ArrayLike) -> Array:
        return np.hypot(self.floor, self.scale * np.power(np.asarray(x, dtype=float), self.power))


class Fit(NamedTuple):
    """The maximum: coefficients (k,) of the mean, the spread, the covariance (k + 3, k + 3) of
    [coefficients, floor, scale, power] for independent samples, and the standardised residuals (n,)."""

    beta: Array
    spread: Spread
    cov: Array
    residuals: Array


class _Terms(NamedTuple):
    value: float  # log-likelihood plus log prior
    gradient: Array
    information: Array  # Fisher's, plus the prior's
    residuals: Array


Mean = Callable[[Array], "tuple[Array, Array] | None"]


def fit(y: Array, mean: Mean, x: Array, least: float, prior: Array) -> Fit:
    """Maximise Σ log N(y; mean(β), σ(x)²) over β and σ = ``Spread`` ⊕ ``least``, by damped scoring.

    Each step is weighted least squares for β, with weights 1/σ², and the same for log σ, whose "measurements" are
    the squared residuals.  It climbs from several starts, since the spread may have more than one summit.

    Parameters
    ----------
    y : (n,) what is predicted.     x : (n,) what the spread grows with, ≥ 0.
    mean : β (k,) → prediction (n,) and Jacobian (n, k), or None where there is none; there must be one at β = 0.
    least : a spread that nothing goes below, in the unit of y.
    prior : (k + 3, 2) mean and standard deviation for β, log floor, log scale, and the power's logit.

    Raises RuntimeError when no start comes within a hundredth of a nat per sample of a maximum.
    """
    k = len(prior) - 3
    log_x = np.log(np.where(x > 0, x, 1.0))

    def terms(p: Array) -> _Terms | None:
        predicted = mean(p[:k])
        if predicted is None or np.any(np.abs(p[k:]) > 50):
            return None
        floor, power = np.exp(2 * p[k]), _power(p[k + 2])
        grown = np.where(x > 0, np.exp(np.minimum(2 * (p[k + 1] + power * log_x), 500)), 0.0)
        variance = least**2 + floor + grown
        z = (y - predicted[0]) / np.sqrt(variance)
        J = predicted[1] / np.sqrt(variance)[:, None]
        L = (
            np.stack([np.full_like(x, floor), grown, grown * log_x * _power_slope(power)], axis=-1) / variance[:, None]
        )  # ∂ log σ
        off = (p - prior[:, 0]) / prior[:, 1]
        information = np.diag(prior[:, 1] ** -2.0)
        information[:k, :k] += J.T @ J
        information[k:, k:] += 2 * L.T @ L
        value = -0.5 * float(np.sum(np.log(variance) + z**2) + off @ off)
        return _Terms(value, np.concatenate([J.T @ z, L.T @ (z**2 - 1)]) - off / prior[:, 1], information, z)

    blank = mean(np.zeros(k))
    assert blank is not None
    rough = float(np.sqrt(np.mean((y - blank[0]) ** 2))) + least  # β still has everything to explain
    summits = []
    for power in (0.5, 1.0, 2.0):
        for share in (0.03, 0.7):  # how much of the rough spread is floor
            scale = np.log(rough) - power * np.mean(log_x)
            start = np.concatenate([np.zeros(k), [np.log(share * rough), scale, np.log(power / (STEEPEST - power))]])
            if (top := _climb(terms, start, near_enough=0.01 * len(y))) is not None:
                summits.append(top)
    if not summits:
        raise RuntimeError(f"the fit did not converge from any start, on {len(y)} samples")
    p, best = max(summits, key=lambda summit: summit[1].value)
    spread = Spread(float(np.exp(p[k])), float(np.exp(p[k + 1])), float(_power(p[k + 2])))
    J = np.diag([*np.ones(k), spread.floor, spread.scale, _power_slope(spread.power)])  # by what was fitted
    return Fit(p[:k], spread, J @ _covariance(terms, p, best.information) @ J, best.residuals)


def fit_spread(residuals: Array, x: Array, least: float, prior: Array) -> Fit:
    """``fit`` with nothing to predict: the spread (its three parameters' prior) of residuals around zero."""
    nothing = np.zeros(len(residuals)), np.zeros((len(residuals), 0))
    return fit(residuals, lambda beta: nothing, x, least, prior)


def _climb(terms: Callable[[Array], _Terms | None], p: Array, near_enough: float) -> tuple[Array, _Terms] | None:
    """Levenberg's damped scoring, up to where a full step gains nothing; None if 300 do not come near enough."""
    here, damping = terms(p), 1e-2
    if here is None:
        return None
    for _ in range(300):
        to_gain = 0.5 * here.gradient @ np.linalg.solve(here.information, here.gradient)
        if to_gain < 1e-9 or damping > 1e15:
            break
        damped = here.information + damping * np.diag(np.diag(here.information))
        step = np.linalg.solve(damped, here.gradient)
        there = terms(p + step)
        if there is not None and there.value > here.value:
            p, here, damping = p + step, there, max(damping / 5, 1e-12)
        else:
            damping *= 10
    return (p, here) if to_gain < near_enough else None


def _power(logit: float) -> float:
    return STEEPEST / (1 + np.exp(-logit))


def _power_slope(power: float) -> float:
    return power * (1 - power / STEEPEST)


def _covariance(terms: Callable[[Array], _Terms | None], p: Array, fisher: Array) -> Array:
    """Inverse of the observed information, the gradient's own slope at the summit; Fisher's where that fails."""
    step = 1e-3 / np.sqrt(np.diag(fisher))
    slope = np.zeros_like(fisher)
    for i, h in enumerate(np.diag(step)):
        above, below = terms(p + h), terms(p - h)
        if above is None or below is None:
            break
        slope[i] = (below.gradient - above.gradient) / (2 * step[i])
    observed = 0.5 * (slope + slope.T)
    # In the unit of Fisher's errors the curvatures are near 1; where one vanishes the summit is a ridge.
    if np.linalg.eigvalsh(observed * step[:, None] * step * 1e6)[0] < 1e-6:
        observed = fisher
    return np.asarray(np.linalg.solve(observed, np.eye(len(p))), dtype=float)


def autocorrelation(x: ArrayLike, lags: int) -> Array:
    """Correlation of a sequence (n,) with itself, 0 … ``lags`` samples later, (lags + 1,); the first is 1."""
    values = np.asarray(x, dtype=float)
    if values.ndim != 1 or not 0 <= lags < values.size:
        raise ValueError(f"expected a sequence and 0 ≤ lags < its length, got shape {values.shape} and {lags}")
    if not np.all(np.isfinite(values)):
        raise ValueError(f"expected finite numbers, got {values[~np.isfinite(values)][0]}")
    values = values - values.mean()
    size = 1 << (2 * values.size).bit_length()  # long enough that the end does not wrap round to the beginning
    products = np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2, size)[: lags + 1]
    return products / products[0] if products[0] > 0 else np.eye(1, lags + 1)[0]


def effective_samples(x: ArrayLike) -> float:
    """How many independent samples would fix a mean as well as these n do: n / (1 + 2 Σ ρ_k), between 1 and n.

    The sum ends where two neighbouring correlations no longer add up to something positive.
    Source: Geyer (1992), Statistical Science 7(4), section 3.3.
    """
    n = int(np.size(x))
    rho = autocorrelation(x, n - 1)
    pairs = rho[: n // 2 * 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs <= 0)) if np.any(pairs <= 0) else len(pairs)
    return float(np.clip(n / max(2 * float(np.sum(pairs[:end])) - 1, 1.0), 1.0, n))
