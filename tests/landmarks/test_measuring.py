"""From pixels to height and axis: how well, over four hundred views or (slow) two thousand, and what is refused."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from coursekit.geometry import transform
from coursekit.landmarks import COLOURS, LandmarkPixels, find_corners, measure
from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder
from coursekit.results import Rejected
from coursekit.world.arena import Arena, Crate, Cylinder
from coursekit.world.camera import PAINT, View, mounted, paint, render, visibility

WIDE_CAMERA = Camera(fx=400, fy=400, cx=319.5, cy=239.5, width=640, height=480)  # sees 0.67 rad to either side


@dataclass
class Seen:
    """A rendered view of a landmark: the truth (None if it is not in the picture) and what was measured.

    gap : pixels between it and its nearest neighbour in the picture, negative when they overlap.
    """

    truth: View | None
    hidden_px: float
    gap: float
    got: LandmarkPixels | Rejected


def random_view(rng, camera, others):
    """A landmark 0.7 to 12 m away within ±0.6 rad, any colour, light, noise and blur, perhaps with others near."""
    pose = np.array([*rng.uniform(-5, 5, 2), rng.uniform(-np.pi, np.pi)])
    d, theta = rng.uniform(0.7, 12.0), rng.uniform(-0.6, 0.6)
    where = [(d, theta)]
    for _ in range(others):
        near = d * rng.uniform(0.35, 1.3), theta + rng.uniform(-0.12, 0.12)
        apart = np.hypot(near[0] - d, d * (near[1] - theta))
        if apart > 0.25 and near[0] > 0.5:
            where.append(near)
    points = transform(pose, np.array([[r * np.cos(b), r * np.sin(b)] for r, b in where]))
    names = rng.permutation(list(PAINT))
    cylinders = [Cylinder(tuple(p), colour=str(name)) for p, name in zip(points, names, strict=False)]
    image = render(
        camera, pose, cylinders, rng=rng,
        light=rng.uniform(0.3, 1.2), noise=rng.uniform(0, 5), blur=rng.uniform(0.3, 1.0),
    )  # fmt: skip
    truth, *neighbours = visibility(camera, pose, cylinders)
    got = measure(find_corners(image, cylinders[0].colour), camera)
    if truth is None:
        return Seen(None, 0.0, np.inf, got)
    gaps = [max(n.left_px - truth.right_px, truth.left_px - n.right_px) for n in neighbours if n]
    return Seen(truth, truth.hidden * (truth.right_px - truth.left_px), min(gaps, default=np.inf), got)


# In one worker, so that the views are drawn once.
one_drawing = pytest.mark.xdist_group("landmark views")


@pytest.fixture(scope="module", params=[pytest.param(400), pytest.param(2000, marks=pytest.mark.slow)])
def views(request):
    rng = np.random.default_rng(20)
    return [random_view(rng, COURSE_CAMERA, others=int(rng.integers(0, 3))) for _ in range(request.param)]


def room(view):
    """Pixels between a landmark and the picture's nearest edge."""
    return min(view.left_px, 639 - view.right_px, view.top_px, 479 - view.bottom_px)


def errors(views):
    """Height and axis errors in pixels of the measured ones among the whole landmarks, (n, 2)."""
    return np.array(
        [
            [seen.got.height_px - seen.truth.height_px, seen.got.axis_px - seen.truth.axis_px]
            for seen in views
            if seen.got and seen.truth and seen.truth.whole
        ]
    )


@one_drawing
def test_the_median_height_is_right_to_a_pixel_and_the_median_axis_to_half(views):
    """The claim of Lab 1, and what this measurement really does: twenty times better."""
    error = np.abs(errors(views))
    assert len(error) > 0.5 * len(views)
    height, axis = np.median(error, axis=0)
    assert height <= 1.0 and axis <= 0.5
    assert height <= 0.1 and axis <= 0.1
    assert np.all(np.percentile(error, 99, axis=0) <= 0.75)


