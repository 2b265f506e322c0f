"""AprilTags, rendered and found again: corners, range and bearing, and whether their covariance is honest."""

import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.geometry import between, inverse, transform
from coursekit.pinhole import COURSE_CAMERA
from coursekit.results import Rejected
from coursekit.world.arena import Arena, Tag
from coursekit.world.camera import CAMERA_HEIGHT, CAMERA_OFFSET, mounted, render
from coursekit.world.tags import (
    EXPOSURE,
    Detection,
    corner_cov,
    detect,
    measure,
    measurement_cov,
    quads,
    tag_corners,
)

ARENA = Arena.load("tags")


def view(rng, distance=(0.5, 2.5)):
    """A random tag in front of a random robot → picture, tag, true corners, true range and bearing."""
    pose = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)])
    d, bearing, aside = rng.uniform(*distance), rng.uniform(-0.35, 0.35), rng.uniform(-1.1, 1.1)
    position = transform(mounted(pose), [d * np.cos(bearing), d * np.sin(bearing)])
    tag = Tag(int(rng.integers(587)), tuple(position), float(pose[2] + bearing + np.pi + aside))
    picture = render(COURSE_CAMERA, mounted(pose), [], walls=ARENA.walls, quads=quads([tag]), rng=rng, **EXPOSURE)
    x, y, yaw = between(mounted(pose), [*tag.position, tag.yaw])
    placed = np.array([x, y, tag.height - CAMERA_HEIGHT, yaw])
    p = transform(inverse(pose), tag.position)
    z = np.array([np.hypot(*p), np.arctan2(p[1], p[0])])
    return picture, tag, placed, COURSE_CAMERA.project(tag_corners(placed, tag.size)), z


def views(count, seed):
    rng, out = np.random.default_rng(seed), []
    while len(out) < count:
        picture, tag, placed, corners, z = view(rng)
        if corners.min() > 10 and np.all(corners.max(axis=0) < [629, 469]):
            out.append((picture, tag, placed, corners, z))
    return out


VIEWS = views(90, seed=1)
FOUND = [detect(picture) for picture, *_ in VIEWS]


def test_nine_tags_in_ten_are_found_and_all_by_their_own_id():
    hits = [[seen.id for seen in found] == [tag.id] for found, (_, tag, *_) in zip(FOUND, VIEWS, strict=True)]
    assert np.mean(hits) > 0.9
    assert all(len(found) <= 1 for found in FOUND)


def test_corners_are_unbiased_and_as_exact_as_they_say():
    """Errors of some 650 corner coordinates in their own standard deviations: rms 1 within 20 %, and no lean of more
    than a fifth of one in any of the eight (standard error 0.11)."""
    normalised = []
    for found, (_, _, _, corners, _) in zip(FOUND, VIEWS, strict=True):
        for seen in found:
            normalised.append((seen.corners - corners).ravel() / np.sqrt(np.diag(corner_cov(corners))))
    normalised = np.array(normalised)
    assert 0.8 < np.sqrt(np.mean(normalised**2)) < 1.2
    assert np.all(np.abs(normalised.mean(axis=0)) < 0.33)


def test_range_and_bearing_know_how_wrong_they_are():
    """The average of 80 and more χ²₂ values; the band is that of 99.9 %, widened by a tenth for a model of the
    corners that is right to a tenth."""
    squares = []
    for found, (_, tag, _, _, z) in zip(FOUND, VIEWS, strict=True):
        for seen in found:
            if result := measure(seen, COURSE_CAMERA, tag.size, CAMERA_OFFSET):
                error, R = result[0] - z, result[1]
                squares.append(error @ np.linalg.solve(R, error))
    low, high = chi2_band(2, len(squares), confidence=0.999)
    assert len(squares) > 80
    assert 0.9 * low < np.mean(squares) < 1.1 * high


