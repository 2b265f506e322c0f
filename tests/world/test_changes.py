"""What somebody does to a world while the robot drives: a door falls shut, a crate is carried."""

import numpy as np
import pytest

from coursekit.world.arena import Arena, Crate, Cylinder, Wall
from coursekit.world.changes import carry, shut
from coursekit.world.lidar import Lidar
from coursekit.world.robot import World

DOOR = Wall((1.0, -1.0), (1.0, 1.0))


def ahead(world):
    return Lidar(beams=2).scan(world).ranges[0]


def yard():
    return World(Arena("yard", walls=(Wall((3, -2), (3, 2)),), crates=(Crate((2.0, 1.5, 0.0)),)), seed=1)


def test_a_door_that_falls_shut_is_seen_and_stops_the_robot_and_leaves_the_arena_of_others_alone():
    world, other = yard(), yard()
    assert ahead(world) == pytest.approx(3.0)
    shut(world, DOOR)
    assert ahead(world) == pytest.approx(1.0) and ahead(other) == pytest.approx(3.0)
    for _ in range(100):
        world.step(0.6, 0.0)
    assert world.pose[0] < 1.0 - world.robot.radius + 5e-3 and world.contact
    assert DOOR in world.arena.walls and DOOR not in other.arena.walls


def test_a_door_does_not_close_on_a_robot_or_on_a_crate():
    world = yard()
    for wall in (Wall((0.1, -1), (0.1, 1)), Wall((2.1, 0), (2.1, 3))):
        with pytest.raises(ValueError, match="wall: something stands between"):
            shut(world, wall)
    assert len(world.arena.walls) == 1
    with pytest.raises(TypeError, match="wall: expected Wall"):
        shut(world, ((0, 1), (1, 1)))
    shut(world, Wall((2.5, 2.0), (3.5, 2.0)))  # walls may meet


def test_a_crate_that_is_carried_is_where_it_was_put_and_at_rest():
    world = yard()
    carry(world, 0, [1.0, 0.0, 0.5])
    assert world.crates[0] == pytest.approx([1.0, 0.0, 0.5])
    assert ahead(world) < 0.8
    for _ in range(20):
        world.step(0.0, 0.0)
    assert world.crates[0] == pytest.approx([1.0, 0.0, 0.5], abs=1e-9)


def test_a_crate_is_not_put_into_the_robot_a_wall_or_a_cylinder_and_stays_where_it_was():
    arena = Arena("a", walls=(Wall((3, -2), (3, 2)),), cylinders=(Cylinder((0, 2)),), crates=(Crate((2.0, 1.5, 0.0)),))
    world = World(arena, seed=1)
    for pose in ([0.3, 0.0, 0.0], [3.1, 0.0, 0.0], [0.1, 2.0, 0.0]):
        with pytest.raises(ValueError, match="something else stands where crate 0"):
            carry(world, 0, pose)
    with pytest.raises(ValueError, match="pose: expected finite"):
        carry(world, 0, [0, np.nan, 0])
    with pytest.raises(IndexError, match="expected one of 1 crates"):
        carry(world, 1, [0, 1, 0])
    assert world.crates[0] == pytest.approx([2.0, 1.5, 0.0])


def test_a_crate_that_is_carried_round_a_robot_that_touches_it_leaves_the_robot_free():
    world = World(Arena("a", crates=(Crate((0.5, 0.0, 0.0), mass=50.0),)), seed=1)
    for _ in range(40):
        world.step(0.5, 0.0)
    assert world.contact
    carry(world, 0, world.crates[0] - [2 * (world.crates[0, 0] - world.pose[0]), 0.0, 0.0])
    for _ in range(40):
        world.step(0.5, 0.0)
    assert world.velocity[0] > 0.4
