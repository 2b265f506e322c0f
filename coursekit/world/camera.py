r"""A pinhole camera in the flat world: what stands there, painted column by column.

A cylinder's silhouette, its curved rims and the lid that an eye above it sees all follow from two depths per
column (``sightlines``); no mesh is involved, and an edge lies where geometry puts it to a small fraction of a
pixel, because each pixel is mixed by the share of it that is covered.

``render`` = ``paint`` (the scene) + ``expose`` (light, blur, noise).  Whoever wants something else in the picture
draws it in between with ``draw_quad``, or hands it to ``render`` among its ``quads``.

Deterministic: the same arguments and the same generator give the same bytes.

>>> from coursekit.pinhole import COURSE_CAMERA
>>> picture = render(COURSE_CAMERA, [0, 0, 0], [Cylinder((3.0, 0.0), colour="red")])
>>> picture.shape, picture[240, 319].tolist()      # blue, green, red
((480, 640, 3), [28, 24, 166])
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from coursekit.geometry import Array, compose, inverse, transform
from coursekit.pinhole import Camera, project_cylinder
from coursekit.world._checks import number
from coursekit.world.arena import Crate, Cylinder, Wall
from coursekit.world.backdrop import Image, backdrop
from coursekit.world.flat_pictures import Quad, check_pose, draw_quad, mix
from coursekit.world.sightlines import CAMERA_HEIGHT, View, depths, height_of, rows, sides, visibility

__all__ = [
    "CAMERA_HEIGHT", "CAMERA_OFFSET", "PAINT", "View",
    "draw_quad", "expose", "mounted", "paint", "render", "visibility",
]  # fmt: skip

CAMERA_OFFSET = 0.07  # of the robot's camera, ahead of the robot's centre, metres
PAINT = {
    "red": (34, 30, 205),
    "green": (48, 165, 36),
    "blue": (190, 78, 22),
    "cyan": (205, 192, 24),
    "magenta": (172, 32, 192),
    "yellow": (24, 196, 212),
}
"""What the named colours look like in full light, BGR."""
_CRATE = (36, 104, 172)  # orange: no landmark has this hue
_SUN = (-0.6, 0.8)  # where the light comes from, in the plane
_RAYS = 4  # per column of pixels


def render(
    camera: Camera,
    T_world_camera: ArrayLike,
    cylinders: Iterable[Cylinder],
    *,
    light: float = 1.0,
    noise: float = 2.0,
    blur: float = 0.6,
    rng: np.random.Generator | None = None,
    walls: Iterable[Wall] = (),
    crates: Iterable[Crate] = (),
    quads: Iterable[Quad] = (),
    camera_height: float = CAMERA_HEIGHT,
    texture: float = 1.0,
) -> Image:
    """What the camera sees: (height, width, 3) uint8, BGR.

    Parameters
    ----------
    T_world_camera : [x, y, θ] of the camera, (3,); ``mounted(T_world_robot)`` is where the robot carries it.
    light : brightness of the whole scene; 1 is a bright room.
    noise : standard deviation of the sensor's noise in grey levels; none without an ``rng``.
    blur : standard deviation of the lens's blur, pixels.
    quads : pairs (corners_world (4, 3), texture) as in ``draw_quad``; nearer things hide them, but walls do not.
    camera_height : of the eye over the floor, metres.
    texture : contrast of floor and walls, 0 for plain ones.

    Raises ValueError for a pose that is not three finite numbers, an unknown colour, and negative settings.
    """
    scene = paint(
        camera, T_world_camera, cylinders,
        walls=walls, crates=crates, quads=quads, camera_height=camera_height, texture=texture,
    )  # fmt: skip
    return expose(scene, light=light, noise=noise, blur=blur, rng=rng)


def mounted(T_world_robot: ArrayLike, camera_offset: float = CAMERA_OFFSET) -> Array:
    """T_world_camera of a camera ``camera_offset`` metres ahead of the robot's centre, looking where it looks."""
    return compose(T_world_robot, [camera_offset, 0.0, 0.0])


def paint(
    camera: Camera,
    T_world_camera: ArrayLike,
    cylinders: Iterable[Cylinder],
    *,
    walls: Iterable[Wall] = (),
    crates: Iterable[Crate] = (),
    quads: Iterable[Quad] = (),
    camera_height: float = CAMERA_HEIGHT,
    texture: float = 1.0,
) -> Image:
    """The scene in full light through a perfect lens; arguments as for ``render``."""
    pose, eye = check_pose(T_world_camera), number(camera_height, "camera_height", above=0.0)
    image, wall_depth = backdrop(camera, pose, tuple(walls), eye, number(texture, "texture", least=0.0))
    things: list[Cylinder | Crate | Quad] = [*cylinders, *crates, *quads]
    for thing in sorted(things, key=lambda thing: _distance(thing, pose), reverse=True):  # near things hide far ones
        if isinstance(thing, tuple):
            draw_quad(image, camera, pose, *thing, camera_height=eye)
        else:
            _paint_thing(image, camera, pose, thing, eye, wall_depth)
    return image