def test_the_unrendered_covariance_is_the_rendered_one():
    """So that a run without pictures is the run with pictures: standard deviations agree to a half one by one,
    and to a twentieth in the median; they differ only because the corners do."""
    ratios = []
    for found, (_, tag, placed, *_) in zip(FOUND, VIEWS, strict=True):
        for seen in found:
            if result := measure(seen, COURSE_CAMERA, tag.size, CAMERA_OFFSET):
                R = measurement_cov(tag, placed, COURSE_CAMERA, CAMERA_OFFSET)
                ratios.append(np.sqrt(np.diag(result[1]) / np.diag(R)))
    np.testing.assert_allclose(ratios, 1, atol=0.5)
    np.testing.assert_allclose(np.median(ratios, axis=0), 1, atol=0.05)


def test_exact_corners_give_the_exact_place():
    rng = np.random.default_rng(2)
    for _ in range(50):
        d, bearing = rng.uniform(0.5, 3.0), rng.uniform(-0.4, 0.4)
        yaw = bearing + np.pi + rng.uniform(-1.2, 1.2)
        placed = [d * np.cos(bearing), d * np.sin(bearing), rng.uniform(-0.1, 0.1), yaw]
        corners = COURSE_CAMERA.project(tag_corners(placed, 0.16))
        (r, theta), _ = measure(Detection(1, corners), COURSE_CAMERA, 0.16, 0.07)
        assert r == pytest.approx(np.hypot(placed[0] + 0.07, placed[1]), abs=1e-6)
        assert theta == pytest.approx(np.arctan2(placed[1], placed[0] + 0.07), abs=1e-6)


def test_a_tag_is_seen_from_the_front_only():
    front = quads([Tag(5, (2.0, 0.0), np.pi)])
    back = quads([Tag(5, (2.0, 0.0), 0.0)])
    assert [seen.id for seen in detect(render(COURSE_CAMERA, [0, 0, 0], [], quads=front))] == [5]
    assert detect(render(COURSE_CAMERA, [0, 0, 0], [], quads=back)) == []


def test_the_reports_eight_tags_stand_where_its_table_says():
    table = {3: (2.5, 0), 2: (2.5, 1), 4: (1, 1.5), 17: (-0.3, 1.5), 0: (-1.3, 0.6), 16: (-1.2, 0.2)}
    table |= {15: (-0.3, -1.2), 1: (0.1, -1.2)}
    assert {tag.id: tag.position for tag in ARENA.tags} == table
    picture = render(COURSE_CAMERA, mounted([0, 0, 0]), [], walls=ARENA.walls, quads=quads(ARENA.tags))
    assert sorted(seen.id for seen in detect(picture)) == [2, 3]


def test_a_corner_taken_for_what_it_is_not_is_rejected_with_its_reason():
    corners = COURSE_CAMERA.project(tag_corners([1.5, 0.1, 0.05, 3.0], 0.16))
    corners[0] += [4.0, -3.0]
    verdict = measure(Detection(1, corners), COURSE_CAMERA, 0.16)
    assert isinstance(verdict, Rejected) and "no upright square" in verdict.reason


def test_a_tag_on_its_side_is_rejected_instead_of_put_far_away():
    corners = COURSE_CAMERA.project(tag_corners([1.5, 0.1, 0.05, 3.0], 0.16))
    for turned in (1, 2, 3):
        verdict = measure(Detection(1, np.roll(corners, turned, axis=0)), COURSE_CAMERA, 0.16)
        assert isinstance(verdict, Rejected) and "no upright square" in verdict.reason


@pytest.mark.parametrize(("size", "offset"), [(0.0, 0.0), (-0.16, 0.0), (np.nan, 0.0), (0.16, np.nan), (0.16, np.inf)])
def test_a_size_or_an_offset_that_cannot_be_is_refused(size, offset):
    corners = COURSE_CAMERA.project(tag_corners([1.5, 0.1, 0.05, 3.0], 0.16))
    with pytest.raises(ValueError, match="expected size > 0 and a finite camera_offset"):
        measure(Detection(1, corners), COURSE_CAMERA, size, offset)


@pytest.mark.parametrize(
    "picture",
    [np.zeros((9, 9)), np.zeros((9, 9, 3)), np.zeros((9, 9, 4), np.uint8), np.zeros((0, 9, 3), np.uint8), None],
)
def test_what_is_no_picture_raises(picture):
    with pytest.raises(ValueError, match="image: expected"):
        detect(picture)


def test_an_empty_picture_shows_no_tags():
    assert detect(np.full((480, 640, 3), 128, np.uint8)) == []
