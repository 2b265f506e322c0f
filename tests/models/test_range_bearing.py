"""Range and bearing: one pose or many, one landmark or a map, the same numbers."""

import numpy as np
import pytest

from coursekit.models import RangeBearing
from coursekit.models.range_bearing import Gx, Gz, H, H_landmark, g, h, residual

rng = np.random.default_rng(17)
POSES = rng.uniform([-3, -3, -np.pi], [3, 3, np.pi], (40, 3))
LANDMARKS = rng.uniform(-3, 3, (7, 2))
Z = rng.uniform([0.3, -np.pi], [5, np.pi], (7, 2))


@pytest.mark.parametrize(("function", "second"), [(h, LANDMARKS), (H, LANDMARKS), (H_landmark, LANDMARKS),
                                                  (g, Z), (Gx, Z), (Gz, Z)])  # fmt: skip
def test_a_map_and_a_batch_of_poses_give_what_each_pair_gives_alone(function, second):
    alone = np.array([[function(pose, one) for one in second] for pose in POSES])
    np.testing.assert_allclose(function(POSES[:, None], second), alone, atol=1e-14)
    np.testing.assert_allclose(function(POSES[0], second), alone[0], atol=1e-14)
    np.testing.assert_allclose(function(POSES, second[0]), alone[:, 0], atol=1e-14)


@pytest.mark.parametrize(
    ("function", "second", "by_pose", "by_second", "wrap"),
    [(h, LANDMARKS[0], H, H_landmark, residual), (g, Z[0], Gx, Gz, np.subtract)],
    ids=["h", "g"],
)
def test_each_jacobian_is_the_derivative(function, second, by_pose, by_second, wrap):
    for pose in POSES:
        for jacobian, at in ((by_pose, 0), (by_second, 1)):
            columns = []
            for step in 1e-6 * np.eye((3, 2)[at]):
                ahead, behind = ((pose + step, second), (pose - step, second)) if at == 0 else (
                    (pose, second + step), (pose, second - step))  # fmt: skip
                columns.append(wrap(function(*ahead), function(*behind)) / 2e-6)
            np.testing.assert_allclose(jacobian(pose, second), np.stack(columns, axis=-1), atol=1e-6)


def test_the_inverse_undoes_the_measurement_for_every_pair():
    z = h(POSES[:, None], LANDMARKS)
    np.testing.assert_allclose(g(POSES[:, None], z), np.broadcast_to(LANDMARKS, (40, 7, 2)), atol=1e-12)


def test_the_sensor_is_the_same_model():
    for landmark in LANDMARKS:
        sensor = RangeBearing(landmark)
        np.testing.assert_array_equal(sensor.h(POSES[0]), h(POSES[0], landmark))
        np.testing.assert_array_equal(sensor.H(POSES[0]), H(POSES[0], landmark))
        np.testing.assert_array_equal(sensor.H_landmark(POSES[0]), H_landmark(POSES[0], landmark))


def test_the_residual_of_a_bearing_goes_the_short_way_round():
    np.testing.assert_allclose(residual([2.0, 3.1], [1.0, -3.1]), [1.0, 6.2 - 2 * np.pi])


def test_one_landmark_underfoot_spoils_no_other():
    pose = np.array([1.0, 2.0, 0.5])
    landmarks = np.array([[1.0, 2.0], [3.0, 2.0]])
    np.testing.assert_allclose(h(pose, landmarks), [[0.0, -0.5], [2.0, -0.5]])
    for jacobian in (H, H_landmark):
        assert np.isnan(jacobian(pose, landmarks)[0]).any() and np.isfinite(jacobian(pose, landmarks)[1]).all()
        with pytest.raises(ValueError, match="stands on the landmark"):
            jacobian(pose, landmarks[0])
    with pytest.raises(ValueError, match="stands on the landmark"):
        h(pose, landmarks[0])


@pytest.mark.parametrize("function", [h, H, H_landmark, g, Gx, Gz])
@pytest.mark.parametrize(
    ("pose", "second", "error", "message"),
    [
        (np.zeros(2), np.ones(2), ValueError, r"state: expected shape \(\.\.\., 3\), got \(2,\)"),
        (np.zeros(3), np.ones(3), ValueError, r"expected shape \(\.\.\., 2\), got \(3,\)"),
        (np.zeros(3), [np.nan, 1.0], ValueError, "finite"),
        ("pose", np.ones(2), TypeError, "state"),
        (np.zeros(3), None, TypeError, "landmark|z "),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(function, pose, second, error, message):
    with pytest.raises(error, match=message):
        function(pose, second)
