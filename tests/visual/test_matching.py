"""MapMatcher: where a picture was taken, how sure that is, and when it says no."""

import re

import cv2
import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.geometry import wrap_angle
from coursekit.results import Rejected
from coursekit.visual import DirectMatcher, Fix, MapMatcher, odometry_from_image
from coursekit.visual.homography import jacobian, project
from coursekit.world import seafloor
from coursekit.world.seafloor import frame_to_map, look
from coursekit.world.seafloor_map import paint

WATER = {"blur": 0.7, "noise": 4.0, "caustics": 0.12}
CUT = (slice(200, 600), slice(400, 800))  # its centre is the map's pixel (599.5, 399.5)


def error(fix, pose):
    return np.array([fix.x - pose[0], fix.y - pose[1], wrap_angle(fix.yaw - pose[2])])


def clouds(shape, seed, finest=2.0):
    """A picture with detail of every size, as natural photographs have: 1/f noise."""
    rng = np.random.default_rng(seed)
    f = np.hypot(*np.meshgrid(np.fft.rfftfreq(shape[1]), np.fft.fftfreq(shape[0])))
    spectrum = np.fft.rfft2(rng.standard_normal(shape)) / np.maximum(f, 1 / max(shape)) * np.exp(-((finest * f) ** 2))
    image = np.fft.irfft2(spectrum, s=shape)
    return np.clip(128 + 45 * image / image.std(), 0, 255).astype(np.uint8)


# --- where -------------------------------------------------------------------------------------------------------


def test_a_cut_from_the_map_is_found_where_it_was_cut(sea, matcher):
    fix = matcher.locate(sea[CUT])
    assert error(fix, [599.5, 399.5, 0]) == pytest.approx([0, 0, 0], abs=1e-3)
    assert fix.scale == pytest.approx(1, abs=1e-5) and fix.inliers > 300


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_cut_shows_neither_a_bias_nor_the_wrong_sense_of_rotation(sea, matcher, turns):
    """np.rot90 turns the picture anticlockwise, as a camera sees it that turned clockwise.  Without precise upscaling
    SIFT is a quarter of a pixel off along both axes of each picture: 0.7 px after half a turn."""
    fix = matcher.locate(np.rot90(sea[CUT], turns))
    assert error(fix, [599.5, 399.5, turns * np.pi / 2]) == pytest.approx([0, 0, 0], abs=0.05)


def test_frames_through_water_are_located_to_a_small_part_of_a_pixel_and_know_it(sea, matcher):
    """60 frames from anywhere.  NEES of (x, y, yaw) within the two-sided 99.9 % band of an honest fix (so 1 draw of
    the seed in 1,000 would raise a false alarm), median error ≤ 0.1 px and ≤ 0.02° (asked: 0.5 px and 0.1°)."""
    rng, errors, nees, scales = np.random.default_rng(3), [], [], []
    for _ in range(60):
        pose, scale = rng.uniform([320, 320, -np.pi], [2240, 480, np.pi]), rng.uniform(0.85, 1.15)
        light = {"gain": rng.uniform(0.8, 1.2), "offset": rng.uniform(-10, 10), "time": rng.uniform(0, 99)}
        if not (fix := matcher.locate(look(sea, pose, scale=scale, rng=rng, **light, **WATER))):
            continue
        errors.append(error(fix, pose))
        nees.append(errors[-1] @ np.linalg.solve(fix.cov[:3, :3], errors[-1]))
        scales.append((fix.scale - scale) / np.sqrt(fix.cov[3, 3]))
    assert np.median(np.hypot(*np.array(errors)[:, :2].T)) < 0.1
    assert np.median(np.abs(np.array(errors)[:, 2])) < np.radians(0.02)
    assert len(errors) > 40 and np.abs(errors).max() < 1
    low, high = chi2_band(3, runs=len(errors), confidence=0.999)
    assert low < np.mean(nees) < high
    assert 0.5 < np.std(scales) < 1.6


@pytest.mark.parametrize(
    "make", [lambda: paint(21, (600, 1200)), lambda: clouds((700, 900), 5)], ids=["painted", "1/f"]
)
def test_other_maps_work_unchanged_under_rotation_scale_brightness_and_noise(make):
    strange = make()
    h, w = strange.shape[:2]
    matcher, rng, off = MapMatcher(strange), np.random.default_rng(8), []
    for scale in (0.8, 0.9, 1.0, 1.1, 1.25):
        for _ in range(2):
            # a 300 px frame stays on the map at any angle
            pose = np.append(rng.uniform([270, 270], [w - 270, h - 270]), rng.uniform(-np.pi, np.pi))
            view = look(strange, pose, scale=scale, gain=rng.uniform(0.7, 1.2), noise=5, blur=0.5, size=300, rng=rng)
            if fix := matcher.locate(view):
                off.append(error(fix, pose))
                assert fix.scale == pytest.approx(scale, rel=2e-3)
    assert len(off) >= 9  # one of the painted map's may lie on bare sand
    assert np.median(np.hypot(*np.array(off)[:, :2].T)) < 0.25 and np.abs(off).max() < 1.5
    assert np.median(np.abs(np.array(off)[:, 2])) < np.radians(0.1)


