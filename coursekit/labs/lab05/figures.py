"""Lab 5's pictures: covariances that fill, tags in a photograph, loops that close, thresholds that fail, verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coursekit.gaussian import chi2_band, symmetrize
from coursekit.geometry import Array
from coursekit.labs.lab05.runs import ARENA, TAGS, Track
from coursekit.teaching import plotting
from coursekit.world.tags import Detection


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
    """Error of the heading and ± 2σ over time, a panel for each filter; ``strange``: only new tags were in view.

    The titles say both at the end of that stretch, in milliradians.
    """
    fig = plotting.figure(7.8, 3.3)
    axes: Any = plotting.axes(fig, 1, len(courses), sharey=True)
    for ax, (name, (time, error, sigma)) in zip(axes, courses.items(), strict=True):
        ax.axvspan(*strange, color=plotting.TRUTH, alpha=0.07, lw=0, label="sees only new tags")
        ax.fill_between(time, -2000 * sigma, 2000 * sigma, color=plotting.ESTIMATE, alpha=0.25, lw=0, label="± 2σ")
        ax.plot(time, 1000 * error, color=plotting.MEASUREMENT, lw=1.4, label="estimate − truth")
        k = max(int(np.searchsorted(time, strange[1] - 1e-6)) - 1, 0)
        ax.set_title(f"{name}: ± {2000 * sigma[k]:.0f}, off {abs(1000 * error[k]):.0f}", fontsize=10.5)
        ax.set(xlabel="time [s]", xlim=(0, time[-1]))
    axes[0].set_ylabel("heading [mrad]")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8.5)
    return fig


SHOWN = 19  # rows of a covariance: a pose and eight landmarks


def room(ax: Axes) -> None:
    """The tags, each with its id, on fixed axes."""
    for tag, (x, y) in zip(ARENA.tags, TAGS, strict=True):
        half = np.array([-np.sin(tag.yaw), np.cos(tag.yaw)]) * tag.size
        ax.plot(*np.stack([tag.position - half, tag.position + half]).T, color=plotting.TRUTH, lw=4, zorder=1)
        behind = np.array([-0.34, -0.24]) * [np.cos(tag.yaw), np.sin(tag.yaw)]  # numbers are wider than high
        ax.annotate(str(tag.id), (x + behind[0], y + behind[1]), ha="center", va="center", fontsize=9)
    ax.set(xlim=(-2.4, 3.4), ylim=(-2.3, 2.3), xlabel="x [m]", ylabel="y [m]")
    ax.set_aspect("equal")


def association_matrix(track: Track) -> Array:
    """How often each tag (row) was taken for each landmark (column)."""
    ids, chosen = (np.concatenate([pair[i] for pair in track.taken_for]) for i in (0, 1))
    rows = (ids[:, None] == [tag.id for tag in ARENA.tags]) & (chosen[:, None] >= 0)
    columns = chosen[:, None] == np.arange(max(len(track.landmarks), 12))
    return np.asarray(rows.astype(float).T @ columns)


def covariance_image(ax: Axes, cov: Array, **style: Any) -> Any:
    """The sizes of a covariance's entries as colours, on a fixed raster: the pose first, then landmark by landmark."""
    image = ax.imshow(log_size(cov), cmap="viridis", vmin=-8, vmax=3, **style)
    ax.set(xticks=[1, *range(4, SHOWN, 4)], yticks=[1, *range(4, SHOWN, 4)])
    names = ["pose", *(f"$l_{{{i}}}$" for i in range(1, 9, 2))]
    ax.set_xticklabels(names)
    ax.set_yticklabels(names)
    ax.grid(visible=False)
    return image


