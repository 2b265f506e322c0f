r"""A robot whose instruments are not quite what they say: the part of the state that ``CalibratingSlam`` adds.

    [x, y, θ, κ, λ, b, p, τ]:  the robot runs at λ v and turns at κ ω, and its camera says range · cos(bearing)^p + b
    of where the landmark will be τ seconds after the odometry that is known.

κ = λ = 1 and b = p = τ = 0 are ideal instruments.  A commanded turn rate has κ < 1, a camera that takes depth for range
has p = 1, and odometry that runs ahead of the pictures has τ < 0.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array
from coursekit.models import range_bearing
from coursekit.models.checks import array_of
from coursekit.slam.observations import Observations

ROBOT = 8  # entries of the state before the first landmark
KAPPA, LAMBDA, OFFSET, DEPTH, DELAY = range(3, ROBOT)
_WIDEST = 1.4  # rad: beyond, cos(bearing)^p is held, for no camera sees there
_NEAREST = 0.05  # m: a landmark is never put nearer


@dataclass(frozen=True)
class Instruments:
    """What is known beforehand of κ, λ, b [m], p and τ [s]: their means and standard deviations.

    The defaults are wide: gains right to a fifth and a tenth, a range that may as well be a depth, clocks that agree to
    a fifth of a second.  ``drift`` is how far each may wander in √s.  ``Instruments.ideal()`` learns nothing.

    Raises ValueError for anything but five finite numbers each, and for deviations that are not positive.

    >>> Instruments().sigma
    (0.2, 0.1, 0.1, 0.5, 0.2)
    """

    mean: tuple[float, float, float, float, float] = (1.0, 1.0, 0.0, 0.5, 0.0)
    sigma: tuple[float, float, float, float, float] = (0.2, 0.1, 0.1, 0.5, 0.2)
    drift: float = 1e-3

    def __post_init__(self) -> None:
        array_of(self.mean, "mean", (5,))
        if not np.all(array_of(self.sigma, "sigma", (5,)) > 0):
            raise ValueError(f"sigma: expected five standard deviations > 0, got {self.sigma}")
        if not 0 <= self.drift < np.inf:
            raise ValueError(f"drift: expected a finite deviation ≥ 0, got {self.drift}")

    @classmethod
    def ideal(cls) -> Instruments:
        """Instruments that are what they say."""
        return cls((1.0, 1.0, 0.0, 0.0, 0.0), (1e-6,) * 5, 0.0)


def meant(x: Array, control: Array) -> Array:
    """[λ v, κ ω]: what the robot does of what its odometry says, (2,)."""
    return np.array([x[LAMBDA] * control[0], x[KAPPA] * control[1]])


def camera(x: Array, control: Array) -> tuple[Array, Array]:
    """The pose (3,) from which the picture was taken, and its derivative by the robot's state (3, 8)."""
    theta, tau = x[2], x[DELAY]
    v, omega = meant(x, control)
    ahead = np.array([np.cos(theta), np.sin(theta)])
    left = np.array([-ahead[1], ahead[0]])
    pose = np.array([*(x[:2] + tau * v * ahead), theta + tau * omega])
    A = np.zeros((3, ROBOT))
    A[:, :3] = np.eye(3)
    A[:2, 2], A[:2, LAMBDA], A[:2, DELAY] = tau * v * left, tau * control[0] * ahead, v * ahead
    A[2, KAPPA], A[2, DELAY] = tau * control[1], omega
    return pose, A


def seen(x: Array, control: Array, landmarks: Array) -> tuple[Array, Array, Array]:
    """h (n, 2) of landmarks (n, 2), ∂h/∂robot (n, 2, 8) and ∂h/∂landmark (n, 2, 2)."""
    pose, A = camera(x, control)
    ideal = range_bearing.h(pose, landmarks)
    r, bearing = ideal[:, 0], np.clip(ideal[:, 1], -_WIDEST, _WIDEST)
    p, cosine = x[DEPTH], np.cos(bearing)
    slope = np.where(np.abs(ideal[:, 1]) < _WIDEST, np.tan(bearing), 0.0)
    M = np.zeros((len(r), 2, 2))
    M[:, 0, 0], M[:, 0, 1], M[:, 1, 1] = cosine**p, -r * p * cosine**p * slope, 1.0
    H = M @ range_bearing.H(pose, landmarks) @ A
    H[:, 0, OFFSET] += 1.0
    H[:, 0, DEPTH] += r * cosine**p * np.log(cosine)
    z = np.stack([r * cosine**p + x[OFFSET], ideal[:, 1]], axis=-1)
    return z, H, M @ range_bearing.H_landmark(pose, landmarks)


def placed(x: Array, control: Array, z: ArrayLike) -> Array:
    """Where the landmarks are that are seen as z (n, 2): the inverse of ``seen``, (n, 2)."""
    z = np.asarray(z, dtype=float)
    pose, _ = camera(x, control)
    r = (z[:, 0] - x[OFFSET]) / np.cos(np.clip(z[:, 1], -_WIDEST, _WIDEST)) ** x[DEPTH]
    return range_bearing.g(pose, np.stack([np.maximum(r, _NEAREST), z[:, 1]], axis=-1))


@dataclass(frozen=True, eq=False)
class CalibratedObservations(Observations):
    """Observations by instruments that are not ideal: ``covariances`` are those of the robot's eight entries."""

    robot: Array = field(kw_only=True)
    control: Array = field(kw_only=True)

    @cached_property
    def _seen(self) -> tuple[Array, Array, Array]:
        return seen(self.robot, self.control, self.landmarks)

    @cached_property
    def jacobians(self) -> tuple[Array, Array]:
        """∂h/∂robot (n, 2, 8) and ∂h/∂landmark (n, 2, 2)."""
        return self._seen[1:]

    @cached_property
    def innovations(self) -> Array:
        """Measurement i minus what landmark j would give, (m, n, 2)."""
        return range_bearing.residual(self.z[:, None], self._seen[0])

    @cached_property
    def metres(self) -> Array:
        """How far from landmark j measurement i puts its own, (m, n)."""
        points = placed(self.robot, self.control, self.z)
        return np.linalg.norm(points[:, None] - self.landmarks, axis=-1)
