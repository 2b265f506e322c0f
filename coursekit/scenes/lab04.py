"""Lab 4's drives and filters: localisation among six cylinders, and the strips that judge it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coursekit import datasets, ekf, experiments, noise, plotting
from coursekit.gaussian import Gaussian, nees
from coursekit.geometry import Array, transform, wrap_angle
from coursekit.models import DifferentialDrive, RangeBearing, pose_residual
from coursekit.world.arena import Arena

LAB = Arena.load("lab")
LANDMARKS = np.array([c.position for c in LAB.cylinders])
SENSORS = [RangeBearing(p) for p in LANDMARKS]
MOTION = DifferentialDrive(sigma_v=0.06, sigma_omega=0.08)
START = Gaussian(np.array([1.2, -1.2, 0.7]), np.diag([0.05, 0.05, 0.03]) ** 2)
CONTROL, DT, STEPS = np.array([0.5, 0.36]), 0.15, 130  # m/s, rad/s; s
SIGHT = 0.53  # rad to either side: where the course's camera ends
NEAR = 0.4  # m: any nearer, and a cylinder stands out of the picture at both ends
Sense = Callable[[Array], tuple[Array, Array]]
"""What a filter makes of raw measurements (..., 2): those that it believes, (..., 2), and their R, (..., 2, 2)."""


@lru_cache
def sensor_noise() -> noise.Calibrated:
    """Lab 3's model of the camera, fitted to the world's own log."""
    return noise.fit_calibrated(datasets.load("landmark_log"))


@lru_cache
def report_noise() -> noise.Piecewise:
    """The report's model, fitted to the same log."""
    return noise.fit_piecewise(datasets.load("landmark_log"))


def believing(model: Any, r_scale: float = 1.0, correction: Any = None) -> Sense:
    """A filter's eyes: the model's R, ``r_scale`` times, and its correction, or that of another model."""
    corrects = correction or model

    def sense(z: Array) -> tuple[Array, Array]:
        return np.array(corrects.correct(*z.T)).T, r_scale * model.R(*z.T)

    return sense


@dataclass(frozen=True)
class Drive:
    """One drive: the truth (n + 1, 3), and for each of the n steps what was seen, (which landmark, raw z) pairs."""

    truth: Array
    seen: list[list[tuple[int, Array]]]


def drive(rng: np.random.Generator, landmarks: int = 6, steps: int = STEPS, start: Gaussian = START) -> Drive:
    """A lap and more of the lab, with the noise of ``MOTION`` on the wheels and lab 3's on the camera."""
    return _drive(rng, landmarks, steps, start)


def _drive(
    rng: np.random.Generator, landmarks: int, steps: int, start: Gaussian, push: float = 0.0, pushed_at: float = 6.0
) -> Drive:
    truth, noises = [start.sample(rng, 1)[0]], []
    for k in range(steps):
        pose = MOTION.sample(truth[-1], CONTROL, DT, rng)
        if push and k == round(pushed_at / DT):
            pose = np.append(transform(pose, [0.0, push]), pose[2])
        truth.append(pose)
        noises.append(rng.standard_normal((len(LANDMARKS), 2)))
    poses = np.array(truth)
    return Drive(poses, glimpses(poses[1:], np.array(noises), landmarks))


