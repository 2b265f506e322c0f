r"""Association against a map that is known: which of its landmarks was that, and where does an id stand on it?

The rules are those of SLAM, and see what they see there, with landmarks that have no uncertainty of their own.

>>> from coursekit.gaussian import Gaussian
>>> from coursekit.slam.association import JointCompatibility, Mahalanobis
>>> tags = KnownMap({6: [2.0, 0.0], 7: [0.0, 2.5], 20: [2.0, 0.4]})
>>> tags.row(20), tags.ids[2]
(2, 20)
>>> pose, R = Gaussian([0.1, 0.0, 0.0], np.diag([0.2, 0.2, 0.1]) ** 2), np.diag([0.05, 0.01]) ** 2
>>> tags.match(pose, [[1.9, 0.0], [2.0, 0.2], [-1.0, 0.3]], R, JointCompatibility(0.99))
Matches(rows=array([ 0,  2, -2]), rejected={2: Rejected(reason='a range of -1 m')})

Source: Neira & Tardós (2001); Thrun, Burgard & Fox (2005), section 7.5, for localisation with unknown correspondences.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, several
from coursekit.gaussian import Gaussian, check_belief, check_covariance
from coursekit.geometry import Array
from coursekit.models import range_bearing
from coursekit.models.checks import unusable
from coursekit.results import Rejected
from coursekit.slam._checks import check_ids
from coursekit.slam.observations import AMBIGUOUS, Association, Indices, Observations, check_answer


@dataclass(frozen=True, eq=False)
class Matches:
    """What a rule made of the measurements of one moment.

    rows : of each measurement the landmark's row (m,); ``NEW`` for one that fits no landmark, ``AMBIGUOUS`` for one
        that must not be used.
    rejected : the measurements that could not be compared → ``Rejected`` with its reason; they are ambiguous, too.
    """

    rows: Indices
    rejected: dict[int, Rejected]


class KnownMap:
    """Landmarks whose places are known, each under an id.

    landmarks : id → [x, y] in metres, in the order of its rows; or (n, 2), whose ids are 0 to n - 1.

    Raises ValueError for landmarks of another shape or not finite.

    >>> KnownMap([[2.0, 0.0], [0.0, 2.5]]).row(1)
    1
    """

    def __init__(self, landmarks: Mapping[Any, ArrayLike] | ArrayLike) -> None:
        named = isinstance(landmarks, Mapping)
        places = several(landmarks.values() if isinstance(landmarks, Mapping) else landmarks, "landmarks")
        self.landmarks = as_numbers(places, "landmarks").copy() if len(places) else np.empty((0, 2))
        if self.landmarks.shape != (len(places), 2) or not np.all(np.abs(self.landmarks) < LARGEST):
            raise ValueError(f"landmarks: expected finite [x, y] for each, got {places}")
        self.landmarks.flags.writeable = False
        self.ids: tuple[Any, ...] = tuple(landmarks) if named else tuple(range(len(self.landmarks)))  # type: ignore[arg-type]
        self._rows = {name: row for row, name in enumerate(self.ids)}

    def row(self, name: Any) -> int:
        """The row of the landmark with this id.  Raises KeyError for an id that is not on the map."""
        if name not in self._rows:
            raise KeyError(f"no landmark of this map has the id {name!r}")
        return self._rows[name]

    def match(
        self, pose: Gaussian, z: ArrayLike, R: ArrayLike, rule: Association, ids: Sequence[Any] | None = None
    ) -> Matches:
        """Which landmark each measurement of one moment belongs to.

        Parameters
        ----------
        pose : the belief; its first three entries are x, y [m] and θ [rad].
        z : (m, 2) ranges [m] and bearings [rad]; m may be 0.
        R : (2, 2) for all or (m, 2, 2).
        rule : such as ``Mahalanobis(0.99)``, see ``association``.     ids : for ``Known()``, of each measurement.

        A measurement that is not finite or has a range ≤ 0 is rejected, and the others are matched.  A landmark right
        under the robot is matched by ``Euclidean`` and ``Known`` only: its bearing is not defined.

        Raises ValueError for shapes, an R that is no covariance and what the rule raises; TypeError for a belief that
        is none.

        Source: Neira & Tardós (2001).
        """
        check_belief(pose, "pose")
        if isinstance(rule, type) or not callable(rule):
            raise TypeError(f"rule: expected one such as Mahalanobis(0.99), got {rule!r}")
        z = as_numbers(z, "z")
        z = z.reshape(-1, 2) if z.size == 0 else z
        if pose.mean.ndim != 1 or pose.mean.size < 3 or z.ndim != 2 or z.shape[1] != 2:
            raise ValueError(f"expected one belief over [x, y, θ, …] and z of shape (m, 2), got {pose.mean.shape} "
                             f"and {z.shape}")  # fmt: skip
        noise = as_numbers(R, "R")
        Rs = [check_covariance(one, "R", size=2) for one in (noise if noise.ndim == 3 else [noise] * len(z))]
        if len(Rs) != len(z):
            raise ValueError(f"R: expected one, or one for each of {len(z)} measurements, got {len(Rs)}")
        ids = check_ids(ids, len(z))
        rejected = {i: Rejected(why) for i, why in enumerate(unusable(range_bearing, one) for one in z) if why}
        left = [i for i in range(len(z)) if i not in rejected]
        rows = np.full(len(z), AMBIGUOUS, dtype=np.intp)
        if left:
            names = None if ids is None else [ids[i] for i in left]
            shown = self._observations(pose, z[left], np.array([Rs[i] for i in left]), names)
            rows[left] = check_answer(rule(shown), len(left), len(self.ids))
        return Matches(rows, rejected)

    def _observations(self, pose: Gaussian, z: Array, R: Array, ids: Sequence[Any] | None) -> Observations:
        """What a rule sees: landmarks that are certain, and share nothing with the pose."""
        n, mean = len(self.ids), pose.mean[:3]
        certain = pose.cov[:3, :3], np.zeros((n, 2, 3)), np.zeros((n, 2, 2))
        return Observations(z, R, mean, self.landmarks, (mean, self.landmarks), lambda: certain,
                            lambda some: np.zeros((2 * len(some), 2 * len(some))), ids, self._rows)  # fmt: skip
