"""Sensor models: what is seen, the inverse, and what they refuse.  Their Jacobians are checked in test_models.py."""

import numpy as np
import pytest

from coursekit.models import Position, RangeBearing, RangeOnly


def _pose(rng):
    return rng.uniform([-5, -5, -np.pi], [5, 5, np.pi])


def _landmark_in_sight(rng, pose):
    distance, direction = rng.uniform(0.5, 10), rng.uniform(-np.pi, np.pi)
    return pose[:2] + distance * np.array([np.cos(direction), np.sin(direction)])


def test_bearing_residual_is_small_across_pi():
    sensor = RangeBearing([-3.0, 0.0])
    z, z_hat = sensor.h([0.0, 0.01, 0.0]), sensor.h([0.0, -0.01, 0.0])
    assert abs(z[1] - z_hat[1]) > 6
    assert abs(sensor.residual(z, z_hat)[1]) < 0.01


def test_the_inverse_measurement_undoes_the_measurement():
    rng = np.random.default_rng(6)
    for _ in range(100):
        pose = _pose(rng)
        landmark = _landmark_in_sight(rng, pose)
        np.testing.assert_allclose(RangeBearing.g(pose, RangeBearing(landmark).h(pose)), landmark, atol=1e-12)


def test_many_poses_see_what_each_would_alone():
    rng = np.random.default_rng(7)
    poses = rng.normal(0, 3, (2, 30, 3))
    for sensor in (RangeBearing([1.0, 2.0]), RangeOnly([1.0, 2.0], position=(0, 1)), Position()):
        together = sensor.h(poses)
        np.testing.assert_allclose(together[1, 4], sensor.h(poses[1, 4]), atol=1e-14)
        residuals = sensor.residual(together, sensor.h(poses[0, 0]))
        np.testing.assert_allclose(residuals[1, 4], sensor.residual(together[1, 4], sensor.h(poses[0, 0])), atol=1e-14)
        jacobians = np.broadcast_to(sensor.H(poses), (2, 30, together.shape[-1], 3))
        np.testing.assert_allclose(jacobians[1, 4], sensor.H(poses[1, 4]), atol=1e-14)
    together = RangeBearing([1.0, 2.0]).linearized(poses)
    np.testing.assert_array_equal(together[0], RangeBearing([1.0, 2.0]).h(poses))
    np.testing.assert_array_equal(together[1], RangeBearing([1.0, 2.0]).H(poses))
    z = rng.uniform([1, -3], [5, 3], (30, 2))
    np.testing.assert_allclose(RangeBearing.g(poses[0], z)[3], RangeBearing.g(poses[0, 3], z[3]), atol=1e-14)
    np.testing.assert_allclose(RangeBearing.g(poses[0, 0], z)[3], RangeBearing.g(poses[0, 0], z[3]), atol=1e-14)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: RangeBearing([1.0, 2.0, 3.0]), "landmark"),
        (lambda: RangeBearing([1.0, np.nan]), "landmark"),
        (lambda: RangeBearing([1.0, 2.0], -np.eye(2)), "R: expected a positive definite"),
        (lambda: RangeBearing([1.0, 2.0], np.eye(3)), "R: expected shape"),
        (lambda: RangeBearing([1.0, 2.0], [[1.0, 0.5], [0.0, 1.0]]), "R: expected a symmetric"),
        (lambda: RangeBearing([1.0, 2.0]).H([1.0, 2.0, 0.3]), "no derivative"),
        (lambda: RangeBearing([1.0, 2.0]).h([1.0, 2.0, 0.3]), "stands on the landmark: no bearing is defined"),
        (lambda: Position().residual([1.0], [1.0, 2.0]), r"z: expected shape \(\.\.\., 2\)"),
        (lambda: RangeOnly([1.0, 2.0]).residual([1.0, 2.0], [1.0]), r"z: expected shape \(\.\.\., 1\)"),
        (lambda: RangeBearing([1.0, 2.0]).residual([1.0], [1.0, 2.0]), "z .* expected shape"),
        (lambda: RangeBearing.g(np.zeros(3), [1.0, np.nan]), "z .* expected finite"),
        (lambda: RangeOnly([1.0, 2.0]).h(np.zeros(2)), "state: expected shape"),
        (lambda: RangeOnly([1.0, 2.0]).H([1.0, 0.0, 2.0, 0.0]), "no derivative"),
        (lambda: RangeOnly([1.0, 2.0], np.zeros((1, 1))), "R: expected a positive definite"),
        (lambda: Position(np.eye(3)), "R: expected shape"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_on_top_of_a_landmark_the_range_is_zero_and_a_cloud_is_not_lost_over_one_particle():
    assert RangeOnly([1.0, 2.0]).h([1.0, 0.0, 2.0, 0.0]) == [0.0]
    seen = RangeBearing([1.0, 2.0]).h([[1.0, 2.0, 0.3], [0.0, 2.0, 0.0]])
    np.testing.assert_allclose(seen, [[0.0, -0.3], [1.0, 0.0]])


def test_of_many_poses_one_on_top_of_the_landmark_has_no_jacobian_and_the_others_have_theirs():
    for sensor, poses in (
        (RangeBearing([1.0, 2.0]), [[1.0, 2.0, 0.3], [0.0, 2.0, 0.0]]),
        (RangeOnly([1.0, 2.0]), [[1.0, 0.0, 2.0, 0.0], [0.0, 0.0, 2.0, 0.0]]),
    ):
        H = sensor.H(poses)
        assert np.isnan(H[0]).any()
        np.testing.assert_array_equal(H[1], sensor.H(poses[1]))


def test_what_nobody_can_have_measured_has_a_reason():
    assert RangeBearing.unusable([-2.0, 0.1]) == "a range of -2 m"
    assert RangeBearing.unusable([2.0, 45.0]) == "a bearing of 45 rad"
    assert RangeOnly.unusable([0.0]) == "a range of 0 m"
    assert RangeBearing.unusable([2.0, 6.0]) == RangeOnly.unusable([1e-3]) == ""


def test_a_sensor_keeps_its_landmark_and_noise_to_itself():
    landmark, R = np.array([1.0, 2.0]), np.eye(2)
    sensor = RangeBearing(landmark, R)
    landmark[0], R[0, 0] = 9.0, 9.0
    assert sensor.landmark[0] == 1.0 and sensor.R[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        sensor.R[0, 0] = 2.0
