r"""AprilTags: hung into the picture, found in it again, and turned into range and bearing that know how wrong they are.

``quads`` makes the pictures that ``camera.render`` hangs up; ``detect``, from ``tag_detector``, finds them with
OpenCV's detector and fits the four sides of each to a small fraction of a pixel; ``measure`` asks which upright square
would look like that.

>>> from coursekit.pinhole import COURSE_CAMERA
>>> from coursekit.world.arena import Tag
>>> from coursekit.world.camera import CAMERA_OFFSET, mounted, render
>>> tag = Tag(id=3, position=(2.0, 0.3), yaw=3.0)
>>> picture = render(COURSE_CAMERA, mounted([0, 0, 0]), [], quads=quads([tag]))
>>> seen, = detect(picture)
>>> z, R = measure(seen, COURSE_CAMERA, tag.size, CAMERA_OFFSET)
>>> print(seen.id, z.round(2), np.hypot(2.0, 0.3).round(2))
3 [2.02 0.15] 2.02

An id is part of what a detector sees.  Whether a filter is told is another matter: Lab 5 does not.

Source: Olson (2011) for the tags; Hartley & Zisserman (2004), section 5.1, for a covariance from pixel noise.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, rotation
from coursekit.pinhole import Camera
from coursekit.results import Rejected
from coursekit.world.arena import Tag
from coursekit.world.backdrop import Image
from coursekit.world.flat_pictures import Quad
from coursekit.world.tag_detector import FAMILIES, Detection, detect, dictionary

__all__ = [
    "CELLS", "EXPOSURE", "FAMILIES", "MARGIN", "Detection",
    "corner_cov", "detect", "measure", "measurement_cov", "quads", "tag_corners", "tag_corners_jacobian",
]  # fmt: skip

CELLS = 8  # across a tag's black square
MARGIN = 1  # white cells around it, on the paper
_TEXELS = 20  # per cell
_MISFIT = 33.4  # χ² with four degrees of freedom: one good detection in a million is worse
EXPOSURE = {"light": 0.5, "noise": 12.0, "blur": 1.0}
"""How Lab 5's camera sees: a dim hall and a soft lens.  ``corner_cov`` was measured on views rendered like this."""
# Standard deviation of a fitted corner in pixels, on a large tag; what a cell of one pixel adds, falling with its
# square; and the correlation of a side's two ends: a line that is too high at one end is mostly too low at the other.
# tests/world/test_tags.py holds all three to rendered views.
CORNER_FLOOR, CORNER_ALIASING, CORNER_CORRELATION = 0.11, 1.6, -0.6


def quads(tags: Iterable[Tag]) -> list[Quad]:
    """The tags on their paper, as ``camera.render`` takes them: corners in the world, texture."""
    out: list[Quad] = []
    for tag in tags:
        paper = tag.size * (1 + 2 * MARGIN / CELLS)
        corners = tag_corners([*tag.position, tag.height, tag.yaw], paper)
        out.append((corners, _texture(tag.id)))
    return out


def tag_corners(tag: ArrayLike, size: float) -> Array:
    """Corners of an upright square [x, y, z, yaw], in that frame, clockwise as its beholder sees them, (4, 3).

    x, y, z of the centre and ``size`` in metres; ``yaw`` is where its face looks to.
    """
    x, y, z, yaw = np.asarray(tag, dtype=float)
    # Whoever looks at the face has its left on the tag's right hand: -sin, cos is the tag's left.
    across = rotation(yaw) @ [0.0, 0.5 * size]
    signs = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])
    return np.c_[np.array([x, y]) + signs[:, :1] * across, z + signs[:, 1] * 0.5 * size]


def tag_corners_jacobian(tag: ArrayLike, size: float) -> Array:
    """∂ ``tag_corners`` / ∂ tag, (4, 3, 4)."""
    yaw = float(np.asarray(tag, dtype=float)[3])
    J = np.zeros((4, 3, 4))
    J[:, [0, 1, 2], [0, 1, 2]] = 1.0
    J[:, :2, 3] = np.array([-1, 1, 1, -1])[:, None] * (rotation(yaw) @ [-0.5 * size, 0.0])
    return J


def measure(seen: Detection, camera: Camera, size: float, camera_offset: float = 0.0) -> tuple[Array, Array] | Rejected:
    """Range [m] and bearing [rad] of a tag's centre from the robot's centre, (2,), and their covariance, (2, 2).

    The camera is level and the tag upright, so four numbers, [x, y, z, yaw] in the camera's frame, explain eight
    pixels; they are found by weighted least squares, and what the pixels' noise does to them is the covariance.

    size : of the black square, metres.     camera_offset : how far the camera stands ahead of the robot's centre, m.

    Rejects pixels that no upright square explains: a corner was taken for what it is not, or the tag lies on its side.
    Raises ValueError for a size or an offset that cannot be.
    """
    if not (0 < size < np.inf and np.isfinite(camera_offset)):
        raise ValueError(f"expected size > 0 and a finite camera_offset in metres, got {size} and {camera_offset}")
    wide = (seen.corners[[1, 2]] - seen.corners[[0, 3]])[:, 0].mean()
    high = (seen.corners[[3, 2]] - seen.corners[[0, 1]])[:, 1].mean()
    if min(wide, high) < 0.5 * seen.cells:
        return Rejected(f"no upright square looks like this: {wide:.1f} pixels wide, {high:.1f} high")
    whiten = np.asarray(np.linalg.cholesky(corner_cov(seen.corners, seen.cells)))
    left, right = seen.corners[[0, 3]].mean(axis=0), seen.corners[[1, 2]].mean(axis=0)
    heights = np.linalg.norm(seen.corners[[3, 2]] - seen.corners[[0, 1]], axis=1)
    x = camera.fy * size / heights.mean()
    y, z = camera.unproject(0.5 * (left + right), x)[1:]
    # A small tag turned to the left looks much like one turned to the right: start from both, and keep the better.
    facing = np.arctan2(y, x) + np.pi
    fits = [_fit(np.array([x, y, z, facing + turn]), seen.corners, whiten, camera, size) for turn in (-0.7, 0.7)]
    tag, information, cost = min(fits, key=lambda fit: fit[2])
    if cost > _MISFIT:
        return Rejected(f"no upright square looks like this: its misfit χ² is {cost:.0f}, the limit {_MISFIT}")
    return _range_bearing(tag, information, camera_offset)


