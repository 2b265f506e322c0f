"""Projection and its inverse: exact with the corrections, wrong by a known amount without."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder, range_bearing, range_bearing_jacobian

cameras = st.builds(
    Camera,
    fx=st.floats(200, 900),
    fy=st.floats(200, 900),
    cx=st.floats(250, 390),
    cy=st.floats(180, 300),
    width=st.just(640),
    height=st.just(480),
)
ranges, bearings = st.floats(0.7, 20.0), st.floats(-0.6, 0.6)
heights, radii, offsets = st.floats(0.1, 2.0), st.floats(0.0, 0.3), st.floats(-0.2, 0.2)


def rims(x, y, radius, height, eye, n=20_000):
    """The two rims of a cylinder as points in the camera's frame, (2, n, 3): bottom, then top."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=-1)
    return np.stack([np.c_[ring, np.full(n, -eye)], np.c_[ring, np.full(n, height - eye)]])


@given(cameras, ranges, bearings, heights, radii, offsets)
def test_range_and_bearing_undo_the_projection_exactly(camera, d, theta, h, r, offset):
    pixels = project_cylinder(d, theta, camera, h, r, offset)
    got = range_bearing(pixels.height_px, pixels.axis_px, camera, h, radius=r, camera_offset=offset)
    np.testing.assert_allclose(got, (d, theta), rtol=0, atol=1e-9)


@given(cameras, ranges, bearings, st.floats(0.3, 1.0), st.floats(0.02, 0.3), st.floats(0.05, 0.95))
@settings(max_examples=30)
def test_the_projection_is_that_of_the_cylinders_own_points(camera, d, theta, h, r, share):
    """Twenty thousand points of each rim, no formula: height and edges agree to the points' spacing."""
    pixels = project_cylinder(d, theta, camera, h, r)
    uv = camera.project(rims(d * np.cos(theta), d * np.sin(theta), r, h, eye=share * h))
    np.testing.assert_allclose(np.ptp(uv[..., 1]), pixels.height_px, rtol=1e-6)
    np.testing.assert_allclose([uv[..., 0].min(), uv[..., 0].max()], [pixels.left_px, pixels.right_px], atol=1e-3)


def test_arrays_and_scalars_give_the_same_answers():
    d, theta = np.meshgrid([0.8, 3.0, 9.0], [-0.5, 0.0, 0.4])
    pixels = project_cylinder(d, theta, COURSE_CAMERA, 0.5, 0.1, 0.07)
    got_d, got_theta = range_bearing(pixels.height_px, pixels.axis_px, COURSE_CAMERA, 0.5, 0.1, 0.07)
    assert got_d.shape == got_theta.shape == d.shape
    one = range_bearing(pixels.height_px[1, 2], pixels.axis_px[1, 2], COURSE_CAMERA, 0.5, 0.1, 0.07)
    assert np.ndim(one[0]) == np.ndim(one[1]) == 0
    assert (one[0], one[1]) == (got_d[1, 2], got_theta[1, 2])


def test_one_height_broadcasts_over_many_columns_and_radii():
    d, theta = range_bearing(50.0, [100.0, 320.0, 500.0], COURSE_CAMERA, 0.5, radius=[[0.0], [0.1]])
    assert d.shape == theta.shape == (2, 3)


def test_a_landmark_to_the_left_has_a_positive_bearing():
    assert range_bearing(50.0, 100.0, COURSE_CAMERA, 0.5)[1] > 0.3


def test_straight_ahead_and_uncorrected_the_range_is_short_by_radius_and_offset():
    pixels = project_cylinder([1.0, 4.0, 12.0], 0.0, COURSE_CAMERA, 0.5, radius=0.1, camera_offset=0.07)
    d, theta = range_bearing(pixels.height_px, pixels.axis_px, COURSE_CAMERA, 0.5)
    np.testing.assert_allclose(d - [1.0, 4.0, 12.0], -0.17, atol=1e-12)
    np.testing.assert_allclose(theta, 0.0, atol=1e-12)


