"""Lab 4's explorers: a filter to mistune, the homework's ranges, and a gate that locks out."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coursekit import ekf, plotting
from coursekit.failures.lab04 import column_repeated
from coursekit.gaussian import Gaussian, chi2_band, ellipse, nees
from coursekit.geometry import Array
from coursekit.models import ConstantVelocity, RangeOnly
from coursekit.scenes import lab04
from coursekit.scenes.lab04 import DT, LAB, LANDMARKS, STEPS, Drive, Track, drive, localise, pushed_drive


class OneRun:
    """NEES over NIS of one run, on a two-sided 95 % band each: stands beside every run that can be moved."""

    def __init__(self, fig: Any, duration: float, dofs: tuple[int, int], axes: Any = None) -> None:
        axes = plotting.axes(fig, 2, 1, sharex=True) if axes is None else axes
        self.bands = [chi2_band(dof) for dof in dofs]
        for ax, dof, band, name in zip(axes, dofs, self.bands, ("NEES", "NIS"), strict=True):
            ax.axhspan(*band, color=plotting.BAND, alpha=0.18, lw=0)
            ax.axhline(dof, color=plotting.BAND, ls="--", lw=1)
            ax.set(xlim=(0, duration), ylim=(0.01, 1000), yscale="log", ylabel=name)
            ax.set_yticks([0.01, 1, 100], ["0.01", "1", "100"])
        axes[-1].set_xlabel("time [s]")
        (self.nees,) = axes[0].plot([], [], color=plotting.ESTIMATE, lw=1.2)
        (self.nis,) = axes[1].plot([], [], ".", color=plotting.ESTIMATE, ms=4)
        (self.refused,) = axes[1].plot([], [], "x", color=plotting.MEASUREMENT, ms=4)
        self.titles = [ax.set_title(" ") for ax in axes]
        self.moving: list[Artist] = [self.nees, self.nis, self.refused, *self.titles]

    def show(self, t: Any, nees: Array, at: Array, nis: Array, used: NDArray[np.bool_] | None = None) -> None:
        """The NEES at each time t, and the NIS of each measurement at its time; those not used are crossed."""
        used = np.ones(len(nis), dtype=bool) if used is None else used
        self.nees.set_data(t, _on_paper(nees))
        self.nis.set_data(at[used], _on_paper(nis[used]))
        self.refused.set_data(at[~used], _on_paper(nis[~used]))
        for title, name, values, band in zip(self.titles, ("NEES", "NIS"), (nees, nis), self.bands, strict=True):
            inside = np.mean((values > band[0]) & (values < band[1])) if len(values) else np.nan
            title.set_text(f"{name}: {inside:.0%} inside the 95 % band" if len(values) else f"{name}: nothing yet")


def _on_paper(values: Array) -> Array:
    return np.clip(values, 0.012, 850)


def _halves(width: float, height: float, ratios: tuple[float, float]) -> tuple[Figure, Any, Any]:
    """A figure, the axes of a map in its left half, and its right half."""
    fig = plotting.figure(width, height)
    halves: Any = fig.subfigures(1, 2, width_ratios=ratios)
    left, right = halves
    return fig, plotting.axes(left), right


class Tuning:
    """Track, ellipses, NEES and NIS of one drive while Q, R, the landmarks and the gate are turned."""

    def __init__(self) -> None:
        self.figure, room, right = _halves(8.2, 4.3, (1.1, 1))
        plotting.draw_arena(room, replace(LAB, crates=(), cylinders=()))
        (self.landmarks,) = room.plot([], [], "o", color=plotting.WALL, ms=6)
        (self.truth,) = room.plot([], [], color=plotting.TRUTH, lw=1.2, label="truth")
        (self.track,) = room.plot([], [], color=plotting.ESTIMATE, lw=1.2, label="estimate")
        self.ellipses = [room.plot([], [], color=plotting.ESTIMATE, lw=1)[0] for _ in range(6)]
        room.legend(loc="upper center", ncols=2)
        self.title = room.set_title(" ")
        self.t = DT * np.arange(1, STEPS + 1)
        self.scores = OneRun(right, self.t[-1], (3, 2))
        self.moving: list[Artist] = [
            self.landmarks, self.truth, self.track, *self.ellipses, self.title, *self.scores.moving
        ]  # fmt: skip

    def update(self, q_scale: float, r_scale: float, landmarks: int, gate: str) -> None:
        """Q and R as multiples of the honest ones; 1, 2 or 6 landmarks; the gate "off" or a probability."""
        track, run = self.follow(q_scale, r_scale, landmarks, gate)
        self.landmarks.set_data(*LANDMARKS[:landmarks].T)
        self.truth.set_data(*run.truth[:, :2].T)
        self.track.set_data(*track.means[:, :2].T)
        for line, k in zip(self.ellipses, range(20, STEPS, 20), strict=True):
            belief = track.beliefs[k]
            line.set_data(*(belief.mean[:2] + ellipse(belief.cov[:2, :2])).T)
        error = np.hypot(*(track.means[:, :2] - run.truth[1:, :2]).T)
        refused = "" if track.used.all() else f", {np.mean(~track.used):.0%} refused"
        self.title.set_text(f"RMS error {np.sqrt(np.mean(error**2)):.2f} m{refused}")
        self.scores.show(self.t, track.nees, track.measured_at, track.nis, track.used)

    @staticmethod
    @lru_cache(maxsize=200)
    def follow(q_scale: float, r_scale: float, landmarks: int, gate: str) -> tuple[Track, Drive]:
        """The drive, and what a filter makes of it."""
        run = drive(np.random.default_rng(4), landmarks)
        sense = lab04.believing(lab04.sensor_noise(), r_scale)
        return localise(run, sense, lab04.scaled(q_scale), gate=None if gate == "off" else float(gate)), run


POINTS = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 5.0]])
WALK, NOTHING = ConstantVelocity(sigma_a=0.05), np.empty(0)  # nobody steers it


@lru_cache
def homework(landmarks: int, wrong: bool) -> tuple[Array, list[Gaussian], Array]:
    """Constant velocity and ranges only: truth (61, 4), the belief after each step, and each NIS, (60, landmarks)."""
    rng = np.random.default_rng(7)
    truth = [np.array([1.0, 0.25, 0.8, 0.15])]
    belief = Gaussian(np.array([1.3, 0.2, 0.5, 0.2]), np.diag([0.4, 0.1, 0.4, 0.1]) ** 2)
    beliefs, surprises = [belief], []
    sensors = [(column_repeated if wrong else RangeOnly)(p, np.diag([0.05**2])) for p in POINTS[:landmarks]]
    for _ in range(60):
        truth.append(WALK.sample(truth[-1][None], NOTHING, 0.25, rng)[0])
        belief = ekf.predict(belief, WALK, NOTHING, 0.25)
        ranges = [
            np.hypot(*(truth[-1][[0, 2]] - p)) + 0.05 * e for p, e in zip(POINTS, rng.normal(size=3), strict=True)
        ]
        for sensor, z in zip(sensors, ranges, strict=False):
            correction = ekf.correct(belief, sensor, np.array([z]))
            belief = correction.belief
            surprises.append(correction.nis)
        beliefs.append(belief)
    return np.array(truth), beliefs, np.array(surprises).reshape(60, landmarks)


@lru_cache
def place_nees(landmarks: int, wrong: bool) -> Array:
    """NEES of the place alone, two numbers, at the start and after each step of ``homework``, (61,)."""
    truth, beliefs, _ = homework(landmarks, wrong)
    return np.array([nees(b.marginal([0, 2]), x[[0, 2]]) for b, x in zip(beliefs, truth, strict=True)])


class RangesOnly:
    """The homework: where a point is that only hears how far it is from one, two or three landmarks."""

    def __init__(self) -> None:
        self.figure, ax, right = _halves(8.6, 4.3, (1.35, 1))
        ax.plot(*POINTS.T, "^", color=plotting.WALL, ms=8)
        (self.heard,) = ax.plot([], [], "^", color=plotting.HIGHLIGHT, ms=11, label="landmarks that are heard")
        (self.truth,) = ax.plot([], [], color=plotting.TRUTH, label="truth")
        (self.track,) = ax.plot([], [], color=plotting.ESTIMATE, label="estimate")
        (self.ellipse,) = ax.plot([], [], color=plotting.ESTIMATE, lw=1.2)
        ax.set(xlim=(-1.2, 7.2), ylim=(-1.2, 7.4), xlabel="x [m]", ylabel="y [m]")
        ax.set_aspect("equal")
        ax.legend(loc="upper left")
        self.title = ax.set_title(" ")
        self.scores = OneRun(right, 15.0, (2, 1))
        self.moving: list[Artist] = [
            self.heard, self.truth, self.track, self.ellipse, self.title, *self.scores.moving
        ]  # fmt: skip

    def update(self, time: float, landmarks: int, jacobian: str) -> None:
        """Time [s], the number of landmarks, and whose Jacobian: "derived" or "the homework's"."""
        truth, beliefs, surprises = homework(landmarks, jacobian != "derived")
        k = round(time / 0.25)
        means = np.array([b.mean for b in beliefs[: k + 1]])
        place, t, scores = (
            beliefs[k].marginal([0, 2]),
            0.25 * np.arange(61),
            place_nees(landmarks, jacobian != "derived"),
        )
        self.heard.set_data(*POINTS[:landmarks].T)
        self.truth.set_data(truth[: k + 1, 0], truth[: k + 1, 2])
        self.track.set_data(means[:, 0], means[:, 2])
        self.ellipse.set_data(*(place.mean + ellipse(place.cov)).T)
        error = np.hypot(*(place.mean - truth[k, [0, 2]]))
        verdict = "inside" if scores[k] < ekf.gate_threshold(0.95, 2) else "outside"
        self.title.set_text(f"{error:.2f} m off; truth {verdict} the 95 % ellipse")
        self.scores.show(t[: k + 1], scores[: k + 1], np.repeat(t[1 : k + 1], landmarks), surprises[:k].ravel())


class LockedOut:
    """The robot is pushed aside at 6 s.  Which filter finds it again?"""

    CORRECTIONS = ("no gate", "hard gate 0.99", "robust 0.99")

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 5.4)
        axes: Any = plotting.axes(self.figure, 3, 1, sharex=True, height_ratios=[1.3, 1, 1])
        error, _, nis = axes
        self.t = DT * np.arange(1, STEPS + 1)
        for ax in axes:
            ax.axvline(6.0, color=plotting.HIGHLIGHT, lw=1.2, ls="--")
        error.annotate("pushed", (6.1, 1.25), color="#8a6000", fontsize=9.5)
        (self.error,) = error.plot([], [], color=plotting.MEASUREMENT, label="error of the position")
        (self.claim,) = error.plot([], [], color=plotting.ESTIMATE, label="what the filter claims: 95 %")
        error.set(ylim=(0, 1.5), ylabel="metres")
        error.legend(loc="upper right")
        self.title = error.set_title(" ")
        self.scores = OneRun(None, self.t[-1], (3, 2), axes[1:])
        threshold = ekf.gate_threshold(0.99, 2)
        nis.axhline(threshold, color=plotting.WALL, lw=1)
        nis.annotate("gate", (0.1, 1.2 * threshold), color=plotting.WALL, fontsize=9.5)
        nis.set_ylabel("NIS (× refused)")
        self.moving: list[Artist] = [self.error, self.claim, self.title, *self.scores.moving]

    def update(self, push: float, q_scale: float, correction: str) -> None:
        """How far it is pushed [m], Q as a multiple of the honest one, and what is done about surprises."""
        track, run = self.follow(push, q_scale, correction)
        spreads = np.linalg.eigvalsh(np.array([b.cov[:2, :2] for b in track.beliefs]))[:, -1]
        self.error.set_data(self.t, np.hypot(*(track.means[:, :2] - run.truth[1:, :2]).T))
        self.claim.set_data(self.t, np.sqrt(ekf.gate_threshold(0.95, 2) * spreads))
        self.scores.show(self.t, track.nees, track.measured_at, track.nis, track.used)
        late = track.measured_at > 6
        end = float(np.hypot(*(track.means[-1, :2] - run.truth[-1, :2])))
        self.title.set_text(f"{np.mean(~track.used[late]):.0%} refused after the push; at the end {end:.2f} m off")

    @staticmethod
    @lru_cache(maxsize=200)
    def follow(push: float, q_scale: float, correction: str) -> tuple[Track, Drive]:
        """The drive with its push, and what a filter makes of it."""
        run = pushed_drive(push)
        robust = correction == "robust 0.99"
        return localise(
            run,
            lab04.believing(lab04.sensor_noise()),
            lab04.scaled(q_scale),
            gate=0.99 if correction == "hard gate 0.99" else None,
            correct=ekf.correct_robustly if robust else ekf.correct,
        ), run
