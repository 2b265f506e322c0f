r"""Lab 5: EKF-SLAM, a robot and its landmarks in one Gaussian.

The state is [x, y, θ, l₁, l₂, …].  The *cross*-covariances make it work: whoever learns where one landmark is also
learns something about all landmarks that were seen from the same places.

>>> from coursekit.slam.association import Mahalanobis
>>> from coursekit.models import DifferentialDrive
>>> slam = EkfSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Mahalanobis(0.99))
>>> R = np.diag([0.05, 0.01]) ** 2
>>> slam.observe([[2.0, 0.0], [1.5, -0.8]], R)          # seen once: nothing is sure yet
array([-1, -1])
>>> slam.predict([0.5, 0.0], 0.1)
>>> slam.observe([[1.95, 0.0], [1.46, -0.82]], R)
array([0, 1])
>>> slam.landmarks.round(2) + 0.0
array([[ 2.  ,  0.  ],
       [ 1.05, -1.07]])

Three filters share this face, with what ``own_sensor`` and ``stored`` add to it.  ``EkfSlam`` is the textbook's.  It
grows too sure once the heading is badly known; ``FirstEstimateSlam`` does so less, and ``InvariantSlam`` is the one to
use (Lab 5, going further, measures all three).

Cost: a prediction touches the pose's three rows, O(n); k measurements of landmarks cost one rank-2k downdate of the
covariance, O(n²), in place and in one triangle.  Multiplying out (I - K H) P, as the textbook writes it, is O(n³).

Source: Smith, Self & Cheeseman (1990); Thrun, Burgard & Fox (2005), section 10.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from coursekit.ekf.lost import Broken, Lost, Watch
from coursekit.gaussian import Gaussian, check_belief, factored, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.models import MotionModel, range_bearing
from coursekit.models.checks import has_parts, moved, unusable
from coursekit.results import Rejected
from coursekit.slam._checks import check_count, check_ids, check_measurements, check_share
from coursekit.slam._map_covariance import POSE, MapCovariance, landmark_rows
from coursekit.slam.association import Known
from coursekit.slam.observations import AMBIGUOUS, NEW, Association, Indices, Observations, check_answer
from coursekit.slam.own_sensor import Sensing
from coursekit.slam.stored import Stored


class EkfSlam(Sensing, Stored):
    """A map that grows while the robot drives.

    Parameters
    ----------
    pose : where the robot starts, [x, y, θ] in m and rad; the map's frame is the frame of this.
    motion : of a pose, see ``models``.
    associate : tells which landmark a measurement belongs to, see ``association``.
    n_init : a landmark is tentative until it was seen this often.  Tentative ones are estimated like the others, but
        not handed out, so that a single false detection never makes a landmark.  With ``Known()`` ids one is enough.
    max_misses : a tentative landmark that this many observations in a row did not show again is forgotten.

    Everything handed out is read-only; an error leaves the filter as it was.  Raises ValueError or TypeError for a
    start that is no belief over a pose, a model without f, F, Q, a rule that is none, and counts below 1.

    **Too sure** where the heading's σ is more than a few hundredths of a radian while landmarks are mapped: after a
    long blind stretch, or among many landmarks without a look back.  Its NEES is then 10 and more where 3 is right, and
    gates turn good measurements away.  ``InvariantSlam`` takes its place with the same arguments and is honest
    there; ``CalibratingSlam`` is the one for recordings of a real robot.

    ``lost`` tells when it has left its own gate.

    >>> from coursekit.models import DifferentialDrive
    >>> slam = EkfSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Known())
    >>> slam.observe([[2.0, 0.0]], np.diag([0.05, 0.01]) ** 2, ids=["door"])
    array([0])
    >>> slam.cov.shape
    (5, 5)

    Source: Thrun, Burgard & Fox (2005), table 10.2; tentative landmarks: Dissanayake et al. (2001), section IV.
    """

    def __init__(
        self, pose: Gaussian, motion: MotionModel, associate: Association, *, n_init: int = 2, max_misses: int = 100
    ) -> None:
        check_belief(pose, "pose")
        if pose.mean.shape != (3,):
            raise ValueError(f"pose: expected a belief over [x, y, θ], got one over {pose.mean.size} numbers")
        has_parts(motion, "motion", ("f", "F", "Q"))
        if isinstance(associate, type) or not callable(associate):
            raise TypeError(f"associate: expected a rule such as Mahalanobis(0.99), got {associate!r}")
        self.motion, self.associate = motion, associate
        n_init = check_count(n_init, "n_init")
        self.n_init = 1 if isinstance(associate, Known) else n_init
        self.max_misses = check_count(max_misses, "max_misses")
        self.nis, self.dof = 0.0, 0  # of the last observation's innovations, all together
        self._x, self._P = pose.mean.copy(), MapCovariance(pose.cov)
        self._index: list[int] = []  # of each landmark in the state: its row for the outside, or NEW while tentative
        self._tentative: dict[int, tuple[int, int]] = {}  # place in the state → times seen, misses since
        self._labels: dict[Any, int] = {}
        self._watch = Watch()
        self.rejected: dict[int, Rejected] = {}  # of the last observation: which measurements were not used, and why

    # What the outside may know.

    @property
    def landmarks(self) -> Array:
        """Where the confirmed landmarks are, in the order in which they were confirmed, (n, 2)."""
        return _frozen(self._x[self._handed_out()[3:]].reshape(-1, 2))

    @property
    def mean(self) -> Array:
        """[x, y, θ, l₁, l₂, …] of pose and confirmed landmarks, (3 + 2n,)."""
        return _frozen(self._x[self._handed_out()])

    @property
    def cov(self) -> Array:
        """The covariance of ``mean``, (3 + 2n, 3 + 2n)."""
        return _frozen(self._P.block(self._handed_out()))

    @property
    def pose(self) -> Gaussian:
        """The belief over [x, y, θ]."""
        return Gaussian(self._x[:3], factored(self._P.pose)[0])

    @property
    def lost(self) -> Lost | None:
        """Why the filter is not to be believed any more, or None while its innovations have the size that it expects.

        It stays lost.  It goes on estimating, except that a step that its numbers cannot carry changes nothing.
        """
        return self._watch.lost

    @property
    def rows(self) -> dict[Any, int]:
        """The row in ``landmarks`` of each id that ``Known`` was told: {id: row}."""
        return {name: self._index[j] for name, j in self._labels.items() if self._index[j] != NEW}

    # What moves it.

    def predict(self, control: ArrayLike, dt: float) -> None:
        """Drive on: the pose moves, and its correlation with every landmark turns with it.  Arguments as ``ekf``."""
        x, F, Q = self._motion(control, dt)
        if not math.isfinite(sum(x.tolist())):
            raise ValueError(f"f: expected finite numbers, got {x}")
        self._watch.time += float(dt)
        try:
            pose_cov, _ = factored(symmetrize(F.dot(self._P.pose).dot(F.T) + Q))
        except ValueError:  # F and Q were looked at: it is P
            self._watch.give_up("the covariance of the pose is not positive definite any more")
            return
        self._P.move(F, pose_cov)
        self._x[:3] = x

    def observe(self, z: ArrayLike, R: ArrayLike, ids: Sequence[Any] | None = None) -> Indices:
        """Take in what was seen at one moment, all of it together.

        Parameters
        ----------
        z : (m, 2) ranges [m] and bearings [rad]; m may be 0.
        R : (2, 2) for all of them or (m, 2, 2), each symmetric positive definite.
        ids : read by ``Known()`` and by no other rule.

        Returns the landmark of each measurement, its row in ``landmarks``; -1 for one that belongs to a landmark
        still tentative or to none.  A measurement that cannot be used (not finite, a range ≤ 0, one that the rule calls
        ambiguous, such as two of one id) is in ``rejected`` with its reason, and the others are used.

        Raises ValueError for shapes, for an R that is no covariance or is 10¹² times smaller than what the map leaves
        open of the measurement (64-bit numbers could not tell what is left), for a landmark right under the robot, for
        an answer of the rule that names no landmark, and what the rule raises.
        """
        z, R = check_measurements(z, R)
        ids = check_ids(ids, len(z))
        bad = {i: Rejected(why) for i, why in enumerate(unusable(range_bearing, one) for one in z) if why}
        good = [i for i in range(len(z)) if i not in bad]
        indices = np.full(len(z), NEW, dtype=np.intp)
        names = None if ids is None else [ids[i] for i in good]
        indices[good], unclear = self._observe(z[good], R[good], names)
        self.rejected = bad | {good[i]: Rejected("ambiguous: no landmark that it surely is") for i in unclear}
        return indices

    def _observe(self, z: Array, R: Array, ids: list[Any] | None) -> tuple[Indices, list[int]]:
        """``observe`` of measurements that can be used: the landmarks, and which were ambiguous."""
        observations = self._observations(z, R, ids)
        chosen = check_answer(self.associate(observations) if len(z) else [], len(z), len(self._index))
        try:
            self._check_new(z, R, chosen)
            self._correct(observations, chosen)
        except Broken as broken:
            self._watch.give_up(str(broken))
            return np.full(len(z), NEW, dtype=np.intp), []
        except ValueError:
            if self.lost is None:
                raise
            return np.full(len(z), NEW, dtype=np.intp), []
        if len(z):
            self._watch.looked(self.nis, self.dof, unused=bool(np.all(chosen == AMBIGUOUS)))
        if new := [i for i, j in enumerate(chosen.tolist()) if j == NEW]:
            chosen[new] = range(len(self._index), len(self._index) + len(new))
            self._augment(z[new], R[new])
            if ids is not None and isinstance(self.associate, Known):
                self._labels.update({ids[i]: int(chosen[i]) for i in new})
        self._count(chosen)
        indices = np.array([self._index[j] if j >= 0 else NEW for j in chosen.tolist()], dtype=np.intp)
        self._forget()
        return indices, np.flatnonzero(chosen == AMBIGUOUS).tolist()

    # How it is done.

    def _motion(self, control: ArrayLike, dt: float) -> tuple[Array, Array, Array]:
        return moved(self.motion, self._x[:3].copy(), control, dt)

    def _observations(self, z: Array, R: Array, ids: Sequence[Any] | None) -> Observations:
        pose, landmarks = self._x[:3].copy(), self._x[3:].reshape(-1, 2)
        at, P = (pose, landmarks), self._P
        return Observations(z, R, pose, landmarks, at, P.pose_and_landmarks, P.block_of_landmarks, ids, self._labels)

    def _correct(self, observations: Observations, chosen: Indices) -> None:
        """The Kalman update with what is matched: x + K ν and P - K S Kᵀ."""
        matched = [(i, j) for i, j in enumerate(chosen.tolist()) if j >= 0]
        self.nis, self.dof = 0.0, 0
        if not matched:
            return
        pose, landmarks = observations.linearization_point
        H = [jacobian(pose, landmarks[j], j) for _, j in matched]
        nu = np.concatenate([
            range_bearing.residual(observations.z[i], range_bearing.h(observations.pose, observations.landmarks[j]))
            for i, j in matched
        ])  # fmt: skip
        W, w, _ = self._gain(H, nu, matched, observations.R)
        self._shift(W, w)
        self.nis, self.dof = float(w.dot(w)), len(nu)

    def _shift(self, W: Array, w: Array) -> None:
        """x + W w and P - W Wᵀ."""
        self._x += W.dot(w)
        self._x[2] = wrap_angle(float(self._x[2]))
        self._P.downdate(W)

    def _linearized_at(self, j: int) -> tuple[Array, Array]:
        """The pose (3,) and landmark j (2,) where Jacobians are taken."""
        return self._x[:3].copy(), self._x[self._columns(j)[-2:]]

    def _gain(self, H: list[Array], nu: Array, matched: list[tuple[int, int]], R: Array) -> tuple[Array, Array, Array]:
        """With S = H P Hᵀ + R = Uᵀ U: W = P Hᵀ U⁻¹, w = U⁻ᵀ ν and U.  K ν is W w, and K S Kᵀ is W Wᵀ.

        H : of each pair its columns that are not zero, (2, 5): those of the pose and of the landmark.
        """
        k = 2 * len(matched)
        PHT, S = np.empty((len(self._x), k), order="F"), np.empty((k, k))
        rows = range(0, k, 2)
        columns = [self._columns(j) for _, j in matched]
        for row, H_j, of_pair in zip(rows, H, columns, strict=True):
            PHT[:, row : row + 2] = self._P.columns(of_pair).dot(H_j.T)
        for row, H_j, of_pair, (i, _) in zip(rows, H, columns, matched, strict=True):
            S[row : row + 2] = H_j.dot(PHT[of_pair])
            S[row : row + 2, row : row + 2] += R[i]
        if not (np.all(S.diagonal() > 0) and math.isfinite(S.trace())):
            raise Broken("the variance of an innovation is not positive any more: the map's covariance is broken")
        for row, (i, _) in zip(rows, matched, strict=True):
            check_share(R[i], S[row : row + 2, row : row + 2], k, R[i])
        U, failed = dpotrf(S)
        w = dtrsv(U, nu, trans=1)
        if failed or not math.isfinite(w.dot(w)):
            raise Broken("H P Hᵀ + R is not positive definite, although R is: the map's covariance is broken")
        return dtrsm(1.0, U, PHT, side=1), w, U

    def _columns(self, j: int) -> list[int]:
        """The columns of H that landmark j leaves not zero."""
        return [0, 1, 2, 3 + 2 * j, 4 + 2 * j]

    def _check_new(self, z: Array, R: Array, chosen: Indices) -> None:
        """A new landmark must differ from the robot's own error by more than rounding does."""
        pose, P = self._x[:3], self._P.pose
        for i in np.flatnonzero(chosen == NEW):
            Gx, Gz = range_bearing.Gx(pose, z[i]), range_bearing.Gz(pose, z[i])
            noise = Gz.dot(R[i]).dot(Gz.T)
            check_share(noise, Gx.dot(P).dot(Gx.T) + noise, 1, R[i])

    def _augment(self, z: Array, R: Array) -> None:
        """New landmarks of an observation."""
        self._place(z, R)

    def _place(self, z: Array, R: Array) -> None:
        """New landmarks, through the inverse measurement: each as unsure as the robot *and* its measurement are."""
        pose, k = self._x[:3].copy(), len(z)
        Gx, Gz = range_bearing.Gx(pose, z), range_bearing.Gz(pose, z)
        cross = Gx.reshape(2 * k, 3) @ self._P.columns(POSE).T
        corner = cross[:, :3] @ Gx.reshape(2 * k, 3).T
        for i, noise in enumerate(Gz @ R @ Gz.swapaxes(1, 2)):
            corner[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += noise
        self._grow(range_bearing.g(pose, z), cross, corner)
        self._tentative.update({len(self._index) + i: (0, 0) for i in range(k)})
        self._index += [NEW] * k

    def _grow(self, places: Array, cross: Array, corner: Array) -> None:
        """Landmarks (k, 2) at the state's end, with their rows (2k, n) and (2k, 2k) of the covariance."""
        self._x = np.concatenate([self._x, places.ravel()])
        self._P.grow(cross, corner)

    def _count(self, chosen: Indices) -> None:
        """Note which tentative landmarks were seen; those seen often enough are confirmed."""
        for j, (seen, missed) in list(self._tentative.items()):
            seen, missed = (seen + 1, 0) if j in chosen else (seen, missed + 1)
            self._tentative[j] = seen, missed
            if seen >= self.n_init:
                self._index[j] = len(self._index) - len(self._tentative)
                del self._tentative[j]

    def _forget(self) -> None:
        """Drop tentative landmarks that did not show again; of a Gaussian, that is dropping rows."""
        if gone := {j for j, (_, missed) in self._tentative.items() if missed >= self.max_misses}:
            self._keep([j for j in range(len(self._index)) if j not in gone])

    def _keep(self, kept: list[int]) -> None:
        rows = np.concatenate([POSE, landmark_rows(np.array(kept, dtype=np.intp))])
        self._x = self._x[rows]
        self._P.keep(rows)
        self._index = [self._index[j] for j in kept]
        self._tentative = {kept.index(j): counts for j, counts in self._tentative.items() if j in kept}
        self._labels = {name: kept.index(j) for name, j in self._labels.items() if j in kept}

    def _handed_out(self) -> Indices:
        order = sorted((index, j) for j, index in enumerate(self._index) if index != NEW)
        return np.concatenate([POSE, landmark_rows(np.array([j for _, j in order], dtype=np.intp))])


def jacobian(pose: Array, landmark: Array, j: int) -> Array:
    """∂h/∂[x, y, θ, l_x, l_y], (2, 5): all of H that is not zero for one landmark."""
    if math.dist(pose[:2], landmark) < range_bearing.TOO_NEAR:
        raise ValueError(f"state: the robot stands on landmark {j} of its map: range and bearing have no derivative "
                         "there")  # fmt: skip
    H = range_bearing.H(pose, landmark)
    return np.concatenate([H, -H[:, :2]], axis=1)


def _frozen(array: Array) -> Array:
    array = np.array(array)
    array.flags.writeable = False
    return array
