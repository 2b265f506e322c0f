"""Lab 7's explorers: the homework's cloud, five ways to resample, a lost robot, noise that is held or drawn afresh."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from matplotlib.artist import Artist

from coursekit import gaussian, particles
from coursekit.geometry import Array
from coursekit.labs.lab07.figures import cloud_ellipse
from coursekit.labs.lab07.runs import CONTROL, FIX, FIXES, LAB, PERIOD, at_the_start, drive, homework, planned_path
from coursekit.particles import Particles
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed


class HomeworkCloud:
    """The cloud before and after a fix, its weights, and its effective sample size at every fix so far."""

    def __init__(self) -> None:
        self.figure = plotting.figure(8.8, 4.3)
        panels = plotting.mosaic(
            self.figure, [["plan", "close", "weights"], ["plan", "close", "share"]], width_ratios=[1.25, 1.1, 0.9]
        )
        ax, close, weights, share = (panels[name] for name in ("plan", "close", "weights", "share"))
        ax.plot(*planned_path()[:, :2].T, color=plotting.ODOMETRY, lw=1, ls="--")
        ax.plot(*FIXES.T, "x", color=plotting.MEASUREMENT, ms=5, alpha=0.5)
        ax.set(xlim=(-2.9, 2.9), ylim=(-0.9, 4.9), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        close.set(xlim=(-0.7, 0.7), ylim=(-0.7, 0.7), aspect="equal", xlabel="x − x of the fix [m]")
        close.set_title("close to the fix", loc="left")
        close.set_ylabel("y − y of the fix [m]")
        self.views = [(ax, np.zeros(2)), (close, np.ones(2))]  # the second is drawn relative to the fix
        self.clouds = []
        for view, _ in self.views:
            (before,) = view.plot([], [], ".", color=plotting.ODOMETRY, ms=2.5, alpha=0.5, label="before the fix")
            after = view.scatter(
                [np.nan], [np.nan], s=[9], color=plotting.ESTIMATE, alpha=0.55, lw=0, zorder=3, label="after, by weight"
            )
            (fix,) = view.plot([], [], color=plotting.MEASUREMENT, lw=1.6, zorder=4, label="fix, 95 %")
            (ellipse,) = view.plot([], [], color=plotting.TRUTH, lw=1.4, zorder=4, label="cloud, 95 %")
            self.clouds.append((before, after, fix, ellipse))
        self.figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=4, markerscale=2.5)
        self.title = ax.set_title(" ", loc="left")
        weights.set(xlim=(0, 100), ylim=(0, 12), yticks=[1, 4, 8, 12], xlabel="particles, heaviest first [%]")
        weights.set_title("weight × N", loc="left")
        (self.weights,) = weights.plot([], [], color=plotting.ESTIMATE)
        weights.axhline(1, color=plotting.ODOMETRY, lw=1, ls="--")
        share.set(xlim=(2, 23), ylim=(0, 100), xticks=[5, 10, 15, 20], xlabel="time [s]")
        share.set_title("ESS [% of N]", loc="left")
        self.bars = share.bar(PERIOD * np.arange(1, 5), np.zeros(4), width=3.2, color=plotting.ESTIMATE)
        self.moving: list[Artist] = [*sum(self.clouds, ()), self.title, self.weights, *self.bars]
        self.run = lru_cache(maxsize=64)(self._run)

    @staticmethod
    def _run(n: int, noise: float, resampler: str) -> list[tuple[Particles, Particles]]:
        return homework(n, np.random.default_rng(lab_seed(7) + 5), noise, resampler)

    def update(self, *, particles: int, noise: float, time: int, resampler: str) -> None:
        history = self.run(particles, noise, resampler)
        now = round(time / PERIOD) - 1
        before, after = history[now]
        shown = slice(None, None, max(1, particles // 1000))
        sizes = np.minimum(14 * particles * after.weights[shown] * 300 / max(particles, 300), 260)
        for (_, relative), (grey, blue, fix, ellipse) in zip(self.views, self.clouds):
            origin = relative * FIXES[now]
            grey.set_data(*(before.states[shown, :2] - origin).T)
            blue.set_offsets(after.states[shown, :2] - origin)
            blue.set_sizes(sizes)
            fix.set_data(*(FIXES[now] - origin + gaussian.ellipse(FIX.R)).T)
            ellipse.set_data(*(cloud_ellipse(after) - origin).T)
        self.weights.set_data(np.linspace(0, 100, particles), particles * np.sort(after.weights)[::-1])
        shares = [100 * _ess(weighed) / particles for _, weighed in history]
        for k, bar in enumerate(self.bars):
            bar.set_height(shares[k] if k <= now else 0)
        self.title.set_text(f"{shares[now] / 100 * particles:.0f} of {particles} particles still count")

    def alt(self, particles: int, noise: float, time: int, resampler: str) -> str:
        after = self.run(particles, noise, resampler)[round(time / PERIOD) - 1][1]
        x, y, _ = _mean(after)
        return (
            f"A robot on a circle of 1.75 m: its grey cloud before the fix at {time} s, curved like a banana, and the "
            f"blue cloud after it around ({x:.2f}, {y:.2f}) m; effective sample size {_ess(after):.0f} of {particles}"
        )


class ResamplerStrip:
    """Ten weights side by side on [0, 1], the positions of one draw, and copies against ten times the weight."""

    SHAPES: ClassVar = {
        "nearly even": np.array([8, 12, 9, 11, 10, 7, 13, 10, 9, 11.0]),
        "uneven": np.array([1, 22, 4, 3, 25, 1, 2, 30, 9, 3.0]),
        "one rules": np.array([2, 3, 1, 2, 78, 3, 4, 2, 3, 2.0]),
    }

    def __init__(self) -> None:
        self.figure = plotting.figure(7.2, 4.4)
        strip, copies = plotting.axes(self.figure, 2, 1, height_ratios=[1, 2.1])
        strip.set(xlim=(-0.01, 1.01), ylim=(-0.15, 1.45), yticks=[], xlabel="cumulative weight")
        strip.grid(visible=False)
        strip.spines["left"].set_visible(False)
        colours = ["#56B4E9", "#9ad0f0"]
        self.intervals = [strip.barh(0.4, 0.1, left=0.1 * i, height=0.8, color=colours[i % 2])[0] for i in range(10)]
        self.names = [strip.text(0.1 * i, 0.4, str(i), ha="center", va="center", fontsize=9) for i in range(10)]
        (self.positions,) = strip.plot([], [], "v", color=plotting.MEASUREMENT, ms=7)
        (self.certain,) = strip.plot([], [], "s", color=plotting.TRUTH, ms=5)
        self.title = strip.set_title(" ", loc="left")
        copies.set(xlim=(-0.6, 9.6), ylim=(0, 10), xticks=range(10), xlabel="particle", ylabel="copies")
        self.expected = copies.bar(range(10), np.zeros(10), color=colours[0], width=0.7, label="N × weight")
        (self.spread,) = copies.plot(
            [], [], color=plotting.BAND, lw=3, label="mean ± one standard deviation, 1000 draws"
        )
        (self.centre,) = copies.plot([], [], "_", color=plotting.BAND, ms=9, mew=2.5)
        (self.drawn,) = copies.plot([], [], "D", color=plotting.MEASUREMENT, ms=6, label="copies in this draw")
        copies.legend(loc="upper right", fontsize=8.5)
        self.moving: list[Artist] = [
            *self.intervals, *self.names, self.positions, self.certain, self.title, *self.expected, self.spread,
            self.centre, self.drawn,
        ]  # fmt: skip
        self.statistics = lru_cache(maxsize=32)(self._statistics)

    def _statistics(self, method: str, weights: str) -> tuple[Array, Array]:
        rng, w = np.random.default_rng(lab_seed(7)), self.SHAPES[weights]
        copies = [np.bincount(particles.RESAMPLERS[method](w, rng), minlength=w.size) for _ in range(1000)]
        return np.mean(copies, axis=0), np.std(copies, axis=0)

    def draw(self, method: str, weights: str, draw: int) -> tuple[Array, Array, Any]:
        """Positions on [0, 1), the certain copies' places, and copies (10,): the package's draw, step by step."""
        w = self.SHAPES[weights] / self.SHAPES[weights].sum()
        rng, n, cumulative = np.random.default_rng(lab_seed(7) + 100 + draw), w.size, np.cumsum(w)
        certain = np.floor(n * w).astype(int) if method == "residual" else np.zeros(n, dtype=int)
        if method == "systematic":
            positions = (np.arange(n) + rng.random()) / n
        elif method == "stratified":
            positions = (np.arange(n) + rng.random(n)) / n
        elif method == "wheel":
            positions = np.mod(rng.random() + np.cumsum(rng.random(n) * 2 * w.max()), 1)
        elif method == "residual":
            left = np.searchsorted(np.cumsum(n * w - certain), rng.random(n - certain.sum()) * (n - certain.sum()))
            positions = (cumulative - w)[left] + 0.75 * w[
                left
            ]  # drawn among the cut-off parts; shown in their intervals
        else:
            positions = rng.random(n)
        chosen = np.searchsorted(cumulative, np.minimum(positions, cumulative[-1] - 1e-12), side="right")
        places = [cumulative[i] - w[i] + w[i] * (np.arange(c) + 1) / (c + 2) for i, c in enumerate(certain)]
        return positions, np.concatenate(places), np.bincount(chosen, minlength=n) + certain

    def update(self, *, method: str, weights: str, draw: int) -> None:
        w = self.SHAPES[weights] / self.SHAPES[weights].sum()
        left = np.cumsum(w) - w
        positions, places, copies = self.draw(method, weights, draw)
        for i in range(10):
            self.intervals[i].set_x(left[i])
            self.intervals[i].set_width(w[i])
            self.names[i].set_x(left[i] + w[i] / 2)
            self.names[i].set_visible(bool(w[i] > 0.018))
            self.expected[i].set_height(10 * w[i])
        self.positions.set_data(positions, np.full(positions.size, 1.0))
        self.certain.set_data(places, np.full(places.size, 1.0))
        centre, sd = self.statistics(method, weights)
        bars = np.array([[i, i, np.nan] for i in range(10)]) + 0.22, np.stack([centre - sd, centre + sd, sd], axis=1)
        self.spread.set_data(bars[0].ravel(), bars[1].ravel())
        self.centre.set_data(np.arange(10) + 0.22, centre)
        self.drawn.set_data(np.arange(10), copies)
        ess = particles.effective_sample_size(w)
        self.title.set_text(
            f"{method}: {np.sum(copies > 0)} of 10 survive (ESS {ess:.1f}), variance of the copies {np.sum(sd**2):.1f}"
        )

    def alt(self, method: str, weights: str, draw: int) -> str:
        copies = self.draw(method, weights, draw)[2]
        return (
            f"Ten weights as intervals of [0, 1], positions of {method} resampling above; below, bars of ten times the "
            f"weight and this draw's copies: {', '.join(map(str, copies))}"
        )


class LostRobot:
    """A robot that starts anywhere: the cloud in the whole lab, and close to the robot with its headings.

    history : (weighed cloud, true pose) after each half second.  Time 0 shows the first cloud without its weights:
        the belief before any range.
    """

    def __init__(self, history: list[tuple[Particles, Array]]) -> None:
        self.history = history
        self.figure = plotting.figure(8.8, 4.0)
        room, close = plotting.axes(self.figure, 1, 2, width_ratios=[1.45, 1])
        plotting.draw_arena(room, LAB)
        (self.dots,) = room.plot([], [], ".", color=plotting.ESTIMATE, ms=2.5, alpha=0.5, label="1000 of the particles")
        self.arrows = close.quiver(
            *np.zeros((4, 120)), color=plotting.ESTIMATE, angles="xy", scale=14, width=0.006, alpha=0.6
        )
        self.robots = [
            plotting.draw_robot(ax, np.zeros(3), colour=plotting.TRUTH, size=size)
            for ax, size in ((room, 0.4), (close, 0.28))
        ]
        room.plot([], [], ">", color=plotting.TRUTH, ms=8, label="true robot")
        room.set(xlim=(-4.1, 4.1), ylim=(-3.1, 3.1))
        close.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.1), aspect="equal", xlabel="x − x of the robot [m]")
        close.set_ylabel("y − y of the robot [m]")
        self.titles = [ax.set_title(" ", loc="left") for ax in (room, close)]
        self.figure.legend(*room.get_legend_handles_labels(), loc="outside lower center", ncols=2, markerscale=1.5)
        self.moving: list[Artist] = [self.dots, self.arrows, *self.robots, *self.titles]

    def look(self, time: float) -> tuple[Particles, Array, str]:
        """The cloud at a time [s], the true pose, and how well the cloud knows the heading, in words."""
        cloud, truth = self.history[max(round(2 * time) - 1, 0)]
        if time == 0:
            cloud = Particles(cloud.states, angles=(2,))
        length = min(abs(cloud.weights @ np.exp(1j * cloud.states[:, 2])), 1.0)  # 1: all point the same way
        spread = np.degrees(np.sqrt(-2 * np.log(length)))
        return cloud, truth, f"±{spread:.0f}°" if spread < 90 else "any"

    def update(self, *, time: float) -> None:
        cloud, truth, heading = self.look(time)
        rng = np.random.default_rng(lab_seed(7) + round(2 * time))
        self.dots.set_data(*cloud.states[rng.choice(len(cloud), size=1000, p=cloud.weights), :2].T)
        x, y, theta = cloud.states[rng.choice(len(cloud), size=120, p=cloud.weights)].T
        self.arrows.set_offsets(np.stack([x - truth[0], y - truth[1]], axis=1))
        self.arrows.set_UVC(np.cos(theta), np.sin(theta))
        for robot, pose, size in zip(self.robots, (truth, np.array([0, 0, truth[2]])), (0.4, 0.28), strict=True):
            robot.set_xy(plotting.robot_outline(pose, size))
        self.titles[0].set_text(f"{time:g} s: {len(cloud):,d} particles, {_ess(cloud):,.0f} count")
        self.titles[1].set_text(f"close to the robot; heading: {heading}")

    def alt(self, time: float) -> str:
        cloud, truth, heading = self.look(time)
        off = np.linalg.norm(_mean(cloud)[:2] - truth[:2])
        return (
            f"A lab from above with its beacons and {len(cloud)} guesses, {_ess(cloud):.0f} count; their mean is "
            f"{off:.2f} m from the robot, and their headings: {heading}"
        )


class NoiseModels:
    """Ten seconds of dead reckoning, cut into steps: where 1500 robots end, and how wide they lie."""

    STEPS = (1, 2, 5, 10, 20, 50, 100)
    NOISE: ClassVar = {
        "fresh, same σ": plotting.MEASUREMENT,
        "fresh, σ·√steps": plotting.BAND,
        "held": plotting.ESTIMATE,
    }

    def __init__(self) -> None:
        self.endings = {(k, noise): self.dead_reckoning(k, noise) for k in self.STEPS for noise in self.NOISE}
        self.figure = plotting.figure(7.6, 3.9)
        ax, curve = plotting.axes(self.figure, 1, 2, width_ratios=[1.15, 1])
        ax.plot(*planned_path(12)[:, :2].T, color=plotting.ODOMETRY, lw=1, ls="--")
        (self.cloud,) = ax.plot([], [], ".", ms=2.5, alpha=0.5)
        ax.set(xlim=(-1.7, 3.5), ylim=(0.4, 4.6), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        self.title = ax.set_title(" ", loc="left")
        for noise, colour in self.NOISE.items():
            variance = [self.endings[k, noise][:, 0].var() for k in self.STEPS]
            curve.plot(self.STEPS, variance, ".-", color=colour, label=noise)
        (self.here,) = curve.plot([], [], "o", mfc="none", mec=plotting.TRUTH, ms=11, mew=2)
        curve.set(xscale="log", yscale="log", xlabel="steps in 10 s", ylabel="var x [m²]")
        curve.set_title("one σ, three meanings", loc="left")
        curve.legend(loc="lower left")
        self.moving: list[Artist] = [self.cloud, self.title, self.here]

    @staticmethod
    def dead_reckoning(steps: int, noise: str, n: int = 1500) -> Array:
        """Poses after 10 s in ``steps`` steps, (n, 3)."""
        rng = np.random.default_rng(lab_seed(7) + 3)
        if noise == "held":
            held = CONTROL + rng.standard_normal((n, 2)) * [drive().sigma_v, drive().sigma_omega]
            poses = np.zeros((n, 3))
            for _ in range(steps):
                poses = drive().f(poses, held, 10 / steps)
            return poses
        cloud, model = at_the_start(n), drive(0.05 * (np.sqrt(steps) if "√" in noise else 1.0))
        for _ in range(steps):
            cloud = particles.predict(cloud, model, CONTROL, 10 / steps, rng)
        return cloud.states

    def update(self, *, steps: int, noise: str) -> None:
        poses = self.endings[steps, noise]
        self.cloud.set_data(*poses[:, :2].T)
        self.cloud.set_color(self.NOISE[noise])
        self.here.set_data([steps], [poses[:, 0].var()])
        self.title.set_text(f"{steps} step{'s' * (steps > 1)} of {10 / steps:g} s: var x = {poses[:, 0].var():.4f} m²")

    def alt(self, steps: int, noise: str) -> str:
        poses = self.endings[steps, noise]
        return (
            f"Endings of 1500 robots after 10 s in {steps} steps, noise {noise}: they spread {poses[:, 0].std():.2f} m "
            f"along x and {poses[:, 1].std():.2f} m along y; beside them, var x against the number of steps"
        )


def _mean(cloud: Particles) -> Array:
    return particles.mean(cloud)


def _ess(cloud: Particles) -> float:
    return particles.effective_sample_size(cloud.weights)
