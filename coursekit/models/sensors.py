"""Sensor models: what would be measured in a state, and how that changes with it."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.gaussian import check_covariance
from coursekit.geometry import Array, wrap_angle
from coursekit.models import range_bearing
from coursekit.models._vectors import entries, functions, vector
from coursekit.models.checks import right_by_construction


@right_by_construction
@dataclass(frozen=True)
class RangeBearing:
    """Range [m] and bearing [rad, positive to the left] from a pose [x, y, θ] to a landmark [x, y] in the world.

    The inverse measurement ``g`` goes the other way, from a pose and a measurement to the landmark; it needs no
    landmark and so no instance.  R (2, 2), m² and rad².  Raises ValueError for a landmark or R that cannot be.

    >>> RangeBearing([3.0, 4.0]).h([0.0, 0.0, 0.0]).round(3)
    array([5.   , 0.927])
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.02**2]))

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, landmark: ArrayLike, R: ArrayLike = ...) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "landmark", _landmark(self.landmark))
        object.__setattr__(self, "R", _noise(self.R, size=2))

    def h(self, x: ArrayLike) -> Array:
        """(..., 3) → (..., 2).

        Raises ValueError for one pose on top of the landmark, which has no bearing from there.  Of many poses, one
        that stands on it gets the range 0 and a bearing of -θ: a cloud of particles is not lost over one of them.
        """
        return range_bearing.seen(*self._offset(x))

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (..., 2, 3).  Raises ``Undefined``, a ValueError, on top of the landmark, where the bearing has no
        derivative; of many poses, one that stands there gets NaN, and the others do not suffer from it."""
        dx, dy, _ = self._offset(x)
        return range_bearing.by_pose(dx, dy, _distance(dx, dy))

    def linearized(self, x: ArrayLike) -> tuple[Array, Array]:
        """h and H at once, for a filter of many poses; as H does, NaN for one on top of the landmark."""
        dx, dy, theta = self._offset(x)
        r = _distance(dx, dy)
        h = vector(r, wrap_angle(functions(theta).atan2(dy, dx) - theta))
        return h, range_bearing.by_pose(dx, dy, r)

    def H_landmark(self, x: ArrayLike) -> Array:
        """∂h/∂landmark, (..., 2, 2): minus the position's columns of H, for only the difference counts."""
        return -self.H(x)[..., :2]

    g = staticmethod(range_bearing.g)
    Gx = staticmethod(range_bearing.Gx)
    Gz = staticmethod(range_bearing.Gz)
    residual = staticmethod(range_bearing.residual)
    unusable = staticmethod(range_bearing.unusable)

    @staticmethod
    def wrap_state(x: Array) -> Array:
        """The pose with its heading in (-π, π]: what a filter asks for after it has added a correction."""
        if x.ndim > 1:
            x = x.copy()
            x[..., 2] = wrap_angle(x[..., 2])
            return x
        if not -math.pi < x[2] <= math.pi:
            x = np.array([x[0], x[1], wrap_angle(float(x[2]))])
        return x

    def _offset(self, x: ArrayLike) -> Any:
        """Δx and Δy from the pose to the landmark, and θ: floats of one pose, arrays of many."""
        x, y, theta = entries(x, 3, "state")
        lx, ly = self.landmark.tolist()
        return lx - x, ly - y, theta


