"""Lab 8's pictures: how a frame is matched, where it lies, clouds that starve, the filter's error along the dive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle

from coursekit import particles, visual
from coursekit.gaussian import Gaussian, ellipse
from coursekit.geometry import Array
from coursekit.labs.lab08.runs import KIDNAPPED, Ratios, poses_of
from coursekit.models import pose_residual
from coursekit.particles import Particles
from coursekit.results import Rejected
from coursekit.teaching import plotting
from coursekit.visual import Fix
from coursekit.visual.homography import project
from coursekit.world import seafloor
from coursekit.world.seafloor import FRAME, frame_to_map


def rgb(image: Any, step: int = 1) -> Any:
    """For Matplotlib: every ``step``-th pixel, red first."""
    return np.ascontiguousarray(image[::step, ::step, ::-1] if image.ndim == 3 else image[::step, ::step])


def outline(pose: Array, scale: float = 1.0) -> Array:
    """The frame's border on the map, with a notch that points forward, (n, 2)."""
    m, e = (FRAME - 1) / 2, FRAME - 1
    corners = np.array([[0, 0], [m - 25, 0], [m, -40], [m + 25, 0], [e, 0], [e, e], [0, e], [0, 0]])
    return np.column_stack([corners, np.ones(len(corners))]) @ frame_to_map(pose, scale).T


def draw_map(ax: Any, title: str = " ", faint: bool = False) -> Any:
    """The map with its pixels as axes; returns the title.  ``faint`` leaves the detail to what is drawn on it, and
    makes a published frame a third as large."""
    sea = seafloor.load()
    if faint:
        sea = 255 - (255 - cv2.resize(sea, None, fx=1 / 6, fy=1 / 6, interpolation=cv2.INTER_AREA)) // 2
    ax.imshow(rgb(sea, 1 if faint else 2), extent=(-0.5, 2559.5, 799.5, -0.5), interpolation="bilinear")
    ax.set(xlim=(0, 2560), ylim=(800, 0), xlabel="u, east [px]", ylabel="v, south [px]")
    ax.grid(visible=False)
    return ax.set_title(title)


def bare(ax: Any) -> Any:
    """An axes without ticks, grid or frame."""
    ax.set(xticks=[], yticks=[])
    ax.grid(visible=False)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def frames_beside_map(frames: Sequence[Any], names: Sequence[str]) -> Figure:
    """Frames in a row, the map below them."""
    figure = plotting.figure(7.2, 5.2)
    panels: Any = figure.subfigures(2, 1, height_ratios=[1.1, 1])
    for ax, frame, name in zip(plotting.axes(panels[0], 1, len(frames)), frames, names, strict=True):
        bare(ax).imshow(rgb(frame))
        ax.set_title(name, loc="center")
    draw_map(plotting.axes(panels[1]), "the map, 2560 × 800 pixels")
    return figure


def alive(cloud: Particles) -> float:
    """The cloud's effective sample size."""
    return particles.effective_sample_size(cloud.weights)


def ratio_test(found: Ratios, frame: Any, threshold: float = 0.75) -> Figure:
    """Left, features of a frame with their sizes and directions; right, distance ratios of right and wrong pairs."""
    figure = plotting.figure(7.4, 3.5)
    left, right = plotting.axes(figure, 1, 2, width_ratios=[1, 1.25])
    bare(left).imshow(rgb(frame)[100:300, 100:300], extent=(99.5, 299.5, 299.5, 99.5))
    left.set(xlim=(100, 300), ylim=(300, 100))
    left.set_title("SIFT: place, size and direction", fontsize=10.5)
    inside = [k for k in found.keypoints if 110 < k.pt[0] < 290 and 110 < k.pt[1] < 290]
    for k in sorted(inside, key=lambda k: -k.size)[:40]:
        (u, v), r, a = k.pt, k.size / 2, np.radians(k.angle)
        left.add_patch(Circle((u, v), r, fill=False, color=plotting.HIGHLIGHT, lw=1.4))
        left.plot([u, u + r * np.cos(a)], [v, v + r * np.sin(a)], color=plotting.HIGHLIGHT, lw=1.4)
    ratio, is_right = found.nearest / found.second, found.is_right
    bins = np.linspace(0, 1, 26)
    shades = {"right place": plotting.BAND, "wrong place": plotting.MEASUREMENT}
    right.hist([ratio[is_right], ratio[~is_right]], bins, stacked=True, color=list(shades.values()), label=list(shades))
    right.axvline(threshold, color=plotting.TRUTH, ls="--", lw=1.2)
    right.set(xlabel="distance to the nearest / to the second nearest", ylabel="features of the frame")
    kept = ratio < threshold
    below, above = (100 * is_right[some].mean() for some in (kept, ~kept))
    right.set_title(f"Below {threshold}: {below:.0f} % right. Above: {above:.0f} % right")
    right.title.set_fontsize(10.5)
    right.legend(loc="upper left")
    return figure


