"""Lab 4's drives and pictures: localisation among six cylinders, the homework's ranges, and a gate that locks out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coursekit import datasets, ekf, experiments, noise, plotting
from coursekit.failures.lab04 import column_repeated
from coursekit.gaussian import Gaussian, chi2_band, ellipse, nees
from coursekit.geometry import Array, transform, wrap_angle
from coursekit.models import ConstantVelocity, DifferentialDrive, RangeBearing, RangeOnly, pose_residual
from coursekit.world.arena import Arena

LAB = Arena.load("lab")
LANDMARKS = np.array([c.position for c in LAB.cylinders])
SENSORS = [RangeBearing(p) for p in LANDMARKS]
MOTION = DifferentialDrive(sigma_v=0.06, sigma_omega=0.08)
START = Gaussian(np.array([1.2, -1.2, 0.7]), np.diag([0.05, 0.05, 0.03]) ** 2)
CONTROL, DT, STEPS = np.array([0.5, 0.36]), 0.15, 130  # m/s, rad/s; s
SIGHT = 0.53  # rad to either side: where the course's camera ends
Sense = Callable[[Array], tuple[Array, Array]]
"""What a filter makes of a raw measurement (2,): the measurement that it believes, and its R."""


@lru_cache
def sensor_noise() -> noise.Calibrated:
    """Lab 3's model of the camera, fitted to the world's own log."""
    return noise.fit_calibrated(datasets.load("landmark_log"))


@lru_cache
def report_noise() -> noise.Piecewise:
    """The report's model, fitted to the same log."""
    return noise.fit_piecewise(datasets.load("landmark_log"))


def believing(model: Any, r_scale: float = 1.0) -> Sense:
    """A filter's eyes: the model's correction and its R, ``r_scale`` times."""

    def sense(z: Array) -> tuple[Array, Array]:
        return np.array(model.correct(z[0], z[1])), r_scale * model.R(z[0], z[1])

    return sense


@dataclass(frozen=True)
class Drive:
    """One drive: the truth (n + 1, 3), and for each of the n steps what was seen, (which landmark, raw z) pairs."""

    truth: Array
    seen: list[list[tuple[int, Array]]]


def drive(rng: np.random.Generator, landmarks: int = 6, steps: int = STEPS, start: Gaussian = START) -> Drive:
    """A lap and more of the lab, with the noise of ``MOTION`` on the wheels and lab 3's on the camera."""
    truth, seen = [start.sample(rng, 1)[0]], []
    for _ in range(steps):
        truth.append(MOTION.sample(truth[-1], CONTROL, DT, rng))
        seen.append(glimpse(truth[-1], rng, landmarks))
    return Drive(np.array(truth), seen)


def glimpse(pose: Array, rng: np.random.Generator, landmarks: int = 6) -> list[tuple[int, Array]]:
    """What the camera says of the landmarks in its field of view, uncorrected: (which, raw range and bearing) pairs.

    Lab 3's model runs from what was measured to what is true; a raw measurement is found by going back.
    """
    model, noises = sensor_noise(), rng.standard_normal((len(LANDMARKS), 2))
    dx, dy = (LANDMARKS[:landmarks] - pose[:2]).T
    z = np.stack([np.hypot(dx, dy), wrap_angle(np.arctan2(dy, dx) - pose[2])], axis=-1)
    visible = np.flatnonzero(np.abs(z[:, 1]) < SIGHT)
    if not visible.size:
        return []
    z, noises = z[visible], noises[visible]
    raw = z - [model.offset, 0.0]
    for _ in range(3):  # the correction is nearly a shift, so this converges at once
        sigma = np.sqrt(np.diagonal(model.R(*raw.T), axis1=1, axis2=2))
        raw = raw + z + sigma * noises - np.stack(model.correct(*raw.T), axis=-1)
    return list(zip(visible.tolist(), raw, strict=True))


@dataclass(frozen=True)
class Track:
    """What a filter believed after each step, and how it did: NEES (n,), and each measurement's time, NIS, verdict."""

    beliefs: list[Gaussian]
    nees: Array
    measured_at: Array
    nis: Array
    used: NDArray[np.bool_]

    @property
    def means(self) -> Array:
        """(n, 3)."""
        return np.array([b.mean for b in self.beliefs])


