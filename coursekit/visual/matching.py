r"""Where on the map was this picture taken?  Features, pairs, a consensus, and how far to trust it.

The answer's frame is the map image's: x to the right and y down in pixels of the map, yaw clockwise from north
(the top of the map), a whole number of pixels being a pixel's centre.  ``Fix.belief`` is the same in the
odometry's frame.

Source: Lowe (2004) for SIFT and the ratio test; Muja & Lowe (2009) for FLANN; Fischler & Bolles (1981) for RANSAC;
Lange, Little & Taylor (1989) for the t-distributed residuals.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.gaussian import Gaussian, symmetrize
from coursekit.geometry import Array
from coursekit.results import Rejected
from coursekit.visual.frames import odometry_from_image

SMALLEST = 32  # pixels: a picture smaller than this holds no feature worth the name
FAINTEST = 0.01  # contrast of a feature, a quarter of SIFT's default: a moonscape has no stronger ones
FREEDOM = 4.0  # of the t-distribution that residuals follow: tails heavier than a Gaussian's
GRID = 0.004  # px: what interpolation does to a position, unseen by any residual


@dataclass(frozen=True, eq=False)
class Fix:
    """Where a picture was taken, by its match with the map.  Counts as true.

    x, y : the map's pixel under the picture's centre.     yaw : clockwise from north, (-π, π].
    inliers : pairs of features that agree.     homography : (3, 3), the picture's pixels to the map's.
    scale : pixels of the map per pixel of the picture.     cov : (4, 4) of [x, y, yaw, scale], from the
    inliers' residuals; 1 px and 0.01 rad for a fix made by hand without one.
    rms : of the inliers' residuals, px of the map.     pairs : (inliers, 4) [u, v on the picture, u, v on the map].
    """

    x: float
    y: float
    yaw: float
    inliers: int
    homography: Array
    scale: float = 1.0
    cov: Array = field(default_factory=lambda: np.diag([1.0, 1.0, 1e-4, 1e-4]))
    rms: float = 0.0
    pairs: Array = field(default_factory=lambda: np.empty((0, 4)))

    @property
    def pose(self) -> Array:
        """[x, y, yaw] in the image's frame, (3,)."""
        return np.array([self.x, self.y, self.yaw])

    @property
    def belief(self) -> Gaussian:
        """N over [x east, y north, θ counter-clockwise from east], pixels and radians: the odometry's frame."""
        flip = np.array([1.0, -1.0, -1.0])
        return Gaussian(odometry_from_image(self.pose), self.cov[:3, :3] * np.outer(flip, flip))


