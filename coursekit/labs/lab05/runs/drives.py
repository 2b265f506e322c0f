"""Lab 5's drives among eight tags, and what a filter makes of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import Gaussian, nees
from coursekit.geometry import Array, inverse, transform, wrap_angle
from coursekit.labs.lab05.failures import Report
from coursekit.models import RangeBearing, SlippingWheels, pose_residual
from coursekit.pinhole import COURSE_CAMERA
from coursekit.results import Rejected
from coursekit.slam import EkfSlam, InvariantSlam
from coursekit.world import pilot, tags
from coursekit.world.arena import Arena, Tag
from coursekit.world.backdrop import Image
from coursekit.world.camera import CAMERA_HEIGHT, CAMERA_OFFSET, mounted, render
from coursekit.world.robot import World

ARENA = Arena.load("tags")
TAGS = np.array([tag.position for tag in ARENA.tags])
MOTION = SlippingWheels(sigma_pose=(1e-4, 1e-4, 1e-4))  # what the world's robot does, in its own numbers
DT, LOOK = 0.1, 2  # s, the control period; a picture every second one
STARTS = {"in the middle": (0.0, 0.0, 0.0), "off the middle": (0.5, -0.5, 2.6), "turned round": (0.0, 0.0, np.pi)}
_SENSORS = {tag.id: RangeBearing(np.array(tag.position)) for tag in ARENA.tags}
_YAWS = np.array([tag.yaw for tag in ARENA.tags])
_ACROSS = (
    np.stack([-np.sin(_YAWS), np.cos(_YAWS)], axis=-1) * 0.5 * (1 + 2 * tags.MARGIN / tags.CELLS) * ARENA.tags[0].size
)
_PAPERS = np.stack([TAGS - _ACROSS, TAGS + _ACROSS])  # the two ends of each, (2, n, 2)
_CELL = np.array([0.2, 0.2, 0.05, 0.2])  # m, m, m, rad: within it, one covariance serves
_EDGE, _OBLIQUE = 8.0, 1.25  # pixels and radians: beyond, OpenCV's detector begins to miss tags


class Slam(Protocol):
    """What a drive asks of a filter: ``slam.EkfSlam``, or one of the failures."""

    @property
    def mean(self) -> Array: ...
    @property
    def cov(self) -> Array: ...
    @property
    def pose(self) -> Gaussian: ...
    def predict(self, control: ArrayLike, dt: float) -> None: ...
    def observe(self, z: ArrayLike, R: ArrayLike) -> Any: ...


@dataclass(frozen=True)
class Look:
    """One picture's worth: which tags (m,), for scoring only, what was measured (m, 2), and how well (m, 2, 2)."""

    ids: Array
    z: Array
    R: Array


@dataclass(frozen=True)
class Drive:
    """The truth (n + 1, 3), the odometry (n, 2), after each step a look or None, and the step that ends each lap."""

    truth: Array
    odometry: Array
    looks: list[Look | None]
    lap_ends: list[int]

    def until(self, lap: int) -> Drive:
        """The first laps of it."""
        n = self.lap_ends[lap - 1]
        return Drive(self.truth[: n + 1], self.odometry[:n], self.looks[:n], self.lap_ends[:lap])

    @property
    def start(self) -> Gaussian:
        """The map's frame is where the robot starts: known, but for a hair."""
        return Gaussian(self.truth[0], 1e-8 * np.eye(3))


def drive(seed: int, path: str = "square", laps: int = 2, start: str = "in the middle", clutter: float = 0.0) -> Drive:
    """Along the report's square or octagon, by the PID pilot, and back to its first corner.

    The robot drives backwards, so that its camera keeps looking at what it leaves behind.

    clutter : how many false detections a picture shows, on average.
    """
    return _drive(seed, path, laps, start, clutter)


