"""Lab 4's failures: five filters that run, print numbers and are wrong."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit import ekf
from coursekit.ekf import Correction
from coursekit.gaussian import Gaussian
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive, MotionModel, RangeBearing, RangeOnly, SensorModel
from coursekit.teaching.failures import Failure

# --- prediction -------------------------------------------------------------------------------------------------


def transpose_first(belief: Gaussian, motion: MotionModel, control: ArrayLike, dt: float) -> Gaussian:
    """Fᵀ P F + Q: the transpose on the wrong side."""
    u = np.asarray(control, dtype=float)
    F = motion.F(belief.mean, u, dt)
    return Gaussian(motion.f(belief.mean, u, dt), F.T @ belief.cov @ F + motion.Q(belief.mean, u, dt))


def covariance_is_that_of_the_samples(predict: Any) -> bool:
    """100,000 states through the model itself: a heading error must become a sideways error, not the reverse.

    The spread is small, so that a sound filter is linear to a per cent; the tolerance is five times that.
    """
    belief = Gaussian(np.array([0.0, 0.0, 0.8]), np.diag([0.01, 0.02, 0.03]) ** 2)
    motion, control = DifferentialDrive(0.02, 0.01), np.array([1.0, 0.3])
    predicted = predict(belief, motion, control, 1.0)
    rng = np.random.default_rng(4)
    samples = motion.sample(belief.sample(rng, 100_000), control, 1.0, rng)
    return bool(np.allclose(predicted.cov, np.cov(samples.T), rtol=0.05, atol=0.05 * predicted.cov.max()))


# --- correction -------------------------------------------------------------------------------------------------


class BareMinus(RangeBearing):
    """Range and bearing whose residual is a bare minus."""

    @staticmethod
    def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
        """z - z_hat, and nothing done about the bearing."""
        return np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)


def unwrapped_bearing(belief: Gaussian, sensor: RangeBearing, z: ArrayLike, R: ArrayLike | None = None) -> Correction:
    """Correct with z - h(x) as it comes: a landmark right behind the robot jumps by a whole turn."""
    return ekf.correct(belief, BareMinus(sensor.landmark, sensor.R), z, R)


def a_landmark_behind_is_no_surprise(correct: Any) -> bool:
    """Landmarks behind the robot, measured perfectly, 0.01 rad across the seam: the NIS must stay below 1."""
    belief = Gaussian(np.array([0.0, 0.0, 0.0]), np.diag([0.05, 0.05, 0.02]) ** 2)
    behind = RangeBearing(np.array([-3.0, 0.015]))
    z = behind.h(belief.mean) + np.array([0.0, 0.01])
    wrapped = np.array([z[0], z[1] - 2 * np.pi])  # the sensor reports angles in (-π, π]
    return bool(correct(belief, behind, wrapped).nis < 1.0)


class column_repeated(RangeOnly):
    """Range only, with the homework's Eq. (10): (p_x - l_x)/r in both columns."""

    def H(self, x: ArrayLike) -> Array:
        """The derivative by x, written twice."""
        H = super().H(x)
        i, j = self.position
        H[..., 0, j] = H[..., 0, i]
        return H


def jacobian_is_the_derivative(sensor: Any) -> bool:
    """H against central differences of h, at twenty random states."""
    rng, made = np.random.default_rng(10), sensor([1.0, 2.0])
    for _ in range(20):
        x = rng.normal(size=4) * 3
        steps = 1e-6 * np.eye(4)
        numerical = np.stack([(made.h(x + s) - made.h(x - s)) / 2e-6 for s in steps], axis=-1)
        if not np.allclose(made.H(x), numerical, atol=1e-6):
            return False
    return True


# --- gating -----------------------------------------------------------------------------------------------------


