"""Features tile by tile: the same ones, the same fixes, and no tile larger than it may be."""

import cv2
import numpy as np
import pytest

from coursekit.visual import MapMatcher, features
from coursekit.world.seafloor import look


@pytest.fixture
def small_tiles(monkeypatch):
    """Tiles of 512 pixels, for a map of two million that is otherwise looked at in one piece."""
    monkeypatch.setattr(features, "WHOLE", 1 << 18)
    monkeypatch.setattr(features, "CORE", 512)


@pytest.fixture(scope="module")
def part(sea):
    return sea[:, :1300]


@pytest.fixture(scope="module")
def whole(part):
    return features.features(part)


def test_tiles_hold_the_features_of_the_whole_each_of_them_once(part, whole, small_tiles):
    """All but 2 %, those whose neighbourhood is wider than the overlap; none within a hundredth of a pixel twice."""
    places, descriptors = features.features(part)
    matches = cv2.BFMatcher().match(whole[1].astype(np.float32), descriptors.astype(np.float32))
    apart = np.array([np.hypot(*(whole[0][m.queryIdx] - places[m.trainIdx])) for m in matches])
    assert len(places) == pytest.approx(len(whole[0]), rel=0.02)
    assert np.mean(apart < 0.01) > 0.98


def test_a_matcher_of_tiles_gives_the_same_fixes(sea, matcher, small_tiles):
    tiled, rng = MapMatcher(sea), np.random.default_rng(3)
    for _ in range(4):
        frame = look(sea, rng.uniform([420, 320, -np.pi], [2100, 480, np.pi]), noise=4, blur=0.7, rng=rng)
        one, other = matcher.locate(frame), tiled.locate(frame)
        assert bool(one) == bool(other)
        if one:
            assert (
                other.pose == pytest.approx(one.pose, abs=3 * np.sqrt(one.cov[0, 0]))
                and other.inliers > 0.9 * one.inliers
            )


def test_no_piece_is_larger_than_a_tile_and_its_overlap(sea, small_tiles):
    pieces = [(v.stop - v.start, u.stop - u.start) for _, _, u, v in features._tiles(sea.shape)]
    assert len(pieces) == 2 * 5 and np.max(pieces) <= 512 + 2 * 128
    cores = [(u.start, u.stop, v.start, v.stop) for u, v, _, _ in features._tiles(sea.shape)]
    assert sum((b - a) * (d - c) for a, b, c, d in cores) == sea.size
    assert all(around.start % 128 == 0 for _, _, u, v in features._tiles(sea.shape) for around in (u, v))


def test_the_strongest_features_of_a_large_picture_are_kept(part, small_tiles):
    places, descriptors = features.features(part, 50)
    assert places.shape == (50, 2) and descriptors.shape == (50, 128)
    one_piece = cv2.SIFT.create(nfeatures=50, enable_precise_upscale=True, contrastThreshold=features.FAINTEST)
    expected = np.array([k.pt for k in one_piece.detect(part, None)])
    near = np.linalg.norm(places[:, None] - expected, axis=-1).min(axis=0) < 0.5
    assert near.mean() > 0.9


def test_a_plain_picture_has_no_features():
    places, descriptors = features.features(np.full((64, 64), 7, np.uint8))
    assert places.shape == (0, 2) and descriptors.shape == (0, 128)
