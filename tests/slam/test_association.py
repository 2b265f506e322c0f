"""Which landmark was that?  Each rule on its own ground, and on each other's."""

import numpy as np
import pytest
from scipy.stats import chi2

from coursekit.models import RangeBearing
from coursekit.slam.association import (
    AMBIGUOUS,
    NEW,
    Euclidean,
    JointCompatibility,
    Known,
    Mahalanobis,
    Observations,
)
from tests.work import within

R = np.diag([0.05, 0.02]) ** 2


def observations(z, landmarks, P=None, R=R, pose=(0.0, 0.0, 0.0), **ids):
    """Observations of a map with the whole covariance P of [pose, landmarks]; the default knows both to a hair."""
    z, landmarks, pose = np.reshape(z, (-1, 2)).astype(float), np.reshape(landmarks, (-1, 2)), np.array(pose)
    n = len(landmarks)
    P = 1e-8 * np.eye(3 + 2 * n) if P is None else P

    def covariances():
        own = np.array([P[3 + 2 * j : 5 + 2 * j, 3 + 2 * j : 5 + 2 * j] for j in range(n)]).reshape(n, 2, 2)
        return P[:3, :3], P[3:, :3].reshape(n, 2, 3), own

    def between(indices):
        rows = (3 + 2 * np.asarray(indices)[:, None] + [0, 1]).ravel()
        return P[np.ix_(rows, rows)]

    noise = np.broadcast_to(R, (len(z), 2, 2))
    return Observations(z, noise, pose, landmarks, (pose, landmarks), covariances, between, **ids)


def seen(landmarks, pose=(0.0, 0.0, 0.0)):
    return np.array([RangeBearing(p).h(pose) for p in landmarks])


MAP = np.array([[2.0, 0.0], [2.0, 1.0], [1.0, -1.5], [-1.0, 2.0]])
RULES = [Euclidean(0.3), Mahalanobis(0.99), JointCompatibility(0.99)]


@pytest.mark.parametrize("rule", RULES)
def test_a_clear_case_is_clear_to_every_rule(rule):
    order = [2, 0, 3, 1]
    far = [4.0, -2.5]
    chosen = rule(observations([*seen(MAP[order]), far], MAP))
    assert chosen.tolist() == [*order, NEW]


@pytest.mark.parametrize("rule", RULES)
def test_an_empty_map_makes_everything_new_and_no_measurement_makes_nothing(rule):
    assert rule(observations(seen(MAP), np.empty((0, 2)))).tolist() == [NEW] * 4
    assert rule(observations(np.empty((0, 2)), MAP)).tolist() == []


@pytest.mark.parametrize("rule", RULES)
def test_no_landmark_is_given_twice_and_the_nearer_gets_it(rule):
    z = seen(MAP[[0, 0]]) + np.array([[0.02, 0.0], [0.001, 0.0]])
    chosen = rule(observations(z, MAP))
    assert chosen[1] == 0 and chosen[0] in (NEW, AMBIGUOUS)


@pytest.mark.parametrize("rule", RULES)
def test_a_bearing_across_pi_is_the_same_landmark(rule):
    z = [[3.0, -np.pi + 0.005]]
    assert rule(observations(z, [[-3.0, 0.01], [3.0, 0.0]])).tolist() == [0]


@pytest.mark.parametrize("rule", RULES)
def test_ids_are_read_by_nobody_but_known(rule):
    z = seen(MAP)
    honest = rule(observations(z, MAP))
    misled = rule(observations(z, MAP, ids=["d", "c", "b", "a"], labels={"a": 0, "b": 1, "c": 2, "d": 3}))
    assert honest.tolist() == misled.tolist()


def test_known_ids_are_believed_even_against_the_measurements():
    labels = {17: 1, 4: 0}
    assert Known()(observations(seen(MAP[:3]), MAP, ids=[17, 99, 4], labels=labels)).tolist() == [1, NEW, 0]


def test_known_refuses_missing_ids():
    with pytest.raises(ValueError, match="ids: Known"):
        Known()(observations(seen(MAP[:1]), MAP))


def test_one_tag_in_two_places_costs_its_own_measurements_and_no_other():
    labels = {17: 1, 4: 0}
    chosen = Known()(observations(seen(MAP), MAP, ids=[17, 4, 17, 99], labels=labels))
    assert chosen.tolist() == [AMBIGUOUS, 0, AMBIGUOUS, NEW]


