"""Lab 6's project: a complete ICP for two lidar scans, with its covariance.

The design is a function::

    def complete_icp(source, target):
        '''source (n, 2), target (m, 2), metres, each in the robot's frame at its moment.

        Returns pose, the source's frame in the target's [x, y, θ] (3,), and cov, the covariance of its error (3, 3).
        '''
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from coursekit import geometry, icp
from coursekit.gaussian import mahalanobis_squared
from coursekit.geometry import Array
from coursekit.models import pose_residual
from coursekit.teaching import plotting
from coursekit.teaching.criteria import Judge, clean, small
from coursekit.teaching.judging import Trouble
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar

ROOM, LIDAR = Arena.load("lab"), Lidar()
PAIRS = 5  # alignments in a run
LIMIT = float(chi2.ppf(0.95, 3))
STRAYS = 0.05  # share of a scan's beams that return a distance of their own


@dataclass(frozen=True)
class Scenario:
    """Pairs of scans (source, target), and the source's pose in the target's frame, (PAIRS, 3)."""

    scans: list[tuple[Array, Array]]
    motions: Array


def make(rng: np.random.Generator) -> Scenario:
    """Five places in the lab, a drive of some decimetres at each, two scans with a few stray points."""
    scans, motions = [], rng.normal(0, [0.12, 0.12, 0.08], (PAIRS, 3))
    for motion in motions:
        here = rng.uniform([-2.5, -1, -np.pi], [2.5, 1, np.pi])
        scans.append((_scan(geometry.compose(here, motion), rng), _scan(here, rng)))
    return Scenario(scans, motions)


def _scan(pose: Array, rng: np.random.Generator) -> Array:
    points = LIDAR.scan(ROOM, rng, pose).points()
    stray = rng.random(len(points)) < STRAYS
    points[stray] *= rng.uniform(0.3, 0.9, (int(stray.sum()), 1))  # dust, rain, somebody's legs
    return points


def run(design: Any, scenario: Scenario, watch: Any) -> dict[str, Array]:
    """Align every pair, and measure errors and claims."""
    poses, covs = [], []
    for source, target in scenario.scans:
        answer = watch.call("complete_icp()", design, source, target)
        try:
            pose, cov = answer
        except (TypeError, ValueError):
            raise Trouble("complete_icp() returns two things, pose (3,) and cov (3, 3)") from None
        poses.append(watch.numbers("pose", pose, (3,)))
        covs.append(watch.covariance("cov", cov, 3))
        watch.advance()
    errors = pose_residual(scenario.motions, np.array(poses))
    nees = np.array([mahalanobis_squared(e, P) for e, P in zip(errors, covs, strict=True)])
    source, target = scenario.scans[0]
    return {
        "off": np.hypot(*errors[:, :2].T), "turned": np.abs(errors[:, 2]), "nees": nees,
        "source": source, "target": target, "pose": poses[0],
    }  # fmt: skip


def coverage(*, full: float = 0.85, none: float = 0.4) -> Judge:
    """Share of the alignments inside their 95 % ellipsoid; a median NEES far below an honest 2.4 is too modest."""

    def judge(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
        scores = np.concatenate([o.values["nees"] for o in mine])
        inside, median = float(np.mean(scores < LIMIT)), float(np.median(scores))
        sure = np.clip((inside - none) / (full - none), 0, 1)
        modest = np.clip(median / 0.8, 0, 1)
        said = f"{100 * inside:.0f} % of the errors inside their 95 % ellipsoid"
        said += f", median NEES {median:.2g} (2.4 is right)"
        said += "; too sure of itself" if sure < 1 else "; too modest" if modest < 1 else ""
        return float(min(sure, modest)), said

    return judge


def reference(source: Array, target: Array) -> tuple[Array, Array]:
    """The package's own: planes with a kernel."""
    result = icp.align(source, target, metric="point_to_plane", kernel="cauchy", max_distance=0.5, max_iterations=100)
    return result.pose, result.covariance if result.covariance is not None else np.eye(3)


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """The first pair as aligned, beside the package's errors."""
    fig = plotting.figure(8.6, 3.6)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.2, 1])
    left.plot(*mine["target"].T, ".", color=plotting.ODOMETRY, ms=4, label="target")
    moved = geometry.transform(mine["pose"], mine["source"])
    left.plot(*moved.T, ".", color=plotting.ESTIMATE, ms=3, label="source, moved")
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    left.set_title(f"Pair 1: {1000 * mine['off'][0]:.1f} mm off", loc="left")
    fig.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    place = np.arange(1, len(mine["off"]) + 1)
    right.bar(place - 0.15, 1000 * mine["off"], 0.3, color=plotting.ESTIMATE, label="yours")
    right.bar(place + 0.15, 1000 * theirs["off"], 0.3, color=plotting.ODOMETRY, label="the package")
    right.set(xlabel="pair", ylabel="error of the position [mm]")
    right.set_title(f"Median error {1000 * np.median(mine['off']):.1f} mm", loc="left")
    right.set_ylim(top=1.35 * right.get_ylim()[1])  # room for the legend above the bars
    right.legend()
    return fig


PROJECT = Project(
    name="lab06",
    title="A complete ICP",
    make=make,
    run=run,
    reference=reference,
    criteria=(
        Criterion("position error, median", 35, small("off", full=0.004, none=0.025, unit="m", average=np.median)),
        Criterion("heading error, median", 15, small("turned", full=0.0015, none=0.01, unit="rad", average=np.median)),
        Criterion("honesty: errors in their ellipsoid", 40, coverage()),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
    runs=12,
)
