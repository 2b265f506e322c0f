import numpy as np
import pytest

from coursekit import icp
from coursekit.icp.acceleration import Anderson, quasi_random_subset, subset_sizes
from tests.icp.clouds import bumps, motion, problem, room


def test_subsets_grow_to_the_whole_and_never_start_below_the_smallest():
    assert subset_sizes(50) == [50]
    assert subset_sizes(5750) == [89, 718, 5750]
    assert subset_sizes(100_000, smallest=1000, growth=10) == [1000, 10_000, 100_000]


@pytest.mark.parametrize("n", [100, 5750, 99_991])
def test_a_subset_is_evenly_spread_and_out_of_step_with_any_scanner(n):
    chosen = quasi_random_subset(n, 64)
    assert 60 <= len(chosen) <= 64 and len(np.unique(chosen)) == len(chosen)
    assert np.diff(chosen).max() < 4 * n / 64
    for period in (4, 16, 32, 64):  # of a scanner with so many rows: each row is met
        assert len(np.unique(chosen % period)) > 0.4 * min(period, len(chosen))
    assert np.array_equal(quasi_random_subset(n, n), np.arange(n))


def test_mixing_finds_the_fixed_point_of_a_slow_iteration_in_a_few_looks():
    """An iteration that halves the shift's error in x and takes a twentieth off in y would need hundreds of steps."""
    cloud = np.random.default_rng(0).normal(size=(50, 2))
    goal = np.array([0.3, -0.2])

    def iterate(T):
        ahead = np.eye(3)
        ahead[:2, 2] = T[:2, 2] + [0.5, 0.05] * (goal - T[:2, 2])
        return ahead

    T, mixing = np.eye(3), Anderson(cloud)
    for _ in range(5):
        T = mixing.propose(T, iterate(T))
    assert T[:2, 2] == pytest.approx(goal, abs=1e-9)
    plain = np.eye(3)
    for _ in range(5):
        plain = iterate(plain)
    assert np.abs(plain[:2, 2] - goal).max() > 0.1


def test_a_proposal_is_a_rigid_motion():
    rng = np.random.default_rng(1)
    mixing = Anderson(rng.normal(size=(50, 3)))
    for _ in range(8):
        T = mixing.propose(motion(3, 0.5, 1, np.zeros(3), rng), motion(3, 0.5, 1, np.zeros(3), rng))
        assert T[:3, :3] @ T[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_the_length_of_a_step_is_what_it_does_to_the_cloud():
    rng = np.random.default_rng(2)
    cloud = rng.normal(size=(4000, 3))
    a, b = motion(3, 0.1, 0.2, np.zeros(3), rng), motion(3, 0.12, 0.1, np.zeros(3), rng)
    moved = np.sqrt(np.mean(np.sum((icp.move(a, cloud) - icp.move(b, cloud)) ** 2, axis=1)))
    assert Anderson(cloud).step_length(a, b) == pytest.approx(moved, rel=0.05)


@pytest.mark.parametrize("metric", ["point_to_point", "point_to_plane"])
@pytest.mark.parametrize("shape", [bumps, room])
def test_the_fast_path_ends_at_the_error_of_the_plain_one(shape, metric):
    for seed in range(3):
        p = problem(shape, 1500, np.random.default_rng(seed), angle=0.4, shift=0.2)
        plain = icp.align(p.source, p.target, metric=metric, max_iterations=200)
        fast = icp.align(p.source, p.target, metric=metric, max_iterations=200, accelerate=True)
        assert plain.converged and fast.converged
        assert fast.rmse == pytest.approx(plain.rmse, rel=0.02)  # minima lie close together
        assert p.error(fast.T_target_source) < 0.03


def test_the_fast_path_looks_at_the_whole_cloud_only_a_few_times():
    p = problem(bumps, 4000, np.random.default_rng(3), angle=0.4, shift=0.2)
    looks = []
    for accelerate in (False, True):
        result = icp.align(p.source, p.target, max_iterations=200, accelerate=accelerate)
        looks.append(sum(len(step.matches) == 4000 for step in result.history))
    assert looks[1] < 0.5 * looks[0]