def geometry() -> Figure:
    """The robot, one landmark, and every letter of the derivation."""
    fig = plotting.figure(6.4, 3.7)
    ax = plotting.axes(fig)
    pose, landmark = np.array([0.6, 0.5, 0.35]), np.array([3.4, 2.6])
    (dx, dy), heading = landmark - pose[:2], np.array([np.cos(pose[2]), np.sin(pose[2])])
    direction = np.arctan2(dy, dx)
    plotting.draw_robot(ax, pose, size=0.35)
    ax.plot(*landmark, "s", color=plotting.WALL, ms=10)
    ax.plot(*np.stack([pose[:2], landmark]).T, color=plotting.MEASUREMENT, lw=1.8)
    ax.plot(*np.stack([pose[:2], pose[:2] + 2.0 * heading]).T, color=plotting.ESTIMATE, lw=1.2, ls="--")
    ax.plot([pose[0], landmark[0], landmark[0]], [pose[1], pose[1], landmark[1]], color=plotting.TRUTH, lw=0.9, ls=":")
    for radius, low, high, colour, name in (
        (1.25, 0.0, pose[2], plotting.ESTIMATE, r"$\theta$"),
        (1.6, pose[2], direction, plotting.MEASUREMENT, r"$\varphi$"),
    ):
        a = np.linspace(low, high, 30)
        ax.plot(pose[0] + radius * np.cos(a), pose[1] + radius * np.sin(a), color=colour, lw=1.2)
        middle = 0.5 * (low + high)
        at = pose[:2] + (radius + 0.17) * np.array([np.cos(middle), np.sin(middle)])
        ax.annotate(name, at, ha="center", va="center", color=colour, fontsize=13)
    side = np.array([-np.sin(direction), np.cos(direction)])
    ax.annotate("$r$", pose[:2] + 0.62 * np.array([dx, dy]) + 0.16 * side, color=plotting.MEASUREMENT, fontsize=13)
    ax.annotate(r"$\Delta x$", (2.3, pose[1] - 0.24), fontsize=12)
    ax.annotate(r"$\Delta y$", (landmark[0] + 0.08, 1.5), fontsize=12)
    ax.annotate("robot $(x, y)$", (0.35, 0.0), color=plotting.ESTIMATE, fontsize=11)
    ax.annotate(r"landmark $\ell_j$", (3.1, 2.82), fontsize=11)
    ax.set(xlim=(0, 4.2), ylim=(-0.2, 3.1), xlabel="x [m]", ylabel="y [m]")
    ax.set_aspect("equal")
    ax.set_title("One look: a range and a bearing")
    return fig


def arc_figure(turn: float = 0.6) -> Figure:
    """A map corrected by a turn: along the tangent, as a Kalman filter moves it, and along the arc."""
    fig = plotting.figure(6.4, 3.5)
    ax = plotting.axes(fig)
    points = np.array([[1.6, 0.3], [2.2, 0.3], [2.2, 0.9]])
    tangent = points + turn * points @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    c, s = np.cos(turn), np.sin(turn)
    arc = points @ np.array([[c, s], [-s, c]])
    for shape, colour, label in (
        (points, plotting.ODOMETRY, "before"),
        (tangent, plotting.MEASUREMENT, "x + δ: along the tangent"),
        (arc, plotting.ESTIMATE, "x + V(δθ) δ: along the arc"),
    ):
        ax.plot(*shape.T, "o-", color=colour, lw=1.4, ms=6, label=label)
    for point in points:
        a = np.arctan2(point[1], point[0]) + np.linspace(0, turn, 40)
        ax.plot(*(np.hypot(*point) * np.stack([np.cos(a), np.sin(a)])), color=plotting.TRUTH, lw=0.7, ls=":")
    ax.plot(0, 0, "k+", ms=10)
    ax.annotate("where the turn happened", (0, 0), xytext=(8, -4), textcoords="offset points", fontsize=9)
    ax.set(xlabel="x [m]", ylabel="y [m]", xlim=(-0.2, 3.0), ylim=(-0.2, 2.6))
    ax.set_aspect("equal")
    grown = np.linalg.norm(tangent[1] - tangent[0]) / np.linalg.norm(points[1] - points[0]) - 1
    ax.set_title(f"A turn of {turn:g} rad along the tangent makes the map {100 * grown:.0f} % larger")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return fig


