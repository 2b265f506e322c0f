r"""What a noise model is, how models are compared, and the report's model (Lab 3).

Two models share one meaning.  Given what was measured, the truth is Gaussian,

    p(r, φ | measured) = N([r, φ]; correct(measured), R(measured)),

a density over the *true* range r (m) and bearing φ (rad), in nats per (m · rad).  Because both models are densities
over the same two variables, their likelihoods on the same samples can be subtracted; had one of them been a density of
the measured range, its correction's Jacobian would have to come in first.

Source: Akaike (1974) for the criterion; the report's assignment 4 for the piecewise model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, number, together
from coursekit.geometry import Array, wrap_angle
from coursekit.recordings import Log

LEAST_SPREAD = (1e-5, 1e-6)  # m, rad: nothing is known better, so R stays positive definite on a noise-free log


class NoiseModel:
    """What both models can do: correct a measurement, state its covariance, and be scored on a log.

    ``parameters`` is how many numbers were fitted.  The robot's ``turn_rate`` (rad/s) and ``speed`` (m/s) belong to the
    measurement where they are known; a model without a delay ignores them.
    """

    parameters: int

    def correct(
        self, range: ArrayLike, bearing: ArrayLike, turn_rate: ArrayLike | None = None, speed: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """The true range (m) and bearing (rad) that the model expects."""
        raise NotImplementedError

    def R(
        self, range: ArrayLike, bearing: ArrayLike, turn_rate: ArrayLike | None = None, speed: ArrayLike | None = None
    ) -> Array:
        """Covariance of what ``correct`` gives, (..., 2, 2)."""
        raise NotImplementedError

    def residuals(self, log: Log) -> Array:
        """Corrected measurement minus truth, [m, rad], (n, 2), with the log's turn rate and speed."""
        r, phi = self.correct(as_log(log).range, log.bearing, log.turn_rate, log.speed)
        return np.stack([r - log.true_range, wrap_angle(phi - log.true_bearing)], axis=-1)

    def doubt(self, log: Log) -> str:
        """Why the measurements of a log say nothing about its truth, as far as this model can tell; empty when they do.

        Where what is left of an error is more than half as wide as the truth itself varies, the truth's own mean would
        do almost as well as the measurement.  The truth may stand in another order than the measurements, or belong to
        another landmark; or the robot stood still, and the log can tell nothing apart.

        Raises as ``log_likelihood``.
        """
        if not len(as_log(log)):
            raise ValueError("log: expected at least one sample")
        left, reasons = np.sqrt(np.mean(self.residuals(log) ** 2, axis=0)), []
        for name, unit, sigma, truth in zip(
            ("range", "bearing"), ("m", "rad"), left, (log.true_range, log.true_bearing)
        ):
            varies = float(np.std(truth))
            if sigma > 0.5 * varies:
                reasons.append(
                    f"the {name} is off by {sigma:.2g} {unit}, where the truth itself varies by {varies:.2g}"
                )
        return "the measurements say little about the truth: " + " and ".join(reasons) if reasons else ""

    def log_likelihood(self, log: Log) -> float:
        """Mean log density of the true range and bearing given the measured ones, nats per sample.

        Raises TypeError for something that is no ``Log``, ValueError for an empty one.
        """
        if not len(as_log(log)):
            raise ValueError("log: expected at least one sample")
        e, R = self.residuals(log), self.R(log.range, log.bearing, log.turn_rate, log.speed)
        squared = np.einsum("ni,ni->n", e, np.linalg.solve(R, e[..., None])[..., 0])
        return float(np.mean(-0.5 * (squared + np.linalg.slogdet(2 * np.pi * R)[1])))


def aic(model: NoiseModel, log: Log) -> float:
    """Akaike's criterion on the log that the model was fitted to: 2 parameters - 2 log-likelihood; lower is better.

    >>> log = Log(range=[1.0, 2.2], bearing=[0.0, 0.1], true_range=[1.1, 2.0], true_bearing=[0.0, 0.0])
    >>> round(aic(fit_piecewise(log), log), 3)
    -2.336
    """
    return 2 * model.parameters - 2 * len(log) * model.log_likelihood(log)


