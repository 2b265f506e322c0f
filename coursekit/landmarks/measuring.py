r"""Lab 1: from a colour image to a landmark's outline, and from the outline to its height and symmetry axis.

``find_corners`` looks at the image, ``measure`` at nothing but points: it takes corners found in any other way as
well.  The "corners" are points all along the outline, its extremes among them; a corner detector such as OpenCV's
``goodFeaturesToTrack`` finds other points.  A measurement that cannot be trusted is a result, ``Rejected`` with its
reason, and never a silent number.

The image of an upright cylinder in a level camera has two edges that are exactly vertical, and two rims that
are halves of ellipses.  Between the edges, with s from -1 at the left one to 1 at the right one, a rim is

    v(s) = a + b s ± c √(1 - s²)        and its extreme is        a ± √(b² + c²),

so a rim is found by linear least squares over all its columns, to a small fraction of a pixel.  Far away c is small,
and √(b² + c²) of a noisy b and c is too large on average: beyond 8 m heights come out some 0.05 px too tall.

Source: the HSV segmentation is textbook (Szeliski 2022, section 3.1.2); outline and checks are Lab 1's own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.doors import LARGEST, as_numbers, number
from coursekit.geometry import Array
from coursekit.landmarks.outline import outline
from coursekit.pinhole import Camera
from coursekit.results import Rejected

COLOURS = {
    "red": (170, 8),
    "yellow": (22, 38),
    "green": (45, 75),
    "cyan": (80, 100),
    "blue": (102, 130),
    "magenta": (138, 165),
}
"""The hues of a landmark's colour, from … to, in OpenCV's half degrees (0 to 179; red runs through 0)."""

MIN_SATURATION, MIN_VALUE = 120, 18  # of 255: what counts as coloured at all
MIN_AREA = 30  # pixels: less is a speck
MIN_HEIGHT = 5.0  # pixels: less is no measurement
MARGIN = 3.0  # pixels from the picture's edge: closer, nobody can see whether the landmark ends there


@dataclass(frozen=True)
class LandmarkPixels:
    """``height_px`` from the highest to the lowest point of the outline; ``axis_px`` the column of the axis."""

    height_px: float
    axis_px: float


def measure(corners: ArrayLike, camera: Camera, *, aspect: float | None = None) -> LandmarkPixels | Rejected:
    r"""Height and symmetry axis of an upright cylinder from points of its outline, or why not.

    The height is max v - min v.  The axis lies at the mean of the two edges' *angles*, which is exact for a
    cylinder; it does not matter how many points there are on either side, where a mean over points leans to the
    side that has more of them.

    Parameters
    ----------
    corners : (n, 2) pixels [u, v] in any order: four corners of a rectangle, or any number along the outline that
        reach its extremes.  NaN says that something hides this part of the outline.
    aspect : the landmark's true width over its height, 2r/h, if known: then a width that does not fit the height
        is rejected too, whatever it is that hides the rest.

    Returns ``LandmarkPixels(height_px, axis_px)``, or ``Rejected`` with its reason: no corners, too few, not finite,
    outside the image, at its edge, too small, lopsided.

    Raises ValueError for what is not an (n, 2) array of numbers and for an aspect that is not positive, TypeError for
    a camera that is no ``Camera``.

    Source: derived in Lab 1; the report that it follows took the mean of all corners for the axis.

    >>> from coursekit.pinhole import COURSE_CAMERA
    >>> measure([[300, 100], [340, 100], [340, 300], [300, 300]], COURSE_CAMERA).height_px
    200.0
    >>> measure([[0, 100], [40, 100], [40, 300], [0, 300]], COURSE_CAMERA)
    Rejected(reason="cut off by the picture's left edge")
    """
    points = _points(corners)
    if not isinstance(camera, Camera):
        raise TypeError(f"camera: expected a pinhole.Camera, got {type(camera).__name__}")
    if len(points) == 0:
        return Rejected("no corners: too little of the landmark's colour in the picture for an outline")
    known = points[np.isfinite(points).all(axis=1)]
    (left, top), (right, bottom) = known.min(axis=0, initial=np.inf), known.max(axis=0, initial=-np.inf)
    if left < -0.5 or top < -0.5 or right > camera.width - 0.5 or bottom > camera.height - 0.5:
        box = f"u {left:.1f} to {right:.1f}, v {top:.1f} to {bottom:.1f}"
        return Rejected(f"corners outside the {camera.width} × {camera.height} picture: {box}")
    room = {"left": left, "top": top, "right": camera.width - 1 - right, "bottom": camera.height - 1 - bottom}
    if edges := [edge for edge in room if room[edge] < MARGIN]:
        return Rejected(f"cut off by the picture's {' and '.join(edges)} edge{'s' * (len(edges) > 1)}")
    if unknown := len(points) - len(known):
        return Rejected(f"occluded: {unknown} of {len(points)} corners are NaN, their part of the outline is not known")
    if len(points) < 4:
        return Rejected(f"too few corners: expected at least 4, got {len(points)}")
    if bottom - top < MIN_HEIGHT or right - left < 1:
        return Rejected(
            f"too small: {right - left:.1f} × {bottom - top:.1f} pixels, expected 1 × {MIN_HEIGHT:g} at least"
        )
    if reason := _lopsided(points, right - left):
        return Rejected(reason)
    bearings = camera.bearing([left, right])
    pixels = LandmarkPixels(float(bottom - top), float(camera.column(bearings.mean())))
    if aspect is not None and (reason := _misfit(pixels, bearings, camera, aspect)):
        return Rejected(reason)
    return pixels


def find_corners(image_bgr: NDArray[np.uint8], colour: str) -> Array:
    """Points of a landmark's outline, to a fraction of a pixel: (n, 2) pixels [u, v]; (0, 2) if there is none.

    The picture is cut into coloured and other pixels by hue, the largest piece is taken, and each of its edges is
    found anew where the picture's colour crosses half way from inside to outside.  The points run around the
    outline from its top left corner clockwise.  Where something nearer stands in front of it the outline is not
    known, and the points there are NaN: something nearer reaches lower down in the picture, so it is what shows
    just below the landmark's bottom, or beside its edge at the bottom.

    Its limits: it sees one landmark at a time, the largest piece of the colour, so of two with one colour the smaller
    is lost, and a larger thing of that colour (a car, a door) is taken instead; it knows six saturated paints and no
    other, no grey, no pastel, and a landmark in two colours only by one of them.  A photograph of the world at large is
    full of such pieces: ``measure`` rejects most of them, and nearly all if it is told the landmark's ``aspect``.

    Parameters
    ----------
    image_bgr : (h, w, 3) uint8; blue, green, red, as OpenCV has it.
    colour : one of ``COLOURS``.

    Raises ValueError for another kind of picture (grey, float) and for a colour without a name.

    Source: Szeliski (2022), section 3.1.2, for the hue; the outline is derived in Lab 1.

    >>> image = np.full((480, 640, 3), 128, np.uint8)
    >>> image[100:301, 300:341] = (255, 255, 0)                    # 41 columns and 201 rows of cyan
    >>> corners = find_corners(image, "cyan")
    >>> np.ptp(corners, axis=0).round(1), find_corners(image, "red").shape
    (array([ 41., 201.]), (0, 2))
    """
    import cv2  # here and below: ``measure`` and the package's other estimators are there without it

    image = _picture(image_bgr)
    hsv = cv2.cvtColor(cv2.GaussianBlur(image, (3, 3), 0), cv2.COLOR_BGR2HSV)
    mask = segment(hsv, colour)
    box = _largest_piece(mask)
    if box is None:
        return np.empty((0, 2))
    coloured = cv2.inRange(hsv, (0, MIN_SATURATION, MIN_VALUE), (179, 255, 255))
    return outline(image, mask, coloured & ~mask, box)


def segment(hsv: NDArray[np.uint8], colour: str) -> NDArray[np.uint8]:
    """Mask, 255 where a picture in OpenCV's HSV has the landmark's colour, else 0.  Red's hues run through 0."""
    import cv2

    if not isinstance(colour, str) or colour not in COLOURS:
        raise ValueError(f"colour: expected one of {', '.join(COLOURS)}, got {colour!r}")
    low, high = COLOURS[colour]
    spans = [(low, high)] if low <= high else [(low, 179), (0, high)]
    masks = [cv2.inRange(hsv, (a, MIN_SATURATION, MIN_VALUE), (b, 255, 255)) for a, b in spans]
    return np.asarray(masks[0] if len(masks) == 1 else masks[0] | masks[1])


