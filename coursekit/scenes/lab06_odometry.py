"""Lab 6's drive: a lap round the lab with a lidar, the tracks that scan matching makes of it, and the map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from coursekit import geometry, icp, plotting
from coursekit.gaussian import mahalanobis_squared
from coursekit.geometry import Array
from coursekit.icp.graph import residuals
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar
from coursekit.world.pilot import drive
from coursekit.world.robot import World

LAP = np.array([[2.2, -1.0], [2.2, 0.9], [-2.2, 1.3], [-2.2, -0.6], [0.0, 0.0]])
COLOURS = (plotting.ODOMETRY, plotting.MEASUREMENT, plotting.ESTIMATE, plotting.BAND)


class Lap(NamedTuple):
    """A drive seen by its lidar: scans in the robot's frame, true poses (n, 3), and what the wheels say, (n, 3)."""

    scans: list[Array]
    truth: Array
    wheels: Array


@lru_cache(maxsize=4)
def lap(seed: int = 6, every: int = 4) -> Lap:
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


def tracks(lap: Lap, named: Mapping[str, Array]) -> Figure:
    """Tracks over the arena, and their distance from the truth."""
    fig = plotting.figure(8.0, 4.0)
    ax, error = plotting.axes(fig, 1, 2, width_ratios=[1.45, 1])
    plotting.draw_arena(ax, Arena.load("lab"))
    ax.plot(*lap.truth[:, :2].T, color=plotting.TRUTH, lw=3, alpha=0.35, label="truth")
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(lap.truth[:, :2], axis=0).T))]
    for (name, poses), colour in zip(named.items(), COLOURS, strict=False):
        style = {"color": colour, "lw": 1.4, "ls": "--" if colour == plotting.ODOMETRY else "-", "label": name}
        ax.plot(*poses[:, :2].T, **style)
        error.plot(way, np.maximum(np.hypot(*(poses - lap.truth)[:, :2].T), 1e-4), **style)
    error.set(yscale="log", ylim=(3e-4, 6), xlabel="driven [m]")
    error.set_title("distance from the truth [m]", loc="left")
    error.legend(fontsize=8.5, loc="upper left")
    ax.set_title("One lap, as wheels and lidar tell it", loc="left")
    return fig


def map_picture(clouds: Mapping[str, Array]) -> Figure:
    """What was seen, put together by two tracks, over the walls as they are."""
    fig = plotting.figure(8.0, 3.6)
    for ax, (name, cloud) in zip(plotting.axes(fig, 1, 2, sharey=True), clouds.items(), strict=True):
        plotting.draw_arena(ax, Arena.load("lab"))
        ax.plot(*cloud.T, ".", color=plotting.ESTIMATE, ms=1.5)
        ax.set_title(name, loc="left")
        ax.label_outer()
    return fig


def chain(track: icp.Track) -> list[icp.Edge]:
    """A track's steps as edges of a pose graph."""
    edges = []
    for k, step in enumerate(track.steps):
        if step.covariance is not None:
            edges.append(icp.Edge(k, k + 1, step.pose, step.covariance))
    return edges


def closing_error(poses: Array, edge: icp.Edge) -> Array:
    """How far a closing edge contradicts a track, [x, y, θ]."""
    return geometry.compose(geometry.inverse(edge.pose), geometry.between(poses[edge.i], poses[edge.j]))


def strain(poses: Array, edges: Sequence[icp.Edge]) -> float:
    """Σ rᵀ P⁻¹ r: how hard the edges pull at the poses, chi-square with 3 × (edges - poses + 1) degrees of freedom."""
    return sum(mahalanobis_squared(residuals(poses[e.i], poses[e.j], e.pose)[0], e.cov) for e in edges)
