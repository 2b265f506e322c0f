import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.icp.odometry import thin
from coursekit.models import pose_residual
from coursekit.scenes import lab06_odometry as scene

PLANES = {"metric": "point_to_plane", "kernel": "cauchy"}


@pytest.fixture(scope="module")
def lap():
    return scene.lap(6)


@pytest.fixture(scope="module")
def track(lap):
    return icp.scan_to_scan(lap.scans, start=lap.truth[0], **PLANES)


def test_a_lap_is_followed_by_its_scans_alone(lap, track):
    """No wheels: 13 m and 170 scans, within centimetres at the end."""
    rms, end, turn = scene.off(track.poses, lap.truth)
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
    assert scene.off(track.poses, lap.truth[:90])[0] < 0.005
    first = thin(lap.scans[0], 0.05)
    assert 1.5 * len(first) < len(track.cloud) < 2000  # the map grows behind the crates, and then stops


def test_points_instead_of_planes_drift_and_closing_the_loop_takes_most_of_it_back(lap):
    track = icp.scan_to_scan(lap.scans, start=lap.truth[0])
    rms, end, _ = scene.off(track.poses, lap.truth)
    assert rms > 0.05
    seen_again = icp.align(
        lap.scans[-1], lap.scans[0], max_distance=1.0, **PLANES,
        initial=geometry.homogeneous(geometry.between(track.poses[0], track.poses[-1])),
    )  # fmt: skip
    assert seen_again.converged
    edges = [*scene.chain(track), icp.Edge(0, len(lap.scans) - 1, seen_again.pose, seen_again.covariance)]
    closed = scene.off(icp.relax(track.poses, edges), lap.truth)
    assert closed[0] < 0.6 * rms and closed[1] < 0.1 * end


def test_wheels_may_give_the_guess(lap):
    motions = geometry.between(lap.wheels[:-1], lap.wheels[1:])[:40]
    guessed = icp.scan_to_scan(lap.scans[:41], motions=motions, start=lap.truth[0], **PLANES)
    assert scene.off(guessed.poses, lap.truth[:41])[0] < 0.01
    with pytest.raises(ValueError, match=r"motions: expected finite poses of shape \(40, 3\), got \(39, 3\)"):
        icp.scan_to_map(lap.scans[:41], motions=motions[:-1])
    with pytest.raises(ValueError, match="at least one"):
        icp.scan_to_scan([])


def test_thinning_keeps_the_first_point_of_each_cell_in_order():
    cloud = np.array([[0.01, 0.01], [0.2, 0.0], [0.02, 0.02], [-0.01, 0.0], [0.2, 0.01]])
    assert thin(cloud, 0.1).tolist() == [[0.01, 0.01], [0.2, 0.0], [-0.01, 0.0]]
