r"""A lidar that turns once and returns a range for each of its beams.

Walls, cylinders and crates are segments and circles; a beam is a half-line.  Casting is one array operation, beams
by things, with no loop.  Frames: ``Scan.angles`` and ``Scan.points()`` are the robot's (x forward, y left), and the
lidar sits on the robot's centre.  The whole turn is taken at one instant, from one pose.

>>> from coursekit.world.arena import Arena, Wall
>>> yard = Arena("yard", walls=(Wall((2, -1), (2, 1)),))
>>> scan = Lidar(beams=4).scan(yard, pose=(0.5, 0, 0))
>>> scan.ranges                       # to the left, ahead, to the right, behind: -90°, 0°, 90°, 180°
array([inf, 1.5, inf, inf])
>>> scan.points()
array([[1.5, 0. ]])
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, transform
from coursekit.world._checks import count, number
from coursekit.world.arena import Arena
from coursekit.world.robot import World

ON_THE_LINE = 1e-9  # metres


@dataclass(frozen=True)
class Scan:
    """One turn of the lidar.

    angles : (n,) directions of the beams in the robot's frame, radians.
    ranges : (n,) metres; ``inf`` where nothing stands within reach, never NaN.
    """

    angles: Array
    ranges: Array

    def points(self) -> Array:
        """What the beams hit, in the robot's frame, (m, 2), m ≤ n: beams that came back empty are left out."""
        hit = np.isfinite(self.ranges)
        angles, ranges = self.angles[hit], self.ranges[hit]
        return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)


@dataclass(frozen=True)
class Lidar:
    """What the lidar is made of.

    beams : in a full turn, evenly spread over (-π, π], counter-clockwise; the last one looks backwards.
    max_range : m; what stands further off is not seen and its beam reads ``inf``.
    sigma : standard deviation of a range's white noise, m.

    Raises ValueError for beams that are no whole number ≥ 1, a max_range ≤ 0 and a sigma that is negative or not
    finite, TypeError for what is no number.
    """

    beams: int = 360
    max_range: float = 12.0
    sigma: float = 0.01

    def __post_init__(self) -> None:
        count(self.beams, "beams")
        number(self.max_range, "max_range", above=0.0, most=np.inf)
        number(self.sigma, "sigma", least=0.0)

    @property
    def angles(self) -> Array:
        """Directions of the beams in the robot's frame, (beams,)."""
        return np.asarray(np.pi * (2 * np.arange(1, int(self.beams) + 1) / self.beams - 1))

    def scan(self, world: World | Arena, rng: np.random.Generator | None = None, pose: ArrayLike | None = None) -> Scan:
        """Look around once.

        Parameters
        ----------
        world : a world as it stands now, or an arena with its crates where its file put them.
        rng : of the noise; without one the ranges are exact.
        pose : T_world_robot (3,); the default is where the world's robot is, or the arena's start.

        A range that noise would make negative is 0.  Raises ValueError for a pose that is not a finite [x, y, θ],
        TypeError for what is neither a world nor an arena.
        """
        if not isinstance(world, (World, Arena)):
            hint = f"; Arena.load({world!r}) reads one" if isinstance(world, str) else ""
            raise TypeError(f"world: expected a World or an Arena, got {world!r}{hint}")
        arena = world.arena if isinstance(world, World) else world
        crates = world.crates if isinstance(world, World) else np.array([c.pose for c in arena.crates]).reshape(-1, 3)
        if pose is None:
            pose = world.pose if isinstance(world, World) else arena.start
        pose = as_numbers(pose, "pose")
        if pose.shape != (3,) or not np.all(np.isfinite(pose)):
            raise ValueError(f"pose: expected finite [x, y, θ], got {pose}")
        starts, ends, centres, radii = _surfaces(arena, crates)
        if isinstance(world, World) and world.others:
            there = np.array([world.pose[:2], *(other.pose[:2] for other in world.others)])
            there = there[np.linalg.norm(there - pose[:2], axis=1) > world.robot.radius]  # not the one that carries it
            centres = np.concatenate([centres, there])
            radii = np.concatenate([radii, np.full(len(there), world.robot.radius)])
        ranges = cast(pose[:2], pose[2] + self.angles, starts, ends, centres, radii)
        ranges[ranges > self.max_range] = np.inf
        if rng is not None:
            ranges = np.maximum(ranges + self.sigma * rng.standard_normal(int(self.beams)), 0.0)
        return Scan(self.angles, ranges)


