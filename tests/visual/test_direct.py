"""The direct method: each particle's own window of the map against the picture."""

import cv2
import numpy as np
import pytest

from coursekit.visual import DirectMatcher, odometry_from_image
from coursekit.world.seafloor import look

POSE = np.array([700.0, 410.0, 0.8])
TRUTH = odometry_from_image(POSE)


@pytest.fixture(scope="module")
def frame(sea):
    return look(sea, POSE, noise=4, caustics=0.12, blur=0.7, rng=np.random.default_rng(0))


def test_at_full_size_it_is_the_correlation_with_the_window_one_would_cut_by_hand(sea, frame):
    here = DirectMatcher(sea, level=0, contrast_floor=1e-6).correlation(frame)
    for away in ([0, 0, 0], [5, 3, 0.05], [-40, 20, 1.0]):
        window = look(sea, POSE + away)
        by_hand = np.corrcoef(window.ravel().astype(float), frame.ravel().astype(float))[0, 1]
        assert here(odometry_from_image(POSE + away)[None])[0] == pytest.approx(by_hand, abs=0.02)


@pytest.mark.parametrize("level", [2, 3, 4])
def test_the_truth_fits_best_and_a_pose_further_off_fits_worse(sea, frame, level):
    log_likelihood = DirectMatcher(sea, level).log_likelihood(frame)
    for axis, away in [([1, 0, 0], 40.0), ([0, 1, 0], 40.0), ([0, 0, 1], 0.4)]:
        states = TRUTH + np.outer(np.linspace(-away, away, 41), axis)
        best = np.argmax(log_likelihood(states))
        assert abs(best - 20) <= 1
        assert log_likelihood(states[[20, 26, 32]]) == pytest.approx(sorted(log_likelihood(states[[20, 26, 32]]))[::-1])


def test_brightness_and_contrast_of_the_picture_do_not_matter(sea, frame):
    direct, states = DirectMatcher(sea), TRUTH + np.random.default_rng(1).normal(size=(50, 3)) * [10, 10, 0.1]
    dimmed = np.round(0.6 * frame + 30).astype(np.uint8)
    assert direct.log_likelihood(dimmed)(states) == pytest.approx(direct.log_likelihood(frame)(states), abs=0.3)


def test_a_thousand_particles_at_once_are_a_thousand_particles_one_by_one(sea, frame):
    states = TRUTH + np.random.default_rng(2).normal(size=(1000, 3)) * [60, 60, 0.5]
    log_likelihood = DirectMatcher(sea).log_likelihood(frame)
    assert log_likelihood(states)[::97] == pytest.approx([log_likelihood(s[None])[0] for s in states[::97]], abs=1e-4)


def test_the_blocks_that_save_memory_do_not_show(sea, frame, monkeypatch):
    from coursekit.visual import direct as module

    states = TRUTH + np.random.default_rng(3).normal(size=(300, 3)) * [60, 60, 0.5]
    whole = DirectMatcher(sea).correlation(frame)(states)
    monkeypatch.setattr(module, "MOST_PIXELS", 20_000)
    assert DirectMatcher(sea).correlation(frame)(states) == pytest.approx(whole, abs=1e-6)


def test_how_high_the_camera_floats_is_seen_from_the_fit(sea):
    for scale in (0.94, 1.0, 1.06):
        view = look(sea, POSE, scale=scale, noise=3, rng=np.random.default_rng(0))
        assert DirectMatcher(sea).scale(view, TRUTH) == pytest.approx(scale, abs=0.011)


def test_a_uniform_picture_and_a_bare_map_say_nothing(sea, frame):
    states = TRUTH + np.random.default_rng(4).normal(size=(20, 3)) * [60, 60, 0.5]
    assert np.array_equal(DirectMatcher(sea).log_likelihood(np.full((400, 400), 90, np.uint8))(states), np.zeros(20))
    bare = DirectMatcher(np.full((800, 2560), 90, np.uint8))
    assert bare.log_likelihood(frame)(states) == pytest.approx(np.zeros(20), abs=1e-6)


def test_colour_is_welcome(sea, frame):
    colour = cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR)
    states = TRUTH[None]
    assert DirectMatcher(sea).log_likelihood(colour)(states) == pytest.approx(
        DirectMatcher(sea).log_likelihood(frame)(states), abs=0.05
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda sea: DirectMatcher(sea, level=-1), "level"),
        (lambda sea: DirectMatcher(sea, independent=2), "independent"),
        (lambda sea: DirectMatcher(sea, contrast_floor=np.nan), "contrast_floor"),
        (lambda sea: DirectMatcher(sea[:40, :40], level=5), "too small for 5 halvings"),
        (lambda sea: DirectMatcher(sea).log_likelihood(np.full((400, 400), np.nan)), "uint8"),
        (lambda sea: DirectMatcher(sea).correlation(sea[:400, :400], np.nan), "scale"),
        (lambda sea: DirectMatcher(sea).correlation(sea[:400, :400])(np.zeros((3, 2))), "pose"),
    ],
)
def test_what_cannot_be_compared_is_refused(sea, call, message):
    with pytest.raises(ValueError, match=message):
        call(sea)
