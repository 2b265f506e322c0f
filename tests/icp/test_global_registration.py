import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.icp.global_registration import spread_rotations
from tests.icp.clouds import bumps, motion, problem, room


@pytest.mark.parametrize(("shape", "n", "runs"), [(room, 400, 8), (bumps, 1500, 2)])
def test_from_any_rotation_a_start_is_found_that_leads_home(shape, n, runs):
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        p = problem(shape, n, rng, angle=rng.uniform(1, np.pi), shift=rng.uniform(0, 5))
        result = icp.align(p.source, p.target, initial=icp.find_start(p.source, p.target), max_iterations=200)
        assert result.converged and p.error(result.T_target_source) < 0.05


def test_a_start_is_found_with_three_quarters_of_the_overlap():
    for seed in range(4):
        rng = np.random.default_rng(seed)
        p = problem(room, 400, rng, angle=rng.uniform(1, np.pi), shift=1.0, overlap=0.75)
        start = icp.find_start(p.source, p.target, trim=0.6)
        result = icp.align(p.source, p.target, initial=start, trim=0.7, max_iterations=200)
        assert p.error(result.T_target_source) < 0.03


def test_rotations_are_rotations_and_leave_no_large_gap():
    turns = spread_rotations(200, 3)
    assert all(geometry.is_rotation(R, tolerance=1e-12) for R in turns)
    rng, worst = np.random.default_rng(0), 0.0
    for _ in range(300):
        R = motion(3, rng.uniform(0, np.pi), 0, np.zeros(3), rng)[:3, :3]
        traces = np.einsum("nij,ij->n", turns, R)
        worst = max(worst, float(np.arccos(np.clip((traces.max() - 1) / 2, -1, 1))))
    assert worst < np.radians(45)
    assert spread_rotations(4, 2)[1] == pytest.approx(geometry.rotation(np.pi / 2))


def test_bad_clouds_are_refused_at_the_door():
    with pytest.raises(ValueError, match="source: expected finite"):
        icp.find_start([[0.0, np.nan], [1, 1]], np.eye(2))


def test_clouds_of_two_dimensions_are_refused_together():
    with pytest.raises(ValueError, match="one dimension"):
        icp.find_start(np.eye(2), np.eye(3))


def test_of_equal_starts_the_first_that_was_tried_is_returned():
    """A square looks the same four ways.  Which way comes back must not hang on the last bit of a cost."""
    side = np.linspace(-1, 1, 21)[:-1]
    square = np.vstack([np.stack([side, -np.ones(20)], 1) @ geometry.rotation(k * np.pi / 2).T for k in range(4)])
    for turn in (0.0, 1e-3, -1e-3):
        T = icp.find_start(square @ geometry.rotation(turn).T, square)
        assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(-turn, abs=1e-6)
