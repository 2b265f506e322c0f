"""Lab 9's pictures: where commands alone lead, what a delay does, and what the recordings say of each filter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from coursekit import ekf, icp
from coursekit.geometry import Array
from coursekit.labs.lab09.localisation import Track, truth_at
from coursekit.labs.lab09.runs import Map
from coursekit.recordings import Clouds, Mrclam
from coursekit.teaching import plotting


def room(ax: Axes, run: Mrclam) -> None:
    """Landmarks and the true track, in metres."""
    ax.plot(*np.array(list(run.landmarks.values())).T, "s", color=plotting.WALL, ms=5, label="landmarks")
    ax.plot(*run.groundtruth[::20, 1:3].T, color=plotting.TRUTH, lw=0.8, label="truth")
    ax.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")


def by_commands(run: Mrclam, times: Array, poses: Array) -> Figure:
    """Where the commands alone lead, beside the truth; and the error over time."""
    fig = plotting.figure(8.4, 3.9)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.2, 1])
    room(left, run)
    left.plot(*poses[:, :2].T, color=plotting.ODOMETRY, lw=1, label="commands alone")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    left.set_title(f"One robot for {(times[-1] - times[0]) / 60:.0f} minutes")
    error = np.hypot(*(poses - truth_at(run, times))[:, :2].T)
    right.plot(times - times[0], error, color=plotting.ODOMETRY)
    right.set(xlabel="time [s]", ylabel="position error [m]", ylim=(0, None))
    right.set_title(f"The commands alone: up to {error.max():.1f} m off")
    return fig


def late_and_deep() -> Figure:
    """What the derivation speaks of: a command, the step it makes δ later, and a depth that is called a range."""
    fig = plotting.figure(8.6, 3.4)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.5, 1])
    t = np.array([0.0, 1.0, 1.0, 2.2, 2.2, 4.0])
    u = np.array([0.3, 0.3, 1.0, 1.0, 0.5, 0.5])
    left.plot(t, u, color=plotting.ODOMETRY, lw=2, label="commanded, $u(t)$")
    left.plot(t + 0.5, u, color=plotting.TRUTH, lw=2, label="done, $u(t - \\delta)$")
    left.fill_between([1.1, 1.5], 0, 0.3, color=plotting.ESTIMATE, alpha=0.3, lw=0)
    left.fill_between([1.5, 2.1], 0, 1.0, color=plotting.ESTIMATE, alpha=0.3, lw=0)
    left.annotate("", (1.5, 1.1), (1.0, 1.1), arrowprops={"arrowstyle": "<->", "lw": 1})
    left.annotate("$\\delta$", (1.25, 1.13), ha="center")
    left.annotate("$m$", (1.8, 0.45), ha="center")
    left.set(xlim=(0, 4), ylim=(0, 1.35), xticks=[1.1, 2.1], yticks=[], xlabel="time")
    left.set_xticklabels(["$t$", "$t + \\Delta t$"])
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    left.set_title("The robot does what it was told, δ later")
    plotting.draw_robot(right, [0, 0, 0], colour=plotting.TRUTH, size=0.35)
    right.plot([0, 2.6], [0, 1.5], color=plotting.TRUTH, lw=1.4)
    right.plot([0, 2.6], [0, 0], color=plotting.MEASUREMENT, lw=1.8)
    right.plot([2.6, 2.6], [0, 1.5], color=plotting.ODOMETRY, lw=1, ls=":")
    right.plot(2.6, 1.5, "s", color=plotting.WALL, ms=8)
    right.add_patch(Arc((0, 0), 1.6, 1.6, theta1=0, theta2=30, color=plotting.TRUTH))
    right.annotate("$r$", (1.2, 0.85))
    right.annotate("$\\varphi$", (0.9, 0.17))
    right.annotate("depth $r\\cos\\varphi$", (1.3, -0.1), ha="center", va="top", color=plotting.MEASUREMENT)
    right.annotate("$\\ell$", (2.72, 1.5), va="center")
    right.set(xlim=(-0.4, 3.1), ylim=(-0.5, 1.9), aspect="equal")
    right.axis("off")
    right.set_title("A camera that calls the depth a range")
    return fig


def log_and_clouds(scores: Mapping[str, Mapping[str, float]], clouds: Clouds, fit: icp.Registration) -> Figure:
    """Nats a held-out sample of two noise models; and two clouds before and after registration, seen from above."""
    fig = plotting.figure(8.8, 3.6)
    left, before, after = plotting.axes(fig, 1, 3, width_ratios=[1.5, 1, 1])
    width, models = 0.38, list(next(iter(scores.values())))
    for i, (model, colour) in enumerate(zip(models, (plotting.ODOMETRY, plotting.ESTIMATE), strict=True)):
        bars = [score[model] for score in scores.values()]
        left.bar(np.arange(len(bars)) + (i - 0.5) * width, bars, width, color=colour, label=model)
    left.axhline(0, color=plotting.TRUTH, lw=0.8)
    left.set_xticks(range(len(scores)), [name.replace(" ", "\n", 1) for name in scores])
    left.set_ylabel("nats a held-out sample")
    left.set_title("The log")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
    some = slice(None, None, 8)
    moved = icp.move(fit.T_target_source, clouds.source)
    for ax, cloud, title in ((before, clouds.source, "The clouds, before"), (after, moved, "and after ICP")):
        ax.plot(*clouds.target[some, :2].T, ".", color=plotting.TRUTH, ms=2, label="target")
        ax.plot(*cloud[some, :2].T, ".", color=plotting.ESTIMATE, ms=2, label="source")
        ax.set(aspect="equal", xlabel="x [m]")
        ax.set_title(title)
    before.set_ylabel("y [m]")
    before.legend(loc="upper center", bbox_to_anchor=(1.1, -0.22), ncols=2, markerscale=4)
    return fig


def followed(track: Track, run: Mrclam) -> Figure:
    """The estimate on the map, its error with the claimed 95 %, and its NEES."""
    fig = plotting.figure(8.8, 4.4)
    panels = plotting.mosaic(fig, [["map", "error"], ["map", "nees"]], width_ratios=[1, 1.2])
    room(panels["map"], run)
    panels["map"].plot(*track.mean[:, :2].T, color=plotting.ESTIMATE, lw=0.9, label="estimate")
    panels["map"].legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3)
    panels["map"].set_title(f"Among known landmarks: {track.rmse(run):.3f} m RMS")
    known = track.time <= run.groundtruth[-1, 0]
    t, P = track.time[known] - track.time[0], track.cov[known]
    error_panel(panels["error"], t, track.errors(run), np.sqrt(P[:, 0, 0] + P[:, 1, 1]))
    nees_panel(panels["nees"], t, track.nees(run))
    return fig


def error_panel(ax: Axes, t: Array, errors: Array, sigma: Array) -> None:
    """Position error, and twice its claimed root mean square."""
    ax.fill_between(t, 0, 2 * sigma, color=plotting.ESTIMATE, alpha=0.25, lw=0, label="2σ, claimed")
    ax.plot(t, np.hypot(*errors[:, :2].T), color=plotting.MEASUREMENT, lw=1, label="error")
    ax.set(ylabel="position [m]", ylim=(0, None), xlim=(0, t[-1]))
    ax.legend(loc="upper right", ncols=2, fontsize=8.5)


def nees_panel(ax: Axes, t: Array, values: Array) -> None:
    """NEES of one run, with the 95 % quantile of χ² with 3 degrees of freedom."""
    bound = ekf.gate_threshold(0.95, 3)
    ax.semilogy(t, np.maximum(values, 1e-2), color=plotting.ESTIMATE, lw=0.8)
    ax.axhspan(1e-2, bound, color=plotting.BAND, alpha=0.15, lw=0)
    ax.axhline(3, color=plotting.BAND, lw=1, ls="--")
    ax.set(xlabel="time [s]", ylabel="NEES", ylim=(3e-2, 300), xlim=(0, t[-1]))
    ax.set_title(f"NEES {np.mean(values):.1f} on average, {np.mean(values < bound):.0%} below {bound:.1f}")


NAMES = {
    "κ": "κ turn gain", "λ": "λ speed", "b": "b offset of the range", "p": "p depth for range", "δ": "δ delay",
    "γ": "γ veer", "β": "β camera's yaw",
}  # fmt: skip


def blame(alone: Mapping[str, float], without: Mapping[str, float], none: float, everything: float) -> Figure:
    """Average NEES when one constant alone is learnt, and when all but one are."""
    fig = plotting.figure(8.4, 3.2)
    left, right = plotting.axes(fig, 1, 2, sharey=True)
    for ax, values, reference, title in (
        (left, alone, none, "only this one is learnt"),
        (right, without, everything, "all but this one are learnt"),
    ):
        worst = (min if ax is left else max)(values, key=lambda s: values[s])
        colours = [plotting.MEASUREMENT if s == worst else plotting.ODOMETRY for s in values]
        ax.barh([NAMES[s] for s in values], list(values.values()), color=colours)
        ax.axvline(reference, color=plotting.TRUTH, lw=1.2, ls=":")
        ax.axvline(3, color=plotting.BAND, lw=1.4)
        ax.set(xlabel="average NEES (3 is right)")
        ax.set_title(title)
    left.invert_yaxis()
    return fig


def mapped(found: Map) -> Figure:
    """A map and a way that SLAM made, moved onto the truth; and the way's error."""
    fig = plotting.figure(8.4, 3.9)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.2, 1])
    room(left, found.run)
    moved = icp.move(found.motion, found.way[:, :2])
    left.plot(*moved.T, color=plotting.ESTIMATE, lw=0.8, label="SLAM")
    marks = icp.move(found.motion, found.landmarks)
    left.plot(*marks.T, "o", color=plotting.ESTIMATE, ms=8, mfc="none", label="its landmarks")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, fontsize=8.5)
    left.set_title(f"{len(marks)} landmarks found, {len(found.run.landmarks)} are there")
    error = np.hypot(*(moved - truth_at(found.run, found.way_time)[:, :2]).T)
    right.plot(found.way_time - found.time[0], error, color=plotting.ESTIMATE, lw=1)
    right.set(xlabel="time [s]", ylabel="position error, aligned [m]", ylim=(0, None))
    right.set_title(f"The way: {found.track_error:.2f} m RMS")
    return fig


def turn_rates(ax: Axes) -> tuple[Any, Any]:
    """Empty lines for the true and the commanded turn rate, on fixed axes."""
    (true,) = ax.plot([], [], color=plotting.TRUTH, lw=1.6, label="turned")
    (told,) = ax.plot([], [], color=plotting.MEASUREMENT, lw=1.6, label="commanded, shifted by the delay")
    ax.set(xlabel="time [s]", ylabel="turn rate [rad/s]", ylim=(-0.6, 0.6))
    return true, told
