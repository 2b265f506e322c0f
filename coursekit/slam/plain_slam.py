r"""EKF-SLAM as one writes it on a blackboard: whole matrices, one landmark after the other, nothing for speed.

The lab writes it out; ``EkfSlam`` is held equal to it; each fault of the report replaces one of its methods.

Source: Thrun, Burgard & Fox (2005), table 10.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.ekf import gate_threshold
from coursekit.gaussian import Gaussian, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.models import MotionModel, range_bearing
from coursekit.slam.observations import AMBIGUOUS, NEW


class PlainSlam:
    """[x, y, θ, l₁, l₂, …] in ``x`` (n,) and its covariance in ``P`` (n, n).

    pose : the belief over [x, y, θ] at the start, in m and rad.     motion : a model with f, F, Q.

    For study: it checks no argument, and what it raises is NumPy's.

    >>> from coursekit.models import DifferentialDrive
    >>> slam = PlainSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive())
    >>> slam.observe([[2.0, 0.0], [1.5, -0.8]], np.diag([0.05, 0.01]) ** 2)
    [0, 1]
    >>> slam.landmarks.round(2)
    array([[ 2.  ,  0.  ],
           [ 1.05, -1.08]])
    """

    def __init__(self, pose: Gaussian, motion: MotionModel) -> None:
        self.x, self.P, self.motion = pose.mean.copy(), pose.cov.copy(), motion
        self.labels: dict[Any, int] = {}

    @property
    def landmarks(self) -> Array:
        """(n, 2)."""
        return self.x[3:].reshape(-1, 2)

    @property
    def pose(self) -> Gaussian:
        """The belief over [x, y, θ]."""
        return Gaussian(self.x[:3], symmetrize(self.P[:3, :3]))

    @property
    def mean(self) -> Array:
        """``x``, under the name that ``EkfSlam`` gives it."""
        return self.x

    @property
    def cov(self) -> Array:
        """``P``."""
        return self.P

    def predict(self, control: ArrayLike, dt: float) -> None:
        """F P Fᵀ + Q, with an F that leaves the landmarks where they are."""
        n, pose, u = len(self.x), self.x[:3].copy(), np.asarray(control, dtype=float)
        F, Q = np.eye(n), np.zeros((n, n))
        F[:3, :3], Q[:3, :3] = self.motion.F(pose, u, dt), self.motion.Q(pose, u, dt)
        self.x[:3], self.P = self.motion.f(pose, u, dt), F @ self.P @ F.T + Q

    def observe(self, z: ArrayLike, R: ArrayLike, ids: Sequence[Any] | None = None) -> list[int]:
        """Take in ranges and bearings (m, 2) with R (2, 2) or (m, 2, 2); the landmark that each was taken for.

        Without ids ``rule`` decides, one measurement after the other.  With ids those that are known correct the
        state all at once, and the others are new.
        """
        z = np.asarray(z, dtype=float).reshape(-1, 2)
        R = np.broadcast_to(R, (len(z), 2, 2))
        if ids is None:
            return [self._take_in(*pair) for pair in zip(z, R, strict=True)]
        known = [i for i, name in enumerate(ids) if name in self.labels]
        if known:
            self.correct(z[known], R[known], [self.labels[ids[i]] for i in known])
        for i, name in enumerate(ids):
            if name not in self.labels:
                self.labels[name] = len(self.landmarks)
                self.augment(z[i], R[i])
        return [self.labels[name] for name in ids]

    def rule(self, z: Array, R: Array) -> int:
        """Which landmark was that: nearest in standard deviations, within the gate; far outside it, a new one."""
        pairs = [self.innovation(z[None], R[None], [j]) for j in range(len(self.landmarks))]
        d2 = np.array([nu @ np.linalg.solve(S, nu) for nu, S in pairs])
        if not d2.size or d2.min() > gate_threshold(1 - 1e-6, 2):
            return NEW
        return int(np.argmin(d2)) if d2.min() < gate_threshold(0.99, 2) else AMBIGUOUS

    def H(self, j: int) -> Array:
        """∂(range and bearing of landmark j)/∂x, (2, n)."""
        H, pose, landmark = np.zeros((2, len(self.x))), self.x[:3], self.landmarks[j]
        H[:, :3] = range_bearing.H(pose, landmark)
        H[:, 3 + 2 * j : 5 + 2 * j] = range_bearing.H_landmark(pose, landmark)
        return H

    def augment(self, z: Array, R: Array) -> None:
        """A new landmark, through the inverse measurement and its Jacobians."""
        pose, n = self.x[:3].copy(), len(self.x)
        G = np.zeros((n + 2, n + 2))
        G[:n, :n], G[n:, :3], G[n:, n:] = np.eye(n), range_bearing.Gx(pose, z), range_bearing.Gz(pose, z)
        both = np.zeros((n + 2, n + 2))
        both[:n, :n], both[n:, n:] = self.P, R
        self.x, self.P = np.r_[self.x, range_bearing.g(pose, z)], G @ both @ G.T

    def innovation(self, z: Array, R: Array, landmarks: list[int]) -> tuple[Array, Array]:
        """ν (2k,) and S (2k, 2k) of measurements z (k, 2), R (k, 2, 2) if they are these landmarks."""
        H = np.vstack([self.H(j) for j in landmarks])
        S = H @ self.P @ H.T
        for i, noise in enumerate(R):
            S[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += noise
        return range_bearing.residual(z, range_bearing.h(self.x[:3], self.landmarks[landmarks])).ravel(), S

    def correct(self, z: Array, R: Array, landmarks: list[int]) -> None:
        """The Kalman update with measurements z (k, 2), R (k, 2, 2) of these landmarks."""
        (nu, S), H = self.innovation(z, R, landmarks), np.vstack([self.H(j) for j in landmarks])
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ nu
        self.x[2] = wrap_angle(self.x[2])
        self.P = symmetrize(self.P - K @ S @ K.T)

    def _take_in(self, z: Array, R: Array) -> int:
        j = self.rule(z, R)
        if j == NEW:
            self.augment(z, R)
            return len(self.landmarks) - 1
        if j != AMBIGUOUS:
            self.correct(z[None], R[None], [j])
        return j
