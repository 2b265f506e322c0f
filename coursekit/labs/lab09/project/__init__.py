"""Lab 9's project, the capstone: a robot that drives by its own SLAM through two rooms, while the rooms change.

The design is a class::

    class MyRobot:
        def __init__(self, mean, cov, waypoints): ...        # the start [x, y, θ] (3,), its covariance (3, 3); (n, 2) m
        def move(self, control, control_cov, dt): ...        # odometry [v, ω], the covariance of its error (2, 2), s
        def scan(self, points): ...                          # what the lidar hit, in the robot's frame, (m, 2) m
        def see(self, ids, z, R): ...                        # tags: ids (m,), range and bearing (m, 2), R (m, 2, 2)
        def command(self): ...                               # → [v, ω] for the next period, or None: "I have arrived"
        mean, cov, landmarks                                 # the belief, (3,) and (3, 3), and the map, (n, 2) m

``hall`` is the world.  ``robot`` holds a ``Starter``, whose parts a design may replace, and the package's own design.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.geometry import Array
from coursekit.labs.lab09.project.hall import DT, HALL, LOOK_EVERY, START, Hall, Scenario, make
from coursekit.labs.lab09.project.robot import Reference, Starter, Step, along_the_arc
from coursekit.models import pose_residual
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean
from coursekit.teaching.judging import Trouble, Watch
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project

STEPS = 900  # control periods: after 90 s the drive is over
START_COV = 1e-8 * np.eye(3)  # the map's frame is where the robot starts
NEAR = 0.2  # m: a waypoint that the robot passes at this distance is reached, a tag with a landmark so near is found
HONEST = (1.0, 5.0)  # the NEES averaged over all drives; 3 is right
TAGS = np.array([tag.position for tag in HALL.tags])

__all__ = ["PROJECT", "Reference", "Starter", "Step", "along_the_arc"]


def run(design: Any, scenario: Scenario, watch: Watch) -> dict[str, Array]:
    """Let a design drive: where it was, where it believed to be, what it reached, touched and mapped."""
    hall, way = Hall(scenario), scenario.waypoints
    mine = watch.call("MyRobot(mean, cov, waypoints)", design, np.array(START), START_COV.copy(), way.copy())
    truth, means, covs, shown, arrived = [], [], [], np.zeros(len(TAGS), dtype=int), False
    shown += _sense(mine, hall, watch)
    for k in range(1, STEPS + 1):
        wanted = watch.call("command()", mine.command)
        if arrived := wanted is None:
            break
        odometry = hall.step(watch.numbers("command()", wanted, (2,)))
        watch.call("move()", mine.move, *odometry, DT)
        if k % LOOK_EVERY == 0:
            shown += _sense(mine, hall, watch)
        truth.append(hall.world.pose)
        means.append(watch.numbers("mean", watch.attribute(mine, "mean"), (3,)))
        covs.append(watch.covariance("cov", watch.attribute(mine, "cov"), 3))
        watch.advance()
    if not truth:
        raise Trouble("command() returned None before the first step; is there a return at the function's end?")
    landmarks = watch.numbers("landmarks", watch.attribute(mine, "landmarks"), (None, 2))
    errors = pose_residual(np.array(truth), np.array(means))
    apart = np.linalg.norm(landmarks[:, None] - TAGS, axis=-1) if len(landmarks) else np.full((1, len(TAGS)), np.inf)
    found = apart.min(axis=0) < NEAR
    return {
        "truth": np.array(truth), "means": np.array(means), "covs": np.array(covs), "waypoints": way,
        "nees": np.sum(errors * np.linalg.solve(np.array(covs), errors[..., None])[..., 0], axis=-1),
        "rms": np.sqrt(np.mean(np.sum(errors[:, :2] ** 2, axis=1))),
        "reached": np.mean(reached(np.array(truth)[:, :2], way, arrived)), "touched": np.array(hall.touched * DT),
        "landmarks": landmarks, "shown": np.sum(shown >= 3), "found": np.sum(found & (shown >= 3)),
        "extra": len(landmarks) - np.sum(found),
    }  # fmt: skip


def _sense(mine: Any, hall: Hall, watch: Watch) -> np.ndarray:
    """A scan and a look; returns which tags were in the picture."""
    watch.call("scan()", mine.scan, hall.scan())
    shown, sighting = hall.look()
    watch.call("see()", mine.see, *sighting)
    return shown


def reached(track: Array, waypoints: Array, arrived: bool) -> np.ndarray:
    """Which waypoints (n, 2) the track (k, 2) passes, one after the other; the last one counts where the robot ends."""
    hit, now = np.zeros(len(waypoints), dtype=bool), 0
    for i, waypoint in enumerate(waypoints[:-1]):
        near = np.flatnonzero(np.linalg.norm(track[now:] - waypoint, axis=1) < NEAR)
        if len(near):
            hit[i], now = True, now + near[0]
    hit[-1] = arrived and np.linalg.norm(track[-1] - waypoints[-1]) < NEAR
    return hit


def tour(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of the waypoints that were reached."""
    share = _mean(mine, "reached")
    return share, f"{share:.0%} of the waypoints passed within {NEAR} m"


