"""Lab 7's drives: the homework's with its fixes, a lost robot's among radio beacons, and one among eight tags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coursekit import particles
from coursekit.gaussian import Gaussian, nees
from coursekit.geometry import Array, inverse, transform, wrap_angle
from coursekit.models import DifferentialDrive, Position, SlippingWheels, pose_residual, range_bearing
from coursekit.particles import Particles
from coursekit.pinhole import COURSE_CAMERA
from coursekit.slam import EkfSlam
from coursekit.slam.association import Known
from coursekit.world import pilot, tags
from coursekit.world.arena import Arena
from coursekit.world.camera import CAMERA_HEIGHT, CAMERA_OFFSET, mounted
from coursekit.world.robot import World

# The assignment's robot: wheels of 0.25 m, 0.5 m apart, turning at 1.5 and 2 rad/s; a fix of the position every 5 s.
RADIUS, TRACK, WHEELS, PERIOD = 0.25, 0.5, np.array([1.5, 2.0]), 5.0
CONTROL = np.array([RADIUS * WHEELS.sum() / 2, RADIUS * (WHEELS[1] - WHEELS[0]) / TRACK])
FIXES = np.array([[1.6561, 1.2847], [1.0505, 3.1059], [-0.9875, 3.2118], [-1.6450, 1.1978]])
FIX = Position(R=np.diag([0.1**2, 0.1**2]))


def drive(sigma_wheel: float = 0.05) -> DifferentialDrive:
    """The homework's robot: each wheel errs by ``sigma_wheel`` rad/s, held for a whole step, and nothing else does.

    The default is the assignment's number; the report does not print it.
    """
    return DifferentialDrive.from_wheels(RADIUS, TRACK, sigma_wheel, sigma_pose=(0.0, 0.0, 0.0))


def at_the_start(n: int) -> Particles:
    """All particles at the known start."""
    return Particles(np.zeros((n, 3)), angles=(2,))


def homework(
    n: int, rng: np.random.Generator, sigma_wheel: float = 0.05, resampler: str = "systematic"
) -> list[tuple[Particles, Particles]]:
    """The assignment's filter; (before, after) each of the four fixes.  ``resampler`` may be "never"."""
    cloud, history = at_the_start(n), []
    for z in FIXES:
        predicted = particles.predict(cloud, drive(sigma_wheel), CONTROL, PERIOD, rng)
        weighed = particles.weigh(predicted, particles.log_likelihood(FIX, z))
        history.append((predicted, weighed))
        method = particles.RESAMPLERS.get(resampler)
        cloud = particles.resample(weighed, rng, method) if method else weighed
    return history


def planned_path(seconds: float = 20.0) -> Array:
    """Where the robot would go if its wheels never erred, (101, 3)."""
    return np.array([drive().f(np.zeros(3), CONTROL, t) for t in np.linspace(1e-9, seconds, 101)])


@dataclass(frozen=True)
class Leg:
    """Half a second of a drive among beacons.  controls (10, 2): odometry [v m/s, ω rad/s] of each 0.05 s;
    ranges (6,) m to the beacons at the end; truth (3,): the pose then."""

    controls: Array
    ranges: Array
    truth: Array


LAB = Arena.load("lab")
BEACONS = np.array([cylinder.position for cylinder in LAB.cylinders])
BEACON_SIGMA, TICK = 0.3, 0.05


def drive_among_beacons(rng: np.random.Generator, seconds: float = 12.0) -> list[Leg]:
    """The world's robot on a circle; six cylinders of the lab carry radios that tell a range, good to 0.3 m."""
    world, legs = World(LAB, rng), []
    for _ in range(round(seconds / (10 * TICK))):
        controls = []
        for _ in range(10):
            world.step(0.35, 0.4)
            controls.append(world.odometry)
        ranges = np.linalg.norm(BEACONS - world.pose[:2], axis=1) + BEACON_SIGMA * rng.standard_normal(len(BEACONS))
        legs.append(Leg(np.array(controls), ranges, world.pose))
    return legs


HALL = Arena.load("tags")
TAGS = np.array([tag.position for tag in HALL.tags])
_YAWS = np.array([tag.yaw for tag in HALL.tags])
WHEELS_IN_HALL = SlippingWheels(sigma_pose=(1e-4, 1e-4, 1e-4))  # what the world's robot does, in its own numbers
HALL_DT, LOOK_EVERY = 0.1, 2  # s, the control period; the camera looks after every second one
COARSE = np.diag([0.1, 0.05]) ** 2  # m², rad²: a sensor that is worse than lab 5's camera

Look = list[tuple[int, Array, Array]]
"""(index of the tag, z = [range, bearing], R) of each tag in view."""


@dataclass(frozen=True)
class TagDrive:
    """One lap of the report's square: truth (n + 1, 3), odometry (n, 2), and what was seen after each step."""

    truth: Array
    odometry: Array
    looks: list[Look]


def drive_among_tags(rng: np.random.Generator, R: Array | None = None) -> TagDrive:
    """Along lab 5's square, backwards, so that the camera keeps looking at what is left behind.

    R : of every measurement; by default what lab 5's camera has at that distance and angle.
    """
    world, corners = World(HALL, rng, dt=HALL_DT), pilot.square()
    truth, odometry, looks = [world.pose], [], []
    for _ in pilot.drive(world, [*corners, corners[0]], pilot.Pilot(turn_rate=0.8, reverse=True)):
        truth.append(world.pose)
        odometry.append(world.odometry)
        looks.append(_look(world.pose, rng, R) if len(odometry) % LOOK_EVERY == 0 else [])
    return TagDrive(np.array(truth), np.array(odometry), looks)


def _look(pose: Array, rng: np.random.Generator, R: Array | None) -> Look:
    """The tags in the camera's field of view that face it, none hidden."""
    places, facing = transform(inverse(mounted(pose)), TAGS), wrap_angle(_YAWS - pose[2])
    x, y = places.T
    oblique = np.abs(wrap_angle(np.arctan2(-y, -x) - facing))
    seen = []
    for i in np.flatnonzero((x > 0.25) & (np.abs(y) < 0.55 * x) & (oblique < 1.25)).tolist():
        tag = HALL.tags[i]
        seen_at = [x[i], y[i], tag.height - CAMERA_HEIGHT, facing[i]]
        cov = tags.measurement_cov(tag, seen_at, COURSE_CAMERA, CAMERA_OFFSET) if R is None else R
        z = range_bearing.h(pose, TAGS[i]) + np.linalg.cholesky(cov) @ rng.standard_normal(2)
        seen.append((i, z, cov))
    return seen


def ekf_slam(drive: TagDrive) -> tuple[float, Array]:
    """Lab 5's filter on the same drive with known ids: mean error of the map [m], NEES of the pose at each look."""
    slam = EkfSlam(Gaussian(drive.truth[0], 1e-8 * np.eye(3)), WHEELS_IN_HALL, Known())
    scores, order = [], []
    for pose, control, look in zip(drive.truth[1:], drive.odometry, drive.looks, strict=True):
        slam.predict(control, HALL_DT)
        if look:
            ids, z, R = zip(*look, strict=True)
            slam.observe(np.array(z), np.array(R), ids=list(ids))
            order += [i for i in ids if i not in order]
            scores.append(nees(slam.pose, pose, pose_residual))
    return float(np.mean(np.linalg.norm(slam.landmarks - TAGS[order], axis=1))), np.array(scores)
