"""Lab 7's project: a complete particle filter that finds a lost robot by its distances to six radio beacons.

The design is a class::

    class MyFilter:
        def __init__(self, low, high, rng): ...              # the pose [x, y, θ] lies between low and high, (3,) each
        def predict(self, control, control_cov, dt): ...     # odometry [v, ω], the covariance of its error (2, 2), s
        def correct(self, beacons, ranges, sigma): ...       # (6, 2) m, (6,) m, the ranges' standard deviation in m
        mean, cov                                            # the belief after each correction: (3,) and (3, 3)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit import particles
from coursekit.gaussian import chi2_band
from coursekit.geometry import Array, wrap_angle
from coursekit.labs.lab07.runs import BEACON_SIGMA, BEACONS, LAB
from coursekit.models import DifferentialDrive, RangeOnly, pose_residual
from coursekit.particles import Particles
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean, honest, small
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project
from coursekit.world.robot import Robot, World

ROOM = replace(LAB, walls=(), cylinders=(), crates=())  # nothing to run into: a contact is no part of the model
WORN = Robot(slip=0.3)  # wheels that slip a lot: it is this noise that keeps the headings of a cloud apart
SQUARE = 3.0  # m: the side of the square in which the robot starts, any way round
DT, STEPS, LISTEN_EVERY = 0.1, 100, 5  # s; control periods; the beacons are heard after every fifth
SETTLED = 6  # corrections before the belief is judged
# Two drives that need directions, not numbers: one starts close to ±π, so that a cloud of headings in (-π, π] is cut in
# two; the other passes ±π while it is judged.
CUT, CROSSING = 0.2, (5.5, 8.5)  # rad from ±π; s
NEAR, ALIGNED = 0.5, 1.0  # m, rad: a robot that is known so well counts as found


@dataclass(frozen=True)
class Scenario:
    """low and high (3,) of the start; truth (k, 3) at each correction; controls (5, 2) and their covariances (5, 2, 2)
    before each; ranges (k, 6); and the seed of the generator that the filter gets.
    """

    low: Array
    high: Array
    truth: Array
    controls: list[Array]
    control_covs: list[Array]
    ranges: Array
    seed: int


def make(rng: np.random.Generator) -> Scenario:
    """Ten seconds on a circle, from a start that the filter is not told."""
    omega = rng.choice([-1, 1]) * rng.uniform(0.35, 0.6)
    close, earlier = rng.uniform(-CUT, CUT), omega * rng.uniform(*CROSSING)
    start = wrap_angle(np.pi + (close if rng.random() < 0.5 else -earlier))
    centre = rng.uniform([-1.5, -1.0], [1.5, 1.0])
    speed = rng.uniform(0.25, 0.4)
    turn = np.sign(omega)
    position = centre + speed / abs(omega) * np.array([np.sin(start), -np.cos(start)]) * turn
    world = World(replace(ROOM, start=(*position, start)), rng, WORN, dt=DT)
    low = np.array([*(position - rng.uniform(0, SQUARE, size=2)), -np.pi])
    truth, controls, covs, ranges = [], [], [], []
    for k in range(1, STEPS + 1):
        world.step(speed, omega)
        controls.append(world.odometry)
        covs.append(WORN.odometry_cov(float(world.odometry[0]), float(world.odometry[1]), DT))
        if k % LISTEN_EVERY == 0:
            truth.append(world.pose)
            distance = np.linalg.norm(BEACONS - world.pose[:2], axis=1)
            ranges.append(np.abs(distance + BEACON_SIGMA * rng.standard_normal(len(BEACONS))))
    parts = STEPS // LISTEN_EVERY
    high = np.array([*(low[:2] + SQUARE), np.pi])
    return Scenario(low, high, np.array(truth), np.split(np.array(controls), parts), np.split(np.array(covs), parts),
                    np.array(ranges), int(rng.integers(2**31)))  # fmt: skip


def run(design: Any, scenario: Scenario, watch: Any) -> dict[str, Array]:
    """Carry a filter through a scenario: what it believes after every correction, and what that is worth."""
    means, covs = [], []
    own = np.random.default_rng(scenario.seed)
    mine = watch.call("MyFilter(low, high, rng)", design, scenario.low.copy(), scenario.high.copy(), own)
    for controls, control_covs, ranges in zip(scenario.controls, scenario.control_covs, scenario.ranges, strict=True):
        for control, control_cov in zip(controls, control_covs, strict=True):
            watch.call("predict()", mine.predict, control, control_cov, DT)
        watch.call("correct()", mine.correct, BEACONS.copy(), ranges, BEACON_SIGMA)
        means.append(watch.numbers("mean", watch.attribute(mine, "mean"), (3,)))
        covs.append(watch.covariance("cov", watch.attribute(mine, "cov"), 3))
        watch.advance()
    errors = pose_residual(scenario.truth, np.array(means))
    scores = np.sum(errors * np.linalg.solve(np.array(covs), errors[..., None])[..., 0], axis=-1)
    distance = np.hypot(errors[:, 0], errors[:, 1])
    second = slice(len(distance) // 2, None)
    return {
        "truth": scenario.truth,
        "means": np.array(means),
        "covs": np.array(covs),
        "distance": distance,
        "nees": scores[SETTLED:],
        "rms": np.sqrt(np.mean(distance[second] ** 2)),
        "turned": np.sqrt(np.mean(errors[second, 2] ** 2)),
        "sigma_heading": np.sqrt(np.mean(np.array(covs)[second, 2, 2])),
        "lost": np.array(float(distance[-1] > NEAR or abs(errors[-1, 2]) > ALIGNED)),
    }


def unbiased(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The NEES over all runs and judged steps: all in the 95 % band of one step, none from a tenth outside it."""
    low, high = chi2_band(3, runs=len(mine))
    got, package = (float(np.mean([o.values["nees"] for o in runs])) for runs in (mine, theirs))
    outside = max(got / high, low / got) - 1
    said = f"{got:.3g} (the package: {package:.3g}); full points from {low:.2f} to {high:.2f}, none a tenth outside"
    side = "" if outside <= 0 else ": too sure of itself" if got > high else ": too modest"
    return 1 - 10 * max(outside, 0), said + side