def test_the_gate_holds_the_share_that_it_says():
    """20,000 honest measurements of one uncertain landmark from an uncertain pose: within the gate of 0.99 and of 0.9
    to four standard errors, 1 false alarm in 8,000."""
    rng = np.random.default_rng(1)
    A = rng.normal(0, 0.05, (5, 5))
    P = A @ A.T + 1e-4 * np.eye(5)
    mean = np.array([0.0, 0.0, 0.0, 3.0, 1.0])
    draws = mean + 0.3 * rng.standard_normal((20_000, 5)) @ np.linalg.cholesky(P).T  # small: h is straight over it
    d = draws[:, 3:] - draws[:, :2]
    z = np.stack([np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0]) - draws[:, 2]], axis=-1)
    z += 0.3 * rng.standard_normal(z.shape) * np.sqrt(np.diag(R))
    squared = observations(z, mean[3:], 0.09 * P, 0.09 * R, pose=mean[:3]).squared_distances[:, 0]
    for gate in (0.9, 0.99):
        share = np.mean(squared < chi2.ppf(gate, 2))
        assert abs(share - gate) < 4 * np.sqrt(gate * (1 - gate) / 20_000) + 0.002


def test_distances_are_those_of_a_joint_gaussian_written_out():
    rng = np.random.default_rng(2)
    n = len(MAP)
    A = rng.normal(0, 0.2, (3 + 2 * n, 3 + 2 * n))
    P, pose = A @ A.T, np.array([0.3, -0.2, 0.4])
    z = seen(MAP, pose) + rng.normal(0, 0.1, (n, 2))
    got = observations(z, MAP, P, pose=pose).squared_distances
    for i in range(n):
        for j in range(n):
            sensor, H = RangeBearing(MAP[j]), np.zeros((2, 3 + 2 * n))
            H[:, :3], H[:, 3 + 2 * j : 5 + 2 * j] = sensor.H(pose), sensor.H_landmark(pose)
            innovation = sensor.residual(z[i], sensor.h(pose))
            assert got[i, j] == pytest.approx(innovation @ np.linalg.solve(H @ P @ H.T + R, innovation), rel=1e-9)


# Two tags 0.4 m apart, and a robot whose heading is off by nearly as much as the angle between them.
PAIR = np.array([[2.5, 0.2], [2.5, -0.2]])


def turned(angle, sigma):
    """What is seen of the pair by a robot that is turned by ``angle`` and knows its heading to ``sigma``."""
    P = np.diag([1e-6, 1e-6, sigma**2, 1e-6, 1e-6, 1e-6, 1e-6])
    return observations(seen(PAIR, (0.0, 0.0, angle)), PAIR, P, R=np.diag([0.02, 0.005]) ** 2)


def test_joint_compatibility_keeps_apart_what_nearest_neighbours_swap():
    """Both seen from a pose turned by 0.14 rad, σ = 0.1: each tag looks nearest to where the *other* one was expected;
    only as a pair do they tell that the robot is turned."""
    case = turned(0.14, 0.1)
    assert np.argmin(case.metres, axis=1).tolist() == [1, 1]
    assert JointCompatibility(0.99)(case).tolist() == [0, 1]
    assert Mahalanobis(0.99)(case).tolist() != [0, 1]
    assert Euclidean(0.5)(case).tolist() != [0, 1]


def test_a_jointly_impossible_pair_is_cut_to_the_part_that_agrees():
    """Each measurement alone agrees with its landmark through a heading error, but of opposite signs."""
    case = turned(0.0, 0.1)
    z = case.z + np.array([[0.0, 0.15], [0.0, -0.15]])
    torn = observations(z, PAIR, np.diag([1e-6, 1e-6, 0.01, 1e-6, 1e-6, 1e-6, 1e-6]), R=np.diag([0.02, 0.005]) ** 2)
    assert np.all(np.diag(torn.squared_distances) < chi2.ppf(0.99, 2))
    assert np.sum(JointCompatibility(0.99)(torn) >= 0) == 1


