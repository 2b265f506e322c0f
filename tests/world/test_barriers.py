"""Nothing passes a wall: not a thin body, not a fast one, not one that is squeezed."""

import numpy as np
import pytest

from coursekit.geometry import transform
from coursekit.world.arena import Arena, Crate, Cylinder, Wall
from coursekit.world.robot import Robot, World
from tests.world.test_robot import drive

STRIDE = Robot().top_speed * 0.05 / 10  # metres in one substep of the defaults
OVERLAP = STRIDE + 1e-3  # metres that a body may lie in a wall for a moment


def wall(x):
    return (Wall((x, -5), (x, 5)),)


@pytest.mark.parametrize(
    ("crates", "settings", "message"),
    [
        ((), {"dt": 0.25, "substeps": 1}, "the robot is 0.36 m wide and could pass a wall"),
        ((), {"robot": Robot(radius=0.005)}, "the robot is 0.01 m wide and could pass a wall"),
        ((), {"robot": Robot(max_speed=50.0)}, "take more substeps or a smaller dt"),
        ((Crate((1, 0, 0), (0.4, 0.01)),), {}, r"crates\[0\] is 0.01 m wide"),
    ],
)
def test_what_moves_farther_in_a_substep_than_it_is_wide_is_refused_at_the_door(crates, settings, message):
    with pytest.raises(ValueError, match=message):
        World(Arena("w", walls=wall(1.5), crates=crates), 1, **settings)


def test_on_an_empty_plane_there_is_nothing_to_pass_and_any_step_will_do():
    world = World(Arena("plane"), 1, dt=0.25, substeps=1)
    assert drive(world, [(1.3, 0.0)] * 20)[-1, 0] > 4


def test_more_substeps_let_the_same_robot_in_and_the_wall_stops_it():
    world = World(Arena("w", walls=wall(1)), 1, dt=0.25, substeps=20)
    assert (
        drive(world, [(1.3, 0.0)] * 20)[:, 0].max() < 1 - world.robot.radius + world.robot.top_speed * 0.25 / 20 + 1e-3
    )


@pytest.mark.parametrize("mass", [1e-4, 1e-3, 2e-3, 0.1, 1.0])
def test_a_thin_crate_that_is_pressed_against_a_wall_stays_before_it_and_the_robot_before_the_crate(mass):
    world = World(Arena("w", walls=wall(2), crates=(Crate((1, 0, 0), (0.02, 0.4), mass),)), 1)
    poses, sides = [], []
    for _ in range(150):
        world.step(1.3, 0.0)
        poses.append(world.pose[0])
        sides.append(transform(world.crates[0], world.arena.crates[0].corners)[:, 0].max())
    assert max(sides) < 2 + OVERLAP
    assert max(poses) < 2 - 0.02 - world.robot.radius + 2 * OVERLAP
    assert world.crates[0, 0] > 1.9  # it was pushed there, not left behind


def test_what_is_pressed_against_a_wall_can_be_left_again():
    world = World(Arena("w", walls=wall(2), crates=(Crate((1, 0, 0), (0.02, 0.4), 0.1),)), 1)
    drive(world, [(1.3, 0.0)] * 100)
    assert drive(world, [(-0.5, 0.0)] * 40)[-1, 0] < 1.3
    assert not world.contact


@pytest.mark.parametrize("mass", [1e-4, 1e-3, 2e-3])
@pytest.mark.parametrize(("y", "turn"), [(0.0, 0.0), (0.05, 0.3)])
def test_a_crate_of_a_gram_is_pushed_and_not_shot(mass, y, turn):
    world = World(Arena("open", crates=(Crate((0.6, y, turn), (0.3, 0.3), mass),)), 1)
    places = [world.crates[0, :2]]
    for _ in range(60):
        world.step(1.0, 0.0)
        places.append(world.crates[0, :2])
    speeds = np.hypot(*np.diff(places, axis=0).T) / world.dt
    assert 0.5 < speeds.max() < 1.2
    if turn == 0.0:
        assert places[-1][0] - world.pose[0] == pytest.approx(0.15 + world.robot.radius, abs=0.01)


