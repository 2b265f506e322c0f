import numpy as np
import pytest

from coursekit import icp
from coursekit.icp.pairing import Pairing
from tests.icp.clouds import problem, room


def test_a_step_tells_the_distances_of_its_own_pairs():
    target = np.array([[0.0, 0], [4, 0], [8, 0]])
    source = np.array([[0.0, 1], [4, 2], [8, 9]])
    step = Pairing(source, target, icp.KdTree(target), reach=3.0).look(np.eye(3), np.arange(3))
    assert step.matches.tolist() == [[0, 0], [1, 1]]
    assert step.rmse == pytest.approx(np.sqrt((1 + 4) / 2))
    assert step.cost == pytest.approx((1 + 4 + 3.0**2) / 3)  # who has no partner counts as one at the reach


def test_the_cost_on_planes_is_the_distance_from_them():
    target, source = np.array([[0.0, 0], [5, 0]]), np.array([[0.3, 0.4], [5.3, -0.4]])
    pairing = Pairing(source, target, icp.KdTree(target), normals=np.tile([0.0, 1.0], (2, 1)))
    step = pairing.look(np.eye(3), np.arange(2))
    assert step.rmse == pytest.approx(0.5)
    assert step.cost == pytest.approx(0.16)


@pytest.mark.parametrize("reach", [np.inf, 0.5])
def test_each_half_of_an_iteration_can_only_lower_the_cost(reach):
    p = problem(room, 300, np.random.default_rng(0), angle=0.6, shift=0.4)
    pairing = Pairing(p.source, p.target, icp.KdTree(p.target), reach=reach)
    everyone = np.arange(len(p.source))
    step = pairing.look(np.eye(3), everyone)
    for _ in range(30):
        T = pairing.fit(step)
        i, j = step.matches.T
        assert np.mean(np.sum((icp.move(T, p.source[i]) - p.target[j]) ** 2, axis=1)) <= step.rmse**2 + 1e-15
        ahead = pairing.look(T, everyone)
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
        step = pairing.look(np.eye(3), np.arange(200))
        step = pairing.look(pairing.fit(step), np.arange(200))
        errors[kernel] = np.linalg.norm(pairing.fit(step)[:2, 2] - [0.01, 0.02])
    assert max(errors["huber"], errors["cauchy"], errors["tukey"]) < 0.5 * errors[None]