@dataclass(frozen=True)
class Piecewise(NoiseModel):
    """The report's model: R = diag(var_range, var_bearing), times ``inflation`` outside the limits; no correction.

    ``samples`` says how many errors made each variance.
    """

    var_range: float
    var_bearing: float
    range_limits: tuple[float, float]
    bearing_limit: float
    inflation: float
    samples: tuple[int, int]
    parameters: int = 2

    def correct(
        self, range: ArrayLike, bearing: ArrayLike, turn_rate: ArrayLike | None = None, speed: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """The measurement as it is."""
        return as_measured(range, bearing)

    def R(
        self, range: ArrayLike, bearing: ArrayLike, turn_rate: ArrayLike | None = None, speed: ArrayLike | None = None
    ) -> Array:
        """Covariance of a *measured* range [m] and bearing [rad], (..., 2, 2)."""
        r, phi = as_measured(range, bearing)
        near, far = self.range_limits
        R = np.zeros((*r.shape, 2, 2))
        R[..., 0, 0] = self.var_range * np.where((near <= r) & (r <= far), 1.0, self.inflation)
        R[..., 1, 1] = self.var_bearing * np.where(np.abs(phi) <= self.bearing_limit, 1.0, self.inflation)
        return R


def fit_piecewise(
    log: Log, range_limits: tuple[float, float] = (1.0, 10.0), bearing_limit: float = 0.6, inflation: float = 3.0
) -> Piecewise:
    """Sample variances (n - 1 in the denominator) of the errors inside limits on the *measured* range and bearing.

    A variance is taken about the mean, and the mean is then forgotten: whatever bias there is inside the limits
    is either removed unseen or, where it changes with range, counted as noise.

    Parameters: ``range_limits`` in metres, ``bearing_limit`` in radians, ``inflation`` times the variances outside.

    Raises TypeError for something that is no ``Log``, ValueError when fewer than two samples lie inside the limits, or
    for limits and inflation ≤ 0.

    Source: the report's assignment 4.

    >>> log = Log(range=[2.1, 3.3, 4.2], bearing=[0.0] * 3, true_range=[2.0, 3.0, 4.0], true_bearing=[0.1, -0.1, 0.0])
    >>> round(fit_piecewise(log).var_range, 6), round(fit_piecewise(log).var_bearing, 6)
    (0.01, 0.01)
    """
    log = as_log(log)
    limits = as_numbers(range_limits, "range_limits")
    if limits.shape != (2,):
        raise ValueError(f"range_limits: expected (near, far) in metres, got {range_limits!r}")
    near, far = limits.tolist()
    bearing_limit, inflation = number(bearing_limit, "bearing_limit"), number(inflation, "inflation")
    if not (0 <= near < far < np.inf and 0 < bearing_limit < np.inf and 0 < inflation < LARGEST):
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


def as_log(log: Log) -> Log:
    """``log``; TypeError where it is something else."""
    if not isinstance(log, Log):
        raise TypeError(f"log: expected a Log, as load_log returns it, got {type(log).__name__}")
    return log


def as_measured(range: ArrayLike, bearing: ArrayLike) -> tuple[Array, Array]:
    """Range and bearing as finite arrays of one shape, the bearing in (-π, π]."""
    r, phi = together(_numbers("range", range), wrap_angle(_numbers("bearing", bearing)))
    if not (np.all(np.isfinite(phi)) and np.all((r >= 0) & np.isfinite(r))):
        raise ValueError(f"expected finite bearings and ranges ≥ 0, got range {range!r} and bearing {bearing!r}")
    return r, phi


def as_rate(name: str, rate: ArrayLike | None) -> Array:
    """A turn rate or speed as finite numbers; 0 where it is not known."""
    values = _numbers(name, 0.0 if rate is None else rate)
    if not np.all(np.abs(values) < LARGEST):
        raise ValueError(f"{name}: expected finite numbers, got {rate!r}")
    return values


def _numbers(name: str, values: ArrayLike) -> Array:
    try:
        return as_numbers(values, name)
    except (TypeError, ValueError):
        raise TypeError(f"{name}: expected a number or an array of numbers, got {values!r}") from None
