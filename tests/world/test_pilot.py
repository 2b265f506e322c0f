import numpy as np
import pytest

from coursekit.world.arena import Arena, Wall
from coursekit.world.pilot import PID, Pilot, drive, octagon, polygon, square
from coursekit.world.robot import World

OPEN = Arena("open")


@pytest.mark.parametrize("waypoints", [square(), octagon(), square(laps=2), octagon(side=0.3)], ids=len)
def test_the_pilot_visits_every_waypoint_in_order_and_stops_at_the_last(waypoints):
    world = World(OPEN, 1)
    reached = 0
    for step in drive(world, waypoints):
        if step.waypoint > reached:
            # Told one period after it arrived: by then the robot has gone on a little.
            assert step.waypoint == reached + 1
            assert np.hypot(*(world.pose[:2] - waypoints[reached])) < 0.03 + 0.5 * world.dt
            reached = step.waypoint
    assert reached == len(waypoints) and step.arrived
    assert np.hypot(*(world.pose[:2] - waypoints[-1])) < 0.06
    assert world.velocity == pytest.approx([0, 0, 0], abs=1e-6)


@pytest.mark.parametrize(("make", "corners", "side"), [(square, 4, 2.0), (octagon, 8, 0.75)])
def test_paths_are_regular_counter_clockwise_and_of_the_reports_size(make, corners, side):
    path = make()
    assert path.shape == (corners, 2)
    edges = np.roll(path, -1, axis=0) - path
    assert np.hypot(*edges.T) == pytest.approx(side)
    following = np.roll(edges, -1, axis=0)
    turns = np.arctan2(edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0], (edges * following).sum(axis=1))
    assert turns == pytest.approx(2 * np.pi / corners)
    assert path.mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert make(laps=3, centre=(1, 2)) == pytest.approx(np.tile(path, (3, 1)) + np.array([1, 2]))


def test_the_robot_keeps_close_to_the_straight_line_between_waypoints():
    world = World(OPEN, 2)
    world_path = [world.pose[:2] for _ in drive(world, [[3.0, 0.0], [3.0, 3.0]])]
    off = [min(abs(y), abs(x - 3.0)) for x, y in world_path]
    assert max(off) < 0.1


def test_a_pilot_that_arrives_at_speed_still_ends_at_a_stop():
    world = World(OPEN, 2)
    speeds = [world.velocity[0] for _ in drive(world, [[3.0, 0.0]], Pilot(speed=1.0, tolerance=0.5))]
    assert max(speeds) > 0.7
    assert world.velocity == pytest.approx([0, 0, 0], abs=1e-6)


def test_the_world_moves_only_while_the_caller_iterates():
    world = World(OPEN, 1)
    steps = drive(world, square())
    assert world.time == 0
    assert next(steps).time == world.time == pytest.approx(world.dt)


def test_driving_backwards_keeps_the_nose_where_it_was():
    world = World(OPEN, 3)
    headings = [world.pose[2] for _ in drive(world, [[-4.0, 0.0]], Pilot(speed=1.0, reverse=True))]
    assert world.pose[0] < -3.9
    assert np.abs(headings).max() < 0.3


def test_the_pilot_can_steer_by_an_estimate_instead_of_the_truth():
    world = World(OPEN, 4)
    for _ in drive(world, [[2.0, 0.0]], pose=lambda: world.pose + np.array([0.5, 0.0, 0.0])):
        pass
    assert world.pose[0] == pytest.approx(1.5, abs=0.1)


def test_a_blocked_robot_gives_up_and_says_where():
    world = World(Arena("wall", walls=(Wall((1, -3), (1, 3)),)), 5)
    with pytest.raises(TimeoutError, match=r"waypoint 0.*stuck"):
        for _ in drive(world, [[2.0, 0.0]], timeout=5.0):
            pass
    assert world.time < 6.0


def test_waypoints_and_settings_that_make_no_sense_are_refused_before_anything_moves():
    world = World(OPEN, 0)
    for waypoints in ([[1.0, 2.0, 3.0]], [[np.nan, 0.0]], np.zeros((2, 2, 2))):
        with pytest.raises(ValueError, match="waypoints"):
            drive(world, waypoints)
    with pytest.raises(ValueError, match="tolerance"):
        Pilot(tolerance=0.0)
    with pytest.raises(ValueError, match="side"):
        square(side=-1.0)
    assert world.time == 0


def test_a_pid_loop_is_the_textbooks():
    loop = PID(kp=2.0, ki=0.5, kd=0.1)
    assert loop(1.0, 0.5) == pytest.approx(2.0 + 0.5 * 0.5)
    assert loop(0.6, 0.5) == pytest.approx(1.2 + 0.5 * 0.8 + 0.1 * (0.6 - 1.0) / 0.5)
    loop.reset()
    assert loop(1.0, 0.5) == pytest.approx(2.25)


def test_the_integral_does_not_wind_up_while_the_output_is_at_its_limit():
    loop = PID(kp=1.0, ki=1.0, limit=1.0)
    assert [loop(10.0, 1.0) for _ in range(50)] == [1.0] * 50
    assert loop(-0.1, 1.0) == pytest.approx(-0.2)


@pytest.mark.parametrize("lost", [[np.nan, 0, 0], [0, 0, np.inf], [0, 0]])
def test_a_pilot_that_does_not_know_where_it_is_has_not_arrived(lost):
    world = World(Arena("nowhere"), seed=1)
    with pytest.raises(ValueError, match="pose: expected finite"):
        list(drive(world, [[5, 0]], pose=lambda: lost))
    assert world.time == 0


def test_settings_of_a_drive_that_are_no_numbers_are_refused():
    for name in ("speed", "turn_rate", "tolerance"):
        with pytest.raises(ValueError, match=f"{name}: expected one finite number > 0"):
            Pilot(**{name: np.nan})
        with pytest.raises(TypeError, match=f"{name}: expected real numbers"):
            Pilot(**{name: "fast"})
    with pytest.raises(ValueError, match="corners: expected a whole number ≥ 3"):
        polygon(4.5, 1.0)
    with pytest.raises(ValueError, match="centre: expected finite"):
        square(centre=(0, np.nan))
    with pytest.raises(ValueError, match="timeout: expected one number ≥ 0"):
        drive(World(Arena("nowhere"), seed=1), [[5, 0]], timeout=np.nan)
    for bad in (PID(1.0), "lab"):
        with pytest.raises(TypeError, match="world: expected a World"):
            drive(bad, [[5, 0]])


def test_a_pid_loop_refuses_what_would_stay_in_its_integral_for_ever():
    for limit in (-1, 0, np.nan):
        with pytest.raises(ValueError, match="limit: expected one number > 0"):
            PID(1.0, limit=limit)
    with pytest.raises(TypeError, match="kd: expected real numbers"):
        PID(1.0, kd="some")
    loop = PID(1.0, ki=1.0, kd=1.0)
    for error, dt, name in ((np.nan, 0.1, "error"), (1.0, 0.0, "dt"), (1.0, np.nan, "dt"), ([1.0], 0.1, "error")):
        with pytest.raises(ValueError, match=f"{name}: expected one finite number"):
            loop(error, dt)
    assert loop(1.0, 0.5) == pytest.approx(1.5)
