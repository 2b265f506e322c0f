import itertools

import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.icp import voxel_downsample
from coursekit.labs.lab06 import runs
from coursekit.models import pose_residual
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar

PLANES = {"metric": "point_to_plane", "kernel": "cauchy"}


@pytest.fixture(scope="module")
def lap():
    return runs.lap(6)


@pytest.fixture(scope="module")
def track(lap):
    return icp.scan_to_scan(lap.scans, start=lap.truth[0], **PLANES)


def test_a_lap_is_followed_by_its_scans_alone(lap, track):
    """No wheels: 13 m and 170 scans, within centimetres at the end."""
    rms, end, turn = runs.off(track.poses, lap.truth)
    assert rms < 0.02 and end < 0.04 and abs(turn) < 1.0
    assert len(track.poses) == len(lap.scans) and len(track.steps) == len(lap.scans) - 1
    assert len(track.cloud) == sum(map(len, lap.scans))


def test_each_step_of_the_lap_knows_its_error(lap, track):
    """Average NEES over 173 steps, three degrees of freedom.  They share scans, and corners bend the normals: within a
    factor of 1.6 of 3, where the band of independent steps would be 2.6 to 3.4."""
    truth = geometry.between(lap.truth[:-1], lap.truth[1:])
    errors = [pose_residual(step.pose, t) for step, t in zip(track.steps, truth, strict=True)]
    nees = [e @ np.linalg.solve(step.covariance, e) for e, step in zip(errors, track.steps, strict=True)]
    assert 3 / 1.6 < np.mean(nees) < 3 * 1.6


def test_laid_on_the_map_the_robot_does_not_drift(lap):
    track = icp.scan_to_map(lap.scans[:90], start=lap.truth[0], **PLANES)
    assert runs.off(track.poses, lap.truth[:90])[0] < 0.005
    first = voxel_downsample(lap.scans[0], 0.05)
    assert 1.5 * len(first) < len(track.cloud) < 2000  # the map grows behind the crates, and then stops


def test_points_instead_of_planes_drift_and_closing_the_loop_takes_most_of_it_back(lap):
    track = icp.scan_to_scan(lap.scans, start=lap.truth[0])
    rms, end, _ = runs.off(track.poses, lap.truth)
    assert rms > 0.05
    seen_again = icp.align(
        lap.scans[-1], lap.scans[0], max_distance=1.0, **PLANES,
        initial=geometry.homogeneous(geometry.between(track.poses[0], track.poses[-1])),
    )  # fmt: skip
    assert seen_again.converged
    edges = [*runs.chain(track), icp.Edge(0, len(lap.scans) - 1, seen_again.pose, seen_again.covariance)]
    closed = runs.off(icp.optimize_pose_graph(track.poses, edges), lap.truth)
    assert closed[0] < 0.6 * rms and closed[1] < 0.1 * end


def test_wheels_may_give_the_guess(lap):
    motions = geometry.between(lap.wheels[:-1], lap.wheels[1:])[:40]
    guessed = icp.scan_to_scan(lap.scans[:41], motions=motions, start=lap.truth[0], **PLANES)
    assert runs.off(guessed.poses, lap.truth[:41])[0] < 0.01
    with pytest.raises(ValueError, match=r"motions: expected finite poses of shape \(40, 3\), got \(39, 3\)"):
        icp.scan_to_map(lap.scans[:41], motions=motions[:-1])
    with pytest.raises(ValueError, match="at least one"):
        icp.scan_to_scan([])


def test_thinning_keeps_the_first_point_of_each_cell_in_order():
    cloud = np.array([[0.01, 0.01], [0.2, 0.0], [0.02, 0.02], [-0.01, 0.0], [0.2, 0.01]])
    assert voxel_downsample(cloud, 0.1).tolist() == [[0.01, 0.01], [0.2, 0.0], [-0.01, 0.0]]
    cube = np.array([[0.0, 0, 0], [0.01, 0.01, 0.2], [0.05, 0.05, 0.05]])
    assert len(voxel_downsample(cube, 0.1)) == 2
    for cell in (0.0, np.nan, -1.0):
        with pytest.raises(ValueError, match="cell: expected a length > 0 m"):
            voxel_downsample(cube, cell)


