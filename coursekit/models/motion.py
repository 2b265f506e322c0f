"""Motion models: where the state goes, and how much less is known about it there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, generator, number
from coursekit.geometry import Array, wrap_angle
from coursekit.models._vectors import copies, entries, functions, product, sine_cosine, square, vector
from coursekit.models.checks import right_by_construction


@right_by_construction
@dataclass(frozen=True)
class DifferentialDrive:
    r"""A robot on two wheels.  State [x, y, θ] (m, m, rad); control [v, ω] (m/s, rad/s).

    Between two samples of the control the robot runs along an arc of a circle, so f is exact for a control
    that holds still.  The wheels' noise is a constant error of v and ω over the step (standard deviations
    ``sigma_v`` m/s, ``sigma_omega`` rad/s), independent from one step to the next: take smaller steps and
    the same two numbers mean *less* noise (Lab 7 measures how much less).  ``sigma_pose`` [m, m, rad] is
    what no wheel explains, over one step, along the state's own axes; it keeps Q positive definite.

    Raises ValueError for a negative or non-finite deviation, TypeError for what is no number; so does each method for
    a state or control of the wrong shape, for NaN, and for dt ≤ 0 s.

    >>> drive = DifferentialDrive(sigma_v=0.05, sigma_omega=0.1)
    >>> drive.f([0.0, 0.0, 0.0], [np.pi / 2, np.pi / 2], dt=1.0).round(3)     # a quarter circle of radius 1 m
    array([1.   , 1.   , 1.571])
    >>> F, Q = drive.F([0.0, 0.0, 0.0], [1.0, 0.0], 1.0), drive.Q([0.0, 0.0, 0.0], [1.0, 0.0], 1.0)
    >>> np.sqrt(np.diag(Q)).round(3)                                          # along, across, heading
    array([0.05, 0.05, 0.1 ])

    Source: Thrun, Burgard & Fox (2005), section 5.3, for the arc; the covariance is its first-order propagation.
    """

    sigma_v: float = 0.05
    sigma_omega: float = 0.05
    sigma_pose: tuple[float, float, float] = (1e-3, 1e-3, 1e-3)
    _wheels: Array = field(init=False, repr=False, compare=False)
    _pose_cov: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        pose = as_numbers(self.sigma_pose, "sigma_pose")
        sigmas = as_numbers([self.sigma_v, self.sigma_omega, *pose.ravel()], "sigma_v, sigma_omega")
        if sigmas.shape != (5,) or not np.all((sigmas >= 0) & (sigmas < LARGEST)):
            raise ValueError(f"expected finite standard deviations ≥ 0, one for v, one for ω, three for the pose, "
                             f"got {sigmas}")  # fmt: skip
        object.__setattr__(self, "_wheels", np.diag(sigmas[:2]))
        object.__setattr__(self, "_pose_cov", np.diag(sigmas[2:] ** 2))

    @classmethod
    def from_wheels(cls, radius: float, track: float, sigma_wheel: float, **noise: Any) -> DifferentialDrive:
        """The model whose two wheels (radius m, track m apart) each err by ``sigma_wheel`` rad/s.

        Raises ValueError for a radius or track that is not positive.
        """
        if not (radius > 0 and track > 0):
            raise ValueError(f"expected radius > 0 and track > 0 in metres, got {radius} and {track}")
        return cls(radius * sigma_wheel / np.sqrt(2), np.sqrt(2) * radius * sigma_wheel / track, **noise)

    def f(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """The pose after ``dt`` seconds: (..., 3) and (..., 2) → (..., 3).

        The chord of the arc has length v·dt·sinc(ω dt/2) and direction θ + ω dt/2: written with sinc, because
        v/ω is 0/0 on a straight line.
        """
        x, y, theta, v, omega = _pose_and_control(x, u)
        dt = _step(dt)
        half = 0.5 * omega * dt
        chord, direction = v * dt * _sinc(half), theta + half
        sine, cosine = sine_cosine(direction)
        return vector(x + chord * cosine, y + chord * sine, wrap_angle(theta + omega * dt))

    def F(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂x, (..., 3, 3)."""
        _, _, theta, v, omega = _pose_and_control(x, u)
        dt = _step(dt)
        half = 0.5 * omega * dt
        chord, direction = v * dt * _sinc(half), theta + half
        sine, cosine = sine_cosine(direction)
        F = copies(_I3, direction)
        F[..., 0, 2], F[..., 1, 2] = -chord * sine, chord * cosine
        return F

    def G(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂u, (..., 3, 2): how an error of [v, ω] that lasts for the step moves the pose."""
        _, _, theta, v, omega = _pose_and_control(x, u)
        dt = _step(dt)
        half = 0.5 * omega * dt
        s, c = sine_cosine(theta + half)
        # The chord's change with v; and, through half = ω dt/2, its turning and its shortening with ω.
        sinc, bend = _sinc(half), 0.5 * v * dt * dt
        along, across, shorter = dt * sinc, bend * sinc, bend * _sinc_slope(half)
        G = copies(_NO_G, c)
        G[..., 0, 0], G[..., 0, 1] = along * c, shorter * c - across * s
        G[..., 1, 0], G[..., 1, 1] = along * s, shorter * s + across * c
        G[..., 2, 1] = dt
        return G

    def root_M(self, u: ArrayLike, dt: float) -> Array:
        """A square root of M, the covariance of the control's error: here diag(σ_v, σ_ω), (2, 2)."""
        return self._wheels

    def Q(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """G M Gᵀ + diag(σ_pose²), (..., 3, 3), with M the covariance of the control's error."""
        return square(product(self.G(x, u, dt), self.root_M(u, dt))) + self._pose_cov

    def linearized(self, x: ArrayLike, u: ArrayLike, dt: float) -> tuple[Array, Array, Array]:
        """f, F and Q at once, for a filter of many states: the way is v ∂f/∂v, since the chord grows with v alone."""
        G = self.G(x, u, dt)  # which looks at the arguments
        x, u = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        dx, dy = u[..., 0] * G[..., 0, 0], u[..., 0] * G[..., 1, 0]
        F = copies(_I3, dx)
        F[..., 0, 2], F[..., 1, 2] = -dy, dx
        f = vector(x[..., 0] + dx, x[..., 1] + dy, wrap_angle(x[..., 2] + u[..., 1] * dt))
        return f, F, square(product(G, self.root_M(u, dt))) + self._pose_cov

    def sample(self, states: ArrayLike, u: ArrayLike, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 3) → (n, 3)."""
        states, rng = as_numbers(states, "states"), generator(rng)
        if states.ndim > 2:
            raise ValueError(f"states: expected shape (n, 3), got {states.shape}")
        entries(u, 2, "control [v, ω]")  # one number would broadcast
        check_controls(states, u)
        noise = control_noise(self.root_M(u, dt), states, rng)
        moved = self.f(states, np.asarray(u, dtype=float) + noise, dt)
        if any(self.sigma_pose):
            moved += rng.standard_normal(moved.shape) * self.sigma_pose
            moved[..., 2] = wrap_angle(moved[..., 2])
        return moved


@right_by_construction
@dataclass(frozen=True)
class SlippingWheels(DifferentialDrive):
    """A differential drive whose noise comes from its wheels: the faster one turns, the more it may slip.

    Over a step each wheel's ground speed is off by ``slip`` times its rim speed, and encoders that count whole
    ticks of ``tick`` metres round it: with the robot's own numbers this is what the world's robot does.
    ``sigma_v`` and ``sigma_omega`` are not used.

    track : between the wheels, m.     slip : a share, ≥ 0.     tick : ground covered in one encoder tick, m, ≥ 0.

    Source: Siegwart, Nourbakhsh & Scaramuzza (2011), section 5.2.4.
    """

    track: float = 0.287
    slip: float = 0.03
    tick: float = 2 * math.pi * 0.033 / 4096

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (0 < self.track < math.inf and 0 <= self.slip < math.inf and 0 <= self.tick < math.inf):
            raise ValueError(f"expected track > 0, slip ≥ 0 and tick ≥ 0, all finite, got {self}")

    def root_M(self, u: ArrayLike, dt: float) -> Array:
        """A square root of M, (..., 2, 2), one column a wheel: its error, as the body feels it in [v, ω]."""
        v, omega = entries(u, 2, "control [v, ω]")
        half = 0.5 * omega * self.track
        # A count that starts and ends between two ticks is off by tick²/6.
        rounding = self.tick**2 / (6 * _step(dt) ** 2)
        sqrt = functions(v).sqrt
        left, right = (sqrt((self.slip * rim) ** 2 + rounding) for rim in (v - half, v + half))
        root = copies(_NO_ROOT, v)
        root[..., 0, 0], root[..., 0, 1] = 0.5 * left, 0.5 * right
        root[..., 1, 0], root[..., 1, 1] = -left / self.track, right / self.track
        return root


@right_by_construction
@dataclass(frozen=True)
class ConstantVelocity:
    r"""A point that keeps its velocity but for white-noise acceleration.  State [p_x, v_x, p_y, v_y].

    ``sigma_a`` is the noise's intensity, m/s^(3/2): over a step of dt seconds the velocity's variance grows by
    sigma_a² dt, whatever the number of steps it is cut into.  The control is not used.

    Raises ValueError for an intensity that is negative or not finite, TypeError for what is no number; so does each
    method for a state that is not (4,), for NaN, and for dt ≤ 0 s.

    >>> ConstantVelocity(sigma_a=0.1).f([0.0, 1.0, 0.0, -1.0], None, dt=0.5)   # m, m/s, m, m/s
    array([ 0.5,  1. , -0.5, -1. ])

    Source: Bar-Shalom, Li & Kirubarajan (2001), eq. 6.2.2-12.
    """

    sigma_a: float = 0.1

    def __post_init__(self) -> None:
        if not 0 <= number(self.sigma_a, "sigma_a") < LARGEST:
            raise ValueError(f"sigma_a: expected a finite intensity ≥ 0, got {self.sigma_a}")

    def f(self, x: ArrayLike, u: ArrayLike | None, dt: float) -> Array:
        """The state after ``dt`` seconds, (..., 4) → (..., 4)."""
        px, vx, py, vy = entries(x, 4, "state")
        dt = _step(dt)
        return vector(px + vx * dt, vx, py + vy * dt, vy)

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
        moved, rng = self.f(states, u, dt), generator(rng)
        return np.asarray(moved + rng.standard_normal(moved.shape) @ self._noise_factor(_step(dt)).T)

    def _noise_factor(self, dt: float) -> Array:
        """L with Q = L Lᵀ: per axis, the Cholesky factor of σ_a² [[dt³/3, dt²/2], [dt²/2, dt]]."""
        a = self.sigma_a * math.sqrt(dt)
        position, shared, own = a * dt / math.sqrt(3), a * math.sqrt(0.75), 0.5 * a
        return np.array([[position, 0, 0, 0], [shared, own, 0, 0], [0, 0, position, 0], [0, 0, shared, own]])


_I3, _NO_G, _NO_ROOT = np.eye(3), np.zeros((3, 2)), np.zeros((2, 2))


def _pose_and_control(x: Any, u: Any) -> Any:
    """x, y, θ, v, ω: floats of one pose and one control, arrays of many."""
    try:
        if x.ndim == u.ndim == 1:
            (px, py, theta), (v, omega) = x.tolist(), u.tolist()
            if abs(px) + abs(py) + abs(theta) + abs(v) + abs(omega) < LARGEST:
                return px, py, theta, v, omega
    except (AttributeError, TypeError, ValueError):
        pass  # no arrays, or of the wrong size or kind: the careful way knows what to say
    pose, control = entries(x, 3, "state"), entries(u, 2, "control [v, ω]")
    check_controls(x, u)
    return *pose, *control


def check_controls(x: Any, u: Any) -> None:
    """Controls (..., 2) for states (..., 3): one for all or one for each."""
    try:
        np.broadcast_shapes(np.shape(x)[:-1], np.shape(u)[:-1])
    except ValueError:
        raise ValueError(f"control [v, ω]: expected one for all or one for each state, got shape {np.shape(u)} for "
                         f"states {np.shape(x)}; they cannot be broadcast") from None  # fmt: skip


def control_noise(root: Array, states: Array, rng: np.random.Generator) -> Array:
    """Noise of the control for each state (n, 3), (n, 2): of the covariance root rootᵀ, one (2, 2) or one for each."""
    if root.ndim > 3:
        raise ValueError("control [v, ω]: expected one for all or one for each state, got more axes")
    unit = rng.standard_normal((2, *states.shape[:-1]))
    return np.asarray((root @ unit).T if root.ndim == 2 else (root @ unit.T[..., None])[..., 0])


def _sinc(t: Any) -> Any:
    """sin(t)/t, with its limit 1 at t = 0."""
    if type(t) is float:
        return math.sin(t) / t if t else 1.0
    t = np.maximum(np.abs(t), 1e-300)
    return sine_cosine(t)[0] / t


def _sinc_slope(t: Any) -> Any:
    """Derivative of sin(t)/t; the series where the closed form cancels."""
    if type(t) is float:
        return -t / 3 + t**3 / 30 if abs(t) < 1e-3 else (t * math.cos(t) - math.sin(t)) / t**2
    near = np.abs(t) < 1e-3
    sine, cosine = sine_cosine(t)
    return np.where(near, -t / 3 + t**3 / 30, (t * cosine - sine) / np.where(near, 1.0, t) ** 2)


def _step(dt: float) -> float:
    try:
        if 0 < dt < math.inf:
            step = float(dt)  # single precision would spread to the state
            if 1 / LARGEST < step < LARGEST:
                return step
    except OverflowError:
        pass  # a whole number beyond all floats
    except (TypeError, ValueError):
        raise TypeError(f"dt: expected a time step in seconds, one number, got {dt!r}") from None
    raise ValueError(f"dt: expected a time step > 0 s, got {dt}")
