r"""What a column of pixels meets, and so which landmarks a camera sees whole: geometry without a picture.

The camera is level and everything in the world is upright, so a column of pixels is a vertical plane through the
eye, and whatever it sees of a thing lies between two depths: where it enters the thing's ground plan and where it
leaves it.  Depth is measured along the optical axis: a ray is the line x · (1, t) in the camera's frame, with
t = (c_x - u)/f_x.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, inverse, transform
from coursekit.pinhole import Camera, project_cylinder
from coursekit.world.arena import Crate, Cylinder, Wall

CAMERA_HEIGHT = 0.2  # of the robot's eye over the floor, metres
WALL_HEIGHT, CRATE_HEIGHT = 1.1, 0.3
Thing = Cylinder | Crate | Wall


@dataclass(frozen=True)
class View:
    """What a picture shows of one cylinder, known from the world and not from the picture.

    left_px, right_px, top_px, bottom_px : the extremes of its outline.     axis_px : the column of its axis.
    cut : which edges of the picture cut it off, of "left", "right", "top", "bottom".
    hidden : the share of its width over which something nearer covers any of it.
    """

    left_px: float
    right_px: float
    top_px: float
    bottom_px: float
    axis_px: float
    cut: tuple[str, ...]
    hidden: float

    @property
    def height_px(self) -> float:
        """From the top of the outline to its bottom."""
        return self.bottom_px - self.top_px

    @property
    def whole(self) -> bool:
        """True when nothing of it is missing."""
        return not self.cut and self.hidden == 0


def visibility(
    camera: Camera,
    T_world_camera: ArrayLike,
    cylinders: Sequence[Cylinder],
    *,
    walls: Iterable[Wall] = (),
    crates: Iterable[Crate] = (),
    camera_height: float = CAMERA_HEIGHT,
) -> list[View | None]:
    """The truth about each cylinder in a picture; None for one that is not in it at all."""
    pose = np.asarray(T_world_camera, dtype=float)
    things: list[Thing] = [*cylinders, *crates, *walls]
    return [_view(camera, pose, c, [o for o in things if o is not c], camera_height) for c in cylinders]


def depths(pose: Array, thing: Thing, t: Array) -> tuple[Array, Array]:
    """Where rays enter and leave a thing's ground plan: depths of t's shape, infinite where they miss it.

    A ray that only touches a cylinder, or passes within rounding of it, meets it at the tangent.
    """
    if isinstance(thing, Cylinder):
        x, y = transform(inverse(pose), thing.position)
        a, b, c = 1 + t**2, x + t * y, x**2 + y**2 - thing.radius**2
        discriminant = b**2 - a * c
        hit = (discriminant > -1e-9 * b**2) & (b > 0) & (c > 0)
        root = np.sqrt(np.maximum(discriminant, 0))
        return np.where(hit, (b - root) / a, np.inf), np.where(hit, (b + root) / a, np.inf)
    crossings = np.array([_crossing(start, end, t) for start, end in sides(pose, thing)])
    near = crossings.min(axis=0)
    return near, np.where(np.isfinite(near), np.where(np.isfinite(crossings), crossings, 0).max(axis=0), np.inf)


def sides(pose: Array, thing: Crate | Wall) -> Array:
    """The segments of a thing's ground plan in the camera's frame, (n, 2, 2): segment, end, [x, y]."""
    if isinstance(thing, Wall):
        return transform(inverse(pose), np.array([[thing.start, thing.end]]))
    corners = transform(inverse(pose), transform(thing.pose, thing.corners))
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def rows(camera: Camera, near: Array, far: Array, eye: float, height: float) -> tuple[Array, Array, Array]:
    """Where a thing is drawn: the top of its body, its bottom, and the far edge of its lid (the top, if unseen).

    Infinite depths give the horizon.
    """
    top = camera.cy - camera.fy * (height - eye) / near
    bottom = camera.cy + camera.fy * eye / near
    return top, bottom, np.minimum(top, camera.cy - camera.fy * (height - eye) / far)


def height_of(thing: Thing) -> float:
    """Metres over the floor."""
    if isinstance(thing, Cylinder):
        return thing.height
    return CRATE_HEIGHT if isinstance(thing, Crate) else WALL_HEIGHT


def _crossing(start: Array, end: Array, t: Array) -> Array:
    """Depth at which the rays x · (1, t) cross a segment, infinite where they miss it or it lies behind."""
    direction = end - start
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (start[0] * t - start[1]) / (direction[1] - direction[0] * t)
        depth = start[0] + share * direction[0]
        return np.where((share >= 0) & (share <= 1) & (depth > 1e-6), depth, np.inf)


def _view(camera: Camera, pose: Array, cylinder: Cylinder, others: Sequence[Thing], eye: float) -> View | None:
    x, y = transform(inverse(pose), cylinder.position)
    if x <= cylinder.radius:
        return None
    left, right, axis = _outline(camera, x, y, cylinder)
    t = np.linspace(camera.cx - left, camera.cx - right, 401)[1:-1] / camera.fx
    near, far = depths(pose, cylinder, t)
    _, bottoms, tops = rows(camera, near, far, eye, cylinder.height)
    top, bottom = float(tops.min()), float(bottoms.max())
    w, h = camera.width - 0.5, camera.height - 0.5
    if right <= -0.5 or left >= w or bottom <= -0.5 or top >= h:
        return None
    cut = {"left": left < -0.5, "right": right > w, "top": top < -0.5, "bottom": bottom > h}
    hidden = np.zeros(t.shape, dtype=bool)
    for other in others:
        near_other, far_other = depths(pose, other, t)
        _, bottom_other, top_other = rows(camera, near_other, far_other, eye, height_of(other))
        hidden |= (near_other < near) & (top_other < bottoms) & (bottom_other > tops)
    return View(left, right, top, bottom, axis, tuple(side for side in cut if cut[side]), float(hidden.mean()))


def _outline(camera: Camera, x: float, y: float, cylinder: Cylinder) -> tuple[float, float, float]:
    pixels = project_cylinder(np.hypot(x, y), np.arctan2(y, x), camera, cylinder.height, cylinder.radius)
    return float(pixels.left_px), float(pixels.right_px), float(pixels.axis_px)
