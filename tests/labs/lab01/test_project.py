"""Lab 1's project: any sound landmark finder gets its marks, and a wrong one the finding that it deserves."""

import cv2
import numpy as np
import pytest

from coursekit.labs.lab01.project import KINDS, PROJECT, reference
from tests.labs.judge import Judge

SEEDS = range(7_000, 7_005)


def masks(image, low, high):
    """The landmark's colour, and any other landmark's."""
    h, s, v = cv2.cvtColor(cv2.GaussianBlur(image, (3, 3), 0), cv2.COLOR_BGR2HSV).astype(int).transpose(2, 0, 1)
    coloured = (s >= 120) & (v >= 18)
    mine = coloured & ((h >= low) & (h <= high) if low <= high else (h >= low) | (h <= high))
    return mine, coloured & ~mine


def box(mine):
    """Column, row, width, height of the largest region, or None."""
    _, _, stats, _ = cv2.connectedComponentsWithStats(mine.astype(np.uint8))
    areas = stats[1:, cv2.CC_STAT_AREA]
    return stats[1 + areas.argmax(), :4] if areas.size and areas.max() >= 30 else None


def whole_pixels(image, low, high, camera, edges=True):
    """A finder without any fraction of a pixel: the box of the mask, and three refusals."""
    mine, other = masks(image, low, high)
    if (found := box(mine)) is None:
        return "nothing of this colour"
    x, y, w, h = found
    if edges and min(x, y, camera.width - x - w, camera.height - y - h) < 3:
        return "cut off"
    if other[y + h - 3 : y + h + 6, max(x - 5, 0) : x + w + 5].sum() >= 4:
        return "occluded"
    return h, x + (w - 1) / 2


def from_centre_to_centre(image, low, high, camera):
    got = whole_pixels(image, low, high, camera)
    return got if isinstance(got, str) else (got[0] - 1, got[1])


def trusts_everything(image, low, high, camera):
    found = box(masks(image, low, high)[0])
    if found is None:
        return "nothing of this colour"
    x, _, w, h = found
    return h, x + (w - 1) / 2


def sees_no_edge(image, low, high, camera):
    return whole_pixels(image, low, high, camera, edges=False)


def refuses_everything(image, low, high, camera):
    return "occluded"


def axis_at_the_left_edge(image, low, high, camera):
    got, found = whole_pixels(image, low, high, camera), box(masks(image, low, high)[0])
    return got if isinstance(got, str) else (got[0], found[0])


def takes_any_colour(image, low, high, camera):
    return whole_pixels(image, 0, 179, camera)


def axis_first(image, low, high, camera):
    got = whole_pixels(image, low, high, camera)
    return got if isinstance(got, str) else got[::-1]


def paints_on_the_image(image, low, high, camera):
    got = reference(image, low, high, camera)
    image[:] = 0
    return got


def measures_nan(image, low, high, camera):
    return np.nan, np.nan


def fails_on_an_empty_mask(image, low, high, camera):
    v, u = np.nonzero(masks(image, low, high)[0])
    return v.max() - v.min() + 1.0, (u.min() + u.max()) / 2


def says_nothing(image, low, high, camera):
    return None


def stub(image, low, high, camera):
    raise NotImplementedError


judged = Judge(PROJECT, reference, SEEDS)


def test_the_packages_own_finder_gets_full_marks():
    assert judged(reference).mark >= 98


def test_a_finder_to_whole_pixels_gets_most_of_them():
    assert 80 <= judged(whole_pixels).mark < judged(reference).mark - 3


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (from_centre_to_centre, 82, "height: median error"),
        (trusts_everything, 75, "share measured all the same"),
        (sees_no_edge, 88, "share measured all the same"),
        (refuses_everything, 40, "whole landmarks: share refused: 1 "),
        (axis_at_the_left_edge, 78, "axis: median error"),
        (takes_any_colour, 60, "height: median error"),
        (axis_first, 60, "height: median error"),
        (paints_on_the_image, 90, "my_finder() changes its arguments in place"),
        (measures_nan, 0, "what my_finder() returns holds NaN"),
        (fails_on_an_empty_mask, 0, "my_finder() raised ValueError"),
        (says_nothing, 0, "is None; is there a return"),
        (stub, 0, "Nothing here yet"),
    ],
)
def test_a_wrong_finder_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)


def test_every_run_shows_each_kind_of_view():
    photos = judged.scenario(SEEDS[0])
    assert [photo.kind for photo in photos] == list(KINDS)
    for photo in photos:
        assert (photo.truth is None) == (photo.kind == "nothing")
        if photo.truth:
            assert bool(photo.truth.cut) == (photo.kind == "cut off")
            assert (photo.truth.hidden > 0) == (photo.kind == "occluded")


def test_its_picture_can_be_drawn():
    mine, theirs = judged.outcomes(trusts_everything)[0].values, judged.outcomes(reference)[0].values
    assert len(PROJECT.draw(mine, theirs).axes) == 2
