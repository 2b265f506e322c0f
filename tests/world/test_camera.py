"""The picture is where geometry says, to a few hundredths of a pixel, and the truth about it is the truth."""

import cv2
import numpy as np
import pytest

from coursekit.geometry import inverse, transform
from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder
from coursekit.world.arena import Crate, Cylinder, Wall
from coursekit.world.camera import PAINT, draw_quad, expose, mounted, paint, render, visibility

ORIGIN = np.zeros(3)


def ahead(d, theta, **kinds):
    return Cylinder((d * np.cos(theta), d * np.sin(theta)), **kinds)


@pytest.mark.parametrize(("d", "theta"), [(0.9, 0.0), (1.5, 0.35), (3.0, -0.5), (6.0, 0.2), (12.0, -0.4)])
def test_edges_and_rims_lie_where_the_projection_puts_them(d, theta):
    """White cylinder before black, so that the covered share of a row or column of pixels adds up to a length."""
    cylinder = ahead(d, theta, colour="cyan")
    red = paint(COURSE_CAMERA, ORIGIN, [cylinder], texture=0)[..., 2].astype(float)
    empty = paint(COURSE_CAMERA, ORIGIN, [], texture=0)[..., 2].astype(float)
    pixels = project_cylinder(d, theta, COURSE_CAMERA, 0.5, 0.1)
    (view,) = visibility(COURSE_CAMERA, ORIGIN, [cylinder])
    middle = int((view.top_px + view.bottom_px) / 2)
    inside = int(pixels.axis_px)
    # Shading changes across the cylinder but not down it: each edge is judged against the colour beside it.
    row = (empty[middle] - red[middle]) / (empty[middle, 0] - red[middle, inside])
    columns = np.arange(COURSE_CAMERA.width)
    seen = np.flatnonzero(np.abs(row) > 0.02)
    assert abs(seen[0] - pixels.left_px) < 1 and abs(seen[-1] - pixels.right_px) < 1
    assert np.all(row[columns < pixels.left_px - 1] == 0) and np.all(row[columns > pixels.right_px + 1] == 0)
    tallest = round(float(COURSE_CAMERA.cx - COURSE_CAMERA.fx * np.sin(theta) * d / (d * np.cos(theta) - 0.1)))
    column, ground = red[:, tallest], empty[:, tallest]
    covered = (ground - column) / np.where(ground == column.min(), 1, ground - column.min())
    assert covered.sum() == pytest.approx(pixels.height_px, abs=0.06)
    assert (view.left_px, view.right_px) == pytest.approx((pixels.left_px, pixels.right_px))
    assert view.height_px == pytest.approx(pixels.height_px, rel=1e-4)


@pytest.mark.parametrize("side", ["left_px", "right_px"])
def test_a_partly_covered_column_is_mixed_by_the_covered_share(side):
    for shift in np.linspace(0.0, 1.0, 11):
        camera = Camera(530, 530, 319.5 + shift, 239.5, 640, 480)
        scene = paint(camera, ORIGIN, [ahead(4.0, 0.0, colour="cyan")], texture=0)
        edge = float(getattr(project_cylinder(4.0, 0.0, camera, 0.5, 0.1), side))
        row, at, outward = scene[200, :, 2].astype(float), int(np.floor(edge + 0.5)), -1 if side == "left_px" else 1
        covered = (row[at + 2 * outward] - row[at]) / (row[at + 2 * outward] - row[at - outward])
        # The shading of the pixel further in is not quite that of this one, hence the tolerance.
        assert covered == pytest.approx(0.5 - outward * (at - edge), abs=0.06)


