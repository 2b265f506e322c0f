r"""A pilot that drives a robot from waypoint to waypoint with two PID loops.

The heading loop turns the robot towards the waypoint; the speed loop drives at the distance that remains, as far
as the heading error allows.  By default the pilot steers by the true pose, as the reports' robots did by their
own; give ``drive`` a ``pose`` function to steer by an estimate.

>>> from coursekit.world.arena import Arena
>>> from coursekit.world.robot import World
>>> world = World(Arena("nowhere"), seed=1)
>>> for step in drive(world, square(1.0)):
...     pass
>>> step.waypoint, step.waypoints, step.arrived
(4, 4, True)

Source: Åström & Hägglund (1995), chapter 3, for the loop with its anti-windup.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, inverse, transform
from coursekit.world._checks import count, number
from coursekit.world.robot import World


@dataclass
class PID:
    """A proportional-integral-derivative loop with a bounded output.

    kp, ki, kd : gains: output per error, per error · second, per error / second.
    limit : of the output's size, > 0; the integral holds still while the output is at it (anti-windup).

    Raises ValueError for gains that are not finite and for a limit that is not positive, TypeError for no numbers.

    >>> loop = PID(kp=2.0, limit=1.0)
    >>> loop(0.1, dt=0.05), loop(3.0, dt=0.05)
    (0.2, 1.0)
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    limit: float = np.inf

    def __post_init__(self) -> None:
        for gain in ("kp", "ki", "kd"):
            number(getattr(self, gain), gain)
        number(self.limit, "limit", above=0.0, most=np.inf)
        self.reset()

    def reset(self) -> None:
        """Forget the past: what a new waypoint asks for."""
        self._integral = 0.0
        self._last: float | None = None

    def __call__(self, error: float, dt: float) -> float:
        """The output for this error, ``dt`` seconds after the last one.

        Raises ValueError for an error that is not finite, and for dt ≤ 0, which would stay in the integral for ever;
        TypeError for what is no number.  The loop is then as it was.
        """
        error, dt = number(error, "error"), number(dt, "dt", above=0.0)
        slope = 0.0 if self._last is None else (error - self._last) / dt
        self._last = error
        wanted = self.kp * error + self.ki * (self._integral + error * dt) + self.kd * slope
        if abs(wanted) <= self.limit:
            self._integral += error * dt
        return float(np.clip(wanted, -self.limit, self.limit))


@dataclass(frozen=True)
class Step:
    """Where a drive stands after one control period.

    control : [v, ω] as commanded.     waypoint : how many of the ``waypoints`` are reached.
    """

    time: float
    control: Array
    waypoint: int
    waypoints: int

    @property
    def arrived(self) -> bool:
        """Is the last waypoint reached?"""
        return self.waypoint == self.waypoints


@dataclass
class Pilot:
    """Steers to one point at a time.

    speed, turn_rate : the most it commands, m/s and rad/s.
    tolerance : distance from a waypoint, m, at which it counts as reached.
    reverse : drive with the back in front, so that a camera keeps looking at what is left behind.

    Raises ValueError for a speed, turn_rate or tolerance that is not positive.
    """

    speed: float = 0.5
    turn_rate: float = 1.5
    tolerance: float = 0.03
    reverse: bool = False

    def __post_init__(self) -> None:
        for name in ("speed", "turn_rate", "tolerance"):
            number(getattr(self, name), name, above=0.0)
        self._heading = PID(kp=3.0, ki=0.2, kd=0.1, limit=self.turn_rate)
        self._distance = PID(kp=1.5, kd=0.05, limit=self.speed)

    def reset(self) -> None:
        """Start afresh for a new waypoint."""
        self._heading.reset()
        self._distance.reset()

    def control(self, pose: ArrayLike, goal: ArrayLike, dt: float) -> Array:
        """The command [v, ω] that takes T_world_robot = ``pose`` (3,) towards ``goal`` (2,) in the world."""
        x, y = transform(inverse(pose), goal)  # as the robot sees it
        way = -1.0 if self.reverse else 1.0
        bearing = float(np.arctan2(way * y, way * x))
        turn = self._heading(bearing, dt)
        # Facing away, the robot turns on the spot first: that keeps its path close to the straight line.
        facing = max(np.cos(bearing), 0.0) ** 3
        return np.array([way * facing * self._distance(float(np.hypot(x, y)), dt), turn])