def cast(origin: ArrayLike, directions: ArrayLike, starts: Array, ends: Array, centres: Array, radii: Array) -> Array:
    """Distance along each half-line to the first segment or circle, ``inf`` where there is none.

    Parameters
    ----------
    origin : (2,), m.     directions : (n,) angles in the world, radians.
    starts, ends : (s, 2), the segments.     centres, radii : (c, 2), (c,), the circles, seen from outside.

    Returns (n,).

    A beam o + t u meets the segment a + s e where  t = (a - o) × e / u × e  and  s = (a - o) × u / u × e;
    it meets a circle at  t = p·u - sqrt(r² - (p × u)²)  with p the centre as seen from o.  A beam that runs along a
    segment meets its nearer end, or starts on it.
    """
    o, directions = np.asarray(origin, dtype=float), np.asarray(directions, dtype=float)
    ux, uy = np.cos(directions), np.sin(directions)
    nearest = np.full(directions.shape, np.inf)
    if len(starts):
        (ax, ay), (ex, ey) = (starts - o).T[..., None], (ends - starts).T[..., None]
        with np.errstate(divide="ignore", invalid="ignore"):
            per_cross = 1.0 / (ux * ey - uy * ex)  # infinite for a parallel beam, which then fails the test on s
            s = (ax * uy - ay * ux) * per_cross
            t = (ax * ey - ay * ex) * per_cross
            # A hair of tolerance, or beams would slip through the corner that two walls share.
            met = (t >= 0) & (s >= -1e-12) & (s <= 1 + 1e-12)
        nearest = np.minimum(nearest, np.where(met, t, np.inf).min(axis=0))
        # Both ends on the beam's line: there u × e is zero, or whatever rounding made of it.
        bx, by = ax + ex, ay + ey
        row, beam = np.nonzero(np.maximum(abs(ax * uy - ay * ux), abs(bx * uy - by * ux)) < ON_THE_LINE)
        if len(row):
            ends_at = np.stack([(px * ux + py * uy)[row, beam] for px, py in ((ax, ay), (bx, by))])
            t = np.where(ends_at.min(axis=0) >= 0, ends_at.min(axis=0), np.where(ends_at.max(axis=0) >= 0, 0.0, np.inf))
            np.minimum.at(nearest, beam, t)
    if len(centres):
        px, py = (centres - o).T[..., None]
        along, across = px * ux + py * uy, px * uy - py * ux
        depth = radii[:, None] ** 2 - across**2
        t = along - np.sqrt(np.maximum(depth, 0.0))
        nearest = np.minimum(nearest, np.where((depth >= 0) & (t >= 0), t, np.inf).min(axis=0))
    return nearest + 0.0  # a wall right here is at 0, not at -0


def _surfaces(arena: Arena, crates: Array) -> tuple[Array, Array, Array, Array]:
    starts, ends, centres, radii, corners = _fixed(arena)
    if len(crates):
        here = transform(crates[:, None, :], corners)
        starts = np.concatenate([starts, here.reshape(-1, 2)])
        ends = np.concatenate([ends, np.roll(here, -1, axis=1).reshape(-1, 2)])
    return starts, ends, centres, radii


@lru_cache(maxsize=32)
def _fixed(arena: Arena) -> tuple[Array, Array, Array, Array, Array]:
    """The arena as arrays: walls' ends, cylinders' centres and radii, crates' corners in their own frames."""
    return (
        np.array([w.start for w in arena.walls]).reshape(-1, 2),
        np.array([w.end for w in arena.walls]).reshape(-1, 2),
        np.array([c.position for c in arena.cylinders]).reshape(-1, 2),
        np.array([c.radius for c in arena.cylinders]),
        np.array([c.corners for c in arena.crates]).reshape(-1, 4, 2),
    )