@given(ranges, bearings)
def test_off_the_axis_the_missing_radius_grows_as_one_over_cosine(d, theta):
    pixels = project_cylinder(d, theta, COURSE_CAMERA, 0.5, radius=0.1)
    got, bearing = range_bearing(pixels.height_px, pixels.axis_px, COURSE_CAMERA, 0.5)
    np.testing.assert_allclose(got - d, -0.1 / np.cos(theta), atol=1e-9)
    np.testing.assert_allclose(bearing, theta, atol=1e-12)


def test_the_mean_of_the_edges_angles_is_exact_and_of_their_pixels_is_7_mrad_off():
    pixels = project_cylinder(1.0, 0.6, COURSE_CAMERA, 0.5, radius=0.1)
    edges = np.array([pixels.left_px, pixels.right_px])
    np.testing.assert_allclose(COURSE_CAMERA.bearing(edges).mean(), 0.6, atol=1e-12)
    error = COURSE_CAMERA.bearing(edges.mean()) - 0.6
    assert 0.0065 < error < 0.0075, f"{error:.5f} rad"


@given(st.floats(1.0, 15.0), heights)
def test_a_pixel_of_height_costs_the_range_squared_over_height_times_focal_length(d, h):
    camera = COURSE_CAMERA
    pixels = project_cylinder(d, 0.0, camera, h)
    J = range_bearing_jacobian(pixels.height_px, pixels.axis_px, camera, h)
    np.testing.assert_allclose(J[0, 0], -(d**2) / (h * camera.fy), rtol=1e-12)
    np.testing.assert_allclose(J[1, 1], -1 / camera.fx, rtol=1e-9)


@given(cameras, ranges, bearings, heights, radii, offsets)
def test_the_jacobian_of_range_and_bearing_is_the_slope(camera, d, theta, h, r, offset):
    pixels = project_cylinder(d, theta, camera, h, r, offset)
    at, eps = np.array([pixels.height_px, pixels.axis_px]), 1e-5 * pixels.height_px
    numerical = [
        (
            np.array(range_bearing(*(at + step), camera, h, r, offset))
            - range_bearing(*(at - step), camera, h, r, offset)
        )
        / (2 * eps)
        for step in eps * np.eye(2)
    ]
    J = range_bearing_jacobian(*at, camera, h, r, offset)
    np.testing.assert_allclose(J, np.transpose(numerical), rtol=1e-5, atol=1e-7)


def test_the_jacobian_broadcasts_with_its_matrix_last():
    assert range_bearing_jacobian([40.0, 50.0, 60.0], 300.0, COURSE_CAMERA, 0.5).shape == (3, 2, 2)


@given(cameras, st.floats(0.3, 20), st.floats(-5, 5), st.floats(-2, 2))
def test_the_jacobian_of_the_projection_is_the_slope(camera, x, y, z):
    p, eps = np.array([x, y, z]), 1e-6
    numerical = [(camera.project(p + step) - camera.project(p - step)) / (2 * eps) for step in eps * np.eye(3)]
    np.testing.assert_allclose(camera.project_jacobian(p), np.transpose(numerical), rtol=1e-5, atol=1e-3)


@given(cameras, st.floats(0.3, 20), st.floats(-5, 5), st.floats(-2, 2))
def test_unproject_undoes_project(camera, x, y, z):
    np.testing.assert_allclose(camera.unproject(camera.project([x, y, z]), x), [x, y, z], atol=1e-9)


def test_columns_and_bearings_undo_each_other_and_agree_with_project():
    angles = np.linspace(-1.5, 1.5, 31)
    u = COURSE_CAMERA.column(angles)
    np.testing.assert_allclose(COURSE_CAMERA.bearing(u), angles, atol=1e-12)
    points = np.c_[np.cos(angles), np.sin(angles), np.zeros(31)]
    np.testing.assert_allclose(COURSE_CAMERA.project(points)[:, 0], u)


def test_left_in_the_world_is_left_in_the_picture_and_up_is_up():
    u, v = COURSE_CAMERA.project([2.0, 0.5, 0.3])
    assert u < COURSE_CAMERA.cx and v < COURSE_CAMERA.cy


