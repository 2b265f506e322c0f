r"""From residuals to a noise model: what a measured range and bearing say about the true ones.

Two models share one meaning.  Given what was measured, the truth is Gaussian,

    p(d, θ | measured) = N([d, θ]; correct(measured), R(measured)),

a density over the *true* range and bearing, in nats per (m · rad).  Because both models are densities over the
same two variables, their likelihoods on the same samples can be subtracted; had one of them been a density of the
measured range, its correction's Jacobian would have to come in first.

``fit_piecewise`` is the report's model: no correction, one variance a coordinate, three times as much outside
stated limits.  ``fit_calibrated`` finds the bias that lab 2's geometry predicts, and how the spread of what is left
grows, both by maximum likelihood.

>>> from coursekit import datasets
>>> log = datasets.load("landmark_log")
>>> model = fit_calibrated(log[::2])
>>> model.log_likelihood(log[1::2]) > fit_piecewise(log[::2]).log_likelihood(log[1::2])
True

Source: Carroll & Ruppert (1988), chapters 2-3 (variance functions, joint maximum likelihood by scoring).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from coursekit import scoring
from coursekit.geometry import Array, wrap_angle
from coursekit.recordings import Log
from coursekit.recordings import read_landmark_log as load_log
from coursekit.scoring import Spread, autocorrelation, effective_samples

__all__ = ["Calibrated", "Log", "NoiseModel", "Piecewise", "Spread", "aic", "autocorrelation",
           "effective_samples", "fit_calibrated", "fit_piecewise", "load_log"]  # fmt: skip

LEAST_SPREAD = (1e-5, 1e-6)  # m, rad: nothing is known better, so R stays positive definite on a noise-free log
FARTHEST = 1e3  # m: beyond, the spread stops growing, so that R is finite for any range
NEAREST_LANDMARK = 0.01  # m: no landmark is nearer, so that nothing is divided by zero


class NoiseModel:
    """What both models can do: correct a measurement, state its covariance, and be scored on a log."""

    parameters: int

    def correct(self, range: ArrayLike, bearing: ArrayLike) -> tuple[Array, Array]:
        raise NotImplementedError

    def R(self, range: ArrayLike, bearing: ArrayLike) -> Array:
        raise NotImplementedError

    def residuals(self, log: Log) -> Array:
        """Corrected measurement minus truth, [m, rad], (n, 2)."""
        d, theta = self.correct(log.range, log.bearing)
        return np.stack([d - log.true_range, wrap_angle(theta - log.true_bearing)], axis=-1)

    def log_likelihood(self, log: Log) -> float:
        """Mean log density of the true range and bearing given the measured ones, nats per sample."""
        if not len(log):
            raise ValueError("log: expected at least one sample")
        e, R = self.residuals(log), self.R(log.range, log.bearing)
        squared = np.einsum("ni,ni->n", e, np.linalg.solve(R, e[..., None])[..., 0])
        return float(np.mean(-0.5 * (squared + np.linalg.slogdet(2 * np.pi * R)[1])))


def aic(model: NoiseModel, log: Log) -> float:
    """Akaike's criterion on the log that the model was fitted to: 2 parameters - 2 log-likelihood; lower is better."""
    return 2 * model.parameters - 2 * len(log) * model.log_likelihood(log)


@dataclass(frozen=True)
class Piecewise(NoiseModel):
    """The report's model: R = diag(var_range, var_bearing), times ``inflation`` outside the limits; no correction."""

    var_range: float
    var_bearing: float
    range_limits: tuple[float, float]
    bearing_limit: float
    inflation: float
    samples: tuple[int, int]  # how many made each variance
    parameters: int = 2

    def correct(self, range: ArrayLike, bearing: ArrayLike) -> tuple[Array, Array]:
        """The measurement as it is."""
        return _measured(range, bearing)

    def R(self, range: ArrayLike, bearing: ArrayLike) -> Array:
        """Covariance of a *measured* range [m] and bearing [rad], (..., 2, 2)."""
        d, theta = _measured(range, bearing)
        near, far = self.range_limits
        return _diagonal(
            self.var_range * np.where((near <= d) & (d <= far), 1.0, self.inflation),
            self.var_bearing * np.where(np.abs(theta) <= self.bearing_limit, 1.0, self.inflation),
        )


