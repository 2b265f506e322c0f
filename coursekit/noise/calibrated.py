r"""The calibrated model: bias from lab 2's geometry, an age of the picture, and a spread that grows (Lab 3).

Notation: r range, φ bearing, from the robot's centre to the landmark's axis; v speed and ω turn rate of the robot; a
dot is a rate of change.

>>> from coursekit.recordings import datasets
>>> model = fit_calibrated(datasets.load("landmark_log"))
>>> f"the offset is {model.offset:.2f} m, the delay {1e3 * model.delay:.0f} ms"
'the offset is 0.17 m, the delay 42 ms'

Source: Carroll & Ruppert (1988), chapters 2-3; Gelman et al. (2013), section 14.2, for what an uncertain coefficient
adds to a prediction; the geometry is lab 2's.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import together
from coursekit.gaussian import symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.noise import regression
from coursekit.noise.correlation import effective_samples
from coursekit.noise.models import LEAST_SPREAD, NoiseModel, as_log, as_measured, as_rate
from coursekit.noise.regression import Spread
from coursekit.recordings import Log

FARTHEST = 1e3  # m: beyond, the spread stops growing, so that R is finite for any range
NEAREST_LANDMARK = 0.01  # m: no landmark is nearer, so that nothing is divided by zero
GROSS, MOST_GROSS = 30.0, 0.02  # robust standard deviations; the share of rows that may be left out
COEFFICIENTS = ("offset", "inverse_range_bias", "lateral_bias", "yaw_misalignment", "lever_arm", "delay")
SPREADS = ("range_floor", "range_scale", "range_power", "bearing_floor", "bearing_scale", "bearing_power", "jitter")

# Mean and standard deviation of each parameter's prior: the coefficients in m, 1/m, m, rad, m, s; then log floor, log
# scale and the power's logit (-1.1 is a power of 1) of the range and of the bearing, and the log jitter.
_PRIOR = np.array([[0, 0.3], [0, 0.02], [0, 0.1], [0, 0.1], [0, 0.3], [0, 0.1]])
_SPREAD_PRIOR = np.array([[np.log(0.005), 2], [np.log(0.02), 3], [-1.1, 1],
                          [np.log(0.002), 2], [np.log(0.02), 3], [-1.1, 1], [np.log(0.01), 1.5]])  # fmt: skip


@dataclass(frozen=True)
class Calibrated(NoiseModel):
    r"""Bias, delay and spread of a range and a bearing.

    What was measured, (r, φ), is the landmark as it stood ``delay`` seconds ago, seen through three constants of
    lab 2's geometry and two of the camera's mounting:

    r' = 1 / (1/r + inverse_range_bias) + offset + lateral_bias (1 - cos φ)
        a height that misses some pixels makes an inverse range too small by ``inverse_range_bias`` (1/m); from the
        near rim to the robot's centre it is ``offset`` (m) farther, radius plus camera offset, and when looking aside
        about ``lateral_bias`` (m), radius minus camera offset, more;
    φ' = φ + yaw_misalignment - asin(lever_arm sin φ / r')
        the camera stands ``lever_arm`` (m) ahead of the robot's centre and is turned by ``yaw_misalignment`` (rad);
    (r, φ) now = (r', φ') + delay (ṙ, φ̇),   ṙ = -v cos φ',   φ̇ = -ω + v sin φ' / r'
        in the meantime the robot has driven and turned, and the landmark has moved in its view.

    The spread of what is left grows with the measured range and with \|φ\|; and since a picture's age varies, by
    ``jitter`` (s), it grows with the rates:  σ_r² = range_spread(r)² + (jitter ṙ)²,  σ_φ² = bearing_spread(\|φ\|)² +
    (jitter φ̇)².  ``R`` adds what the log left open about the six coefficients, J C Jᵀ, with C their covariance
    ``cov``: next to nothing where the log went, much where it never went.

    Where ``turn_rate`` or ``speed`` is not given, the delay's effect cannot be corrected.  It then stays in R, with the
    mean square ``typical_rates`` of the log; for a robot at rest give 0.

    Outside the log the model extrapolates, and this is how.  Nearer than ``nearest``, the nearest measurement, σ_r
    keeps the value it has there; farther out it grows by its law, up to 1 km.  Beyond ``reach``, half as far again
    as 99 % of the log went (nearer, if a negative inverse-range bias would send ranges to infinity), the effect of that
    bias keeps the value it has there.

    The noise is coloured: residuals that follow each other are alike for about ``correlation_times`` (s; range,
    bearing).  A log is therefore worth ``effective_samples`` (range, bearing) independent ones.  ``standard_errors``
    and ``cov`` count those; ``naive_errors`` count every row.

    >>> from coursekit.recordings import datasets
    >>> model = fit_calibrated(datasets.load("landmark_log"))
    >>> r, phi = model.correct(3.0, 0.2, turn_rate=0.5, speed=0.0)
    >>> sigma = np.sqrt(np.diag(model.R(3.0, 0.2, turn_rate=0.5, speed=0.0)))
    """

    offset: float
    inverse_range_bias: float
    lateral_bias: float
    yaw_misalignment: float
    lever_arm: float
    delay: float
    range_spread: Spread
    bearing_spread: Spread
    jitter: float
    nearest: float
    reach: float
    cov: Array = field(repr=False)
    typical_rates: tuple[float, float] = (0.0, 0.0)
    naive_errors: dict[str, float] = field(default_factory=dict, repr=False)
    standard_errors: dict[str, float] = field(default_factory=dict, repr=False)
    effective_samples: tuple[float, float] = (1.0, 1.0)
    correlation_times: tuple[float, float] = (0.0, 0.0)
    parameters: int = 13

    @property
    def coefficients(self) -> Array:
        """The six ``COEFFICIENTS``, (6,), in m, 1/m, m, rad, m, s; ``cov`` is theirs."""
        return np.array([getattr(self, name) for name in COEFFICIENTS])

    def correct(
        self,
        range: ArrayLike,
        bearing: ArrayLike,
        turn_rate: ArrayLike | None = None,
        speed: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Range (m) and bearing (rad) of now, from the robot's centre to the axis, bias removed.

        Parameters
        ----------
        range, bearing : as measured, m and rad.
        turn_rate : the robot's ω, rad/s, counter-clockwise.     speed : the robot's v, m/s, forward.
            Where one is not given, nothing is corrected for it.

        Returns two arrays of the shape that all arguments share.  Raises ValueError for ranges that are negative and
        for numbers that are not finite.
        """
        r, phi, omega, v = together(*as_measured(range, bearing), as_rate("turn_rate", turn_rate),
                                               as_rate("speed", speed))  # fmt: skip
        now = _now(self.coefficients, r, phi, v, omega, self.reach)
        return now[..., 0], now[..., 1]

    def R(
        self,
        range: ArrayLike,
        bearing: ArrayLike,
        turn_rate: ArrayLike | None = None,
        speed: ArrayLike | None = None,
    ) -> Array:
        """Covariance of what ``correct`` makes of the same arguments, (..., 2, 2), in m², m rad, rad²."""
        r, phi, omega, v = together(*as_measured(range, bearing), as_rate("turn_rate", turn_rate),
                                               as_rate("speed", speed))  # fmt: skip
        then = _as_it_stood(r, phi, self.coefficients, self.reach)
        dr, dphi = _rates(*then, v, omega)
        J = _now_jacobian(self.coefficients, r, phi, v, omega, self.reach)
        R = symmetrize(J @ self.cov @ np.swapaxes(J, -1, -2))
        spreads = self.range_spread(np.clip(r, self.nearest, FARTHEST)), self.bearing_spread(np.abs(phi))
        for i, (spread, rate, given) in enumerate(zip(spreads, (dr, dphi), (speed, turn_rate), strict=True)):
            R[..., i, i] += spread**2 + (self.jitter * rate) ** 2 + LEAST_SPREAD[i] ** 2
            if given is None:
                R[..., i, i] += (self.delay**2 + self.cov[5, 5] + self.jitter**2) * self.typical_rates[i] ** 2
        return R


