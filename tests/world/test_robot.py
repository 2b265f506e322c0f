import hashlib
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from coursekit.geometry import between
from coursekit.models import DifferentialDrive, pose_residual
from coursekit.world.arena import Arena, Crate, Cylinder, Wall
from coursekit.world.robot import Robot, World
from tests.work import within

OPEN = Arena("open")
SURE_FOOTED = Robot(slip=0.0)


def drive(world, commands):
    """Poses before the first and after each command, (n + 1, 3)."""
    poses = [world.pose]
    for v, omega in commands:
        world.step(v, omega)
        poses.append(world.pose)
    return np.array(poses)


def fingerprint(seed=3):
    """Everything that a drive into crates and walls of the lab leaves behind, as a hash."""
    world = World(Arena.load("lab"), seed)
    digest = hashlib.sha256()
    for k in range(400):
        world.step(0.6, 1.2 * np.sin(k / 30))
        for value in (world.pose, world.velocity, world.odometry, world.wheels, world.crates, world.encoders):
            digest.update(value.tobytes())
    return digest.hexdigest()


def test_two_runs_with_one_seed_give_the_same_bytes_even_in_another_process():
    program = "from tests.world.test_robot import fingerprint; print(fingerprint())"
    there = [
        subprocess.run(
            [sys.executable, "-c", program], env={**os.environ, "PYTHONHASHSEED": hash_seed},
            capture_output=True, text=True, check=True,
        ).stdout.strip()
        for hash_seed in ("0", "1")
    ]  # fmt: skip
    assert {fingerprint(), fingerprint(), *there} == {fingerprint()}
    assert fingerprint(4) != fingerprint()


def test_without_slip_the_robot_follows_the_arcs_that_its_odometry_tells():
    world, motion = World(OPEN, 0, replace(SURE_FOOTED, ticks=10**7)), DifferentialDrive()
    dead_reckoned = world.pose
    for k in range(400):
        world.step(0.5, np.sin(k / 40))
        dead_reckoned = motion.f(dead_reckoned, world.odometry, world.dt)
    assert np.abs(pose_residual(dead_reckoned, world.pose)) == pytest.approx(0, abs=1e-3)


def test_a_full_circle_comes_back_to_its_start():
    world = World(OPEN, 0, SURE_FOOTED)
    poses = drive(world, [(0.5, 0.5)] * 800)
    middle = 0.5 * (poses[400:, :2].max(axis=0) + poses[400:, :2].min(axis=0))
    assert np.hypot(*(poses[400:, :2] - middle).T) == pytest.approx(1.0, abs=2e-3)
    assert world.velocity == pytest.approx([0.5, 0, 0.5], abs=2e-3)


def test_wheels_accelerate_no_faster_than_they_can():
    robot = Robot(max_acceleration=0.5)
    world = World(OPEN, 0, robot)
    speeds = [world.wheels[0] * robot.wheel_radius]
    for _ in range(30):
        world.step(1.0, 0.0)
        speeds.append(world.wheels[0] * robot.wheel_radius)
    assert np.diff(speeds) == pytest.approx(0.5 * world.dt, abs=1e-12)
    assert world.velocity[0] < 0.8


def test_a_command_that_is_too_fast_keeps_its_curvature():
    world = World(OPEN, 0, SURE_FOOTED)
    drive(world, [(5.0, 2.5)] * 60)
    v, omega = world.odometry
    assert omega / v == pytest.approx(0.5, rel=1e-2)
    assert np.abs(world.wheels).max() == pytest.approx(world.robot.max_speed / world.robot.wheel_radius)


def test_odometry_counts_whole_ticks_and_loses_none():
    world = World(OPEN, 1, Robot(ticks=64))
    tick = 2 * np.pi * world.robot.wheel_radius / 64
    travelled = np.zeros(2)
    for k in range(200):
        world.step(0.4, 0.3 * np.cos(k / 20))
        counted = world.robot.rim_speeds(*world.odometry) * world.dt / tick
        assert counted == pytest.approx(np.round(counted), abs=1e-9)
        travelled += counted
    assert travelled == pytest.approx(world.encoders, abs=1e-6)


