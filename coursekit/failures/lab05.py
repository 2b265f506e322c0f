"""Lab 5's exhibits: the report's EKF-SLAM, fault by fault, beside one that is sound.

``PlainSlam`` is EKF-SLAM as one writes it on a blackboard: dense, one tag after the other.  Each fault of the report
replaces one of its methods, so they can be had one by one or, as in the report, together.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.ekf import gate_threshold
from coursekit.failures import Exhibit
from coursekit.gaussian import Gaussian, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive, MotionModel, RangeBearing

NEW, UNSURE = -1, -2


class PlainSlam:
    """[x, y, θ, l₁, l₂, …] in ``x`` (n,) and its covariance in ``P`` (n, n)."""

    def __init__(self, pose: Gaussian, motion: MotionModel) -> None:
        self.x, self.P, self.motion = pose.mean.copy(), pose.cov.copy(), motion

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
        """``x``, under the name that the package gives it."""
        return self.x

    @property
    def cov(self) -> Array:
        """``P``."""
        return self.P

    def predict(self, control: ArrayLike, dt: float) -> None:
        """F P Fᵀ + Q, with an F that leaves the landmarks where they are: three rows and columns of P change."""
        pose, u = self.x[:3].copy(), np.asarray(control, dtype=float)
        F = self.motion.F(pose, u, dt)
        self.P[:3] = F @ self.P[:3]
        self.P[:, :3] = self.P[:, :3] @ F.T
        self.P[:3, :3] += self.motion.Q(pose, u, dt)
        self.x[:3] = self.motion.f(pose, u, dt)

    def observe(self, z: ArrayLike, R: ArrayLike) -> list[int]:
        """Take in ranges and bearings (m, 2) with R (2, 2) or (m, 2, 2); says which landmark each was taken for."""
        z = np.asarray(z, dtype=float).reshape(-1, 2)
        return [self._take_in(*pair) for pair in zip(z, np.broadcast_to(R, (len(z), 2, 2)), strict=True)]

    def rule(self, z: Array, R: Array) -> int:
        """Which landmark was that: nearest in standard deviations, within the gate; far outside it, a new one."""
        d2 = np.array([nu @ np.linalg.solve(S, nu) for nu, S in (self.surprise(z, R, j) for j in self._all())])
        if not d2.size or d2.min() > gate_threshold(1 - 1e-6, 2):
            return NEW
        return int(np.argmin(d2)) if d2.min() < gate_threshold(0.99, 2) else UNSURE

    def H(self, j: int) -> Array:
        """∂(range and bearing of landmark j)/∂x, (2, n)."""
        sensor, H = RangeBearing(self.landmarks[j]), np.zeros((2, len(self.x)))
        H[:, :3], H[:, 3 + 2 * j : 5 + 2 * j] = sensor.H(self.x[:3]), sensor.H_landmark(self.x[:3])
        return H

    def begin(self, z: Array, R: Array) -> None:
        """A new landmark, through the inverse measurement and its Jacobians."""
        pose, n = self.x[:3].copy(), len(self.x)
        G = np.zeros((n + 2, n + 2))
        G[:n, :n], G[n:, :3], G[n:, n:] = np.eye(n), RangeBearing.Gx(pose, z), RangeBearing.Gz(pose, z)
        both = np.zeros((n + 2, n + 2))
        both[:n, :n], both[n:, n:] = self.P, R
        self.x, self.P = np.r_[self.x, RangeBearing.g(pose, z)], G @ both @ G.T

    def surprise(self, z: Array, R: Array, j: int) -> tuple[Array, Array]:
        """The innovation of z if it is landmark j, and its covariance."""
        H = self.H(j)
        nu = RangeBearing.residual(z, RangeBearing(self.landmarks[j]).h(self.x[:3]))
        return nu, H @ self.P @ H.T + R

    def correct(self, z: Array, R: Array, j: int) -> None:
        """The Kalman update."""
        (nu, S), H = self.surprise(z, R, j), self.H(j)
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ nu
        self.x[2] = wrap_angle(self.x[2])
        self.P = symmetrize(self.P - K @ S @ K.T)

    def _take_in(self, z: Array, R: Array) -> int:
        j = self.rule(z, R)
        if j == NEW:
            self.begin(z, R)
            return len(self.landmarks) - 1
        if j != UNSURE:
            self.correct(z, R, j)
        return j

    def _all(self) -> range:
        return range(len(self.landmarks))

    def _metres(self, z: Array) -> Array:
        return np.linalg.norm(self.landmarks - RangeBearing.g(self.x[:3], z), axis=-1)


# --- the report's faults --------------------------------------------------------------------------------------------


class Metres(PlainSlam):
    """Nearest in metres; the report took 1.6 m on the square and 1 m on the octagon."""

    threshold = 1.0

    def rule(self, z: Array, R: Array) -> int:
        """The nearest landmark if it is nearer than the threshold."""
        d = self._metres(z)
        return int(np.argmin(d)) if d.size and d.min() < self.threshold else NEW


class Inverted(Metres):
    """The report's sentence, as it stands: below the threshold, a landmark "is detected for the first time"."""

    def rule(self, z: Array, R: Array) -> int:
        """Near is new, and far is known; only an empty map has nothing to be far from."""
        d = self._metres(z)
        return NEW if not d.size or d.min() < self.threshold else int(np.argmin(d))


