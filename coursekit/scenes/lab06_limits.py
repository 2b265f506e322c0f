"""Lab 6's limits: strays and views that overlap in part, and a corridor that says nothing along itself."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection

from coursekit import geometry, icp, plotting
from coursekit.failures.lab06 import frozen_pairs
from coursekit.gaussian import ellipse
from coursekit.geometry import Array
from coursekit.scenes.lab06 import METRICS, PAIR, SOURCE, TARGET, displacement, started, two_scans
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar

CURES: dict[str, dict[str, Any]] = {
    "all pairs": {},
    "trim 0.6": {"trim": 0.6},
    "within 0.5 m": {"max_distance": 0.5},
    "Tukey": {"kernel": "tukey"},
}


class Outliers:
    """A scan with strays and half of it unseen by the other, aligned with all pairs, some of them, or all in doubt."""

    START = (np.radians(12), 0.15)

    def __init__(self) -> None:
        self.source, self.target = two_scans(360)
        rng = np.random.default_rng(1)
        self.strays = rng.uniform([-3, -3], [4, 3], (200, 2))
        self.figure = plotting.figure(7.4, 4.4)
        ax = plotting.axes(self.figure)
        (self.seen,) = ax.plot([], [], ".", color=TARGET, ms=5, label="target")
        (self.out,) = ax.plot([], [], "x", color=plotting.MEASUREMENT, ms=4, label="source, left out")
        (self.kept,) = ax.plot([], [], ".", color=SOURCE, ms=4, label="source, in pairs")
        self.pairs = LineCollection([], colors=PAIR, linewidths=0.9, zorder=1.5)
        ax.add_collection(self.pairs)
        ax.set(xlim=(-5, 7.6), ylim=(-5.2, 4.2), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        ax.legend(loc="upper right", fontsize=8.5, markerscale=1.6)
        self.title = ax.set_title(" ", loc="left")
        self.moving: list[Artist] = [self.seen, self.out, self.kept, self.pairs, self.title]
        self.run = lru_cache(maxsize=128)(self._run)

    def _run(self, strays: int, hidden: int, cure: str) -> tuple[Array, Array, icp.Registration]:
        bearing = np.arctan2(*self.target.T[::-1])
        target = self.target[np.abs(geometry.wrap_angle(bearing - 2.5)) > np.pi * hidden / 100]
        count = round(len(self.source) * strays / (100 - strays))
        source = np.vstack([self.source, self.strays[:count]])
        return (
            source,
            target,
            icp.align(source, target, initial=started(*self.START), max_iterations=100, **CURES[cure]),
        )

    def update(self, *, strays: int, hidden: int, cure: str) -> None:
        source, target, result = self.run(strays, hidden, cure)
        moved = icp.move(result.T_target_source, source)
        i, j = result.matches.T
        if cure == "Tukey":  # weight zero beyond 4.685 scales
            apart = np.linalg.norm(moved[i] - target[j], axis=1)
            trusted = apart < 4.685 * 1.4826 * np.median(apart)
            i, j = i[trusted], j[trusted]
        left_out = np.setdiff1d(np.arange(len(source)), i)
        self.seen.set_data(*target.T)
        self.kept.set_data(*moved[i].T)
        self.out.set_data(*moved[left_out].T)
        self.pairs.set_segments(list(np.stack([moved[i], target[j]], axis=1)))
        off = 1000 * displacement(result.T_target_source, self.source)
        self.title.set_text(f"{cure}: {len(i)} of {len(source)} points take part; {off:.0f} mm from its place")

    def alt(self, strays: int, hidden: int, cure: str) -> str:
        source, _, result = self.run(strays, hidden, cure)
        return (
            f"A scan of {len(source)} points, {strays} % of them strays, laid on one in which {hidden} % of the "
            f"directions are hidden, with {cure}: it ends "
            f"{1000 * displacement(result.T_target_source, self.source):.0f} mm from its place"
        )


class Corridor:
    """Two scans in a corridor: where the end wall is out of reach, nothing holds the answer along it."""

    WALLS: ClassVar = [30, 11, 9, 6, 3]

    def __init__(self) -> None:
        self.arena, self.lidar = Arena.load("corridor"), Lidar()
        self.figure = plotting.figure(7.6, 4.4)
        ax, belief = plotting.axes(self.figure, 2, 1, height_ratios=[1, 1.35])
        ax.set(xlim=(-12.6, 12.6), ylim=(-2.2, 2.2), xlabel="x [m], from the first pose", ylabel="y [m]")
        (self.seen,) = ax.plot([], [], ".", color=TARGET, ms=4)
        (self.cloud,) = ax.plot([], [], ".", color=SOURCE, ms=3)
        self.title = ax.set_title(" ", loc="left")
        belief.set(xlim=(-0.45, 1.6), ylim=(-11, 11), yticks=[-10, 0, 10])  # the right is for the legend
        belief.set(xlabel="moved along the corridor [m]", ylabel="across [mm]")
        (self.truth,) = belief.plot([], [], "*", color=plotting.TRUTH, ms=13, label="truth")
        (self.found,) = belief.plot([], [], "o", color=SOURCE, ms=3.5, label="ICP")
        (self.honest,) = belief.plot([], [], color=SOURCE, label="95 %, surfaces")
        (self.proud,) = belief.plot([], [], color=plotting.MEASUREMENT, label="95 %, pairs taken for granted")
        belief.legend(loc="lower right", fontsize=8.5)
        self.verdict = belief.set_title(" ", loc="left")
        self.moving: list[Artist] = [
            self.seen, self.cloud, self.title, self.truth, self.found, self.honest, self.proud, self.verdict,
        ]  # fmt: skip
        self.run = lru_cache(maxsize=64)(self._run)

    def _run(self, wall: float, moved: float, metric: str) -> tuple[Array, Array, icp.Registration]:
        rng, pose = np.random.default_rng(3), np.array([30.0 - wall, 0.0, 0.0])
        target = self.lidar.scan(self.arena, rng, pose).points()
        source = self.lidar.scan(self.arena, rng, geometry.compose(pose, [moved, 0.0, 0.0])).points()
        return source, target, icp.align(source, target, metric=METRICS[metric], max_distance=1.0, max_iterations=100)

    def update(self, *, wall: float, moved: float, metric: str) -> None:
        source, target, result = self.run(wall, moved, metric)
        x, y, _ = result.pose
        assert result.covariance is not None
        self.seen.set_data(*target.T)
        self.cloud.set_data(*icp.move(result.T_target_source, source).T)
        self.title.set_text(f"end wall {wall} m ahead, lidar to 12 m; the robot went {moved} m")
        self.truth.set_data([moved], [0.0])
        self.found.set_data([x], [1000 * y])
        for line, cov in ((self.honest, result.covariance), (self.proud, frozen_pairs(result, source, target))):
            line.set_data(*((np.array([x, y]) + ellipse(cov[:2, :2])) * [1, 1000]).T)
        sigma = float(np.sqrt(result.covariance[0, 0]))
        shown = f"{sigma:.1f} m" if sigma > 0.5 else f"{1000 * sigma:.0f} mm"
        says = "converged" if result.converged else "not converged"
        self.verdict.set_text(f"ICP says {abs(x):.2f} m ± {shown}, {says}")

    def alt(self, wall: float, moved: float, metric: str) -> str:
        _, _, result = self.run(wall, moved, metric)
        assert result.covariance is not None
        return (
            f"Two scans in a corridor whose end wall is {wall} m ahead: the robot went {moved} m, ICP by {metric} says "
            f"{result.pose[0]:.2f} m with a standard deviation of {np.sqrt(result.covariance[0, 0]):.2f} m along it"
        )
