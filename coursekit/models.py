r"""Motion and sensor models: every function with its Jacobian beside it.

A motion model has ``f(x, u, dt)``, ``F(x, u, dt)`` = ∂f/∂x, ``Q(x, u, dt)`` (its noise in state space) and
``sample(states, u, dt, rng)``.  A sensor model has ``h(x)``, ``H(x)`` = ∂h/∂x, ``R`` and
``residual(z, z_hat)``.  Any object with these serves the filters; there is no base class.

``f``, ``h`` and ``residual`` broadcast over leading axes, so that a filter's mean and a cloud of particles use
the same line.

Source: Thrun, Burgard & Fox (2005), chapters 5 and 6; Bar-Shalom, Li & Kirubarajan (2001), section 6.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import check_covariance
from coursekit.geometry import Array, wrap_angle


class MotionModel(Protocol):
    """What a filter asks of a motion model."""

    def f(self, x: Array, u: Array, dt: float) -> Array: ...
    def F(self, x: Array, u: Array, dt: float) -> Array: ...
    def Q(self, x: Array, u: Array, dt: float) -> Array: ...
    def sample(self, states: Array, u: Array, dt: float, rng: np.random.Generator) -> Array: ...


class SensorModel(Protocol):
    """What a filter asks of a sensor model."""

    @property
    def R(self) -> Array: ...
    def h(self, x: Array) -> Array: ...
    def H(self, x: Array) -> Array: ...
    def residual(self, z: Array, z_hat: Array) -> Array: ...


def pose_residual(a: ArrayLike, b: ArrayLike) -> Array:
    """a - b for poses (..., 3), with the heading's difference in (-π, π]."""
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return np.concatenate([difference[..., :2], wrap_angle(difference[..., 2:3])], axis=-1)