class OneColumn(PlainSlam):
    """A Jacobian with one column for each landmark, and none for the heading: the report's listing."""

    def H(self, j: int) -> Array:
        """Six entries where there are nine."""
        H = super().H(j)
        H[:, 2] = 0.0
        H[:, 4 + 2 * j] = 0.0
        return H


class Thousand(PlainSlam):
    """A landmark that starts with 1000 m² and no correlation with anything; then its own measurement is used."""

    def begin(self, z: Array, R: Array) -> None:
        """Zeros beside P, and a thousand in the corner."""
        n = len(self.x)
        P = 1000.0 * np.eye(n + 2)
        P[:n, :n], P[n:, :n], P[:n, n:] = self.P, 0.0, 0.0
        self.x, self.P = np.r_[self.x, RangeBearing.g(self.x[:3], z)], P

    def _take_in(self, z: Array, R: Array) -> int:
        known = len(self.landmarks)
        j = super()._take_in(z, R)
        if j == known:
            self.correct(z, R, j)  # "then we use the location of this landmark to update the state"
        return j


class Report(OneColumn, Thousand, Metres):
    """All of it at once: what the report ran (its rule must have stood the right way round in the program)."""


# --- the checks -----------------------------------------------------------------------------------------------------

_R = np.diag([0.03, 0.01]) ** 2
_MOTION = DifferentialDrive(0.05, 0.05)


def a_tag_seen_again_is_no_new_one(slam: Any) -> bool:
    """A robot that stands still sees the same two tags, 2 m apart, ten times: the map must hold two."""
    rng, made = np.random.default_rng(5), slam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), _MOTION)
    for _ in range(10):
        made.observe(np.array([[2.0, 0.5], [2.0, -0.5]]) + rng.normal(size=(2, 2)) * [0.03, 0.01], _R)
    return len(made.landmarks) == 2


def jacobian_is_the_derivative(slam: Any) -> bool:
    """H of each of three landmarks against central differences of range and bearing, entry by entry."""
    made = slam(Gaussian(np.array([0.2, -0.1, 0.4]), 1e-4 * np.eye(3)), _MOTION)
    made.observe([[2.0, 0.5], [3.0, -0.1], [2.5, -0.5]], _R)
    x, steps = made.x, 1e-6 * np.eye(len(made.x))

    def h(x: Array, j: int) -> Array:
        return RangeBearing(x[3 + 2 * j : 5 + 2 * j]).h(x[:3])

    return all(
        np.allclose(made.H(j), np.stack([(h(x + s, j) - h(x - s, j)) / 2e-6 for s in steps], axis=-1), atol=1e-6)
        for j in range(len(made.landmarks))
    )


