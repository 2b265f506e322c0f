"""Square tags found in a picture: OpenCV decodes them, and straight lines fitted to their sides place the corners.

OpenCV looks for dark quadrilaterals at several thresholds, each the mean of a window around a pixel.  Two of its
defaults lose tags in photographs.  Its widest window is narrower than the cells of a large, blurred tag, which leaves
no edge in it, so it is widened here; and a tag whose cells are some two pixels wide falls apart under any threshold, so
the picture is searched a second time, enlarged.

Source: Garrido-Jurado et al. (2014) for OpenCV's detector; Olson (2011) for the AprilTag families.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array

FAMILIES: dict[str, int] = {
    name.removeprefix("DICT_").lower(): getattr(cv2.aruco, name)
    for name in sorted(dir(cv2.aruco))
    if name.startswith("DICT_")
}
"""The families of tags that OpenCV can decode, by name: "apriltag_36h11", "aruco_original", "4x4_50", …"""

WIDEST_WINDOW = 53  # pixels, of the adaptive threshold; OpenCV's default is 23
BORDER = 3  # pixels that a corner has to keep from the picture's edge
REACHES = (2.5, 10.0)  # pixels to either side in which an edge is looked for; the wide one serves where all is blurred
CONTRAST = 15  # grey levels that a side must rise by


@dataclass(frozen=True, eq=False)
class Detection:
    """A tag in a picture: its id, and the corners of its black square, (4, 2) pixels, clockwise from the top left.

    ``cells`` is how many cells the black square has across, its black border included.

    >>> Detection(id=3, corners=np.array([[10.0, 10], [50, 10], [50, 50], [10, 50]])).cells
    8
    """

    id: int
    corners: Array
    cells: int = 8


def detect(
    image: NDArray[np.uint8],
    family: str = "apriltag_36h11",
    *,
    enlarge: float = 2.0,
    parameters: Mapping[str, float] | None = None,
) -> list[Detection]:
    """Every tag that is wholly in the picture; an empty list is a result like any other.

    OpenCV's corners are good to a pixel or so; they are moved to where straight lines fitted to the four sides meet.
    Tags too near the picture's border, too oblique or too pale for that are left out.

    Parameters
    ----------
    image : (h, w) or (h, w, 1) grey, or (h, w, 3) BGR, uint8.
    family : one of ``FAMILIES``.  The fewer cells a family's tags have, the likelier it is that something else in a
        picture looks like one of them.
    enlarge : the picture is searched as it is and so many times larger, for tags with cells of some two pixels.  This
        takes four times as long as the picture as it is; 1 leaves it out.
    parameters : OpenCV's ``cv2.aruco.DetectorParameters`` by name, for a picture unlike others.  It leads to the tags
        and has no effect on their fitted corners.

    Raises ValueError for another kind of picture, an unknown family or parameter, an ``enlarge`` outside 1 to 8, and
    a parameter's value that OpenCV refuses; TypeError for values of another type.

    >>> tag = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(FAMILIES["5x5_100"]), 42, 70)
    >>> picture = cv2.copyMakeBorder(tag, 30, 30, 60, 60, cv2.BORDER_CONSTANT, value=255)      # grey, (130, 190)
    >>> seen, = detect(picture, "5x5_100", parameters={"errorCorrectionRate": 0.3})
    >>> seen.id, seen.corners.round(1).tolist()
    (42, [[59.5, 29.5], [129.5, 29.5], [129.5, 99.5], [59.5, 99.5]])

    Source: Garrido-Jurado et al. (2014); Olson (2011).
    """
    grey = _grey(image)
    if isinstance(enlarge, bool) or not isinstance(enlarge, (int, float, np.integer, np.floating)):
        raise TypeError(f"enlarge: expected a number from 1 to 8, got {enlarge!r}")
    if not 1 <= enlarge <= 8:
        raise ValueError(f"enlarge: expected a number from 1 to 8, got {enlarge}")
    detector = _detector(*_settings(family, parameters))
    settings = detector.getDetectorParameters()
    cells = dictionary(family).markerSize + 2 * settings.markerBorderBits
    rough: list[tuple[int, Array]] = []
    for scale in (1.0, float(enlarge)) if enlarge > 1 else (1.0,):
        corners, ids = _search(detector, grey, scale)
        for found, corner in zip(ids, corners, strict=True):
            if not any(found == other and _same_place(corner, known) for other, known in rough):
                rough.append((found, corner))
    pictures = (grey, 255 - grey) if settings.detectInvertedMarker else (grey,)
    out = []
    for found, corner in rough:
        fits = (_fitted(picture, corner, cells, reach) for reach in REACHES for picture in pictures)
        best = next((fit for fit in fits if fit is not None), None)
        out += [] if best is None else [Detection(found, best, cells)]
    return out


@lru_cache(maxsize=8)
def dictionary(family: str) -> cv2.aruco.Dictionary:
    """OpenCV's dictionary of a family's codes."""
    return cv2.aruco.getPredefinedDictionary(FAMILIES[family])


def _search(detector: cv2.aruco.ArucoDetector, grey: NDArray[np.uint8], scale: float) -> tuple[list[Array], list[int]]:
    """OpenCV's corners, each (4, 2) in pixels of the picture, and ids, from the picture enlarged ``scale`` times."""
    shape = tuple(round(scale * n) for n in grey.shape[::-1])
    larger = grey if scale == 1 else cv2.resize(grey, shape, interpolation=cv2.INTER_CUBIC)
    corners, ids, _ = detector.detectMarkers(larger)
    if ids is None:
        return [], []
    per_pixel = np.array(larger.shape[::-1]) / grey.shape[::-1]
    # A whole number is a pixel's centre, so the picture's corner, at -0.5, is what enlarging leaves in its place.
    return [(c.reshape(4, 2) + 0.5) / per_pixel - 0.5 for c in corners], [int(i) for i in ids.ravel()]