def sharp(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The claimed σ of the heading against the package's: all up to 1.2 times, none from 1.6 times."""
    got, package = (float(np.sqrt(np.mean([o.values["sigma_heading"] ** 2 for o in runs]))) for runs in (mine, theirs))
    return (1.6 - got / package) / 0.4, f"you claim {got:.2g} rad (the package: {package:.2g}); full up to 1.2 times it"


def found(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of runs that end with the robot found; none below a half."""
    share = 1 - float(np.mean([o.values["lost"] for o in mine]))
    return 2 * share - 1, f"found in {100 * share:.0f} % of the runs: at the end within {NEAR:g} m and {ALIGNED:g} rad"


class Reference:
    """The package's own: ``particles``, sixty thousand guesses to begin with and ten thousand from then on."""

    first, later = 60_000, 10_000

    def __init__(self, low: Array, high: Array, rng: np.random.Generator) -> None:
        self._rng = rng
        self._cloud = Particles(rng.uniform(low, high, size=(self.first, 3)), angles=(2,))

    @property
    def mean(self) -> Array:
        """[x, y, θ]."""
        return particles.mean(self._cloud)

    @property
    def cov(self) -> Array:
        """(3, 3)."""
        return particles.covariance(self._cloud)

    def predict(self, control: Array, control_cov: Array, dt: float) -> None:
        """Each guess by its own draw of the odometry's error."""
        errors = self._rng.multivariate_normal(np.zeros(2), control_cov, size=len(self._cloud), method="cholesky")
        arc = DifferentialDrive(0.0, 0.0, sigma_pose=(0.0, 0.0, 0.0))
        self._cloud = particles.predict(self._cloud, arc, control + errors, dt, self._rng)

    def correct(self, beacons: Array, ranges: Array, sigma: float) -> None:
        """Six ranges; a draw when fewer than half of the guesses count."""
        if particles.effective_sample_size(self._cloud.weights) < len(self._cloud) / 2:
            self._cloud = particles.resample(self._cloud, self._rng, size=self.later)
        sensors = [RangeOnly(b, R=np.array([[sigma**2]]), position=(0, 1)) for b in beacons]
        fits = [particles.log_likelihood(s, [r])(self._cloud.states) for s, r in zip(sensors, ranges, strict=True)]
        self._cloud = particles.weigh(self._cloud, sum(fits))


def _moment(k: int) -> str:
    """When the k-th of the judged corrections is made."""
    return f"t = {DT * LISTEN_EVERY * (SETTLED + 1 + k):.1f} s"


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """Where one run's robot was and was believed to be, and the NEES, beside the package's."""
    fig = plotting.figure(8.6, 3.6)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1, 1.2])
    left.plot(*BEACONS.T, "o", mfc="none", mec=plotting.MEASUREMENT, ms=9, label="beacons")
    left.plot(*mine["truth"][:, :2].T, ".-", color=plotting.TRUTH, lw=1.2, label="truth")
    left.plot(*mine["means"][:, :2].T, ".-", color=plotting.ESTIMATE, lw=1.2, label="your filter")
    for mean, cov in zip(mine["means"][SETTLED::5], mine["covs"][SETTLED::5], strict=True):
        plotting.draw_ellipse(left, mean[:2], cov[:2, :2], lw=1)
    left.set(xlim=(-4, 4), ylim=(-3, 3), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    left.set_title(f"Position error {mine['rms']:.2f} m (RMS, second half)")
    fig.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    t = DT * LISTEN_EVERY * np.arange(SETTLED + 1, SETTLED + 1 + len(mine["nees"]))
    right.semilogy(t, np.maximum(mine["nees"], 1e-2), color=plotting.ESTIMATE, label="your filter")
    right.semilogy(t, np.maximum(theirs["nees"], 1e-2), color=plotting.ODOMETRY, lw=0.8, label="the package")
    right.axhline(3, color=plotting.TRUTH, lw=0.8, ls=":")
    right.set(xlabel="time [s]", ylabel="NEES of one run", title="Over many runs an honest NEES averages 3")
    low, high = right.get_ylim()
    ticks = [t for t in (0.1, 0.3, 1, 2, 3, 5, 10, 30, 100, 300, 1000) if low <= t <= high]
    right.set_yticks(ticks, [f"{t:g}" for t in ticks])
    right.set_yticks([], minor=True)
    right.legend()
    return fig


# The limits are set from 120 drives (seeds 7000 to 7119) of the tests' plain filter: the NEES averages 2.83, and of
# 6,000 random choices of twenty drives (of three) 0.05 % (0.08 %) lose points for honesty.  99.9 % have an RMS below
# 0.13 m (0.17 m) and 0.24 rad (0.33 rad).
PROJECT = Project(
    name="lab07",
    title="A complete particle filter",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("position error in the second half, RMS", 10, small("rms", full=0.16, none=0.6, unit="m")),
        Criterion("heading error in the second half, RMS", 10, small("turned", full=0.4, none=0.7, unit="rad")),
        Criterion("honesty: NEES, averaged over all steps", 30, unbiased),
        Criterion("honesty: NEES in its band, step by step", 10, honest("nees", 3, full=0.5, none=0.3, when=_moment)),
        Criterion("σ of the heading in the second half, RMS", 10, sharp),
        Criterion("robots found", 20, found),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
)
