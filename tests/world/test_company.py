"""Several robots in one world."""

import numpy as np
import pytest

from coursekit.world.arena import Arena, Wall
from coursekit.world.lidar import Lidar
from coursekit.world.robot import Robot, World

HALL = Arena("hall", walls=(Wall((-3, -3), (6, -3)), Wall((-3, 3), (6, 3))))
STARTS = [[0.0, 1.0, 0.0], [0.0, -1.0, 0.5]]


def drive(world, steps, v, omega, others=()):
    for _ in range(steps):
        world.step(v, omega, others)
    return world


def test_far_apart_the_first_robot_drives_as_if_it_were_alone():
    alone = drive(World(HALL, seed=3), 40, 0.5, 0.2)
    company = drive(World(HALL, seed=3, others=STARTS), 40, 0.5, 0.2, [[0.3, 0.0], [0.1, 0.0]])
    np.testing.assert_array_equal(company.pose, alone.pose)
    np.testing.assert_array_equal(company.encoders, alone.encoders)


def test_each_robot_follows_its_own_command_and_counts_its_own_ticks():
    world = drive(World(HALL, seed=3, robot=Robot(slip=0.0), others=STARTS), 40, 0.0, 0.0, [[0.5, 0.0], [0.0, 1.0]])
    ahead, turning = world.others
    np.testing.assert_array_equal(world.pose, [0.0, 0.0, 0.0])
    assert ahead.pose[0] > 0.8 and abs(ahead.pose[1] - 1.0) < 1e-6 and ahead.odometry[0] == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(turning.pose[:2], [0.0, -1.0], atol=1e-6)
    assert turning.pose[2] > 2.0 and turning.encoders[0] == -turning.encoders[1] - 1
    assert (ahead.encoders > 0).all() and not world.encoders.any()


def test_slip_is_drawn_for_each_robot_by_itself():
    world = drive(World(HALL, seed=3, others=[[0, 1, 0], [0, -1, 0]]), 40, 0.5, 0.0, [[0.5, 0.0], [0.5, 0.0]])
    turned = [world.pose[2], *(other.pose[2] for other in world.others)]
    assert len(set(np.round(turned, 6))) == 3


def test_robots_bump_and_none_passes_through_the_other():
    world = World(HALL, seed=3, others=[[1.5, 0.0, np.pi], [0.0, 2.0, 0.0]])
    drive(world, 80, 0.8, 0.0, [[0.8, 0.0], [0.0, 0.0]])
    facing, apart = world.others
    assert world.contact and facing.contact and not apart.contact
    gap = np.linalg.norm(world.pose[:2] - facing.pose[:2])
    assert gap == pytest.approx(2 * world.robot.radius, abs=0.01)


def test_without_commands_the_others_brake():
    world = drive(World(HALL, seed=3, others=STARTS), 20, 0.0, 0.0, [[0.5, 0.0], [0.5, 0.0]])
    drive(world, 20, 0.0, 0.0)
    assert all(abs(other.velocity[0]) < 1e-3 for other in world.others)


def test_a_lidar_sees_the_others_and_not_the_robot_that_carries_it():
    world, lidar = World(HALL, seed=3, others=[[2.0, 0.0, np.pi]]), Lidar(beams=4)
    ahead = int(np.argmin(np.abs(lidar.angles)))
    assert lidar.scan(world).ranges[ahead] == pytest.approx(2.0 - world.robot.radius)
    theirs = lidar.scan(world, pose=world.others[0].pose)
    assert theirs.ranges[ahead] == pytest.approx(2.0 - world.robot.radius)
    assert Lidar(beams=4).scan(World(HALL, seed=3)).ranges[ahead] == np.inf


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda: World(HALL, seed=1, others=[[1.0, 0.0]]), r"others: expected a finite start \[x, y, θ\]"),
        (lambda: World(HALL, seed=1, others=[[0.1, 0.0, 0.0]]), "would start inside something"),
        (lambda: World(HALL, seed=1, others=[[1.0, 3.0, 0.0]]), "would start inside something"),
        (lambda: World(HALL, seed=1, others=STARTS).step(0.1, 0.0, [[0.1, 0.0]]), r"\[v, ω\] for each of 2"),
        (lambda: World(HALL, seed=1).step(0.1, 0.0, [[0.1, 0.0]]), r"\[v, ω\] for each of 0"),
    ],
)
def test_what_no_company_can_be_is_refused(act, said):
    with pytest.raises(ValueError, match=said):
        act()