def measurement_cov(tag: Tag, T_camera_tag: ArrayLike, camera: Camera, camera_offset: float = 0.0) -> Array:
    """The covariance (2, 2) that ``measure`` gives a tag seen at [x, y, z, yaw] in the camera's frame, unrendered."""
    pose = np.asarray(T_camera_tag, dtype=float)
    corners = camera.project(tag_corners(pose, tag.size))
    J = np.linalg.solve(np.linalg.cholesky(corner_cov(corners)), _pixel_slopes(pose, camera, tag.size))
    return _range_bearing(pose, J.T @ J, camera_offset)[1]


def corner_cov(corners: ArrayLike, cells: int = CELLS) -> Array:
    """The covariance of the corners [u₁, v₁, …, u₄, v₄], (8, 8) pixels²: the narrower a tag's cells, the larger.

    A corner's u comes from the line on its left or right, its v from the line above or below.
    """
    c = np.asarray(corners, dtype=float)
    width = np.abs(c[[1, 2], 0] - c[[0, 3], 0]).mean()
    height = np.abs(c[[3, 2], 1] - c[[0, 1], 1]).mean()
    cell = np.maximum([width, height], 1.0) / cells
    cov = np.tile(np.hypot(CORNER_FLOOR, CORNER_ALIASING / cell**2) ** 2, 4) * np.eye(8)
    for i, j in ((0, 6), (2, 4), (1, 3), (5, 7)):  # u of the left and the right side's ends, v of the upper and lower
        cov[i, j] = cov[j, i] = CORNER_CORRELATION * cov[i, i]
    return cov


def _fit(tag: Array, corners: Array, L: Array, camera: Camera, size: float) -> tuple[Array, Array, float]:
    """Gauss-Newton for [x, y, z, yaw], with L Lᵀ the pixels' covariance → the tag, its information (4, 4), the cost."""

    def whitened(tag: Array) -> tuple[Array, Array]:
        residual = (corners - camera.project(tag_corners(tag, size))).ravel()
        both = np.asarray(np.linalg.solve(L, np.c_[residual, _pixel_slopes(tag, camera, size)]))
        return both[:, 0], both[:, 1:]

    for _ in range(8):
        residual, J = whitened(tag)
        # A little damping: head on, the yaw hardly shows.
        step = np.linalg.solve(J.T @ J + 1e-9 * np.diag(np.diag(J.T @ J)), J.T @ residual)
        step[3] = np.clip(step[3], -0.5, 0.5)
        tag = tag + step
        tag[0] = max(tag[0], 2 * size)
        if np.abs(step).max() < 1e-9:
            break
    residual, J = whitened(tag)
    return tag, np.asarray(J.T @ J), float(residual @ residual)


def _pixel_slopes(tag: Array, camera: Camera, size: float) -> Array:
    """∂(pixels of the four corners)/∂[x, y, z, yaw], (8, 4)."""
    project = camera.project_jacobian(tag_corners(tag, size))
    return np.asarray((project @ tag_corners_jacobian(tag, size)).reshape(8, 4))


def _range_bearing(tag: Array, information: Array, camera_offset: float) -> tuple[Array, Array]:
    x, y = tag[0] + camera_offset, tag[1]
    r = np.hypot(x, y)
    J = np.array([[x / r, y / r, 0, 0], [-y / r**2, x / r**2, 0, 0]])
    R = J @ np.linalg.solve(information, J.T)
    return np.array([r, np.arctan2(y, x)]), 0.5 * (R + R.T)


@lru_cache(maxsize=64)
def _texture(tag_id: int) -> Image:
    square = cv2.aruco.generateImageMarker(dictionary("apriltag_36h11"), tag_id, CELLS * _TEXELS)
    white = MARGIN * _TEXELS
    paper = cv2.copyMakeBorder(square, white, white, white, white, cv2.BORDER_CONSTANT, value=255)
    # Printed black is dark grey, and paper is not a lamp: neither end of the scale is reached, and none clips noise.
    return np.asarray(cv2.cvtColor(cv2.convertScaleAbs(paper, alpha=0.7, beta=40), cv2.COLOR_GRAY2BGR), dtype=np.uint8)
