r"""Where on the map was this picture taken?  Features, correspondences, a consensus, and a covariance.

``MapMatcher.correspondences`` pairs features that look alike, right or wrong; ``MapMatcher.locate`` finds the pose
that most of them agree on.  It takes the camera to look straight down, and only where the pairs say otherwise, tilted.

The answer's frame is the map image's: x to the right and y down in pixels of the map, yaw clockwise from north
(the top of the map), a whole number of pixels being a pixel's centre.  ``Fix.belief`` is the same in the
odometry's frame.

Source: Lowe (2004) for SIFT and the ratio test; Muja & Lowe (2009) for FLANN; Fischler & Bolles (1981) for RANSAC;
Lange, Little & Taylor (1989) for the t-distributed residuals.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.doors import LARGEST, as_numbers, count, number
from coursekit.gaussian import Gaussian, with_margin
from coursekit.geometry import Array
from coursekit.results import Rejected
from coursekit.visual.features import features
from coursekit.visual.frames import odometry_from_image
from coursekit.visual.homography import jacobian, project
from coursekit.visual.pictures import as_grey
from coursekit.visual.views import LEAST_SPREAD, likelier, straight_down, tilted


@dataclass(frozen=True, eq=False)
class Fix:
    """Where a picture was taken, by its match with the map.  Counts as true.

    x, y : the map's pixel under the picture's centre.     yaw : clockwise from north, (-π, π].
    inliers : pairs of features that agree.     homography : (3, 3), the picture's pixels to the map's.
    scale : pixels of the map per pixel of the picture.     cov : (4, 4) of [x, y, yaw, scale], from the
    inliers' residuals; 1 px and 0.01 rad for a fix made by hand without one.
    rms : of the inliers' residuals, px of the map.     pairs : (inliers, 4) [u, v on the picture, u, v on the map].

    It checks nothing: ``MapMatcher.locate`` makes it.

    >>> Fix(x=100.0, y=50.0, yaw=0.0, inliers=40, homography=np.eye(3)).belief.mean.round(3)
    array([100.   , -50.   ,   1.571])

    Source: Hartley & Zisserman (2004), chapter 4.
    """

    x: float
    y: float
    yaw: float
    inliers: int
    homography: Array
    scale: float = 1.0
    cov: Array = field(default_factory=lambda: np.diag([1.0, 1.0, 1e-4, 1e-4]))
    rms: float = 0.0
    pairs: Array = field(default_factory=lambda: np.empty((0, 4)), repr=False)

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

    It has two verbs.  ``locate(image)`` answers where a picture was taken, or why it cannot say.
    ``correspondences(image)`` is its first half, for a look inside: features that look alike, right or wrong.

    Parameters
    ----------
    map_image : (h, w) grey, (h, w, 3) BGR or (h, w, 4) BGRA, uint8.  One of 4,000 by 4,000 pixels takes half a minute,
        and some 40 bytes a pixel where it is dense with features.
    max_features : the strongest features of a picture are used, at most so many.
    ratio : Lowe's test: the nearest descriptor on the map must be closer than ratio times the second nearest.
    reprojection : px of the map; pairs that agree within it are inliers.
    min_inliers : fewer are rejected.
    scales : (low, high) plausible pixels of the map per pixel of the picture.
    max_skew : the longest over the shortest axis of the homography's image of a circle.
    margin : px of the map by which the picture's centre may lie outside the map.

    The settings are for a camera over the map that looks down within 35° of the vertical.  Two other cases need others:

    - *An oblique photograph.*  A camera tilted by τ shows a circle 1/cos τ times longer than wide, so at 50° the skew
      is 1.56: give ``max_skew`` a little more.  The picture's centre is farther away than the ground below, by 1/cos τ
      too; widen ``scales`` by that.  Features survive some 60°; near that, a ``ratio`` of 0.85 keeps more of them.
    - *Neighbouring photographs of a survey*, one of which serves as the map.  Where they overlap by less than half,
      the centre of the one lies outside the other: give ``margin`` half the picture's size.

    Building the search trees draws from OpenCV's own generator; it is seeded first, so that the same map always
    gives the same matcher.

    Raises ValueError for settings that make no sense, a map that is no uint8 image, and one so plain that nothing
    on it can be told apart.

    >>> rng = np.random.default_rng(0)
    >>> blobs = cv2.GaussianBlur(rng.integers(0, 256, (200, 300), dtype=np.uint8), (0, 0), 3.0)
    >>> map_image = cv2.normalize(blobs, None, 0, 255, cv2.NORM_MINMAX)
    >>> fix = MapMatcher(map_image).locate(map_image[30:151, 100:251])  # its middle lies at (175, 90)
    >>> bool(fix), round(fix.x), round(fix.y), fix.yaw < 0.01
    (True, 175, 90, True)
    >>> MapMatcher(map_image).locate(np.full((100, 100), 7, np.uint8))
    Rejected(reason='the image is uniform: grey level 7 everywhere')

    A photograph tilted by 50°, whose centre shows the map at (150, 100):

    >>> look = np.array([[1.62, 0.742, -123.6], [0, 1.5354, -24.68], [0, 0.0062, 1]])  # from map to picture
    >>> oblique = cv2.warpPerspective(map_image, look, (240, 160))
    >>> MapMatcher(map_image).locate(oblique)
    Rejected(reason='implausible skew: one axis is 1.56 times the other, at most 1.25')
    >>> fix = MapMatcher(map_image, max_skew=1.8).locate(oblique)
    >>> round(fix.x), round(fix.y)
    (150, 100)

    A neighbour that begins where three fifths of the map are over; its centre is 25 px beyond the edge:

    >>> here, neighbour = map_image[:, :180], map_image[:199, 109:]
    >>> MapMatcher(here).locate(neighbour)
    Rejected(reason='outside the map: the centre would lie at (204, 99)')
    >>> round(MapMatcher(here, margin=90).locate(neighbour).x, 1)
    204.0

    Source: Lowe (2004); Muja & Lowe (2009); Fischler & Bolles (1981).
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
        margin: float = 0.0,
    ) -> None:
        max_features = count(max_features, "max_features")
        min_inliers = count(min_inliers, "min_inliers", least=4)  # a homography has 8 unknowns, a pair gives 2
        if as_numbers(scales, "scales").shape != (2,):
            raise ValueError(f"scales: expected (low, high), got {scales!r}")
        ratio, reprojection, max_skew, margin = (
            number(value, name) for name, value in (("ratio", ratio), ("reprojection", reprojection),
                                                    ("max_skew", max_skew), ("margin", margin))
        )  # fmt: skip
        if not (
            0 < ratio <= 1
            and LARGEST > reprojection > 0
            and 0 < scales[0] < scales[1]
            and max_skew >= 1
            and margin >= 0
        ):
            raise ValueError("expected ratio in (0, 1], reprojection > 0, rising scales > 0, max_skew ≥ 1, margin ≥ 0, "
                             f"got {ratio}, {reprojection}, {scales}, {max_skew}, {margin}")  # fmt: skip
        grey = as_grey(map_image, "map_image")
        self.shape = grey.shape
        self.max_features, self.ratio, self.reprojection = max_features, ratio, reprojection
        self.min_inliers, self.scales, self.max_skew, self.margin = min_inliers, scales, max_skew, margin
        self.points, descriptors = features(grey)
        if len(self.points) < min_inliers:
            raise ValueError(f"map_image: expected at least {min_inliers} features, found {len(self.points)}")
        cv2.setRNGSeed(1)
        self._descriptors = descriptors.astype(np.float32)  # the index looks into them, so they must live as long
        del descriptors  # before the trees grow: on a large map the bytes are worth having back
        self._index = cv2.flann.Index(self._descriptors, {"algorithm": 1, "trees": 4})  # 1: k-d trees

    def locate(self, image: NDArray[np.uint8]) -> Fix | Rejected:
        """Match one picture: a ``Fix``, or ``Rejected`` with its reason.

        Parameters
        ----------
        image : like the map, 32 pixels or more each way; it may be larger than the map.

        Raises ValueError for anything that is not such an image.  A picture that shows nothing, or nothing that
        is on the map, is no error: it is rejected.
        """
        grey = as_grey(image, "image")
        if grey.min() == grey.max():
            return Rejected(f"the image is uniform: grey level {grey[0, 0]} everywhere")
        pairs = self.correspondences(grey)
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
        return self._refine(pairs, agree, rough, centre)

    def correspondences(self, image: NDArray[np.uint8]) -> Array:
        """Pairs of features that look alike: (n, 4) [u, v on the picture, u, v on the map].

        They passed the ratio test, and each place occurs at most once.  Nothing has asked yet whether they agree on one
        pose, so some are wrong (*putative* correspondences); ``locate`` goes on from here.

        Raises ValueError for what is no image.

        >>> rng = np.random.default_rng(0)
        >>> blobs = cv2.GaussianBlur(rng.integers(0, 256, (200, 300), dtype=np.uint8), (0, 0), 3.0)
        >>> map_image = cv2.normalize(blobs, None, 0, 255, cv2.NORM_MINMAX)
        >>> pairs = MapMatcher(map_image).correspondences(map_image[30:150, 100:250])
        >>> np.median(pairs[:, 2:] - pairs[:, :2], axis=0).round()
        array([100.,  30.])

        Source: Lowe (2004), section 7.1.
        """
        places, descriptors = features(as_grey(image, "image"), self.max_features)
        if len(places) < 2:
            return np.empty((0, 4))
        nearest, squared = self._index.knnSearch(descriptors.astype(np.float32), 2, params={"checks": 32})
        kept = squared[:, 0] < self.ratio**2 * squared[:, 1]
        pairs = np.hstack([places[kept], self.points[nearest[kept, 0]]])
        # One corner with two orientations is two features but one piece of evidence.
        for columns in (slice(0, 2), slice(2, 4)):
            pairs = pairs[np.sort(np.unique(np.round(pairs[:, columns] * 4), axis=0, return_index=True)[1])]
        return pairs

    def implausible(self, homography: Array | None, centre: ArrayLike) -> str:
        """Why no camera looks at the map like this, by ``scales``, ``max_skew`` and ``margin``; empty when one can.

        Parameters: ``homography`` (3, 3), picture to map; ``centre`` (2,), the picture's, in its own pixels.
        """
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
        (h, w), (x, y), beyond = self.shape, place, 0.5 + self.margin
        inside = -beyond <= x <= w - 1 + beyond and -beyond <= y <= h - 1 + beyond
        allowed = f", {self.margin:g} px beyond it at most" if self.margin else ""
        return "" if inside else f"outside the map: the centre would lie at ({x:.0f}, {y:.0f}){allowed}"

    def _refine(self, pairs: Array, agree: NDArray[np.bool_], rough: Array, centre: Array) -> Fix | Rejected:
        """The likelier of the two views, fitted to the inliers; a second round picks the inliers anew by it."""
        view = likelier(pairs[agree], centre, rough)
        for _ in range(2):
            agree = view.squared(pairs) < self.reprojection**2
            if agree.sum() < self.min_inliers:
                return Rejected(f"{agree.sum()} matches agree, {self.min_inliers} needed")
            inliers = pairs[agree]
            view = tilted(inliers, centre, view.homography) if view.tilted else straight_down(inliers, centre)
        if reason := self.implausible(view.homography, centre):
            return Rejected(reason)
        x, y, yaw, scale = (float(value) for value in view.pose)
        cov = with_margin(view.cov + np.diag([LEAST_SPREAD**2, LEAST_SPREAD**2, 0, 0]))
        rms = float(np.sqrt(view.squared(inliers).mean()))
        return Fix(x, y, yaw, len(inliers), view.homography, scale, cov, rms, inliers)
