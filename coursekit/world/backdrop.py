"""Floor, walls and what is above them: the textured room that the camera's other things stand in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from coursekit.geometry import Array
from coursekit.pinhole import Camera
from coursekit.world.arena import Wall
from coursekit.world.sightlines import WALL_HEIGHT, depths, rows, sides

Image = NDArray[np.uint8]

FLOOR, WALL, SKIRTING, SKY = (122, 130, 136), (172, 186, 192), (88, 94, 100), (214, 208, 200)  # BGR
SKIRTING_HEIGHT = 0.08
_TILE, _TILE_SIDE = 512, 2.0  # the floor's texture, pixels, which repeats every two metres
_REACH = (1.5, 3.0, 6.0, 14.0)  # beyond each depth, metres, half as much detail; beyond the last, none


def backdrop(camera: Camera, pose: Array, walls: Sequence[Wall], eye: float, texture: float) -> tuple[Image, Array]:
    """The empty room: a picture, and the depth of the wall in each column (width,), infinite where there is none."""
    image = _sky(camera).copy()
    _paint_floor(image, camera, pose, eye, texture)
    return image, _paint_walls(image, camera, pose, walls, eye, texture)


def _paint_floor(image: Image, camera: Camera, pose: Array, eye: float, texture: float) -> None:
    """Warp the floor's texture into the rows below the horizon, in bands of falling detail."""
    # Pixel (u, v) sees the floor at depth x = f_y · eye / (v - c_y): linear in (u, v, 1) up to scale.
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    floor = np.array([[0, 0, fy * eye], [-fy * eye / fx, 0, fy * eye * cx / fx], [0, 1, -cy]])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = np.mod(pose[:2], _TILE_SIDE)  # small numbers: OpenCV keeps texture coordinates in 16 bits
    scale = _TILE / _TILE_SIDE
    texture_of = np.diag([scale, scale, 1.0]) @ [[c, -s, x], [s, c, y], [0, 0, 1.0]] @ floor
    edges = [camera.height] + [int(np.clip(np.ceil(cy + fy * eye / reach), 0, camera.height)) for reach in _REACH]
    for level, (below, above) in enumerate(pairwise(edges)):
        if below > above:
            tile, shift = _floor_tile(texture, level), np.array([[1, 0, 0], [0, 1, above], [0, 0, 1.0]])
            shrink = np.diag([0.5**level, 0.5**level, 1.0])
            image[above:below] = cv2.warpPerspective(
                tile, shrink @ texture_of @ shift, (camera.width, below - above),
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_WRAP,
            )  # fmt: skip
    image[int(np.clip(np.ceil(cy), 0, camera.height)) : edges[-1]] = FLOOR


def _paint_walls(image: Image, camera: Camera, pose: Array, walls: Sequence[Wall], eye: float, texture: float) -> Array:
    """Paint in each column the nearest wall and its skirting board; return its depth."""
    nearest = np.full(camera.width, np.inf)
    colour = np.zeros((camera.width, 3))
    t = (camera.cx - np.arange(camera.width, dtype=float)) / camera.fx
    for wall in walls:
        depth, _ = depths(pose, wall, t)
        seen = depth < nearest
        if not seen.any():
            continue
        start = sides(pose, wall)[0, 0]
        along = np.hypot(depth[seen] - start[0], depth[seen] * t[seen] - start[1])
        heading = np.arctan2(*(np.array(wall.end) - wall.start)[::-1])
        # Walls that face differently are lit differently; panels a metre wide make each stretch of wall its own.
        shade = 0.93 + 0.07 * np.cos(2 * heading - 0.7) + 0.06 * texture * _panels(along)
        colour[seen] = np.clip(shade, 0, 1.2)[:, None] * WALL
        nearest[seen] = depth[seen]
    if np.isfinite(nearest).any():
        row = np.arange(camera.height)[:, None]
        for height, paint in ((WALL_HEIGHT, colour), (SKIRTING_HEIGHT, np.array([SKIRTING] * camera.width))):
            top, bottom, _ = rows(camera, nearest, nearest, eye, height)
            first = int(np.clip(np.floor(top[np.isfinite(nearest)].min()), 0, camera.height))
            last = int(np.clip(np.ceil(bottom[np.isfinite(nearest)].max()) + 1, 0, camera.height))
            inside = (row[first:last] >= top) & (row[first:last] <= bottom) & np.isfinite(nearest)
            painted = np.broadcast_to(np.uint8(np.clip(paint, 0, 255)), (last - first, camera.width, 3))
            cv2.copyTo(np.ascontiguousarray(painted), np.uint8(inside), image[first:last])
    return nearest


def _panels(along: Array) -> Array:
    """Brightness along a wall: panels of one metre with a dark joint, each a little different."""
    panel = np.floor(along)
    tone = np.sin(12.9898 * panel) * 43758.5453  # a hash: any panel, always the same tone
    return 1.6 * (tone - np.floor(tone)) - 0.8 - 2.5 * (along - panel < 0.03)


@lru_cache(maxsize=8)
def _sky(camera: Camera) -> Image:
    share = np.linspace(0, 1, camera.height)[:, None, None]
    sky = np.array(SKY) * (0.86 + 0.28 * share)
    return np.broadcast_to(np.clip(sky, 0, 255), (camera.height, camera.width, 3)).astype(np.uint8)


@lru_cache(maxsize=32)
def _floor_tile(texture: float, level: int) -> Image:
    """Speckled stone in slabs of half a metre, seen at 1/2, 1/4 … of its detail."""
    rng = np.random.default_rng(2018)  # the stone is always the same stone
    speckle = np.zeros((_TILE, _TILE))
    for size in (8, 32, 128, _TILE):
        octave = cv2.resize(rng.standard_normal((size, size)), (_TILE, _TILE), interpolation=cv2.INTER_CUBIC)
        speckle += octave * 3.0
    joint = np.minimum(*np.meshgrid(*[np.abs((np.arange(_TILE) + 64) % 128 - 64)] * 2)) < 2
    tile = np.array(FLOOR) + texture * (speckle - 22.0 * joint)[..., None]
    for _ in range(level):
        tile = cv2.resize(tile, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return np.clip(tile, 0, 255).astype(np.uint8)
