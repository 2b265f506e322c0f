"""Lab 5's drives: the shortcut sees what the rendered camera sees, and neither tells a filter more than it should."""

import numpy as np
import pytest

from coursekit.scenes import lab05


def test_the_shortcut_sees_the_tags_that_the_rendered_camera_sees():
    """Sixty places along both paths; where they differ, a tag stands at the edge of what can be seen."""
    rng, same, seen = np.random.default_rng(5), 0, 0
    for path in ("square", "octagon"):
        truth = lab05.drive(1, path).truth
        for pose in truth[10 :: len(truth) // 30]:
            drawn, (_, _, rendered) = lab05.glimpse(pose, rng), lab05.photograph(pose, rng)
            same += len(set(drawn.ids) & set(rendered.ids))
            seen += len(set(drawn.ids) | set(rendered.ids))
    assert seen > 40
    assert same / seen > 0.9


@pytest.mark.parametrize("path", ["square", "octagon"])
def test_each_lap_shows_every_tag_often_enough_to_be_confirmed(path):
    run = lab05.drive(3, path).until(1)
    ids = np.concatenate([look.ids for look in run.looks if look])
    assert min(np.sum(ids == tag.id) for tag in lab05.ARENA.tags) >= 3


def test_the_first_lap_of_a_drive_is_a_part_of_it():
    run = lab05.drive(2, "octagon")
    first = run.until(1)
    assert len(first.odometry) == len(first.truth) - 1 == len(first.looks) < len(run.odometry)
    np.testing.assert_array_equal(first.truth, run.truth[: len(first.truth)])
    assert np.hypot(*(first.truth[-1] - run.truth[-1])[:2]) < 0.2


def test_a_map_error_counts_tags_and_measures_metres():
    found, error = lab05.map_error(lab05.TAGS + np.array([0.03, 0.04]))
    assert (found, round(error, 6)) == (8, 0.05)
    assert lab05.map_error(lab05.TAGS[:6])[0] == 6
