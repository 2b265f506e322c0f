"""Lab 6's pictures: clouds, the geometry of a pair, NEES, tracks, maps, the report's registration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from coursekit import icp
from coursekit.geometry import Array, rotation
from coursekit.labs.lab06.runs import Lap
from coursekit.recordings import Clouds
from coursekit.teaching import plotting
from coursekit.world.arena import Arena

TARGET, SOURCE, PAIR = plotting.ODOMETRY, plotting.ESTIMATE, plotting.HIGHLIGHT


def clouds_picture(source: Array, target: Array, title: str) -> Figure:
    """Two planar clouds over each other."""
    fig = plotting.figure(6.4, 4.4)
    ax = plotting.axes(fig)
    ax.plot(*target.T, ".", color=TARGET, ms=4, label="before (target)")
    ax.plot(*source.T, ".", color=SOURCE, ms=4, label="after (source)")
    ax.set(xlabel="x [m], in the robot's frame", ylabel="y [m]", aspect="equal")
    ax.set_title(title, loc="left")
    ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), markerscale=2)
    return fig


def geometry_of_pairs() -> Figure:
    """Two drawings with the symbols of the derivation: matched points with their means, and a point before a wall."""
    fig = plotting.figure(8.2, 3.6)
    points, wall = plotting.axes(fig, 1, 2, width_ratios=[1.15, 1])
    p = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]])
    q = p @ rotation(0.5).T + [4.0, 0.4]
    leans = [-0.45, -0.35], [0.15, -0.45], [-0.15, 0.25]
    for cloud, colour, name in ((p, SOURCE, "p"), (q, TARGET, "q")):
        mean = cloud.mean(axis=0)
        for i, (point, lean) in enumerate(zip(cloud, leans, strict=True), start=1):
            points.plot(*np.array([mean, point]).T, ":", color=colour, lw=1)
            points.plot(*point, "o", color=colour, ms=6)
            points.annotate(f"${name}_{i}$", point + lean, color=colour)
        points.plot(*mean, "+", color=colour, ms=12, mew=2)
        points.annotate(rf"$\bar {name}$", tuple(mean + np.array([0.2, 0.05])), color=colour)
    points.annotate(r"$p'_3 = p_3 - \bar p$", (-0.95, 1.9), color=SOURCE)
    for a, b in zip(p, q, strict=True):
        points.plot(*np.array([a, b]).T, color=PAIR, lw=0.8)
    points.set(xlim=(-1.2, 7), ylim=(-1.1, 4.6), aspect="equal", xlabel="x [m]", ylabel="y [m]")
    points.set_title("Known pairs: $q_i$ is where $R\\,p_i + t$ should be", loc="left")
    wall.axhline(3, color=TARGET, lw=1)
    along = np.array([0.4, 1.3, 2.2, 3.1, 4.0, 4.9])
    wall.plot(along, np.full(6, 3.0), "o", color=TARGET, ms=6)
    wall.plot(3.35, 2.2, "o", color=SOURCE, ms=6)
    wall.annotate("$p_i$", (3.5, 1.85), color=SOURCE)
    wall.annotate("$q_i$", (2.75, 3.2), color=TARGET)
    wall.annotate("", (3.35, 3.0), (3.35, 2.2), arrowprops={"arrowstyle": "<->", "color": plotting.MEASUREMENT})
    wall.annotate(r"$\hat n_i^\top (q_i - p_i)$", (3.5, 2.5), color=plotting.MEASUREMENT)
    wall.plot([3.35, 3.1], [2.2, 3.0], color=PAIR, lw=0.8)
    wall.annotate("", (3.1, 4.0), (3.1, 3.0), arrowprops={"arrowstyle": "->", "color": plotting.TRUTH})
    wall.annotate(r"$\hat n_i$", (3.2, 3.6))
    plotting.draw_robot(wall, [0.5, 0.4, 0.4], SOURCE, size=0.35)
    wall.annotate("", (3.28, 2.15), (0.5, 0.4), arrowprops={"arrowstyle": "->", "color": SOURCE})
    wall.annotate("$a_i$", (1.9, 0.95), color=SOURCE)
    turn = np.linspace(0.05, 0.9, 30)
    wall.plot(0.5 + 1.1 * np.cos(turn), 0.4 + 1.1 * np.sin(turn), color=plotting.TRUTH, lw=1)
    wall.annotate(r"$\theta$", (1.7, 0.6))
    wall.set(xlim=(-0.2, 5.4), ylim=(0, 4.4), aspect="equal", xlabel="x [m]", yticks=[0, 1, 2, 3, 4])
    wall.set_title("A wall: only the distance along $\\hat n_i$ counts", loc="left")
    for ax in (points, wall):
        ax.grid(visible=False)
    return fig


def nees_rows(named: Mapping[str, Sequence[float]], dof: int = 3) -> Figure:
    """NEES of many alignments by name: a stroke each, a dot for the average, and an honest claim's 95 % limit."""
    fig = plotting.figure(8.0, 0.9 + 0.55 * len(named))
    ax, limit = plotting.axes(fig), chi2_limit(dof)
    for row, (name, values) in enumerate(named.items()):
        scores = np.asarray(values, dtype=float)
        colour = plotting.ESTIMATE if "frozen" not in name else plotting.MEASUREMENT
        ax.plot(np.clip(scores, 0.05, 2000), np.full(len(scores), row), "|", color=colour, ms=13, alpha=0.6)
        ax.plot(scores.mean(), row, "o", color=plotting.TRUTH, ms=7)
        ax.annotate(f"{100 * np.mean(scores > limit):.0f} % outside", (2300, row), va="center", annotation_clip=False)
    ax.axvline(dof, color=plotting.TRUTH, lw=0.9, ls=":")
    ax.axvline(limit, color=plotting.BAND, lw=1.5)
    ax.set(xscale="log", xlim=(0.05, 2000), ylim=(len(named) - 0.5, -0.5), xlabel="NEES; dot: the average")
    ax.set_yticks(range(len(named)), list(named))
    ax.set_title(f"NEES: {dof} (dotted) is right on average, and 5 % beyond {limit:.1f} (green)", loc="left")
    return fig


