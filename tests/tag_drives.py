"""Drives among the eight tags for the tests of SLAM: with pictures, or without and with the pictures' covariance."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from coursekit.gaussian import Gaussian, mahalanobis_squared
from coursekit.geometry import Array, between, inverse, transform
from coursekit.models import SlippingWheels, pose_residual
from coursekit.pinhole import COURSE_CAMERA
from coursekit.slam import EkfSlam
from coursekit.slam.association import Association, Mahalanobis
from coursekit.world.arena import Arena
from coursekit.world.camera import CAMERA_HEIGHT, CAMERA_OFFSET, mounted, render
from coursekit.world.pilot import Pilot, drive, octagon, square
from coursekit.world.robot import World
from coursekit.world.tags import EXPOSURE, detect, measure, measurement_cov, quads, tag_corners

ARENA = Arena.load("tags")
PERIOD = 0.4  # s from picture to picture
# The world's own wheels.  What the physics adds to them is nothing: see test_slipping_wheels_predict_… in test_motion.
MOTION = SlippingWheels(sigma_pose=(1e-5, 1e-5, 1e-5))


@dataclass(frozen=True, eq=False)
class Seen:
    """One picture: ids (m,) for scoring only, z (m, 2), R (m, 2, 2)."""

    ids: list
    z: Array
    R: Array


@dataclass(frozen=True, eq=False)
class Drive:
    """(odometry or None, true pose, Seen or None) for each control period of ``dt`` seconds."""

    dt: float
    steps: list


def record(path: str, seed: int, laps: int = 2, pictures: bool = False) -> Drive:
    """Two laps of the report's path by the PID pilot."""
    world, rng = World(ARENA, seed, substeps=4), np.random.default_rng([seed, 1])
    look = photograph if pictures else glance
    corners = {"square": square, "octagon": octagon}[path](laps=laps)
    steps, every = [(None, world.pose, look(world.pose, rng))], round(PERIOD / world.dt)
    for k, _ in enumerate(drive(world, corners, Pilot(speed=0.3, turn_rate=1.0)), start=1):
        steps.append((world.odometry, world.pose, look(world.pose, rng) if k % every == 0 else None))
    return Drive(world.dt, steps)


recorded = lru_cache(maxsize=None)(record)


def photograph(pose: Array, rng: np.random.Generator) -> Seen:
    """What OpenCV's detector and ``tags.measure`` make of a rendered picture."""
    things = quads(ARENA.tags)
    picture = render(COURSE_CAMERA, mounted(pose), [], walls=ARENA.walls, quads=things, rng=rng, **EXPOSURE)
    found = [(seen.id, measure(seen, COURSE_CAMERA, 0.16, CAMERA_OFFSET)) for seen in detect(picture)]
    return _seen([(i, *result) for i, result in found if result])


def glance(pose: Array, rng: np.random.Generator) -> Seen:
    """The tags whose face fills enough of the picture, with errors drawn from the covariance that it would give."""
    rows = []
    poses = np.array([[*tag.position, tag.yaw] for tag in ARENA.tags])
    for tag, (x, y, yaw) in zip(ARENA.tags, between(mounted(pose), poses), strict=True):
        if x < 0.25 or abs(y) > x:
            continue
        placed = np.array([x, y, tag.height - CAMERA_HEIGHT, yaw])
        uv = COURSE_CAMERA.project(tag_corners(placed, tag.size))
        wide, high = uv[1, 0] - uv[0, 0] >= 14, uv[3, 1] - uv[0, 1] >= 24
        if wide and high and uv.min() >= 8 and np.all(uv.max(axis=0) < [632, 472]):
            R = measurement_cov(tag, placed, COURSE_CAMERA, CAMERA_OFFSET)
            px, py = transform(inverse(pose), tag.position)
            z = np.array([np.hypot(px, py), np.arctan2(py, px)]) + np.linalg.cholesky(R) @ rng.standard_normal(2)
            rows.append((tag.id, z, R))
    return _seen(rows)


def _seen(rows: Sequence) -> Seen:
    ids, z, R = ([row[i] for row in rows] for i in range(3))
    return Seen(ids, np.reshape(z, (-1, 2)), np.reshape(R, (-1, 2, 2)))


@dataclass(frozen=True, eq=False)
class Outcome:
    """A map, scored afterwards by ids that the filter never got."""

    count: int
    tags: list
    mixed: int
    error: Array
    nees: Array
    nis: float


def slam_over(
    run: Drive, associate: Association | None = None, cls=EkfSlam, motion=MOTION, trust=1.0, ids=None
) -> Outcome:
    """Run SLAM over a drive; ``trust`` divides R, ``ids`` gives (misleading) ids to whoever would read them."""
    slam = cls(Gaussian(np.zeros(3), 1e-12 * np.eye(3)), motion, associate or Mahalanobis(0.999))
    start, taken, nees, nis = run.steps[0][1], {}, [], np.zeros(2)
    for odometry, pose, seen in run.steps:
        if odometry is not None:
            slam.predict(odometry, run.dt)
        if seen is None:
            continue
        indices = slam.observe(seen.z, seen.R / trust, ids=None if ids is None else ids(seen.ids))
        for i, j in zip(seen.ids, indices, strict=True):
            if j >= 0:
                taken.setdefault(int(j), []).append(i)
        belief = slam.pose
        nees.append(mahalanobis_squared(pose_residual(between(start, pose), belief.mean), belief.cov))
        nis += slam.nis, slam.dof
    tags = [max(set(ids), key=ids.count) for _, ids in sorted(taken.items())]
    where = {tag.id: tag.position for tag in ARENA.tags}
    error = [np.hypot(*(p - where[i])) for p, i in zip(transform(start, slam.landmarks), tags, strict=True)]
    mixed = sum(len(set(ids)) > 1 for ids in taken.values())
    return Outcome(len(slam.landmarks), tags, mixed, np.array(error), np.array(nees)[1:], nis[0] / nis[1])