def consensus(pairs: Array, agree: Any, homography: Array, fix: Fix) -> Figure:
    """Left, pairs that agree and pairs that do not; right, the frame's corners by eight and by four parameters."""
    figure = plotting.figure(7.6, 3.6)
    left, right = plotting.axes(figure, 1, 2, width_ratios=[1.5, 1])
    draw_map(left, f"RANSAC: {agree.sum()} of {len(pairs)} pairs agree", faint=True)
    left.title.set_fontsize(10.5)
    M, shift = fix.homography[:2, :2], fix.homography[:2, 2]
    for ok, colour, width in ((False, plotting.MEASUREMENT, 1.0), (True, plotting.BAND, 0.5)):
        ends = np.stack([pairs[agree == ok, :2] @ M.T + shift, pairs[agree == ok, 2:]], axis=1)
        left.add_collection(LineCollection(list(ends), colors=colour, linewidths=width, alpha=0.7))
        left.plot(*ends[:, 1].T, ".", color=colour, ms=3.5, label="pair agrees" if ok else "pair disagrees")
    left.plot(*outline(fix.pose, fix.scale).T, color=plotting.ESTIMATE, lw=1.8)
    e = FRAME - 1
    corners = np.array([[0.0, 0], [e, 0], [e, e], [0, e], [0, 0]])
    four = corners @ M.T + shift
    bent = 100 * (project(homography, corners) - four)
    right.plot(*four.T, color=plotting.ESTIMATE, lw=1.8, label="4 parameters")
    right.plot(*(four + bent).T, color=plotting.MEASUREMENT, lw=1.4, ls="--", label="8 parameters, bend × 100")
    right.set(aspect="equal", xlabel="u, east [px]", ylabel="v, south [px]")
    right.invert_yaxis()
    worst = np.hypot(*bent.T).max() / 100
    right.set_title(f"The homography bends a corner by {worst:.1f} px", fontsize=10.5)
    figure.legend(loc="outside lower center", ncols=5, fontsize=9)
    return figure


