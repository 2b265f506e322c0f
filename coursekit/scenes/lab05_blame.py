"""Lab 5's inquest: which part makes a filter too sure?  Swap true parts into its drives, one at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from coursekit import plotting
from coursekit.association import Association, Indices
from coursekit.gaussian import Gaussian, chi2_band, mahalanobis_squared
from coursekit.geometry import Array
from coursekit.models import CreepingWheels, RangeBearing, pose_residual
from coursekit.scenes.lab05 import ARENA, DT, MOTION, Drive, Look, glimpse
from coursekit.slam import EkfSlam

TAG_AT = {tag.id: np.array(tag.position) for tag in ARENA.tags}
_SENSORS = {i: RangeBearing(position) for i, position in TAG_AT.items()}


def motion(scale: float = 1.0) -> CreepingWheels:
    """The lab's wheels, with ``scale`` times their noise."""
    slip = tuple(scale * s for s in MOTION.sigma_slip)
    return CreepingWheels(sigma_slip=slip, creep=scale * MOTION.creep, tick=scale * MOTION.tick)  # type: ignore[arg-type]


def fresh(kind: type[EkfSlam], rule: Association, run: Drive, scale: float = 1.0) -> EkfSlam:
    """A filter that has not seen anything of the drive yet, and knows that all noise is scaled."""
    return kind(Gaussian(run.start.mean, scale**2 * run.start.cov), motion(scale), rule)


def redrawn(run: Drive, rng: np.random.Generator, scale: float = 1.0) -> Drive:
    """The same odometry, but a truth that was drawn from Q and looks that were drawn from R, both scaled.

    Nothing is left here that the filter's model does not say: what goes wrong, the filter does by itself.
    """
    wheels, truth, looks = motion(scale), [run.truth[0]], []
    for u, look in zip(run.odometry, run.looks, strict=True):
        pose = wheels.sample(truth[-1][None], u, DT, rng)[0]
        truth.append(pose)
        looks.append(_scaled(glimpse(pose, rng), pose, scale) if look else None)
    return Drive(np.array(truth), run.odometry, looks, run.lap_ends)


def verdict(run: Drive, slam: EkfSlam, told: bool = True) -> tuple[float, float]:
    """(NEES of the pose, averaged over the looks; NEES of the map at the end, for each of its numbers).

    told : does the filter hear the ids?  If not, a landmark is scored by the tag that it was mostly taken for.
    """
    scores: list[float] = []
    names: dict[int, list[int]] = {}
    for u, look, pose in zip(run.odometry, run.looks, run.truth[1:], strict=True):
        slam.predict(u, DT)
        if look is None:
            continue
        chosen = slam.observe(look.z, look.R, ids=look.ids.tolist() if told else None)
        for i, j in zip(look.ids.tolist(), chosen.tolist(), strict=True):
            names.setdefault(j, []).append(i)
        belief = slam.pose
        scores.append(mahalanobis_squared(pose_residual(belief.mean, pose), belief.cov))
    tags = [max(set(names[j]), key=names[j].count) for j in range(len(slam.landmarks))]
    error = slam.landmarks - [TAG_AT[i] for i in tags]
    return float(np.mean(scores)), mahalanobis_squared(error.ravel(), slam.cov[3:, 3:]) / error.size


def heading(run: Drive, slam: EkfSlam) -> tuple[Array, Array, Array]:
    """After each look, with ids: time, error of the heading, its σ, in s and rad."""
    rows = []
    for k, (u, look) in enumerate(zip(run.odometry, run.looks, strict=True), 1):
        slam.predict(u, DT)
        if look:
            slam.observe(look.z, look.R, ids=look.ids.tolist())
            belief = slam.pose
            error = pose_residual(belief.mean, run.truth[k])[2]
            rows.append((DT * k, error, np.sqrt(belief.cov[2, 2])))
    time, error, sigma = np.array(rows).T
    return time, error, sigma


def all_at_once(run: Drive, slam: EkfSlam, steps: int = 8) -> tuple[float, float]:
    """``verdict`` on the most likely drive and map, given *all* odometry and all looks: least squares, ids known.

    The same numbers and the same f, h, Q and R as the filter's, but every linearisation is done again at the newest
    estimate of everything, which a filter cannot: the past is no longer in its state.  ``slam`` tells where to start.
    """
    n = len(run.odometry)
    poses, points = [run.start.mean], dict[int, Array]()
    for u, look in zip(run.odometry, run.looks, strict=True):
        slam.predict(u, DT)
        for i, z in zip(look.ids.tolist(), look.z, strict=True) if look else ():
            points.setdefault(i, RangeBearing.g(slam.pose.mean, z))
        if look:
            slam.observe(look.z, look.R, ids=look.ids.tolist())
        poses.append(slam.pose.mean)
    x, names = np.concatenate([np.ravel(poses), *points.values()]), list(points)
    for _ in range(steps):
        J, residual = _linearised(run, x, names)
        factor = splu((J.T @ J).tocsc())
        step = factor.solve(J.T @ residual)
        x = x + step
        if np.abs(step).max() < 1e-4:
            break

    def cov(rows: Indices) -> Array:
        columns = np.zeros((len(x), len(rows)))
        columns[rows, np.arange(len(rows))] = 1.0
        return np.asarray(factor.solve(columns))[rows]

    scores = []
    for k in range(10, n + 1, 10):
        error = pose_residual(x[3 * k : 3 * k + 3], run.truth[k])
        scores.append(mahalanobis_squared(error, cov(3 * k + np.arange(3))))
    landmarks = np.arange(3 * n + 3, len(x))
    error = x[landmarks] - np.concatenate([TAG_AT[i] for i in names])
    return float(np.mean(scores)), mahalanobis_squared(error, cov(landmarks)) / len(landmarks)


