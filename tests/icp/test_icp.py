"""Lab 6's claims on recordings that nobody here made, and in the world."""

import numpy as np
import pytest

from coursekit import geometry, icp
from tests.recorded import recording

PUBLISHED = np.array(
    [
        [0.947817, -0.125278, -0.293168, 0.483643],
        [0.196485, 0.953703, 0.227703, -0.248299],
        [0.251068, -0.273425, 0.92855, 0.255736],
        [0, 0, 0, 1],
    ]
)


@pytest.fixture(scope="module")
def clouds():
    return recording("icp_clouds")


@pytest.fixture(scope="module")
def plain(clouds):
    return icp.align(clouds.source, clouds.target, max_distance=0.25)


def assert_is_the_answer(result):
    assert result.converged
    assert result.T_target_source[:3, 3] == pytest.approx([0.49969, -0.30002, 0.30057], abs=1e-4)
    assert result.T_target_source[0, :3] == pytest.approx([0.95218, -0.15852, -0.26119], abs=1e-4)
    assert result.rmse == pytest.approx(0.00741, abs=1e-5)
    assert result.matches.shape == (5750, 2) and np.array_equal(result.matches[:, 0], np.arange(5750))


def test_the_reports_clouds_are_half_a_metre_apart_and_not_where_the_report_put_them(plain):
    assert_is_the_answer(plain)
    assert geometry.is_rotation(plain.T_target_source[:3, :3], tolerance=1e-12)


def test_the_fast_path_ends_at_the_same_answer(clouds, plain):
    fast = icp.align(clouds.source, clouds.target, max_distance=0.25, accelerate=True)
    assert_is_the_answer(fast)
    assert fast.rmse == pytest.approx(plain.rmse, rel=1e-3)


def test_after_thirty_iterations_the_cloud_is_still_on_its_way(clouds):
    result = icp.align(clouds.source, clouds.target, max_distance=0.25, max_iterations=30)
    assert not result.converged and result.iterations == 30
    assert result.rmse == pytest.approx(0.00850, abs=5e-6)
    assert result.T_target_source[:3, 3] == pytest.approx([0.4966, -0.2939, 0.2965], abs=5e-5)


def test_it_stops_moving_after_about_44(plain):
    assert 40 <= plain.iterations <= 46


def test_two_exact_searches_cannot_differ(clouds, plain):
    """The report's brute force and its tree printed two RMSEs for one transform.  The first iterations here."""
    brute = icp.align(clouds.source, clouds.target, max_distance=0.25, search="brute", max_iterations=4)
    for a, b in zip(brute.history, plain.history, strict=False):
        assert np.array_equal(a.matches, b.matches) and a.rmse == b.rmse


def test_the_published_transform_lies_on_the_way_and_not_at_its_end(clouds, plain):
    R = PUBLISHED[:3, :3]
    assert geometry.is_rotation(R, tolerance=2e-5)  # as good as six digits are
    U, _, Vt = np.linalg.svd(R)
    initial = PUBLISHED.copy()
    initial[:3, :3] = U @ Vt
    there = icp.align(clouds.source, clouds.target, max_distance=0.25, initial=initial)
    assert there.history[0].rmse == pytest.approx(0.0227, abs=5e-5)
    assert_is_the_answer(there)
    gaps = [np.linalg.norm(step.T_target_source[:3, 3] - PUBLISHED[:3, 3]) for step in plain.history]
    assert 20 <= int(np.argmin(gaps)) < 30


def test_the_reports_two_errors_are_mean_distances_there_and_back(clouds):
    """0.0202175 by brute force and 0.0220894 by tree: two questions, not two answers."""
    there = icp.move(PUBLISHED, clouds.source)
    for a, b, printed in ((there, clouds.target, 0.0202175), (clouds.target, there, 0.0220894)):
        distance = icp.KdTree(b).nearest(a, np.inf)[1]
        assert np.mean(distance) == pytest.approx(printed, abs=3e-7)
        assert np.sqrt(np.mean(distance**2)) > printed + 0.002


def test_planes_a_kernel_and_a_start_from_nothing_agree_on_the_answer(clouds):
    for options in (
        {"metric": "point_to_plane"},
        {"kernel": "tukey", "max_iterations": 100},
        {"initial": icp.find_start(clouds.source, clouds.target)},
    ):
        result = icp.align(clouds.source, clouds.target, max_distance=0.25, accelerate=True, **options)
        assert result.converged
        assert result.T_target_source[:3, 3] == pytest.approx([0.4997, -0.3, 0.3006], abs=1e-3)
