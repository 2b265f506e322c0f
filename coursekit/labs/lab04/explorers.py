"""Lab 4's explorers: one step after the other, a filter to mistune, a gate that locks out, the homework's ranges."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from coursekit import ekf
from coursekit.gaussian import Gaussian, chi2_band, ellipse, nees
from coursekit.geometry import Array
from coursekit.labs.lab04.figures import Strips, average_nis
from coursekit.labs.lab04.runs import (
    DT,
    LANDMARKS,
    POINTS,
    STEPS,
    Drives,
    R,
    Tracks,
    homework,
    localise,
    scaled,
    simulate,
)
from coursekit.models import DifferentialDrive, RangeBearing
from coursekit.teaching import experiments, plotting


def _halves(width: float, height: float, ratios: tuple[float, float]) -> tuple[Figure, Any, Any]:
    """A figure, the axes of a map in its left half, and its right half."""
    fig = plotting.figure(width, height)
    halves: Any = fig.subfigures(1, 2, width_ratios=ratios)
    left, right = halves
    return fig, plotting.axes(left), right


class Cycle:
    """Predict, correct, predict, correct: what each half of a step does to the ellipse."""

    MOMENTS = tuple(range(17))  # the start, then a prediction and a correction in turn
    MARKS = np.array([[1.5, 2.2], [4.4, -0.6]])

    def __init__(self) -> None:
        self.figure, ax, right = _halves(8.2, 4.1, (1.5, 1))
        bars = plotting.axes(right)
        ax.plot(*self.MARKS.T, "s", color=plotting.WALL, ms=8, label="landmark")
        (self.truth,) = ax.plot([], [], color=plotting.TRUTH, lw=1.2, label="truth")
        (self.before,) = ax.plot([], [], color=plotting.ODOMETRY, lw=1.2, ls="--", label="one moment before")
        (self.now,) = ax.plot([], [], color=plotting.ESTIMATE, lw=2.2, label="95 % claim")
        (self.ray,) = ax.plot([], [], color=plotting.MEASUREMENT, lw=1.4, label="measured")
        self.robot = plotting.draw_robot(ax, [0, 0, 0], colour=plotting.TRUTH, size=0.35)
        ax.set_aspect("equal")
        ax.set(xlim=(-0.9, 5.3), ylim=(-1.2, 3.6), xlabel="x [m]", ylabel="y [m]")
        self.figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=5)
        self.title = ax.set_title(" ")
        self.bars = bars.bar(["x [m]", "y [m]", "θ [rad]"], [0, 0, 0], color=plotting.ESTIMATE)
        bars.set(ylim=(0, 0.6), ylabel="σ that the filter claims", title="Standard deviations")
        self.moving: list[Artist] = [
            self.truth, self.before, self.now, self.ray, self.robot, self.title, *self.bars
        ]  # fmt: skip

    def update(self, moment: int, sees: str) -> None:
        """The moment, from 0; what the camera gives: "range and bearing", "range only", "bearing only", "nothing"."""
        truth, beliefs, rays = self.follow(sees)
        k, belief, before = (moment + 1) // 2, beliefs[moment], beliefs[max(moment - 1, 0)]
        self.truth.set_data(*truth[: k + 1, :2].T)
        self.robot.set_xy(plotting.robot_outline(truth[k], 0.35))
        for line, shown in ((self.now, belief), (self.before, before)):
            line.set_data(*(shown.mean[:2] + ellipse(shown.cov[:2, :2])).T)
        corrected = moment > 0 and moment % 2 == 0
        self.ray.set_data(*(rays[k - 1].T if corrected and sees != "nothing" else np.empty((2, 0))))
        for bar, sigma in zip(self.bars, np.sqrt(np.diag(belief.cov)), strict=True):
            bar.set_height(sigma)
        area = np.pi * 5.99 * np.sqrt(np.linalg.det(belief.cov[:2, :2]))
        what = "start" if moment == 0 else f"{'correct' if corrected else 'predict'} (second {k})"
        self.title.set_text(f"{what}: the ellipse covers {area:.2f} m²")

    @classmethod
    def words(cls, moment: int, sees: str) -> str:
        """What a frame shows, with its result."""
        area = np.pi * 5.99 * np.sqrt(np.linalg.det(cls.follow(sees)[1][moment].cov[:2, :2]))
        return f"A robot's 95 % ellipse before and after this moment; it now covers {area:.2f} square metres"

    @classmethod
    @lru_cache(maxsize=8)
    def follow(cls, sees: str) -> tuple[Array, list[Gaussian], list[Array]]:
        """Truth (9, 3), the belief at each moment, and each step's line from the robot to what it saw."""
        rng, motion = np.random.default_rng(experiments.lab_seed(4)), DifferentialDrive(0.1, 0.08)
        cov = np.diag([0.1, 0.1, 0.12]) ** 2
        beliefs, truth, rays = [Gaussian(np.zeros(3), cov)], [rng.standard_normal(3) @ np.linalg.cholesky(cov).T], []
        variances = {"range only": [0.08, 9.0], "bearing only": [99.0, 0.03], "nothing": [99.0, 9.0]}
        for k in range(8):
            truth.append(motion.sample(truth[-1], [0.55, 0.22], 1.0, rng))
            beliefs.append(ekf.predict(beliefs[-1], motion, [0.55, 0.22], 1.0))
            sensor = RangeBearing(cls.MARKS[k % 2], np.diag(variances.get(sees, [0.08, 0.03])) ** 2)
            z = sensor.h(truth[-1]) + rng.standard_normal(2) * [0.08, 0.03]
            beliefs.append(beliefs[-1] if sees == "nothing" else ekf.correct(beliefs[-1], sensor, z).belief)
            rays.append(np.array([truth[-1][:2], RangeBearing.g(truth[-1], z)]))
        return np.array(truth), beliefs, rays