def _linearised(run: Drive, x: Array, names: list[int]) -> tuple[Any, Array]:
    """All residuals in their own standard deviations, and their Jacobian: the start, each step, each measurement."""
    poses = x[: 3 * len(run.truth)].reshape(-1, 3)
    residuals: list[Array] = []
    places, blocks = [], []  # (rows, columns) and entries of the Jacobian

    def add(cov: Array, residual: Array, *parts: tuple[int, Array]) -> None:
        L, row = np.linalg.cholesky(cov), sum(r.size for r in residuals)
        whitened = np.linalg.solve(L, np.column_stack([residual, *(part for _, part in parts)]))
        residuals.append(whitened[:, 0])
        columns = np.concatenate([at + np.arange(part.shape[1]) for at, part in parts])
        places.append(np.stack(np.meshgrid(row + np.arange(len(cov)), columns, indexing="ij")).reshape(2, -1))
        blocks.append(whitened[:, 1:].ravel())

    add(run.start.cov, pose_residual(run.start.mean, poses[0]), (0, np.eye(3)))
    for k, (u, look) in enumerate(zip(run.odometry, run.looks, strict=True)):
        here, there = poses[k], poses[k + 1]
        miss = pose_residual(MOTION.f(here, u, DT), there)
        add(MOTION.Q(here, u, DT), miss, (3 * k, -MOTION.F(here, u, DT)), (3 * k + 3, np.eye(3)))
        for i, z, R in zip(look.ids.tolist(), look.z, look.R, strict=True) if look else ():
            at = poses.size + 2 * names.index(i)
            sensor = RangeBearing(x[at : at + 2], R)
            miss = sensor.residual(z, sensor.h(there))
            add(R, miss, (3 * k + 3, sensor.H(there)), (at, sensor.H_landmark(there)))
    residual = np.concatenate(residuals)
    entries = (np.concatenate(blocks), np.concatenate(places, axis=1))
    return csc_array(entries, shape=(len(residual), len(x))), residual


def _scaled(look: Look, pose: Array, scale: float) -> Look:
    expected = np.array([_SENSORS[i].h(pose) for i in look.ids.tolist()]).reshape(-1, 2)
    return Look(look.ids, expected + scale * (look.z - expected), scale**2 * look.R)


def verdict_figure(found: Mapping[str, Sequence[tuple[float, float]]]) -> Figure:
    """A row for each part that was swapped, a dot for each drive: NEES of the pose, and of the map."""
    fig = plotting.figure(7.8, 3.4)
    axes: Any = plotting.axes(fig, 1, 2, sharey=True)
    for column, (ax, right, name) in enumerate(
        zip(axes, (3, 1), ("pose: average NEES", "map: NEES per number"), strict=True)
    ):
        for y, values in enumerate(found.values()):
            dots = [pair[column] for pair in values]
            ax.plot(dots, y + np.linspace(-0.18, 0.18, len(dots)), "o", color=plotting.ESTIMATE, ms=4, alpha=0.7)
            ax.plot([np.median(dots)] * 2, [y - 0.3, y + 0.3], color=plotting.TRUTH, lw=1.6)
        ax.axvline(right, color=plotting.BAND, lw=1.2, zorder=1)
        ax.set(xscale="log", xlabel=f"{name} ({right} is right)", yticks=range(len(found)), ylim=(-0.6, None))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.minorticks_off()
    low, high = (edge / 16 for edge in chi2_band(16))
    axes[1].axvspan(low, high, color=plotting.BAND, alpha=0.18, lw=0, label="95 % of drives")
    axes[1].legend(loc="lower right", fontsize=8.5)
    axes[0].set_yticklabels(found)
    axes[0].invert_yaxis()
    return fig


def heading_figure(courses: Mapping[str, tuple[Array, Array, Array]], strange: tuple[float, float]) -> Figure:
    """Error of the heading and ± 2σ over time, a panel for each filter; ``strange``: only new tags were in view."""
    fig = plotting.figure(7.8, 3.1)
    axes: Any = plotting.axes(fig, 1, len(courses), sharey=True)
    for ax, (name, (time, error, sigma)) in zip(axes, courses.items(), strict=True):
        ax.axvspan(*strange, color=plotting.TRUTH, alpha=0.07, lw=0, label="sees only new tags")
        ax.fill_between(time, -2000 * sigma, 2000 * sigma, color=plotting.ESTIMATE, alpha=0.25, lw=0, label="± 2σ")
        ax.plot(time, 1000 * error, color=plotting.MEASUREMENT, lw=1.4, label="estimate − truth")
        ax.set(title=name, xlabel="time [s]", xlim=(0, time[-1]))
    axes[0].set_ylabel("heading [mrad]")
    axes[-1].legend(loc="upper right", fontsize=8.5)
    return fig
