"""Lab 5's failures: the report's EKF-SLAM, fault by fault, beside one that is sound.

Each fault of the report replaces one method of ``PlainSlam``, so they can be had one by one or, as in the report,
together.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.gaussian import Gaussian
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive, range_bearing
from coursekit.slam.observations import NEW
from coursekit.slam.plain_slam import PlainSlam
from coursekit.teaching.failures import Failure

# --- the report's faults --------------------------------------------------------------------------------------------


class Metres(PlainSlam):
    """Nearest in metres; the report took 1.6 m on the square and 1 m on the octagon."""

    threshold = 1.0

    def _metres(self, z: Array) -> Array:
        return np.linalg.norm(self.landmarks - range_bearing.g(self.x[:3], z), axis=-1)

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

    def augment(self, z: Array, R: Array) -> None:
        """Zeros beside P, and a thousand in the corner."""
        n = len(self.x)
        P = 1000.0 * np.eye(n + 2)
        P[:n, :n], P[n:, :n], P[:n, n:] = self.P, 0.0, 0.0
        self.x, self.P = np.r_[self.x, range_bearing.g(self.x[:3], z)], P

    def _take_in(self, z: Array, R: Array) -> int:
        known = len(self.landmarks)
        j = super()._take_in(z, R)
        if j == known:
            self.correct(z[None], R[None], [j])  # "then we use the location of this landmark to update the state"
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
        return range_bearing.h(x[:3], x[3 + 2 * j : 5 + 2 * j])

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
    made.augment(z, _R)
    robots = pose.sample(rng, 100_000)
    seen = range_bearing.g(robots, z + rng.normal(size=(100_000, 2)) * np.sqrt(np.diag(_R)))
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


Failure(
    "lab05.inverted_rule",
    "The EKF-SLAM report, 3: nearer than the threshold is 'detected for the first time'.",
    Inverted, PlainSlam, a_tag_seen_again_is_no_new_one,
    "The map doubles at every look, and whatever is far is taken for what is known.",
)  # fmt: skip
Failure(
    "lab05.one_column",
    "The EKF-SLAM report, f: H[0, idx] and H[1, idx], and nothing for the heading.",
    OneColumn, PlainSlam, jacobian_is_the_derivative,
    "Half of each landmark is never seen, and the robot's heading is corrected only through its correlations.",
)  # fmt: skip
Failure(
    "lab05.thousand",
    "The EKF-SLAM report, g: 1000 on the diagonal and zeros beside it.",
    Thousand, PlainSlam, a_new_landmark_inherits_the_robots_error,
    "A new landmark is off by the robot's own error; without the cross-covariance the filter forgets that.",
)  # fmt: skip
Failure(
    "lab05.metres",
    "The EKF-SLAM report, 3a: thresholds of 0.5, 1, 1.6, 2 and 2.5 m were tried.",
    Metres, PlainSlam, near_tags_stay_two_and_a_far_one_stays_one,
    "A threshold small enough to tell two near tags apart makes two landmarks of one tag when the robot is unsure.",
)  # fmt: skip
Failure(
    "lab05.stuck_variances",
    "The EKF-SLAM report's printed covariances: every other diagonal entry is still 1000.",
    Report, PlainSlam, every_variance_falls_when_its_landmark_is_seen,
    "A variance that never moves is a direction that no measurement reaches.",
)  # fmt: skip
