"""Lab 6's explorers: ICP step by step, its basin of convergence, strays, and a long corridor."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, to_rgba
from numpy.typing import NDArray

from coursekit import geometry, icp
from coursekit.gaussian import ellipse
from coursekit.geometry import Array
from coursekit.labs.lab06.failures import frozen_pairs
from coursekit.labs.lab06.figures import PAIR, SOURCE, TARGET
from coursekit.labs.lab06.runs import CURES, METRICS, displacement, started, two_scans
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar


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
        curve.set(xlim=(-0.5, 30.5), ylim=(0.003, 20), yscale="log", xlabel="iteration")
        curve.set_title("RMS distance [m]", loc="left")
        (self.rmse,) = curve.plot([], [], color=PAIR, label="to the nearest point")
        (self.truth,) = curve.plot([], [], color=plotting.TRUTH, label="to its true place")
        (self.now,) = curve.plot([], [], "o", color=SOURCE, ms=6)
        curve.legend(loc="upper center", bbox_to_anchor=(0.45, -0.18), fontsize=8.5)
        self.moving: list[Artist] = [self.cloud, self.pairs, self.title, self.rmse, self.truth, self.now]
        self.run = lru_cache(maxsize=32)(self._run)

    def _run(self, start: float, metric: str) -> tuple[tuple[icp.Iteration, ...], list[float]]:
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
        state = f"Settled after {k}" if k < iteration else f"Iteration {k}"
        self.title.set_text(f"{state}: RMSE {step.rmse:.2f} m, {apart[k]:.2f} m off")

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
    HOME: ClassVar = 0.1  # m: an end nearer than this to the true place is home

    def __init__(self) -> None:
        self.source, self.target = two_scans(90)
        self.normals = icp.normals(self.target)
        self.figure = plotting.figure(7.8, 4.2)
        basin, ax = plotting.axes(self.figure, 1, 2, width_ratios=[1.3, 1])
        self.map = basin.imshow(
            np.ones((len(self.SHIFTS), len(self.TURNS))), norm=LogNorm(0.01, 3), cmap="viridis_r", aspect="auto",
            origin="lower", extent=(-190, 190, -2.25, 2.25),
        )  # fmt: skip
        scale = self.figure.colorbar(
            self.map, ax=basin, ticks=[0.01, 0.1, 1], format="%g", location="bottom", aspect=40, shrink=0.9
        )
        scale.set_label("error at the end [m]; black line: 0.1 m", fontsize=9)
        scale.minorticks_off()
        basin.set(xlabel="start turned by [°]", ylabel="start shifted by [m]", xticks=range(-180, 181, 90))
        basin.grid(visible=False)
        self.border = LineCollection([], colors=plotting.TRUTH, linewidths=1.8)  # between home and elsewhere
        basin.add_collection(self.border)
        (self.start,) = basin.plot([], [], "s", mfc="none", mec=plotting.MEASUREMENT, mew=2, ms=10)
        self.share = basin.set_title(" ", loc="left")
        ax.plot(*self.target.T, ".", color=TARGET, ms=5, label="target")
        (self.before,) = ax.plot([], [], ".", color=plotting.MEASUREMENT, ms=3, alpha=0.5, label="start")
        (self.after,) = ax.plot([], [], ".", color=SOURCE, ms=5, label="end")
        ax.set(xlim=(-6, 7), ylim=(-7.2, 6.2), xlabel="x [m]", aspect="equal")
        ax.legend(loc="lower center", fontsize=8.5, ncols=3, columnspacing=0.9, handletextpad=0.1, markerscale=1.6)
        self.end = ax.set_title(" ", loc="left")
        self.moving: list[Artist] = [self.map, self.border, self.start, self.share, self.before, self.after, self.end]
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

    def edges(self, home: NDArray[np.bool_]) -> list[Array]:
        """The sides of the map's cells that part home from elsewhere, each as two points (2, 2)."""
        turn, shift = 20.0, 0.5  # of a cell
        across = [
            np.array([[x + turn / 2, y - shift / 2], [x + turn / 2, y + shift / 2]])
            for i, y in enumerate(self.SHIFTS) for j, x in enumerate(self.TURNS[:-1]) if home[i, j] != home[i, j + 1]
        ]  # fmt: skip
        along = [
            np.array([[x - turn / 2, y + shift / 2], [x + turn / 2, y + shift / 2]])
            for i, y in enumerate(self.SHIFTS[:-1]) for j, x in enumerate(self.TURNS) if home[i, j] != home[i + 1, j]
        ]  # fmt: skip
        return across + along

    def update(self, *, turn: float, shift: float, metric: str) -> None:
        ends, result = self.ends(metric), self.align(turn, shift, metric)
        self.map.set_data(ends)
        self.border.set_segments(self.edges(ends < self.HOME))
        self.start.set_data([turn], [shift])
        self.share.set_text(f"{100 * np.mean(ends < self.HOME):.0f} % of the starts end within {self.HOME} m")
        self.before.set_data(*icp.move(result.history[0].T_target_source, self.source).T)
        self.after.set_data(*icp.move(result.T_target_source, self.source).T)
        self.end.set_text(
            f"ends {displacement(result.T_target_source, self.source):.2f} m off, RMSE {result.rmse:.2f} m"
        )

    def alt(self, turn: float, shift: float, metric: str) -> str:
        result = self.align(turn, shift, metric)
        return (
            f"A map of starts with a black border round those that end within {self.HOME} m: "
            f"{100 * np.mean(self.ends(metric) < self.HOME):.0f} % of them, matching by {metric}. "
            f"The start turned by {turn}° and shifted by {shift} m ends "
            f"{displacement(result.T_target_source, self.source):.2f} m from its place"
        )