class Tuning:
    """One hundred drives, filtered at once while Q, R and the landmarks are turned; one of them on the map."""

    RUNS = 100

    def __init__(self) -> None:
        self.figure, room, right = _halves(8.2, 4.1, (1.1, 1))
        (self.landmarks,) = room.plot([], [], "s", color=plotting.WALL, ms=6, label="landmark")
        (self.truth,) = room.plot([], [], color=plotting.TRUTH, lw=1.2, label="truth")
        (self.track,) = room.plot([], [], color=plotting.ESTIMATE, lw=1.2, label="estimate")
        self.ellipses = [room.plot([], [], color=plotting.ESTIMATE, lw=1)[0] for _ in range(8)]
        room.set_aspect("equal")
        room.set(xlim=(-3.5, 3.7), ylim=(-2.7, 2.9), xlabel="x [m]", ylabel="y [m]")
        self.figure.legend(*room.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        self.title = room.set_title(" ")
        self.t = DT * np.arange(1, STEPS + 1)
        self.scores = Strips(right, self.t[-1], (3, 2), self.RUNS)
        self.moving: list[Artist] = [
            self.landmarks, self.truth, self.track, *self.ellipses, self.title, *self.scores.moving
        ]  # fmt: skip

    def update(self, q_scale: float, r_scale: float, landmarks: int) -> None:
        """Q and R as multiples of the honest ones; 1, 2 or 6 landmarks."""
        drives, tracks = self.follow(q_scale, r_scale, landmarks)
        self.landmarks.set_data(*LANDMARKS[:landmarks].T)
        self.truth.set_data(*drives.truth[0, :, :2].T)
        self.track.set_data(*tracks.mean[0, :, :2].T)
        for line, k in zip(self.ellipses, range(10, STEPS, 10), strict=False):
            line.set_data(*(tracks.mean[0, k, :2] + ellipse(tracks.cov[0, k, :2, :2])).T)
        rms = np.sqrt(np.mean(tracks.error(drives) ** 2))
        self.title.set_text(f"RMS error of {self.RUNS} drives: {rms:.2f} m")
        self.scores.show(self.t, tracks.nees.mean(axis=0), average_nis(tracks.nis), float(np.nanmean(tracks.nis)))

    @classmethod
    def facts(cls, q_scale: float, r_scale: float, landmarks: int) -> dict[str, str]:
        """Error, average NEES and NIS, and the share of the steps whose NEES lies in its band."""
        drives, tracks = cls.follow(q_scale, r_scale, landmarks)
        (low, high), average = chi2_band(3, cls.RUNS), tracks.nees.mean(axis=0)
        return {
            "error": f"{np.sqrt(np.mean(tracks.error(drives) ** 2)):.2f} m",
            "nees": f"{average.mean():.1f}",
            "inside": f"{100 * np.mean((average > low) & (average < high)):.0f} %",
            "nis": f"{np.nanmean(tracks.nis):.1f}",
        }

    @classmethod
    def words(cls, **values: Any) -> str:
        """What a frame shows, with its result."""
        facts = cls.facts(**values)
        return (
            f"One of {cls.RUNS} drives with its ellipses; their average NEES is {facts['nees']}, inside its band at "
            f"{facts['inside']} of the steps, their NIS {facts['nis']}, their position error {facts['error']}"
        )

    @classmethod
    @lru_cache(maxsize=200)
    def follow(cls, q_scale: float, r_scale: float, landmarks: int) -> tuple[Drives, Tracks]:
        """The drives, and what the filter makes of them."""
        drives = cls.drives(landmarks)
        seed = experiments.lab_seed(4) + 1
        return drives, localise(drives, drives.start(seed), r_scale * R, scaled(q_scale))

    @classmethod
    @lru_cache(maxsize=3)
    def drives(cls, landmarks: int) -> Drives:
        """The same hundred drives, however many landmarks stand there."""
        return simulate(np.random.default_rng(experiments.lab_seed(4)), cls.RUNS, landmarks=landmarks)


class LockedOut:
    """The robot is pushed aside at half time, in forty drives.  Which filter finds it again?"""

    CORRECTIONS = ("no gate", "hard gate 0.99", "robust 0.99")
    RUNS, LOST = 40, 0.3  # m

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 4.3)
        axes: Any = plotting.axes(self.figure, 2, 1, sharex=True, height_ratios=[1.5, 1])
        self.t = DT * np.arange(1, STEPS + 1)
        at = self.t[STEPS // 2]
        for ax in axes:
            ax.axvline(at, color=plotting.HIGHLIGHT, lw=1.2, ls="--")
        errors, refused = axes
        errors.annotate("pushed", (at + 0.1, 1.35), color="#8a6000", fontsize=9.5)
        self.lines = [errors.plot([], [], color=plotting.ESTIMATE, lw=0.6, alpha=0.6)[0] for _ in range(self.RUNS)]
        errors.axhline(self.LOST, color=plotting.WALL, lw=0.8, ls=":")
        errors.set(ylim=(0, 1.5), xlim=(0, self.t[-1]), ylabel="error [m]")
        (self.refused,) = refused.plot([], [], ".", color=plotting.MEASUREMENT, ms=4)
        refused.set(ylim=(-3, 103), ylabel="refused [%]", xlabel="time [s]")
        self.title, self.share = errors.set_title(" "), refused.set_title(" ")
        self.moving: list[Artist] = [*self.lines, self.refused, self.title, self.share]

    def update(self, push: float, q_scale: float, correction: str) -> None:
        """How far each is pushed [m], Q as a multiple of the honest one, and what is done about surprises."""
        drives, tracks = self.follow(push, q_scale, correction)
        errors = tracks.error(drives)
        for line, error in zip(self.lines, errors, strict=True):
            line.set_data(self.t, np.minimum(error, 1.48))
        made, kept = np.isfinite(tracks.nis).sum(axis=(0, 2)), tracks.used.sum(axis=(0, 2))
        share = np.divide(100.0 * (made - kept), made, out=np.full(len(made), np.nan), where=made > 0)
        self.refused.set_data(self.t, share)
        late = slice(STEPS // 2 + 1, None)
        refused = 1 - kept[late].sum() / made[late].sum()
        self.title.set_text(
            f"{100 * self.lost(push, q_scale, correction):.0f} % of {self.RUNS} drives end more than "
            f"{self.LOST} m off; median {np.median(errors[:, -1]):.2f} m"
        )
        self.share.set_text(f"{100 * refused:.0f} % of the measurements after the push were refused")

    @classmethod
    def words(cls, push: float, q_scale: float, correction: str) -> str:
        """What a frame shows, with its result."""
        share = cls.lost(push, q_scale, correction)
        return f"Position errors of {cls.RUNS} drives over time; {100 * share:.0f} % end more than {cls.LOST} m off"

    @classmethod
    def lost(cls, push: float, q_scale: float, correction: str) -> float:
        """The share of the drives that end more than ``LOST`` metres off."""
        drives, tracks = cls.follow(push, q_scale, correction)
        return float(np.mean(tracks.error(drives)[:, -1] > cls.LOST))

    @classmethod
    @lru_cache(maxsize=60)
    def follow(cls, push: float, q_scale: float, correction: str) -> tuple[Drives, Tracks]:
        """The drives with their push, and what the filter makes of them."""
        seed = experiments.lab_seed(4)
        drives = simulate(np.random.default_rng(seed + 12), cls.RUNS, push=push)
        return drives, localise(
            drives,
            drives.start(seed + 13),
            R,
            scaled(q_scale),
            gate=0.99 if correction == "hard gate 0.99" else None,
            correct=ekf.correct_robustly if correction == "robust 0.99" else ekf.correct,
        )


class RangesOnly:
    """The homework: where a point is that only hears how far it is from one, two or three landmarks."""

    def __init__(self) -> None:
        self.figure, ax, right = _halves(8.6, 4.1, (1.35, 1))
        ax.plot(*POINTS.T, "s", color=plotting.WALL, ms=7)
        (self.heard,) = ax.plot([], [], "s", color=plotting.HIGHLIGHT, ms=10, label="landmark that is heard")
        (self.truth,) = ax.plot([], [], color=plotting.TRUTH, label="truth")
        (self.track,) = ax.plot([], [], color=plotting.ESTIMATE, label="estimate")
        (self.ellipse,) = ax.plot([], [], color=plotting.ESTIMATE, lw=1.2)
        ax.set(xlim=(-1.2, 7.2), ylim=(-1.2, 6.4), xlabel="x [m]", ylabel="y [m]")
        ax.set_aspect("equal")
        self.figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)
        self.title = ax.set_title(" ")
        self.scores = Strips(right, 15.0, (2, 1), 40)
        self.moving: list[Artist] = [
            self.heard, self.truth, self.track, self.ellipse, self.title, *self.scores.moving
        ]  # fmt: skip

    def update(self, time: float, landmarks: int, jacobian: str) -> None:
        """Time [s], the number of landmarks, and whose Jacobian: "derived" or "the homework's"."""
        truth, beliefs, surprises = homework(landmarks, jacobian != "derived")
        k, place = round(time / 0.25), beliefs.marginal([0, 2])
        scores, t = nees(place, truth[..., [0, 2]]).mean(axis=1), 0.25 * np.arange(61)
        self.heard.set_data(*POINTS[:landmarks].T)
        self.truth.set_data(*truth[: k + 1, 0, [0, 2]].T)
        self.track.set_data(*place.mean[: k + 1, 0].T)
        self.ellipse.set_data(*(place.mean[k, 0] + ellipse(place.cov[k, 0])).T)
        error = np.hypot(*(place.mean[k] - truth[k][:, [0, 2]]).T)
        self.title.set_text(f"one of 40 walks; median error {np.median(error):.2f} m")
        nis = surprises[:k].mean(axis=(1, 2))
        self.scores.show(t[: k + 1], scores[: k + 1], np.append(np.nan, nis), nis.mean() if k else np.nan)

    @staticmethod
    def words(time: float, landmarks: int, jacobian: str) -> str:
        """What a frame shows, with its result."""
        truth, beliefs, _ = homework(landmarks, jacobian != "derived")
        k, place = round(time / 0.25), beliefs.marginal([0, 2])
        score = np.mean(nees(place, truth[..., [0, 2]])[k])
        return f"A walker's true and estimated track; the place's NEES, averaged over 40 walks, is now {score:.1f}"