def fit_calibrated(log: Log) -> Calibrated:
    """Bias, delay and what is left of the errors, by maximum likelihood with spreads that grow.

    The coefficients maximise the density of what was *measured*, given the truth: that is the sensor, and does not
    depend on where the robot drove.  (The other way round, a robot that stood still would teach that every range is
    the same.)  They are fitted where the noise is made: heights in pixels are inverse ranges.  One delay serves range
    and bearing, since both come from one picture.  The spread of the corrected errors, over what was measured, is then
    what ``R`` states and ``log_likelihood`` scores.

    Every parameter has a wide prior, worth less than one sample: it decides only what the log leaves open, such as
    the inverse-range bias when nothing far away was logged, or the delay when the robot never turned; R then says so.
    Outliers are part of the log and widen R, as they must in a covariance that is scored on them; to gate them is the
    filter's task.  They do not bend the coefficients: rows that are grossly wrong, thirty times as far off as is
    usual, are left out of their fit, if they are at most a fiftieth of the log.

    Raises TypeError for something that is no ``Log``, ValueError for fewer than five samples, RuntimeError when the fit
    does not converge.

    Source: Carroll & Ruppert (1988), chapters 2-3.

    >>> from coursekit.recordings import datasets
    >>> log = datasets.load("landmark_log")
    >>> model = fit_calibrated(log[::2])
    >>> bool(model.log_likelihood(log[1::2]) > 2.0)
    True
    """
    if len(as_log(log)) < 5:
        raise ValueError(f"log: expected at least 5 samples, got {len(log)}")
    fitted, kept = _fit_without_gross(log)
    worth = effective_samples(fitted.residuals[0]), effective_samples(fitted.residuals[1])
    shares = np.array(worth) / len(kept)
    naive, cov = (_posterior(fitted.information, counted) for counted in (np.ones(2), shares))
    counted = np.sqrt(np.append(np.repeat(shares, 3), shares.max()))  # the jitter's error is the better output's
    naive_errors = np.concatenate([np.sqrt(np.diag(naive)), fitted.spread_errors])
    errors = np.concatenate([np.sqrt(np.diag(cov)), fitted.spread_errors / counted])
    span = float(log.stamp[-1] - log.stamp[0])
    dr, dphi = _rates(log.true_range, log.true_bearing, log.speed, log.turn_rate)
    offset, inverse_range_bias, lateral_bias, yaw_misalignment, lever_arm, delay = (float(b) for b in fitted.beta)
    model = Calibrated(
        offset,
        inverse_range_bias,
        lateral_bias,
        yaw_misalignment,
        lever_arm,
        delay,
        range_spread=fitted.spreads[0],
        bearing_spread=fitted.spreads[1],
        jitter=fitted.jitter,
        nearest=float(np.min(log.range)),
        # A negative inverse-range bias sends far ranges to infinity: its effect is held well before.
        reach=min(1.5 * float(np.quantile(log.range, 0.99)), 0.7 / max(-inverse_range_bias, 1e-12)),
        cov=cov,
        typical_rates=(float(np.sqrt(np.mean(dr**2))), float(np.sqrt(np.mean(dphi**2)))),
        naive_errors=dict(zip(COEFFICIENTS + SPREADS, map(float, naive_errors), strict=True)),
        standard_errors=dict(zip(COEFFICIENTS + SPREADS, map(float, errors), strict=True)),
        effective_samples=worth,
        correlation_times=(0.5 * span / worth[0], 0.5 * span / worth[1]),
    )
    # So far the spreads belong to what was measured; R is asked for the spread of what ``correct`` makes of it, with
    # every row.
    x, rates = np.stack([log.range, np.abs(log.bearing)]), np.stack([dr, dphi])
    left = regression.fit_spread(model.residuals(log).T, x, rates, np.array(LEAST_SPREAD), _SPREAD_PRIOR)
    return replace(model, range_spread=left.spreads[0], bearing_spread=left.spreads[1], jitter=left.jitter)