class Outliers:
    """A scan with strays and a part that the other does not see, aligned with all pairs, some of them, or weights.

    A pair is drawn as strong as its weight.
    """

    START = (np.radians(12), 0.15)

    def __init__(self) -> None:
        self.source, self.target = two_scans(360)
        rng = np.random.default_rng(lab_seed(6) + 1)
        self.strays = rng.uniform([-3, -3], [4, 3], (200, 2))
        self.figure = plotting.figure(7.8, 4.2)
        ax = plotting.axes(self.figure)
        (self.seen,) = ax.plot([], [], ".", color=TARGET, ms=5, label="target")
        (self.out,) = ax.plot([], [], "x", color=plotting.MEASUREMENT, ms=4, label="source, left out")
        self.kept = ax.scatter([], [], s=9, color=SOURCE, lw=0, label="source: the darker, the more weight", zorder=2)
        self.pairs = LineCollection([], linewidths=0.9, zorder=1.5)
        ax.add_collection(self.pairs)
        ax.set(xlim=(-4.6, 6.2), ylim=(-6, 4.2), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=8.5, markerscale=1.6)
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
        weights = np.ones(len(i))
        if cure == "Tukey":
            apart = np.linalg.norm(moved[i] - target[j], axis=1)
            weights = icp.KERNELS["tukey"](apart / (1.4826 * np.median(apart)))
        i, j, weights = i[weights > 0], j[weights > 0], weights[weights > 0]
        left_out = np.setdiff1d(np.arange(len(source)), i)
        self.seen.set_data(*target.T)
        self.kept.set_offsets(moved[i])
        self.kept.set_facecolors([to_rgba(SOURCE, 0.15 + 0.85 * w) for w in weights])
        self.out.set_data(*moved[left_out].T)
        self.pairs.set_segments(list(np.stack([moved[i], target[j]], axis=1)))
        self.pairs.set_color([to_rgba(PAIR, w) for w in weights])
        off = 1000 * displacement(result.T_target_source, self.source)
        self.title.set_text(f"{cure}: {weights.sum():.0f} of {len(source)} points count; {off:.0f} mm off")

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
        belief.set(xlim=(-0.45, 1.05), ylim=(-14, 14), yticks=[-10, 0, 10])
        belief.set(xlabel="moved along the corridor [m]", ylabel="across [mm]")
        (self.truth,) = belief.plot([], [], "*", color=plotting.TRUTH, ms=13, label="truth")
        (self.found,) = belief.plot([], [], "o", color=SOURCE, ms=3.5, label="ICP")
        (self.honest,) = belief.plot([], [], color=SOURCE, label="its 95 % ellipse")
        (self.proud,) = belief.plot([], [], color=plotting.MEASUREMENT, label="95 %, frozen pairs")
        belief.legend(loc="upper center", bbox_to_anchor=(0.5, -0.35), ncols=4, fontsize=8.5)
        self.verdict = belief.set_title(" ", loc="left")
        self.moving: list[Artist] = [
            self.seen, self.cloud, self.title, self.truth, self.found, self.honest, self.proud, self.verdict,
        ]  # fmt: skip
        self.run = lru_cache(maxsize=64)(self._run)

    def _run(self, wall: float, moved: float, metric: str) -> tuple[Array, Array, icp.Registration]:
        rng, pose = np.random.default_rng(lab_seed(6) + 3), np.array([30.0 - wall, 0.0, 0.0])
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