def drive(
    world: World,
    waypoints: ArrayLike,
    pilot: Pilot | None = None,
    *,
    pose: Callable[[], ArrayLike] | None = None,
    timeout: float = 60.0,
) -> Iterator[Step]:
    """Drive through the waypoints and stop; yields a ``Step`` after each control period of the world.

    Parameters
    ----------
    waypoints : (n, 2), m, in the world.
    pose : where the pilot believes to be, asked before each period; the default is the truth.
    timeout : seconds of the world's time that one leg may take.

    The world advances only while the caller iterates, which makes this the loop to hang sensors, recorders and
    progress bars on.  Raises ValueError for waypoints that are not finite (n, 2) and for a pose that is not a finite
    [x, y, θ], TypeError for what is no world, TimeoutError when a leg takes too long: something stands in the way.
    """
    if not isinstance(world, World):
        raise TypeError(f"world: expected a World, got {world!r}")
    waypoints = np.atleast_2d(as_numbers(waypoints, "waypoints"))
    if waypoints.ndim != 2 or waypoints.shape[1] != 2 or not np.all(np.isfinite(waypoints)):
        raise ValueError(f"waypoints: expected finite points of shape (n, 2), got {waypoints}")
    seconds = number(timeout, "timeout", least=0.0, most=np.inf)
    return _drive(world, waypoints, pilot or Pilot(), pose or (lambda: world.pose), seconds)


def _drive(
    world: World, waypoints: Array, pilot: Pilot, pose: Callable[[], ArrayLike], timeout: float
) -> Iterator[Step]:
    def where() -> Array:
        here = as_numbers(pose(), "pose")
        if here.shape != (3,) or not np.all(np.isfinite(here)):  # else NaN would count as arrived
            raise ValueError(f"pose: expected finite [x, y, θ], got {here}")
        return here

    for reached, goal in enumerate(waypoints):
        pilot.reset()
        deadline = world.time + timeout
        while np.hypot(*(goal - where()[:2])) > pilot.tolerance:
            if world.time > deadline:
                raise TimeoutError(f"waypoint {reached}, {goal}: expected to arrive within {timeout} s, "
                                   f"got stuck at {where()[:2].round(3)}")  # fmt: skip
            yield _advance(world, pilot.control(where(), goal, world.dt), reached, len(waypoints))
    stop = np.zeros(2)
    yield _advance(world, stop, len(waypoints), len(waypoints))
    while np.any(np.abs(world.wheels) > 1e-9):
        yield _advance(world, stop, len(waypoints), len(waypoints))


def _advance(world: World, control: Array, reached: int, waypoints: int) -> Step:
    world.step(*control)
    return Step(world.time, control, reached, waypoints)


def square(side: float = 2.0, laps: int = 1, centre: ArrayLike = (0.0, 0.0)) -> Array:
    """Corners of a square round ``centre``, counter-clockwise from its south-east corner, (4 laps, 2).

    The default side is the report's.
    """
    return polygon(4, side, laps, centre)


def octagon(side: float = 0.75, laps: int = 1, centre: ArrayLike = (0.0, 0.0)) -> Array:
    """Corners of a regular octagon round ``centre``, counter-clockwise, (8 laps, 2); the report's side by default."""
    return polygon(8, side, laps, centre)


def polygon(corners: int, side: float, laps: int = 1, centre: ArrayLike = (0.0, 0.0)) -> Array:
    """Corners of a regular polygon with its first side on the right, running up from below, (corners × laps, 2)."""
    corners, side, laps = count(corners, "corners", least=3), number(side, "side", above=0.0), count(laps, "laps")
    radius = 0.5 * side / np.sin(np.pi / corners)
    turn = 2 * np.pi * (np.arange(corners) - 0.5) / corners
    ring = radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    middle = as_numbers(centre, "centre")
    if middle.shape != (2,) or not np.all(np.isfinite(middle)):
        raise ValueError(f"centre: expected finite [x, y], got {centre!r}")
    return middle + np.tile(ring, (laps, 1))