def localise(
    run: Drive,
    sense: Sense,
    motion: DifferentialDrive = MOTION,
    *,
    start: Gaussian = START,
    gate: float | None = None,
    correct: Callable[..., ekf.Correction] = ekf.correct,
    every: int = 1,
) -> Track:
    """Predict at every step, correct with every measurement that passes the gate (a probability; None lets all in)."""
    belief, beliefs, scores, measured = start, [], [], []
    for k, seen in enumerate(run.seen, 1):
        belief = ekf.predict(belief, motion, CONTROL, DT)
        for i, raw in seen if k % every == 0 else []:
            z, R = sense(raw)
            correction = correct(belief, SENSORS[i], z, R)
            passes = gate is None or correction.nis < ekf.gate_threshold(gate, 2)
            belief = correction.belief if passes else belief
            measured.append((k * DT, correction.nis, passes))
        beliefs.append(belief)
        scores.append(nees(belief, run.truth[k], pose_residual))
    at, nis, used = np.array(measured).reshape(-1, 3).T
    return Track(beliefs, np.array(scores), at, nis, used.astype(bool))


def average_nees(sense: Sense, motion: DifferentialDrive = MOTION, runs: int = 100, **options: Any) -> Array:
    """NEES at each step, averaged over seeded runs, (n,): the figure that has a chi-square band."""
    tracks = experiments.monte_carlo(lambda rng: localise(drive(rng), sense, motion, **options), runs)
    return np.mean([t.nees for t in tracks], axis=0)


def late_scores(rng: np.random.Generator, late: int, replay: Callable[..., list[Gaussian]] | None) -> float:
    """Mean NEES of one drive on which every measurement comes ``late`` steps late.

    ``replay(history, sensor, z, R, late)`` rewrites the beliefs up to now; None applies it to the present as it is.
    """
    run, sense, history, scores = drive(rng), believing(sensor_noise()), [START], []
    for k in range(1, STEPS + 1):
        history.append(ekf.predict(history[-1], MOTION, CONTROL, DT))
        for i, raw in run.seen[k - 1 - late] if k > late else []:
            z, R = sense(raw)
            if replay is None:
                history[-1] = ekf.correct(history[-1], SENSORS[i], z, R).belief
            else:
                history = replay(history, SENSORS[i], z, R, late)
        scores.append(nees(history[-1], run.truth[k], pose_residual))
    return float(np.mean(scores))


def scaled(q_scale: float) -> DifferentialDrive:
    """The motion model with Q ``q_scale`` times the true one."""
    s = np.sqrt(q_scale)
    return DifferentialDrive(s * MOTION.sigma_v, s * MOTION.sigma_omega, tuple(s * np.array(MOTION.sigma_slip)))


class Tuning:
    """Track, ellipses and NEES of one drive while Q, R, the landmarks and the gate are turned."""

    def __init__(self) -> None:
        self.figure = plotting.figure(7.8, 4.3)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1.1, 1])
        room, strip = axes
        plotting.draw_arena(room, replace(LAB, crates=(), cylinders=()))
        (self.landmarks,) = room.plot([], [], "o", color=plotting.WALL, ms=6)
        (self.truth,) = room.plot([], [], color=plotting.TRUTH, lw=1.2, label="truth")
        (self.track,) = room.plot([], [], color=plotting.ESTIMATE, lw=1.2, label="estimate")
        self.ellipses = [room.plot([], [], color=plotting.ESTIMATE, lw=1)[0] for _ in range(6)]
        room.legend(loc="upper center", ncols=2)
        self.title = room.set_title(" ")
        low, high = chi2_band(3)
        self.t = DT * np.arange(1, STEPS + 1)
        strip.axhspan(low, high, color=plotting.BAND, alpha=0.18, lw=0)
        strip.axhline(3, color=plotting.BAND, ls="--", lw=1)
        (self.nees,) = strip.plot([], [], color=plotting.ESTIMATE, lw=1.2)
        strip.set(xlim=(0, self.t[-1]), ylim=(0.01, 1000), yscale="log", xlabel="time [s]", ylabel="NEES of one run")
        strip.yaxis.set_major_formatter("{x:g}")
        self.words = strip.set_title(" ")
        self.moving: list[Artist] = [
            self.landmarks, self.truth, self.track, *self.ellipses, self.title, self.nees, self.words
        ]  # fmt: skip
        self.drives = {n: drive(np.random.default_rng(4), n) for n in (1, 2, 6)}

    def update(self, q_scale: float, r_scale: float, landmarks: int, gate: str) -> None:
        """Q and R as multiples of the honest ones; 1, 2 or 6 landmarks; the gate "off" or a probability."""
        run = self.drives[landmarks]
        track = localise(run, believing(sensor_noise(), r_scale), scaled(q_scale), gate=None if gate == "off" else 0.99)
        self.landmarks.set_data(*LANDMARKS[:landmarks].T)
        self.truth.set_data(*run.truth[:, :2].T)
        self.track.set_data(*track.means[:, :2].T)
        for line, k in zip(self.ellipses, range(20, STEPS, 20), strict=True):
            belief = track.beliefs[k]
            line.set_data(*(belief.mean[:2] + ellipse(belief.cov[:2, :2])).T)
        error = np.hypot(*(track.means[:, :2] - run.truth[1:, :2]).T)
        refused = "" if track.used.all() else f", {np.mean(~track.used):.0%} refused"
        self.title.set_text(f"error {np.sqrt(np.mean(error**2)):.2f} m{refused}")
        low, high = chi2_band(3)
        inside = np.mean((track.nees > low) & (track.nees < high))
        self.nees.set_data(self.t, np.clip(track.nees, 0.011, 900))
        self.words.set_text(f"{inside:.0%} of steps inside the 95 % band")


