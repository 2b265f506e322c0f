"""Lab 4's drives and filters: drives drawn from the filter's own models, drives that a camera photographed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coursekit import ekf, noise
from coursekit.gaussian import Gaussian, nees
from coursekit.geometry import Array, transform, wrap_angle
from coursekit.labs.lab04.failures import column_repeated
from coursekit.landmarks import LandmarkPixels, find_corners, measure
from coursekit.models import ConstantVelocity, DifferentialDrive, RangeBearing, RangeOnly, SlippingWheels, pose_residual
from coursekit.pinhole import COURSE_CAMERA, range_bearing
from coursekit.recordings import datasets
from coursekit.teaching import experiments
from coursekit.world.arena import Arena
from coursekit.world.camera import mounted, render
from coursekit.world.pilot import Pilot, drive
from coursekit.world.robot import Robot, World

ROOM = replace(Arena.load("lab"), crates=())  # what a robot can push is a story of its own
LANDMARKS = np.array([c.position for c in ROOM.cylinders])
SENSORS = [RangeBearing(p) for p in LANDMARKS]
START_COV = np.diag([0.05, 0.05, 0.03]) ** 2
SIGHT = 0.53  # rad to either side: where the course's camera ends

# The simulated drives: a lap of the room, with the noise that the filter believes in.
MOTION, R = DifferentialDrive(sigma_v=0.06, sigma_omega=0.08), np.diag([0.1, 0.03]) ** 2
CONTROL, DT, STEPS = np.array([0.5, 0.36]), 0.2, 90  # m/s, rad/s; s
HOME = np.array([1.2, -1.2, 0.7])

# The photographed drives: the clock of the landmark log of Lab 3, and its camera.
TICK, PER_STEP, PICTURE_EVERY, READY_AFTER = 1 / 120, 24, 5, 3  # s; ticks
ROUTE = np.array([(2.2, -0.7), (2.4, 0.8), (0.6, 1.4), (-2.1, 1.3), (-2.0, -0.4), (-1.9, -2.0), (0.5, -1.6)])
# A wheel slips anew at every tick, so that over a step of PER_STEP ticks its mean slip is smaller by the root.
WHEELS = SlippingWheels(slip=Robot().slip / np.sqrt(PER_STEP), sigma_pose=(2e-4, 2e-4, 2e-4))


@dataclass(frozen=True)
class Drives:
    """N drives of n steps of ``dt`` seconds.

    truth (N, n + 1, 3); control (N, n, 2), as the odometry says; z (N, n, L, 2): what was measured of each landmark
    at the end of each step, NaN where it was not.
    """

    truth: Array
    control: Array
    z: Array
    dt: float

    def start(self, seed: int, cov: Array = START_COV) -> Gaussian:
        """What the filters are told of the start of each: the truth with an error of this covariance."""
        n = len(self.truth)
        errors = np.random.default_rng(seed).standard_normal((n, 3)) @ np.linalg.cholesky(cov).T
        return Gaussian(self.truth[:, 0] + errors, np.tile(cov, (n, 1, 1)))


@dataclass(frozen=True)
class Tracks:
    """What a filter made of N drives.  mean (N, n, 3), cov (N, n, 3, 3), nees (N, n); of each measurement its nis and
    whether it was used, (N, n, L), NaN and False where there was none."""

    mean: Array
    cov: Array
    nees: Array
    nis: Array
    used: NDArray[np.bool_]

    def error(self, drives: Drives) -> Array:
        """Distance between estimated and true position, (N, n), in metres."""
        return np.asarray(np.hypot(*np.moveaxis((self.mean - drives.truth[:, 1:])[..., :2], -1, 0)))


def simulate(
    rng: np.random.Generator, runs: int = 100, *, landmarks: int = 6, steps: int = STEPS, push: float = 0.0
) -> Drives:
    """Laps of the room with the very noise that ``MOTION`` and ``R`` state.

    push : how far somebody moves the robot to its left at half time, in metres; no wheel feels it.
    """
    pose = HOME + rng.standard_normal((runs, 3)) @ np.linalg.cholesky(START_COV).T
    truth = [pose]
    for k in range(steps):
        pose = MOTION.sample(pose, CONTROL, DT, rng)
        if push and k == steps // 2:
            pose = np.concatenate([[transform(p, [0.0, push]) for p in pose], pose[:, 2:]], axis=1)
        truth.append(pose)
    poses = np.stack(truth, axis=1)
    z = np.stack([sensor.h(poses[:, 1:]) for sensor in SENSORS[:landmarks]], axis=2)
    z = np.where(np.abs(z[..., 1:]) < SIGHT, z, np.nan) + rng.standard_normal(z.shape) @ np.linalg.cholesky(R).T
    z[..., 1] = wrap_angle(z[..., 1])
    return Drives(poses, np.broadcast_to(CONTROL, (runs, steps, 2)), z, DT)


def localise(
    drives: Drives,
    start: Gaussian,
    R: Array = R,
    motion: DifferentialDrive = MOTION,
    *,
    correct: Callable[..., ekf.Correction] = ekf.correct,
    gate: float | None = None,
) -> Tracks:
    """Filter all drives side by side: predict, then correct with each landmark that was seen.

    R : (2, 2), or one for each measurement, (N, n, L, 2, 2).     gate : a probability; None lets all in.
    """
    belief, beliefs, seen = start, [], np.isfinite(drives.z[..., 0])
    nis, used = np.full(seen.shape, np.nan), seen.copy()
    sensors = [RangeBearing(p, R) for p in LANDMARKS] if R.ndim == 2 else SENSORS
    for k in range(drives.control.shape[1]):
        belief = ekf.predict(belief, motion, drives.control[:, k], drives.dt)
        for i in np.nonzero(seen[:, k].any(axis=0))[0]:
            after = correct(belief, sensors[i], drives.z[:, k, i], None if R.ndim == 2 else R[:, k, i])
            nis[:, k, i] = after.nis
            if gate is not None:
                used[:, k, i] &= ~(after.nis > ekf.gate_threshold(gate, 2))
            belief = after.belief if used[seen[:, k, i], k, i].all() else chosen(used[:, k, i], after.belief, belief)
        beliefs.append(belief)
    mean, cov = (np.stack([getattr(b, part) for b in beliefs], axis=1) for part in ("mean", "cov"))
    return Tracks(mean, cov, nees(Gaussian.trusted(mean, cov), drives.truth[:, 1:], pose_residual), nis, used)


def chosen(which: NDArray[np.bool_], this: Gaussian, that: Gaussian) -> Gaussian:
    """Belief by belief, this one or that."""
    mean = np.where(which[:, None], this.mean, that.mean)
    return Gaussian.trusted(mean, np.where(which[:, None, None], this.cov, that.cov))


def scaled(q_scale: float) -> DifferentialDrive:
    """The motion model with Q ``q_scale`` times the true one."""
    s = np.sqrt(q_scale)
    return DifferentialDrive(s * MOTION.sigma_v, s * MOTION.sigma_omega, tuple(s * np.array(MOTION.sigma_pose)))


# --- drives in the world of physics ------------------------------------------------------------------------------


def photograph(pose: Array, rng: np.random.Generator) -> tuple[Any, Array]:
    """The picture from a pose (h, w, 3), and of each cylinder its range and bearing, (6, 2), NaN where not measured.

    The camera, its whole pixels and what it leaves uncorrected are those of Lab 3's log.
    """
    picture = render(COURSE_CAMERA, mounted(pose), ROOM.cylinders, walls=ROOM.walls, rng=rng)
    z = np.full((len(ROOM.cylinders), 2), np.nan)
    for i, cylinder in enumerate(ROOM.cylinders):
        corners = find_corners(picture, cylinder.colour)
        if len(corners):
            whole = np.where(corners < np.nanmean(corners, axis=0), np.ceil(corners), np.floor(corners))
            pixels = measure(whole, COURSE_CAMERA)
            if isinstance(pixels, LandmarkPixels):
                z[i] = range_bearing(pixels.height_px, pixels.axis_px, COURSE_CAMERA, cylinder.height)
    return picture, z


def photographed(rng: np.random.Generator, steps: int = 100) -> Drives:
    """One drive from waypoint to waypoint in the world of physics, looked at once in a step.

    A picture is taken at every fifth tick and is ready three ticks later; the filter gets the newest that is ready,
    which is 25 to 58 ms old.
    """
    route = np.roll(ROUTE, -int(rng.integers(len(ROUTE))), axis=0)[:: -1 if rng.random() < 0.5 else 1]
    route = np.tile(route + rng.uniform(-0.2, 0.2, route.shape), (4, 1))
    ahead = route[1] - route[0]
    start = (*route[0], np.arctan2(ahead[1], ahead[0]) + rng.uniform(-0.5, 0.5))
    world = World(replace(ROOM, start=start), seed=rng, dt=TICK, substeps=2)
    poses, odometry, z = [world.pose], [], []
    pilot = drive(world, route[1:], Pilot(speed=0.5, turn_rate=1.0, tolerance=0.1), timeout=120.0)
    for _ in islice(pilot, PER_STEP * steps):
        poses.append(world.pose)
        odometry.append(world.odometry)
        if (tick := len(odometry)) % PER_STEP == 0:
            z.append(photograph(poses[(tick - READY_AFTER) // PICTURE_EVERY * PICTURE_EVERY], rng)[1])
    control = np.reshape(odometry, (steps, PER_STEP, 2)).mean(axis=1)
    return Drives(np.array(poses[::PER_STEP])[None], control[None], np.array(z)[None], PER_STEP * TICK)


COLUMNS = ("drive", "time", "x", "y", "theta", "v", "omega",
           *(f"{name}_{c.colour}" for c in ROOM.cylinders for name in ("range", "bearing")))  # fmt: skip


@lru_cache
def recorded() -> Drives:
    """Sixty drives like ``photographed``, from the project's data: drawing their 6,000 pictures takes minutes."""
    table = np.genfromtxt(datasets.project_file("camera_drives.csv"), delimiter=",", skip_header=1)
    table = table.reshape(len(np.unique(table[:, 0])), -1, len(COLUMNS))
    after = table[:, 1:]
    z = after[..., 7:].reshape(*after.shape[:2], -1, 2)
    return Drives(table[..., 2:5], after[..., 5:7], z, PER_STEP * TICK)