def glimpses(poses: Array, noises: Array, landmarks: int) -> list[list[tuple[int, Array]]]:
    """What the camera says, at each pose, of the landmarks in its field of view: (which, raw z) pairs, uncorrected.

    ``noises`` (n, 6, 2) are standard normal.  Lab 3's model runs from what was measured to what is true; a raw
    measurement is found by going back.
    """
    model = sensor_noise()
    dx, dy = np.moveaxis(LANDMARKS[:landmarks] - poses[:, None, :2], -1, 0)
    z = np.stack([np.hypot(dx, dy), wrap_angle(np.arctan2(dy, dx) - poses[:, 2:])], axis=-1)
    steps, which = np.nonzero((np.abs(z[..., 1]) < SIGHT) & (z[..., 0] > NEAR))
    z, noises = z[steps, which], noises[steps, which]
    raw = z - [model.offset, 0.0]
    for _ in range(3):  # the correction is nearly a shift, so this converges at once
        sigma = np.sqrt(np.diagonal(model.R(*raw.T), axis1=1, axis2=2))
        raw = raw + z + sigma * noises - np.stack(model.correct(*raw.T), axis=-1)
    seen: list[list[tuple[int, Array]]] = [[] for _ in poses]
    for k, i, measured in zip(steps.tolist(), which.tolist(), raw, strict=True):
        seen[k].append((i, measured))
    return seen


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
    raws = np.array([raw for seen in run.seen for _, raw in seen]).reshape(-1, 2)
    believed, noises = sense(raws)
    noises.flags.writeable = False  # checked once, as sensor.R is
    made = zip(believed, noises, strict=True)
    belief, beliefs, measured = start, [], []
    for k, seen in enumerate(run.seen, 1):
        belief = ekf.predict(belief, motion, CONTROL, DT)
        for (i, _), (z, R) in zip(seen, made, strict=False):
            if k % every:
                continue
            correction = correct(belief, SENSORS[i], z, R)
            passes = gate is None or correction.nis < ekf.gate_threshold(gate, 2)
            belief = correction.belief if passes else belief
            measured.append((k * DT, correction.nis, passes))
        beliefs.append(belief)
    at, nis, used = np.array(measured).reshape(-1, 3).T
    errors = pose_residual(run.truth[1:], np.array([b.mean for b in beliefs]))
    weighed = np.linalg.solve(np.array([b.cov for b in beliefs]), errors[..., None])[..., 0]
    return Track(beliefs, np.sum(errors * weighed, axis=-1), at, nis, used.astype(bool))


def many(sense: Sense, motion: DifferentialDrive = MOTION, runs: int = 40, **options: Any) -> list[Track]:
    """What a filter made of each of ``runs`` seeded drives."""
    return experiments.monte_carlo(lambda rng: localise(drive(rng), sense, motion, **options), runs)


def average_nees(sense: Sense, motion: DifferentialDrive = MOTION, runs: int = 100, **options: Any) -> Array:
    """NEES at each step, averaged over seeded runs, (n,): the figure that has a chi-square band."""
    return np.mean([t.nees for t in many(sense, motion, runs, **options)], axis=0)


def average_nis(tracks: list[Track]) -> tuple[Array, NDArray[np.int_]]:
    """NIS at each step, averaged over all that the runs measured there (NaN for nothing), and how many that were."""
    steps = np.concatenate([np.rint(t.measured_at / DT).astype(int) - 1 for t in tracks])
    counts = np.bincount(steps, minlength=len(tracks[0].beliefs))
    sums = np.bincount(steps, np.concatenate([t.nis for t in tracks]), minlength=len(counts))
    return np.divide(sums, counts, out=np.full(len(counts), np.nan), where=counts > 0), counts


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


@lru_cache
def pushed_drive(push: float) -> Drive:
    """A drive on which somebody moves the robot ``push`` metres to its left after 6 s: no wheel feels it."""
    return _drive(np.random.default_rng(12), len(LANDMARKS), STEPS, START, push)


def strips(filters: dict[str, list[Track]]) -> Figure:
    """NEES and NIS over time for several filters, averaged over their runs, each over its two-sided band."""
    fig = plotting.figure(8.2, 0.6 + 1.75 * len(filters))
    axes: Any = plotting.axes(fig, len(filters), 2, sharex=True, sharey="col", squeeze=False)
    t = DT * np.arange(1, STEPS + 1)
    for (left, right), (name, tracks) in zip(axes, filters.items(), strict=True):
        nis, counts = average_nis(tracks)
        inside = plotting.consistency_strip(left, t, np.mean([r.nees for r in tracks], axis=0), 3, len(tracks), "NEES")
        left.set_title(f"{name}: {inside:.0%} inside")
        inside = plotting.consistency_strip(right, t, nis, 2, counts, "NIS")
        right.set_title(f"{inside:.0%} inside")
    for ax in axes[:-1].flat:
        ax.set_xlabel("")
    return fig
