"""Constants in the state: a radio that calibrates itself, and a motion model with more entries than it knows."""

import numpy as np
import pytest

from coursekit import ekf
from coursekit.gaussian import Gaussian, chi2_band
from coursekit.models import DifferentialDrive, RangeOnly, ScaledRange, WithConstants

BEACONS = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [0.0, 15.0]])
R = np.array([[0.15**2]])
WHEELS = DifferentialDrive(0.05, 0.05, (1e-4, 1e-4, 1e-4))


def drive(rng, scale, offset, sensor_of, motion, start, steps=400):
    """Four beacons in turn on a drive of 160 m → RMSE of the position after the first quarter, and the last belief."""
    truth, belief, errors = np.array([10.0, 3.0, 0.0]), start, []
    for k in range(steps):
        u = np.array([1.0, 0.18 + 0.1 * np.sin(0.05 * k)])
        truth = WHEELS.sample(truth[None], u, 0.4, rng)[0]
        belief = ekf.predict(belief, motion, u, 0.4)
        beacon = BEACONS[k % 4]
        z = scale * np.hypot(*(truth[:2] - beacon)) + offset + rng.normal(0, 0.15)
        belief = ekf.correct(belief, sensor_of(beacon), [z]).belief
        errors.append(np.hypot(*(truth - belief.mean[:3])[:2]))
    return np.sqrt(np.mean(np.square(errors[steps // 4 :]))), belief


def taken_at_its_word(rng, scale, offset):
    start = Gaussian([10.0, 3.0, 0.0], np.diag([0.3, 0.3, 0.1]) ** 2)
    return drive(rng, scale, offset, lambda b: RangeOnly(b, R, position=(0, 1)), WHEELS, start)[0]


def calibrated(rng, scale, offset):
    start = Gaussian([10.0, 3.0, 0.0, 1.0, 0.0], np.diag([0.3, 0.3, 0.1, 0.1, 0.5]) ** 2)
    motion = WithConstants(WHEELS, drift=(1e-4, 1e-4))
    return drive(rng, scale, offset, lambda b: ScaledRange(b, R, scale=3, offset=4), motion, start)


@pytest.mark.parametrize("seed", [101, 102, 103, 104])
def test_a_radio_whose_metres_are_too_long_calibrates_itself(seed):
    """7 % too long, and 0.3 m before its antenna: 1.8 m off at its word, 0.12 m calibrated (means of 30 more)."""
    off = taken_at_its_word(np.random.default_rng(seed), 1.07, 0.3)
    error, belief = calibrated(np.random.default_rng(seed), 1.07, 0.3)
    assert error < 0.2 and off > 5 * error
    sigma = np.sqrt(np.diag(belief.cov))[3:]
    assert np.all(np.abs(belief.mean[3:] - [1.07, 0.3]) < 4 * sigma) and sigma[0] < 0.005 and sigma[1] < 0.05


def test_a_radio_that_is_right_loses_next_to_nothing_by_being_calibrated():
    plain = [taken_at_its_word(np.random.default_rng(s), 1.0, 0.0) for s in range(110, 114)]
    own = [calibrated(np.random.default_rng(s), 1.0, 0.0)[0] for s in range(110, 114)]
    assert np.mean(own) < 1.15 * np.mean(plain)


def test_scale_and_offset_are_as_sure_as_they_should_be():
    """Scale and offset at the end of 40 drives: mean NEES in the two-sided band of 99.9 %."""
    rng, scores = np.random.default_rng(9), []
    for _ in range(40):
        true = rng.normal([1.0, 0.0], [0.1, 0.5])
        _, belief = calibrated(rng, *true)
        e = belief.mean[3:] - true
        scores.append(e @ np.linalg.solve(belief.cov[3:, 3:], e))
    low, high = chi2_band(2, 40, 0.999)
    assert low < np.mean(scores) < high


def test_scale_alone_offset_alone_and_neither():
    x = np.array([3.0, 4.0, 0.0, 1.1, 0.2])
    where = {"landmark": [0.0, 0.0], "position": (0, 1)}
    assert ScaledRange(**where, scale=3, offset=4).h(x) == pytest.approx([5.7])
    assert ScaledRange(**where, scale=None, offset=4).h(x) == pytest.approx([5.2])
    assert ScaledRange(**where, scale=3).h(x) == pytest.approx([5.5])
    assert ScaledRange(**where, scale=None).h(x) == RangeOnly([0.0, 0.0], position=(0, 1)).h(x)


def test_constants_stay_and_drift_as_told():
    """Standard deviations of 20,000 draws over 4 s, to 3 % (6 standard errors)."""
    motion, x = WithConstants(WHEELS, (0.1, 0.0)), np.array([1.0, 2.0, 0.3, 1.1, 0.2])
    draws = motion.sample(np.tile(x, (20_000, 1)), np.array([0.5, 0.1]), 4.0, np.random.default_rng(2))
    np.testing.assert_array_equal(draws[:, 4], 0.2)
    assert draws[:, 3].std() == pytest.approx(0.2, rel=0.03)
    assert np.sqrt(motion.Q(x, np.array([0.5, 0.1]), 4.0)[3, 3]) == pytest.approx(0.2)


def test_many_beliefs_go_at_once():
    many = Gaussian(np.tile([1.0, 2.0, 0.3, 1.0], (5, 1)), np.tile(0.01 * np.eye(4), (5, 1, 1)))
    moved = ekf.predict(many, WithConstants(WHEELS, (0.0,)), [0.5, 0.1], 0.2)
    seen = ekf.correct(moved, ScaledRange([4.0, 0.0], R), [3.0])
    one = ekf.correct(
        ekf.predict(many[2], WithConstants(WHEELS, (0.0,)), [0.5, 0.1], 0.2), ScaledRange([4.0, 0.0], R), [3.0]
    )
    np.testing.assert_allclose(seen.belief.mean[2], one.belief.mean, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ScaledRange([0.0, 0.0], scale=1), "different entries of the state"),
        (lambda: ScaledRange([0.0, 0.0], scale=-1), "different entries of the state"),
        (lambda: ScaledRange([0.0, np.nan]), "landmark"),
        (
            lambda: ScaledRange([0.0, 0.0], scale=3).h([1.0, 2.0, 0.0]),
            r"state: expected shape \(\.\.\., n\) with n > 3",
        ),
        (lambda: WithConstants(WHEELS, (-1.0,)), "drift: expected standard deviations"),
        (lambda: WithConstants(WHEELS, ()), "drift: expected standard deviations"),
        (
            lambda: WithConstants(WHEELS, (0.1, 0.1)).f([1.0, 2.0], [0.1, 0.1], 0.1),
            r"state: expected shape \(\.\.\., n \+ 2\)",
        ),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()