@lru_cache
def sensor_noise() -> noise.Calibrated:
    """Lab 3's model of the camera, fitted to the log of one cylinder."""
    return noise.fit_calibrated(datasets.load("landmark_log"))


@lru_cache
def report_noise() -> noise.Piecewise:
    """The report's model, fitted to the same log."""
    return noise.fit_piecewise(datasets.load("landmark_log"))


def believed(drives: Drives, model: Any, *, rates: bool = True) -> tuple[Drives, Array]:
    """What Lab 3's model makes of what was measured: the drives with z corrected, and R, (N, n, L, 2, 2).

    rates : does the model hear how fast the robot turned and drove?  Without, it cannot correct for the delay.
    """
    seen = np.isfinite(drives.z[..., 0])
    z, R = np.full(drives.z.shape, np.nan), np.tile(np.eye(2), (*seen.shape, 1, 1))
    v, omega = (np.broadcast_to(part[..., None], seen.shape)[seen] for part in np.moveaxis(drives.control, -1, 0))
    arguments = (*drives.z[seen].T, omega, v) if rates else drives.z[seen].T
    z[seen] = np.stack(model.correct(*arguments), axis=-1)
    R[seen] = model.R(*arguments)
    return replace(drives, z=z), R


# --- the homework ------------------------------------------------------------------------------------------------

