"""A filter that has left its own gate says so, and blames nothing else."""

import numpy as np
import pytest

from coursekit.ekf.lost import Watch
from coursekit.gaussian import Gaussian
from coursekit.models import DifferentialDrive, range_bearing
from coursekit.slam import CalibratingSlam, EkfSlam, FirstEstimateSlam, InvariantSlam, Lost
from coursekit.slam.association import AMBIGUOUS, Known
from tests.recorded import recording

START = Gaussian(np.zeros(3), 1e-6 * np.eye(3))
R = np.diag([0.1, 0.02]) ** 2
LANDMARKS = np.array([[3.0, 1.0], [2.5, -1.0], [4.0, 0.2]])

KINDS = pytest.mark.parametrize("kind", [EkfSlam, InvariantSlam, FirstEstimateSlam, CalibratingSlam])


def looks(slam, rng, scale, count=80):
    """Feed a filter that stands still with noise ``scale`` times what R says."""
    for _ in range(count):
        slam.predict([0.0, 0.0], 0.1)
        z = range_bearing.h(np.zeros(3), LANDMARKS) + scale * rng.standard_normal((3, 2)) * [0.1, 0.02]
        slam.observe(np.maximum(z, [0.1, -3.0]), R, ["a", "b", "c"])


@KINDS
def test_an_honest_filter_is_never_lost(kind):
    for seed in range(5):
        slam = kind(START, DifferentialDrive(), Known())
        looks(slam, np.random.default_rng(seed), 1.0)
        assert slam.lost is None


@KINDS
def test_innovations_ten_times_too_long_are_lost_with_a_reason_and_a_time(kind):
    slam = kind(START, DifferentialDrive(), Known())
    looks(slam, np.random.default_rng(1), 1.0, 30)
    looks(slam, np.random.default_rng(1), 10.0, 40)
    assert isinstance(slam.lost, Lost) and not slam.lost
    assert "surprise too much" in slam.lost.reason and 3.0 < slam.lost.since < 7.0


def test_twice_the_noise_is_a_poor_R_and_not_yet_lost():
    slam = EkfSlam(START, DifferentialDrive(), Known())
    looks(slam, np.random.default_rng(2), 1.7)
    assert slam.lost is None


def test_a_filter_that_knows_nothing_of_what_it_sees_is_lost():
    slam = EkfSlam(START, DifferentialDrive(), lambda seen: np.full(len(seen.z), AMBIGUOUS, dtype=np.intp))
    for k in range(60):
        slam.predict([0.1, 0.0], 0.5)
        slam.observe([[2.0, 0.1]], R)
        slam.observe([], R)  # nothing seen says nothing
        assert slam.lost is None or k >= 30
    assert "no measurement was a landmark" in slam.lost.reason


def test_a_broken_covariance_is_lost_and_the_next_steps_change_nothing():
    slam = EkfSlam(START, DifferentialDrive(), Known())
    slam.observe([[2.0, 0.1]], R, ["a"])
    slam._P._P[0, 0] = -1.0
    before = slam.mean
    assert slam.observe([[2.0, 0.1]], R, ["a"]).tolist() == [-1]
    slam.predict([0.1, 0.0], 1.0)
    assert "covariance is broken" in slam.lost.reason and "R:" not in slam.lost.reason
    np.testing.assert_array_equal(slam.mean, before)


def test_the_first_reason_stands():
    watch = Watch()
    watch.give_up("first")
    watch.time = 5.0
    watch.give_up("second")
    assert watch.lost == Lost("first", 0.0)


def test_arguments_that_cannot_be_are_still_errors_when_lost():
    slam = EkfSlam(START, DifferentialDrive(), Known())
    slam._watch.give_up("for the test")
    with pytest.raises(ValueError, match="ids"):
        slam.observe([[2.0, 0.1], [2.0, 0.2]], R, ["a"])
    with pytest.raises(ValueError, match="z: expected"):
        slam.observe([2.0, 0.1], R, ["a"])


@pytest.mark.parametrize(
    ("wheels", "sigmas"),
    [((0.05, 0.15), (0.15, 0.04)), ((0.05, 0.15), (0.1, 0.03)), ((0.03, 0.1), (0.2, 0.05)),
     pytest.param((0.1, 0.3), (0.15, 0.04), marks=pytest.mark.slow),
     pytest.param((0.05, 0.1), (0.3, 0.1), marks=pytest.mark.slow)],
)  # fmt: skip
def test_first_estimates_that_run_away_on_a_real_robot_say_that_they_are_lost(wheels, sigmas):
    """Nothing is raised; whoever stops at ``lost`` is still inside the hall, which is some 15 m long."""
    from coursekit.labs.lab09.localisation import events, start_of, truth_at

    run = recording("mrclam7_robot1")
    slam, worst = FirstEstimateSlam(start_of(run), DifferentialDrive(*wheels), Known()), 0.0
    for stamp, control, dt, sightings in events(run):
        if stamp > run.groundtruth[-1, 0] or (slam.lost is not None and slam._watch.time > slam.lost.since + 30):
            break
        if dt > 0:
            slam.predict(control, dt)
        once = dict(reversed(sightings))
        if once:
            slam.observe(np.array(list(once.values())), np.diag(sigmas) ** 2, list(once))
        if slam.lost is None:
            worst = max(worst, float(np.hypot(*(slam.pose.mean - truth_at(run, stamp))[:2])))
    assert worst < 10.0