@pytest.mark.parametrize("height", [0.0, -3.0, np.nan, np.inf, [40.0, 0.0], [np.nan, 40.0], "tall", None])
def test_a_height_that_is_no_height_is_refused_with_its_value(height):
    with pytest.raises(ValueError, match="height_px: expected finite positive numbers, got"):
        range_bearing(height, 320.0, COURSE_CAMERA, 0.5)


def test_the_refusal_names_the_entry():
    with pytest.raises(ValueError, match=r"got -1\.0 \(entry \(2,\) of shape \(3,\)\)"):
        range_bearing([40.0, 50.0, -1.0], 320.0, COURSE_CAMERA, 0.5)


@pytest.mark.parametrize("axis", [np.nan, np.inf, [320.0, np.nan]])
def test_an_axis_that_is_not_finite_is_refused(axis):
    with pytest.raises(ValueError, match="axis_px: expected finite numbers, got"):
        range_bearing(50.0, axis, COURSE_CAMERA, 0.5)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"landmark_height": 0.0}, "landmark_height: expected finite positive"),
        ({"landmark_height": np.nan}, "landmark_height: expected finite positive"),
        ({"radius": -0.1}, "radius: expected metres ≥ 0, got -0.1"),
        ({"radius": np.nan}, "radius: expected finite"),
        ({"camera_offset": np.inf}, "camera_offset: expected finite"),
    ],
)
def test_an_impossible_landmark_is_refused(wrong, words):
    with pytest.raises(ValueError, match=words):
        range_bearing(50.0, 320.0, COURSE_CAMERA, **({"landmark_height": 0.5} | wrong))


@pytest.mark.parametrize(("d", "theta"), [(2.0, 2.0), (2.0, np.pi), (0.15, 0.0), (1.0, 1.5)])
def test_a_cylinder_that_is_not_in_front_of_the_camera_has_no_picture(d, theta):
    with pytest.raises(ValueError, match="wholly in front of the camera"):
        project_cylinder(d, theta, COURSE_CAMERA, 0.5, radius=0.1, camera_offset=0.07)


@pytest.mark.parametrize("p", [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [np.nan, 0, 0], [1.0, 2.0]])
def test_a_point_that_is_not_in_front_of_the_camera_has_no_picture(p):
    with pytest.raises(ValueError, match="p_camera"):
        COURSE_CAMERA.project(p)


def test_a_column_for_something_behind_is_refused():
    with pytest.raises(ValueError, match="in front of the camera"):
        COURSE_CAMERA.column(2.0)


@pytest.mark.parametrize(
    ("name", "value"), [("fx", 0.0), ("fy", -1.0), ("cx", np.nan), ("cy", "left"), ("width", 0), ("height", 480.5)]
)
def test_a_camera_is_checked_when_it_is_made(name, value):
    intrinsics = {"fx": 530.0, "fy": 530.0, "cx": 320.0, "cy": 240.0, "width": 640, "height": 480}
    with pytest.raises(ValueError, match=name):
        Camera(**(intrinsics | {name: value}))


def test_a_camera_is_frozen():
    with pytest.raises(AttributeError):
        COURSE_CAMERA.fx = 1.0


@pytest.mark.parametrize("pixels", [[1.0, 2.0, 3.0], [1.0], 1.0, [np.nan, 1.0]])
def test_unprojecting_asks_for_whole_pixels_u_and_v(pixels):
    with pytest.raises(ValueError, match="pixels: expected"):
        COURSE_CAMERA.unproject(pixels, 2.0)


def test_a_size_that_comes_as_a_float_becomes_a_whole_number():
    camera = Camera(53.0, 53.0, 32.0, 24.0, 64.0, np.float64(48))
    assert isinstance(camera.width, int) and isinstance(camera.height, int)
    assert camera == Camera(53.0, 53.0, 32.0, 24.0, 64, 48)


@pytest.mark.parametrize("camera", ["course", (530, 530, 319.5, 239.5), None])
def test_what_is_no_camera_is_an_error(camera):
    for call in (range_bearing, range_bearing_jacobian, project_cylinder):
        with pytest.raises(TypeError, match=r"camera: expected a pinhole\.Camera, got"):
            call(50.0, 0.0, camera, 0.5)
