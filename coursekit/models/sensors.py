"""Sensor models: what would be measured in a state, and how that changes with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import check_covariance
from coursekit.geometry import Array, wrap_angle
from coursekit.models._vectors import entries, functions, vector


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
        x, y, theta = entries(x, 3, "state")
        lx, ly = self.landmark.tolist()
        dx, dy = lx - x, ly - y
        m = functions(theta)
        return vector(m.hypot(dx, dy), wrap_angle(m.atan2(dy, dx) - theta))

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (2, 3).  Raises ValueError on top of the landmark, where the bearing has no derivative."""
        dx, dy, r = self._offset(x)
        H, q = np.empty((2, 3)), r * r
        H[0, 0], H[0, 1], H[0, 2] = -dx / r, -dy / r, 0.0
        H[1, 0], H[1, 1], H[1, 2] = dy / q, -dx / q, -1.0
        return H

    def H_landmark(self, x: ArrayLike) -> Array:
        """∂h/∂landmark, (2, 2): minus the position's columns of H, for only the difference counts."""
        dx, dy, r = self._offset(x)
        return np.array([[dx / r, dy / r], [-dy / r**2, dx / r**2]])

    @staticmethod
    def g(x: ArrayLike, z: ArrayLike) -> Array:
        """The inverse measurement: where the landmark is that is seen from x as z, (..., 3) and (..., 2) → (..., 2)."""
        (x, y, theta), (r, bearing) = entries(x, 3, "state"), entries(z, 2, "z [range, bearing]")
        direction = theta + bearing
        m = functions(direction)
        return vector(x + r * m.cos(direction), y + r * m.sin(direction))

    @staticmethod
    def Gx(x: ArrayLike, z: ArrayLike) -> Array:
        """∂g/∂x, (2, 3)."""
        (_, _, theta), (r, bearing) = entries(x, 3, "state", one=True), entries(z, 2, "z [range, bearing]", one=True)
        direction = theta + bearing
        return np.array([[1.0, 0.0, -r * math.sin(direction)], [0.0, 1.0, r * math.cos(direction)]])

    @staticmethod
    def Gz(x: ArrayLike, z: ArrayLike) -> Array:
        """∂g/∂z, (2, 2)."""
        (_, _, theta), (r, bearing) = entries(x, 3, "state", one=True), entries(z, 2, "z [range, bearing]", one=True)
        c, s = math.cos(theta + bearing), math.sin(theta + bearing)
        return np.array([[c, -r * s], [s, r * c]])

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat with the bearing's difference in (-π, π], (..., 2)."""
        r, bearing = entries(z, 2, "z [range, bearing]")
        r_hat, bearing_hat = entries(z_hat, 2, "z_hat")
        return vector(r - r_hat, wrap_angle(bearing - bearing_hat))

    @staticmethod
    def wrap_state(x: Array) -> Array:
        """The pose with its heading in (-π, π]: what a filter asks for after it has added a correction."""
        if not -math.pi < x[2] <= math.pi:
            x = np.array([x[0], x[1], wrap_angle(float(x[2]))])
        return x

    def _offset(self, x: ArrayLike) -> tuple[float, float, float]:
        x, y, _ = entries(x, 3, "state", one=True)
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
        dx, dy = x[..., i] - self.landmark[0], x[..., j] - self.landmark[1]
        return np.sqrt(dx * dx + dy * dy)[..., None]  # np.hypot guards against overflow, at three times the price

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