def geometry() -> Figure:
    """One frame on the map: its middle (x, y), the yaw ψ, one point as q in the frame and as m on the map."""
    figure = plotting.figure(6.4, 3.7)
    ax = plotting.axes(figure)
    ax.set(xlim=(-5, 100), ylim=(66, -6), aspect="equal", xticks=[], yticks=[])
    ax.grid(visible=False)
    for spine in ax.spines.values():
        spine.set_visible(False)
    ink = {"color": plotting.TRUTH, "fontsize": 12}
    arrow = {"arrowstyle": "-|>", "color": plotting.TRUTH, "lw": 1.4}
    ax.annotate("", (97, 0), (0, 0), arrowprops=arrow)
    ax.annotate("", (0, 63), (0, 0), arrowprops=arrow)
    ax.text(97, -2.5, "$u$, east", ha="right", **ink)
    ax.text(1.5, 63, "$v$, south", **ink)
    middle, yaw, half = np.array([50.0, 36.0]), np.radians(35), 17.0
    ahead, aside = np.array([np.sin(yaw), -np.cos(yaw)]), np.array([np.cos(yaw), np.sin(yaw)])
    square = middle + half * np.array([-aside + ahead, aside + ahead, aside - ahead, -aside - ahead, -aside + ahead])
    ax.plot(*square.T, color=plotting.ESTIMATE, lw=2)
    tip = middle + 27 * ahead
    ax.annotate("", tip, middle, arrowprops={"arrowstyle": "-|>", "color": plotting.ESTIMATE, "lw": 1.8})
    ax.text(tip[0] + 1, tip[1] - 1, "forward: up in the frame", color=plotting.ESTIMATE, fontsize=10.5)
    ax.plot([middle[0]] * 2, [middle[1], middle[1] - 24], color=plotting.WALL, ls=":", lw=1.4)
    ax.text(middle[0] - 1, middle[1] - 25, "north", color=plotting.WALL, fontsize=10.5, ha="right")
    ax.add_patch(Arc(tuple(middle), 32, 32, theta1=-90, theta2=-90 + np.degrees(yaw), color=plotting.TRUTH, lw=1.4))
    ax.text(middle[0] + 2.4, middle[1] - 10.5, r"$\psi$", **ink)
    ax.plot(*middle, "o", color=plotting.TRUTH, ms=6)
    ax.text(middle[0] + 2.5, middle[1] + 0.6, "$(x, y)$", **ink)
    point = middle + 10 * aside - 9 * ahead
    ax.annotate("", point, middle, arrowprops={"arrowstyle": "-|>", "color": plotting.MEASUREMENT, "lw": 1.6})
    ax.text(
        *(0.5 * (middle + point) + [1.5, -1.0]), r"$s\,R(\psi)\,\mathbf{q}$", color=plotting.MEASUREMENT, fontsize=11
    )
    ax.plot(*point, "o", color=plotting.MEASUREMENT, ms=6)
    ax.text(point[0] + 2, point[1] + 3, r"$\mathbf{m}$", color=plotting.MEASUREMENT, fontsize=12)
    ax.annotate("", point, (0, 0), arrowprops={"arrowstyle": "-|>", "color": plotting.ODOMETRY, "lw": 0.9, "ls": "--"})
    ax.set_title(
        "The frame's middle, plus the arrow $\\mathbf{q}$ turned by ψ and scaled by $s$, is the point $\\mathbf{m}$",
        fontsize=10,
    )
    return figure


def prediction_as_a_sum() -> Figure:
    """In one dimension: two particles' bells, their sum, and a narrow fix beside them, with the worked example's x."""
    figure = plotting.figure(7.0, 3.2)
    ax = plotting.axes(figure)
    x = np.linspace(-3.5, 7.5, 600)
    bells = [w * np.exp(-0.5 * (x - f) ** 2) / np.sqrt(2 * np.pi) for f, w in ((0.0, 0.75), (4.0, 0.25))]
    for bell, name in zip(bells, ("0.75 × bell of particle 1", "0.25 × bell of particle 2"), strict=True):
        ax.plot(x, bell, color=plotting.PREDICTION, lw=1.4, ls="--", label=name)
    ax.plot(x, sum(bells), color=plotting.PREDICTION, lw=2.4, label="their sum, the prediction $p(x)$")
    fix = 0.06 * np.exp(-0.5 * ((x - 1) / 0.12) ** 2) / (np.sqrt(2 * np.pi) * 0.12)
    ax.fill_between(x, fix, color=plotting.MEASUREMENT, alpha=0.35, lw=0, label="the fix $g(x)$, scaled down")
    height = 0.75 * np.exp(-0.5) / np.sqrt(2 * np.pi) + 0.25 * np.exp(-4.5) / np.sqrt(2 * np.pi)
    ax.plot([1], [height], "o", color=plotting.TRUTH, ms=7)
    ax.annotate(f"$p(1) = {height:.4f}$", (1, height), xytext=(1.35, height + 0.02), fontsize=11)
    ax.set(xlabel="x [px]", ylabel="density [1/px]", ylim=(0, 0.42), xlim=(-3.5, 7.5))
    ax.set_title("The prediction of a cloud is a sum of bells, one for each particle", fontsize=11)
    ax.legend(loc="upper right", fontsize=9)
    return figure


def weight_dots(ax: Any, offsets: Array, cloud: Particles) -> Any:
    """Dots whose area and opacity grow with their weight: one that has next to none is a faint speck."""
    relative = cloud.weights / cloud.weights.max()
    dots = ax.scatter(*offsets.T, lw=0)
    dots.set(sizes=4 + 26 * np.sqrt(relative), facecolors=weight_colours(relative))
    return dots