def fit_piecewise(
    log: Log, range_limits: tuple[float, float] = (1.0, 10.0), bearing_limit: float = 0.6, inflation: float = 3.0
) -> Piecewise:
    """Sample variances (n - 1 in the denominator) of the errors inside limits on the *measured* range and bearing.

    A variance is taken about the mean, and the mean is then forgotten: whatever bias there is inside the limits
    is either removed unseen or, where it changes with range, counted as noise.

    Raises ValueError when fewer than two samples lie inside the limits, or for limits and inflation ≤ 0.
    """
    near, far = range_limits
    if not (0 <= near < far and bearing_limit > 0 and 0 < inflation < np.inf):
        raise ValueError(f"expected 0 ≤ near < far, bearing_limit > 0 and finite inflation > 0, "
                         f"got {range_limits}, {bearing_limit}, {inflation}")  # fmt: skip
    chosen = (near <= log.range) & (log.range <= far), np.abs(log.bearing) <= bearing_limit
    counts = int(np.sum(chosen[0])), int(np.sum(chosen[1]))
    if min(counts) < 2:
        raise ValueError(f"log: expected at least two samples inside the limits, got {counts[0]} between {near} and "
                         f"{far} m and {counts[1]} within ±{bearing_limit} rad, of {len(log)}")  # fmt: skip
    variances = [
        max(float(np.var(errors[mask], ddof=1)), least**2)
        for errors, mask, least in zip((log.range_error, log.bearing_error), chosen, LEAST_SPREAD, strict=True)
    ]
    return Piecewise(variances[0], variances[1], (near, far), bearing_limit, inflation, counts)


@dataclass(frozen=True)
class Calibrated(NoiseModel):
    r"""Bias and spread, each in the form that lab 2's geometry gives it.

    d_true = 1 / (1/d + shortfall) + offset + sideways (1 - cos θ)
        a height that misses some pixels makes an inverse range too small by ``shortfall`` (1/m); from the near rim
        to the robot's centre it is ``offset`` farther, radius plus camera offset, and about ``sideways``, radius
        minus camera offset, more when looking aside;
    θ_true = θ + turn - asin(lever sin θ / d_true)
        the camera stands ``lever`` ahead of the robot's centre and is turned by ``turn``;
    σ_d(d) and σ_θ(\|θ\|)
        each a ``Spread``, of the measured range and bearing.

    Outside the log the model extrapolates, and this is how.  Nearer than ``nearest``, the nearest measurement, σ_d
    keeps the value it has there; farther out it grows by its law, up to 1 km.  Beyond ``reach``, half as far again
    as 99 % of the log went (nearer, if a negative shortfall would send ranges to infinity), the shortfall's effect
    keeps the value it has there.

    ``naive_errors`` are standard errors from the observed information, right for independent samples;
    ``standard_errors`` are those times √(n / n_eff), since residuals that follow each other are alike: exact for a
    mean, near enough for the rest.
    """

    offset: float
    shortfall: float
    sideways: float
    turn: float
    lever: float
    range_spread: Spread
    bearing_spread: Spread
    nearest: float
    reach: float
    naive_errors: dict[str, float] = field(repr=False)
    standard_errors: dict[str, float] = field(repr=False)
    effective_samples: tuple[float, float]
    parameters: int = 11

    def correct(self, range: ArrayLike, bearing: ArrayLike) -> tuple[Array, Array]:
        """Range and bearing from the robot's centre to the axis, bias removed; the shape they share."""
        return _corrected(*_measured(range, bearing), *self.bias, self.reach)

    @property
    def bias(self) -> tuple[float, float, float, float, float]:
        """What ``correct`` takes away: offset, shortfall, sideways, turn, lever."""
        return self.offset, self.shortfall, self.sideways, self.turn, self.lever

    def R(self, range: ArrayLike, bearing: ArrayLike) -> Array:
        """Covariance of what ``correct`` makes of a *measured* range [m] and bearing [rad], (..., 2, 2)."""
        d, theta = _measured(range, bearing)
        return _diagonal(
            self.range_spread(np.clip(d, self.nearest, FARTHEST)) ** 2 + LEAST_SPREAD[0] ** 2,
            self.bearing_spread(np.abs(theta)) ** 2 + LEAST_SPREAD[1] ** 2,
        )


