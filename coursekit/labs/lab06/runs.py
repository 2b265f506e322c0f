"""Lab 6's scans and clouds: two scans of the lab, a lap round it with a lidar, and the report's clouds."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from coursekit import geometry, icp
from coursekit.gaussian import mahalanobis_squared
from coursekit.geometry import Array, so3_exp
from coursekit.graph import residuals
from coursekit.labs.lab06.failures import frozen_pairs
from coursekit.models import pose_residual
from coursekit.recordings import Clouds
from coursekit.recordings.datasets import DatasetUnavailable, load
from coursekit.teaching.experiments import lab_seed
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar
from coursekit.world.pilot import drive
from coursekit.world.robot import World

HERE, MOVED = np.array([-1.0, 0.2, 0.4]), np.array([0.45, 0.1, 0.3])  # T_world_target, T_target_source
ARENA, LIDAR = Arena.load("lab"), Lidar()
METRICS = {"points": "point_to_point", "planes": "point_to_plane"}


@lru_cache(maxsize=8)
def two_scans(beams: int = 360) -> tuple[Array, Array]:
    """(source, target): what the lidar sees in the lab after, and before, the robot moved by ``MOVED``."""
    arena, lidar, rng = Arena.load("lab"), Lidar(beams=beams), np.random.default_rng(lab_seed(6))
    target = lidar.scan(arena, rng, HERE).points()
    return lidar.scan(arena, rng, geometry.compose(HERE, MOVED)).points(), target


def started(turn: float, shift: float = 0.0) -> Array:
    """A start that is wrong by ``turn`` radians about the robot and by ``shift`` metres ahead of it, homogeneous."""
    return geometry.homogeneous(geometry.compose(MOVED, [shift, 0.0, turn]))


def displacement(T: Array, points: Array) -> float:
    """RMS distance of the points from where they belong, metres."""
    apart = icp.move(T, points) - geometry.transform(MOVED, points)
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


class Drive(NamedTuple):
    """One alignment of two scans, judged: its NEES by three covariances, and the error of the place [m].

    nees : by the package's covariance.     frozen : by that of frozen pairs.     noise_alone : without the bias.
    """

    nees: float
    frozen: float
    noise_alone: float
    off: float


def judged(seed: int, **options: Any) -> Drive:
    """A place in the lab and a drive of some decimetres, two scans, aligned from "it did not move"."""
    rng = np.random.default_rng(seed)
    here, motion = rng.uniform([-2.5, -1, -np.pi], [2.5, 1, np.pi]), rng.normal(0, [0.15, 0.15, 0.1])
    source, target = (LIDAR.scan(ARENA, rng, pose).points() for pose in (geometry.compose(here, motion), here))
    result = icp.align(source, target, max_distance=0.5, max_iterations=100, **options)
    error = pose_residual(motion, result.pose)
    assert result.covariance is not None
    claims = result.covariance, frozen_pairs(result, source, target), walls_alone(result, source, target)
    scores = [mahalanobis_squared(error, P) for P in claims]
    return Drive(scores[0], scores[1], scores[2], off=float(np.hypot(*error[:2])))


def walls_alone(result: icp.Registration, source: Array, target: Array) -> Array:
    """Twice the inverse information of the pairs that lie within three sigma of their walls: noise, and no bias."""
    i, j = result.matches.T
    moved, n = icp.move(result.T_target_source, source[i]), icp.normals(target)[j]
    left, arm = np.sum(n * (target[j] - moved), axis=1), moved - result.T_target_source[:2, 2]
    J = np.column_stack([n, arm[:, 0] * n[:, 1] - arm[:, 1] * n[:, 0]])
    used = np.abs(left) < 3 * 1.4826 * np.median(np.abs(left))
    return np.asarray(np.linalg.solve(J[used].T @ J[used], np.eye(3)) * np.mean(left[used] ** 2))


CURES: dict[str, dict[str, Any]] = {
    "all pairs": {},
    "trim 0.6": {"trim": 0.6},
    "within 0.5 m": {"max_distance": 0.5},
    "Tukey": {"kernel": "tukey"},
}
LAP = np.array([[2.2, -1.0], [2.2, 0.9], [-2.2, 1.3], [-2.2, -0.6], [0.0, 0.0]])


class Lap(NamedTuple):
    """A drive seen by its lidar: scans in the robot's frame, true poses (n, 3), and what the wheels say, (n, 3)."""

    scans: list[Array]
    truth: Array
    wheels: Array


