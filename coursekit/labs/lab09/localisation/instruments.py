r"""Instruments that a filter calibrates while it uses them: state [x, y, θ, κ, λ, b, p, δ, γ, β].

=====  ================================================================================  ====
κ      the robot turns at κ ω when ω rad/s are commanded                                 1
λ      it runs at λ v when v m/s are commanded                                           1
b      the camera's range begins b metres before it                                      m
p      its "range" is range · cos(bearing)ᵖ: p = 1 is a camera that takes depth for it   1
δ      the robot does what it was told δ seconds ago                                     s
γ      it veers by γ radians in each commanded metre: no two wheels are of one size      rad/m
β      the camera looks β to the left of straight ahead                                  rad
=====  ================================================================================  ====

κ = λ = 1 and zeros are instruments as one wishes for.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive, RangeBearing
from coursekit.models.checks import right_by_construction

KAPPA, LAMBDA, B, P, DELTA, GAMMA, BETA = range(3, 10)
SIZE = 10
IDEAL = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])  # κ, λ, b, p, δ, γ, β
_WIDEST = 1.4  # rad: beyond, cos(bearing)^p is held, for no camera sees there


@right_by_construction
@dataclass(frozen=True, eq=False)
class CalibratingDrive:
    """A differential drive that learns what its odometry means, and how late it does what it is told.

    odometry : what was commanded and when, (n, 3): stamp [s], v [m/s], ω [rad/s]; each holds until the next.  The
        *control* of a step is the time t [s] at which it begins: the model looks up what was commanded in
        [t - δ, t + dt - δ], whatever δ it believes in.

    ``sigma_v`` [m/√s] and ``sigma_omega`` [rad/√s] are intensities: what the wheels add to the variance in a second, in
    however many steps, because a recording's stamps come as they like.  The defaults are a seventh of the robots'
    walking pace of 0.15 m/s, and three degrees.  ``sigma_drift`` (7,) is how far the constants may wander in √s.

    Raises ValueError for odometry of another shape, not finite, or whose stamps run backwards, and for negative
    deviations; each method for a state that is none and for dt ≤ 0.

    >>> drive = CalibratingDrive([[0.0, 0.1, 0.0], [5.0, 0.2, 0.0]])
    >>> at_rest = np.array([0.0, 0.0, 0.0, *IDEAL])
    >>> late = at_rest + np.eye(10)[7]                         # δ = 1 s
    >>> [round(float(drive.f(state, 4.0, 2.0)[0]), 3) for state in (at_rest, late)]
    [0.3, 0.2]
    """

    odometry: Array
    sigma_v: float = 0.02
    sigma_omega: float = 0.05
    sigma_drift: tuple[float, ...] = (1e-3,) * 7
    _until: Array = field(init=False, repr=False)  # ∫ [v, ω] dt up to each stamp
    _stamps: list[float] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        odometry = as_numbers(self.odometry, "odometry").copy()
        if odometry.ndim != 2 or odometry.shape[1] != 3 or not len(odometry) or not np.isfinite(odometry).all():
            raise ValueError(f"odometry: expected finite rows [stamp, v, ω] of shape (n, 3), got {odometry.shape}")
        gaps = np.diff(odometry[:, :1], axis=0)
        if np.any(gaps < 0):
            raise ValueError("odometry: expected stamps in order, got some that run backwards")
        sigmas = as_numbers([self.sigma_v, self.sigma_omega, *self.sigma_drift], "sigma_v, sigma_omega, sigma_drift")
        if sigmas.shape != (SIZE - 1,) or not np.isfinite(sigmas).all() or np.any(sigmas < 0):
            raise ValueError(f"expected finite standard deviations ≥ 0, for v, ω and seven constants, got {sigmas}")
        odometry.flags.writeable = False
        object.__setattr__(self, "odometry", odometry)
        object.__setattr__(self, "_stamps", odometry[:, 0].tolist())
        object.__setattr__(self, "_until", np.concatenate([np.zeros((1, 2)), np.cumsum(odometry[:-1, 1:] * gaps, 0)]))

    def f(self, x: ArrayLike, t: float, dt: float) -> Array:
        """The state ``dt`` seconds after t, (..., 10)."""
        x = _state(x)
        commanded, _ = self._commanded(x, t, dt)
        return np.concatenate([self._drive(dt).f(x[..., :3], _done(x, commanded), dt), x[..., 3:]], axis=-1)

    def F(self, x: ArrayLike, t: float, dt: float) -> Array:
        """∂f/∂x, (..., 10, 10)."""
        x = _state(x)
        commanded, later = self._commanded(x, t, dt)
        drive, pose, done = self._drive(dt), x[..., :3], _done(x, commanded)
        G, (v, omega) = drive.G(pose, done, dt), np.moveaxis(commanded, -1, 0)[..., None]
        F = np.zeros((*x.shape, SIZE)) + np.eye(SIZE)
        F[..., :3, :3] = drive.F(pose, done, dt)
        F[..., :3, KAPPA], F[..., :3, LAMBDA], F[..., :3, GAMMA] = G[..., 1] * omega, G[..., 0] * v, G[..., 1] * v
        F[..., :3, DELTA] = (G @ _done(x, later)[..., None])[..., 0]
        return F

    def Q(self, x: ArrayLike, t: float, dt: float) -> Array:
        """The wheels' noise on the pose and the drift of the rest, (..., 10, 10)."""
        x = _state(x)
        done = _done(x, self._commanded(x, t, dt)[0])
        Q = np.zeros((*x.shape, SIZE)) + np.diag([0.0, 0.0, 0.0, *np.square(self.sigma_drift) * dt])
        Q[..., :3, :3] = self._drive(dt).Q(x[..., :3], done, dt)
        return Q

    def sample(self, states: ArrayLike, t: float, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 10) → (n, 10)."""
        states = _state(states)
        controls = _done(states, self._commanded(states, t, dt)[0])
        poses = self._drive(dt).sample(states[:, :3], controls, dt, rng)
        drift = np.asarray(self.sigma_drift) * math.sqrt(dt) * rng.standard_normal((len(states), SIZE - 3))
        return np.concatenate([poses, states[:, 3:] + drift], axis=1)

    def _drive(self, dt: float) -> DifferentialDrive:
        s = 1 / math.sqrt(dt)
        return DifferentialDrive(self.sigma_v * s, self.sigma_omega * s, (0.0, 0.0, 0.0))

    def _commanded(self, x: Array, t: float, dt: float) -> tuple[Array, Array]:
        """The mean control [v, ω] of the step, and its derivative by δ, each (..., 2)."""
        if not (0 < dt < math.inf and math.isfinite(t)):
            raise ValueError(f"expected a time t and a time step dt > 0, in seconds, got t={t}, dt={dt}")
        (before, first), (after, last) = self._history(t - x[..., DELTA]), self._history(t + dt - x[..., DELTA])
        return (after - before) / dt, (first - last) / dt

    def _history(self, times: Any) -> tuple[Array, Array]:
        """∫ [v, ω] dt up to some times, and [v, ω] then; nothing was commanded before the first stamp."""
        stamps = self.odometry[:, 0]
        row = bisect_right(self._stamps, times) if np.ndim(times) == 0 else np.searchsorted(stamps, times, "right")
        k = np.maximum(np.asarray(row) - 1, 0)
        control = self.odometry[k, 1:] * np.asarray(row > 0)[..., None]
        return self._until[k] + control * np.asarray(times - stamps[k])[..., None], control


@right_by_construction
@dataclass(frozen=True)
class CalibratingRangeBearing:
    """Range and bearing to a landmark [x, y] by a camera that is not sure what its range means, nor where it looks.

    R by default: 0.1 m, for some two pixels in the height of a landmark at four metres, and 0.03 rad.  It is more than
    one sighting scatters about the next, on purpose: most of a camera's error is the same in the next picture.

    Raises ValueError for a landmark or R that cannot be, and for a state that is none.

    >>> depth = CalibratingRangeBearing([4.0, 3.0])
    >>> depth.h([0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0]).round(3)
    array([4.   , 0.644])
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.03**2]))
    _ideal: RangeBearing = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        ideal = RangeBearing(self.landmark, self.R)
        for name, value in (("_ideal", ideal), ("landmark", ideal.landmark), ("R", ideal.R)):
            object.__setattr__(self, name, value)

    def h(self, x: ArrayLike) -> Array:
        """[range · cos(bearing)ᵖ + b, bearing], the bearing from where the camera looks, (..., 2)."""
        x = _state(x)
        r, bearing = self._seen(x)
        return np.stack([r * np.cos(_held(bearing)) ** x[..., P] + x[..., B], bearing], axis=-1)

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (..., 2, 10)."""
        x = _state(x)
        (r, bearing), p = self._seen(x), x[..., P]
        cosine, slope = np.cos(_held(bearing)), np.where(np.abs(bearing) < _WIDEST, np.tan(bearing), 0.0)
        H = np.zeros((*x.shape[:-1], 2, SIZE))
        H[..., :3] = self._ideal.H(x[..., :3])
        H[..., 1, BETA] = -1.0
        H[..., 0, :] = (cosine**p)[..., None] * (H[..., 0, :] - (r * p * slope)[..., None] * H[..., 1, :])
        H[..., 0, B], H[..., 0, P] = 1.0, r * cosine**p * np.log(cosine)
        return H

    residual = staticmethod(RangeBearing.residual)
    unusable = staticmethod(RangeBearing.unusable)

    @staticmethod
    def wrap_state(x: Array) -> Array:
        """The state with its heading in (-π, π]."""
        return np.concatenate([RangeBearing.wrap_state(x[..., :3]), x[..., 3:]], axis=-1)

    def _seen(self, x: Array) -> Any:
        r, bearing = np.moveaxis(self._ideal.h(x[..., :3]), -1, 0)
        return r, np.asarray(wrap_angle(bearing - x[..., BETA]))


def _done(x: Array, commanded: Array) -> Array:
    """[λ v, κ ω + γ v]: what the robot does of what it was told, (..., 2)."""
    v, omega = commanded[..., 0], commanded[..., 1]
    return np.stack([x[..., LAMBDA] * v, x[..., KAPPA] * omega + x[..., GAMMA] * v], axis=-1)


def _held(bearing: Any) -> Any:
    return np.clip(bearing, -_WIDEST, _WIDEST)


def _state(x: ArrayLike) -> Array:
    x = as_numbers(x, "state")
    if x.ndim == 0 or x.shape[-1] != SIZE:
        raise ValueError(f"state: expected shape (..., {SIZE}), [x, y, θ, κ, λ, b, p, δ, γ, β], got {x.shape}")
    return x
