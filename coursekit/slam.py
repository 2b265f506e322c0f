r"""Lab 5: EKF-SLAM, a robot and its landmarks in one Gaussian.

The state is [x, y, θ, l₁, l₂, …]; what makes it work are the *cross*-covariances: whoever learns where one landmark
is learns something about all that were seen from the same places.

>>> from coursekit.association import Mahalanobis
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

Cost: a prediction touches the pose's three rows, O(n); k measurements of landmarks cost one rank-2k downdate of the
covariance, O(n²), in place and in one triangle.  Multiplying out (I - K H) P, as the textbook writes it, is O(n³).

Source: Dissanayake et al. (2001); Thrun, Burgard & Fox (2005), section 10.2; Huang, Mourikis & Roumeliotis (2010).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from coursekit.association import NEW, Association, Indices, Known, Sightings
from coursekit.gaussian import Gaussian, check_covariance
from coursekit.geometry import Array, wrap_angle
from coursekit.models import MotionModel, RangeBearing

_POSE: Indices = np.arange(3, dtype=np.intp)


class EkfSlam:
    """A map that grows while the robot drives.

    Parameters
    ----------
    pose : where the robot starts, [x, y, θ]; the map's frame is the frame of this.
    motion : of a pose, see ``models``.
    associate : tells which landmark a measurement belongs to, see ``association``.
    confirm : a landmark is tentative until it was seen this often.  Tentative ones are estimated like the others, but
        not handed out, so that a single false detection never makes a landmark.  With ``Known()`` ids one is enough.
    patience : a tentative landmark that this many observations did not show again is forgotten.

    Everything handed out is read-only; an error leaves the filter as it was.
    """

    def __init__(
        self, pose: Gaussian, motion: MotionModel, associate: Association, *, confirm: int = 2, patience: int = 100
    ) -> None:
        if pose.mean.shape != (3,):
            raise ValueError(f"pose: expected a belief over [x, y, θ], got one over {pose.mean.size} numbers")
        if confirm < 1 or patience < 1:
            raise ValueError(f"expected confirm ≥ 1 and patience ≥ 1, got {confirm} and {patience}")
        self.motion, self.associate = motion, associate
        self.confirm, self.patience = (1 if isinstance(associate, Known) else confirm), patience
        self.nis, self.dof = 0.0, 0  # of the last observation's innovations, all together
        self._x = pose.mean.copy()
        self._P = np.asfortranarray(pose.cov)  # only the lower triangle is kept up to date
        self._index: list[int] = []  # of each landmark in the state: its row for the outside, or NEW while tentative
        self._tentative: dict[int, tuple[int, int]] = {}  # place in the state → times seen, observations since
        self._labels: dict[Any, int] = {}

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
        return _frozen(self._block(self._handed_out()))

    @property
    def pose(self) -> Gaussian:
        """The belief over [x, y, θ]."""
        return Gaussian(self._x[:3], self._pose_cov())

    # What moves it.

    def predict(self, control: ArrayLike, dt: float) -> None:
        """Drive on: the pose moves, and its correlation with every landmark turns with it.  Arguments as ``ekf``."""
        control = np.asarray(control, dtype=float)
        x, F, Q = self._motion(control, dt)
        P_pose = F.dot(self._pose_cov()).dot(F.T) + Q
        if not math.isfinite(x.dot(P_pose).dot(x)):
            raise ValueError(f"control: expected finite numbers, got {control}")
        self._P[3:, :3] = self._P[3:, :3].dot(F.T)
        self._P[:3, :3], self._x[:3] = P_pose, x

    def observe(self, z: ArrayLike, R: ArrayLike, ids: Sequence[Any] | None = None) -> Indices:
        """Take in what was seen at one moment, all of it together.

        Parameters
        ----------
        z : (m, 2) ranges [m] and bearings [rad]; m may be 0.
        R : (2, 2) for all of them or (m, 2, 2), each symmetric positive definite.
        ids : read by ``Known()`` and by no other rule.

        Returns the landmark of each measurement, its row in ``landmarks``; -1 for one that belongs to a landmark
        still tentative or to none.  Raises ValueError for shapes, for anything not finite, for a range ≤ 0, for an R
        that is no covariance, and what the rule raises.
        """
        z, R = _check(z, R)
        ids = None if ids is None else list(ids)
        if ids is not None and len(ids) != len(z):
            raise ValueError(f"ids: expected one for each of {len(z)} measurements, got {len(ids)}")
        sightings = self._sightings(z, R, ids)
        chosen = np.array(self.associate(sightings) if len(z) else [], dtype=np.intp)
        self._correct(sightings, chosen)
        if new := [i for i, j in enumerate(chosen.tolist()) if j == NEW]:
            chosen[new] = range(len(self._index), len(self._index) + len(new))
            self._augment(z[new], R[new])
            if ids is not None and isinstance(self.associate, Known):
                self._labels.update({ids[i]: int(chosen[i]) for i in new})
        self._count(chosen)
        indices = np.array([self._index[j] if j >= 0 else NEW for j in chosen.tolist()], dtype=np.intp)
        self._forget()
        return indices

    # How it is done.

    def _motion(self, control: Array, dt: float) -> tuple[Array, Array, Array]:
        x = self._x[:3].copy()
        return self.motion.f(x, control, dt), self.motion.F(x, control, dt), self.motion.Q(x, control, dt)

    def _sightings(self, z: Array, R: Array, ids: Sequence[Any] | None) -> Sightings:
        pose, landmarks = self._x[:3].copy(), self._x[3:].reshape(-1, 2)
        at = (pose, landmarks)
        return Sightings(z, R, pose, landmarks, at, self._covariances, self._between, ids, self._labels)

    def _correct(self, sightings: Sightings, chosen: Indices) -> None:
        """The Kalman update with what is matched: P Hᵀ by columns, and one downdate P - W Wᵀ."""
        matched = [(i, j) for i, j in enumerate(chosen.tolist()) if j >= 0]
        k = len(matched)
        if not k:
            self.nis, self.dof = 0.0, 0
            return
        pose, points = sightings.linearised_at
        PHT, S, innovation = np.empty((len(self._x), 2 * k), order="F"), np.empty((2 * k, 2 * k)), np.empty(2 * k)
        touched = []  # of each pair: H's five columns, and where they stand in the state
        for row, (i, j) in zip(range(0, 2 * k, 2), matched, strict=True):
            H, columns = _jacobian_row(pose, points[j]), [0, 1, 2, 3 + 2 * j, 4 + 2 * j]
            PHT[:, row : row + 2] = self._columns(columns).dot(H.T)
            innovation[row : row + 2] = _innovation(sightings.z[i], sightings.pose, sightings.landmarks[j])
            touched.append((H, columns))
        for row, (i, _), (H, columns) in zip(range(0, 2 * k, 2), matched, touched, strict=True):
            S[row : row + 2] = H.dot(PHT[columns])
            S[row : row + 2, row : row + 2] += sightings.R[i]

        U, failed = dpotrf(S)  # S = Uᵀ U, W = P Hᵀ U⁻¹, w = U⁻ᵀ ν
        W, w = dtrsm(1.0, U, PHT, side=1), dtrsv(U, innovation, trans=1)
        nis = float(w.dot(w))
        if failed or not math.isfinite(nis):
            raise ValueError(f"R: expected covariances that leave H P Hᵀ + R positive definite, got {sightings.R}")
        self._x += W.dot(w)
        self._x[2] = wrap_angle(float(self._x[2]))
        self._P = dsyrk(-1.0, W, beta=1.0, c=self._P, overwrite_c=1, lower=1)
        self.nis, self.dof = nis, 2 * k

    def _augment(self, z: Array, R: Array) -> None:
        """New landmarks, through the inverse measurement: each as unsure as the robot *and* its measurement are."""
        pose, n, k = self._x[:3].copy(), len(self._x), len(z)
        Gx = np.concatenate([RangeBearing.Gx(pose, one) for one in z])
        P = np.empty((n + 2 * k, n + 2 * k), order="F")
        P[:n, :n] = self._P
        P[n:, :n] = Gx @ self._columns(_POSE).T
        P[n:, n:] = P[n:, :3] @ Gx.T
        for i in range(k):
            Gz, own = RangeBearing.Gz(pose, z[i]), slice(n + 2 * i, n + 2 * i + 2)
            P[own, own] += Gz @ R[i] @ Gz.T
        self._x, self._P = np.concatenate([self._x, RangeBearing.g(pose, z).ravel()]), P
        self._tentative.update({len(self._index) + i: (0, 0) for i in range(k)})
        self._index += [NEW] * k

    def _count(self, chosen: Indices) -> None:
        """Note which tentative landmarks were seen; those seen often enough are confirmed."""
        for j, (seen, missed) in list(self._tentative.items()):
            seen, missed = (seen + 1, 0) if j in chosen else (seen, missed + 1)
            self._tentative[j] = seen, missed
            if seen >= self.confirm:
                self._index[j] = len(self._index) - len(self._tentative)
                del self._tentative[j]

    def _forget(self) -> None:
        """Drop tentative landmarks that did not show again; of a Gaussian, that is dropping rows."""
        if gone := {j for j, (_, missed) in self._tentative.items() if missed >= self.patience}:
            self._keep([j for j in range(len(self._index)) if j not in gone])

    def _keep(self, kept: list[int]) -> None:
        rows = np.concatenate([_POSE, _rows(np.array(kept, dtype=np.intp))])
        self._x, self._P = self._x[rows], np.asfortranarray(self._P[np.ix_(rows, rows)])
        self._index = [self._index[j] for j in kept]
        self._tentative = {kept.index(j): counts for j, counts in self._tentative.items() if j in kept}

    def _handed_out(self) -> Indices:
        order = sorted((index, j) for j, index in enumerate(self._index) if index != NEW)
        return np.concatenate([_POSE, _rows(np.array([j for _, j in order], dtype=np.intp))])

    def _pose_cov(self) -> Array:
        P = self._P[:3, :3].copy()
        P[0, 1], P[0, 2], P[1, 2] = P[1, 0], P[2, 0], P[2, 1]
        return P

    def _covariances(self) -> tuple[Array, Array, Array]:
        n = len(self._index)
        a = 3 + 2 * np.arange(n)
        landmark_cov = np.empty((n, 2, 2))
        landmark_cov[:, 0, 0], landmark_cov[:, 1, 1] = self._P[a, a], self._P[a + 1, a + 1]
        landmark_cov[:, 0, 1] = landmark_cov[:, 1, 0] = self._P[a + 1, a]
        return self._pose_cov(), self._P[3:, :3].reshape(n, 2, 3), landmark_cov

    def _between(self, landmarks: Indices) -> Array:
        return self._block(_rows(landmarks))

    def _block(self, rows: Indices) -> Array:
        """Rows and columns of the covariance, read from the triangle that holds them."""
        return np.asarray(self._P[np.maximum(rows[:, None], rows), np.minimum(rows[:, None], rows)])

    def _columns(self, columns: Any) -> Array:
        """Whole columns of the covariance, (n, k): below the diagonal as stored, above it from the rows."""
        out = np.empty((len(self._x), len(columns)), order="F")
        for k, c in enumerate(columns):
            out[c:, k], out[:c, k] = self._P[c:, c], self._P[c, :c]
        return out


class FirstEstimateSlam(EkfSlam):
    """EKF-SLAM whose Jacobians are taken where pose and landmarks were *first* estimated.

    Linearising each step at the newest estimate makes the linearised system believe that it can see its own absolute
    heading, which no range or bearing tells: its covariance shrinks without reason, and the filter grows sure of what
    it cannot know.  With first estimates the directions that cannot be observed stay unobserved.

    Source: Huang, Mourikis & Roumeliotis (2010), section 4.
    """

    def __init__(self, pose: Gaussian, motion: MotionModel, associate: Association, **options: Any) -> None:
        super().__init__(pose, motion, associate, **options)
        self._predicted = self._x[:3].copy()  # the pose before the last correction
        self._first = np.empty((0, 2))

    def _motion(self, control: Array, dt: float) -> tuple[Array, Array, Array]:
        x, F, Q = super()._motion(control, dt)
        # The step as seen from where the pose was predicted, not from where it was corrected to.
        F = F.copy()
        F[0, 2] -= self._x[1] - self._predicted[1]
        F[1, 2] += self._x[0] - self._predicted[0]
        return x, F, Q

    def predict(self, control: ArrayLike, dt: float) -> None:
        """As ``EkfSlam.predict``."""
        super().predict(control, dt)
        self._predicted = self._x[:3].copy()

    def _sightings(self, z: Array, R: Array, ids: Sequence[Any] | None) -> Sightings:
        return replace(super()._sightings(z, R, ids), linearised_at=(self._predicted, self._first))

    def _augment(self, z: Array, R: Array) -> None:
        super()._augment(z, R)
        self._first = np.vstack([self._first, self._x[-2 * len(z) :].reshape(-1, 2)])

    def _keep(self, kept: list[int]) -> None:
        super()._keep(kept)
        self._first = self._first[kept]


def _rows(landmarks: Indices) -> Indices:
    """Where landmarks stand in the state: two rows each, (k,) → (2k,)."""
    return np.asarray((3 + 2 * landmarks[:, None] + [0, 1]).ravel())


def _jacobian_row(pose: Array, landmark: Array) -> Array:
    """∂h/∂[x, y, θ, l_x, l_y], (2, 5): all of H that is not zero for one landmark."""
    (x, y, _), (lx, ly) = pose.tolist(), landmark.tolist()
    dx, dy = lx - x, ly - y
    r = max(math.hypot(dx, dy), 1e-9)
    c, s, p, q = dx / r, dy / r, dy / (r * r), dx / (r * r)
    return np.array([[-c, -s, 0.0, c, s], [p, -q, -1.0, -p, q]])


def _innovation(z: Array, pose: Array, landmark: Array) -> tuple[float, float]:
    """z minus what is expected, the bearing wrapped."""
    (r, bearing), (x, y, theta), (lx, ly) = z.tolist(), pose.tolist(), landmark.tolist()
    return r - math.hypot(lx - x, ly - y), float(wrap_angle(bearing - math.atan2(ly - y, lx - x) + theta))


def _check(z: ArrayLike, R: ArrayLike) -> tuple[Array, Array]:
    z = np.array(z, dtype=float)
    z = z.reshape(0, 2) if z.size == 0 else z
    if z.ndim != 2 or z.shape[1] != 2:
        raise ValueError(f"z: expected ranges and bearings of shape (m, 2), got {z.shape}")
    numbers = z.ravel().tolist()
    if not math.isfinite(sum(number * number for number in numbers)) or min(numbers[::2], default=1.0) <= 0:
        raise ValueError(f"z: expected finite bearings and ranges > 0, got {z}")
    R = np.asarray(R, dtype=float)
    R = R.reshape(0, 2, 2) if R.size == len(z) == 0 else R
    if R.shape not in ((2, 2), (len(z), 2, 2)):
        raise ValueError(f"R: expected shape (2, 2) or ({len(z)}, 2, 2), got {R.shape}")
    each = R.reshape(-1, 2, 2)
    # Symmetric, a > 0, determinant > 0 and finite: what cannot be cleared so, the long look names or mends.
    if not all(b == c and a > 0 and b * b < a * d < math.inf for (a, b), (c, d) in each.tolist()):
        each = np.array([check_covariance(one, "R", size=2) for one in each])
    return z, each if len(each) == len(z) else np.repeat(each, len(z), axis=0)


def _frozen(array: Array) -> Array:
    array = np.array(array)
    array.flags.writeable = False
    return array