def test_colour_alpha_and_grey_are_the_same_picture(matcher):
    colour = seafloor.load()[CUT]
    alpha = np.dstack([colour, np.full(colour.shape[:2], 9, np.uint8)])
    grey = cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY)
    fixes = [matcher.locate(image) for image in (colour, alpha, grey, grey[..., None])]
    assert all(np.array_equal(fix.pose, fixes[0].pose) for fix in fixes)


def test_a_picture_of_another_size_is_located_by_its_own_centre(sea, matcher):
    fix = matcher.locate(sea[200:390, 400:725])
    assert error(fix, [400 + 162, 200 + 94.5, 0]) == pytest.approx([0, 0, 0], abs=0.01)


def test_the_homography_the_pose_and_the_pairs_tell_one_story(sea, matcher):
    pose, scale = np.array([1900.3, 380.9, -2.0]), 1.1
    fix = matcher.locate(look(sea, pose, scale=scale, noise=3, rng=np.random.default_rng(0)))
    assert project(fix.homography, np.array([[199.5, 199.5]]))[0] == pytest.approx([fix.x, fix.y])
    assert fix.homography[:2] == pytest.approx(frame_to_map(pose, scale), abs=0.2)
    assert fix.pairs.shape == (fix.inliers, 4)
    off = np.linalg.norm(project(fix.homography, fix.pairs[:, :2]) - fix.pairs[:, 2:], axis=1)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(fix.rms, rel=0.05) and off.max() < 3.1
    assert np.array_equal(fix.pose, [fix.x, fix.y, fix.yaw]) and fix


def test_a_corner_with_two_orientations_is_one_piece_of_evidence(sea, matcher):
    pairs = np.round(matcher.correspondences(sea[CUT]) * 4)
    assert len(pairs) == len(np.unique(pairs[:, :2], axis=0)) == len(np.unique(pairs[:, 2:], axis=0))


def test_a_belief_is_the_fix_in_the_odometrys_frame(sea, matcher):
    fix = matcher.locate(sea[CUT])
    assert np.array_equal(fix.belief.mean, odometry_from_image(fix.pose))
    # x keeps its sign, y and the heading turn theirs
    cov = np.diag([4.0, 9.0, 1e-4, 1e-4])
    cov[0, 1] = cov[1, 0] = 2.0
    cov[1, 2] = cov[2, 1] = 0.01
    turned = Fix(1, 2, 0.5, 20, np.eye(3), 1.0, cov, 0.2, np.empty((0, 4))).belief.cov
    assert turned[0, 1] == -2.0 and turned[1, 2] == 0.01 and np.array_equal(np.diag(turned), [4, 9, 1e-4])


def test_a_fix_made_by_hand_is_good_to_a_pixel():
    fix = Fix(10.0, 20.0, 0.5, 30, np.eye(3))
    assert np.array_equal(np.diag(fix.belief.cov), [1, 1, 1e-4]) and fix.scale == 1


def test_two_matchers_of_one_map_agree_to_the_last_bit_and_change_nothing(sea, matcher):
    frame = look(sea, [700, 380, 1.0], noise=5, rng=np.random.default_rng(2))
    given = frame.copy()
    one, two = matcher.locate(frame), MapMatcher(sea).locate(frame)
    assert np.array_equal(one.pose, two.pose) and np.array_equal(one.cov, two.cov)
    assert np.array_equal(matcher.locate(frame).pose, one.pose)
    assert np.array_equal(frame, given)


