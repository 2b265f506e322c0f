r"""Motion and sensor models: every function with its Jacobian beside it.

A motion model has ``f(x, u, dt)``, ``F(x, u, dt)`` = ∂f/∂x, ``Q(x, u, dt)`` (its noise in state space) and
``sample(states, u, dt, rng)``.  A sensor model has ``h(x)``, ``H(x)`` = ∂h/∂x, ``R`` and
``residual(z, z_hat)``.  Any object with these serves the filters; there is no base class.

``f``, ``h``, ``g`` and ``residual`` broadcast over leading axes, so that a filter's mean and a cloud of particles
use the same line; Jacobians are those of one state.  NumPy and ``math`` give the functions below the same names,
so that line runs on arrays and, ten times faster, on the plain floats of a single state.

Source: Thrun, Burgard & Fox (2005), chapters 5 and 6; Bar-Shalom, Li & Kirubarajan (2001), section 6.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import check_covariance
from coursekit.geometry import Array, wrap_angle


class MotionModel(Protocol):
    """What a filter asks of a motion model."""

    def f(self, x: Array, u: Any, dt: float) -> Array: ...
    def F(self, x: Array, u: Any, dt: float) -> Array: ...
    def Q(self, x: Array, u: Any, dt: float) -> Array: ...
    def sample(self, states: Array, u: Any, dt: float, rng: np.random.Generator) -> Array: ...


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

    Raises ValueError for a negative or non-finite deviation; so does each method for a state or control of the
    wrong shape, for NaN, and for dt ≤ 0.
    """

    sigma_v: float = 0.05
    sigma_omega: float = 0.05
    sigma_slip: tuple[float, float, float] = (1e-3, 1e-3, 1e-3)
    _wheels: Array = field(init=False, repr=False, compare=False)
    _slip: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        sigmas = np.array([self.sigma_v, self.sigma_omega, *self.sigma_slip], dtype=float)
        if sigmas.shape != (5,) or not np.all(np.isfinite(sigmas)) or np.any(sigmas < 0):
            raise ValueError(f"expected five finite standard deviations ≥ 0, got {sigmas}")
        object.__setattr__(self, "_wheels", np.diag(sigmas[:2] ** 2))
        object.__setattr__(self, "_slip", np.diag(sigmas[2:] ** 2))

    @classmethod
    def from_wheels(cls, radius: float, track: float, sigma_wheel: float, **noise: Any) -> DifferentialDrive:
        """The model whose two wheels (radius m, track m apart) each err by ``sigma_wheel`` rad/s."""
        if not (radius > 0 and track > 0):
            raise ValueError(f"expected radius > 0 and track > 0 in metres, got {radius} and {track}")
        return cls(radius * sigma_wheel / np.sqrt(2), np.sqrt(2) * radius * sigma_wheel / track, **noise)

    def f(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """The pose after ``dt`` seconds: (..., 3) and (..., 2) → (..., 3).

        The chord of the arc has length v·dt·sinc(ω dt/2) and direction θ + ω dt/2: written with sinc, because
        v/ω is 0/0 on a straight line.
        """
        (x, y, theta), (v, omega) = _entries(x, 3, "state"), _entries(u, 2, "control [v, ω]")
        half = 0.5 * omega * _step(dt)
        chord, direction = v * dt * _sinc(half), theta + half
        m = _functions(direction)
        return _vector(x + chord * m.cos(direction), y + chord * m.sin(direction), wrap_angle(theta + omega * dt))

    def F(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂x, (3, 3)."""
        (_, _, theta), (v, omega) = _entries(x, 3, "state", one=True), _entries(u, 2, "control [v, ω]", one=True)
        half = 0.5 * omega * _step(dt)
        chord, direction = v * dt * _sinc(half), theta + half
        F = _I3.copy()
        F[0, 2], F[1, 2] = -chord * math.sin(direction), chord * math.cos(direction)
        return F

    def G(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂u, (3, 2): how an error of [v, ω] that lasts for the step moves the pose."""
        (_, _, theta), (v, omega) = _entries(x, 3, "state", one=True), _entries(u, 2, "control [v, ω]", one=True)
        half = 0.5 * omega * _step(dt)
        c, s = math.cos(theta + half), math.sin(theta + half)
        # The chord's change with v; and, through half = ω dt/2, its turning and its shortening with ω.
        along, across, shorter = dt * _sinc(half), 0.5 * v * dt**2 * _sinc(half), 0.5 * v * dt**2 * _sinc_slope(half)
        G = np.zeros((3, 2))
        G[0, 0], G[0, 1] = along * c, shorter * c - across * s
        G[1, 0], G[1, 1] = along * s, shorter * s + across * c
        G[2, 1] = dt
        return G

    def Q(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """G diag(σ_v², σ_ω²) Gᵀ + diag(σ_slip²), (3, 3)."""
        G = self.G(x, u, dt)
        return G.dot(self._wheels).dot(G.T) + self._slip

    def sample(self, states: ArrayLike, u: ArrayLike, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 3) → (n, 3)."""
        states = np.asarray(states, dtype=float)
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

    def __post_init__(self) -> None:
        if not (math.isfinite(self.sigma_a) and self.sigma_a >= 0):
            raise ValueError(f"sigma_a: expected a finite intensity ≥ 0, got {self.sigma_a}")

    def f(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        """The state after ``dt`` seconds, (..., 4) → (..., 4)."""
        px, vx, py, vy = _entries(x, 4, "state")
        dt = _step(dt)
        return _vector(px + vx * dt, vx, py + vy * dt, vy)

    def F(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        """∂f/∂x, (4, 4), the same for every state."""
        dt = _step(dt)
        return np.array([[1.0, dt, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, dt], [0.0, 0.0, 0.0, 1.0]])

    def Q(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        """The covariance that the acceleration's noise leaves after ``dt`` seconds, (4, 4)."""
        L = self._noise_factor(_step(dt))
        return L.dot(L.T)

    def sample(self, states: ArrayLike, u: ArrayLike | None, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 4) → (n, 4)."""
        moved = self.f(states, u, dt)
        return np.asarray(moved + rng.standard_normal(moved.shape) @ self._noise_factor(dt).T)

    def _noise_factor(self, dt: float) -> Array:
        """L with Q = L Lᵀ: per axis, the Cholesky factor of σ_a² [[dt³/3, dt²/2], [dt²/2, dt]]."""
        a = self.sigma_a * math.sqrt(dt)
        position, shared, own = a * dt / math.sqrt(3), a * math.sqrt(0.75), 0.5 * a
        return np.array([[position, 0, 0, 0], [shared, own, 0, 0], [0, 0, position, 0], [0, 0, shared, own]])


@dataclass(frozen=True)
class RangeBearing:
    """Range [m] and bearing [rad, positive to the left] from a pose [x, y, θ] to a landmark [x, y] in the world.

    The inverse measurement ``g`` goes the other way, from a pose and a measurement to the landmark; it needs no
    landmark and so no instance.  Raises ValueError for a landmark or R that cannot be.
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.02**2]))

    def __post_init__(self) -> None:
        object.__setattr__(self, "landmark", _landmark(self.landmark))
        object.__setattr__(self, "R", _noise(self.R, size=2))

    def h(self, x: ArrayLike) -> Array:
        """(..., 3) → (..., 2)."""
        x, y, theta = _entries(x, 3, "state")
        lx, ly = self.landmark.tolist()
        dx, dy = lx - x, ly - y
        m = _functions(theta)
        return _vector(m.hypot(dx, dy), wrap_angle(m.atan2(dy, dx) - theta))

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (2, 3).  Raises ValueError on top of the landmark, where the bearing has no derivative."""
        dx, dy, r = self._offset(x)
        H = np.empty((2, 3))
        H[0, 0], H[0, 1], H[0, 2] = -dx / r, -dy / r, 0.0
        H[1, 0], H[1, 1], H[1, 2] = dy / r**2, -dx / r**2, -1.0
        return H

    def H_landmark(self, x: ArrayLike) -> Array:
        """∂h/∂landmark, (2, 2): minus the position's columns of H, for only the difference counts."""
        dx, dy, r = self._offset(x)
        return np.array([[dx / r, dy / r], [-dy / r**2, dx / r**2]])

    @staticmethod
    def g(x: ArrayLike, z: ArrayLike) -> Array:
        """The inverse measurement: where the landmark is that is seen from x as z, (..., 3) and (..., 2) → (..., 2)."""
        (x, y, theta), (r, bearing) = _entries(x, 3, "state"), _entries(z, 2, "z [range, bearing]")
        direction = theta + bearing
        m = _functions(direction)
        return _vector(x + r * m.cos(direction), y + r * m.sin(direction))

    @staticmethod
    def Gx(x: ArrayLike, z: ArrayLike) -> Array:
        """∂g/∂x, (2, 3)."""
        (_, _, theta), (r, bearing) = _entries(x, 3, "state", one=True), _entries(z, 2, "z [range, bearing]", one=True)
        direction = theta + bearing
        return np.array([[1.0, 0.0, -r * math.sin(direction)], [0.0, 1.0, r * math.cos(direction)]])

    @staticmethod
    def Gz(x: ArrayLike, z: ArrayLike) -> Array:
        """∂g/∂z, (2, 2)."""
        (_, _, theta), (r, bearing) = _entries(x, 3, "state", one=True), _entries(z, 2, "z [range, bearing]", one=True)
        c, s = math.cos(theta + bearing), math.sin(theta + bearing)
        return np.array([[c, -r * s], [s, r * c]])

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat with the bearing's difference in (-π, π], (..., 2)."""
        (r, bearing), (r_hat, bearing_hat) = _entries(z, 2, "z [range, bearing]"), _entries(z_hat, 2, "z_hat")
        return _vector(r - r_hat, wrap_angle(bearing - bearing_hat))

    def _offset(self, x: ArrayLike) -> tuple[float, float, float]:
        x, y, _ = _entries(x, 3, "state", one=True)
        lx, ly = self.landmark.tolist()
        return lx - x, ly - y, _distance(lx - x, ly - y)


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
        object.__setattr__(self, "R", _noise(self.R, size=1))

    def h(self, x: ArrayLike) -> Array:
        """(..., n) → (..., 1)."""
        x = _state_holding(x, self.position)
        i, j = self.position
        return np.hypot(x[..., i] - self.landmark[0], x[..., j] - self.landmark[1])[..., None]

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (1, n): the unit vector from the landmark, in the two position columns."""
        x = _state_holding(x, self.position)
        i, j = self.position
        dx, dy = x[i] - self.landmark[0], x[j] - self.landmark[1]
        H = np.zeros((1, x.size))
        H[0, i], H[0, j] = np.array([dx, dy]) / _distance(dx, dy)
        return H

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat, (..., 1)."""
        return np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)


