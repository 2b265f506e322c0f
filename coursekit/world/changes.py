"""What somebody else does to a world while the robot drives in it: a door falls shut, a crate is carried away.

>>> from coursekit.world.arena import Arena, Crate
>>> from coursekit.world.lidar import Lidar
>>> world = World(Arena("yard", crates=(Crate((2.0, 1.0, 0.0)),)), seed=1)
>>> shut(world, Wall((1.5, -1.0), (1.5, 0.6)))
>>> carry(world, 0, [3.0, 0.0, 0.0])
>>> world.crates.tolist(), round(float(Lidar(beams=2).scan(world).ranges[0]), 2)     # ahead: the door, not the crate
([[3.0, 0.0, 0.0]], 1.5)
"""

from __future__ import annotations

import operator
from dataclasses import replace

import numpy as np
import pymunk
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.world.arena import Wall
from coursekit.world.barriers import SLACK
from coursekit.world.robot import OBSTACLE, World


def shut(world: World, wall: Wall) -> None:
    """A wall from now on; ``world.arena`` has it too.

    Raises ValueError, and changes nothing, where it would stand in the robot or in a crate; TypeError for no wall.
    """
    if not isinstance(wall, Wall):
        raise TypeError(f"wall: expected Wall(start, end), got {wall!r}")
    shape = pymunk.Segment(world.space.static_body, wall.start, wall.end, 0.0)
    shape.friction, shape.filter = 0.5, pymunk.ShapeFilter(categories=OBSTACLE)
    if _stands_in(world.space, shape):
        raise ValueError(f"wall: something stands between {wall.start} and {wall.end}")
    world.space.add(shape)
    world.arena = replace(world.arena, walls=(*world.arena.walls, wall))


def carry(world: World, index: int, pose: ArrayLike) -> None:
    """Put a crate down elsewhere, at rest.

    Parameters
    ----------
    index : of the crate, in the arena's order.
    pose : T_world_crate [x, y, θ] (3,).

    Raises ValueError, and changes nothing, for a pose that is not finite or where something else stands; IndexError for
    a crate that is not there.
    """
    there = as_numbers(pose, "pose")
    if there.shape != (3,) or not np.isfinite(there).all():
        raise ValueError(f"pose: expected finite [x, y, θ], got {pose!r}")
    bodies = world._crates
    if not 0 <= operator.index(index) < len(bodies):
        raise IndexError(f"index: expected one of {len(bodies)} crates, got {index}")
    body, (shape,) = bodies[index], tuple(bodies[index].shapes)
    before = body.position, body.angle
    _put(world.space, body, (float(there[0]), float(there[1])), float(there[2]))
    if _stands_in(world.space, shape):
        _put(world.space, body, *before)
        raise ValueError(f"pose: something else stands where crate {index} was to be put, at {there.tolist()}")
    body.velocity, body.angular_velocity = (0.0, 0.0), 0.0
    world._barriers.forget()


def _put(space: pymunk.Space, body: pymunk.Body, position: tuple[float, float], angle: float) -> None:
    body.position, body.angle = position, angle
    space.reindex_shapes_for_body(body)


def _stands_in(space: pymunk.Space, shape: pymunk.Shape) -> bool:
    """Does a shape overlap one of another body by more than things do that are pressed together?  Fixed things may.

    A query's depths are > 0 where the engine has swapped the two shapes, and < 0 elsewhere.
    """
    return any(
        hit.shape.body is not shape.body
        and max(abs(point.distance) for point in hit.contact_point_set.points) > 2 * SLACK
        for hit in space.shape_query(shape)
    )