@right_by_construction
@dataclass(frozen=True)
class RangeOnly:
    """Distance [m] to a landmark [x, y]; ``position`` names the state's entries that hold x and y.

    The default (0, 2) fits ``ConstantVelocity``; for a pose [x, y, θ] give ``position=(0, 1)``.  R (1, 1), m².
    Raises ValueError for a landmark or R that cannot be, and for a state without these entries.

    >>> RangeOnly([3.0, 4.0], position=(0, 1)).h([0.0, 0.0, 0.3])
    array([5.])
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2]))
    position: tuple[int, int] = (0, 2)

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, landmark: ArrayLike, R: ArrayLike = ..., position: tuple[int, int] = (0, 2)) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "landmark", _landmark(self.landmark))
        object.__setattr__(self, "R", _noise(self.R, size=1))
        object.__setattr__(self, "position", _columns(self.position))

    def h(self, x: ArrayLike) -> Array:
        """(..., n) → (..., 1); zero on top of the landmark, where H raises."""
        x = _state_holding(x, self.position)
        i, j = self.position
        dx, dy = x[..., i] - self.landmark[0], x[..., j] - self.landmark[1]
        return np.sqrt(dx * dx + dy * dy)[..., None]  # np.hypot guards against overflow, at three times the price

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (..., 1, n): the unit vector from the landmark, in the two position columns.

        Raises ``Undefined``, a ValueError, on top of the landmark, where the range is 0 but has no derivative; of many
        states, one that stands there gets NaN.
        """
        x = _state_holding(x, self.position)
        i, j = self.position
        dx, dy = x[..., i] - self.landmark[0], x[..., j] - self.landmark[1]
        H = np.zeros((*x.shape[:-1], 1, x.shape[-1]))
        H[..., 0, i], H[..., 0, j] = np.array([dx, dy]) / _distance(dx, dy)
        return H

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat, (..., 1)."""
        return _difference(z, z_hat, 1)

    @staticmethod
    def unusable(z: ArrayLike) -> str:
        """Why nothing can have measured z [m], (1,); empty when something can."""
        (r,) = entries(z, 1, "z", one=True)
        return "" if r > 0 else f"a range of {r:.4g} m"


@right_by_construction
@dataclass(frozen=True)
class Position:
    """A fix [x, y] in metres; ``position`` names the state's entries that hold x and y, (0, 1) for a pose.

    R (2, 2), m².  Raises ValueError for an R that is no covariance and for a state without these entries.

    >>> Position().h([1.0, 2.0, 0.3])
    array([1., 2.])
    """

    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.1**2]))
    position: tuple[int, int] = (0, 1)

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, R: ArrayLike = ..., position: tuple[int, int] = (0, 1)) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", _noise(self.R, size=2))
        object.__setattr__(self, "position", _columns(self.position))

    def h(self, x: ArrayLike) -> Array:
        """(..., n) → (..., 2)."""
        return _state_holding(x, self.position)[..., list(self.position)]

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (2, n), the same for every state."""
        return np.eye(_state_holding(x, self.position).shape[-1])[list(self.position)]

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat, (..., 2)."""
        return _difference(z, z_hat, 2)


def _difference(z: ArrayLike, z_hat: ArrayLike, size: int) -> Array:
    """z - z_hat, each (..., size): one number for two would broadcast."""
    z, z_hat = as_numbers(z, "z"), as_numbers(z_hat, "z_hat")
    for name, array in (("z", z), ("z_hat", z_hat)):
        if array.shape[-1:] != (size,):
            raise ValueError(f"{name}: expected shape (..., {size}), got {array.shape}")
        if array.size and not (array.min() > -LARGEST and array.max() < LARGEST):
            raise ValueError(f"{name}: expected finite numbers, got {array} (none beyond {LARGEST:g})")
    try:
        np.broadcast_shapes(z.shape, z_hat.shape)
    except ValueError:
        raise ValueError(f"z: expected a shape that goes with z_hat's {z_hat.shape}, got {z.shape}") from None
    return np.asarray(z - z_hat)


def _state_holding(x: ArrayLike, position: tuple[int, int]) -> Array:
    x = as_numbers(x, "state")
    if x.ndim == 0 or x.shape[-1] <= max(position):
        raise ValueError(f"state: expected shape (..., n) with n > {max(position)}, got {x.shape}")
    if x.size and not (x.min() > -LARGEST and x.max() < LARGEST):
        raise ValueError(f"state: expected finite numbers, got {x} (none beyond {LARGEST:g})")
    return x


def _columns(position: Any) -> tuple[int, int]:
    """Two different entries of a state, counted from 0."""
    try:
        i, j = (operator.index(column) for column in position)
    except (TypeError, ValueError, KeyError):
        raise TypeError(f"position: expected two entries of the state such as (0, 1), got {position!r}") from None
    if i == j or min(i, j) < 0:
        raise ValueError(f"position: expected two different entries, counted from 0, got {position}")
    return i, j


def _landmark(landmark: ArrayLike) -> Array:
    landmark = as_numbers(landmark, "landmark").copy()
    if landmark.shape != (2,) or not np.all(np.abs(landmark) < LARGEST):
        raise ValueError(f"landmark: expected a finite [x, y], got {landmark!r}")
    landmark.flags.writeable = False
    return landmark


def _noise(R: ArrayLike, size: int) -> Array:
    R = check_covariance(R, "R", size=size)
    R.flags.writeable = False
    return R


def _distance(dx: Any, dy: Any) -> Any:
    """Of one pose a distance, or ``Undefined``; of many, NaN on top of the landmark: the others do not suffer."""
    if functions(dx) is math:
        return range_bearing.distance(dx, dy)
    r = np.hypot(dx, dy)
    if r.ndim == 0:
        return range_bearing.distance(float(dx), float(dy))
    return np.where(r < range_bearing.TOO_NEAR, np.nan, r)