class MapMatcher:
    """Matches pictures with one map, whose features are computed once, here.

    Parameters
    ----------
    map_image : (h, w) grey, (h, w, 3) BGR or (h, w, 4) BGRA, uint8.
    max_features : the strongest features of a picture are used, at most so many.
    ratio : Lowe's test: the nearest descriptor on the map must be closer than ratio times the second nearest.
    reprojection : px of the map; pairs that agree within it are inliers.
    min_inliers : fewer are rejected.
    scales : (low, high) plausible pixels of the map per pixel of the picture.
    max_skew : the longest over the shortest axis of the homography's image of a circle.

    Building the search trees draws from OpenCV's own generator; it is seeded first, so that the same map always
    gives the same matcher.

    Raises ValueError for settings that make no sense, a map that is no uint8 image, and one so plain that nothing
    on it can be told apart.
    """

    def __init__(
        self,
        map_image: NDArray[np.uint8],
        *,
        max_features: int = 600,
        ratio: float = 0.75,
        reprojection: float = 3.0,
        min_inliers: int = 12,
        scales: tuple[float, float] = (0.5, 2.0),
        max_skew: float = 1.25,
    ) -> None:
        if max_features < 1 or min_inliers < 4:  # a homography has 8 unknowns, a pair gives 2
            raise ValueError(f"expected max_features ≥ 1 and min_inliers ≥ 4, got {max_features} and {min_inliers}")
        if not (0 < ratio <= 1 and reprojection > 0 and 0 < scales[0] < scales[1] and max_skew >= 1):
            raise ValueError("expected ratio in (0, 1], reprojection > 0, rising scales > 0 and max_skew ≥ 1, "
                             f"got {ratio}, {reprojection}, {scales} and {max_skew}")  # fmt: skip
        grey = as_grey(map_image, "map_image")
        self.shape = grey.shape
        self.ratio, self.reprojection, self.min_inliers = ratio, reprojection, min_inliers
        self.scales, self.max_skew = scales, max_skew
        # Without precise upscaling SIFT puts every feature a quarter of a pixel off, in the picture's own axes.
        precise: dict[str, Any] = {"enable_precise_upscale": True, "contrastThreshold": FAINTEST}
        keypoints, descriptors = cv2.SIFT.create(**precise).detectAndCompute(grey, None)
        if len(keypoints) < min_inliers:
            raise ValueError(f"map_image: expected at least {min_inliers} features, found {len(keypoints)}")
        self.points: Array = np.array([k.pt for k in keypoints])
        self._sift = cv2.SIFT.create(nfeatures=max_features, **precise)
        cv2.setRNGSeed(1)
        self._search = cv2.FlannBasedMatcher({"algorithm": 1, "trees": 4}, {"checks": 32})  # 1: k-d trees
        self._search.add([descriptors])
        self._search.train()

    def locate(self, image: NDArray[np.uint8]) -> Fix | Rejected:
        """Match one picture: a ``Fix``, or ``Rejected`` with its reason.

        Parameters
        ----------
        image : like the map, of any size from 32 pixels up to the map's own.

        Raises ValueError for anything that is not such an image.  A picture that shows nothing, or nothing that
        is on the map, is no error: it is rejected.
        """
        grey = as_grey(image, "image")
        if grey.shape[0] > self.shape[0] or grey.shape[1] > self.shape[1]:
            raise ValueError(f"image: expected one no larger than the map, {self.shape}, got {grey.shape}")
        if grey.min() == grey.max():
            return Rejected(f"the image is uniform: grey level {grey[0, 0]} everywhere")
        pairs = self.match(grey)
        if len(pairs) < self.min_inliers:
            return Rejected(f"{len(pairs)} features look like one place of the map, {self.min_inliers} needed")
        rough, _ = cv2.findHomography(pairs[:, :2], pairs[:, 2:], cv2.RANSAC, self.reprojection,
                                      maxIters=2000, confidence=0.999)  # fmt: skip
        centre = (np.array(grey.shape[::-1]) - 1) / 2
        if reason := self.implausible(rough, centre):
            return Rejected(reason)
        agree = np.linalg.norm(project(rough, pairs[:, :2]) - pairs[:, 2:], axis=1) < self.reprojection
        if agree.sum() < self.min_inliers:
            return Rejected(f"{agree.sum()} matches agree, {self.min_inliers} needed")
        return self._refine(pairs, agree, centre)

    def match(self, grey: NDArray[np.uint8]) -> Array:
        """Pairs that pass the ratio test, each place at most once: (n, 4) [u, v on the picture, u, v on the map]."""
        keypoints, descriptors = self._sift.detectAndCompute(grey, None)
        if len(keypoints) < 2:
            return np.empty((0, 4))
        nearest = self._search.knnMatch(descriptors, k=2)
        kept = [m for m, second in nearest if m.distance < self.ratio * second.distance]
        pairs = np.array([[*keypoints[m.queryIdx].pt, *self.points[m.trainIdx]] for m in kept]).reshape(-1, 4)
        # One corner with two orientations is two features but one piece of evidence.
        for columns in (slice(0, 2), slice(2, 4)):
            pairs = pairs[np.sort(np.unique(np.round(pairs[:, columns] * 4), axis=0, return_index=True)[1])]
        return pairs

    def implausible(self, homography: Array | None, centre: ArrayLike) -> str:
        """Why this cannot be a camera that looks straight down on the map; empty when it can."""
        if homography is None:
            return "no homography explains the matches"
        J = jacobian(homography, centre)
        if np.linalg.det(J) <= 0:
            return "mirrored: the homography turns the picture over"
        long, short = np.linalg.svd(J, compute_uv=False)
        if not self.scales[0] <= np.sqrt(long * short) <= self.scales[1]:
            return f"implausible scale: {np.sqrt(long * short):.2f}, expected {self.scales[0]} to {self.scales[1]}"
        if long > self.max_skew * short:
            return f"implausible skew: one axis is {long / short:.2f} times the other, at most {self.max_skew}"
        return self._outside(project(homography, np.asarray(centre, dtype=float)[None])[0])

    def _outside(self, place: Array) -> str:
        (h, w), (x, y) = self.shape, place
        inside = -0.5 <= x <= w - 0.5 and -0.5 <= y <= h - 0.5
        return "" if inside else f"outside the map: the centre would lie at ({x:.0f}, {y:.0f})"

    def _refine(self, pairs: Array, agree: NDArray[np.bool_], centre: Array) -> Fix | Rejected:
        """A homography has 8 parameters, a camera that looks straight down has 4: fit those to the inliers.

        The second round picks the inliers anew, by the better model.
        """
        for _ in range(2):
            inliers = pairs[agree]
            (a, b, x, y), cov, rms = fit_similarity(inliers[:, :2] - centre, inliers[:, 2:])
            M = np.array([[a, -b], [b, a]])
            shift = np.array([x, y]) - M @ centre
            agree = np.linalg.norm(pairs[:, :2] @ M.T + shift - pairs[:, 2:], axis=1) < self.reprojection
            if agree.sum() < self.min_inliers:
                return Rejected(f"{agree.sum()} matches agree, {self.min_inliers} needed")
        if reason := self._outside(np.array([x, y])):
            return Rejected(reason)
        scale = float(np.hypot(a, b))
        # [a, b, x, y] → [x, y, yaw, scale], with a = scale cos yaw and b = scale sin yaw
        J = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-b / scale**2, a / scale**2, 0, 0], [a / scale, b / scale, 0, 0]])
        cov = symmetrize(J @ cov @ J.T) + np.diag([GRID**2, GRID**2, 0, 0])
        homography = np.vstack([np.column_stack([M, shift]), [0, 0, 1]])
        yaw = float(np.arctan2(b, a))
        return Fix(float(x), float(y), yaw, len(inliers), homography, scale, cov, rms, inliers)