@one_drawing
def test_the_errors_have_no_bias(views):
    """A bias of a tenth of a pixel at 12 m would be 5 cm of range."""
    assert np.all(np.abs(errors(views).mean(axis=0)) < 0.05)


@one_drawing
def test_every_cut_off_landmark_is_rejected_with_the_edge_that_cuts_it(views):
    cut = [seen for seen in views if seen.truth and seen.truth.cut]
    assert len(cut) > 0.04 * len(views)
    for seen in cut:
        assert not seen.got, f"{seen}"
        if seen.got.reason.startswith("cut off"):
            assert set(seen.truth.cut) & set(seen.got.reason.replace("'s", "").split()), f"{seen}"
        else:  # a sliver, or hidden on top of it
            assert seen.got.reason.startswith(("no corners", "too small")) or seen.truth.hidden, f"{seen}"


@one_drawing
def test_every_occluded_landmark_is_rejected_as_such(views):
    """Occluded: half a pixel of its width or more is hidden."""
    hidden = [seen for seen in views if seen.truth and not seen.truth.cut and seen.hidden_px > 0.5]
    assert len(hidden) > 0.125 * len(views)
    for seen in hidden:
        assert not seen.got, f"{seen}"
        reasons = ("occluded", "no corners", "too small", "lopsided") + ("cut off",) * (room(seen.truth) < 3.5)
        assert seen.got.reason.startswith(reasons), f"{seen}"
    partly = [seen for seen in hidden if seen.truth.hidden < 0.8]
    assert np.mean([seen.got.reason.startswith("occluded") for seen in partly]) > 0.95


@one_drawing
def test_a_landmark_that_is_not_in_the_picture_has_no_corners(views):
    gone = [seen for seen in views if seen.truth is None]
    assert len(gone) > 0.025 * len(views)
    for seen in gone:
        assert seen.got == Rejected("no corners: too little of the landmark's colour in the picture for an outline")


@one_drawing
def test_whole_landmarks_are_rejected_only_at_the_edge_or_where_they_touch_another(views):
    """Of those that stand clear, about one in a hundred: it ends within three pixels of the picture's edge."""
    whole = [seen for seen in views if seen.truth and seen.truth.whole]
    clear = [seen for seen in whole if seen.gap > 4]
    rejected = [seen for seen in clear if not seen.got]
    assert len(clear) > 0.5 * len(views) and len(rejected) / len(clear) < 0.02
    for seen in rejected:
        assert room(seen.truth) < 3.5, f"{seen}"
    assert np.mean([not seen.got for seen in whole]) < 0.06


def test_a_wider_camera_measures_out_to_bearings_of_six_tenths():
    """The course's camera ends at 0.54 rad; this one does not, and every landmark beyond 1.5 m is whole."""
    rng = np.random.default_rng(21)
    views = [random_view(rng, WIDE_CAMERA, others=0) for _ in range(150)]
    whole = [seen for seen in views if seen.truth and seen.truth.whole]
    assert len(whole) > 135
    assert np.mean([bool(seen.got) for seen in whole]) > 0.97
    assert np.all(np.median(np.abs(errors(views)), axis=0) <= 0.1)


def test_among_crates_a_known_aspect_leaves_no_false_measurement():
    """Pushed crates hide landmarks in the lab; width over height tells, whatever colour hides the rest."""
    rng, lab, hidden, whole = np.random.default_rng(22), Arena.load("lab"), 0, []
    for _ in range(70):
        pose = np.array([*rng.uniform(-2.5, 2.5, 2), rng.uniform(-np.pi, np.pi)])
        crates = [Crate((*rng.uniform(-2.7, 2.7, 2), rng.uniform(-np.pi, np.pi))) for _ in range(6)]
        if min(np.hypot(*(np.array(crate.pose[:2]) - pose[:2])) for crate in crates) < 0.6:
            continue
        image = render(COURSE_CAMERA, pose, lab.cylinders, walls=lab.walls, crates=crates, rng=rng)
        views = visibility(COURSE_CAMERA, pose, lab.cylinders, walls=lab.walls, crates=crates)
        for cylinder, truth in zip(lab.cylinders, views, strict=True):
            got = measure(find_corners(image, cylinder.colour), COURSE_CAMERA, aspect=0.4)
            if truth is None:
                assert not got
            elif truth.whole:
                whole.append(bool(got))
            elif not truth.cut and truth.hidden * (truth.right_px - truth.left_px) > 1:
                assert not got or abs(got.axis_px - truth.axis_px) < 1.5, f"{got} {truth}"
                hidden += 1
    assert hidden > 8 and np.mean(whole) > 0.9


