"""Several measurements of one moment: what they say together, and what becomes of a bad one among them."""

import numpy as np
import pytest

from coursekit import ekf
from coursekit.gaussian import Gaussian, chi2_band
from coursekit.models import Position, RangeBearing, RangeOnly

BELIEF = Gaussian([0.2, -0.1, 3.1], np.diag([0.2, 0.1, 0.1]) ** 2)
PLACES = [[-3.0, 1.0], [-2.0, -1.0], [-4.0, 0.5]]
TAGS = [RangeBearing(place) for place in PLACES]
Z = np.array([tag.h(BELIEF.mean) for tag in TAGS]) + np.array([[0.05, 0.01], [-0.1, 0.02], [0.02, -0.03]])


def same(a, b):
    np.testing.assert_allclose(a.mean, b.mean, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(a.cov, b.cov, rtol=1e-10, atol=1e-14)


def test_of_a_linear_sensor_together_is_one_after_the_other():
    fixes, z = [Position(0.04 * np.eye(2)), Position(np.diag([0.01, 0.09]))], [[0.3, 0.1], [0.1, -0.2]]
    one = ekf.correct(ekf.correct(BELIEF, fixes[0], z[0]).belief, fixes[1], z[1]).belief
    same(ekf.correct_together(BELIEF, fixes, z).belief, one)


def test_the_order_does_not_matter_though_the_sensors_are_not_linear():
    order = [2, 0, 1]
    a, b = ekf.correct_together(BELIEF, TAGS, Z), ekf.correct_together(BELIEF, [TAGS[i] for i in order], Z[order])
    same(a.belief, b.belief)
    assert a.nis == pytest.approx(b.nis)
    one = BELIEF
    for tag, z in zip(TAGS, Z, strict=True):
        one = ekf.correct(one, tag, z).belief
    assert np.abs(one.mean - a.belief.mean).max() > 1e-5  # re-linearised on the way: close, and not the same


def test_a_single_measurement_is_the_plain_correction_and_none_changes_nothing():
    plain, got = ekf.correct(BELIEF, TAGS[0], Z[0]), ekf.correct_together(BELIEF, TAGS[:1], Z[:1])
    same(got.belief, plain.belief)
    assert got.nis == pytest.approx(plain.nis) and got.used == (0,) and got.each[0] == plain.nis
    nothing = ekf.correct_together(BELIEF, [], [])
    assert nothing.belief is BELIEF and nothing.used == () and nothing.nis == 0.0 and nothing.innovation.shape == (0,)


def test_one_R_for_all_one_each_or_the_sensors_own():
    Rs = [tag.R for tag in TAGS]
    same(ekf.correct_together(BELIEF, TAGS, Z).belief, ekf.correct_together(BELIEF, TAGS, Z, Rs).belief)
    same(ekf.correct_together(BELIEF, TAGS, Z).belief, ekf.correct_together(BELIEF, TAGS, Z, Rs[0]).belief)
    same(ekf.correct_together(BELIEF, TAGS, Z).belief, ekf.correct_together(BELIEF, TAGS, Z, Rs[0].tolist()).belief)


def test_sensors_of_different_kinds_go_together():
    sensors = [TAGS[0], RangeOnly(PLACES[1], position=(0, 1)), Position()]
    got = ekf.correct_together(BELIEF, sensors, [Z[0], Z[1][:1], [0.2, 0.0]])
    assert got.innovation.shape == (5,) and got.used == (0, 1, 2)


BAD = {
    "negative": ([-2.0, 0.3], "a range of -2 m"),
    "zero": ([0.0, 0.3], "a range of 0 m"),
    "NaN": ([2.0, np.nan], "not finite"),
    "infinite": ([np.inf, 0.3], "not finite"),
    "its square is infinite": ([1e200, 0.3], "not finite"),
    "degrees": ([2.0, 45.0], "a bearing of 45 rad"),
}


@pytest.mark.parametrize(("z", "reason"), BAD.values(), ids=BAD)
@pytest.mark.parametrize("where", [0, 1, 2])
def test_one_bad_measurement_is_named_and_the_others_are_used(z, reason, where):
    others = [i for i in range(3) if i != where]
    spoiled = [z if i == where else Z[i] for i in range(3)]
    got = ekf.correct_together(BELIEF, TAGS, spoiled)
    same(got.belief, ekf.correct_together(BELIEF, [TAGS[i] for i in others], Z[others]).belief)
    assert got.used == tuple(others) and list(got.rejected) == [where]
    assert not got.rejected[where] and got.rejected[where].reason.startswith(reason)
    assert np.isnan(got.each[where]) and np.isfinite(got.each[others]).all()


def test_a_landmark_under_the_robot_is_named_and_the_others_are_used():
    got = ekf.correct_together(BELIEF, [RangeBearing(BELIEF.mean[:2]), TAGS[1]], [[0.1, 0.0], Z[1]])
    assert got.used == (1,) and "stands on the landmark" in got.rejected[0].reason


def test_a_gate_turns_away_what_surprises_by_itself_and_nothing_without_it():
    wild = Z + np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 0.0]])
    gated, all_in = ekf.correct_together(BELIEF, TAGS, wild, gate=0.99), ekf.correct_together(BELIEF, TAGS, wild)
    assert gated.used == (0, 2) and gated.rejected[1].reason.startswith("outside the gate: NIS")
    assert gated.each[1] > ekf.gate_threshold(0.99, 2) and all_in.used == (0, 1, 2)
    same(gated.belief, ekf.correct_together(BELIEF, [TAGS[0], TAGS[2]], Z[[0, 2]]).belief)


def test_the_joint_surprise_is_chi_square_when_the_belief_is_honest():
    """The mean NIS of 400 moments with six numbers each: a band of 99.99 %."""
    rng, scores = np.random.default_rng(3), []
    for truth in BELIEF.sample(rng, 400):
        z = [tag.h(truth) + rng.normal(0, [0.1, 0.02]) for tag in TAGS]
        scores.append(ekf.correct_together(BELIEF, TAGS, z).nis)
    low, high = chi2_band(6, 400, 0.9999)
    assert low < np.mean(scores) < high


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ekf.correct_together(BELIEF, TAGS, Z[:2]), "one z and one R for each of 3 sensors, got 2 and 3"),
        (lambda: ekf.correct_together(BELIEF, TAGS, Z, [TAGS[0].R] * 2), "for each of 3 sensors, got 3 and 2"),
        (lambda: ekf.correct_together(BELIEF, TAGS, Z[:, :1]), r"z .* expected shape \(2,\)"),
        (lambda: ekf.correct_together(BELIEF, TAGS, Z, -np.eye(2)), "R: expected a positive definite"),
        (lambda: ekf.correct_together(BELIEF, TAGS, Z, gate=1.0), "gate: expected a probability"),
        (
            lambda: ekf.correct_together(Gaussian(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))), TAGS, Z),
            "belief: expected one",
        ),
    ],
)
def test_what_is_wrong_with_the_call_still_raises(call, message):
    with pytest.raises(ValueError, match=message):
        call()
