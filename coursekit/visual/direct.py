r"""The direct method: lay the picture on the map at every particle and see how well it fits.

The report's first idea, given up because it "would not run at all".  Two things make it run: a pyramid (a picture
eight times smaller has 64 times fewer pixels, and forgives a pose that is a few pixels off), and asking for all the
particles' windows in one call.

Source: Adelson et al. (1984) for the pyramid; Lewis (1995) for normalised correlation.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array
from coursekit.visual.frames import image_from_odometry
from coursekit.visual.pictures import as_grey

SCALES = np.linspace(0.9, 1.1, 21)
MOST_PIXELS = 1 << 20  # of windows looked up in one go; more would only leave the cache


class DirectMatcher:
    """Compares a picture with the map at given poses, on level ``level`` of a pyramid (each level halves).

    Parameters
    ----------
    map_image : as for ``MapMatcher``.
    level : 3 compares 50 × 50 pixels where the camera took 400 × 400.
    independent : how many of those pixels count as independent.  Neighbours err together (a caustic is tens of
        pixels long), so far fewer than there are; it sets how sharp the likelihood is.
    contrast_floor : grey levels; a window whose contrast is far below it fits nothing: it may be light.

    Raises ValueError for a map that is no image or too small for the level, and for settings out of range.

    >>> rng = np.random.default_rng(0)
    >>> blobs = cv2.GaussianBlur(rng.integers(0, 256, (200, 300), dtype=np.uint8), (0, 0), 3.0)
    >>> map_image = cv2.normalize(blobs, None, 0, 255, cv2.NORM_MINMAX)
    >>> at = DirectMatcher(map_image, level=1).log_likelihood(map_image[30:151, 100:251])
    >>> here, away = at(np.array([[175.0, -90.0, np.pi / 2], [190.0, -90.0, np.pi / 2]]))  # away: 15 px east of it
    >>> bool(here > away + 50)
    True

    Source: Adelson et al. (1984); Lewis (1995).
    """

    def __init__(
        self, map_image: NDArray[np.uint8], level: int = 3, independent: float = 60.0, contrast_floor: float = 5.0
    ) -> None:
        if level < 0 or not independent > 2 or not contrast_floor > 0:
            raise ValueError(
                f"expected level ≥ 0, independent > 2, contrast_floor > 0, got {level}, {independent}, {contrast_floor}"
            )
        self.level, self.independent, self.contrast_floor = level, float(independent), float(contrast_floor)
        self._map = shrink(as_grey(map_image, "map_image"), level)

    def log_likelihood(self, image: NDArray[np.uint8], scale: float = 1.0) -> Callable[[Array], Array]:
        r"""log p(image | x) + const for ``particles.weigh``:  -(k/2) log(1 - ρ²), ρ the correlation of the two.

        The frame is taken to be gain · window + offset + noise.  At the best gain, offset and noise level, the
        likelihood of k independent pixels is (1 - ρ²)^(-k/2); that is why brightness does not matter.

        Parameters
        ----------
        scale : pixels of the map per pixel of the picture.

        States are poses in the odometry's frame, (n, 3).  A uniform picture says nothing: 0 everywhere.
        """
        correlate = self.correlation(image, scale)

        def at(states: Array) -> Array:
            rho = np.clip(correlate(states), 0.0, 1 - 1e-9)
            return -0.5 * self.independent * np.log1p(-(rho**2))

        return at

    def scale(self, image: NDArray[np.uint8], state: Array, candidates: Array = SCALES) -> float:
        """The scale at which the picture fits best at one pose (3,): how high the camera floats."""
        return float(max(candidates, key=lambda scale: self.correlation(image, scale)(state[None])[0]))

    def correlation(self, image: NDArray[np.uint8], scale: float = 1.0) -> Callable[[Array], Array]:
        """ρ in [-1, 1] between the picture and the map's window at each state, (n, 3) → (n,)."""
        if not (np.isfinite(scale) and scale > 0):
            raise ValueError(f"scale: expected pixels of the map per pixel > 0, got {scale}")
        grey = as_grey(image, "image")
        small = shrink(grey, self.level)
        step = 2**self.level
        # Where the small picture's pixels lie, as seen from the middle of the full one.
        v, u = np.mgrid[: small.shape[0], : small.shape[1]].astype(np.float32) * step
        u, v = u - (grey.shape[1] - 1) / 2, v - (grey.shape[0] - 1) / 2
        seen = small.ravel() - small.mean()
        norm = float(np.sqrt(seen @ seen))

        def at(states: Array) -> Array:
            poses = image_from_odometry(states)
            if norm < 1e-6:
                return np.zeros(len(poses))
            block = max(1, min(MOST_PIXELS // seen.size, 32_000 // small.shape[0]))
            parts = [poses[k : k + block] for k in range(0, len(poses), block)]
            return np.concatenate([self._correlate(part, u, v, seen / norm, scale / step) for part in parts])

        return at

    def _correlate(self, poses: Array, u: Array, v: Array, seen: Array, shrunk: float) -> Array:
        x, y, yaw = (poses[:, j, None, None].astype(np.float32) for j in range(3))
        c, s = np.float32(shrunk) * np.cos(yaw), np.float32(shrunk) * np.sin(yaw)
        on_u, on_v = c * u - s * v + x / 2**self.level, s * u + c * v + y / 2**self.level
        # One tall picture, window under window: a remap for each of them would cost more than the pixels do.
        tall = (-1, u.shape[1])
        windows = cv2.remap(self._map, on_u.reshape(tall), on_v.reshape(tall), cv2.INTER_LINEAR,
                            borderMode=cv2.BORDER_REPLICATE).reshape(len(poses), -1)  # fmt: skip
        # seen has mean zero, so the window's own mean drops out of the product.
        contrast = np.einsum("np,np->n", windows, windows) / len(seen) - windows.mean(axis=1) ** 2
        spread = np.sqrt(len(seen) * (np.maximum(contrast, 0) + self.contrast_floor**2))
        return np.asarray(np.einsum("np,p->n", windows, seen) / spread, dtype=float)


def shrink(grey: NDArray[np.uint8], level: int) -> NDArray[np.float32]:
    """``level`` halvings, each after a blur: pixel i of the result lies on pixel 2^level · i of the image."""
    small = grey.astype(np.float32) - np.float32(grey.mean())
    for _ in range(level):
        if min(small.shape) < 8:
            raise ValueError(f"image: {grey.shape} is too small for {level} halvings")
        small = cv2.pyrDown(small)
    return small