# --- when it says no ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (lambda sea, rng: np.full((400, 400), 128, np.uint8), "uniform: grey level 128"),
        (lambda sea, rng: look(sea, [1280, 400, 0.4], rng=rng, **WATER), "features look like one place"),
        (lambda sea, rng: look(sea, [500, 400, 0], blur=10, noise=3, rng=rng), "look like one place|agree"),
        (lambda sea, rng: rng.integers(0, 256, (400, 400), dtype=np.uint8), "look like one place|agree"),
        (lambda sea, rng: clouds((400, 400), 1), "look like one place|agree|implausible|mirrored|outside"),
        (lambda sea, rng: np.ascontiguousarray(sea[CUT][:, ::-1]), "look like one place|agree|mirrored|implausible"),
    ],
    ids=["uniform", "bare sand", "murky water", "noise", "another place", "mirrored"],
)
def test_a_picture_that_shows_nothing_of_the_map_is_rejected_with_its_reason(sea, matcher, frame, reason):
    result = matcher.locate(frame(sea, np.random.default_rng(1)))
    assert isinstance(result, Rejected) and not result
    assert re.search(reason, result.reason)


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        ([[1, 0, 100], [0, -1, 700]], "mirrored"),
        ([[3, 0, 100], [0, 3, 100]], "implausible scale: 3.00"),
        ([[0.3, 0, 100], [0, 0.3, 100]], "implausible scale: 0.30"),
        ([[1.5, 0, 100], [0, 1, 100]], "implausible skew"),
        ([[1, 0.5, 100], [0, 1, 100]], "implausible skew"),
        ([[1, 0, -300], [0, 1, 100]], "outside the map"),
        ([[1, 0, 2400], [0, 1, 100]], "outside the map"),
        ([[1, 0, 100], [0, 1, 100]], ""),
        ([[0, -1.2, 700], [1.2, 0, 100]], ""),
    ],
)
def test_a_homography_that_no_camera_over_this_map_can_have_is_named(matcher, matrix, reason):
    homography = np.vstack([matrix, [0, 0, 1]]).astype(float)
    found = matcher.implausible(homography, [199.5, 199.5])
    assert found.startswith(reason) and bool(found) == bool(reason)


def test_no_homography_is_a_reason_too(matcher):
    assert "no homography" in matcher.implausible(None, [0, 0])


# --- bad input ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((400, 400)), "image: expected uint8 .* got float64"),
        (np.full((400, 400), np.nan), "float64 with NaN"),
        (np.zeros((400, 400), np.uint16), "uint16"),
        (np.zeros((400, 400), bool), "bool"),
        (np.zeros(400, np.uint8), r"expected shape .* got \(400,\)"),
        (np.zeros((400, 400, 2), np.uint8), r"expected shape .* got \(400, 400, 2\)"),
        (np.zeros((2, 400, 400, 3), np.uint8), "expected shape"),
        (np.zeros((0, 0), np.uint8), "at least 32 pixels"),
        (np.zeros((400, 10), np.uint8), "at least 32 pixels"),
        (None, "expected uint8"),
    ],
)
def test_what_is_no_picture_is_refused_at_the_door(matcher, image, message):
    with pytest.raises(ValueError, match=message):
        matcher.locate(image)


@pytest.mark.parametrize(("taller", "wider"), [(1, 1), (1, 0), (0, 1), (100, 0), (100, 100)])
def test_a_picture_larger_than_the_map_is_matched_like_any_other(sea, taller, wider):
    picture = sea[100 : 400 + taller, 300 : 600 + wider]
    fix = MapMatcher(sea[100:400, 300:600]).locate(picture)
    assert fix and (fix.x, fix.y) == pytest.approx(((299 + wider) / 2, (299 + taller) / 2), abs=0.05)
    assert DirectMatcher(sea[100:400, 300:600]).correlation(picture)(fix.belief.mean[None])[0] > 0.5


@pytest.mark.parametrize("shared", [0.75, 0.55, 0.35])
def test_neighbouring_photographs_of_a_survey_are_placed_on_each_other(shared):
    """Two pictures of one size, the second turned, brighter and noisy: the one is the map of the other."""
    ground, rng = clouds((500, 1100), 4), np.random.default_rng(0)
    pose = np.array([180 + 360 * (1 - shared) + 60, 250.0, 0.2])
    neighbour = look(ground, pose, gain=1.1, noise=4, size=300, rng=rng)
    fix = MapMatcher(ground[70:430, 60:420], margin=180).locate(neighbour)
    off = error(fix, pose - [60, 70, 0])
    assert np.hypot(*off[:2]) < 1.0 and off @ np.linalg.solve(fix.cov[:3, :3], off) < 25  # χ²₃: 1 in 65,000 is beyond


def test_a_centre_beyond_the_map_needs_a_margin_and_then_keeps_within_it():
    ground = clouds((401, 900), 6)
    here, neighbour = ground[:, :400], ground[:, 249:650]  # its centre lies 50 px beyond the map's last column
    assert "outside the map: the centre would lie at (449, 200)" in MapMatcher(here).locate(neighbour).reason
    assert MapMatcher(here, margin=51).locate(neighbour).x == pytest.approx(449, abs=0.05)
    assert "49 px beyond it at most" in MapMatcher(here, margin=49).locate(neighbour).reason