def _fit_coefficients(log: Log) -> regression.Fit:
    """The six coefficients that make what was measured likeliest, given the truth."""
    r, phi = log.true_range, log.true_bearing
    dr, dphi = _rates(r, phi, log.speed, log.turn_rate)
    zero, one = np.zeros_like(r), np.ones_like(r)

    def measured(beta: Array) -> tuple[Array, Array]:
        """Inverse range and bearing error, (2, n), that these coefficients predict, and their Jacobian (2, n, 6)."""
        offset, inverse_range_bias, lateral, yaw, lever, delay = beta
        then_r, then_phi = r - delay * dr, phi - delay * dphi
        to_rim = then_r - offset - lateral * (1 - np.cos(then_phi))
        to_rim = np.where(to_rim > 0.02 * r, to_rim, np.nan)  # else the camera would stand inside the landmark
        ahead, left = then_r * np.cos(then_phi) - lever, then_r * np.sin(then_phi)  # the landmark, from the camera
        square = ahead**2 + left**2
        aside = 1 - np.cos(then_phi)
        by_delay = dr - lateral * np.sin(then_phi) * dphi
        d_inverse = np.stack([one, -(to_rim**2), aside, zero, zero, by_delay], axis=-1) / to_rim[:, None] ** 2
        turned = -(dphi * then_r * (then_r - lever * np.cos(then_phi)) - dr * lever * np.sin(then_phi)) / square
        d_bearing = np.stack([zero, zero, zero, -one, left / square, turned], axis=-1)
        error = wrap_angle(np.arctan2(left, ahead) - yaw - phi)
        return np.stack([1 / to_rim - inverse_range_bias, error]), np.stack([d_inverse, d_bearing])

    y = np.stack([1 / log.range, log.bearing_error])
    x, rates = np.stack([1 / r, np.abs(phi)]), np.stack([dr / r**2, dphi])
    return regression.fit(y, measured, x, rates, np.array(LEAST_SPREAD), np.concatenate([_PRIOR, _SPREAD_PRIOR]))