def pair_figure(expected: Array, measured: Array, names: Sequence[str]) -> Figure:
    """Expected and measured bearings of two tags on one axis, rad."""
    fig = plotting.figure(7.0, 1.9)
    ax = plotting.axes(fig)
    for y, values, colour, label in ((1, expected, plotting.ESTIMATE, "expected"),
                                     (0, measured, plotting.MEASUREMENT, "measured")):  # fmt: skip
        ax.plot(values, [y] * len(values), "o", color=colour, ms=9, label=label)
        for name, value in zip(names, values, strict=True):
            at = (0, 9 if y else -18)  # below the measured ones, clear of the arrows
            ax.annotate(f"{name}: {_signed(value)}", (value, y), xytext=at, textcoords="offset points", ha="center")
    for a, b in zip(expected, measured, strict=True):
        ax.annotate("", (b, 0.12), (a, 0.88), arrowprops={"arrowstyle": "->", "color": plotting.TRUTH, "lw": 1})
    ax.set(
        xlim=(-0.26, 0.13),
        ylim=(-0.75, 1.7),
        yticks=[0, 1],
        yticklabels=["measured", "expected"],
        xlabel="bearing [rad]",
    )
    ax.set_title(f"Both bearings are off by {_signed(measured[0] - expected[0])} rad: one turn explains both")
    return fig


def _signed(value: float) -> str:
    """Two decimals and a sign, with the minus that the axes use."""
    return f"{value:+.2f}".replace("-", "−")


def detections_figure(picture: Array, found: Sequence[Detection], caption: str) -> Figure:
    """A camera picture with the outlines of what was found in it."""
    fig = plotting.figure(6.4, 4.9)
    ax = plotting.axes(fig)
    ax.imshow(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), interpolation="nearest")
    for one in found:
        ax.plot(*np.vstack([one.corners, one.corners[:1]]).T, color=plotting.MEASUREMENT, lw=2)
        u, v = one.corners.min(axis=0)
        ax.annotate(f"tag {one.id}", (u, v - 9), color="white", fontsize=10,
                    bbox={"facecolor": plotting.MEASUREMENT, "edgecolor": "none", "pad": 1.5})  # fmt: skip
    ax.set(xticks=[], yticks=[], title=caption)
    ax.grid(visible=False)
    return fig


def closure_figure(track: Track) -> Figure:
    """How unsure the filter is of the robot and of each landmark, over time."""
    fig = plotting.figure(7.4, 3.6)
    ax = plotting.axes(fig)

    def sigma(k: int, a: int) -> float:
        return 1000 * float(np.sqrt(np.linalg.eigvalsh(symmetrize(track.covs[k][a : a + 2, a : a + 2]))[-1]))

    for j in range(len(track.landmarks)):
        known = [k for k, mean in enumerate(track.means) if len(mean) > 4 + 2 * j]
        last = j == len(track.landmarks) - 1
        ax.plot(track.time[known], [sigma(k, 3 + 2 * j) for k in known], lw=2 if last else 1.2,
                color=plotting.MEASUREMENT if last else plotting.ESTIMATE,
                label="the landmark found last" if last else "the other landmarks" if j == 0 else None)  # fmt: skip
    robot = [sigma(k, 0) for k in range(len(track.means))]
    ax.plot(track.time, robot, color=plotting.TRUTH, lw=1, alpha=0.7, label="the robot")
    lately = [sigma(k, 3 + 2 * j) for k in known]
    closed = 1 + int(np.argmin(np.divide(lately[1:], lately[:-1])))
    at = 0.5 * (track.time[known[closed - 1]] + track.time[known[closed]])
    ax.axvline(at, color=plotting.TRUTH, lw=1, ls=":")
    ax.annotate("loop closure", (at, 100), xytext=(5, 0), textcoords="offset points", va="top", fontsize=9)
    ax.set(yscale="log", xlabel="time [s]", ylabel="σ in the worst direction [mm]", xlim=(0, track.time[-1]))
    ax.set_title(f"One look: the last landmark's σ falls from {lately[closed - 1]:.0f} to {lately[closed]:.0f} mm")
    ax.set(ylim=(0.3, 200), yticks=[0.5, 1, 2, 5, 10, 20, 50, 100])
    ax.minorticks_off()
    ax.yaxis.set_major_formatter("{x:g}")
    ax.legend(loc="lower right")
    return fig


def log_size(cov: Array) -> Array:
    """log₁₀ of the entries' sizes on the raster; NaN where there is nothing, the least colour where there is a zero."""
    out, n = np.full((SHOWN, SHOWN), np.nan), min(len(cov), SHOWN)
    out[:n, :n] = np.log10(np.maximum(np.abs(cov[:n, :n]), 1e-12))
    return out