def untouched(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of drives without a contact, each worth as much as it reached."""
    touched = np.array([o.values["touched"] for o in mine])
    share = float(np.mean((touched == 0) * [o.values["reached"] for o in mine]))
    return share, f"{np.sum(touched > 0)} of {len(mine)} drives touch something, for {touched.mean():.1f} s on average"


def exact(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """RMS position error: full up to 0.08 m, none from 0.4 m; it counts as far as the tour went."""
    got, package = _mean(mine, "rms"), _mean(theirs, "rms")
    share = float(np.clip((0.4 - got) / 0.32, 0.0, 1.0)) * _mean(mine, "reached")
    return share, f"{got:.3f} m (the package: {package:.3f}; full points up to 0.08, for the whole tour)"


def knows_its_error(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The NEES averaged over all drives: full within HONEST, none where it is off by another factor 2."""
    average, (low, high) = float(np.mean([np.mean(o.values["nees"]) for o in mine])), HONEST
    beyond = max(np.log2(low / max(average, 1e-9)), np.log2(average / high), 0.0)
    side = "" if beyond == 0 else ": too sure of itself" if average > high else ": too modest"
    return float(np.clip(1.0 - beyond, 0.0, 1.0)), f"the NEES averages {average:.3g}; {low} to {high} is honest{side}"


def mapped(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of the tags shown three times that were found, less a tenth for each landmark too many."""
    found, shown, extra = (np.array([o.values[k] for o in mine], dtype=float) for k in ("found", "shown", "extra"))
    share = np.clip(found / np.maximum(shown, 1) - 0.1 * extra, 0.0, 1.0)
    return float(share.mean()), (
        f"{found.mean():.1f} of {shown.mean():.1f} tags found, {extra.mean():.1f} landmarks too many"
    )


def _mean(outcomes: list[Outcome], key: str) -> float:
    return float(np.mean([o.values[key] for o in outcomes]))


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """One drive on its map, and its errors beside the package's."""
    fig = plotting.figure(8.6, 3.8)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.4, 1])
    for wall in HALL.walls:
        left.plot(*np.array([wall.start, wall.end]).T, color=plotting.WALL, lw=2)
    left.plot(*mine["waypoints"].T, "+", color=plotting.HIGHLIGHT, ms=9, label="waypoints")
    left.plot(*TAGS.T, "s", color=plotting.WALL, ms=6, label="tags")
    left.plot(*mine["truth"][:, :2].T, color=plotting.TRUTH, lw=2.4, label="truth")
    left.plot(*mine["means"][:, :2].T, color=plotting.ESTIMATE, lw=1.2, label="your estimate")
    left.plot(*mine["landmarks"].T, "o", color=plotting.ESTIMATE, ms=4, label="your map")
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    left.set_title(f"{mine['reached']:.0%} of the waypoints reached", loc="left")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    for values, colour, name, lw in ((theirs, plotting.ODOMETRY, "the package", 3.0),
                                     (mine, plotting.ESTIMATE, "you", 1.4)):  # fmt: skip
        off = np.hypot(*(values["truth"] - values["means"])[:, :2].T)
        right.plot(DT * np.arange(1, len(off) + 1), off, color=colour, lw=lw, label=name)
    right.set(xlabel="time [s]", ylabel="position error [m]", ylim=(0, None))
    right.set_title(f"NEES of this drive: {np.mean(mine['nees']):.1f}", loc="left")
    right.legend()
    return fig


PROJECT = Project(
    name="lab09",
    title="Capstone: a robot that drives by its own map",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("the tour: waypoints reached", 25, tour),
        Criterion("nothing touched", 15, untouched),
        Criterion("position error, RMS", 20, exact),
        Criterion("honesty: average NEES", 20, knows_its_error),
        Criterion("the map: tags found", 10, mapped),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
    runs=3,
)