POINTS = np.array([[0.0, 0.0], [6.0, 0.0], [3.0, 5.0]])
WALK, NOTHING = ConstantVelocity(sigma_a=0.05), np.empty(0)  # nobody steers it


@lru_cache
def homework(landmarks: int, wrong: bool) -> tuple[Array, list[Gaussian]]:
    """The homework's filter, constant velocity and ranges only: truth (61, 4) and the belief after each step."""
    rng = np.random.default_rng(7)
    truth = [np.array([1.0, 0.25, 0.8, 0.15])]
    belief = Gaussian(np.array([1.3, 0.2, 0.5, 0.2]), np.diag([0.4, 0.1, 0.4, 0.1]) ** 2)
    beliefs = [belief]
    sensors = [(column_repeated if wrong else RangeOnly)(p, np.diag([0.05**2])) for p in POINTS[:landmarks]]
    for _ in range(60):
        truth.append(WALK.sample(truth[-1][None], NOTHING, 0.25, rng)[0])
        belief = ekf.predict(belief, WALK, NOTHING, 0.25)
        ranges = [
            np.hypot(*(truth[-1][[0, 2]] - p)) + 0.05 * e for p, e in zip(POINTS, rng.normal(size=3), strict=True)
        ]
        for sensor, z in zip(sensors, ranges, strict=False):
            belief = ekf.correct(belief, sensor, np.array([z])).belief
        beliefs.append(belief)
    return np.array(truth), beliefs


class RangesOnly:
    """The homework: where a point is that only hears how far it is from one, two or three landmarks."""

    def __init__(self) -> None:
        self.figure = plotting.figure(6.4, 4.6)
        ax = plotting.axes(self.figure)
        ax.plot(*POINTS.T, "^", color=plotting.WALL, ms=8)
        (self.heard,) = ax.plot([], [], "^", color=plotting.HIGHLIGHT, ms=11, label="landmarks that are heard")
        (self.truth,) = ax.plot([], [], color=plotting.TRUTH, label="truth")
        (self.track,) = ax.plot([], [], color=plotting.ESTIMATE, label="estimate")
        (self.ellipse,) = ax.plot([], [], color=plotting.ESTIMATE, lw=1.2)
        ax.set(xlim=(-1, 8.2), ylim=(-1.2, 5.6), xlabel="x [m]", ylabel="y [m]")
        ax.set_aspect("equal")
        ax.legend(loc="upper left")
        self.title = ax.set_title(" ")
        self.moving: list[Artist] = [self.heard, self.truth, self.track, self.ellipse, self.title]

    def update(self, time: float, landmarks: int, jacobian: str) -> None:
        """Time [s], the number of landmarks, and whose Jacobian: "derived" or "the report's"."""
        truth, beliefs = homework(landmarks, jacobian != "derived")
        k = round(time / 0.25)
        means = np.array([b.mean for b in beliefs[: k + 1]])
        place = beliefs[k].marginal([0, 2])
        self.heard.set_data(*POINTS[:landmarks].T)
        self.truth.set_data(truth[: k + 1, 0], truth[: k + 1, 2])
        self.track.set_data(means[:, 0], means[:, 2])
        self.ellipse.set_data(*(place.mean + ellipse(place.cov)).T)
        error, score = np.hypot(*(place.mean - truth[k, [0, 2]])), nees(place, truth[k, [0, 2]])
        verdict = "inside" if score < 5.99 else "outside"
        self.title.set_text(f"{error:.2f} m off; the truth is {verdict} the 95 % ellipse (NEES {score:.1f})")