def a_new_landmark_inherits_the_robots_error(slam: Any) -> bool:
    """100,000 robots and measurements: the grown covariance must be that of the samples, to 5 % of its largest entry.

    The spread is small, so that g is linear to a per cent.
    """
    rng, pose = np.random.default_rng(5), Gaussian(np.array([1.0, 0.5, 0.3]), np.diag([0.02, 0.03, 0.01]) ** 2)
    z, made = np.array([2.0, 0.4]), slam(pose, _MOTION)
    made.begin(z, _R)
    robots = pose.sample(rng, 100_000)
    seen = RangeBearing.g(robots, z + rng.normal(size=(100_000, 2)) * np.sqrt(np.diag(_R)))
    return bool(np.allclose(made.P, np.cov(np.c_[robots, seen].T), rtol=0, atol=0.05 * np.var(seen, axis=0).max()))


def near_tags_stay_two_and_a_far_one_stays_one(slam: Any) -> bool:
    """Tags 0.4 m apart from a robot that is sure; then one tag 0.6 m off, from a robot that may err by as much.

    The first needs a threshold below 0.4 m and the second one above 0.6 m: none in metres does both.
    """
    made = slam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(0.3, 0.3))
    near, alone = np.array([[2.0, 0.4], [2.0, 0.6]]), np.array([[3.0, -0.4]])
    for _ in range(3):
        made.observe(np.concatenate([near, alone]), _R)
    told_apart = len(made.landmarks) == 3
    made.predict([0.0, 0.0], 1.0)
    made.observe(alone + np.array([0.0, 0.2]), _R)
    return told_apart and len(made.landmarks) == 3


def every_variance_falls_when_its_landmark_is_seen(slam: Any) -> bool:
    """Seen thirty times at two metres, no landmark may be unsure by more than a metre in any direction."""
    made = slam(Gaussian(np.zeros(3), 1e-4 * np.eye(3)), _MOTION)
    for _ in range(30):
        made.observe([[2.0, 0.5], [2.2, -0.5]], _R)
    return bool(np.diag(made.P)[3:].max() < 1.0)


Exhibit(
    "lab05.inverted_rule",
    "The EKF-SLAM report, 3: nearer than the threshold is 'detected for the first time'.",
    Inverted, PlainSlam, a_tag_seen_again_is_no_new_one,
    "The map doubles at every look, and whatever is far is taken for what is known.",
)  # fmt: skip
Exhibit(
    "lab05.one_column",
    "The EKF-SLAM report, f: H[0, idx] and H[1, idx], and nothing for the heading.",
    OneColumn, PlainSlam, jacobian_is_the_derivative,
    "Half of each landmark is never seen, and the heading is corrected by hearsay only.",
)  # fmt: skip
Exhibit(
    "lab05.thousand",
    "The EKF-SLAM report, g: 1000 on the diagonal and zeros beside it.",
    Thousand, PlainSlam, a_new_landmark_inherits_the_robots_error,
    "The robot's error and its landmark's are the same one; without the cross-covariance the map cannot know.",
)  # fmt: skip
Exhibit(
    "lab05.metres",
    "The EKF-SLAM report, 3a: thresholds of 0.5, 1, 1.6, 2 and 2.5 m were tried.",
    Metres, PlainSlam, near_tags_stay_two_and_a_far_one_stays_one,
    "A threshold that tells two near tags apart founds a second landmark for one seen by an unsure robot.",
)  # fmt: skip
Exhibit(
    "lab05.stuck_variances",
    "The EKF-SLAM report's printed covariances: every other diagonal entry is still 1000.",
    Report, PlainSlam, every_variance_falls_when_its_landmark_is_seen,
    "A variance that never moves is a direction that no measurement reaches.",
)  # fmt: skip
