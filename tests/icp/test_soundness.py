"""A result that knows when it is none: clouds that have no motion between them, and clouds that have one."""

import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar
from tests.icp.clouds import bumps, problem, room

CLOUDS = {
    "a room": lambda rng: room(400, rng),
    "a bent surface": lambda rng: bumps(1000, rng),
    "scattered points in the plane": lambda rng: rng.uniform(-1, 1, (300, 2)),
    "scattered points in space": lambda rng: rng.uniform(-1, 1, (300, 3)),
    "a ball of points": lambda rng: rng.normal(size=(1000, 3)),
}
OTHERS = {
    "its double": lambda P, rng: 2 * P,
    "its half": lambda P, rng: 0.5 * P,
    "a fifth larger": lambda P, rng: 1.2 * P,
    "its mirror image": lambda P, rng: P * [*[1.0] * (P.shape[1] - 1), -1.0],
    "an unrelated cloud": lambda P, rng: rng.uniform(P.min(axis=0), P.max(axis=0), P.shape),
}
OPTIONS = [{}, {"metric": "point_to_plane"}, {"trim": 0.7}, {"kernel": "tukey"}, {"accelerate": True}]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("name", CLOUDS)
def test_clouds_without_a_motion_between_them_are_not_converged_and_not_sure(name, other, options):
    for seed in range(2):
        rng = np.random.default_rng([seed, len(name)])
        P = CLOUDS[name](rng)
        result = icp.align(P, OTHERS[other](P, rng), **options)
        assert not result.converged
        assert "do not fit each other" in result.reason or "chance does" in result.reason or "stopped" in result.reason
        size = np.sqrt(np.mean(np.sum((P - P.mean(axis=0)) ** 2, axis=1)))
        assert np.sqrt(np.diag(result.covariance))[: P.shape[1]].min() >= size


SOUND = [
    pytest.param({"overlap": 0.7}, {"trim": 0.6}, id="partial overlap, trimmed"),
    pytest.param({"outliers": 0.25}, {"trim": 0.75}, id="outliers, trimmed"),
    pytest.param({"outliers": 0.25}, {"kernel": "tukey"}, id="outliers, kernel"),
    pytest.param({"density": 0.25}, {}, id="sparse target"),
    pytest.param({"density": 4.0}, {}, id="dense target"),
    pytest.param({"noise": 0.0}, {}, id="no noise"),
    pytest.param({"noise": 0.03}, {}, id="noise, as large as the spacing"),
    pytest.param({"noise": 0.06}, {}, id="noise, larger than the spacing"),
]


@pytest.mark.parametrize(("case", "options"), SOUND)
@pytest.mark.parametrize("shape", [room, bumps])
@pytest.mark.parametrize("metric", ["point_to_point", "point_to_plane"])
def test_clouds_of_one_shape_stay_beyond_doubt(shape, case, options, metric):
    for seed in range(4):
        p = problem(shape, 600 if shape is room else 1200, np.random.default_rng([seed, 5]), **case)
        result = icp.align(p.source, p.target, metric=metric, max_iterations=200, **options)
        assert result.converged, result.reason


@pytest.mark.parametrize("noisy", ["source", "target"])
def test_one_cloud_may_be_noisier_than_the_other(noisy):
    """A lidar's scan against a drawing: the drawing has no noise, and the scan's is larger than both spacings."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        p = problem(room, 800, rng, noise=0.0)
        clouds = {"source": p.source, "target": p.target}
        clouds[noisy] = clouds[noisy] + rng.normal(0, 0.06, clouds[noisy].shape)
        result = icp.align(**clouds, metric="point_to_plane", max_iterations=200)
        assert result.converged and p.error(result.T_target_source) < 0.02


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("d", [2, 3])
def test_landmarks_seen_twice_stay_beyond_doubt_up_to_a_third_of_their_spacing(noise, d):
    for n in (12, 60, 300 if d == 3 else 60):
        rng = np.random.default_rng([n, d])
        target = rng.uniform(-1, 1, (n, d))
        result = icp.align(target + rng.normal(0, noise, target.shape), target)
        assert result.converged, result.reason


@pytest.mark.parametrize("seeds", [range(40)])
def test_scans_that_end_in_the_wrong_basin_are_found_out_and_others_are_not(seeds):
    """Turns of a radian in the lab, without a guess: two in three of the lost say so, and hardly any found one does."""
    arena, lidar, judged = Arena.load("lab"), Lidar(), []
    for seed in seeds:
        rng = np.random.default_rng([seed, 77])
        here, moved = rng.uniform([-2.5, -1, -np.pi], [2.5, 1, np.pi]), rng.normal(0, [0.4, 0.4, 1.2])
        source, target = (lidar.scan(arena, rng, pose).points() for pose in (geometry.compose(here, moved), here))
        result = icp.align(source, target, metric="point_to_plane", kernel="cauchy", max_iterations=100)
        lost = np.hypot(*(result.pose - moved)[:2]) > 0.1
        judged.append([lost, result.converged])
    lost, converged = np.array(judged).T
    assert lost.sum() >= 4 and converged[~lost].mean() > 0.95
    assert converged[lost].mean() <= 0.5