def expose(
    scene: Image, *, light: float = 1.0, noise: float = 2.0, blur: float = 0.6, rng: np.random.Generator | None = None
) -> Image:
    """What lens and sensor make of a painted scene; arguments as for ``render``.  The scene is not changed."""
    image = cv2.convertScaleAbs(scene, alpha=number(light, "light", above=0.0))
    if number(blur, "blur", least=0.0) > 0:
        image = cv2.GaussianBlur(image, (0, 0), blur)
    if number(noise, "noise", least=0.0) > 0 and rng is not None:
        # A random byte through the normal's quantiles: fresh noise for a million values in two milliseconds.
        grain = np.frombuffer(rng.bytes(image.size), dtype=np.uint8).reshape(image.shape)
        brighter, darker = _normal_bytes(float(noise))
        image = cv2.subtract(cv2.add(image, cv2.LUT(grain, brighter)), cv2.LUT(grain, darker))
    return np.asarray(image, dtype=np.uint8)


def _distance(thing: Cylinder | Crate | Quad, pose: Array) -> float:
    if isinstance(thing, tuple):
        x, y = np.mean(np.asarray(thing[0], dtype=float), axis=0)[:2]
    else:
        x, y = thing.position if isinstance(thing, Cylinder) else thing.pose[:2]
    return float(np.hypot(x - pose[0], y - pose[1]))


def _paint_thing(
    image: Image, camera: Camera, pose: Array, thing: Cylinder | Crate, eye: float, wall_depth: Array
) -> None:
    """Paint the lid, if the eye is above it, and the body of one thing over what is behind it."""
    rays = (np.arange(camera.width * _RAYS).reshape(camera.width, _RAYS) + 0.5) / _RAYS - 0.5
    covered = np.ones_like(rays)
    if isinstance(thing, Cylinder):
        x, y = transform(inverse(pose), thing.position)
        if x <= thing.radius:
            return
        # Its sides are known exactly: the outermost rays stand for the part of their share that lies within.
        outline = project_cylinder(np.hypot(x, y), np.arctan2(y, x), camera, thing.height, thing.radius)
        left, right, half = outline.left_px, outline.right_px, 0.5 / _RAYS
        covered = np.clip(np.minimum(rays + half, right) - np.maximum(rays - half, left), 0, None) * _RAYS
        rays = np.where(covered > 0, np.clip(rays, left, right), rays)
    t = (camera.cx - rays) / camera.fx
    near, far = depths(pose, thing, t)
    covered = np.where(near < wall_depth[:, None], covered, 0)
    columns = np.flatnonzero(covered.any(axis=1))
    if not columns.size:
        return
    across = slice(columns[0], columns[-1] + 1)
    near, far, covered = near[across], far[across], covered[across].astype(np.float32)
    body, lid = _colours(camera, pose, thing, t[across], near)
    top, bottom, back = rows(camera, near, far, eye, height_of(thing))
    for upper, lower, colour in ((back, top, lid), (top, bottom, body)):
        if np.all(upper >= lower):
            continue
        first = int(np.clip(np.floor(upper.min()), 0, camera.height))
        last = int(np.clip(np.ceil(lower.max()) + 1, 0, camera.height))
        row = np.arange(first, last, dtype=np.float32)[:, None, None] - np.float32(0.5)
        inside = np.clip(np.float32(lower) - row, 0, 1) - np.clip(np.float32(upper) - row, 0, 1)
        mix(image[first:last, across], colour, (inside * covered).mean(axis=2))


def _colours(camera: Camera, pose: Array, thing: Cylinder | Crate, t: Array, near: Array) -> tuple[Array, Array]:
    """Colours of the body, (n, 3), and the lid (3,): what faces the light is brighter, and nothing is black."""
    seen = np.isfinite(near)
    x = np.where(seen, near, 0)
    y = x * t
    if isinstance(thing, Cylinder):
        if thing.colour not in PAINT:
            raise ValueError(f"colour: expected one of {', '.join(PAINT)}, got {thing.colour!r}")
        centre, paint = transform(inverse(pose), thing.position), PAINT[thing.colour]
        normal_x, normal_y = (x - centre[0]) / thing.radius, (y - centre[1]) / thing.radius
    else:
        paint, faces = _CRATE, sides(pose, thing)
        edges = faces[:, 1] - faces[:, 0]
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
        distance = np.einsum("fi,...fi->...f", normals, np.stack([x, y], axis=-1)[..., None, :] - faces[:, 0])
        face = normals[np.argmin(np.abs(distance), axis=-1)]
        normal_x, normal_y = face[..., 0], face[..., 1]
    sun = transform(inverse([0, 0, pose[2]]), _SUN)
    shade = 0.45 + 0.55 * ((1 + normal_x * sun[0] + normal_y * sun[1]) / 2) ** 2
    shade = (shade * seen).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    return shade[:, None] * np.array(paint), np.array(paint, dtype=float)


@lru_cache(maxsize=64)
def _normal_bytes(sigma: float) -> tuple[Image, Image]:
    """For each byte, a normal's quantile as (brighter by, darker by), whole grey levels."""
    levels = np.rint(sigma * ndtri((np.arange(256) + 0.5) / 256))
    return np.clip(levels, 0, 255).astype(np.uint8), np.clip(-levels, 0, 255).astype(np.uint8)