def test_a_standing_robot_stands_still_and_reads_zero():
    world = World(Arena.load("lab"), 1)
    crates = world.crates
    poses = drive(world, [(0.0, 0.0)] * 50)
    assert np.all(poses == poses[0]) and np.all(world.odometry == 0)
    assert world.crates == pytest.approx(crates, abs=1e-12) and not world.contact
    assert world.time == pytest.approx(2.5)


def test_slip_is_as_large_as_the_robots_data_sheet_says():
    """4,000 steps; each entry of the covariance within 4 standard errors: false alarm below 3e-4."""
    world = World(OPEN, 5)
    poses, odometry = [world.pose], []
    for _ in range(4000):
        world.step(0.6, 0.8)
        poses.append(world.pose)
        odometry.append(world.odometry)
    moved = between(np.array(poses[:-1]), np.array(poses[1:]))
    turned = moved[:, 2] / world.dt
    went = np.hypot(moved[:, 0], moved[:, 1]) / world.dt / np.sinc(moved[:, 2] / 2 / np.pi)
    error = (np.stack([went, turned], axis=-1) - odometry)[100:]
    expected = world.robot.odometry_cov(0.6, 0.8, world.dt)
    sigma = np.sqrt(np.diag(expected))
    standard_error = np.sqrt((np.outer(sigma, sigma) ** 2 + expected**2) / len(error))
    assert np.all(np.abs(np.cov(error.T) - expected) < 4 * standard_error)
    assert np.all(np.abs(error.mean(axis=0)) < 4 * sigma / np.sqrt(len(error)))
    # Independent from step to step, so that a filter's Q per step is the whole story.
    for e in error.T:
        assert abs(np.corrcoef(e[:-1], e[1:])[0, 1]) < 4 / np.sqrt(len(e))


@pytest.mark.parametrize(
    "obstacle",
    [
        Arena("wall", walls=(Wall((1, -2), (1, 2)),)),
        Arena("cylinder", cylinders=(Cylinder((1.1, 0.0), 0.1),)),
        Arena("heavy crate", crates=(Crate((1.2, 0.0, 0.0), (0.4, 0.8), 50.0),)),
    ],
    ids=lambda arena: arena.name,
)
def test_an_obstacle_stops_the_body_but_not_the_odometry(obstacle):
    world = World(obstacle, 2)
    poses = drive(world, [(0.5, 0.0)] * 120)
    assert poses[:, 0].max() < 1.0 - world.robot.radius + 0.01
    assert world.contact
    assert abs(world.velocity[0]) < 0.05 and world.odometry[0] == pytest.approx(0.5, abs=0.01)


def test_contact_is_told_only_while_it_lasts():
    world = World(Arena("wall", walls=(Wall((0.6, -2), (0.6, 2)),)), 2)
    flags = []
    for v in [0.4] * 40 + [-0.4] * 40:
        world.step(v, 0.0)
        flags.append(world.contact)
    assert not flags[0] and flags[39] and not flags[-1]


def test_a_light_crate_is_pushed_stops_with_the_robot_and_costs_it_some_speed():
    world = World(Arena("crate", crates=(Crate((0.8, 0.0, 0.0), (0.4, 0.4), 1.0),)), 3)
    drive(world, [(0.3, 0.0)] * 140)
    pushed = world.crates[0, 0]
    assert pushed > 1.2
    assert world.crates[0, 0] - world.pose[0] == pytest.approx(0.2 + world.robot.radius, abs=0.01)
    drive(world, [(0.0, 0.0)] * 60)
    assert world.crates[0, 0] - pushed < 0.05


def test_a_fast_robot_does_not_tunnel_through_a_wall():
    world = World(Arena("wall", walls=(Wall((2, -2), (2, 2)),)), 4, Robot(max_speed=5, max_acceleration=10))
    poses = drive(world, [(5.0, 0.0)] * 60)
    assert poses[:, 0].max() < 2 - 0.15


def test_friction_bounds_how_fast_the_body_follows_the_wheels():
    """On ice the wheels spin: the body gains at most µ g."""
    world = World(OPEN, 0, Robot(traction=0.05, max_acceleration=10.0, slip=0.0))
    drive(world, [(1.0, 0.0)] * 20)
    assert world.velocity[0] == pytest.approx(0.05 * 9.81 * 1.0, rel=0.01)
    assert world.odometry[0] > 0.9