def chi2_limit(dof: int) -> float:
    """The 95 % quantile of chi-square."""
    return float(chi2.ppf(0.95, dof))


COLOURS = (plotting.ODOMETRY, plotting.MEASUREMENT, plotting.ESTIMATE, plotting.BAND)


def tracks(lap: Lap, named: Mapping[str, Array]) -> Figure:
    """Tracks over the arena, and their distance from the truth."""
    fig = plotting.figure(8.0, 4.0)
    ax, error = plotting.axes(fig, 1, 2, width_ratios=[1.45, 1])
    plotting.draw_arena(ax, Arena.load("lab"))
    ax.plot(*lap.truth[:, :2].T, color=plotting.TRUTH, lw=3, alpha=0.35, label="truth")
    way = np.r_[0.0, np.cumsum(np.hypot(*np.diff(lap.truth[:, :2], axis=0).T))]
    for (name, poses), colour in zip(named.items(), COLOURS, strict=False):
        style = {"color": colour, "lw": 1.4, "ls": "--" if colour == plotting.ODOMETRY else "-", "label": name}
        ax.plot(*poses[:, :2].T, **style)
        error.plot(way, np.maximum(np.hypot(*(poses - lap.truth)[:, :2].T), 1e-4), **style)
    error.set(yscale="log", ylim=(3e-4, 2), xlabel="driven [m]")
    error.set_title("Distance from the truth [m]", loc="left")
    fig.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8.5)
    *_, scan, world = (1000 * np.hypot(*(poses - lap.truth)[-1, :2]) for poses in named.values())
    ax.set_title(f"At the end: planes {scan:.0f} mm off, map {world:.0f} mm", loc="left")
    return fig


def map_picture(clouds: Mapping[str, Array]) -> Figure:
    """What was seen, put together by two tracks, over the walls as they are."""
    fig = plotting.figure(8.0, 3.6)
    for ax, (name, cloud) in zip(plotting.axes(fig, 1, 2, sharey=True), clouds.items(), strict=True):
        plotting.draw_arena(ax, Arena.load("lab"))
        ax.plot(*cloud.T, ".", color=plotting.ESTIMATE, ms=1.5)
        ax.set_title(name, loc="left")
        ax.label_outer()
    return fig


def before_and_after(pair: Clouds, T: Array) -> Figure:
    """Both clouds from two sides, as they came and as they were laid on each other."""
    fig = plotting.figure(8.0, 3.4)
    moved = icp.move(T, pair.source)
    panels = [
        (0, 1, pair.source, "as they came"),
        (0, 1, moved, "aligned, from above"),
        (0, 2, moved, "and from the side"),
    ]
    for ax, (i, j, cloud, title) in zip(plotting.axes(fig, 1, 3), panels, strict=True):
        ax.plot(pair.target[::3, i], pair.target[::3, j], ".", color=plotting.ODOMETRY, ms=2, label="Y, target")
        ax.plot(cloud[::3, i], cloud[::3, j], ".", color=plotting.ESTIMATE, ms=2, label="X, source")
        ax.set(xlabel="xyz"[i] + " [m]", ylabel="xyz"[j] + " [m]", aspect="equal")
        ax.set_title(title, loc="left")
    fig.axes[0].legend(loc="lower left", fontsize=8.5, markerscale=4, handletextpad=0.1)
    return fig


def error_curve(result: icp.Registration, stop: int, gaps: Sequence[float]) -> Figure:
    """RMSE over the iterations with the place where the report stopped, and the distance to its transform."""
    fig = plotting.figure(7.6, 3.8)
    ax, gap = plotting.axes(fig, 1, 2, width_ratios=[1.3, 1])
    rmse = [step.rmse for step in result.history]
    ax.plot(rmse, color=plotting.ESTIMATE)
    ax.plot(stop, rmse[stop], "o", color=plotting.MEASUREMENT)
    red, blue = {"color": plotting.MEASUREMENT}, {"color": plotting.ESTIMATE}
    ax.annotate(f"{stop} iterations: {rmse[stop]:.5f} m", (stop - 2, 0.93 * rmse[stop]), ha="right", **red)
    ax.annotate(f"{rmse[-1]:.5f} m", (len(rmse) - 1, 1.08 * rmse[-1]), ha="right", **blue)
    ax.set(
        yscale="log", xlabel="iteration", yticks=[0.01, 0.02, 0.05, 0.1], yticklabels=["0.01", "0.02", "0.05", "0.1"]
    )
    ax.set_title(f"RMSE [m]: it settled after {len(rmse) - 1} iterations", loc="left")
    gap.plot(1000 * np.asarray(gaps), color=plotting.TRUTH)
    nearest = int(np.argmin(gaps))
    gap.plot(nearest, 1000 * gaps[nearest], "o", color=plotting.MEASUREMENT)
    gap.annotate(f"iteration {nearest}: {1000 * gaps[nearest]:.1f} mm", (2, 400 * gaps[nearest]), **red)
    gap.set(yscale="log", xlabel="iteration", ylim=(0.8, 1000))
    gap.set_title("To the report's motion [mm]", loc="left")
    return fig
