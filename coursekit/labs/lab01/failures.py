"""Lab 1's failures: four ways to get a wrong number, or a number where there is none, out of a good picture."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array
from coursekit.landmarks import LandmarkPixels, find_corners, measure, segment
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from coursekit.teaching.failures import Failure
from coursekit.world.arena import Cylinder
from coursekit.world.camera import render

Image = NDArray[np.uint8]


def axis_by_angles(corners: Array) -> float:
    """The axis from the two edges alone, at the mean of their angles: the package's way."""
    got = measure(corners, COURSE_CAMERA)
    return got.axis_px if isinstance(got, LandmarkPixels) else np.nan


def axis_by_the_mean_of_corners(corners: Array) -> float:
    """The report's rule: mid-x below eight corners, the mean of all from eight on."""
    u = corners[:, 0]
    return float((u.min() + u.max()) / 2 if len(corners) < 8 else u.mean())


def axis_stays_when_corners_crowd(axis: Callable[[Array], float]) -> bool:
    """Ten more corners on one edge of the same outline are no news about its axis."""
    outline = np.array([[300.0, 100.0], [340.0, 100.0], [340.0, 200.0], [340.0, 300.0], [300.0, 300.0], [300.0, 200.0],
                        [320.0, 98.0], [320.0, 302.0]])  # fmt: skip
    crowd = np.c_[np.full(10, 340.0), np.linspace(110, 290, 10)]
    return abs(axis(np.vstack([outline, crowd])) - axis(outline)) < 0.1


def trust_what_is_whole(corners: Array) -> bool:
    """``measure``: nothing that comes close to the picture's edge is trusted."""
    return bool(measure(corners, COURSE_CAMERA))


def trust_what_is_not_skewed(corners: Array) -> bool:
    """The report's check: drop a landmark if the middles of its top and its bottom band differ."""
    order = corners[corners[:, 1].argsort()]
    band = max(2, len(order) // 4)
    return bool(abs(order[:band, 0].mean() - order[-band:, 0].mean()) < 0.2 * np.ptp(corners[:, 0]))


def refuses_what_the_picture_cuts(trust: Callable[[Array], bool]) -> bool:
    """A rectangle that slides out of the picture is trusted while it is whole, and no longer."""
    for left in (300.0, 20.0, -10.0, -25.0):
        seen = np.clip([[left, 100], [left + 40, 100], [left + 40, 300], [left, 300]], 0, 639)
        if trust(seen.astype(float)) != (left > 5):
            return False
    return True


def height_between_edges(image: Image) -> float:
    """``measure`` on ``find_corners``: from where the landmark begins to where it ends."""
    got = measure(find_corners(image, "cyan"), COURSE_CAMERA)
    return got.height_px if isinstance(got, LandmarkPixels) else np.nan


def height_between_pixel_centres(image: Image) -> float:
    """Last row minus first row of the mask: from the middle of one pixel to the middle of another."""
    hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
    rows = np.flatnonzero(segment(hsv, "cyan").any(axis=1))
    return float(rows[-1] - rows[0])


def has_no_height_bias(height: Callable[[Image], float]) -> bool:
    """Over a dozen distances the height is right on average, to a fifth of a pixel."""
    errors = []
    for distance in np.linspace(1.5, 9.0, 12):
        image = render(COURSE_CAMERA, np.zeros(3), [Cylinder((distance, 0.0))])
        errors.append(height(image) - project_cylinder(distance, 0.0, COURSE_CAMERA, 0.5, 0.1).height_px)
    return bool(abs(np.mean(errors)) < 0.2)


def sees_hue(image: Image) -> bool:
    """Is there a cyan landmark?  By hue: ``find_corners``."""
    return len(find_corners(image, "cyan")) > 0


def sees_brightness(image: Image) -> bool:
    """Is there a cyan landmark?  By thresholds on blue, green and red, tuned on a bright day."""
    return int(cv2.inRange(image, (140, 130, 0), (255, 255, 90)).sum()) > 50 * 255


def finds_it_in_any_light(sees: Callable[[Image], bool]) -> bool:
    """The same landmark at noon and at dusk, and an empty room that must stay empty."""
    cyan, nothing = [Cylinder((2.0, 0.0))], list[Cylinder]()
    lights = (0.3, 0.5, 0.8, 1.2)
    found = [sees(render(COURSE_CAMERA, np.zeros(3), cyan, light=light)) for light in lights]
    ghosts = [sees(render(COURSE_CAMERA, np.zeros(3), nothing, light=light)) for light in lights]
    return all(found) and not any(ghosts)


Failure(
    "lab01.mean_of_corners",
    "The cylinder report, assignment 1: from eight corners on, the axis is the mean x of all of them.",
    axis_by_the_mean_of_corners, axis_by_angles, axis_stays_when_corners_crowd,
    "A mean over corners leans to the side that has more corners, and corners come where the picture is rough.",
)  # fmt: skip
Failure(
    "lab01.skew_check_alone",
    "The cylinder report, assignments 2 and 3: a skew check is to drop landmarks at the edge of the view.",
    trust_what_is_not_skewed, trust_what_is_whole, refuses_what_the_picture_cuts,
    "The edge of a picture cuts a cylinder straight down: half of one is as upright as a whole one.",
)  # fmt: skip
Failure(
    "lab01.pixel_centres",
    "The cylinder report, assignment 1: height = max y − min y of corners that are pixels.",
    height_between_pixel_centres, height_between_edges, has_no_height_bias,
    "From the first to the last of n pixels it is n − 1: every height is about one pixel short.",
)  # fmt: skip
Failure(
    "lab01.brightness_threshold",
    "A habit of many first programs: colour by thresholds on blue, green and red.",
    sees_brightness, sees_hue, finds_it_in_any_light,
    "At dusk every channel falls below its threshold at once; the hue stays where it was.",
)  # fmt: skip
