"""What a rule of association is shown, and what it may answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array
from coursekit.models import range_bearing

NEW = -1
AMBIGUOUS = -2
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Observations:
    """m measurements of range and bearing, and the n landmarks of a map that they may belong to.

    z (m, 2), R (m, 2, 2) : the measurements [m, rad] and their noise.
    pose (3,), landmarks (n, 2) : the map's mean.
    linearization_point : the pose (3,) and the landmarks (n, 2) where Jacobians are taken.
    covariances : () → covariance of the pose (3, 3), of each landmark with the pose (n, 2, 3), of each landmark
        (n, 2, 2).  A function, for some rules never ask.
    between : indices (k,) → the covariance (2k, 2k) of those landmarks with each other.
    ids, labels : for ``Known`` only: what each measurement says it saw, and the landmark each id stands for.
    """

    z: Array
    R: Array
    pose: Array
    landmarks: Array
    linearization_point: tuple[Array, Array]
    covariances: Callable[[], tuple[Array, Array, Array]]
    between: Callable[[Indices], Array]
    ids: Sequence[Any] | None = None
    labels: Mapping[Any, int] = field(default_factory=dict)

    @cached_property
    def jacobians(self) -> tuple[Array, Array]:
        """∂h/∂pose (n, 2, 3) and ∂h/∂landmark (n, 2, 2) of each landmark; NaN for one right under the robot."""
        return range_bearing.H(*self.linearization_point), range_bearing.H_landmark(*self.linearization_point)

    @cached_property
    def innovations(self) -> Array:
        """Measurement i minus what landmark j would give, the bearing wrapped, (m, n, 2)."""
        return range_bearing.residual(self.z[:, None], range_bearing.h(self.pose, self.landmarks))

    @cached_property
    def squared_distances(self) -> Array:
        """Squared Mahalanobis distances of measurement i from landmark j, (m, n); NaN under the robot."""
        Hx, Hl = self.jacobians
        pose_cov, cross_cov, landmark_cov = self.covariances()
        cross = Hl @ cross_cov @ Hx.swapaxes(1, 2)
        landmark_part = Hl @ landmark_cov @ Hl.swapaxes(1, 2)
        expected_cov = Hx @ pose_cov @ Hx.swapaxes(1, 2) + cross + cross.swapaxes(1, 2) + landmark_part
        S = expected_cov + self.R[:, None]
        a, b, c = S[..., 0, 0], S[..., 0, 1], S[..., 1, 1]
        u, v = self.innovations[..., 0], self.innovations[..., 1]
        return np.asarray((c * u**2 - 2 * b * u * v + a * v**2) / (a * c - b * b))

    @cached_property
    def metres(self) -> Array:
        """How far from landmark j measurement i puts its own landmark, (m, n)."""
        return np.linalg.norm(range_bearing.g(self.pose, self.z)[:, None] - self.landmarks, axis=-1)


class Association(Protocol):
    """What SLAM asks of a rule: one landmark, ``NEW`` or ``AMBIGUOUS`` for each measurement, no landmark twice."""

    def __call__(self, observations: Observations) -> Indices: ...


def check_answer(answer: Any, measurements: int, landmarks: int) -> Indices:
    """A copy of what a rule answered, or an error that says why it cannot be: a rule may be anybody's."""
    chosen = np.array(answer)
    if chosen.size and chosen.dtype.kind not in "iu":
        raise TypeError(f"associate: expected whole numbers, got {answer!r}")
    if chosen.shape != (measurements,):
        raise ValueError(f"associate: expected one landmark for each of {measurements} measurements, got {answer!r}")
    named = [j for j in chosen.tolist() if j >= 0]
    if len(set(named)) < len(named) or not all(AMBIGUOUS <= j < landmarks for j in chosen.tolist()):
        raise ValueError(
            f"associate: expected NEW, AMBIGUOUS or landmarks below {landmarks}, none twice, got {answer!r}"
        )
    return chosen.astype(np.intp)