@lru_cache(maxsize=200)  # here, where a default that was spelt out is no other drive
def _drive(seed: int, path: str, laps: int, start: str, clutter: float) -> Drive:
    rng = np.random.default_rng(seed)
    world = World(replace(ARENA, start=STARTS[start]), rng, dt=DT)
    corners = {"square": pilot.square, "octagon": pilot.octagon}[path](laps=laps)
    truth, odometry, looks = [world.pose], [], []
    ends: list[int] = []
    for step in pilot.drive(world, [*corners, corners[0]], pilot.Pilot(turn_rate=1.0, reverse=True)):
        truth.append(world.pose)
        odometry.append(world.odometry)
        looks.append(glimpse(world.pose, rng, clutter) if len(odometry) % LOOK == 0 else None)
        if step.waypoint > len(corners) // laps * (len(ends) + 1):
            ends.append(len(odometry))
    return Drive(np.array(truth), np.array(odometry), looks, [*ends[: laps - 1], len(odometry)])


def glimpse(pose: Array, rng: np.random.Generator, clutter: float = 0.0) -> Look:
    """Range and bearing of the tags in view, with the covariance that the rendered camera's chain gives them.

    ``photograph`` is the chain itself; this draws from its covariance, which is a thousand times faster.
    """
    ids, z, R = [], [], []
    for tag, seen_at in _in_view(pose):
        cov = _measurement_cov(tag, *np.round(seen_at / _CELL) * _CELL)
        ids.append(tag.id)
        R.append(cov)
        z.append(_SENSORS[tag.id].h(pose) + np.linalg.cholesky(cov) @ rng.standard_normal(2))
    for _ in range(rng.poisson(clutter)):
        ids.append(-1)
        R.append(np.diag([0.005, 0.001]) ** 2)
        z.append(np.array([rng.uniform(0.8, 3.0), rng.uniform(-0.5, 0.5)]))
    return Look(np.array(ids, dtype=int), np.array(z).reshape(-1, 2), np.array(R).reshape(-1, 2, 2))


def photograph(pose: Array, rng: np.random.Generator) -> tuple[Image, list[tags.Detection], Look]:
    """The same from a rendered picture: the picture, what OpenCV finds in it, and what ``tags.measure`` makes of it."""
    light, noise, blur = (tags.EXPOSURE[name] for name in ("light", "noise", "blur"))
    picture = render(COURSE_CAMERA, mounted(pose), [], walls=ARENA.walls, quads=_quads(), rng=rng,
                     light=light, noise=noise, blur=blur)  # fmt: skip
    found, size = tags.detect(picture), ARENA.tags[0].size
    measured = [(one.id, tags.measure(one, COURSE_CAMERA, size, CAMERA_OFFSET)) for one in found]
    kept = [(i, *m) for i, m in measured if not isinstance(m, Rejected)]
    ids, z, R = (np.array([row[i] for row in kept]) for i in range(3))
    return picture, found, Look(ids.astype(int), z.reshape(-1, 2), R.reshape(-1, 2, 2))


def _in_view(pose: Array) -> Iterator[tuple[Tag, Array]]:
    """The tags that the detector finds, with [x, y, z, yaw] of each in the camera's frame."""
    eye = inverse(mounted(pose))
    place, ends = transform(eye, TAGS), transform(eye, _PAPERS)
    facing = wrap_angle(_YAWS - pose[2])
    oblique = np.abs(wrap_angle(np.arctan2(-place[:, 1], -place[:, 0]) - facing))
    for i in np.flatnonzero((place[:, 0] > 0.25) & (np.abs(place[:, 1]) < 0.6 * place[:, 0]) & (oblique < _OBLIQUE)):
        tag = ARENA.tags[i]
        seen_at = np.array([*place[i], tag.height - CAMERA_HEIGHT, facing[i]])
        pixels = COURSE_CAMERA.project(tags.tag_corners(seen_at, tag.size))
        if np.all(pixels > _EDGE) and np.all(pixels < [639 - _EDGE, 479 - _EDGE]) and not _hidden(int(i), ends):
            yield tag, seen_at