@dataclass(frozen=True)
class Position:
    """A fix [x, y] in metres; ``position`` names the state's entries that hold x and y, (0, 1) for a pose."""

    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.1**2]))
    position: tuple[int, int] = (0, 1)

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", _noise(self.R, size=2))

    def h(self, x: ArrayLike) -> Array:
        """(..., n) → (..., 2)."""
        return _state_holding(x, self.position)[..., list(self.position)]

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (2, n)."""
        return np.eye(_state_holding(x, self.position).size)[list(self.position)]

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat, (..., 2)."""
        return np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)


_I3 = np.eye(3)


def _entries(array: ArrayLike, size: int, name: str, one: bool = False) -> Any:
    """The entries along the last axis, after a look at the door: floats of one vector, arrays of many."""
    array = np.asarray(array, dtype=float)
    if array.shape == (size,):
        entries = array.tolist()
        if math.isfinite(sum(entries)):
            return entries
        raise ValueError(f"{name}: expected finite numbers, got {array}")
    if array.ndim == 0 or array.shape[-1] != size or one:
        expected = f"({size},)" if one else f"(..., {size})"
        raise ValueError(f"{name}: expected shape {expected}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers, got {(~np.isfinite(array)).sum()} that are not")
    return [array[..., i] for i in range(size)]


