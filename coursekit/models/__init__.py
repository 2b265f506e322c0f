r"""Motion and sensor models: every function with its Jacobian beside it.

A motion model has ``f(x, u, dt)``, ``F(x, u, dt)`` = ∂f/∂x, ``Q(x, u, dt)`` (its noise in state space) and
``sample(states, u, dt, rng)``.  A sensor model has ``h(x)``, ``H(x)`` = ∂h/∂x, ``R`` and
``residual(z, z_hat)``; one whose state holds an angle may have ``wrap_state(x)`` too, and one that knows what cannot
have been measured ``unusable(z)``, a reason or "".  Any object with these serves the filters; there is no base class.

What a model answers is checked where a filter asks (see ``checks``), and the error names the part that is wrong: a
wrong *type* (a part that is missing, a class in place of an object, text or objects in place of numbers) is a
TypeError, a wrong *value* (a shape, NaN, a covariance that is none) is a ValueError.  So it is for every argument of
the estimators.

Everything broadcasts over leading axes, so that a filter's mean, a cloud of particles and the hundred runs of an
experiment use the same lines: f and h of states (..., n), Jacobians and Q with the same leading axes, or one matrix for
all where it does not depend on the state.  ``linearized`` gives f, F, Q (or h, H) at once, where that is cheaper.

motion       ``DifferentialDrive``, ``SlippingWheels``, ``ConstantVelocity``
sensors      ``RangeBearing``, ``RangeOnly``, ``Position``
unknowns     ``ScaledRange``, ``WithConstants``: a radio's scale and offset, and other constants in the state
numerical    ``Numerical``, ``jacobian``: for a model without a Jacobian

Source: Thrun, Burgard & Fox (2005), chapters 5 and 6; Bar-Shalom, Li & Kirubarajan (2001), section 6.2.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle
from coursekit.models.motion import ConstantVelocity, DifferentialDrive, SlippingWheels
from coursekit.models.numerical import Numerical, jacobian
from coursekit.models.sensors import Position, RangeBearing, RangeOnly
from coursekit.models.steady import SteadyNoiseDrive
from coursekit.models.unknowns import ScaledRange, WithConstants

__all__ = [
    "ConstantVelocity",
    "DifferentialDrive",
    "MotionModel",
    "MotionSampler",
    "Numerical",
    "Position",
    "RangeBearing",
    "RangeOnly",
    "SampledMotion",
    "ScaledRange",
    "SensorModel",
    "SlippingWheels",
    "SteadyNoiseDrive",
    "WithConstants",
    "jacobian",
    "pose_residual",
]


class MotionModel(Protocol):
    """What a Kalman filter asks of a motion model."""

    def f(self, x: Array, u: Any, dt: float, /) -> Array: ...
    def F(self, x: Array, u: Any, dt: float, /) -> Array: ...
    def Q(self, x: Array, u: Any, dt: float, /) -> Array: ...


class MotionSampler(Protocol):
    """What a particle filter asks of a motion model."""

    def sample(self, states: Array, u: Any, dt: float, rng: np.random.Generator, /) -> Array: ...


class SampledMotion(MotionModel, MotionSampler, Protocol):
    """A motion model for both kinds of filter."""


class SensorModel(Protocol):
    """What a filter asks of a sensor model."""

    @property
    def R(self) -> Array: ...
    def h(self, x: Array, /) -> Array: ...
    def H(self, x: Array, /) -> Array: ...
    def residual(self, z: Any, z_hat: Any, /) -> Array: ...


def pose_residual(a: ArrayLike, b: ArrayLike) -> Array:
    """a - b for poses (..., 3), with the heading's difference in (-π, π].

    NaN and infinity come out as NaN.  Raises ValueError for other shapes, TypeError for what are no numbers.
    """
    a, b = as_numbers(a, "a"), as_numbers(b, "b")
    try:
        with np.errstate(invalid="ignore"):
            difference = a - b
    except ValueError:
        difference = np.empty(0)
    if difference.shape[-1:] != (3,) or a.shape[-1:] != (3,) or b.shape[-1:] != (3,):
        raise ValueError(f"expected two poses [x, y, θ], (..., 3) each, got shapes {a.shape} and {b.shape}")
    return np.concatenate([difference[..., :2], wrap_angle(difference[..., 2:3])], axis=-1)