def _same_place(corners: Array, others: Array) -> bool:
    """Do two quadrilaterals lie on each other?"""
    apart = np.linalg.norm(corners.mean(axis=0) - others.mean(axis=0))
    return bool(apart < 0.25 * np.linalg.norm(others[2] - others[0]))


def _fitted(grey: NDArray[np.uint8], corners: Array, cells: int, reach: float, samples: int = 24) -> Array | None:
    """Corners where lines meet that are fitted to the four sides, or None where a side cannot be told."""
    for _ in range(4):  # noise pulls the centre of a rise to the middle of the window, so move the window there too
        start, end = corners, np.roll(corners, -1, axis=0)
        along = end - start
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = along / length
        outward = np.stack([along[:, 1], -along[:, 0]], axis=-1)
        # Look no farther than one cell to either side: beyond are other edges.
        depth = 2 * np.abs(np.sum((0.5 * (start + end) - corners.mean(axis=0)) * outward, axis=1, keepdims=True))
        if np.min(length) < cells or _leaves(corners, grey.shape):
            return None
        s = np.linspace(0.12, 0.88, samples) * length
        t = np.linspace(-1, 1, 21) * np.clip(depth / cells, 1.0, reach)
        places = (start[:, None, None] + s[..., None, None] * along[:, None, None]
                  + t[:, None, :, None] * outward[:, None, None])  # fmt: skip
        u, v = (places[..., i].reshape(4 * samples, -1).astype(np.float32) for i in (0, 1))
        brightness = (
            cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            .reshape(4, samples, -1)
            .astype(float)
        )
        # From dark to bright going out, the edge is the centre of the rise; what falls belongs to the tag's inside.
        rise = np.clip(np.diff(brightness, axis=2), 0, None)
        if np.min(rise.sum(axis=2).mean(axis=1)) < CONTRAST:
            return None
        total = np.maximum(rise.sum(axis=2), 1e-6)
        offset = (rise * (0.5 * (t[:, 1:] + t[:, :-1]))[:, None]).sum(axis=2) / total
        from_middle = s - 0.5 * length
        slope = np.sum(offset * from_middle, axis=1) / np.sum(from_middle**2, axis=1)
        points = 0.5 * (start + end) + outward * offset.mean(axis=1, keepdims=True)
        directions = along + outward * slope[:, None]
        corners = np.array([_meet(points[i - 1], directions[i - 1], points[i], directions[i]) for i in range(4)])
    return corners


def _leaves(corners: Array, shape: tuple[int, ...]) -> bool:
    h, w = shape[:2]
    return bool(np.any(corners < BORDER) or np.any(corners > np.array([w, h]) - 1 - BORDER))


def _meet(p: Array, d: Array, q: Array, e: Array) -> Array:
    """Where the line p + a d meets the line q + b e."""
    a, _ = np.linalg.solve(np.stack([d, -e], axis=-1), q - p)
    return np.asarray(p + a * d)


def _settings(family: str, parameters: Mapping[str, float] | None) -> tuple[str, tuple[tuple[str, float], ...]]:
    """Family and parameters, checked by name, in a form that can be a key."""
    if not isinstance(family, str):
        raise TypeError(f"family: expected one of FAMILIES, got {family!r}")
    if family not in FAMILIES:
        raise ValueError(f"family: expected one of {', '.join(FAMILIES)}, got {family!r}")
    if parameters is not None and not isinstance(parameters, Mapping):
        raise TypeError(f"parameters: expected a mapping from names to values, got {type(parameters).__name__}")
    given = dict(parameters or {})
    kind = cv2.aruco.DetectorParameters
    known = [name for name in dir(kind) if name[0] != "_" and not callable(getattr(kind, name))]
    for name, value in given.items():
        if name not in known:
            raise ValueError(f"parameters: expected some of {', '.join(known)}, got {name!r}")
        if not isinstance(value, (int, float, np.integer, np.floating)):
            raise TypeError(f"parameters: {name}: expected a number, got {value!r}")
        if not np.isfinite(value):
            raise ValueError(f"parameters: {name}: expected a finite number, got {value!r}")
    return family, tuple(sorted(given.items()))


@lru_cache(maxsize=16)
def _detector(family: str, given: tuple[tuple[str, float], ...]) -> cv2.aruco.ArucoDetector:
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMax = WIDEST_WINDOW
    for name, value in given:
        try:
            setattr(parameters, name, value)
        except TypeError:
            raise TypeError(f"parameters: {name}: expected a whole number, got {value!r}") from None
    detector = cv2.aruco.ArucoDetector(dictionary(family), parameters)
    try:  # OpenCV looks at its parameters when it meets a tag, so let it meet one here
        tag = cv2.aruco.generateImageMarker(dictionary(family), 0, 90)
        detector.detectMarkers(cv2.copyMakeBorder(tag, 20, 20, 20, 20, cv2.BORDER_CONSTANT, value=255))
    except cv2.error as refused:
        raise ValueError(f"parameters: OpenCV refuses {dict(given)}: {refused.err}") from None
    return detector


def _grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    image = np.asarray(image)
    shape = image.shape
    if image.dtype != np.uint8 or not image.size or not (len(shape) == 2 or (len(shape) == 3 and shape[2] in (1, 3))):
        raise ValueError(f"image: expected (h, w), (h, w, 1) or (h, w, 3) uint8, got {shape} {image.dtype}")
    if len(shape) == 3 and shape[2] == 3:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    return np.ascontiguousarray(image.reshape(shape[:2]))
