"""Lab 9's failures: three lines of a published filter for the MRCLAM recordings, and what each of them does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coursekit import ekf
from coursekit.gaussian import Gaussian, chi2_band, nees, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.labs.lab09.localisation import truth_at
from coursekit.models import DifferentialDrive, RangeBearing, pose_residual
from coursekit.recordings import Mrclam
from coursekit.teaching.experiments import lab_seed
from coursekit.teaching.failures import Failure

_PUBLISHED = "1988kramer/UTIAS-practice"
Resample = Callable[[Array, Array], Array]  # truth (n, 4), times (m,) → headings (m,)
Step = Callable[[Gaussian, Array, float, RangeBearing, Array], Gaussian]

# --- a heading across ±π ----------------------------------------------------------------------------------------


def heading_as_any_number(truth: Array, times: Array) -> Array:
    """The heading between two stamps, interpolated like x and y."""
    return np.asarray(np.interp(times, truth[:, 0], truth[:, 3]))


def heading_the_short_way(truth: Array, times: Array) -> Array:
    """The heading between two stamps, on the short way round."""
    return truth_at(Mrclam(np.zeros((0, 3)), np.zeros((0, 4)), {}, truth, {}), times)[..., 2]


def between_two_headings_lies_their_middle(resample: Resample) -> bool:
    """Half way between two stamps the heading is less than a quarter turn from both, wherever they look."""
    rng = np.random.default_rng(lab_seed(9))
    for before in rng.uniform(-np.pi, np.pi, 100):
        after = wrap_angle(before + rng.uniform(-0.3, 0.3))
        middle = resample(np.array([[0.0, 0, 0, before], [1.0, 0, 0, after]]), np.array([0.5]))[0]
        if max(abs(wrap_angle(middle - before)), abs(wrap_angle(middle - after))) > np.pi / 2:
            return False
    return True


Failure(
    name="lab09.heading_the_long_way",
    source=f"{_PUBLISHED}, common/sampleMRCLAMdataSet.m: angles are unwrapped in tables of 8 columns; the truth has 4",
    wrong=heading_as_any_number,
    right=heading_the_short_way,
    check=between_two_headings_lies_their_middle,
    lesson="Each time the robot looks west, the resampled truth turns once round, and the filter is blamed for it.",
)


# --- a gain from before the prediction ----------------------------------------------------------------------------


def gain_from_before(belief: Gaussian, control: Array, dt: float, sensor: RangeBearing, z: Array) -> Gaussian:
    """One step; the gain takes the covariance from before the prediction, and S the one after it."""
    predicted = ekf.predict(belief, DifferentialDrive(), control, dt)
    H = sensor.H(predicted.mean)
    S = H @ predicted.cov @ H.T + sensor.R
    K = np.linalg.solve(S, H @ belief.cov).T
    mean = predicted.mean + K @ sensor.residual(z, sensor.h(predicted.mean))
    cov = symmetrize((np.eye(3) - K @ H) @ predicted.cov)
    return Gaussian(mean, cov)


def gain_from_after(belief: Gaussian, control: Array, dt: float, sensor: RangeBearing, z: Array) -> Gaussian:
    """One step as table 3.3 has it."""
    return ekf.correct(ekf.predict(belief, DifferentialDrive(), control, dt), sensor, z).belief


def one_step_is_honest(step: Step) -> bool:
    """Over 4000 first steps with a known belief the NEES averages 3.  A sound filter fails once in 10,000."""
    rng, arc, N = np.random.default_rng(lab_seed(9)), DifferentialDrive(), 4000
    sensor, start = (
        RangeBearing(np.array([3.0, 1.0]), np.diag([0.05, 0.02]) ** 2),
        Gaussian(np.zeros(3), 0.01 * np.eye(3)),
    )
    control, scores = np.array([0.5, 0.2]), []
    truths = arc.sample(start.mean + rng.standard_normal((N, 3)) @ np.linalg.cholesky(start.cov).T, control, 1.0, rng)
    for truth in truths:
        z = sensor.h(truth) + rng.standard_normal(2) * np.sqrt(np.diag(sensor.R))
        scores.append(nees(step(start, control, 1.0, sensor, z), truth, pose_residual))
    low, high = chi2_band(3, N, 0.9999)
    return bool(low < np.mean(scores) < high * 1.03)  # h is not straight


Failure(
    name="lab09.gain_from_before",
    source=f"{_PUBLISHED}, localization/EKF_known_corr.m: K = poseCov * H' * inv(S), with S from poseCovBar",
    wrong=gain_from_before,
    right=gain_from_after,
    check=one_step_is_honest,
    lesson="A gain that ignores the last step corrects too little after a long one, and the covariance claims it did.",
)


# --- nine equal numbers ---------------------------------------------------------------------------------------------


def nine_equal_numbers() -> Array:
    """The covariance of the start, with 0.01 in all nine places."""
    return np.full((3, 3), 0.01)


def three_on_the_diagonal() -> Array:
    """0.1 m and 0.1 rad, and nothing that the three have in common."""
    return np.diag([0.1, 0.1, 0.1]) ** 2


def no_direction_is_free_of_error(start: Callable[[], Array]) -> bool:
    """No direction of the state may be known without error: the smallest eigenvalue is positive."""
    return bool(np.linalg.eigvalsh(start())[0] > 1e-9)


Failure(
    name="lab09.nine_equal_numbers",
    source=f"{_PUBLISHED}, localization/EKF_known_corr.m: poseCov = [0.01 0.01 0.01; 0.01 0.01 0.01; …]",
    wrong=nine_equal_numbers,
    right=three_on_the_diagonal,
    check=no_direction_is_free_of_error,
    lesson="Nine equal numbers say that x, y and θ err by exactly the same amount; any other error is ruled out.",
)