@pytest.mark.parametrize("colour", list(COLOURS))
def test_corners_run_around_the_outline_of_each_colour(colour):
    cylinder = Cylinder((1.5, 0.2), colour=colour)
    corners = find_corners(render(COURSE_CAMERA, [0, 0, 0], [cylinder], rng=np.random.default_rng(0)), colour)
    (view,) = visibility(COURSE_CAMERA, [0, 0, 0], [cylinder])
    np.testing.assert_allclose(corners.min(axis=0), [view.left_px, view.top_px], atol=0.2)
    np.testing.assert_allclose(corners.max(axis=0), [view.right_px, view.bottom_px], atol=0.2)
    (u, v), (next_u, next_v) = corners.T, np.roll(corners, -1, axis=0).T
    area = 0.5 * np.sum(u * next_v - next_u * v)
    assert area == pytest.approx(np.prod(np.ptp(corners, axis=0)), rel=0.06)  # clockwise on the screen: positive


@pytest.mark.parametrize("colour", list(COLOURS))
def test_a_colour_is_not_found_among_all_the_others(colour):
    others = [
        Cylinder((2.0, y), colour=c) for c, y in zip(COLOURS, np.linspace(-0.9, 0.9, 6), strict=True) if c != colour
    ]
    assert find_corners(render(COURSE_CAMERA, [0, 0, 0], others, rng=np.random.default_rng(0)), colour).shape == (0, 2)


def test_corners_leave_the_picture_unchanged():
    image = paint(COURSE_CAMERA, [0, 0, 0], [Cylinder((2.0, 0.0))])
    before = image.copy()
    find_corners(image, "cyan")
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("background", [0, 128, 255])
def test_a_plain_rectangle_is_measured_to_the_pixel(background):
    """41 columns and 201 rows of pixels: the outline runs half a pixel outside their centres."""
    image = np.full((480, 640, 3), background, np.uint8)
    image[100:301, 300:341] = (255, 255, 0)
    got = measure(find_corners(image, "cyan"), COURSE_CAMERA)
    assert (got.height_px, got.axis_px) == pytest.approx((201.0, 320.0), abs=0.02)


@pytest.mark.parametrize("bar", [(0, 0, 255), (90, 90, 90), (40, 60, 80)])
def test_a_bar_in_front_is_noticed_whatever_its_colour(bar):
    image = np.full((480, 640, 3), 160, np.uint8)
    image[100:301, 300:341] = (255, 255, 0)
    image[50:400, 325:380] = bar
    got = measure(find_corners(image, "cyan"), COURSE_CAMERA)
    assert isinstance(got, Rejected) and got.reason.startswith("occluded")


@pytest.mark.parametrize("distance", [1.7, 1.9, 2.2, 2.6, 3.0])
def test_two_landmarks_of_one_colour_that_touch_are_not_taken_for_one(distance):
    pair = [Cylinder((1.5, 0.0)), Cylinder((distance, 0.08 * distance))]
    image = render(COURSE_CAMERA, [0, 0, 0], pair, rng=np.random.default_rng(0))
    assert isinstance(measure(find_corners(image, "cyan"), COURSE_CAMERA), Rejected)


