"""The tag detector: small tags, uneven light, textures, families, grey pictures and OpenCV's own parameters."""

import cv2
import numpy as np
import pytest

from coursekit.pinhole import COURSE_CAMERA
from coursekit.world import tag_detector, tags
from coursekit.world.tag_detector import FAMILIES, Detection, detect
from tests.world.tag_scenes import one_tag, texture


def by_opencv(picture, family="apriltag_36h11"):
    """OpenCV's detector as it comes: {id: corners}."""
    dictionary = cv2.aruco.getPredefinedDictionary(FAMILIES[family])
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
    return {} if ids is None else {int(i): c.reshape(4, 2) for i, c in zip(ids.ravel(), corners, strict=True)}


def printed(family, number, cell=10, quiet=3):
    """A tag on white paper, grey, cells of ``cell`` pixels."""
    dictionary = cv2.aruco.getPredefinedDictionary(FAMILIES[family])
    tag = cv2.aruco.generateImageMarker(dictionary, number, cell * (dictionary.markerSize + 2))
    return cv2.copyMakeBorder(tag, *[quiet * cell] * 4, cv2.BORDER_CONSTANT, value=255)


# --- photographs -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def scenes():
    rng = np.random.default_rng(5)
    return [one_tag(rng, "apriltag_36h11", side) for side in (16.0, 18.0) for _ in range(12)]


@pytest.fixture(scope="module")
def found(scenes):
    return [detect(picture) for picture, _, _ in scenes]


@pytest.fixture(scope="module")
def theirs(scenes):
    return [by_opencv(picture) for picture, _, _ in scenes]


def test_small_tags_that_opencv_misses_are_found_and_no_tag_that_is_not_there(scenes, found, theirs):
    """24 tags with cells of two pixels.  OpenCV as it comes finds about half of them, this about four fifths."""
    numbers = [number for _, number, _ in scenes]
    ours = sum([seen.id for seen in several] == [number] for several, number in zip(found, numbers, strict=True))
    opencv = sum(list(several) == [number] for several, number in zip(theirs, numbers, strict=True))
    assert ours >= opencv + 3
    assert all({seen.id for seen in several} <= {number} for several, number in zip(found, numbers, strict=True))
    assert max(map(len, found)) == 1  # found at both sizes, it is still one tag


def test_corners_are_three_times_as_exact_as_opencvs(scenes, found, theirs):
    ours = [seen.corners - corners for several, (_, _, corners) in zip(found, scenes, strict=True) for seen in several]
    opencv = [c - corners for several, (_, _, corners) in zip(theirs, scenes, strict=True) for c in several.values()]
    rms = [float(np.sqrt(np.mean(np.square(errors)))) for errors in (ours, opencv)]
    assert rms[0] < 0.25 and rms[0] < rms[1] / 3
    assert np.abs(np.mean(ours, axis=(0, 1))).max() < 0.06


@pytest.mark.parametrize("cell", [22, 28])
def test_large_blurred_tags_are_found_for_all_that_opencvs_windows_are_narrower_than_a_cell(cell):
    """Blurred by three tenths of a cell, in uneven light, with noise; OpenCV as it comes finds next to none."""
    rng, found, missed = np.random.default_rng(0), [], 0
    for number in range(4):
        turn = cv2.getRotationMatrix2D((6 * cell - 0.5, 6 * cell - 0.5), rng.uniform(0, 90), 0.9)
        paper = printed("apriltag_36h11", number, cell, quiet=2)
        flat = cv2.warpAffine(paper, turn, paper.shape, borderValue=255)
        lit = (40 + 0.5 * flat) * np.linspace(0.4, 1.0, len(paper))
        seen = cv2.GaussianBlur(lit, (0, 0), 0.3 * cell) + rng.normal(0, 5, paper.shape)
        picture = np.clip(seen, 0, 255).astype(np.uint8)
        missed += number not in by_opencv(picture)
        low, high = 2 * cell - 0.5, 10 * cell - 0.5
        square = np.array([[low, low], [high, low], [high, high], [low, high]])
        found += [tag.corners - (square @ turn[:, :2].T + turn[:, 2]) for tag in detect(picture) if tag.id == number]
    assert len(found) == 4 and missed >= 3
    assert np.sqrt(np.mean(np.square(found))) < cell / 8  # the blur itself rounds the corners


