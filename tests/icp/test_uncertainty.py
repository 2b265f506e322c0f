import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.gaussian import check_covariance, chi2_band
from coursekit.models import pose_residual
from tests.icp.clouds import back, bumps, corridor, motion, problem, room


def planar_error(p, result):
    T = p.T_target_source
    truth = np.array([T[0, 2], T[1, 2], np.arctan2(T[1, 0], T[0, 0])])
    return pose_residual(truth, result.pose)


def spatial_error(p, result):
    T, found = p.T_target_source, result.T_target_source
    return np.r_[T[:3, 3] - found[:3, 3], geometry.so3_log(T[:3, :3] @ found[:3, :3].T)]


def average_nees(shape, n, error, runs, **options):
    values = []
    for seed in range(runs):
        p = problem(shape, n, np.random.default_rng(seed), angle=0.1, shift=0.03)
        result = icp.align(p.source, p.target, max_iterations=100, **options)
        e = error(p, result)
        values.append(e @ np.linalg.solve(result.covariance, e))
    return np.mean(values)


@pytest.mark.parametrize(
    ("shape", "n", "error", "metric"),
    [
        (room, 400, planar_error, "point_to_plane"),
        (room, 400, planar_error, "point_to_point"),
        (bumps, 1000, spatial_error, "point_to_plane"),
        (bumps, 1000, spatial_error, "point_to_point"),
    ],
)
def test_the_covariance_is_the_errors_covariance_within_a_factor_of_two(shape, n, error, metric):
    """Monte Carlo over clouds sampled anew, 40 runs.

    A claim, not a law: the average NEES lies between a half and twice the degrees of freedom, widened by the 99.9 %
    band of a chi-square average, so a covariance within that factor fails once in a thousand.
    """
    dof, runs = (3, 40) if shape is room else (6, 40)
    low, high = chi2_band(dof, runs, confidence=0.999)
    assert 0.5 * low < average_nees(shape, n, error, runs, metric=metric) < 2 * high


def test_pairs_taken_for_granted_are_several_times_too_sure_of_themselves():
    """Why not the textbook's (JᵀJ)⁻¹ σ² with every coordinate of every pair: in the same room it is ten times off."""
    values = []
    for seed in range(20):
        p = problem(room, 400, np.random.default_rng(seed), angle=0.1, shift=0.03)
        result = icp.align(p.source, p.target, max_iterations=100)
        i, j = result.matches.T
        moved = icp.move(result.T_target_source, p.source[i])
        arm = moved - result.T_target_source[:2, 2]
        J = np.zeros((2 * len(i), 3))
        J[0::2, 0] = J[1::2, 1] = 1
        J[0::2, 2], J[1::2, 2] = -arm[:, 1], arm[:, 0]
        residual = (p.target[j] - moved).ravel()
        e = planar_error(p, result)
        values.append(e @ (J.T @ J / np.mean(residual**2)) @ e)
    assert np.mean(values) > 2 * 3


def test_along_a_corridor_nothing_is_known_and_across_it_everything():
    rng = np.random.default_rng(0)
    target, source = (corridor(360, rng) + rng.normal(0, 0.01, (360, 2)) for _ in range(2))
    for metric in ("point_to_point", "point_to_plane"):
        sigma = np.sqrt(np.diag(icp.align(source, target, metric=metric).covariance))
        assert sigma[0] > 1.0  # as long as the corridor, more or less
        assert sigma[1] < 0.02 and sigma[2] < 0.01


def test_one_end_wall_is_enough_to_know_the_place_along_the_corridor():
    rng = np.random.default_rng(1)
    wall = np.stack([np.full(60, 5.0), np.linspace(-1, 1, 60)], axis=1)
    target, source = (np.vstack([corridor(300, rng), wall]) + rng.normal(0, 0.01, (360, 2)) for _ in range(2))
    result = icp.align(source, target, metric="point_to_plane")
    assert result.converged
    assert np.sqrt(result.covariance[0, 0]) < 0.01


def test_twice_the_noise_is_twice_the_sigma_and_four_times_the_points_half_of_it():
    def sigma(n, noise):
        runs = [problem(room, n, np.random.default_rng(s), angle=0.05, noise=noise) for s in range(5)]
        return np.mean(
            [np.sqrt(np.diag(icp.align(p.source, p.target, metric="point_to_plane").covariance)) for p in runs], 0
        )

    base = sigma(400, 0.005)
    assert sigma(400, 0.01) / base == pytest.approx(2, rel=0.3)
    assert sigma(1600, 0.005) / base == pytest.approx(0.5, rel=0.3)


def test_the_covariance_belongs_to_the_pose_wherever_the_origin_is():
    """Seen from an origin 50 m away, a doubt about the heading becomes a doubt about the place."""
    p = problem(room, 400, np.random.default_rng(3))
    near = icp.align(p.source, p.target)
    shift = np.array([50.0, 0.0])
    T = near.T_target_source.copy()
    T[:2, 2] += shift - T[:2, :2] @ shift
    far = icp.align(p.source + shift, p.target + shift, initial=T)
    assert far.covariance[2, 2] == pytest.approx(near.covariance[2, 2], rel=1e-3)
    assert np.sqrt(far.covariance[1, 1]) == pytest.approx(50 * np.sqrt(near.covariance[2, 2]), rel=0.2)


def test_covariances_are_symmetric_and_positive_definite_in_the_plane_and_in_space():
    for shape, size in ((room, 3), (bumps, 6)):
        p = problem(shape, 500, np.random.default_rng(4))
        check_covariance(icp.align(p.source, p.target).covariance, size=size)


def test_scattered_landmarks_speak_in_every_direction():
    """A handful of points that are the same in both clouds: the closed form of least squares is then the right one."""
    values = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        target = rng.uniform(-5, 5, (60, 2))
        T = motion(2, 0.02, 0.05, np.zeros(2), rng)
        source = icp.move(back(T), target + rng.normal(0, 0.02, target.shape))
        result = icp.align(source, target)
        assert result.converged
        e = pose_residual([T[0, 2], T[1, 2], np.arctan2(T[1, 0], T[0, 0])], result.pose)
        values.append(e @ np.linalg.solve(result.covariance, e))
    low, high = chi2_band(3, 60, confidence=0.999)
    assert 0.8 * low < np.mean(values) < 1.25 * high
