"""Association against a map that is known: the rules of SLAM, ids and rows, and bad measurements among good ones."""

import numpy as np
import pytest

from coursekit.gaussian import Gaussian, nis
from coursekit.models import RangeBearing
from coursekit.slam.association import (
    AMBIGUOUS,
    NEW,
    Euclidean,
    JointCompatibility,
    Known,
    KnownMap,
    Mahalanobis,
)

PLACES = {6: [2.0, 0.0], 7: [0.0, 2.5], "door": [-2.0, -1.0], 20: [2.0, 0.4]}
POSE = Gaussian([0.2, -0.1, 0.3], np.diag([0.1, 0.1, 0.05]) ** 2)
R = np.diag([0.05, 0.01]) ** 2
RULES = [Euclidean(0.15), Mahalanobis(0.99), JointCompatibility(0.99)]


def seen(names, pose=POSE.mean):
    return np.array([RangeBearing(PLACES[name]).h(pose) for name in names])


def test_an_id_has_a_row_and_a_row_its_id():
    tags = KnownMap(PLACES)
    assert [tags.row(name) for name in PLACES] == [0, 1, 2, 3] and tags.ids == (6, 7, "door", 20)
    np.testing.assert_array_equal(tags.landmarks[tags.row("door")], PLACES["door"])
    with pytest.raises(KeyError, match="no landmark of this map has the id 8"):
        tags.row(8)


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_finds_the_landmark_that_was_seen(rule):
    tags = KnownMap(PLACES)
    assert tags.match(POSE, seen(["door", 20, 6]), R, rule).rows.tolist() == [2, 3, 0]


def test_known_ids_are_matched_to_their_rows_and_strange_ones_are_new():
    tags = KnownMap(PLACES)
    assert tags.match(POSE, seen([7, 6, 7]), R, Known(), ids=["door", 99, 7]).rows.tolist() == [2, NEW, 1]


def test_joint_compatibility_tells_twins_apart_that_one_by_one_fit_better_the_other_way():
    """Two tags 0.4 m apart, and a robot 0.3 m to the side of where it believes: only as a pair do they fit one way."""
    tags, unsure = KnownMap({0: [3.0, 0.0], 1: [3.0, 0.4]}), Gaussian(np.zeros(3), np.diag([0.3, 0.3, 1e-3]) ** 2)
    z = np.array([RangeBearing(p).h([0.0, 0.3, 0.0]) for p in ([3.0, 0.0], [3.0, 0.4])])
    assert tags.match(unsure, z, R, JointCompatibility(0.99)).rows.tolist() == [0, 1]
    assert tags.match(unsure, z[1:], R, Mahalanobis(0.99)).rows.tolist() == [0]


def test_a_gate_on_a_known_map_holds_the_share_that_it_says():
    """Of 4,000 honest measurements from honest beliefs, 99 % fall inside: within 4.5 standard errors of 0.16 %."""
    rng, tags, inside = np.random.default_rng(1), KnownMap({0: [4.0, 1.0]}), []
    for _ in range(4000):
        pose = rng.multivariate_normal(POSE.mean, POSE.cov)
        z = RangeBearing([4.0, 1.0]).h(pose) + rng.normal(0, np.sqrt(np.diag(R)))
        inside.append(tags.match(POSE, z[None], R, Mahalanobis(0.99)).rows[0] == 0)
    assert abs(np.mean(inside) - 0.99) < 4.5 * 0.0016


def test_the_distance_is_that_of_the_ekf_with_a_certain_landmark():
    sensor, z = RangeBearing(PLACES[6], R), seen([6])[0] + [0.2, 0.05]
    H = sensor.H(POSE.mean)
    expected = nis(sensor.residual(z, sensor.h(POSE.mean)), H @ POSE.cov @ H.T + R)
    shown = []
    KnownMap({6: PLACES[6]}).match(POSE, z[None], R, lambda o: shown.append(o) or [0])
    assert shown[0].squared_distances[0, 0] == pytest.approx(expected)


@pytest.mark.parametrize("rule", RULES)
def test_a_bad_measurement_is_named_and_the_others_are_matched(rule):
    z = seen(["door", 7, 20, 6])
    z[0, 0], z[2, 1] = -2.0, np.nan
    got = KnownMap(PLACES).match(POSE, z, R, rule)
    assert got.rows.tolist() == [AMBIGUOUS, 1, AMBIGUOUS, 0]
    assert {i: why.reason.split(":")[0] for i, why in got.rejected.items()} == {0: "a range of -2 m", 2: "not finite"}


def test_a_landmark_underfoot_spoils_no_other():
    under = KnownMap({0: POSE.mean[:2], 1: PLACES[6]})
    for rule in RULES:
        assert under.match(POSE, seen([6]), R, rule).rows.tolist() == [1]


def test_a_larger_state_will_do_and_so_will_no_measurement():
    tags, wide = KnownMap(PLACES), Gaussian([*POSE.mean, 1.0], np.diag([0.1, 0.1, 0.05, 1.0]) ** 2)
    assert tags.match(wide, seen([7]), R, Mahalanobis()).rows.tolist() == [1]
    assert tags.match(POSE, [], R, Mahalanobis()).rows.shape == (0,)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: KnownMap({0: [1.0, np.nan]}), "landmarks: expected finite"),
        (lambda: KnownMap([[1.0, 2.0, 3.0]] * 2), "landmarks: expected finite"),
        (lambda: KnownMap(PLACES).match(POSE, [1.0, 2.0], R, Mahalanobis()), r"z of shape \(m, 2\)"),
        (lambda: KnownMap(PLACES).match(POSE, [[1.0, 2.0]], [R, R], Mahalanobis()), "expected one.* for each of 1"),
        (lambda: KnownMap(PLACES).match(POSE, [[1.0, 2.0]], -R, Mahalanobis()), "R: expected a positive definite"),
        (lambda: KnownMap(PLACES).match(POSE, seen([6]), R, lambda o: [7]), "associate: expected NEW"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()
