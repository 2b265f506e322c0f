"""What counts as a picture: 8-bit, grey or in colour, and large enough."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

SMALLEST = 32  # pixels: a picture smaller than this holds no feature


def as_grey(image: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    """A grey (h, w) uint8 image from grey, BGR or BGRA, or a ValueError that says what came instead."""
    try:
        image = np.asarray(image)
    except ValueError:
        raise ValueError(f"{name}: expected a picture, got rows of different lengths") from None
    if image.dtype != np.uint8:
        nan = " with NaN" if image.dtype.kind == "f" and np.isnan(image).any() else ""
        raise ValueError(f"{name}: expected uint8 grey levels 0 to 255, got {image.dtype}{nan}")
    channels = image.shape[2] if image.ndim == 3 else 1
    if image.ndim not in (2, 3) or channels not in (1, 3, 4):
        raise ValueError(f"{name}: expected shape (h, w), (h, w, 3) or (h, w, 4), got {image.shape}")
    if min(image.shape[:2]) < SMALLEST:
        raise ValueError(f"{name}: expected at least {SMALLEST} pixels each way, got {image.shape[:2]}")
    if channels == 1:
        return np.ascontiguousarray(image.reshape(image.shape[:2]))
    code = cv2.COLOR_BGR2GRAY if channels == 3 else cv2.COLOR_BGRA2GRAY
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), code))