@dataclass(frozen=True)
class DifferentialDrive:
    r"""A robot on two wheels.  State [x, y, θ] (m, m, rad); control [v, ω] (m/s, rad/s).

    Between two samples of the control the robot runs along an arc of a circle, so f is exact for a control
    that holds still.  The wheels' noise is a constant error of v and ω over the step (standard deviations
    ``sigma_v`` m/s, ``sigma_omega`` rad/s), independent from one step to the next: take smaller steps and
    the same two numbers mean *less* noise (Lab 7 measures how much less).  ``sigma_slip`` [m, m, rad] is
    what no wheel explains, over one step, along the state's own axes; it keeps Q positive definite.
    """

    sigma_v: float = 0.05
    sigma_omega: float = 0.05
    sigma_slip: tuple[float, float, float] = (1e-3, 1e-3, 1e-3)

    def __post_init__(self) -> None:
        sigmas = np.array([self.sigma_v, self.sigma_omega, *self.sigma_slip], dtype=float)
        if sigmas.shape != (5,) or not np.all(np.isfinite(sigmas)) or np.any(sigmas < 0):
            raise ValueError(f"expected five finite standard deviations ≥ 0, got {sigmas}")

    @classmethod
    def from_wheels(cls, radius: float, track: float, sigma_wheel: float, **noise: tuple) -> DifferentialDrive:
        """The model whose two wheels (radius m, track m apart) each err by ``sigma_wheel`` rad/s."""
        return cls(radius * sigma_wheel / np.sqrt(2), np.sqrt(2) * radius * sigma_wheel / track, **noise)

    def f(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """The pose after ``dt`` seconds: (..., 3) and (..., 2) → (..., 3).

        Written with sinc instead of v/ω, which is 0/0 on a straight line:
        the chord of the arc has length v·dt·sinc(ω dt/2) and direction θ + ω dt/2.
        """
        (x,), (v, omega) = _state(x, 3), _control(u)
        _check_dt(dt)
        half = 0.5 * omega * dt
        chord, direction = v * dt * _sinc(half), x[..., 2] + half
        return np.stack(
            [
                x[..., 0] + chord * np.cos(direction),
                x[..., 1] + chord * np.sin(direction),
                wrap_angle(x[..., 2] + omega * dt),
            ],
            axis=-1,
        )

    def F(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂x, (3, 3)."""
        (x,), (v, omega) = _state(x, 3), _control(u)
        half = 0.5 * omega * dt
        chord, direction = v * dt * _sinc(half), x[2] + half
        return np.array([[1, 0, -chord * np.sin(direction)], [0, 1, chord * np.cos(direction)], [0, 0, 1]])

    def G(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂u, (3, 2): how an error of [v, ω] that lasts for the step moves the pose."""
        (x,), (v, omega) = _state(x, 3), _control(u)
        half = 0.5 * omega * dt
        c, s, sinc = np.cos(x[2] + half), np.sin(x[2] + half), _sinc(half)
        chord, slope = v * dt * sinc, v * dt * _sinc_slope(half)
        return 0.5 * dt * np.array([[2 * sinc * c, slope * c - chord * s], [2 * sinc * s, slope * s + chord * c], [0, 2]])  # fmt: skip

    def Q(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """G diag(σ_v², σ_ω²) Gᵀ + diag(σ_slip²), (3, 3)."""
        G = self.G(x, u, dt) * [self.sigma_v, self.sigma_omega]
        return G @ G.T + np.diag(np.square(self.sigma_slip))

    def sample(self, states: ArrayLike, u: ArrayLike, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 3) → (n, 3)."""
        (states,) = _state(states, 3)
        noise = rng.standard_normal((*states.shape[:-1], 2)) * [self.sigma_v, self.sigma_omega]
        moved = self.f(states, np.asarray(u, dtype=float) + noise, dt)
        if any(self.sigma_slip):
            moved += rng.standard_normal(moved.shape) * self.sigma_slip
            moved[..., 2] = wrap_angle(moved[..., 2])
        return moved


@dataclass(frozen=True)
class ConstantVelocity:
    r"""A point that keeps its velocity but for white-noise acceleration.  State [p_x, v_x, p_y, v_y].

    ``sigma_a`` is the noise's intensity, m/s^(3/2): over a step of dt seconds the velocity's variance grows by
    sigma_a² dt, whatever the number of steps it is cut into.  The control is not used.

    Source: Bar-Shalom, Li & Kirubarajan (2001), eq. 6.2.2-12.
    """

    sigma_a: float = 0.1

    def f(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        (x,) = _state(x, 4)
        return np.asarray(x @ self.F(x, u, dt).T)

    def F(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        _check_dt(dt)
        return np.kron(np.eye(2), [[1.0, dt], [0.0, 1.0]])

    def Q(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        _check_dt(dt)
        return self.sigma_a**2 * np.kron(np.eye(2), [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])

    def sample(self, states: ArrayLike, u: ArrayLike | None, dt: float, rng: np.random.Generator) -> Array:
        (states,) = _state(states, 4)
        noise = rng.standard_normal(states.shape) @ np.linalg.cholesky(self.Q(states, u, dt)).T
        return np.asarray(self.f(states, u, dt) + noise)


@dataclass(frozen=True)
class RangeBearing:
    """Range [m] and bearing [rad, positive to the left] from a pose [x, y, θ] to a landmark [x, y] in the world."""

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.02**2]))

    def __post_init__(self) -> None:
        object.__setattr__(self, "landmark", _landmark(self.landmark))
        object.__setattr__(self, "R", check_covariance(self.R, "R", size=2))

    def h(self, x: ArrayLike) -> Array:
        """(..., 3) → (..., 2)."""
        (x,) = _state(x, 3)
        dx, dy = self.landmark[0] - x[..., 0], self.landmark[1] - x[..., 1]
        return np.stack([np.hypot(dx, dy), wrap_angle(np.arctan2(dy, dx) - x[..., 2])], axis=-1)

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (2, 3).  Raises ValueError on top of the landmark, where the bearing has no derivative."""
        (x,) = _state(x, 3)
        dx, dy = self.landmark - x[:2]
        r = _distance(dx, dy)
        return np.array([[-dx / r, -dy / r, 0.0], [dy / r**2, -dx / r**2, -1.0]])

    def residual(self, z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat with the bearing's difference in (-π, π], (..., 2)."""
        difference = np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)
        return np.concatenate([difference[..., :1], wrap_angle(difference[..., 1:])], axis=-1)


@dataclass(frozen=True)
class RangeOnly:
    """Distance [m] to a landmark [x, y]; ``position`` names the state's entries that hold x and y.

    The default (0, 2) fits ``ConstantVelocity``; for a pose [x, y, θ] give ``position=(0, 1)``.
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2]))
    position: tuple[int, int] = (0, 2)

    def __post_init__(self) -> None:
        object.__setattr__(self, "landmark", _landmark(self.landmark))
        object.__setattr__(self, "R", check_covariance(self.R, "R", size=1))

    def h(self, x: ArrayLike) -> Array:
        """(..., n) → (..., 1)."""
        x = np.asarray(x, dtype=float)
        i, j = self.position
        return np.hypot(x[..., i] - self.landmark[0], x[..., j] - self.landmark[1])[..., None]

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (1, n): the unit vector from the landmark, in the two position columns."""
        x = np.asarray(x, dtype=float)
        i, j = self.position
        dx, dy = x[i] - self.landmark[0], x[j] - self.landmark[1]
        H = np.zeros((1, x.size))
        H[0, [i, j]] = np.array([dx, dy]) / _distance(dx, dy)
        return H

    def residual(self, z: ArrayLike, z_hat: ArrayLike) -> Array:
        return np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)


@dataclass(frozen=True)
class Position:
    """A fix [x, y] in metres; ``position`` names the state's entries that hold x and y, (0, 1) for a pose."""

    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.1**2]))
    position: tuple[int, int] = (0, 1)

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", check_covariance(self.R, "R", size=2))

    def h(self, x: ArrayLike) -> Array:
        return np.asarray(x, dtype=float)[..., list(self.position)]

    def H(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        return np.eye(x.size)[list(self.position)]

    def residual(self, z: ArrayLike, z_hat: ArrayLike) -> Array:
        return np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)