def test_an_eye_above_the_top_sees_the_lid_and_below_it_does_not():
    (low,) = visibility(COURSE_CAMERA, ORIGIN, [ahead(1.5, 0)], camera_height=0.2)
    (high,) = visibility(COURSE_CAMERA, ORIGIN, [ahead(1.5, 0)], camera_height=0.6)
    assert low.top_px == pytest.approx(239.5 - 530 * 0.3 / 1.4, abs=1e-3)
    assert high.top_px == pytest.approx(239.5 + 530 * 0.1 / 1.6, abs=1e-3)
    scene = paint(COURSE_CAMERA, ORIGIN, [ahead(1.5, 0, colour="red")], camera_height=0.6, texture=0)
    lid, near_rim = int(high.top_px) + 2, 239.5 + 530 * 0.1 / 1.4
    assert tuple(scene[lid, 319]) == PAINT["red"]
    assert tuple(scene[int(near_rim) + 2, 319]) != PAINT["red"]
    assert tuple(scene[int(high.top_px) - 1, 319]) not in (PAINT["red"], (0, 0, 0))


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others():
    views = [render(COURSE_CAMERA, ORIGIN, [ahead(2, 0)], rng=np.random.default_rng(s)).tobytes() for s in (1, 1, 2)]
    assert views[0] == views[1] != views[2]


def test_without_a_generator_there_is_no_noise():
    assert (
        render(COURSE_CAMERA, ORIGIN, [], noise=9.0).tobytes() == render(COURSE_CAMERA, ORIGIN, [], noise=0).tobytes()
    )


@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0])
def test_noise_has_the_stated_deviation_and_no_bias(sigma):
    """A million pixels: four standard errors of mean and deviation are well inside the tolerance."""
    grey = np.full((480, 640, 3), 128, np.uint8)
    noise = expose(grey, noise=sigma, blur=0, rng=np.random.default_rng(0)).astype(float) - 128
    assert abs(noise.mean()) < 0.02
    # Whole grey levels add 1/12 to the variance; a byte cuts the tails off at 2.9 σ.
    assert noise.std() == pytest.approx(np.sqrt(sigma**2 + 1 / 12), rel=0.03)
    assert abs(np.corrcoef(noise[:, :-1].ravel(), noise[:, 1:].ravel())[0, 1]) < 0.005


def test_light_scales_the_picture_and_blur_spreads_an_edge():
    scene = paint(COURSE_CAMERA, ORIGIN, [ahead(1.5, 0)])
    dim = expose(scene, light=0.5, blur=0)
    np.testing.assert_allclose(dim, scene * 0.5, atol=0.5)
    sharp, soft = (expose(scene, blur=blur)[200].astype(int) for blur in (0.0, 1.5))
    assert np.abs(np.diff(soft, axis=0)).max() < 0.6 * np.abs(np.diff(sharp, axis=0)).max()


def test_exposing_leaves_the_scene_as_it_was():
    scene = paint(COURSE_CAMERA, ORIGIN, [ahead(1.5, 0)])
    before = scene.copy()
    expose(scene, rng=np.random.default_rng(0))
    np.testing.assert_array_equal(scene, before)


def test_things_behind_the_camera_or_off_the_picture_leave_no_trace():
    away = [Cylinder((-2.0, 0.0)), ahead(2.0, 0.8), Cylinder((0.05, 0.0))]
    np.testing.assert_array_equal(paint(COURSE_CAMERA, ORIGIN, away), paint(COURSE_CAMERA, ORIGIN, []))
    assert visibility(COURSE_CAMERA, ORIGIN, away) == [None, None, None]


def test_near_things_hide_far_ones_in_whatever_order_they_are_given():
    near, far = ahead(1.5, 0.0, colour="red"), ahead(3.0, 0.02, colour="green")
    scene = paint(COURSE_CAMERA, ORIGIN, [near, far])
    np.testing.assert_array_equal(scene, paint(COURSE_CAMERA, ORIGIN, [far, near]))
    assert scene[230, 319, 2] > scene[230, 319, 1]
    view_near, view_far = visibility(COURSE_CAMERA, ORIGIN, [near, far])
    assert view_near.whole and view_far.hidden == 1.0


def test_the_hidden_share_is_the_share_of_pixels_that_are_gone():
    far = ahead(4.0, 0.0, colour="green")
    for theta in np.linspace(-0.1, 0.1, 9):
        near = ahead(2.0, theta, colour="red")
        alone, both = (paint(COURSE_CAMERA, ORIGIN, things, texture=0)[230] for things in ([far], [far, near]))
        green = [np.sum((row[:, 1] > 1.5 * row[:, 2]) & (row[:, 1] > 1.5 * row[:, 0])) for row in (alone, both)]
        hidden = visibility(COURSE_CAMERA, ORIGIN, [far, near])[0].hidden
        assert hidden == pytest.approx(1 - green[1] / green[0], abs=0.08)