def _largest_piece(mask: NDArray[np.uint8]) -> tuple[int, int, int, int] | None:
    """Column, row, width and height of the largest connected piece; None when all are specks."""
    import cv2

    _, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    areas = stats[1:, cv2.CC_STAT_AREA]
    if not areas.size or areas.max() < MIN_AREA:
        return None
    x, y, w, h = stats[1 + int(areas.argmax()), :4]
    return int(x), int(y), int(w), int(h)


def _lopsided(points: Array, width: float) -> str:
    """Why the outline cannot be that of an upright thing; empty if it can.

    Its convex hull is cut across near the top, half way down and near the bottom.  The middles of the cuts lie
    on one vertical line if nothing is missing on one side: curved rims and uneven points do not disturb that much.
    """
    top, bottom = points[:, 1].min(), points[:, 1].max()
    hull = _hull(points)
    if len(hull) < 3:
        return "lopsided: all corners lie on one line"
    a, b = hull, np.roll(hull, -1, axis=0)
    middles = []
    for v in top + np.array([0.15, 0.5, 0.85]) * (bottom - top):
        crossing = (np.minimum(a[:, 1], b[:, 1]) <= v) & (v <= np.maximum(a[:, 1], b[:, 1])) & (a[:, 1] != b[:, 1])
        p, q = a[crossing], b[crossing]
        u = p[:, 0] + (v - p[:, 1]) / (q[:, 1] - p[:, 1]) * (q[:, 0] - p[:, 0])
        middles.append((u.min() + u.max()) / 2)
    skew = float(np.ptp(middles))
    if skew > max(2.5, 0.12 * width):
        return f"lopsided: its middle wanders by {skew:.1f} pixels from top to bottom, of a width of {width:.1f}"
    return ""