def weight_colours(relative: Array) -> Array:
    """RGBA in the estimate's colour, opacity by weight relative to the heaviest; never quite invisible, (n, 4)."""
    colours = np.tile(to_rgba(plotting.ESTIMATE), (len(relative), 1))
    colours[:, 3] = 0.06 + 0.74 * np.sqrt(relative)
    return colours


def starving(clouds: dict[str, Particles], fix: Gaussian, truth: Array) -> Figure:
    """Clouds after one fix, above as wide as the motion made them, below as narrow as the fix is."""
    figure = plotting.figure(7.4, 5.0)
    rows = plotting.axes(figure, 2, len(clouds))
    for row, reach in zip(rows, (8.0, 0.2), strict=True):
        for ax, (name, cloud) in zip(row, clouds.items(), strict=True):
            offsets = cloud.states[:, :2] - truth[:2]
            weight_dots(ax, offsets, cloud)
            ax.plot(*((fix.mean - truth)[:2] + ellipse(fix.cov[:2, :2])).T, color=plotting.MEASUREMENT, lw=1.4)
            ax.plot(*(visual.mean(cloud).mean - truth)[:2], "x", color=plotting.TRUTH, ms=8, mew=1.8)
            ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
            if reach > 1:
                ax.set_title(f"{name}\n{alive(cloud):.0f} of {len(cloud)} count", fontsize=10.5)
            elif not np.any(np.abs(offsets).max(axis=1) < reach):
                ax.text(0, -0.13, "no particle here", ha="center", fontsize=9.5)
        row[0].set_ylabel(f"north [px], × {8 / reach:.0f}")
    for ax in rows[1]:
        ax.set_xlabel("east of the truth [px]")
    return figure


def along_the_dive(error: Array, beliefs: Sequence[Gaussian], fixes: Sequence[Fix | Rejected], truth: Array) -> Figure:
    """The filter's error, what it claims, and the fixes' own error; grey where no picture matched."""
    figure = plotting.figure(7.2, 3.8)
    ax = plotting.axes(figure)
    k = np.arange(1, len(error) + 1)
    blind = k[[not fix for fix in fixes[1:]]]
    for frame in blind:
        ax.axvspan(frame - 0.5, frame + 0.5, color="#d9d9d9", lw=0)
    ax.text(blind.mean(), 1.1e3, "no picture matches", ha="center", va="top", fontsize=9.5)
    radius = [np.sqrt(5.99 * np.linalg.eigvalsh(b.cov[:2, :2])[1]) for b in beliefs]
    far = np.maximum(np.hypot(*error[:, :2].T), 1e-3)  # a lucky frame stays on the picture
    where = max(blind - 1, key=lambda i: far[i])
    ax.fill_between(k, 1e-3, radius, color=plotting.BAND, alpha=0.2, lw=0, label="filter's 95 % radius")
    apart = np.maximum(np.hypot(*pose_residual(poses_of(fixes), truth)[1:, :2].T), 1e-3)
    ax.plot(k, apart, "+", color=plotting.MEASUREMENT, label="fix")
    ax.plot(k, far, color=plotting.ESTIMATE, label="filter")
    ax.axvline(KIDNAPPED, color=plotting.TRUTH, lw=1, ls="--")
    ax.annotate("carried off", (KIDNAPPED, 1.1e3), xytext=(7, 0), textcoords="offset points", fontsize=9.5, va="top")
    ax.set(
        yscale="log", ylim=(8e-4, 2e3), xlim=(0.5, len(k) + 0.5), xlabel="frame", ylabel="distance from the truth [px]"
    )
    claims = f"where its 95 % radius is {radius[where]:.0f} px"
    ax.set_title(f"Largest error without matches: {far[where]:.0f} px, {claims}", fontsize=11)
    ax.legend(
        loc="upper left",
        bbox_to_anchor=(0.015, 0.98),
        handlelength=1.4,
        facecolor="white",
        frameon=True,
        edgecolor="none",
    )
    return figure