def test_walls_and_crates_hide_what_is_behind_them_and_stand_on_the_floor():
    wall, crate = Wall((3.0, -2.0), (3.0, 2.0)), Crate((2.0, 0.0, 0.3))
    behind, before = ahead(4.0, 0.3), ahead(2.0, 0.3, colour="magenta")
    views = visibility(COURSE_CAMERA, ORIGIN, [behind, before], walls=[wall], crates=[crate])
    assert views[0].hidden == 1.0 and views[1].whole
    plain = paint(COURSE_CAMERA, ORIGIN, [], walls=[wall])
    np.testing.assert_array_equal(paint(COURSE_CAMERA, ORIGIN, [behind], walls=[wall]), plain)
    bottom = COURSE_CAMERA.cy + COURSE_CAMERA.fy * 0.2 / 3.0
    skirting = np.all(plain[:, 100].astype(int) < 105, axis=-1)
    assert np.flatnonzero(skirting).max() == pytest.approx(bottom, abs=1)


def test_a_crate_turned_by_a_quarter_swaps_its_sides():
    long, turned = Crate((2.0, 0.0, 0.0), (0.6, 0.2)), Crate((2.0, 0.0, np.pi / 2), (0.2, 0.6))
    np.testing.assert_array_equal(*(paint(COURSE_CAMERA, ORIGIN, [], crates=[c], texture=0) for c in (long, turned)))


def test_a_landmark_is_cut_off_by_the_edge_it_crosses():
    views = visibility(COURSE_CAMERA, ORIGIN, [ahead(1.5, 0.53), ahead(1.5, -0.53), ahead(0.6, 0.0)])
    assert [view.cut for view in views] == [("left",), ("right",), ("top",)]
    (below,) = visibility(COURSE_CAMERA, ORIGIN, [ahead(0.7, 0.0)], camera_height=0.35)
    assert below.cut == ("bottom",)


def test_the_floor_stays_put_when_the_camera_moves():
    """The same thousand points of the floor, seen from left and from right: their colours go together."""
    rng = np.random.default_rng(5)
    world, colours = np.c_[rng.uniform(1.0, 1.5, 1000), rng.uniform(-0.2, 0.2, 1000)], []
    for pose in np.array([[0.1, -0.5, 0.35], [0.0, 0.5, -0.35]]):
        x, y = transform(inverse(pose), world).T
        uv = COURSE_CAMERA.project(np.c_[x, y, np.full(len(x), -0.2)]).astype(np.float32)
        scene = paint(COURSE_CAMERA, pose, [], texture=2.0)[..., 1].astype(np.float32)
        colours.append(cv2.remap(scene, uv[:, :1], uv[:, 1:], cv2.INTER_LINEAR).ravel())
    assert np.corrcoef(colours)[0, 1] > 0.8


def tag_image(identity=3, quiet=1):
    tag = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), identity, 80)
    return cv2.copyMakeBorder(tag, *[quiet * 10] * 4, cv2.BORDER_CONSTANT, value=255)


def upright_square(x, y, z, side, yaw):
    """Corners of a square that looks to ``yaw``, in the order of its picture's corners."""
    left = 0.5 * side * np.array([np.sin(yaw), -np.cos(yaw), 0.0])  # of someone who looks at it
    up = np.array([0.0, 0.0, 0.5 * side])
    centre = np.array([x, y, z])
    return np.array([centre + left + up, centre - left + up, centre - left - up, centre + left - up])