def test_a_robot_may_not_start_inside_something():
    with pytest.raises(ValueError, match="inside something"):
        World(Arena("blocked", cylinders=(Cylinder((0.2, 0.0)),)), 0)
    with pytest.raises(ValueError, match="inside something"):
        World(Arena("blocked", walls=(Wall((0.1, -1), (0.1, 1)),)), 0)


def test_commands_and_settings_that_make_no_sense_are_refused():
    world = World(OPEN, 0)
    with pytest.raises(ValueError, match="command"):
        world.step(np.nan, 0.0)
    with pytest.raises(ValueError, match="dt"):
        World(OPEN, 0, dt=0.0)
    with pytest.raises(ValueError, match="track"):
        Robot(track=-1.0)
    assert world.time == 0


def test_what_the_world_hands_out_cannot_be_used_to_move_it():
    world = World(Arena.load("lab"), 0)
    world.step(0.5, 0.1)
    before = world.pose.copy(), world.odometry.copy(), world.crates.copy()
    for value in (world.pose, world.odometry, world.crates, world.wheels, world.encoders):
        value += 1
    assert all(np.array_equal(a, b) for a, b in zip(before, (world.pose, world.odometry, world.crates), strict=True))


def test_headings_are_wrapped_however_often_things_turned():
    world = World(Arena("turned", crates=(Crate((2, 0, 7.0)),), start=(0, 0, 9.0)), 0)
    assert world.pose[2] == pytest.approx(9.0 - 2 * np.pi)
    assert world.crates[0, 2] == pytest.approx(7.0 - 2 * np.pi)


def test_rim_and_body_speeds_are_each_others_inverse():
    robot = Robot()
    assert robot.body_speeds(robot.rim_speeds(0.4, -1.1)) == pytest.approx([0.4, -1.1])
    assert robot.rim_speeds(0.0, 1.0)[1] > 0  # turning left, the right wheel goes ahead


def test_a_second_of_physics_is_some_sixteen_thousand_calls():
    """benchmarks/world.py measures how fast that is; this only catches a collapse."""
    world = World(Arena.load("lab"), 0)
    within(40_000 * 10, lambda: drive(world, [(0.5, 0.6)] * 200))
    assert world.time == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: World("lab", 1), r"arena: expected Arena\(…\), got 'lab'; Arena.load\('lab'\) reads one"),
        (lambda: World(OPEN, 1, robot=0.03), r"robot: expected Robot\(…\), got 0.03"),
        (lambda: World(OPEN, 1).step("fast", 0.0), "command: expected real numbers"),
        (lambda: Robot(slip="little"), "slip: expected real numbers"),
        (lambda: World(OPEN, 1, dt="short"), "dt: expected real numbers"),
        (lambda: World(OPEN, 1, substeps="ten"), "substeps: expected real numbers"),
    ],
)
def test_what_is_of_the_wrong_kind_is_named_with_what_was_expected(make, message):
    with pytest.raises(TypeError, match=message):
        make()


def test_commands_and_substeps_are_single_whole_things():
    with pytest.raises(ValueError, match="command: expected finite"):
        World(OPEN, 1).step(np.array([0.5]), np.array([0.0]))
    with pytest.raises(ValueError, match="command: expected"):
        World(OPEN, 1).step(np.array([0.5]), 0)
    for substeps in (2.7, 0, np.nan, True, [1]):
        with pytest.raises(ValueError, match="substeps: expected a whole number ≥ 1"):
            World(OPEN, 1, substeps=substeps)
    for dt in (-0.1, np.inf, [0.1]):
        with pytest.raises(ValueError, match="dt: expected one finite number > 0"):
            World(OPEN, 1, dt=dt)


def test_the_guard_leaves_a_free_robot_alone_at_full_speed_and_in_a_full_spin():
    """Wheels that slip forwards carry it beyond its rims' speed; a spin moves no point of a disc into anything."""
    world = World(OPEN, 6, Robot(slip=0.1))
    poses = drive(world, [(1.3, 0.0)] * 300)[60:]
    speeds = np.hypot(*np.diff(poses[:, :2], axis=0).T) / world.dt
    assert speeds.max() > 1.45 and speeds.mean() == pytest.approx(1.3, abs=0.03)
    spinning = World(OPEN, 0, SURE_FOOTED)
    drive(spinning, [(0.0, 20.0)] * 80)
    assert spinning.velocity[2] == pytest.approx(2 * 1.3 / spinning.robot.track, rel=1e-3)
