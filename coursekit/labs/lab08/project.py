"""Lab 8's project: find a robot on a map from what its camera sees, through fog, one wrong picture and a kidnapping.

The design is a class::

    class MyLocaliser:
        def __init__(self, map_image, motion, dt, rng): ...    # (h, w, 3) uint8; a motion model in px; s; a Generator
        def step(self, control, frame): ...                    # [v px/s, ω rad/s], then the frame (200, 200, 3) uint8
        mean, cov                                              # [x, y, θ] in the odometry's frame (3,), (3, 3)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.geometry import Array
from coursekit.models import DifferentialDrive, pose_residual
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean, honest, small
from coursekit.teaching.projects import Criterion, Project
from coursekit.visual import MapMatcher, VisualFilter, dominant_cluster, odometry_from_image
from coursekit.world import seafloor
from coursekit.world.seafloor import DT, PIXELS_PER_METRE, SIGMA_OMEGA, SIGMA_SLIP, SIGMA_V, TURN_BIAS, TURN_GAIN

MOTION = DifferentialDrive(SIGMA_V, SIGMA_OMEGA, (SIGMA_SLIP, SIGMA_SLIP, 1e-3))
SIZE = 200  # px, of the camera's frame
STEPS, FOG, WRONG, KIDNAPPED = 24, range(9, 14), 17, 19  # frames are counted from 1
LOCATED, FOUND_AGAIN = 3, 21  # the frames by which the robot has to be found
SETTLED = [k for k in range(LOCATED, STEPS + 1) if k != WRONG and not KIDNAPPED <= k < FOUND_AGAIN]
SHARP = [k for k in SETTLED if k not in FOG]


@dataclass(frozen=True)
class Scenario:
    """map_image (800, 1000, 3); controls (n, 2) [px/s, rad/s]; frames, n of them; truth (n, 3), odometry's frame."""

    map_image: Any
    controls: Array
    frames: list[Any]
    truth: Array
    seed: int


def make(rng: np.random.Generator) -> Scenario:
    """A dive over one end of the sea floor, from a place that nobody tells, carried off to another on its way."""
    sea = seafloor.load()
    map_image = np.ascontiguousarray(sea[:, :1000] if rng.random() < 0.5 else sea[:, -1000:])
    places = rng.permutation([(220.0, 250.0), (760.0, 260.0), (240.0, 560.0), (770.0, 540.0)])
    places = places + rng.uniform(-50, 50, (4, 2))
    seed = int(rng.integers(2**31))
    before = seafloor.dive(map_image, KIDNAPPED - 1, seed, start=[*places[0], rng.uniform(-3, 3)], targets=places[1:2])
    after = seafloor.dive(
        map_image, STEPS - KIDNAPPED, seed + 1, start=[*places[2], rng.uniform(-3, 3)], targets=places[3:]
    )
    poses, light = np.vstack([before.poses, after.poses])[1:], np.vstack([before.light, after.light])[1:]
    commands = np.vstack([before.commands, before.commands[-1:], after.commands])
    frames = []
    for k, (pose, (scale, gain, offset)) in enumerate(zip(poses, light, strict=True), 1):
        seen = np.array([*places[3], 1.0]) if k == WRONG else pose
        frames.append(
            seafloor.look(map_image, seen, scale=scale, gain=gain, offset=offset, blur=12.0 if k in FOG else 0.7,
                          noise=4.0, caustics=0.12, time=k * DT, size=SIZE, rng=rng)
        )  # fmt: skip
    controls = commands * [PIXELS_PER_METRE, TURN_GAIN] + [0.0, TURN_BIAS]
    return Scenario(map_image, controls, frames, odometry_from_image(poses), seed)