@pytest.mark.parametrize(("d", "bearing", "tilt"), [(1.0, 0.0, 0.0), (2.0, 0.3, 0.5), (3.0, -0.4, -0.6)])
def test_a_tag_drawn_as_a_quad_is_read_back_where_it_was_drawn(d, bearing, tilt):
    side = 0.16 * d  # of the black border; around it runs a quiet zone of one of its eight modules
    at = np.array([d * np.cos(bearing), d * np.sin(bearing), 0.25])
    yaw = bearing + np.pi + tilt
    quad = upright_square(*at, side * 10 / 8, yaw)
    image = render(COURSE_CAMERA, ORIGIN, [], quads=[(quad, tag_image())], rng=np.random.default_rng(0))
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    corners, ids, _ = cv2.aruco.ArucoDetector(family, parameters).detectMarkers(image)
    assert ids.ravel().tolist() == [3]
    expected = COURSE_CAMERA.project(upright_square(*at, side, yaw) - [0, 0, 0.2])
    np.testing.assert_allclose(corners[0].reshape(4, 2), expected, atol=0.4)


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5, 0.8])
def test_a_quads_pixels_are_mixed_by_the_covered_share(shift):
    camera = Camera(530, 530, 319.5 + shift, 239.5 - shift, 640, 480)
    quad, image = upright_square(4.0, 0.2, 0.3, 0.2, np.pi + 0.3), np.zeros((480, 640, 3), np.uint8)
    assert draw_quad(image, camera, ORIGIN, quad, np.full((8, 8), 255, np.uint8))
    moments = cv2.moments(image[..., 0].astype(np.float32) / 255)
    exact = cv2.moments(camera.project(quad - [0, 0, 0.2]).astype(np.float32))
    assert moments["m00"] == pytest.approx(exact["m00"], rel=0.01)
    for first in ("m10", "m01"):
        assert moments[first] / moments["m00"] == pytest.approx(exact[first] / exact["m00"], abs=0.05)


@pytest.mark.parametrize("where", [(2, 0, 0.0), (-2, 0, np.pi), (2, 9, np.pi)])
def test_a_quad_seen_from_behind_or_out_of_sight_is_not_drawn(where):
    x, y, yaw = where
    empty = paint(COURSE_CAMERA, ORIGIN, [])
    image = empty.copy()
    assert not draw_quad(image, COURSE_CAMERA, ORIGIN, upright_square(x, y, 0.3, 0.2, yaw), tag_image())
    np.testing.assert_array_equal(image, empty)


def test_a_quad_may_be_smaller_than_a_pixel():
    image = np.zeros((480, 640, 3), np.uint8)
    assert draw_quad(image, COURSE_CAMERA, ORIGIN, upright_square(20, 0.3, 0.3, 0.005, np.pi), tag_image())
    assert 0 < image[..., 0].sum() < 255


def test_a_cylinder_in_front_hides_a_quad():
    quad = (upright_square(3, 0, 0.25, 0.15, np.pi), tag_image())
    hidden = paint(COURSE_CAMERA, ORIGIN, [ahead(1.0, 0.0)], quads=[quad])
    np.testing.assert_array_equal(hidden, paint(COURSE_CAMERA, ORIGIN, [ahead(1.0, 0.0)]))


def test_the_robot_carries_the_camera_ahead_of_its_centre():
    np.testing.assert_allclose(mounted([1.0, 2.0, np.pi / 2], 0.07), [1.0, 2.07, np.pi / 2])


@pytest.mark.parametrize("pose", [[0.0, 0.0], [0.0, 0.0, np.nan], np.zeros((1, 3))])
def test_a_pose_that_is_none_is_refused(pose):
    with pytest.raises(ValueError, match="T_world_camera: expected three finite numbers"):
        render(COURSE_CAMERA, pose, [])


@pytest.mark.parametrize(
    "wrong", [{"light": 0}, {"noise": -1}, {"blur": np.nan}, {"camera_height": 0}, {"texture": -1}]
)
def test_an_impossible_setting_is_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        render(COURSE_CAMERA, ORIGIN, [], **wrong)


def test_a_setting_that_is_no_number_is_refused_by_name():
    with pytest.raises(TypeError, match="blur: expected real numbers"):
        render(COURSE_CAMERA, ORIGIN, [], blur="soft")


def test_a_colour_without_paint_is_refused():
    with pytest.raises(ValueError, match="expected one of red, green"):
        render(COURSE_CAMERA, ORIGIN, [ahead(2, 0, colour="mauve")])


def test_a_quad_without_four_points_is_refused():
    with pytest.raises(ValueError, match="four finite points"):
        draw_quad(paint(COURSE_CAMERA, ORIGIN, []), COURSE_CAMERA, ORIGIN, np.zeros((3, 3)), tag_image())