POINTS = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 5.0]])
WALK, NOTHING = ConstantVelocity(sigma_a=0.05), np.empty(0)  # nobody steers it


@lru_cache
def homework(landmarks: int, wrong: bool, runs: int = 40) -> tuple[Array, Gaussian, Array]:
    """Constant velocity and ranges only, ``runs`` times: truth (61, runs, 4), the beliefs after each step (61, runs),
    and each NIS (60, runs, landmarks)."""
    rng = np.random.default_rng(experiments.lab_seed(4) + 7)
    cov = np.diag([0.4, 0.1, 0.4, 0.1]) ** 2
    truth = [np.array([1.0, 0.25, 0.8, 0.15]) + np.zeros((runs, 4))]
    belief = Gaussian(truth[0] + rng.standard_normal((runs, 4)) * np.sqrt(np.diag(cov)), np.tile(cov, (runs, 1, 1)))
    beliefs, surprises = [belief], []
    sensors = [(column_repeated if wrong else RangeOnly)(p, np.diag([0.05**2])) for p in POINTS[:landmarks]]
    for _ in range(60):
        truth.append(WALK.sample(truth[-1], NOTHING, 0.25, rng))
        belief = ekf.predict(belief, WALK, NOTHING, 0.25)
        noises = 0.05 * rng.standard_normal((3, runs, 1))
        for sensor, e in zip(sensors, noises, strict=False):
            after = ekf.correct(belief, sensor, sensor.h(truth[-1]) + e)
            belief = after.belief
            surprises.append(after.nis)
        beliefs.append(belief)
    together = Gaussian.trusted(*(np.array([getattr(b, part) for b in beliefs]) for part in ("mean", "cov")))
    return np.array(truth), together, np.moveaxis(np.reshape(surprises, (60, landmarks, runs)), 1, 2)
