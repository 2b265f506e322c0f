"""Lab 4's project: a complete EKF that localises a robot in the world, from its odometry and what its camera sees.

The design is a class::

    class MyFilter:
        def __init__(self, mean, cov): ...                   # the start: [x, y, θ] (3,) and its covariance (3, 3)
        def predict(self, control, control_cov, dt): ...     # odometry [v, ω], the covariance of its error (2, 2), s
        def correct(self, landmark, z, R): ...               # [x, y] of the landmark, [range, bearing], R (2, 2)
        mean, cov                                            # the belief after each call
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive, RangeBearing, pose_residual
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean, honest, small
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project
from coursekit.world.arena import Arena
from coursekit.world.pilot import drive
from coursekit.world.robot import World

ROOM = replace(Arena.load("lab"), crates=())  # what a robot can push is a story of its own
LANDMARKS = np.array([c.position for c in ROOM.cylinders])
ROUTE = np.array([(2.2, -0.7), (2.4, 0.8), (0.6, 1.4), (-2.1, 1.3), (-2.0, -0.4), (-1.9, -2.0), (0.5, -1.6)])
DT, STEPS, LOOK_EVERY = 0.05, 600, 10  # s; control periods; the camera looks at every tenth
START_COV = np.diag([0.2, 0.2, 0.15]) ** 2
FIELD_OF_VIEW = 0.53  # rad to either side
SLIP = np.diag([1e-4, 1e-4, 1e-4]) ** 2  # m, m, rad a step: what no wheel explains


@dataclass(frozen=True)
class Scenario:
    """truth (n + 1, 3); controls (n, 2) and their covariances (n, 2, 2); seen[k]: (landmark, z, R) after step k."""

    start: Gaussian
    truth: Array
    controls: Array
    control_covs: Array
    seen: list[list[tuple[Array, Array, Array]]]


def make(rng: np.random.Generator) -> Scenario:
    """A drive of 30 s through the lab, from a start and by waypoints of its own."""
    world = World(ROOM, seed=rng, dt=DT)
    route = np.tile(ROUTE + rng.uniform(-0.15, 0.15, ROUTE.shape), (4, 1))
    truth, controls, seen = [world.pose], [], []
    for k, _ in zip(range(STEPS), drive(world, route, timeout=120.0), strict=False):
        truth.append(world.pose)
        controls.append(world.odometry)
        seen.append(_look(world.pose, rng) if k % LOOK_EVERY == 0 else [])
    covs = np.array([world.robot.odometry_cov(v, omega, DT) for v, omega in controls])
    mean = truth[0] + np.linalg.cholesky(START_COV) @ rng.standard_normal(3)
    mean[2] = wrap_angle(mean[2])
    return Scenario(Gaussian(mean, START_COV), np.array(truth), np.array(controls), covs, seen)


def _look(pose: Array, rng: np.random.Generator) -> list[tuple[Array, Array, Array]]:
    """What the camera says of the landmarks in its field of view: σ grows with the distance, as lab 3 found."""
    found = []
    for landmark in LANDMARKS:
        dx, dy = landmark - pose[:2]
        r, bearing = np.hypot(dx, dy), wrap_angle(np.arctan2(dy, dx) - pose[2])
        if abs(bearing) < FIELD_OF_VIEW and r > 0.4:
            R = np.diag([0.02 + 0.01 * r, 0.015]) ** 2
            z = np.array([r, bearing]) + np.sqrt(np.diagonal(R)) * rng.standard_normal(2)
            found.append((landmark, np.array([max(z[0], 0.05), wrap_angle(z[1])]), R))
    return found


def run(design: Any, scenario: Scenario, watch: Any) -> dict[str, Array]:
    """Drive a filter through a scenario: mean and covariance after every step, and what they are worth."""
    means, covs = [], []
    mine = watch.call("MyFilter(mean, cov)", design, scenario.start.mean.copy(), scenario.start.cov.copy())
    for control, control_cov, seen in zip(scenario.controls, scenario.control_covs, scenario.seen, strict=True):
        watch.call("predict()", mine.predict, control, control_cov, DT)
        for landmark, z, R in seen:
            watch.call("correct()", mine.correct, landmark, z, R)
        means.append(watch.numbers("mean", watch.attribute(mine, "mean"), (3,)))
        covs.append(watch.covariance("cov", watch.attribute(mine, "cov"), 3))
        watch.advance()
    truth = scenario.truth[1:]
    errors = pose_residual(truth, np.array(means))
    scores = np.sum(errors * np.linalg.solve(np.array(covs), errors[..., None])[..., 0], axis=-1)
    rms = np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=1)))
    leaps = _leaps(np.array(means), scenario.seen)
    return {
        "truth": truth,
        "means": np.array(means),
        "covs": np.array(covs),
        "nees": scores,
        "rms": rms,
        "leaps": leaps,
    }


def _leaps(means: Array, seen: list[list[tuple[Array, Array, Array]]]) -> Array:
    """The steps, counted from 1, in which the belief leapt although a bare minus of two bearings was beyond ±π.

    A step drives 3 cm and turns by 0.1 rad at most, and a sound filter's correction is small: half a metre or half a
    radian is a leap.
    """
    found = []
    for k in range(1, len(means)):
        x, moved = means[k - 1], pose_residual(means[k], means[k - 1])
        if np.hypot(*moved[:2]) > 0.5 or abs(moved[2]) > 0.5:
            bare = [z[1] - (np.arctan2(*(landmark - x[:2])[::-1]) - x[2]) for landmark, z, _ in seen[k]]
            found += [k + 1] * any(abs(b) > np.pi for b in bare)
    return np.array(found, dtype=float)


def _honest_and_wrapped(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """``honest``, and what a belief that leaps at ±π is told besides; the points are the same."""
    share, said = honest("nees", 3)(mine, theirs)
    leaps = [o.values["leaps"][0] for o in mine if o.values["leaps"].size]
    if share < 1 and leaps:
        said += (
            f". In {len(leaps)} of {len(mine)} runs, first at step {min(leaps):.0f}, your estimate leapt when a "
            "measured and an expected bearing lay on either side of ±π: is their difference wrapped?"
        )
    return share, said


class Reference:
    """The package's own: ``ekf`` with lab 0's arc and lab 4's sensor."""

    def __init__(self, mean: Array, cov: Array) -> None:
        self._belief = Gaussian(mean, cov)

    @property
    def mean(self) -> Array:
        """[x, y, θ]."""
        return self._belief.mean

    @property
    def cov(self) -> Array:
        """(3, 3)."""
        return self._belief.cov

    def predict(self, control: Array, control_cov: Array, dt: float) -> None:
        """One step along the arc."""
        arc, x, P = DifferentialDrive(), self.mean, self.cov
        F, G = arc.F(x, control, dt), arc.G(x, control, dt)
        self._belief = Gaussian(arc.f(x, control, dt), F @ P @ F.T + G @ control_cov @ G.T + SLIP)

    def correct(self, landmark: Array, z: Array, R: Array) -> None:
        """One landmark."""
        self._belief = ekf.correct(self._belief, RangeBearing(landmark, R), z).belief


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """Track and NEES of one run, beside the package's."""
    fig = plotting.figure(8.6, 3.6)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1, 1.2])
    left.plot(*LANDMARKS.T, "o", color=plotting.WALL, ms=7, label="landmarks")
    left.plot(*mine["truth"][:, :2].T, color=plotting.TRUTH, lw=1.2, label="truth")
    left.plot(*mine["means"][:, :2].T, color=plotting.ESTIMATE, lw=1.2, label="your filter")
    for k in range(40, len(mine["means"]), 120):
        plotting.draw_ellipse(left, mine["means"][k, :2], mine["covs"][k, :2, :2], lw=1)
    left.set_aspect("equal")
    left.set(xlabel="x [m]", ylabel="y [m]", title=f"Position error {mine['rms']:.2f} m (RMS)")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    t = DT * np.arange(1, len(mine["nees"]) + 1)
    right.semilogy(t, np.maximum(mine["nees"], 1e-2), color=plotting.ESTIMATE, label="your filter")
    right.semilogy(t, np.maximum(theirs["nees"], 1e-2), color=plotting.ODOMETRY, lw=0.8, label="the package")
    right.axhline(3, color=plotting.TRUTH, lw=0.8, ls=":")
    right.set(xlabel="time [s]", ylabel="NEES of one run", title="An honest filter's NEES averages 3")
    right.legend()
    return fig


PROJECT = Project(
    name="lab04",
    title="A complete EKF",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("position error, RMS", 40, small("rms", full=0.07, none=0.3, unit="m")),
        Criterion("honesty: NEES in its band", 50, _honest_and_wrapped),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
)
