r"""What keeps bodies out of each other where the physics engine alone would not.

Chipmunk finds a contact only once two bodies overlap, and solves it approximately.  Three things could carry a body
through a wall, which has no thickness: a substep longer than the body is wide, a body that is thrown too fast, and a
squeeze (a robot that presses a thin crate against a wall), in which each substep leaves a little of the approach.
The first is refused at the door (``too_thin``), the second is slowed down, and the third is taken back: a substep
after which two touching bodies lie deeper in each other than one stride, and deeper than before, did not happen, and
what touched something stands still.

Source: Catto (2005), "Iterative dynamics with temporal coherence", for what an iterative solver leaves.
"""

from __future__ import annotations

from collections.abc import Sequence

import pymunk

SLACK = 1e-3  # metres that bodies at rest may overlap


class Barriers:
    """Steps a space so that no body passes another.

    Parameters
    ----------
    space : its gravity-free plane.
    reach : of each moving body the distance of its farthest point from its centre, m; 0 for a disc, whose turning moves
        nothing into anything.
    speed : m/s; neither a body's centre nor, by its turning alone, its farthest point moves faster.
    """

    def __init__(self, space: pymunk.Space, reach: dict[pymunk.Body, float], speed: float) -> None:
        self._space, self._reach, self._speed = space, reach, speed
        self._before: dict[tuple, tuple[float, pymunk.Vec2d]] = {}
        self._now: dict[tuple, tuple[float, pymunk.Vec2d]] = {}
        space.collision_slop = SLACK  # the engine's own, 0.1, is meant for pixels
        space.on_collision(None, None, post_solve=self._note)
        for body in reach:
            body.position_func = self._move

    def step(self, h: float) -> None:
        """One substep of ``h`` seconds."""
        places = [(body, body.position, body.angle) for body in self._reach]
        self._now = {}
        self._space.step(h)
        if not any(self._passes(pair, h) for pair in self._now):
            self._before = self._now
            return
        touching = {shape.body for pair in self._now for shape in pair}
        for body, position, angle in places:
            if body in touching:
                body.position, body.angle = position, angle
                body.velocity, body.angular_velocity = (0.0, 0.0), 0.0

    def forget(self) -> None:
        """Somebody has moved a thing by hand: what touched before says nothing about now."""
        self._before = {}

    def _note(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        contact = arbiter.contact_point_set
        self._now[arbiter.shapes] = -min(point.distance for point in contact.points), contact.normal

    def _passes(self, pair: tuple, h: float) -> bool:
        """Are two bodies, which touched before, deeper in each other now, or out on the other side?"""
        if pair not in self._before:
            return False
        (depth, normal), (depth_before, normal_before) = self._now[pair], self._before[pair]
        return normal.dot(normal_before) < 0 or depth > max(depth_before, self._speed * h + SLACK)

    def _move(self, body: pymunk.Body, h: float) -> None:
        """pymunk's update of a pose, with speeds that the robot, which moves everything, could have given."""
        if (size := body.velocity.length) > self._speed:
            body.velocity *= self._speed / size
        if abs(turn := body.angular_velocity) * self._reach[body] > self._speed:
            body.angular_velocity = self._speed / self._reach[body] * (1.0 if turn > 0 else -1.0)
        pymunk.Body.update_position(body, h)


def too_thin(widths: Sequence[tuple[str, float]], speed: float, h: float) -> str:
    """The first thing, of pairs (name, width in m), that could pass a wall within substeps of h s; "" if none could.

    It must be wider than what it may overlap a wall, a stride and SLACK, and another stride.
    """
    stride = speed * h
    for name, width in widths:
        if width <= 2 * stride + SLACK:
            return (f"{name} is {width:g} m wide and could pass a wall: one substep moves it up to {stride:g} m; "
                    "take more substeps or a smaller dt")  # fmt: skip
    return ""