def _vector(*entries: Any) -> Array:
    """The entries put together again along a last axis."""
    if type(entries[0]) is float is type(entries[-1]):
        return np.array(entries)
    return np.stack(np.broadcast_arrays(*entries), axis=-1)


def _functions(angle: Any) -> Any:
    """The module whose sin, cos, hypot and atan2 fit: ``math`` for a float, NumPy for arrays."""
    return math if type(angle) is float else np


def _sinc(t: Any) -> Any:
    """sin(t)/t, with its limit 1 at t = 0."""
    if type(t) is float:
        return math.sin(t) / t if t else 1.0
    return np.sinc(t / np.pi)


def _sinc_slope(t: float) -> float:
    """Derivative of sin(t)/t; the series where the closed form cancels."""
    if abs(t) < 1e-3:
        return -t / 3 + t**3 / 30
    return (t * math.cos(t) - math.sin(t)) / t**2


def _state_holding(x: ArrayLike, position: tuple[int, int]) -> Array:
    x = np.asarray(x, dtype=float)
    if x.ndim == 0 or x.shape[-1] <= max(position):
        raise ValueError(f"state: expected shape (..., n) with n > {max(position)}, got {x.shape}")
    return x


def _landmark(landmark: ArrayLike) -> Array:
    landmark = np.array(landmark, dtype=float)
    if landmark.shape != (2,) or not np.all(np.isfinite(landmark)):
        raise ValueError(f"landmark: expected a finite [x, y], got {landmark!r}")
    landmark.flags.writeable = False
    return landmark


def _noise(R: ArrayLike, size: int) -> Array:
    R = check_covariance(R, "R", size=size)
    R.flags.writeable = False
    return R


def _distance(dx: float, dy: float) -> float:
    distance = math.hypot(dx, dy)
    if distance < 1e-9:
        raise ValueError("the robot stands on the landmark: range and bearing have no derivative there")
    return distance


def _step(dt: float) -> float:
    if not 0 < dt < math.inf:
        raise ValueError(f"dt: expected a time step > 0 s, got {dt}")
    return dt
