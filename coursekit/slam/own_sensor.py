r"""SLAM with a sensor of one's own: ranges without bearings, bearings without ranges, whatever has an h.

A camera that measures range and bearing tells at once where a landmark is; ``observe`` is made for it.  One range, or
one bearing, leaves a ring or a ray of places, and what may be guessed is the business of who knows the sensor.  So the
sensor answers two questions: what would be measured (``h``), and where a landmark may be that nobody has seen before
(``start``).

>>> import numpy as np
>>> from coursekit.geometry import wrap_angle
>>> from coursekit.models import DifferentialDrive
>>> from coursekit.slam import InvariantSlam, Known
>>> class Compass:                                        # the bearing of a lamp, in a room some 6 m wide
...     R = np.array([[0.01**2]])
...     def h(self, pose, lamp): return [np.arctan2(lamp[1] - pose[1], lamp[0] - pose[0]) - pose[2]]
...     def residual(self, z, z_hat): return wrap_angle(np.subtract(z, z_hat))
...     def start(self, name, z, pose): return Gaussian([3.0, z[0]], np.diag([1.5, 0.01]) ** 2)
>>> slam = InvariantSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Known())
>>> for k in range(40):                                   # along x, past a lamp at [2, 1]
...     at, compass = np.array([0.05 * k, 0.0, 0.0]), Compass()
...     indices = slam.sense(compass, [compass.h(at, [2.0, 1.0])], ["lamp"])
...     slam.predict([0.5, 0.0], 0.1)
>>> bool(np.linalg.norm(slam.landmarks[slam.rows["lamp"]] - [2.0, 1.0]) < 0.1)
True

Source: Solà, Vidal-Calleja, Civera & Montiel (2012) for landmarks that one look does not place.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from coursekit.doors import as_numbers
from coursekit.gaussian import Gaussian, check_belief, check_covariance
from coursekit.geometry import Array
from coursekit.models.checks import array_of, has_parts, one_each, unusable
from coursekit.models.numerical import jacobian
from coursekit.results import Rejected
from coursekit.slam.observations import NEW, Indices

_SMALLEST_R = 1e-12  # of S: below, P - W Wᵀ is made of rounding errors


class LandmarkSensor(Protocol):
    """What ``sense`` asks of a sensor.  ``R`` (m, m), ``H(pose, landmark)`` (m, 3) and ``H_landmark(pose, landmark)``
    (m, 2) are used where it has them; Jacobians are else taken by differences."""

    def h(self, pose: Array, landmark: Array, /) -> ArrayLike:
        """What would be measured, (m,), from a pose (3,) of a landmark (2,)."""

    def residual(self, z: Any, z_hat: Any, /) -> ArrayLike:
        """z - z_hat, (m,), angles wrapped."""

    def start(self, name: Any, z: Array, pose: Gaussian, /) -> Gaussian | None:
        """Where a landmark may be that is not on the map: a belief over [range m, bearing rad] from where the robot
        is, with z taken into account; or None, to wait for more.  It is asked at each look until it answers."""


class Sensing:
    """The part of every filter that takes any sensor."""

    def sense(
        self: Any, sensor: LandmarkSensor, z: ArrayLike, ids: Sequence[Any], R: ArrayLike | None = None
    ) -> Indices:
        """Take in what a sensor of one's own measured at one moment: a range alone, a bearing alone, what has an h.

        Parameters
        ----------
        sensor : with h(pose, landmark), residual and start, see ``slam.own_sensor``.
        z : (k, m), one row for each landmark, in the sensor's units.
        ids : of each row the landmark's, all different.
        R : (m, m) for all or (k, m, m), each a covariance; the sensor's own by default.

        Returns the row in ``landmarks`` of each; -1 for one that cannot be used (then it is in ``rejected``), or that
        belongs to a landmark for which ``start`` still waits.  A landmark is confirmed as soon as it is started.
        ``FirstEstimateSlam`` is not for guesses: a depth that was guessed stays its linearization point.

        Raises ValueError for shapes, ids that occur twice, an R that is no covariance or too small beside what the map
        leaves open, and what a sensor answers that does not fit; TypeError for a sensor without its parts.

        Source: Thrun, Burgard & Fox (2005), table 10.2, lines 10 and 16-19, with any h.
        """
        has_parts(sensor, "sensor", ("h", "residual", "start"))
        z, ids = as_numbers(z, "z"), list(ids)
        if not (z.size or ids):
            return np.empty(0, dtype=np.intp)
        if z.ndim != 2 or len(ids) != len(z) or len(set(ids)) < len(ids):
            raise ValueError(f"expected z of shape (k, m) with k different ids, got {z.shape} and {ids}")
        if R is None:
            has_parts(sensor, "sensor", ("R",))
        given = one_each(getattr(sensor, "R", None) if R is None else as_numbers(R, "R"), z, len(z))
        Rs = [check_covariance(one, "R", size=z.shape[1]) for one in given]
        rejected = {i: Rejected(why) for i, why in enumerate(unusable(sensor, one) for one in z) if why}
        seen = [(i, self._labels[name]) for i, name in enumerate(ids) if name in self._labels and i not in rejected]
        starts = {i: _start(self, sensor, name, z[i]) for i, name in enumerate(ids)
                  if name not in self._labels and i not in rejected}  # fmt: skip
        new = {i: start for i, start in starts.items() if start is not None}
        places = np.array([start.mean for start in new.values()]).reshape(-1, 2)
        spreads = np.array([start.cov for start in new.values()]).reshape(-1, 2, 2)
        self._check_new(places, spreads, np.full(len(new), NEW))
        pairs = [_linearized(self, sensor, z[i], j, Rs[i]) for i, j in seen]
        self.nis, self.dof = 0.0, 0
        if pairs and not _correct(self, pairs):
            return np.full(len(z), NEW, dtype=np.intp)
        if new:
            first = len(self._index)
            self._place(places, spreads)
            for j, i in enumerate(new, start=first):
                self._index[j] = len(self._index) - len(self._tentative)
                del self._tentative[j]
                self._labels[ids[i]] = j
        self.rejected = rejected
        which = [self._labels.get(name) if i not in rejected else None for i, name in enumerate(ids)]
        return np.array([NEW if j is None else self._index[j] for j in which], dtype=np.intp)


def _start(slam: Any, sensor: LandmarkSensor, name: Any, z: Array) -> Gaussian | None:
    start = sensor.start(name, z.copy(), slam.pose)
    if start is None:
        return None
    check_belief(start, "start")
    if start.mean.shape != (2,) or not start.mean[0] > 0:
        raise ValueError(f"start: expected a belief over [range > 0, bearing], got the mean {start.mean}")
    return start


def _linearized(slam: Any, sensor: Any, z: Array, j: int, R: Array) -> tuple[list[int], Array, Array, Array]:
    """The columns of the state that landmark j's measurement depends on, H there (m, c), the innovation and R."""
    columns = slam._columns(j)
    here, landmark = slam._x[:3].copy(), slam._x[columns[-2:]]
    nu = array_of(sensor.residual(z, as_numbers(sensor.h(here, landmark), "h")), "residual", z.shape)
    here, landmark = slam._linearized_at(j)
    if hasattr(sensor, "H"):
        Hx = sensor.H(here, landmark)
    else:
        Hx = jacobian(lambda pose: sensor.h(pose, landmark), here, sensor.residual)
    if hasattr(sensor, "H_landmark"):
        Hl = sensor.H_landmark(here, landmark)
    else:
        Hl = jacobian(lambda place: sensor.h(here, place), landmark, sensor.residual)
    H = np.zeros((len(z), len(columns)))
    H[:, :3], H[:, -2:] = array_of(Hx, "H", (len(z), 3)), array_of(Hl, "H_landmark", (len(z), 2))
    return columns, H, nu, R