def test_a_crate_of_a_gram_goes_no_faster_than_the_robot_could_push_it_even_when_it_slips_out_of_a_corner():
    fastest = []
    for seed in range(18):
        rng = np.random.default_rng(seed)
        size = tuple(rng.choice([0.05, 0.1, 0.2, 0.4], 2))
        crates = [Crate((0.6, rng.uniform(-0.2, 0.2), rng.uniform(-3, 3)), size, 1e-3)]
        crates.append(Crate((1.2, rng.uniform(-0.2, 0.2), rng.uniform(-3, 3)), size, 1e-3))
        world = World(Arena("w", walls=wall(1.6), crates=tuple(crates)), rng)
        places = []
        for _ in range(60):
            world.step(1.0, rng.uniform(-0.5, 0.5))
            places.append(world.crates[:, :2])
        fastest.append(np.linalg.norm(np.diff(places, axis=0), axis=-1).max() / world.dt)
    assert max(fastest) < 1.05 * world.robot.top_speed


def test_a_body_that_is_held_against_a_wall_does_not_sink_into_it():
    for seed in (1, 2, 3):
        world = World(Arena("w", walls=wall(2)), seed)
        drive(world, [(1.3, 0.0)] * 200)
        assert world.pose[0] < 2 - world.robot.radius + 1.2e-3


def test_pushing_a_crate_is_no_squeeze_and_goes_on_smoothly():
    """The guard must not meddle with what the engine solves by itself: no standstill on the way."""
    world = World(Arena("crate", walls=wall(9), crates=(Crate((0.8, 0.0, 0.0), (0.4, 0.4), 1.0),)), 3)
    poses = drive(world, [(0.3, 0.0)] * 200)
    assert np.diff(poses[60:, 0]).min() > 0.25 * world.dt


def furnished_room(rng):
    """A closed room with a partition, a pole and some crates, thin or light or both; the robot starts at its centre."""
    half = rng.uniform(1.0, 1.6, 2)
    corners = half * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    walls = [Wall(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    walls.append(Wall((0.5, -half[1]), (0.5, -0.4)))
    pole = Cylinder((-0.6, 0.6), 0.02)
    radius = float(rng.choice([0.02, 0.05, 0.1, 0.18]))
    crates = []
    for _ in range(40):
        size = rng.choice([0.02, 0.05, 0.1, 0.4]), rng.choice([0.05, 0.2, 0.4])
        reach = 0.5 * np.hypot(*size) + 0.01
        x, y = rng.uniform(reach - half, half - reach)
        free = np.hypot(x, y) > reach + radius and abs(x - 0.5) > reach and np.hypot(x + 0.6, y - 0.6) > reach + 0.02
        apart = all(np.hypot(x - c.pose[0], y - c.pose[1]) > reach + 0.5 * np.hypot(*c.size) for c in crates)
        if free and apart and len(crates) < 4:
            crates.append(Crate((x, y, rng.uniform(-3, 3)), size, 10 ** rng.uniform(-4, 1)))
    return Arena("room", walls=tuple(walls), cylinders=(pole,), crates=tuple(crates)), radius, half


@pytest.mark.parametrize("seed", range(900, 924))
def test_however_the_robot_is_driven_nothing_leaves_the_room(seed):
    """The bound holds whatever the seed; on 551 other rooms the deepest overlap was a stride and SLACK, just that."""
    rng = np.random.default_rng(seed)
    arena, radius, half = furnished_room(rng)
    world = World(arena, rng, Robot(radius=radius))
    beyond = []
    for _ in range(12):
        command = rng.uniform(-1.5, 1.5), rng.uniform(-3, 3) * rng.integers(2)
        for _ in range(10):
            world.step(*command)
            beyond.append(np.max(np.abs(world.pose[:2]) + radius - half))
            beyond += [
                np.max(np.abs(transform(pose, crate.corners)) - half)
                for pose, crate in zip(world.crates, arena.crates, strict=True)
            ]
    assert max(beyond) < OVERLAP + 1e-9