def _hull(points: Array) -> Array:
    """The corners of the convex hull, counter-clockwise, (k, 2): Andrew's monotone chain (1979)."""
    ordered = np.unique(points, axis=0).tolist()
    corners: list[list[float]] = []
    for way in (ordered, ordered[::-1]):  # the lower chain from left to right, the upper one back
        chain: list[list[float]] = []
        for x, y in way:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                    break
                chain.pop()
            chain.append([x, y])
        corners += chain[:-1]
    return np.array(corners)


def _misfit(pixels: LandmarkPixels, bearings: Array, camera: Camera, aspect: float) -> str:
    """Does the width fit the height?  Both are measured in landmark heights, so no length needs to be known."""
    if not 1 / LARGEST < number(aspect, "aspect") < LARGEST:
        raise ValueError(f"aspect: expected a width over a height > 0, got {aspect!r}")
    depth = camera.fy / pixels.height_px + aspect / 2
    expected = 2 * np.arcsin(aspect / 2 * np.cos(bearings.mean()) / depth)
    share = float((bearings[0] - bearings[1]) / expected)
    slack = 0.05 + 1.0 / (expected * camera.fx)  # one pixel, and five per cent
    return f"occluded: {100 * share:.0f} % as wide as a whole landmark of this height" if abs(share - 1) > slack else ""


def _points(corners: ArrayLike) -> Array:
    try:
        points = as_numbers(corners, "corners")
    except (TypeError, ValueError):
        raise ValueError(f"corners: expected (n, 2) numbers, got {corners!r}") from None
    if points.size == 0:
        return np.empty((0, 2))
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"corners: expected shape (n, 2), got {points.shape}")
    return points


def _picture(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        got = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        raise ValueError(f"image_bgr: expected a colour picture (h, w, 3) of uint8, got {got}")
    if min(image.shape[:2]) < 8:
        raise ValueError(f"image_bgr: expected at least 8 × 8 pixels, got {image.shape}")
    return image