@lru_cache(maxsize=4)
def lap(seed: int, every: int = 4) -> Lap:
    """A lap round the lab, with a scan every ``every`` control periods of 0.05 s, and one at either end."""
    arena, lidar = Arena.load("lab"), Lidar()
    world, rng = World(arena, seed), np.random.default_rng([seed, 1])
    scans, truth, wheels = [lidar.scan(world, rng).points()], [world.pose], [world.pose]
    pose = world.pose
    for k, step in enumerate(drive(world, LAP), start=1):
        v, omega = world.odometry * world.dt
        chord = v * np.sinc(omega / (2 * np.pi))
        pose = geometry.compose(pose, [chord * np.cos(omega / 2), chord * np.sin(omega / 2), omega])
        if k % every == 0 or (step.arrived and not np.any(world.wheels)):
            scans.append(lidar.scan(world, rng).points())
            truth.append(world.pose)
            wheels.append(pose)
    return Lap(scans, np.array(truth), np.array(wheels))


def off(poses: Array, truth: Array) -> tuple[float, float, float]:
    """(RMS distance from the truth [m], distance at the end [m], heading error at the end [°])."""
    apart = np.hypot(*(poses - truth)[:, :2].T)
    turn = geometry.wrap_angle(poses[-1, 2] - truth[-1, 2])
    return float(np.sqrt(np.mean(apart**2))), float(apart[-1]), float(np.degrees(turn))


def nees(track: icp.LidarTrack, truth: Array) -> Array:
    """NEES of each step of a track, (n - 1,); truth (n, 3)."""
    errors = pose_residual(geometry.between(truth[:-1], truth[1:]), np.array([step.pose for step in track.steps]))
    covs = np.array([step.covariance for step in track.steps])
    return np.sum(errors * np.linalg.solve(covs, errors[..., None])[..., 0], axis=-1)


def chain(track: icp.LidarTrack) -> list[icp.Edge]:
    """A track's steps as edges of a pose graph."""
    return [icp.Edge(k, k + 1, s.pose, s.covariance) for k, s in enumerate(track.steps) if s.covariance is not None]


def frozen_chain(track: icp.LidarTrack, scans: Sequence[Array]) -> list[icp.Edge]:
    """The same edges with the covariance of frozen pairs."""
    return [icp.Edge(k, k + 1, s.pose, frozen_pairs(s, scans[k + 1], scans[k])) for k, s in enumerate(track.steps)]


def closing_error(poses: Array, edge: icp.Edge) -> Array:
    """How far a closing edge contradicts a track, [x, y, θ]."""
    return geometry.compose(geometry.inverse(edge.pose), geometry.between(poses[edge.i], poses[edge.j]))


def chi2(poses: Array, edges: Sequence[icp.Edge]) -> float:
    """χ² = Σ rᵀ P⁻¹ r over the edges; 3 × (edges - poses + 1) degrees of freedom at its minimum."""
    return sum(mahalanobis_squared(residuals(poses[e.i], poses[e.j], e.pose)[0], e.cov) for e in edges)


REACH = 0.25  # pairs further apart than this do not count, m: the assignment's number
PUBLISHED = np.array(
    [
        [0.947817, -0.125278, -0.293168, 0.483643],
        [0.196485, 0.953703, 0.227703, -0.248299],
        [0.251068, -0.273425, 0.928550, 0.255736],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


def clouds() -> tuple[Clouds, bool]:
    """The report's two clouds and True; where they cannot be had, a stand-in with the same motion, and False."""
    try:
        return load("icp_clouds"), True
    except DatasetUnavailable:
        rng = np.random.default_rng(lab_seed(6))
        x = rng.normal(size=(5750, 3))
        x /= np.linalg.norm(x, axis=1)[:, None]
        lumps = 1 + 0.35 * np.sin(3 * x[:, 0] + 1) * np.cos(2 * x[:, 1]) + 0.4 * np.maximum(x[:, 2], 0) ** 2
        lumps += 0.25 * np.sin(4 * x[:, 1] * x[:, 2] + x[:, 0])
        source = x * lumps[:, None] * [0.2, 0.4, 0.3] + [0.22, 0.5, 0.35]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = so3_exp([-0.2, -0.16, 0.13]), [0.5, -0.3, 0.3]
        return Clouds(source, icp.move(T, source) + rng.normal(0, 0.0043, source.shape)), False


def search_times(sizes: Sequence[int], repeats: int = 3) -> dict[str, list[float]]:
    """Seconds for one search of n points among n, by name of the search: the best of some repeats."""
    rng = np.random.default_rng(lab_seed(6))
    times: dict[str, list[float]] = {}
    searches: dict[str, Callable[[Array], icp.BruteForce | icp.KdTree]] = {
        "brute force": icp.BruteForce,
        "tree": icp.KdTree,
    }
    for name, search in searches.items():
        times[name] = []
        for n in sizes:
            target = rng.uniform(0, 1, (n, 3)) * [1, 1, 0.02]
            points, best = target + rng.normal(0, 0.004, target.shape), np.inf
            for _ in range(repeats):
                start = time.perf_counter()
                search(target).nearest(points, REACH)
                best = min(best, time.perf_counter() - start)
            times[name].append(best)
    return times