def test_a_low_thing_that_hides_the_foot_is_noticed():
    """It leaves top and both sides in sight: only what shows below the visible bottom gives it away."""
    low = Cylinder((2.0, 0.0), radius=0.35, height=0.1, colour="magenta")
    image = render(COURSE_CAMERA, [0, 0, 0], [Cylinder((3.0, 0.0)), low], rng=np.random.default_rng(0))
    got = measure(find_corners(image, "cyan"), COURSE_CAMERA)
    assert isinstance(got, Rejected) and got.reason.startswith("occluded")


# Corners by hand: the same door for everybody's corners.

RECTANGLE = np.array([[300.0, 100.0], [340.0, 100.0], [340.0, 300.0], [300.0, 300.0]])


def moved(right, down):
    return RECTANGLE + np.array([right, down])


def test_four_corners_in_any_order_give_height_and_middle():
    for order in np.random.default_rng(0).permuted(np.tile(np.arange(4), (5, 1)), axis=1):
        got = measure(RECTANGLE[order], COURSE_CAMERA)
        assert (got.height_px, got.axis_px) == pytest.approx((200.0, 320.0), abs=1e-3)


def test_uneven_corners_do_not_move_the_axis():
    crowd = np.c_[np.full(30, 340.0), np.linspace(101, 299, 30)]
    even, uneven = measure(RECTANGLE, COURSE_CAMERA), measure(np.vstack([RECTANGLE, crowd]), COURSE_CAMERA)
    assert uneven == even
    assert np.vstack([RECTANGLE, crowd])[:, 0].mean() - even.axis_px > 15  # where the mean of all corners would be


def test_the_axis_is_the_mean_of_the_edges_angles():
    d, theta = 1.0, -0.42
    pixels = project_cylinder(d, theta, COURSE_CAMERA, 0.5, 0.1)
    corners = [[u, v] for u in (pixels.left_px, pixels.right_px) for v in (100.0, 100.0 + pixels.height_px)]
    got = measure(corners, COURSE_CAMERA)
    assert got.axis_px == pytest.approx(float(pixels.axis_px), abs=1e-9)
    assert got.height_px == pytest.approx(float(pixels.height_px), abs=1e-9)
    assert abs((pixels.left_px + pixels.right_px) / 2 - got.axis_px) > 2


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ([], "no corners"),
        (np.empty((0, 2)), "no corners"),
        ([[320.0, 200.0]], "too few corners: expected at least 4, got 1"),
        (RECTANGLE[:3], "too few corners: expected at least 4, got 3"),
        (np.where(np.arange(8).reshape(4, 2) == 3, np.nan, RECTANGLE), "occluded: 1 of 4 corners are NaN"),
        (np.full((4, 2), np.nan), "occluded: 4 of 4 corners are NaN"),
        (moved(-400, 0), "corners outside the 640 × 480 picture"),
        (moved(0, 300), "corners outside the 640 × 480 picture"),
        ([[300, 200], [310, 200], [320, 200], [340, 200]], "too small: 40.0 × 0.0 pixels"),
        ([[300, 100], [300, 150], [300, 250], [300, 300]], "too small: 0.0 × 200.0 pixels"),
        (moved(-300, 0), "cut off by the picture's left edge"),
        (moved(299, 0), "cut off by the picture's right edge"),
        (moved(0, -100), "cut off by the picture's top edge"),
        (moved(0, 179), "cut off by the picture's bottom edge"),
        (moved(-300, -100), "cut off by the picture's left and top edges"),
        ([[300, 100], [340, 100], [340, 300], [320, 300]], "lopsided: its middle wanders by 7.0 pixels"),
        ([[300, 100], [310, 150], [320, 200], [330, 250]], "lopsided: all corners lie on one line"),
    ],
)  # fmt: skip
def test_corners_that_cannot_be_trusted_are_rejected_with_the_reason(corners, words):
    got = measure(corners, COURSE_CAMERA)
    assert isinstance(got, Rejected)
    assert words in got.reason