class LockedOut:
    """The robot is pushed aside at 6 s.  Which filter finds it again?"""

    CORRECTIONS = ("no gate", "hard gate 0.99", "robust 0.99")

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 4.2)
        axes: Any = plotting.axes(self.figure, 2, 1, sharex=True, height_ratios=[1.5, 1])
        error, nis = axes
        self.t = DT * np.arange(1, STEPS + 1)
        error.axvline(6.0, color=plotting.HIGHLIGHT, lw=1.2, ls="--")
        error.annotate("pushed", (6.1, 1.25), color="#8a6000", fontsize=9.5)
        (self.error,) = error.plot([], [], color=plotting.MEASUREMENT, label="error of the position")
        (self.claim,) = error.plot([], [], color=plotting.ESTIMATE, label="what the filter claims: 95 %")
        error.set(ylim=(0, 1.5), ylabel="metres")
        error.legend(loc="upper right")
        self.title = error.set_title(" ")
        nis.axhline(ekf.gate_threshold(0.99, 2), color=plotting.BAND, lw=1.2)
        nis.annotate("gate", (0.1, 11), color=plotting.BAND, fontsize=9.5)
        (self.used,) = nis.plot([], [], ".", color=plotting.ESTIMATE, ms=4)
        (self.refused,) = nis.plot([], [], "x", color=plotting.MEASUREMENT, ms=4)
        nis.set(xlim=(0, self.t[-1]), ylim=(0.01, 1e4), yscale="log", xlabel="time [s]", ylabel="NIS (× refused)")
        self.moving: list[Artist] = [self.error, self.claim, self.title, self.used, self.refused]

    def update(self, push: float, q_scale: float, correction: str) -> None:
        """How far it is pushed [m], Q as a multiple of the honest one, and what is done about surprises."""
        track, run = self.follow(push, q_scale, correction)
        self.error.set_data(self.t, np.hypot(*(track.means[:, :2] - run.truth[1:, :2]).T))
        self.claim.set_data(self.t, [2.45 * np.sqrt(np.linalg.eigvalsh(b.cov[:2, :2])[-1]) for b in track.beliefs])
        self.used.set_data(track.measured_at[track.used], track.nis[track.used])
        self.refused.set_data(track.measured_at[~track.used], track.nis[~track.used])
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
            believing(sensor_noise()),
            scaled(q_scale),
            gate=0.99 if correction == "hard gate 0.99" else None,
            correct=ekf.correct_robustly if robust else ekf.correct,
        ), run


def pushed_drive(push: float, at: float = 6.0) -> Drive:
    """A drive on which somebody moves the robot ``push`` metres to its left after ``at`` seconds: no wheel feels it."""
    rng = np.random.default_rng(12)
    truth, seen = [START.sample(rng, 1)[0]], []
    for k in range(STEPS):
        pose = MOTION.sample(truth[-1], CONTROL, DT, rng)
        if k == round(at / DT):
            pose = np.append(transform(pose, [0.0, push]), pose[2])
        truth.append(pose)
        seen.append(glimpse(pose, rng))
    return Drive(np.array(truth), seen)


def strips(t: Array, averages: dict[str, Array], runs: int, dof: int = 3) -> Figure:
    """Average NEES over time for several filters, each over the same two-sided band."""
    fig = plotting.figure(7.6, 0.6 + 1.75 * len(averages))
    axes: Any = plotting.axes(fig, len(averages), 1, sharex=True, squeeze=False)
    for ax, (name, values) in zip(axes[:, 0], averages.items(), strict=True):
        plotting.consistency_strip(ax, t, values, dof, runs, name="NEES")
        ax.set_title(f"{name}: {ax.get_title(loc='left') or ax.get_title()}", loc="left")
        ax.set_ylim(1, 100)
        ax.label_outer()
    return fig