def _sinc(t: Array) -> Array:
    """sin(t)/t, with its limit 1 at t = 0."""
    return np.sinc(np.asarray(t) / np.pi)


def _sinc_slope(t: float) -> float:
    """Derivative of sin(t)/t; the series where the closed form cancels."""
    if abs(t) < 1e-3:
        return -t / 3 + t**3 / 30
    return float((t * np.cos(t) - np.sin(t)) / t**2)


def _state(x: ArrayLike, size: int) -> tuple[Array]:
    x = np.asarray(x, dtype=float)
    if x.ndim == 0 or x.shape[-1] != size:
        raise ValueError(f"state: expected shape (..., {size}), got {x.shape}")
    return (x,)


def _control(u: ArrayLike) -> tuple[Array, Array]:
    u = np.asarray(u, dtype=float)
    if u.ndim == 0 or u.shape[-1] != 2:
        raise ValueError(f"control: expected [v, ω] of shape (..., 2), got {u.shape}")
    return u[..., 0], u[..., 1]


def _landmark(landmark: ArrayLike) -> Array:
    landmark = np.array(landmark, dtype=float)
    if landmark.shape != (2,) or not np.all(np.isfinite(landmark)):
        raise ValueError(f"landmark: expected a finite [x, y], got {landmark!r}")
    landmark.flags.writeable = False
    return landmark


def _distance(dx: float, dy: float) -> float:
    distance = float(np.hypot(dx, dy))
    if distance < 1e-9:
        raise ValueError("the robot stands on the landmark: range and bearing have no derivative there")
    return distance


def _check_dt(dt: float) -> None:
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt: expected a time step > 0 s, got {dt}")