def test_joint_distances_are_those_of_the_whole_innovation():
    """Brute force over every assignment of four measurements to five landmarks: the same size and the same set."""
    from itertools import permutations

    rng = np.random.default_rng(4)
    for _ in range(12):
        landmarks = rng.uniform([1, -1.5], [4, 1.5], (4, 2))
        A = rng.normal(0, 0.12, (11, 11))
        P, noise = A @ A.T + 1e-4 * np.eye(11), np.diag([0.05, 0.03]) ** 2
        truth = rng.multivariate_normal(np.r_[0, 0, 0, landmarks.ravel()], P)
        z = seen(truth[3:].reshape(-1, 2)[:3], truth[:3]) + rng.normal(0, [0.05, 0.03], (3, 2))
        case = observations(z, landmarks, P, noise)
        best = (0, 0.0, ())
        for choice in permutations([*range(4), -1, -1, -1], 3):
            pairs = [(i, j) for i, j in enumerate(choice) if j >= 0]
            if not pairs:
                continue
            H, nu = np.zeros((2 * len(pairs), 11)), np.concatenate([case.innovations[i, j] for i, j in pairs])
            for row, (_, j) in enumerate(pairs):
                sensor = RangeBearing(landmarks[j])
                H[2 * row : 2 * row + 2, :3] = sensor.H(np.zeros(3))
                H[2 * row : 2 * row + 2, 3 + 2 * j : 5 + 2 * j] = sensor.H_landmark(np.zeros(3))
            S = H @ P @ H.T + np.kron(np.eye(len(pairs)), noise)
            squared = nu @ np.linalg.solve(S, nu)
            alone = all(case.squared_distances[i, j] < chi2.ppf(0.99, 2) for i, j in pairs)
            if alone and squared < chi2.ppf(0.99, 2 * len(pairs)) and (len(pairs), -squared) > (best[0], -best[1]):
                best = (len(pairs), squared, tuple(pairs))
        chosen = JointCompatibility(0.99)(case)
        assert [(i, int(j)) for i, j in enumerate(chosen) if j >= 0] == list(best[2])


def test_between_gate_and_novelty_lies_what_is_unsure():
    sigma = np.sqrt(R[0, 0])
    for rule in (Mahalanobis(0.99), JointCompatibility(0.99)):
        at = [rule(observations([[2.0 + k * sigma, 0.0]], MAP[:1]))[0] for k in (1, 4, 8)]
        assert at == [0, AMBIGUOUS, NEW]


def test_a_crowd_is_answered_with_bounded_work():
    """Three hundred measurements of three hundred landmarks; and forty that could each be any of forty, where the
    search for the largest joint set would take all night and has to stop early."""
    rng = np.random.default_rng(5)
    landmarks = rng.uniform(-50, 50, (300, 2))
    z = seen(landmarks)[rng.permutation(300)]
    for rule, most_calls in ((Euclidean(0.3), 10_000), (Mahalanobis(), 10_000), (JointCompatibility(), 500_000)):
        chosen = within(most_calls, lambda rule=rule: rule(observations(z, landmarks)))
        assert np.sum(chosen >= 0) > 290
    crowd = np.tile([[2.0, 0.0]], (40, 1)) + rng.normal(0, 0.01, (40, 2))
    cramped = MAP[:1] + rng.normal(0, 0.02, (40, 2))
    stopped = within(500_000, lambda: JointCompatibility(max_nodes=2000)(observations(crowd, cramped)))
    assert np.sum(stopped >= 0) > 10


def test_the_search_ends_when_no_other_set_can_agree_better():
    """Each of twenty landmarks has a twin 5 cm away that would do, too: 2²⁰ sets of twenty pairs."""
    landmarks = np.random.default_rng(6).uniform(-10, 10, (20, 2))
    z, rule = seen(landmarks), JointCompatibility(0.99)
    twins = np.concatenate([landmarks, landmarks + np.array([0.05, 0.0])])
    assert within(50_000, lambda: rule(observations(z, twins))).tolist() == list(range(20))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Euclidean(0.0), "threshold: expected metres > 0"),
        (lambda: Euclidean(np.nan), "threshold"),
        (lambda: Mahalanobis(1.0), "gate"),
        (lambda: Mahalanobis(9.21), "gate"),
        (lambda: Mahalanobis(0.99, new_landmark_gate=0.9), "gate ≤ new_landmark_gate"),
        (lambda: JointCompatibility(0.0), "gate"),
        (lambda: JointCompatibility(max_nodes=0), "max_nodes: expected a whole number ≥ 1"),
    ],
)
def test_a_rule_that_cannot_be_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