def _hidden(i: int, ends: Array) -> bool:
    """Does a nearer tag's paper cover a part of tag i?  Ends of the papers as the eye sees them, (2, n, 2)."""
    slopes = np.sort(ends[..., 1] / np.maximum(ends[..., 0], 1e-3), axis=0)
    depth = ends[..., 0].mean(axis=0)
    nearer = (depth < depth[i]) & (ends[..., 0].min(axis=0) > 0.05)
    return bool(np.any(nearer & (slopes[0] < slopes[1, i]) & (slopes[1] > slopes[0, i])))


@lru_cache(maxsize=10_000)
def _measurement_cov(tag: Tag, *seen_at: float) -> Array:
    return tags.measurement_cov(tag, seen_at, COURSE_CAMERA, CAMERA_OFFSET)


@lru_cache
def _quads() -> Any:
    return tags.quads(ARENA.tags)


@dataclass(frozen=True)
class Track:
    """What a filter believed after each of k looks.

    time (k,), means and covs of pose and landmarks (they grow), nees (k,) of the pose, surprise (k, 2): the look's NIS
    and its degrees of freedom; taken_for : pairs (ids, which landmark each was taken for).
    """

    time: Array
    truth: Array
    means: list[Array]
    covs: list[Array]
    nees: Array
    surprise: Array
    taken_for: list[tuple[Array, Array]]

    @property
    def landmarks(self) -> Array:
        """At the end, (n, 2)."""
        return self.means[-1][3:].reshape(-1, 2)

    @property
    def poses(self) -> Array:
        """(k, 3)."""
        return np.array([mean[:3] for mean in self.means])


def follow(run: Drive, slam: Slam) -> Track:
    """Run a filter over a drive.  It gets odometry, ranges, bearings and their covariances, and never an id."""
    time, means, covs, scores, surprise, taken = [], [], [], [], [], []
    for k, (u, look) in enumerate(zip(run.odometry, run.looks, strict=True), 1):
        slam.predict(u, DT)
        if look is None:
            continue
        taken.append((look.ids, np.asarray(slam.observe(look.z, look.R), dtype=int)))
        time.append(k)
        means.append(slam.mean.copy())
        covs.append(slam.cov.copy())
        scores.append(nees(slam.pose, run.truth[k], pose_residual))
        surprise.append((getattr(slam, "nis", np.nan), getattr(slam, "dof", 0)))
    steps = np.array(time)
    return Track(DT * steps, run.truth[steps], means, covs, np.array(scores), np.array(surprise), taken)


@lru_cache(maxsize=400)
def mapped(
    rule: Any,
    seed: int,
    path: str = "square",
    laps: int = 2,
    start: str = "in the middle",
    kind: type[EkfSlam] = InvariantSlam,
) -> Track:
    """EKF-SLAM with an association rule over a drive of that seed."""
    run = drive(seed, path, 2, start)
    return follow(run.until(laps), kind(run.start, MOTION, rule))


@lru_cache(maxsize=100)
def reported(threshold: float, seed: int, path: str = "square", laps: int = 1) -> Track:
    """The report's filter over the same drive."""
    run, slam = drive(seed, path), type("AsReported", (Report,), {"threshold": threshold})
    return follow(run.until(laps), slam(run.start, MOTION))


def per_coordinate(landmarks: Array) -> float:
    """The report's score: |Δx| and |Δy| of each tag and its nearest landmark, averaged over all coordinates, m."""
    nearest = np.linalg.norm(landmarks[:, None] - TAGS, axis=-1).argmin(axis=0)
    return float(np.abs(landmarks[nearest] - TAGS).mean())


def times_shown(run: Drive) -> Array:
    """How many looks of a drive show each tag, in the order of the arena, (8,)."""
    ids = np.concatenate([look.ids for look in run.looks if look])
    return np.array([np.sum(ids == tag.id) for tag in ARENA.tags])


def map_error(landmarks: Array, within: float = 0.2) -> tuple[int, float]:
    """How many tags have a landmark within reach, and how far a tag is from the nearest landmark on average, m."""
    nearest = np.linalg.norm(landmarks[:, None] - TAGS, axis=-1).min(axis=0)
    return int(np.sum(nearest < within)), float(nearest.mean())
