"""The capstone's world: two rooms, a door that closes behind the robot, a crate that somebody carries, and sensors."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from coursekit.geometry import Array, between, inverse, transform, wrap_angle
from coursekit.pinhole import COURSE_CAMERA
from coursekit.world.arena import Arena, Crate, Cylinder, Tag, Wall
from coursekit.world.camera import CAMERA_HEIGHT, CAMERA_OFFSET, mounted
from coursekit.world.changes import carry, shut
from coursekit.world.lidar import Lidar, cast
from coursekit.world.robot import Robot, World
from coursekit.world.tags import measurement_cov, tag_corners

DT, LOOK_EVERY = 0.1, 5  # s a control period; camera and lidar look after every fifth
LIDAR = Lidar(beams=180, max_range=3.5, sigma=0.02)
ROBOT = Robot(slip=0.1)  # wheels that slip three times as much as the course's own
MISREAD = 0.05  # share of the sightings that come with the id of another tag
START = (-3.0, -1.0, 0.5)

_OUTER = [(-4.0, -2.5), (4.0, -2.5), (4.0, 2.5), (-4.0, 2.5)]
DOOR = Wall((0.0, 0.7), (0.0, 1.7))
HALL = Arena(
    "two rooms",
    walls=(
        *(Wall(a, b) for a, b in zip(_OUTER, _OUTER[1:] + _OUTER[:1], strict=True)),
        Wall((0.0, -2.5), (0.0, -1.7)),
        Wall((0.0, -0.7), (0.0, 0.7)),
        Wall((0.0, 1.7), (0.0, 2.5)),
    ),
    cylinders=(Cylinder((-1.8, 0.1), 0.12), Cylinder((2.0, 0.6), 0.15)),
    crates=(Crate((1.8, -2.1, 0.2)),),
    tags=tuple(
        Tag(id, (x, y), yaw)
        for id, x, y, yaw in [
            (11, -4.0, 1.0, 0.0), (23, -4.0, -1.2, 0.0), (35, -2.6, 2.5, -np.pi / 2), (42, -0.9, 2.5, -np.pi / 2),
            (57, -2.2, -2.5, np.pi / 2), (68, -0.01, 0.3, np.pi), (74, -0.01, 2.1, np.pi), (89, -0.01, -2.0, np.pi),
            (91, 0.01, -0.3, 0.0), (103, 0.01, -2.3, 0.0), (117, 4.0, 1.3, np.pi), (128, 4.0, -1.0, np.pi),
            (136, 2.0, 2.5, -np.pi / 2), (144, 2.8, -2.5, np.pi / 2),
        ]
    ),
    start=START,
)  # fmt: skip
WAYPOINTS = np.array(
    [(-2.6, 1.2), (-0.9, 1.2), (0.9, 1.2), (3.0, 1.5), (3.0, -0.2), (2.7, -1.4), (0.9, -1.2), (-0.9, -1.2), START[:2]]
)
CROSSING, CARRIED_TO, CARRY_SPEED = 1.0, -0.1, 0.13  # m before (2.7, -1.4) where it begins; y of its end, m; m/s
_IDS = np.array([tag.id for tag in HALL.tags])
_TAG_POSES = np.array([[*tag.position, tag.yaw] for tag in HALL.tags])


@dataclass(frozen=True)
class Scenario:
    """waypoints (9, 2), m; the seed of everything that chance decides on the drive."""

    waypoints: Array
    seed: int


def make(rng: np.random.Generator) -> Scenario:
    """The tour of both rooms by waypoints of its own."""
    jitter = rng.uniform(-0.1, 0.1, WAYPOINTS.shape)
    jitter[-1] = 0.0
    return Scenario(WAYPOINTS + jitter, int(rng.integers(2**31)))


class Hall:
    """The world of one drive, and what happens in it besides."""

    def __init__(self, scenario: Scenario) -> None:
        self.world = World(HALL, scenario.seed, ROBOT, dt=DT, substeps=5)
        self.touched = 0  # control periods in contact with something
        self._rng = np.random.default_rng([scenario.seed, 1])
        self._bend = scenario.waypoints[5]
        self._open, self._carrying = True, False

    def step(self, control: Array) -> tuple[Array, Array]:
        """One control period → odometry [v, ω] and its covariance (2, 2)."""
        self.world.step(*control)
        self.touched += self.world.contact
        x, y, _ = self.world.pose
        if self._open and x > 0.5:
            shut(self.world, DOOR)
            self._open = False
        if not self._open and np.hypot(*(self._bend - (x, y))) < CROSSING:
            self._carrying = True
        if self._carrying and self.world.crates[0, 1] < CARRIED_TO:
            with suppress(ValueError):  # whoever carries it waits until the robot is out of the way
                carry(self.world, 0, self.world.crates[0] + [0.0, CARRY_SPEED * DT, 0.0])
        v, omega = self.world.odometry
        return self.world.odometry, ROBOT.odometry_cov(float(v), float(omega), DT)

    def scan(self) -> Array:
        """What the lidar's beams hit, in the robot's frame, (m, 2)."""
        return LIDAR.scan(self.world, self._rng).points()

    def look(self) -> tuple[np.ndarray, tuple[np.ndarray, Array, Array]]:
        """Which tags are in the picture, and what the camera says of them.

        Returns truth values (14,), and ids (m,), [range, bearing] (m, 2) and R (m, 2, 2), with lab 5's errors.
        """
        pose = self.world.pose
        seen = between(mounted(pose), _TAG_POSES)
        shown = np.array([self._shows(tag, seen_at) for tag, seen_at in zip(HALL.tags, seen, strict=True)])
        ids, z, R = [], [], []
        for tag, seen_at, in_sight in zip(HALL.tags, seen, shown, strict=True):
            if in_sight:
                placed = np.array([*seen_at[:2], tag.height - CAMERA_HEIGHT, seen_at[2]])
                cov = measurement_cov(tag, placed, COURSE_CAMERA, CAMERA_OFFSET)
                x, y = transform(inverse(pose), tag.position)
                noisy = np.array([np.hypot(x, y), np.arctan2(y, x)])
                noisy += np.linalg.cholesky(cov) @ self._rng.standard_normal(2)
                z.append([noisy[0], wrap_angle(noisy[1])])
                R.append(cov)
                ids.append(tag.id if self._rng.random() > MISREAD else int(self._rng.choice(_IDS)))
        return shown, (np.array(ids, dtype=int), np.reshape(z, (-1, 2)), np.reshape(R, (-1, 2, 2)))

    def _shows(self, tag: Tag, seen_at: Array) -> bool:
        """Is the tag in the picture, large enough for the detector, and in sight?"""
        x, y, yaw = seen_at
        if x < 0.25 or abs(y) > x:
            return False
        uv = COURSE_CAMERA.project(tag_corners([x, y, tag.height - CAMERA_HEIGHT, yaw], tag.size))
        wide, high = uv[1, 0] - uv[0, 0], uv[3, 1] - uv[0, 1]
        if wide < 14 or high < 24 or uv.min() < 8 or np.any(uv.max(axis=0) > [632, 472]):
            return False
        eye = mounted(self.world.pose)
        ray = np.array([eye[2] + np.arctan2(y, x)])
        starts, ends = self._edges()
        nearest = cast(eye[:2], ray, starts, ends, np.empty((0, 2)), np.empty(0))
        return bool(nearest[0] > np.hypot(x, y) - 0.05)

    def _edges(self) -> tuple[Array, Array]:
        """Walls as they are now and the crate's sides, (n, 2) each: what hides a tag.  The cylinders are too slim."""
        walls = np.array([[w.start, w.end] for w in self.world.arena.walls])
        crate = transform(self.world.crates[0], HALL.crates[0].corners)
        return np.concatenate([walls[:, 0], crate]), np.concatenate([walls[:, 1], np.roll(crate, -1, axis=0)])
