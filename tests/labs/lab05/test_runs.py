"""Lab 5's drives: the shortcut sees what the rendered camera sees, and neither tells a filter more than it should."""

import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.labs.lab05 import runs
from coursekit.slam import EkfSlam, FirstEstimateSlam
from coursekit.slam.association import Known, Mahalanobis


def test_the_shortcut_sees_the_tags_that_the_rendered_camera_sees():
    """Sixty places along both paths; where they differ, a tag stands at the edge of what can be seen."""
    rng, same, seen = np.random.default_rng(5), 0, 0
    for path in ("square", "octagon"):
        truth = runs.drive(1, path).truth
        for pose in truth[10 :: len(truth) // 30]:
            drawn, (_, _, rendered) = runs.glimpse(pose, rng), runs.photograph(pose, rng)
            same += len(set(drawn.ids) & set(rendered.ids))
            seen += len(set(drawn.ids) | set(rendered.ids))
    assert seen > 40
    assert same / seen > 0.9


@pytest.mark.parametrize("path", ["square", "octagon"])
def test_each_lap_shows_every_tag_often_enough_to_be_confirmed(path):
    run = runs.drive(3, path).until(1)
    ids = np.concatenate([look.ids for look in run.looks if look])
    assert min(np.sum(ids == tag.id) for tag in runs.ARENA.tags) >= 3


def test_the_first_lap_of_a_drive_is_a_part_of_it():
    run = runs.drive(2, "octagon")
    first = run.until(1)
    assert len(first.odometry) == len(first.truth) - 1 == len(first.looks) < len(run.odometry)
    np.testing.assert_array_equal(first.truth, run.truth[: len(first.truth)])
    assert np.hypot(*(first.truth[-1] - run.truth[-1])[:2]) < 0.2


def test_a_map_error_counts_tags_and_measures_metres():
    found, error = runs.map_error(runs.TAGS + np.array([0.03, 0.04]))
    assert (found, round(error, 6)) == (8, 0.05)
    assert runs.map_error(runs.TAGS[:6])[0] == 6


def test_what_is_drawn_from_the_model_and_fitted_at_once_is_as_good_as_it_says():
    """NEES of four maps that no linearisation spoils: the average of χ²₁₆/16, in its band of 99.9 %."""
    drives = [
        runs.redrawn(runs.drive(seed, "square", 1, "turned round"), np.random.default_rng(seed)) for seed in (0, 3)
    ]
    drives += [runs.redrawn(runs.drive(seed, "octagon", 1), np.random.default_rng(seed)) for seed in (1, 2)]
    charts = [runs.smoothed_verdict(run, runs.fresh(FirstEstimateSlam, Known(), run))[1] for run in drives]
    low, high = (edge / 16 for edge in chi2_band(16, len(charts), confidence=0.999))
    assert low < np.mean(charts) < high


def test_a_tenth_of_the_noise_moves_the_truth_and_the_looks_by_about_a_tenth():
    run = runs.drive(1, "octagon", 1)
    far, near = (runs.redrawn(run, np.random.default_rng(4), scale) for scale in (1.0, 0.1))
    quiet = runs.redrawn(run, np.random.default_rng(4), 1e-9)
    off = [np.abs(one.truth - quiet.truth)[:12].max() for one in (far, near)]
    assert 5 < off[0] / off[1] < 20
    first = next(k for k, look in enumerate(near.looks) if look and len(look.ids))
    np.testing.assert_allclose(near.looks[first].R, 0.01 * far.looks[first].R, rtol=0.2)


def test_a_verdict_is_that_of_follow():
    run = runs.drive(0, "octagon", 1)
    pose, _ = runs.verdict(run, runs.fresh(EkfSlam, Mahalanobis(0.99), run), told=False)
    track = runs.follow(run, EkfSlam(run.start, runs.MOTION, Mahalanobis(0.99)))
    assert pose == pytest.approx(np.mean(track.nees))
