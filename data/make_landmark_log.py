"""Record ``landmark_log.csv``: the world's own drive around one landmark, like the report's.

    python data/make_landmark_log.py

The robot stands 1.5 m before a cyan cylinder, backs away to 20 m with the camera on it, comes back, and turns left
and right.  Each row is what the report's program would have written:

* its camera takes 24 pictures a second and needs 25 ms for each; 30 times a second a row holds the newest
  measurement, so some repeat, beside the truth of *that* moment, so that a moving robot has moved on;
* its corners are whole pixels of the landmark, and from the first to the last of n pixels it is n - 1;
* neither the landmark's radius nor the camera's place on the robot is corrected for.

Nothing else is wrong with it: the noise is what pixels, light and blur make.  The same seed gives the same bytes;
numbers are rounded to the nanometre, so that they do so on any processor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from coursekit.landmarks import LandmarkPixels, find_corners, measure
from coursekit.pinhole import COURSE_CAMERA, range_bearing
from coursekit.world.arena import Arena
from coursekit.world.camera import mounted, render
from coursekit.world.pilot import Pilot, drive
from coursekit.world.recorder import LANDMARK_COLUMNS, as_table, write_csv
from coursekit.world.robot import World

SEED, ROWS = 1842, 1842
DT = 1 / 120
PICTURE_EVERY, ROW_EVERY, DELAY = 5, 4, 3  # periods of DT
START = (0.0, 0.05, -0.03)  # as well as somebody can put it down by hand
LEGS = ((-18.5, 0.3), True), ((0.1, -0.1), False)  # where to, and whether backwards
SWING, TURN_RATE = 0.58, 0.65  # rad, rad/s


def course(world: World) -> Iterator[None]:
    """Stand, back away, come back, and turn left and right for ever; the world moves as this is iterated."""
    for _ in range(round(3.5 / DT)):
        yield world.step(0.0, 0.0)
    for goal, reverse in LEGS:
        for _ in drive(world, [goal], Pilot(speed=0.95, reverse=reverse)):
            yield
    side = 1.0
    while True:
        yield world.step(0.0, side * TURN_RATE)
        if side * world.pose[2] > SWING:
            side = -side


def look(world: World, rng: np.random.Generator) -> tuple[float, float] | None:
    """Range and bearing the report's way, or None when the landmark cannot be measured."""
    landmark = world.arena.cylinders[0]
    picture = render(COURSE_CAMERA, mounted(world.pose), [landmark], walls=world.arena.walls, rng=rng)
    corners = find_corners(picture, landmark.colour)
    if len(corners) == 0:
        return None
    whole = np.where(corners < np.nanmean(corners, axis=0), np.ceil(corners), np.floor(corners))
    pixels = measure(whole, COURSE_CAMERA)
    if not isinstance(pixels, LandmarkPixels):
        return None
    d, theta = range_bearing(pixels.height_px, pixels.axis_px, COURSE_CAMERA, landmark.height)
    return float(d), float(theta)


def rows() -> Iterator[dict[str, float | str]]:
    """One row after the other, as long as somebody asks."""
    arena = replace(Arena.load("field"), start=START)
    world, rng = World(arena, seed=SEED, dt=DT, substeps=2), np.random.default_rng(SEED)
    landmark = world.arena.cylinders[0]
    waiting: dict[int, tuple[float, float] | None] = {}
    newest = None
    for period, _ in enumerate(course(world)):
        if period % PICTURE_EVERY == 0:
            waiting[period + DELAY] = look(world, rng)
        newest = waiting.pop(period, newest)
        if period % ROW_EVERY == 0 and newest is not None:
            (d, theta), (x, y, heading) = newest, world.pose
            ahead, left = landmark.position[0] - x, landmark.position[1] - y
            true_d, true_theta = float(np.hypot(ahead, left)), float(np.arctan2(left, ahead) - heading)
            values = [world.time, d, theta, true_d, true_theta, d - true_d, theta - true_theta]
            yield dict(zip(LANDMARK_COLUMNS, [*(round(v, 9) for v in values), landmark.colour], strict=True))


if __name__ == "__main__":
    write_csv(as_table(islice(rows(), ROWS)), Path(__file__).with_name("landmark_log.csv"))
