"""Lab 0's project: dead reckoning that knows how wrong it may be, from odometry alone.

The design is a class::

    class MyReckoning:
        def __init__(self, mean, cov): ...                   # the start: [x, y, θ] (3,) and its covariance (3, 3)
        def predict(self, control, control_cov, dt): ...     # odometry [v, ω], the covariance of its error (2, 2), s
        mean, cov                                            # the belief after each call

A scenario is a drive of several legs in the world.  Each leg begins with a pose that somebody has measured, so the
errors of two legs are independent, and their NEES may be averaged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.gaussian import Gaussian, chi2_band
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive, pose_residual
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project
from coursekit.world.arena import Arena
from coursekit.world.robot import Robot, World

DT, LEGS, STEPS = 0.2, 6, 40  # s a control period; legs a drive; periods a leg
START_COV = np.diag([0.01, 0.01, 0.01]) ** 2  # m, m, rad
ARC = DifferentialDrive()


@dataclass(frozen=True)
class Leg:
    """truth (n + 1, 3); controls (n, 2) and their covariances (n, 2, 2); the start as somebody measured it."""

    start: Gaussian
    truth: Array
    controls: Array
    control_covs: Array


def make(rng: np.random.Generator) -> list[Leg]:
    """A drive on an empty plane: the robot keeps moving from leg to leg, and every leg has a command of its own."""
    robot = Robot(slip=rng.uniform(0.008, 0.012))
    world, legs = World(Arena("an empty plane"), rng, robot, dt=DT, substeps=20), []
    turns = np.concatenate([[0.0, 1.5, -1.5], rng.uniform(0.3, 1.2, 3) * rng.choice([-1, 1], 3)])
    for omega in rng.permutation(turns):
        truth, controls = [world.pose], []
        command = rng.uniform(0.3, 0.5), omega
        for _ in range(STEPS):
            world.step(*command)
            truth.append(world.pose)
            controls.append(world.odometry)
        covs = np.array([robot.odometry_cov(v, w, DT) for v, w in controls])
        mean = truth[0] + np.sqrt(np.diag(START_COV)) * rng.standard_normal(3)
        legs.append(Leg(Gaussian(mean, START_COV), np.array(truth), np.array(controls), covs))
    return legs


def run(design: Any, scenario: list[Leg], watch: Any) -> dict[str, Array]:
    """Reckon through every leg: the means, the covariances, and what each leg's last belief is worth."""
    means, covs = np.empty((len(scenario), STEPS, 3)), np.empty((len(scenario), STEPS, 3, 3))
    for i, leg in enumerate(scenario):
        mine = watch.call("MyReckoning(mean, cov)", design, leg.start.mean.copy(), leg.start.cov.copy())
        for k, (control, control_cov) in enumerate(zip(leg.controls, leg.control_covs, strict=True)):
            watch.call("predict()", mine.predict, control, control_cov, DT)
            means[i, k] = watch.numbers("mean", watch.attribute(mine, "mean"), (3,))
            covs[i, k] = watch.covariance("cov", watch.attribute(mine, "cov"), 3)
            watch.advance()
    truth = np.array([leg.truth[1:] for leg in scenario])
    ends = pose_residual(truth[:, -1], means[:, -1])
    scores = np.sum(ends * np.linalg.solve(covs[:, -1], ends[..., None])[..., 0], axis=-1)
    way_off = np.hypot(*np.moveaxis(truth - means, -1, 0)[:2])
    return {"truth": truth, "means": means, "covs": covs, "nees": scores, "off": way_off}


def as_exact(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """RMS position error at the ends of the legs, as a multiple of the package's: full up to 1.05, none from 1.5."""
    got, package = (np.sqrt(np.mean([o.values["off"][:, -1] ** 2 for o in runs])) for runs in (mine, theirs))
    share = float(np.clip((1.5 - got / package) / 0.45, 0.0, 1.0))
    return share, f"{got:.3f} m at a leg's end, {got / package:.2f} times the package's (full points up to 1.05 times)"


def knows_its_error(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The NEES at the ends of all legs, averaged: full in its 99.9 % band, none where it is off by another factor 2."""
    scores = np.array([o.values["nees"] for o in mine])
    low, high = chi2_band(3, runs=scores.size, confidence=0.999)
    average = float(scores.mean())
    beyond = max(np.log2(low / average), np.log2(average / high), 0.0)
    said = f"the NEES averages {average:.3g} over {scores.size} legs; between {low:.2f} and {high:.2f} is honest"
    if beyond > 0:
        said += ": too sure of itself" if average > high else ": too modest"
    return float(np.clip(1.0 - beyond, 0.0, 1.0)), said


class Reference:
    """The package's arc and its Jacobians, with the covariance that the wheels give."""

    def __init__(self, mean: Array, cov: Array) -> None:
        self.mean, self.cov = mean, cov

    def predict(self, control: Array, control_cov: Array, dt: float) -> None:
        """One step along the arc."""
        F, G = ARC.F(self.mean, control, dt), ARC.G(self.mean, control, dt)
        self.mean, self.cov = ARC.f(self.mean, control, dt), F @ self.cov @ F.T + G @ control_cov @ G.T


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """The legs of one drive with the ellipses at their ends, and the errors beside the package's."""
    fig = plotting.figure(8.6, 3.6)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.1, 1])
    for i, (truth, means, covs) in enumerate(zip(mine["truth"], mine["means"], mine["covs"], strict=True)):
        labels = ("truth", "your reckoning", "95 % ellipse") if i == 0 else ("", "", "")
        left.plot(*truth[:, :2].T, color=plotting.TRUTH, lw=2.6, label=labels[0])
        left.plot(*means[:, :2].T, color=plotting.ESTIMATE, lw=1.2, label=labels[1])
        plotting.draw_ellipse(left, means[-1, :2], covs[-1, :2, :2], plotting.BAND, lw=1.2, label=labels[2])
    left.set_aspect("equal", adjustable="datalim")
    left.set(xlabel="x [m]", ylabel="y [m]")
    left.set_title(f"{len(mine['truth'])} legs of one drive", loc="left")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    t = DT * np.arange(1, STEPS + 1)
    # The package's is broad and lies below: who reckons as well as it does still sees both.
    for values, colour, name, lw in (
        (theirs, plotting.ODOMETRY, "the package", 4.0),
        (mine, plotting.ESTIMATE, "you", 1.5),
    ):
        right.plot(t, np.sqrt(np.mean(values["off"] ** 2, axis=0)), color=colour, lw=lw, label=name)
    right.set(xlabel="time since the leg's start [s]", ylabel="position error, RMS [m]", ylim=(0, None))
    right.set_title(f"NEES at the legs' ends: {mine['nees'].mean():.1f} (3 is right)", loc="left")
    right.legend()
    return fig


PROJECT = Project(
    name="lab00",
    title="Dead reckoning that knows its error",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("position error, beside the package's", 40, as_exact),
        Criterion("honesty: NEES in its band", 50, knows_its_error),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
)
