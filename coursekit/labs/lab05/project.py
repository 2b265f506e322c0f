"""Lab 5's project: a complete EKF-SLAM, from odometry, ranges and bearings, without ids and with false detections.

The design is a class::

    class MySlam:
        def __init__(self, mean, cov): ...                 # the start: [x, y, θ] (3,) and its covariance (3, 3)
        def predict(self, control, control_cov, dt): ...   # odometry [v, ω], the covariance of its error (2, 2), s
        def observe(self, z, R): ...                       # one look: ranges and bearings (m, 2), R (2, 2); m may be 0
        mean, cov                                          # [x, y, θ, l₁, l₂, …] and its covariance, after each call
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.gaussian import Gaussian
from coursekit.geometry import Array
from coursekit.labs.lab05.runs import TAGS
from coursekit.models import DifferentialDrive, pose_residual, range_bearing
from coursekit.slam import EkfSlam
from coursekit.slam.association import Mahalanobis
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean, honest, small
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project

DT, STEPS, LOOK_EVERY = 0.2, 240, 2  # s; control periods; a look at every second one
CONTROL_COV = np.diag([0.03, 0.06]) ** 2  # of the odometry's [v, ω], m/s and rad/s
R = np.diag([0.03, 0.01]) ** 2  # m, rad
FIELD_OF_VIEW, REACH, CLUTTER = 0.9, 3.5, 0.05  # rad to either side; m; false detections a look
START = Gaussian(np.zeros(3), 1e-8 * np.eye(3))
FOUND = 0.15  # m: a tag with a landmark nearer than this is found
ARC = DifferentialDrive()


@dataclass(frozen=True)
class Scenario:
    """truth (n + 1, 3); controls (n, 2), what the wheels said; looks[k]: z (m, 2) after step k, or None."""

    truth: Array
    controls: Array
    looks: list[Array | None]


def make(rng: np.random.Generator) -> Scenario:
    """A drive of 48 s on a rounded path of its own among the eight tags."""
    truth, controls, looks = [START.mean], [], []
    radius, phase = rng.uniform(0.45, 0.65), rng.uniform(0, 2 * np.pi)
    for k in range(STEPS):
        u = np.array([0.25, 0.25 / radius * (1 + 0.3 * np.sin(0.1 * k + phase))])
        controls.append(u)
        truth.append(ARC.f(truth[-1], u + np.linalg.cholesky(CONTROL_COV) @ rng.standard_normal(2), DT))
        looks.append(_look(truth[-1], rng) if k % LOOK_EVERY == 0 else None)
    return Scenario(np.array(truth), np.array(controls), looks)


def _look(pose: Array, rng: np.random.Generator) -> Array:
    z = range_bearing.h(pose, TAGS)
    z = z[(np.abs(z[:, 1]) < FIELD_OF_VIEW) & (z[:, 0] < REACH) & (z[:, 0] > 0.3)]
    z = z + rng.standard_normal(z.shape) * np.sqrt(np.diagonal(R))
    false = rng.uniform([0.5, -FIELD_OF_VIEW], [REACH, FIELD_OF_VIEW], (rng.poisson(CLUTTER), 2))
    return rng.permutation(np.concatenate([z, false]))


def run(design: Any, scenario: Scenario, watch: Any) -> dict[str, Array]:
    """Drive a design through a scenario: poses after every step, the map at the end, and what they are worth."""
    means, covs = [], []
    mine = watch.call("MySlam(mean, cov)", design, START.mean.copy(), START.cov.copy())
    for u, z in zip(scenario.controls, scenario.looks, strict=True):
        watch.call("predict()", mine.predict, u, CONTROL_COV.copy(), DT)
        if z is not None:
            watch.call("observe()", mine.observe, z.copy(), R.copy())
        mean = np.asarray(watch.attribute(mine, "mean"), dtype=float)
        size = 3 + 2 * max((mean.size - 3) // 2, 0)
        means.append(watch.numbers("mean", mean, (size,)))
        covs.append(watch.covariance("cov", watch.attribute(mine, "cov"), size)[:3, :3])
        watch.advance()
    poses, truth = np.array([mean[:3] for mean in means]), scenario.truth[1:]
    errors = pose_residual(truth, poses)
    landmarks = means[-1][3:].reshape(-1, 2)
    apart = np.linalg.norm(landmarks[:, None] - TAGS, axis=-1) if len(landmarks) else np.full((1, len(TAGS)), np.inf)
    found = apart.min(axis=0) < FOUND
    return {
        "truth": truth,
        "poses": poses,
        "landmarks": landmarks,
        "nees": np.sum(errors * np.linalg.solve(np.array(covs), errors[..., None])[..., 0], axis=-1),
        "rms": np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=1))),
        "found": np.sum(found),
        "extra": len(landmarks) - np.sum(found),
    }


def complete(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of tags found, less a tenth for each landmark that is none, averaged over the runs."""
    found = np.array([o.values["found"] for o in mine], dtype=float)
    extra = np.array([o.values["extra"] for o in mine], dtype=float)
    share = np.clip(found / len(TAGS) - 0.1 * extra, 0.0, 1.0)
    said = f"{found.mean():.1f} of {len(TAGS)} tags found, {extra.mean():.1f} landmarks that are no tag"
    return float(share.mean()), said