def run(design: Any, scenario: Scenario, watch: Any) -> dict[str, Array]:
    """Let a localiser swim through a scenario: its belief after every frame, and what that is worth."""
    means, covs = [], []
    rng = np.random.default_rng(scenario.seed)
    mine = watch.call("MyLocaliser(map_image, motion, dt, rng)", design, scenario.map_image, MOTION, DT, rng)
    for control, frame in zip(scenario.controls, scenario.frames, strict=True):
        watch.call("step()", mine.step, control, frame)
        means.append(watch.numbers("mean", watch.attribute(mine, "mean"), (3,)))
        covs.append(watch.covariance("cov", watch.attribute(mine, "cov"), 3))
        watch.advance()
    errors = pose_residual(scenario.truth, np.array(means))
    apart = np.hypot(errors[:, 0], errors[:, 1])
    scores = np.sum(errors * np.linalg.solve(np.array(covs), errors[..., None])[..., 0], axis=-1)
    at = {name: np.array(frames) - 1 for name, frames in (("settled", SETTLED), ("sharp", SHARP))}
    lost = apart[[LOCATED - 1, FOUND_AGAIN - 1]] > 5
    return {
        "truth": scenario.truth, "means": np.array(means), "apart": apart, "nees": scores[at["settled"]],
        "error": apart[at["sharp"]], "drift": apart[FOG[-1] - 1], "fooled": apart[WRONG - 1],
        "lost": lost.astype(float),
    }  # fmt: skip


class Reference:
    """The package's own: ``MapMatcher`` and ``VisualFilter``."""

    def __init__(self, map_image: Any, motion: Any, dt: float, rng: np.random.Generator) -> None:
        self._matcher, self._filter = MapMatcher(map_image), VisualFilter(map_image.shape, motion)
        self._dt, self._rng = dt, rng
        self._cloud = self._filter.uniform(1000, rng)

    def step(self, control: Array, frame: Any) -> None:
        """One control, one frame."""
        self._cloud = self._filter.step(self._cloud, control, self._dt, self._matcher.locate(frame), self._rng)
        self._belief = dominant_cluster(self._cloud)

    @property
    def mean(self) -> Array:
        """[x, y, θ]."""
        return self._belief.mean

    @property
    def cov(self) -> Array:
        """(3, 3)."""
        return self._belief.cov


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """The distance from the truth along one dive, beside the package's."""
    fig = plotting.figure(7.6, 3.6)
    ax = plotting.axes(fig)
    k = np.arange(1, STEPS + 1)
    ax.axvspan(FOG[0] - 0.5, FOG[-1] + 0.5, color="#d9d9d9", lw=0)
    labels = (
        (np.mean(FOG), "fog", "center", 0),
        (WRONG, "wrong\npicture", "right", -4),
        (KIDNAPPED, "carried off", "left", 4),
    )
    for at, name, ha, apart in labels:
        ax.annotate(name, (at, 1.5e3), (apart, 0), textcoords="offset points", ha=ha, va="top", fontsize=9.5)
    for at in (WRONG, KIDNAPPED):
        ax.axvline(at, color=plotting.TRUTH, lw=0.8, ls=":")
    ax.plot(k, np.maximum(theirs["apart"], 1e-3), color=plotting.ODOMETRY, lw=1, label="the package")
    ax.plot(k, np.maximum(mine["apart"], 1e-3), "o-", color=plotting.ESTIMATE, ms=4, label="your localiser")
    ax.set(yscale="log", ylim=(5e-4, 2e3), xlabel="frame", ylabel="distance from the truth [px]")
    ax.set_title(f"80 % of the sharp frames lie within {_most(mine['error']):.2g} px of the truth")
    fig.legend(loc="outside lower center", ncols=2)
    return fig


def _most(errors: Array) -> float:
    """What 80 % stay below: one wrong picture is forgiven, a robot that stays lost is not."""
    return float(np.quantile(errors, 0.8))


PROJECT = Project(
    name="lab08",
    title="A localiser that sees",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("position: 80 % of the sharp frames within", 25,
                  small("error", full=0.3, none=5.0, unit="px", average=_most)),
        Criterion("honesty: NEES in its band", 35, honest("nees", 3, full=0.75, none=0.3)),
        Criterion("odometry: error at the end of the fog", 10, small("drift", full=15.0, none=60.0, unit="px")),
        Criterion("doubt: error at the one wrong picture", 10, small("fooled", full=25.0, none=150.0, unit="px")),
        Criterion("found at the start and after the kidnapping: share missed", 10, small("lost", full=0.05, none=1.0)),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
    runs=4,
)  # fmt: skip
