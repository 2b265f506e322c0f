import numpy as np
import pytest

from coursekit import icp
from coursekit.icp.pairing import Iteration, Pairing
from tests.icp.clouds import problem, room


def test_a_step_tells_the_distances_of_its_own_pairs():
    target = np.array([[0.0, 0], [4, 0], [8, 0]])
    source = np.array([[0.0, 1], [4, 2], [8, 9]])
    step = Pairing(source, target, icp.KdTree(target), reach=3.0).match(np.eye(3), np.arange(3))
    assert step.matches.tolist() == [[0, 0], [1, 1]]
    assert step.rmse == pytest.approx(np.sqrt((1 + 4) / 2))
    assert step.cost == pytest.approx((1 + 4 + 3.0**2) / 3)  # who has no partner counts as one at the reach


def test_the_cost_on_planes_is_the_distance_from_them():
    target, source = np.array([[0.0, 0], [5, 0]]), np.array([[0.3, 0.4], [5.3, -0.4]])
    pairing = Pairing(source, target, icp.KdTree(target), normals=np.tile([0.0, 1.0], (2, 1)))
    step = pairing.match(np.eye(3), np.arange(2))
    assert step.rmse == pytest.approx(0.5)
    assert step.cost == pytest.approx(0.16)


@pytest.mark.parametrize("reach", [np.inf, 0.5])
def test_each_half_of_an_iteration_can_only_lower_the_cost(reach):
    p = problem(room, 300, np.random.default_rng(0), angle=0.6, shift=0.4)
    pairing = Pairing(p.source, p.target, icp.KdTree(p.target), reach=reach)
    everyone = np.arange(len(p.source))
    step = pairing.match(np.eye(3), everyone)
    for _ in range(30):
        T = pairing.estimate(step)
        i, j = step.matches.T
        assert np.mean(np.sum((icp.move(T, p.source[i]) - p.target[j]) ** 2, axis=1)) <= step.rmse**2 + 1e-15
        ahead = pairing.match(T, everyone)
        assert ahead.cost <= step.cost + 1e-15
        step = ahead


def test_a_kernel_forgets_an_outlier_that_least_squares_follows():
    rng = np.random.default_rng(1)
    target = rng.uniform(-1, 1, (200, 2))
    source = target - [0.01, 0.02]
    source[:20] += 0.03 * rng.normal(size=(20, 2))
    errors = {}
    for kernel in (None, "huber", "cauchy", "tukey"):
        pairing = Pairing(source, target, icp.KdTree(target), kernel=kernel)
        step = pairing.match(np.eye(3), np.arange(200))
        step = pairing.match(pairing.estimate(step), np.arange(200))
        errors[kernel] = np.linalg.norm(pairing.estimate(step)[:2, 2] - [0.01, 0.02])
    assert max(errors["huber"], errors["cauchy"], errors["tukey"]) < 0.5 * errors[None]


@pytest.mark.parametrize("kernel", sorted(icp.KERNELS))
def test_the_kernels_scale_is_by_default_1_4826_times_the_median_residual(kernel):
    """The weights that a fit gives are those of the definition, written out for residuals of 0.1 … 5 m."""
    residual = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 5.0])  # the median is 0.4
    p = np.stack([np.arange(7.0) * 20, np.arange(7.0) ** 2], axis=1)
    turn = np.arange(7.0)
    q = p + residual[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    step = Iteration(np.eye(3), np.stack([np.arange(7)] * 2, axis=1), rmse=0.0, cost=0.0)
    weights = icp.KERNELS[kernel](residual / (1.4826 * 0.4))
    found = Pairing(p, q, icp.KdTree(q), kernel=kernel).estimate(step)
    assert found == pytest.approx(icp.point_to_point(p, q, weights), abs=1e-12)
    given = Pairing(p, q, icp.KdTree(q), kernel=kernel, kernel_scale=0.2).estimate(step)
    assert given == pytest.approx(icp.point_to_point(p, q, icp.KERNELS[kernel](residual / 0.2)), abs=1e-12)


def test_with_a_kernel_the_cost_is_cut_off_at_three_scales():
    residual = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 5.0])
    p = np.stack([np.arange(7.0) * 20, np.zeros(7)], axis=1)
    q = p + np.stack([np.zeros(7), residual], axis=1)
    step = Pairing(p, q, icp.KdTree(q), kernel="huber").match(np.eye(3), np.arange(7))
    assert step.cost == pytest.approx((np.sum(residual[:-1] ** 2) + (3 * 1.4826 * 0.4) ** 2) / 7)


def test_pairs_that_meet_within_rounding_are_all_good():
    """More than half of them meet exactly, one is a rounding off: its weight is one like the others'."""
    p = np.array([[1.0, 2.0], [1.0, 2.0], [1.0, 2.0], [3.0, 1.0], [5.0, 7.0]])
    q = p.copy()
    q[3:, 0] += [1e-15, -1e-15]
    step = Iteration(np.eye(3), np.stack([np.arange(5)] * 2, axis=1), rmse=0.0, cost=0.0)
    for kernel in icp.KERNELS:
        found = Pairing(p, q, icp.KdTree(q), kernel=kernel).estimate(step)
        assert found == pytest.approx(np.eye(3), abs=1e-12)


def test_a_point_without_a_partner_counts_as_often_as_trimming_keeps_one():
    target = np.array([[0.0, 0], [4, 0], [8, 0], [12, 0]])
    source = target + np.array([[0.0, 1], [0, 2], [0, 9], [0, 9]])
    step = Pairing(source, target, icp.KdTree(target), reach=3.0, trim=0.5).match(np.eye(3), np.arange(4))
    assert step.cost == pytest.approx((1 + 0.5 * 2 * 3.0**2) / 4)