class Reference:
    """The package's own: ``EkfSlam`` with a chi-square gate; a landmark needs four looks."""

    def __init__(self, mean: Array, cov: Array) -> None:
        self._motion = _Odometry(np.zeros((2, 2)))
        self._slam = EkfSlam(Gaussian(mean, cov), self._motion, Mahalanobis(0.99), n_init=4, max_misses=20)

    @property
    def mean(self) -> Array:
        """[x, y, θ, l₁, l₂, …]."""
        return self._slam.mean

    @property
    def cov(self) -> Array:
        """(3 + 2n, 3 + 2n)."""
        return self._slam.cov

    def predict(self, control: Array, control_cov: Array, dt: float) -> None:
        """One step along the arc."""
        self._motion.control_cov = control_cov
        self._slam.predict(control, dt)

    def observe(self, z: Array, R: Array) -> None:
        """One look."""
        self._slam.observe(z, R)


class _Odometry:
    """Lab 0's arc, with the noise that the scenario states."""

    def __init__(self, control_cov: Array) -> None:
        self.control_cov = control_cov

    def f(self, x: Array, u: Array, dt: float) -> Array:
        return ARC.f(x, u, dt)

    def F(self, x: Array, u: Array, dt: float) -> Array:
        return ARC.F(x, u, dt)

    def Q(self, x: Array, u: Array, dt: float) -> Array:
        G = ARC.G(x, u, dt)
        return G @ self.control_cov @ G.T + 1e-12 * np.eye(3)

    def sample(self, states: Array, u: Array, dt: float, rng: np.random.Generator) -> Array:
        noise = rng.standard_normal((len(states), 2)) @ np.linalg.cholesky(self.control_cov).T
        return np.array([ARC.f(x, u + e, dt) for x, e in zip(states, noise, strict=True)])


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """Map and NEES of one run, beside the package's."""
    fig = plotting.figure(8.6, 3.6)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1, 1.2])
    left.plot(*TAGS.T, "s", color=plotting.WALL, ms=8, label="tags")
    left.plot(*mine["truth"][:, :2].T, color=plotting.TRUTH, lw=1.2, label="truth")
    left.plot(*mine["poses"][:, :2].T, color=plotting.ESTIMATE, lw=1.2, label="your track")
    left.plot(*mine["landmarks"].T, "o", color=plotting.ESTIMATE, ms=4, label="your landmarks")
    left.set_aspect("equal")
    left.set(xlabel="x [m]", ylabel="y [m]", xlim=(-3, 4), ylim=(-3, 3))
    left.set_title(f"{int(mine['found'])} of {len(TAGS)} tags found, {int(mine['extra'])} too many")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    t = DT * np.arange(1, len(mine["nees"]) + 1)
    right.semilogy(t, np.maximum(mine["nees"], 1e-2), color=plotting.ESTIMATE, label="your filter")
    right.semilogy(t, np.maximum(theirs["nees"], 1e-2), color=plotting.ODOMETRY, lw=0.8, label="the package")
    right.axhline(3, color=plotting.TRUTH, lw=0.8, ls=":")
    right.set(xlabel="time [s]", ylabel="NEES of the pose, one run", title="An honest filter's NEES averages 3")
    right.legend()
    return fig


PROJECT = Project(
    name="lab05",
    title="A complete EKF-SLAM",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("the map: eight tags, and nothing else", 35, complete),
        Criterion("position error, RMS", 15, small("rms", full=0.08, none=0.4, unit="m")),
        Criterion("honesty: NEES of the pose in its band", 40, honest("nees", 3, full=0.8)),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
)