def fit_calibrated(log: Log) -> Calibrated:
    """Bias, then what is left of the errors, each by maximum likelihood with a spread that grows.

    The bias maximises the density of what was *measured*, given the truth: that is the sensor, and does not depend
    on where the robot drove.  (The other way round, a robot that stood still would teach that every range is the
    same.)  It is fitted where the noise is made: heights in pixels are inverse ranges.  The spread of the corrected
    errors, over what was measured, is then what ``R`` states and ``log_likelihood`` scores.

    Every parameter has a wide prior, worth less than one sample: it decides only what the log leaves open, such as
    the shortfall when nothing far away was logged.  Outliers are part of the log and widen R, as they must in a
    covariance that is scored on them; to gate them is the filter's task.

    Raises ValueError for fewer than five samples, RuntimeError when the fit does not converge.
    """
    if len(log) < 5:
        raise ValueError(f"log: expected at least 5 samples, got {len(log)}")
    d, theta = log.true_range, log.true_bearing

    def inverse_range(beta: Array) -> tuple[Array, Array] | None:
        offset, shortfall, sideways = beta
        to_rim = d - offset - sideways * (1 - np.cos(theta))
        if np.any(to_rim < 0.02 * d):  # the camera would stand inside the landmark
            return None
        by_rim = to_rim**-2
        return 1 / to_rim - shortfall, np.stack([by_rim, -np.ones_like(d), by_rim * (1 - np.cos(theta))], axis=-1)

    def bearing_error(beta: Array) -> tuple[Array, Array]:
        turn, lever = beta
        ahead, left = d * np.cos(theta) - lever, d * np.sin(theta)  # the landmark, from the camera
        J = np.stack([-np.ones_like(d), left / (ahead**2 + left**2)], axis=-1)
        return np.arctan2(left, ahead) - theta - turn, J

    along = scoring.fit(1 / log.range, inverse_range, 1 / d, LEAST_SPREAD[0], _RANGE_PRIOR)
    across = scoring.fit(log.bearing_error, bearing_error, np.abs(theta), LEAST_SPREAD[1], _BEARING_PRIOR)
    offset, shortfall, sideways = (float(b) for b in along.beta)
    turn, lever = (float(b) for b in across.beta)
    bias = offset, shortfall, sideways, turn, lever
    # A negative shortfall sends far ranges to infinity: its effect is held well before.
    reach = min(1.5 * float(np.quantile(log.range, 0.99)), 0.7 / max(-shortfall, 1e-12))
    corrected = _corrected(log.range, log.bearing, *bias, reach)
    ranges = scoring.fit_spread(corrected[0] - d, log.range, LEAST_SPREAD[0], _RANGE_PRIOR[3:])
    error = wrap_angle(corrected[1] - theta)
    bearings = scoring.fit_spread(error, np.abs(log.bearing), LEAST_SPREAD[1], _BEARING_PRIOR[2:])
    effective = effective_samples(along.residuals), effective_samples(across.residuals)
    variances = [np.diag(along.cov)[:3], np.diag(across.cov)[:2], np.diag(ranges.cov), np.diag(bearings.cov)]
    naive = np.sqrt(np.concatenate(variances))
    ratio = np.sqrt(len(log) / np.array(effective))
    honest = naive * np.repeat([*ratio, *ratio], [3, 2, 3, 3])
    return Calibrated(
        *bias,
        range_spread=ranges.spread,
        bearing_spread=bearings.spread,
        nearest=float(np.min(log.range)),
        reach=reach,
        naive_errors=dict(zip(_NAMES, map(float, naive), strict=True)),
        standard_errors=dict(zip(_NAMES, map(float, honest), strict=True)),
        effective_samples=effective,
    )


# Mean and standard deviation of each parameter's prior: of the bias, then log floor, log scale and the power's logit
# (-1.1 is a power of 1).
_RANGE_PRIOR = np.array([[0, 0.3], [0, 0.02], [0, 0.1], [np.log(0.005), 2], [np.log(0.02), 3], [-1.1, 1]])
_BEARING_PRIOR = np.array([[0, 0.1], [0, 0.3], [np.log(0.002), 2], [np.log(0.02), 3], [-1.1, 1]])
_NAMES = ("offset", "shortfall", "sideways", "turn", "lever", "range_floor", "range_scale", "range_power",
          "bearing_floor", "bearing_scale", "bearing_power")  # fmt: skip


def _corrected(
    d: Array, theta: Array, offset: float, shortfall: float, sideways: float, turn: float, lever: float, reach: float
) -> tuple[Array, Array]:
    held = np.minimum(d, reach)
    bent = held / (1 + shortfall * held) - held
    corrected = np.maximum(d + bent + offset + sideways * (1 - np.cos(theta)), NEAREST_LANDMARK)
    aside = np.arcsin(np.clip(lever * np.sin(theta) / corrected, -0.5, 0.5))
    return corrected, wrap_angle(theta + turn - aside)


def _diagonal(var_range: Array, var_bearing: Array) -> Array:
    R = np.zeros((*np.shape(var_range), 2, 2))
    R[..., 0, 0], R[..., 1, 1] = var_range, var_bearing
    return R


def _measured(range: ArrayLike, bearing: ArrayLike) -> tuple[Array, Array]:
    """Range and bearing as finite arrays of one shape, the bearing in (-π, π]."""
    d, theta = np.broadcast_arrays(np.asarray(range, dtype=float), wrap_angle(bearing))
    if not (np.all(np.isfinite(d)) and np.all(np.isfinite(theta)) and np.all(d >= 0)):
        raise ValueError(f"expected finite bearings and ranges ≥ 0, got range {range!r} and bearing {bearing!r}")
    return d, theta
