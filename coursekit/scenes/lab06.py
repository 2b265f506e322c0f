"""Lab 6's pictures: ICP step by step, and its basin of convergence."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from coursekit import geometry, icp, plotting
from coursekit.geometry import Array
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar

TARGET, SOURCE, PAIR = plotting.ODOMETRY, plotting.ESTIMATE, plotting.HIGHLIGHT
HERE, MOVED = np.array([-1.0, 0.2, 0.4]), np.array([0.45, 0.1, 0.3])  # T_world_target, T_target_source
ARENA, LIDAR = Arena.load("lab"), Lidar()
METRICS = {"points": "point_to_point", "planes": "point_to_plane"}


@lru_cache(maxsize=8)
def two_scans(beams: int = 360, seed: int = 6) -> tuple[Array, Array]:
    """(source, target): what the lidar sees in the lab after, and before, the robot moved by ``MOVED``."""
    arena, lidar, rng = Arena.load("lab"), Lidar(beams=beams), np.random.default_rng(seed)
    target = lidar.scan(arena, rng, HERE).points()
    return lidar.scan(arena, rng, geometry.compose(HERE, MOVED)).points(), target


def started(turn: float, shift: float = 0.0) -> Array:
    """A start that is wrong by ``turn`` radians about the robot and by ``shift`` metres ahead of it, homogeneous."""
    return geometry.homogeneous(geometry.compose(MOVED, [shift, 0.0, turn]))


def displacement(T: Array, points: Array) -> float:
    """RMS distance of the points from where they belong, metres."""
    apart = icp.move(T, points) - geometry.transform(MOVED, points)
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def clouds_picture(source: Array, target: Array, title: str) -> Figure:
    """Two planar clouds over each other."""
    fig = plotting.figure(6.4, 4.4)
    ax = plotting.axes(fig)
    ax.plot(*target.T, ".", color=TARGET, ms=4, label="before (target)")
    ax.plot(*source.T, ".", color=SOURCE, ms=4, label="after (source)")
    ax.set(xlabel="x [m], in the robot's frame", ylabel="y [m]", aspect="equal")
    ax.set_title(title, loc="left")
    ax.legend(loc="upper right", markerscale=2)
    return fig


class Iterations:
    """One ICP run, iteration by iteration: the clouds, who is paired with whom, and the error."""

    STEPS: ClassVar = [0, 1, 2, 3, 5, 8, 12, 20, 30]
    STARTS: ClassVar = [10, 30, 60, 150]

    def __init__(self) -> None:
        self.source, self.target = two_scans(180)
        self.figure = plotting.figure(7.8, 4.2)
        ax, curve = plotting.axes(self.figure, 1, 2, width_ratios=[1.6, 1])
        ax.plot(*self.target.T, ".", color=TARGET, ms=5)
        (self.cloud,) = ax.plot([], [], ".", color=SOURCE, ms=5)
        self.pairs = LineCollection([], colors=PAIR, linewidths=0.9, zorder=1.5)
        ax.add_collection(self.pairs)
        ax.set(xlim=(-4.6, 6.4), ylim=(-5, 5), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        self.title = ax.set_title(" ", loc="left")
        curve.set(xlim=(-0.5, 30.5), ylim=(0.003, 90), yscale="log", xlabel="iteration")
        curve.set_title("distance [m]", loc="right")
        (self.rmse,) = curve.plot([], [], color=PAIR, label="to the nearest, RMSE")
        (self.truth,) = curve.plot([], [], color=plotting.TRUTH, label="to its own place")
        (self.now,) = curve.plot([], [], "o", color=SOURCE, ms=6)
        curve.legend(loc="upper right", fontsize=8.5)
        self.moving: list[Artist] = [self.cloud, self.pairs, self.title, self.rmse, self.truth, self.now]
        self.run = lru_cache(maxsize=32)(self._run)

    def _run(self, start: float, metric: str) -> tuple[tuple[icp.Step, ...], list[float]]:
        options: dict[str, Any] = {"metric": METRICS[metric], "max_iterations": 30}
        history = icp.align(self.source, self.target, initial=started(np.radians(start)), **options).history
        return history, [displacement(step.T_target_source, self.source) for step in history]

    def update(self, *, iteration: int, start: float, metric: str) -> None:
        history, apart = self.run(start, metric)
        k = min(iteration, len(history) - 1)
        step = history[k]
        moved = icp.move(step.T_target_source, self.source)
        i, j = step.matches.T
        self.cloud.set_data(*moved.T)
        self.pairs.set_segments(list(np.stack([moved[i], self.target[j]], axis=1)))
        self.rmse.set_data(range(k + 1), [s.rmse for s in history[: k + 1]])
        self.truth.set_data(range(k + 1), np.maximum(apart[: k + 1], 1e-3))
        self.now.set_data([k], [step.rmse])
        state = f"at rest since {k}" if k < iteration else f"iteration {k}"
        self.title.set_text(f"{state}: RMSE {step.rmse:.2f} m, {apart[k]:.2f} m from its place")

    def alt(self, iteration: int, start: float, metric: str) -> str:
        history, apart = self.run(start, metric)
        k = min(iteration, len(history) - 1)
        return (
            f"Two lidar scans of a room, begun {start}° apart and matched by {metric}: after {k} iterations the pairs "
            f"are {history[k].rmse:.3f} m long and the scan is {apart[k]:.2f} m from where it belongs"
        )


class Basin:
    """Where a start leads: the final error over the start's turn and shift, and the result for one start."""

    TURNS: ClassVar = list(range(-180, 181, 20))
    SHOWN: ClassVar = [-160, -100, -60, -20, 20, 60, 100, 160]
    SHIFTS: ClassVar = [-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0]

    def __init__(self) -> None:
        self.source, self.target = two_scans(90)
        self.normals = icp.normals(self.target)
        self.figure = plotting.figure(7.8, 4.2)
        basin, ax = plotting.axes(self.figure, 1, 2, width_ratios=[1.25, 1])
        self.map = basin.imshow(
            np.ones((len(self.SHIFTS), len(self.TURNS))), norm=LogNorm(0.01, 3), cmap="viridis_r", aspect="auto",
            origin="lower", extent=(-190, 190, -2.25, 2.25),
        )  # fmt: skip
        self.figure.colorbar(
            self.map, ax=basin, label="end, from its own place [m]", ticks=[0.01, 0.1, 1]
        ).minorticks_off()
        basin.set(xlabel="start turned by [°]", ylabel="start shifted by [m]", xticks=range(-180, 181, 90))
        basin.grid(visible=False)
        (self.start,) = basin.plot([], [], "s", mfc="none", mec=plotting.MEASUREMENT, mew=2, ms=10)
        self.share = basin.set_title(" ", loc="left")
        ax.plot(*self.target.T, ".", color=TARGET, ms=5, label="target")
        (self.before,) = ax.plot([], [], ".", color=plotting.MEASUREMENT, ms=3, alpha=0.5, label="start")
        (self.after,) = ax.plot([], [], ".", color=SOURCE, ms=5, label="end")
        ax.set(xlim=(-6, 7), ylim=(-7.2, 6.2), xlabel="x [m]", aspect="equal")
        ax.legend(loc="lower center", fontsize=8.5, ncols=3, columnspacing=0.9, handletextpad=0.1, markerscale=1.6)
        self.end = ax.set_title(" ", loc="left")
        self.moving: list[Artist] = [self.map, self.start, self.share, self.before, self.after, self.end]
        self.ends = lru_cache(maxsize=4)(self._ends)
        self.align = lru_cache(maxsize=256)(self._align)

    def _align(self, turn: float, shift: float, metric: str) -> icp.Registration:
        options: dict[str, Any] = {"metric": METRICS[metric], "max_iterations": 40, "tolerance": 1e-4}
        if metric == "planes":
            options["normals"] = self.normals
        return icp.align(self.source, self.target, initial=started(np.radians(turn), shift), **options)

    def _ends(self, metric: str) -> Array:
        return np.array([
            [displacement(self._align(turn, shift, metric).T_target_source, self.source) for turn in self.TURNS]
            for shift in self.SHIFTS
        ])  # fmt: skip

    def update(self, *, turn: float, shift: float, metric: str) -> None:
        ends, result = self.ends(metric), self.align(turn, shift, metric)
        self.map.set_data(ends)
        self.start.set_data([turn], [shift])
        self.share.set_text(f"{np.mean(ends < 0.1):.0%} of the starts come home")
        self.before.set_data(*icp.move(result.history[0].T_target_source, self.source).T)
        self.after.set_data(*icp.move(result.T_target_source, self.source).T)
        self.end.set_text(
            f"ends {displacement(result.T_target_source, self.source):.2f} m off, RMSE {result.rmse:.2f} m"
        )

    def alt(self, turn: float, shift: float, metric: str) -> str:
        result = self.align(turn, shift, metric)
        return (
            f"A map of starts, bright where they come home: {np.mean(self.ends(metric) < 0.1):.0%} of them, matching "
            f"by {metric}. The start turned by {turn}° and shifted by {shift} m ends "
            f"{displacement(result.T_target_source, self.source):.2f} m from its place"
        )
