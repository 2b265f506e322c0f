"""SIFT features of a picture of any size, found tile by tile so that memory does not grow with the picture.

SIFT keeps some sixty copies of what it looks at, blurred and enlarged: 230 bytes a pixel, 15 GB for a map of 8,000 by
8,000 pixels.  A feature depends on its neighbourhood alone, so a large picture is cut into tiles that overlap, and each
feature is taken from the tile in whose core it lies.

Source: Lowe (2004) for the features.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array

FAINTEST = 0.01  # contrast of a feature, a quarter of SIFT's default: a moonscape has no stronger ones
WHOLE = 1 << 21  # pixels: a picture up to this size is looked at in one piece
CORE, OVERLAP = 768, 128  # pixels; multiples of 128, so that all tiles halve on the same grid


def features(grey: NDArray[np.uint8], most: int = 0) -> tuple[Array, NDArray[np.uint8]]:
    """Features of a grey picture, all or the ``most`` strongest: places (n, 2) [u, v], and descriptors (n, 128).

    A descriptor's entries are whole numbers, 0 to 255: as bytes they take a quarter of the memory of OpenCV's floats.
    """
    # Without precise upscaling SIFT puts every feature a quarter of a pixel off, in the picture's own axes.
    precise: dict[str, Any] = {"enable_precise_upscale": True, "contrastThreshold": FAINTEST}
    detector = cv2.SIFT.create(nfeatures=most, **precise)
    found: list[tuple[Array, NDArray[np.uint8], Array]] = []
    for core_u, core_v, around_u, around_v in _tiles(grey.shape):
        keypoints, descriptors = detector.detectAndCompute(np.ascontiguousarray(grey[around_v, around_u]), None)
        if not keypoints:
            continue
        places = np.array([k.pt for k in keypoints]) + np.array([around_u.start, around_v.start])
        # Pixels are centred on whole numbers, so a core reaches from half a pixel before its first one.
        low = np.array([core_u.start, core_v.start]) - 0.5
        high = np.array([core_u.stop, core_v.stop]) - 0.5
        own = np.all((low <= places) & (places < high), axis=1)
        found.append((places[own], descriptors[own].astype(np.uint8), np.array([k.response for k in keypoints])[own]))
    if not found:
        return np.empty((0, 2)), np.empty((0, 128), np.uint8)
    all_places, all_descriptors, response = (np.concatenate(parts) for parts in zip(*found, strict=True))
    if not most or len(found) == 1:
        return all_places, all_descriptors
    strongest = np.argsort(-response, kind="stable")[:most]
    return all_places[strongest], all_descriptors[strongest]


def _tiles(shape: tuple[int, ...]) -> Iterator[tuple[slice, slice, slice, slice]]:
    """Cores that cover the picture once, and what is looked at around each: u and v of the one and of the other."""
    h, w = shape
    core = max(h, w) if h * w <= WHOLE else CORE
    for v in range(0, h, core):
        for u in range(0, w, core):
            yield (
                slice(u, min(u + core, w)),
                slice(v, min(v + core, h)),
                slice(max(u - OVERLAP, 0), min(u + core + OVERLAP, w)),
                slice(max(v - OVERLAP, 0), min(v + core + OVERLAP, h)),
            )