def hard_gate(belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Correction:
    """Throw away whatever lies outside the 99 % gate, and believe on."""
    correction = ekf.correct(belief, sensor, z, R)
    if correction.nis > ekf.gate_threshold(0.99, len(correction.innovation)):
        return Correction(belief, correction.innovation, correction.innovation_cov, correction.nis)
    return correction


def a_wrong_belief_is_given_up(correct: Any) -> bool:
    """A belief half a metre wrong and sure to 3 cm, against sixty perfect measurements of two landmarks."""
    truth = np.array([0.5, 0.0, 0.0])
    belief = Gaussian(np.array([0.0, 0.0, 0.0]), np.diag([0.03, 0.03, 0.01]) ** 2)
    motion = DifferentialDrive(0.02, 0.01)
    for _ in range(30):
        belief = ekf.predict(belief, motion, [0.0, 0.0], 0.1)
        for landmark in np.array([[4.0, 2.0], [4.0, -2.0]]):
            sensor = RangeBearing(landmark)
            belief = correct(belief, sensor, sensor.h(truth)).belief
    return bool(np.hypot(*(belief.mean - truth)[:2]) < 0.1)


# --- covariance -------------------------------------------------------------------------------------------------


def short_form(belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Correction:
    """(I - K H) P in plain floating point, and the result taken for a covariance."""
    H, P, R = sensor.H(belief.mean), belief.cov, np.asarray(sensor.R if R is None else R)
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    innovation = sensor.residual(np.asarray(z, dtype=float), sensor.h(belief.mean))
    posterior = (np.eye(len(P)) - K @ H) @ P
    trusted = Gaussian.trusted(belief.mean + K @ innovation, posterior)
    return Correction(trusted, innovation, S, float(innovation @ np.linalg.solve(S, innovation)))


def covariance_stays_symmetric_and_positive(correct: Any) -> bool:
    """A very sharp sensor against a very wide belief, a hundred times: always symmetric and positive."""
    belief = Gaussian(np.zeros(3), np.diag([1e3, 1e3, 1.0]))
    for k in range(100):
        sensor = RangeBearing(np.array([3.0 + 0.01 * k, 1.0]), np.diag([1e-5, 1e-6]) ** 2)
        belief = correct(belief, sensor, sensor.h(belief.mean)).belief
        if not np.array_equal(belief.cov, belief.cov.T) or np.linalg.eigvalsh(belief.cov)[0] <= 0:
            return False
    return True


Failure(
    "lab04.transpose_first",
    "PythonRobotics, EKF-SLAM (G.T @ P @ G; its G is our F), and many a blackboard.",
    transpose_first, ekf.predict, covariance_is_that_of_the_samples,
    "A wrong heading no longer becomes an error to the side: across the road, the ellipse hardly grows.",
)  # fmt: skip
Failure(
    "lab04.unwrapped_bearing",
    "filterpy's extended filter without a residual function: an innovation of -6.18 rad, silently.",
    unwrapped_bearing, ekf.correct, a_landmark_behind_is_no_surprise,
    "The track runs well until a landmark passes behind the robot; then it leaps.",
)  # fmt: skip
Failure(
    "lab04.column_repeated",
    "A homework, its Eq. (10): the third column repeats (p_x - l_x)/r where (p_y - l_y)/r belongs.",
    column_repeated, RangeOnly, jacobian_is_the_derivative,
    "The estimate can only slide along a diagonal, and there the filter is surest.",
)  # fmt: skip
Failure(
    "lab04.hard_gate",
    "Textbook gating with a Q that is too small: on MRCLAM 7 (Lab 9's log) it refuses almost every measurement.",
    hard_gate, ekf.correct_robustly, a_wrong_belief_is_given_up,
    "A filter that is sure and wrong turns away everything that could have told it so.",
)  # fmt: skip
Failure(
    "lab04.short_form",
    "A homework, its Eq. (12), and most programs: P ← (I - K H) P.",
    short_form, ekf.correct, covariance_stays_symmetric_and_positive,
    "After a sharp measurement the matrix is no longer symmetric, and a variance may turn negative.",
)  # fmt: skip