def test_textures_hold_no_tags():
    """Half a million pixels with detail of every size, of noise, of checkers and of blots: no id at all."""
    rng, shape = np.random.default_rng(1), (300, 400)
    checkers = 255.0 * (np.indices(shape) // 9 % 2).sum(axis=0) % 510
    blots = cv2.GaussianBlur(255.0 * (texture(rng, shape) > 128), (0, 0), 1.0)
    for picture in (texture(rng, shape), rng.uniform(0, 255, shape), checkers, blots):
        assert detect(np.clip(picture, 0, 255).astype(np.uint8)) == []


@pytest.mark.parametrize("near", [4, 6])
def test_a_tag_near_the_edge_of_the_picture_is_fitted_too(near):
    picture = printed("apriltag_36h11", 5)[30 - near :, 30 - near :]
    (seen,) = detect(picture)
    assert seen.corners[0] == pytest.approx([near - 0.5] * 2, abs=0.1)


# --- families, pictures, parameters ------------------------------------------------------------------------------


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_of_opencv_is_a_choice_and_reads_its_own_tags(family):
    dictionary = cv2.aruco.getPredefinedDictionary(FAMILIES[family])
    number = len(dictionary.bytesList) - 1
    (seen,) = detect(printed(family, number), family, enlarge=1)
    cells = dictionary.markerSize + 2
    low, high = 29.5, 29.5 + 10 * cells
    assert (seen.id, seen.cells) == (number, cells)
    assert np.array(seen.corners) == pytest.approx(
        np.array([[low, low], [high, low], [high, high], [low, high]]), abs=0.1
    )


def test_there_is_a_family_for_each_of_opencvs_dictionaries():
    constants = {getattr(cv2.aruco, name) for name in dir(cv2.aruco) if name.startswith("DICT_")}
    assert set(FAMILIES.values()) == constants
    assert {"apriltag_36h11", "apriltag_16h5", "aruco_original", "4x4_50", "aruco_mip_36h12"} <= set(FAMILIES)


def test_grey_and_colour_are_the_same_picture(scenes):
    grey, number, _ = scenes[-1]
    found = [
        detect(p) for p in (grey, grey[..., None], cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.asfortranarray(grey))
    ]
    assert [[seen.id for seen in several] for several in found] == [[number]] * 4
    assert all(np.array_equal(several[0].corners, found[0][0].corners) for several in found)


@pytest.mark.parametrize("scale", [1.0, 2.0, 3.0, 2.5])
def test_what_is_found_in_an_enlarged_picture_lies_where_it_is_in_the_picture(scale):
    """A pixel's centre is a whole number in both, so enlarging twice takes 0 to 0.5; without that, all would be shifted
    by a quarter of a pixel."""
    finder = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(FAMILIES["apriltag_36h11"]))
    (corners,), ids = tag_detector._search(finder, printed("apriltag_36h11", 8), scale)
    assert ids == [8] and corners.mean(axis=0) == pytest.approx([69.5, 69.5], abs=0.1)


def test_the_picture_as_it_is_hides_small_tags_that_its_enlargement_shows(scenes, found):
    once = sum(len(detect(picture, enlarge=1)) for picture, _, _ in scenes)
    assert sum(map(len, found)) >= once + 3


def test_parameters_reach_opencvs_detector():
    picture = printed("apriltag_36h11", 4)
    assert [seen.id for seen in detect(picture)] == [4]
    assert detect(picture, parameters={"minMarkerPerimeterRate": 3.9}) == []  # no tag is as large as that
    white_on_black = 255 - picture
    assert detect(white_on_black) == []
    (seen,) = detect(white_on_black, parameters={"detectInvertedMarker": True})
    assert seen.id == 4 and seen.corners[0] == pytest.approx([29.5, 29.5], abs=0.1)
    assert [
        seen.id for seen in detect(picture, parameters={"cornerRefinementMethod": cv2.aruco.CORNER_REFINE_SUBPIX})
    ] == [4]


@pytest.mark.parametrize(
    ("settings", "kind", "message"),
    [
        ({"family": "36h11"}, ValueError, "family: expected one of .*apriltag_36h11.* got '36h11'"),
        ({"family": 20}, TypeError, "family: expected one of FAMILIES, got 20"),
        ({"enlarge": 0.5}, ValueError, "enlarge: expected a number from 1 to 8, got 0.5"),
        ({"enlarge": np.nan}, ValueError, "enlarge"),
        ({"enlarge": "2"}, TypeError, "enlarge: expected a number"),
        ({"parameters": {"windows": 3}}, ValueError, "expected some of .*adaptiveThreshWinSizeMax.* got 'windows'"),
        ({"parameters": {"readDetectorParameters": 3}}, ValueError, "parameters: expected some of"),
        ({"parameters": {"adaptiveThreshWinSizeMax": 30.5}}, TypeError, "adaptiveThreshWinSizeMax: expected a whole"),
        ({"parameters": {"errorCorrectionRate": "high"}}, TypeError, "errorCorrectionRate: expected a number"),
        ({"parameters": {"errorCorrectionRate": np.nan}}, ValueError, "errorCorrectionRate: expected a finite"),
        ({"parameters": {"adaptiveThreshWinSizeStep": 0}}, ValueError, "OpenCV refuses .*adaptiveThreshWinSizeStep"),
        ({"parameters": {"perspectiveRemovePixelPerCell": 0}}, ValueError, "OpenCV refuses"),
        ({"parameters": 5}, TypeError, "parameters: expected a mapping"),
    ],
)
def test_what_opencv_cannot_be_told_is_refused_at_the_door(settings, kind, message):
    with pytest.raises(kind, match=message):
        detect(np.full((100, 100), 128, np.uint8), **settings)


@pytest.mark.parametrize("shape", [(1, 1), (1, 200), (5, 9, 3)])
def test_a_picture_smaller_than_any_tag_shows_none(shape):
    assert detect(np.full(shape, 128, np.uint8)) == []


def test_a_tag_of_fewer_and_wider_cells_is_measured_as_the_sharper_one():
    corners = COURSE_CAMERA.project(tags.tag_corners([2.0, 0.1, 0.05, 3.0], 0.1))
    R = [tags.measure(Detection(1, corners, cells), COURSE_CAMERA, 0.1)[1] for cells in (6, 8)]
    assert np.all(np.diag(R[0]) < 0.8 * np.diag(R[1]))


def test_tags_hands_out_the_detector_under_its_own_name():
    assert (tags.detect, tags.Detection, tags.FAMILIES) == (detect, Detection, FAMILIES)