def test_the_same_place_in_another_season_is_rejected_with_a_reason():
    """Half of the ground has changed its brightness, and all detail finer than 30 px has grown anew."""
    ground, grown = (clouds((500, 500), seed).astype(float) for seed in (8, 9))
    coarse = cv2.GaussianBlur(ground, (0, 0), 30.0)
    autumn = np.clip(255 - coarse + 0.8 * (grown - cv2.GaussianBlur(grown, (0, 0), 30.0)), 0, 255).astype(np.uint8)
    result = MapMatcher(ground.astype(np.uint8)).locate(autumn[50:450, 50:450])
    assert isinstance(result, Rejected) and re.search("look like one place|agree|implausible", result.reason)


# --- a tilted camera ---------------------------------------------------------------------------------------------


def tilted_look(ground, tilt, at, yaw, rng, shape=(300, 400), f=450.0, height=450.0):
    """What a camera sees whose optical axis meets the ground at ``at``, tilted by ``tilt`` rad from the vertical about
    its own u axis, and its centre ``height`` px away along that axis."""
    K = np.array([[f, 0, (shape[1] - 1) / 2], [0, f, (shape[0] - 1) / 2], [0, 0, 1]])
    c, s, cy, sy = np.cos(tilt), np.sin(tilt), np.cos(yaw), np.sin(yaw)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ np.array([[cy, sy, 0], [-sy, cy, 0], [0, 0, 1]])
    H = K @ np.column_stack([turn[:, 0], turn[:, 1], [0, 0, height]]) @ [[1, 0, -at[0]], [0, 1, -at[1]], [0, 0, 1]]
    seen = cv2.warpPerspective(ground, H, shape[::-1], flags=cv2.INTER_AREA) + rng.normal(0, 4, shape)
    return np.clip(seen, 0, 255).astype(np.uint8), H


@pytest.mark.parametrize("degrees", [1.0, 10.0, 25.0, 50.0])
def test_a_tilted_camera_is_placed_where_its_axis_meets_the_ground_and_knows_how_well(degrees):
    """A similarity, fitted to the same pairs, was 1.8 px off at 10° and 19 at 30°, and said 0.3 and 0.5."""
    ground, rng, squares = clouds((700, 800), 7), np.random.default_rng(2), []
    matcher = MapMatcher(ground, max_skew=2.0)
    for yaw in (0.4, -1.9):
        picture, H = tilted_look(ground, np.radians(degrees), (380.0, 340.0), yaw, rng)
        fix = matcher.locate(picture)
        off = error(fix, [380, 340, yaw])
        squares.append(off @ np.linalg.solve(fix.cov[:3, :3], off))
        assert np.hypot(*off[:2]) < 0.2
        around = np.array([[109.5, 59.5], [289.5, 59.5], [289.5, 239.5], [109.5, 239.5]])
        assert project(fix.homography, around) == pytest.approx(project(np.linalg.inv(H), around), abs=0.7)
        long, short = np.linalg.svd(jacobian(fix.homography, [199.5, 149.5]), compute_uv=False)
        assert long / short == pytest.approx(1 / np.cos(np.radians(degrees)), rel=0.01)
        assert fix.scale == pytest.approx(np.sqrt(long * short), rel=1e-6)
    assert np.mean(squares) < 11.2  # χ²₆ / 2: 1 in 1,000 is beyond


def test_a_camera_that_looks_straight_down_is_taken_for_one(sea, matcher):
    fix = matcher.locate(look(sea, [700, 380, 1.0], rng=np.random.default_rng(2), **WATER))
    assert np.array_equal(fix.homography[2], [0, 0, 1])


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.full((500, 500), 7, np.uint8), "map_image: expected at least 12 features, found 0"),
        (np.full((500, 500), np.nan), "map_image: expected uint8"),
    ],
)
def test_a_map_on_which_nothing_can_be_told_apart_is_refused(image, message):
    with pytest.raises(ValueError, match=message):
        MapMatcher(image)


@pytest.mark.parametrize(
    "settings",
    [
        {"min_inliers": 3},
        {"max_features": 0},
        {"ratio": np.nan},
        {"ratio": 1.5},
        {"reprojection": 0.0},
        {"scales": (2.0, 0.5)},
        {"max_skew": 0.5},
        {"margin": -1.0},
        {"margin": np.nan},
    ],
)
def test_settings_by_which_nothing_could_be_matched_are_refused(sea, settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        MapMatcher(sea, **settings)