def _fit_without_gross(log: Log) -> tuple[regression.Fit, Log]:
    """The fit without the rows that are grossly wrong, if they are few, and the rows that are left.

    A gross error widens the spread that it is measured by, a hundredfold here and there, so residuals are compared with
    their median, and the largest go first: what else looked gross may have been so beside the wrong fit only.  Many are
    no mistakes: then the model is wrong, no row is to blame, and all are kept.
    """
    every = fitted = _fit_coefficients(log)
    kept = log
    while True:
        off = np.abs(fitted.residuals)
        times = np.max(off / np.maximum(1.4826 * np.median(off, axis=1, keepdims=True), 1 / GROSS), axis=0)
        gross = times > max(GROSS, 0.5 * times.max())
        if not gross.any():
            return fitted, kept
        kept = kept[~gross]
        if len(kept) < (1 - MOST_GROSS) * len(log):
            return every, log
        fitted = _fit_coefficients(kept)


def _posterior(information: Array, shares: Array) -> Array:
    """Covariance of the coefficients (6, 6), when a share of each output's samples (2,) counts, and the prior."""
    width = _PRIOR[:, 1]
    total = np.outer(width, width) * np.tensordot(shares, information, axes=1) + np.eye(len(width))
    return np.outer(width, width) * symmetrize(np.asarray(np.linalg.solve(total, np.eye(len(width)))))


def _as_it_stood(r: Array, phi: Array, coefficients: Array, reach: float) -> tuple[Array, Array]:
    """Range and bearing when the picture was taken, bias removed."""
    offset, c, lateral, yaw, lever, _ = coefficients
    held = np.minimum(r, reach)
    bent = held / (1 + c * held) - held
    then = np.maximum(r + bent + offset + lateral * (1 - np.cos(phi)), NEAREST_LANDMARK)
    aside = np.arcsin(np.clip(lever * np.sin(phi) / then, -0.5, 0.5))
    return then, phi + yaw - aside


def _rates(r: Array, phi: Array, v: Array, omega: Array) -> tuple[Array, Array]:
    """How fast a landmark at rest moves in the robot's frame: ṙ (m/s) and φ̇ (rad/s)."""
    return -v * np.cos(phi), -omega + v * np.sin(phi) / r


def _now(coefficients: Array, r: Array, phi: Array, v: Array, omega: Array, reach: float) -> Array:
    """Range and bearing of now, bias and age removed, (..., 2)."""
    then = _as_it_stood(r, phi, coefficients, reach)
    dr, dphi = _rates(*then, v, omega)
    delay = coefficients[-1]
    return np.stack([np.maximum(then[0] + delay * dr, NEAREST_LANDMARK), wrap_angle(then[1] + delay * dphi)], axis=-1)


def _now_jacobian(coefficients: Array, r: Array, phi: Array, v: Array, omega: Array, reach: float) -> Array:
    """∂_now/∂coefficients, (..., 2, 6), where nothing is clipped."""
    _, c, _, _, lever, delay = coefficients
    held, (r_then, phi_then) = np.minimum(r, reach), _as_it_stood(r, phi, coefficients, reach)
    # Of what the picture showed: three coefficients move the range, and the range moves the bearing's lever arm.
    range_then, bearing_then = np.zeros((2, *np.shape(r_then), 6))
    range_then[..., 0], range_then[..., 1], range_then[..., 2] = 1.0, -((held / (1 + c * held)) ** 2), 1 - np.cos(phi)
    slope = np.sin(phi) / r_then / np.sqrt(1 - np.clip(lever * np.sin(phi) / r_then, -0.5, 0.5) ** 2)
    bearing_then[...] = (lever * slope / r_then)[..., None] * range_then
    bearing_then[..., 3], bearing_then[..., 4] = 1.0, -slope
    # Of the way since.
    along, across = v * np.sin(phi_then), v * np.cos(phi_then) / r_then
    J = np.stack([
        range_then + delay * along[..., None] * bearing_then,
        bearing_then + delay * (across[..., None] * bearing_then - (along / r_then / r_then)[..., None] * range_then),
    ], axis=-2)  # fmt: skip
    J[..., 0, 5], J[..., 1, 5] = _rates(r_then, phi_then, v, omega)
    return J
