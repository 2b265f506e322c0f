"""The map image's poses and the odometry's: one conversion, its own inverse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coursekit.geometry import wrap_angle
from coursekit.models import DifferentialDrive
from coursekit.visual import image_from_odometry, odometry_from_image

angle, pixel = st.floats(-np.pi, np.pi), st.floats(-5e3, 5e3)


@pytest.mark.parametrize(("yaw", "theta"), [(0, np.pi / 2), (np.pi / 2, 0), (np.pi, -np.pi / 2), (-np.pi / 2, np.pi)])
def test_north_east_south_and_west_have_their_two_names(yaw, theta):
    assert odometry_from_image([7.0, 9.0, yaw]) == pytest.approx([7.0, -9.0, theta])


@given(pixel, pixel, angle)
def test_there_and_back_is_where_it_started(u, v, yaw):
    back = image_from_odometry(odometry_from_image([u, v, yaw]))
    assert back[:2] == pytest.approx([u, v])
    assert wrap_angle(back[2] - yaw) == pytest.approx(0, abs=1e-12)


@given(pixel, pixel, angle)
def test_the_heading_points_the_same_way_in_both_frames(u, v, yaw):
    x, y, theta = odometry_from_image([u, v, yaw])
    ahead_on_image = np.array([u + np.sin(yaw), v - np.cos(yaw)])
    assert ahead_on_image == pytest.approx([x + np.cos(theta), -(y + np.sin(theta))])


def test_a_left_turn_of_the_odometry_is_anticlockwise_on_the_map():
    """Heading north at 10 px/s and turning left for a quarter turn ends up heading west, up and to the left."""
    start = odometry_from_image([500.0, 400.0, 0.0])
    u, v, yaw = image_from_odometry(DifferentialDrive().f(start, [10.0, np.pi / 2], 1.0))
    assert u < 500 and v < 400
    assert yaw == pytest.approx(-np.pi / 2)


def test_many_poses_at_once_and_nothing_but_poses():
    poses = np.arange(12.0).reshape(2, 2, 3)
    assert odometry_from_image(poses)[1, 0] == pytest.approx(odometry_from_image(poses[1, 0]))
    with pytest.raises(ValueError, match=r"pose: expected \[u, v, yaw\]"):
        odometry_from_image([1.0, 2.0])