@pytest.mark.parametrize(
    ("step", "entered"),
    [
        pytest.param([0.2, 0, 0], [0, 2, 4], id="further than 0.3 m: every second step of 0.2 m"),
        pytest.param([0, 0, 0.2], [0, 3], id="further than 0.5 rad: every third turn of 0.2 rad"),
    ],
)
def test_a_scan_enters_the_map_when_the_robot_has_gone_or_turned_far_enough(step, entered):
    """Each scan sees the same room, and one post that no other scan sees: the map holds the posts of its own scans."""
    walls = np.random.default_rng(0).uniform(-3, 3, (200, 2))
    posts = np.array([[20.0 + 3 * k, 20.0] for k in range(5)])
    poses = np.arange(5)[:, None] * np.array(step, dtype=float)
    scans = [geometry.transform(geometry.inverse(pose), np.vstack([walls, post])) for pose, post in zip(poses, posts)]
    motions = np.array([geometry.between(a, b) for a, b in itertools.pairwise(poses)])
    track = icp.scan_to_map(scans, motions=motions, spacing=0.3)
    assert track.poses == pytest.approx(poses, abs=1e-6)
    held = [k for k, post in enumerate(posts) if np.hypot(*(track.cloud - post).T).min() < 0.01]
    assert held == entered


def test_the_poses_of_a_track_on_the_map_are_as_good_as_they_say_and_not_much_better(lap):
    """The map's error counts: without it the NEES would be far above 3.  It is taken for one error of each scan that
    made the map, although these average out: so the poses are a little better than they say."""
    track = icp.scan_to_map(lap.scans, start=lap.truth[0], **PLANES)
    errors = pose_residual(lap.truth, track.poses)[1:]
    nees = np.sum(errors * np.linalg.solve(track.covariances[1:], errors[..., None])[..., 0], axis=-1)
    assert 0.7 < np.mean(nees) < 3.6 and np.mean(nees < 7.81) > 0.95
    assert np.all(track.covariances[0] == 0)
    steps = np.array([step.covariance for step in track.steps])
    alone = np.sum(errors * np.linalg.solve(steps, errors[..., None])[..., 0], axis=-1)
    assert np.mean(alone) > 1.5 * np.mean(nees)


def test_a_composed_covariance_is_that_of_composed_errors(lap, track):
    """By sampling: steps drawn from their own covariances, composed."""
    rng, k = np.random.default_rng(0), 40
    ends = np.tile(lap.truth[0], (4000, 1))
    for step in track.steps[:k]:
        noise = rng.multivariate_normal(np.zeros(3), step.covariance, 4000)
        ends = geometry.compose(ends, step.pose + noise)
    seen = np.cov(pose_residual(ends, track.poses[k]).T)
    assert np.sqrt(np.diag(track.covariances[k])) == pytest.approx(np.sqrt(np.diag(seen)), rel=0.06)


@pytest.mark.slow
def test_fast_turns_without_a_guess_are_found_from_turned_starts_or_said_to_be_lost():
    """Robots that turn by up to two radians between scans: without second tries a third of the steps are lost."""
    arena, lidar, rng = Arena.load("lab"), Lidar(), np.random.default_rng(5)
    lost, said, plain = [], [], []
    for _ in range(20):
        here = rng.uniform([-2.0, -0.8, -np.pi], [2.0, 0.8, np.pi])
        moved = np.array([*rng.normal(0, 0.1, 2), rng.uniform(0.8, 2.0) * rng.choice([-1, 1])])
        scans = [lidar.scan(arena, rng, pose).points() for pose in (here, geometry.compose(here, moved))]
        step = icp.scan_to_scan(scans, **PLANES).steps[0]
        off = [np.abs(pose_residual(moved, pose)).max() > 0.1
               for pose in (step.pose, icp.align(scans[1], scans[0], max_distance=0.5, **PLANES).pose)]  # fmt: skip
        lost.append(off[0])
        plain.append(off[1])
        said.append("lost: starts turned by up to 180" in step.reason)
    assert np.sum(plain) >= 8 and np.sum(lost) < 0.5 * np.sum(plain)
    assert not np.any(np.array(said) & ~np.array(lost))


def test_a_lost_scan_says_so_and_does_not_enter_the_map(lap):
    """A scan of another place: nothing fits, its pose stays at the guess, and the next scan is found again."""
    strange = np.random.default_rng(1).uniform(-3, 3, (300, 2))
    scans = [*lap.scans[:30:3], strange, lap.scans[30], lap.scans[33]]
    track = icp.scan_to_map(scans, start=lap.truth[0], spacing=0.05, **PLANES)
    step = track.steps[9]
    assert not step.converged and "lost" in step.reason
    assert np.hypot(*(track.poses[-1] - lap.truth[33])[:2]) < 0.02
    reach = np.sqrt(
        np.min(np.sum((geometry.transform(track.poses[10], strange)[:, None] - track.cloud) ** 2, -1), axis=1)
    )
    assert np.median(reach) > 0.05


def test_rows_of_a_thinned_cloud_are_the_rows_of_its_points():
    cloud = np.random.default_rng(2).uniform(-1, 1, (500, 3))
    rows = icp.voxel_rows(cloud, 0.4)
    assert np.array_equal(cloud[rows], voxel_downsample(cloud, 0.4)) and len(rows) < 6**3
    with pytest.raises(ValueError, match="cell: expected a length > 0 m"):
        icp.voxel_rows(cloud, 0.0)
