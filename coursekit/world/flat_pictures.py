"""Flat pictures that hang in the world, drawn by homography: how tags and posters come into the camera's view."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, inverse, transform
from coursekit.pinhole import Camera
from coursekit.world.backdrop import Image
from coursekit.world.sightlines import CAMERA_HEIGHT

Quad = tuple[ArrayLike, Image]
_RAYS = 4  # per pixel, each way


def draw_quad(
    image: Image,
    camera: Camera,
    T_world_camera: ArrayLike,
    corners_world: ArrayLike,
    texture: Image,
    *,
    camera_height: float = CAMERA_HEIGHT,
) -> bool:
    """Draw a flat picture that hangs in the world into ``image``, in place; True when any of it was drawn.

    Parameters
    ----------
    corners_world : (4, 3) metres: where the texture's top left, top right, bottom right and bottom left corners
        are.  It has one side: seen from behind, or with a corner behind the camera, nothing is drawn.
    texture : (h, w) or (h, w, 3) uint8.
    """
    corners = np.asarray(corners_world, dtype=float)
    if corners.shape != (4, 3) or not np.all(np.isfinite(corners)):
        raise ValueError(f"corners_world: expected four finite points, shape (4, 3), got {corners!r}")
    p = np.c_[transform(inverse(check_pose(T_world_camera)), corners[:, :2]), corners[:, 2] - camera_height]
    if np.any(p[:, 0] < 0.02):
        return False
    uv = camera.project(p)
    across, down = uv[1] - uv[0], uv[3] - uv[0]
    low = np.clip(np.floor(uv.min(axis=0)).astype(int), 0, None)
    high = np.minimum(np.ceil(uv.max(axis=0)).astype(int) + 1, [camera.width, camera.height])
    if across[0] * down[1] - across[1] * down[0] <= 0 or np.any(low >= high):
        return False
    shrink = _RAYS * np.ptp(uv, axis=0).max() / max(texture.shape[:2])
    if shrink < 0.5:  # many texels to a ray: average them first
        h, w = (max(1, round(shrink * n)) for n in texture.shape[:2])
        texture = cv2.resize(texture, (w, h), interpolation=cv2.INTER_AREA)
    h, w = texture.shape[:2]
    target = (uv - low + 0.5) * _RAYS - 0.5  # on a grid of _RAYS × _RAYS rays per pixel
    outline = np.array([[0, 0], [w, 0], [w, h], [0, h]]) - 0.5
    H = cv2.getPerspectiveTransform(outline.astype(np.float32), target.astype(np.float32))
    size = high - low
    fine = tuple(int(n) for n in size * _RAYS)
    colour = cv2.warpPerspective(texture, H, fine, borderMode=cv2.BORDER_REPLICATE)
    colour = np.atleast_3d(cv2.resize(colour, tuple(size.tolist()), interpolation=cv2.INTER_AREA))
    # A pixel is covered by as much as its centre lies inside the nearest side, from half a pixel out to half in.
    u, v = np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high, strict=True)))
    edges = np.roll(uv, -1, axis=0) - uv
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
    inside = np.min([(u - a) * n + (v - b) * m for (a, b), (n, m) in zip(uv, normals, strict=True)], axis=0)
    mix(image[low[1] : high[1], low[0] : high[0]], colour, np.clip(inside + 0.5, 0, 1))
    return True


def mix(region: Image, colour: Array, share: Array) -> None:
    """Cover a share of each pixel, in place."""
    region[:] = np.rint(region + share[..., None] * (np.float32(colour) - region))


def check_pose(pose: ArrayLike) -> Array:
    """A camera's pose as an array (3,); ValueError for anything else."""
    pose = np.asarray(pose, dtype=float)
    if pose.shape != (3,) or not np.all(np.isfinite(pose)):
        raise ValueError(f"T_world_camera: expected three finite numbers [x, y, θ], got {pose!r}")
    return pose