@pytest.mark.parametrize(("u", "v"), [(-1, 0), (1, 0), (0, -1), (0, 1)])
def test_an_outline_needs_three_pixels_of_room_to_be_seen_to_end(u, v):
    """An edge is found from the pixels on both sides of it; close to the picture's border some of those are missing."""
    for room, whole in ((2.5, False), (3.5, True)):
        left, top = 300.0, 100.0
        shift = [u * (left - room if u < 0 else 639 - 340 - room), v * (top - room if v < 0 else 479 - 300 - room)]
        assert bool(measure(moved(*shift), COURSE_CAMERA)) == whole


def test_of_two_landmarks_of_one_colour_the_larger_piece_is_found_and_the_smaller_lost():
    image = np.full((480, 640, 3), 128, np.uint8)
    image[150:251, 100:131] = image[100:301, 400:441] = (255, 255, 0)
    corners = find_corners(image, "cyan")
    assert corners[:, 0].min() > 390 and np.ptp(corners[:, 1]) == pytest.approx(201, abs=0.2)


def test_a_known_aspect_rejects_what_is_too_narrow_or_too_wide():
    pixels = project_cylinder(3.0, 0.2, COURSE_CAMERA, 0.5, 0.1)
    for share, fits in ((1.0, True), (0.75, False), (1.3, False)):
        right = pixels.left_px + share * (pixels.right_px - pixels.left_px)
        corners = [[u, v] for u in (pixels.left_px, right) for v in (150.0, 150.0 + pixels.height_px)]
        assert bool(measure(corners, COURSE_CAMERA, aspect=0.4)) == fits
        assert measure(corners, COURSE_CAMERA)


@pytest.mark.parametrize(
    "corners", [None, "corners", [1.0, 2.0, 3.0], np.zeros((4, 3)), [[1, 2], [3]], np.zeros((2, 2, 2))]
)
def test_what_is_no_list_of_points_is_an_error(corners):
    with pytest.raises(ValueError, match="corners: expected"):
        measure(corners, COURSE_CAMERA)


@pytest.mark.parametrize("aspect", [0.0, -1.0, np.nan])
def test_an_impossible_aspect_is_an_error(aspect):
    with pytest.raises(ValueError, match="aspect: expected"):
        measure(RECTANGLE, COURSE_CAMERA, aspect=aspect)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 640), np.uint8),
        np.zeros((480, 640, 1), np.uint8),
        np.zeros((480, 640, 4), np.uint8),
        np.zeros((480, 640, 3)),
        np.zeros((4, 4, 3), np.uint8),
        [[0, 0], [0, 0]],
        None,
    ],
)
def test_a_grey_picture_or_a_wrong_one_is_an_error(image):
    with pytest.raises(ValueError, match="image_bgr: expected"):
        find_corners(image, "cyan")


@pytest.mark.parametrize("colour", ["mauve", None, ["red"]])
def test_a_colour_without_a_name_is_an_error(colour):
    with pytest.raises(ValueError, match="colour: expected one of red, yellow"):
        find_corners(np.zeros((48, 64, 3), np.uint8), colour)


def test_what_is_no_camera_is_an_error():
    with pytest.raises(TypeError, match=r"camera: expected a pinhole\.Camera, got dict"):
        measure(RECTANGLE, {"fx": 530})


def test_an_empty_picture_has_no_corners():
    assert find_corners(np.full((480, 640, 3), 128, np.uint8), "red").shape == (0, 2)


def test_red_is_found_on_both_sides_of_zero_hue():
    for hue in (2, 176):
        image = np.full((200, 200, 3), 128, np.uint8)
        image[60:140, 90:110] = cv2.cvtColor(np.uint8([[[hue, 220, 200]]]), cv2.COLOR_HSV2BGR)[0, 0]
        assert len(find_corners(image, "red")) > 0


def test_the_robots_own_view_leads_to_a_measurement():
    field = Arena.load("field")
    image = render(COURSE_CAMERA, mounted([-2.0, 0.3, -0.1]), field.cylinders, walls=field.walls)
    assert measure(find_corners(image, "cyan"), COURSE_CAMERA)
