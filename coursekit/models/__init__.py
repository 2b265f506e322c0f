r"""Motion and sensor models: every function with its Jacobian beside it.

A motion model has ``f(x, u, dt)``, ``F(x, u, dt)`` = ∂f/∂x, ``Q(x, u, dt)`` (its noise in state space) and
``sample(states, u, dt, rng)``.  A sensor model has ``h(x)``, ``H(x)`` = ∂h/∂x, ``R`` and
``residual(z, z_hat)``; one whose state holds an angle may have ``wrap_state(x)`` too.  Any object with these serves
the filters; there is no base class.

``f``, ``h``, ``g`` and ``residual`` broadcast over leading axes, so that a filter's mean and a cloud of particles
use the same line; Jacobians are those of one state.

motion       ``DifferentialDrive``, ``CreepingWheels``, ``ConstantVelocity``
sensors      ``RangeBearing``, ``RangeOnly``, ``Position``

Source: Thrun, Burgard & Fox (2005), chapters 5 and 6; Bar-Shalom, Li & Kirubarajan (2001), section 6.2.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, wrap_angle
from coursekit.models.motion import ConstantVelocity, CreepingWheels, DifferentialDrive
from coursekit.models.sensors import Position, RangeBearing, RangeOnly

__all__ = [
    "ConstantVelocity",
    "CreepingWheels",
    "DifferentialDrive",
    "MotionModel",
    "Position",
    "RangeBearing",
    "RangeOnly",
    "SensorModel",
    "pose_residual",
]


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
    def residual(self, z: Any, z_hat: Any) -> Array: ...


def pose_residual(a: ArrayLike, b: ArrayLike) -> Array:
    """a - b for poses (..., 3), with the heading's difference in (-π, π]."""
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return np.concatenate([difference[..., :2], wrap_angle(difference[..., 2:3])], axis=-1)