def fit_similarity(source: Array, target: Array, iterations: int = 8) -> tuple[Array, Array, float]:
    r"""The [a, b, x, y] of target = [[a, -b], [b, a]] source + [x, y], under t-distributed residuals.

    Expectation maximisation: w = (ν + 2)/(ν + r²/s²), then weighted least squares and s² = Σ w r²/2n.  The
    covariance is the inverse of the t-distribution's Fisher information, s² (ν + 4)/(ν + 2) (AᵀA)⁻¹.

    source, target (n, 2), n > 2.  Returns parameters (4,), covariance (4, 4), rms of the residuals.
    """
    n = len(source)
    u, v = source.T
    one, zero = np.ones(n), np.zeros(n)
    A = np.stack([np.stack([u, -v, one, zero], axis=-1), np.stack([v, u, zero, one], axis=-1)], axis=1)
    w = np.ones(n)
    for _ in range(iterations):
        weighted = w[:, None, None] * A
        parameters = np.linalg.solve(np.einsum("nij,nik->jk", weighted, A), np.einsum("nij,ni->j", weighted, target))
        squared = np.sum((target - A @ parameters) ** 2, axis=1)
        s2 = max(np.mean(w * squared) / 2, 1e-12)
        w = (FREEDOM + 2) / (FREEDOM + squared / s2)
    information = np.einsum("nij,nik->jk", A, A)
    cov = s2 * (FREEDOM + 4) / (FREEDOM + 2) * n / (n - 2) * np.linalg.solve(information, np.eye(4))
    return parameters, cov, float(np.sqrt(squared.mean()))


def project(homography: Array, points: Array) -> Array:
    """Points through a homography, (n, 2) → (n, 2)."""
    moved = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return moved[:, :2] / moved[:, 2:]


def jacobian(homography: Array, point: ArrayLike) -> Array:
    """How the homography stretches and turns a small neighbourhood of ``point``: (2, 2)."""
    moved = homography @ np.append(np.asarray(point, dtype=float), 1.0)
    return (homography[:2, :2] - np.outer(moved[:2] / moved[2], homography[2, :2])) / moved[2]


def as_grey(image: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    """A grey (h, w) uint8 image from grey, BGR or BGRA, or a ValueError that says what came instead."""
    image = np.asarray(image)
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