def _correct(slam: Any, pairs: list[tuple[list[int], Array, Array, Array]]) -> bool:
    """The Kalman update with all of them together; False where the filter's own numbers do not carry it."""
    nu = np.concatenate([nu for _, _, nu, _ in pairs])
    PHT = np.hstack([slam._P.columns(columns) @ H.T for columns, H, _, _ in pairs])
    S = np.vstack([H @ PHT[columns] for columns, H, _, _ in pairs])
    row = 0
    for _, _, part, R in pairs:
        block = slice(row, row := row + len(part))
        S[block, block] += R
        if np.any(R.diagonal() < _SMALLEST_R * len(nu) * S[block, block].diagonal()):
            raise ValueError("R: too small beside what the map leaves open: 64-bit numbers cannot hold what is left.\n"
                             f"R is\n{R}\nof innovations with the covariance\n{S[block, block]}")  # fmt: skip
    U, failed = dpotrf(S)
    w = dtrsv(U, nu, trans=1)
    if failed or not math.isfinite(w.dot(w)):
        slam._watch.give_up("H P Hᵀ + R is not positive definite, although R is: the map's covariance is broken")
        return False
    slam._shift(dtrsm(1.0, U, np.asfortranarray(PHT), side=1), w)
    slam.nis, slam.dof = float(w.dot(w)), len(nu)
    slam._watch.looked(slam.nis, slam.dof, unused=False)
    return True
