"""Lab 8's dives and its longer figures; the explorers live in ``lab08_explorers``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from coursekit import particles, plotting
from coursekit.gaussian import Gaussian, ellipse
from coursekit.geometry import Array
from coursekit.models import pose_residual
from coursekit.particles import Particles
from coursekit.results import Rejected
from coursekit.visual import (
    Fix,
    MapMatcher,
    image_from_odometry,
)
from coursekit.world import seafloor
from coursekit.world.seafloor import FRAME, Dive, dive, frame_to_map

WATER: dict[str, dict[str, float]] = {
    "clear": {"blur": 0.7, "noise": 4.0},
    "sun ripples": {"blur": 0.7, "noise": 4.0, "caustics": 0.35},
    "noisy": {"blur": 0.7, "noise": 30.0},
    "murky": {"blur": 9.0, "noise": 4.0},
}
PLACES = [
    (420.0, 400.0, 0.6), (640.0, 350.0, -2.2), (860.0, 430.0, 1.9), (1060.0, 380.0, 0.3), (1280.0, 400.0, 1.2),
    (1560.0, 420.0, -0.8), (1840.0, 360.0, 2.8), (2120.0, 430.0, -1.4),
]  # fmt: skip
KIDNAPPED = 52


def story() -> Dive:
    """The lab's dive: rocks, bare sand, rocks again; the swell carries the robot off before frame 52."""
    return dive(seafloor.load(), 64, 1, start=[880, 400, np.pi / 2], targets=[[1900, 400]], kidnap_at=KIDNAPPED)


def training() -> Dive:
    """A dive over rocks and weed, all frames of which match: what the motion is calibrated on."""
    return dive(seafloor.load(), 38, 3, start=[420, 380, 1.0], targets=[[820, 420], [600, 360], [500, 440]])


def look_at(dived: Dive, matcher: MapMatcher) -> list[Fix | Rejected]:
    """What the matcher says to every frame of a dive."""
    return [matcher.locate(dived.frame(k)) for k in range(len(dived))]


def poses_of(fixes: Sequence[Fix | Rejected]) -> Array:
    """The fixes in the odometry's frame, (n, 3); NaN where there was none."""
    return np.array([fix.belief.mean if isinstance(fix, Fix) else [np.nan] * 3 for fix in fixes])


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


def starving(clouds: dict[str, Particles], fix: Gaussian, truth: Array) -> Figure:
    """Clouds after one fix, close up and closer: dots as large as their weight, the fix's ellipse, the truth."""
    figure = plotting.figure(7.2, 3.2)
    panels, reaches = plotting.axes(figure, 1, len(clouds)), [8, 8, 0.25]
    for ax, (name, cloud), reach in zip(panels, clouds.items(), reaches, strict=True):
        sizes = np.clip(12 * len(cloud) * cloud.weights, 4, 500)
        offsets = cloud.states[:, :2] - truth[:2]
        ax.scatter(*offsets.T, s=sizes, color=plotting.ESTIMATE, alpha=0.45, lw=0)
        ax.plot(*(fix.mean - truth)[:2], "+", color=plotting.MEASUREMENT, ms=12, mew=1.8)
        ax.plot(*((fix.mean - truth)[:2] + ellipse(fix.cov[:2, :2])).T, color=plotting.MEASUREMENT, lw=1.2)
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="east of the truth [px]")
        closer = f" (magnified × {reaches[0] / reach:.0f})" if reach < reaches[0] else ""
        ax.set_title(f"{name}{closer}\n{alive(cloud):.0f} of {len(cloud)} count", fontsize=10)
    panels[0].set_ylabel("north of the truth [px]")
    return figure


def along_the_dive(error: Array, beliefs: Sequence[Gaussian], fixes: Sequence[Fix | Rejected], truth: Array) -> Figure:
    """The filter's error, what it claims, and the fixes' own error; grey where no picture matched."""
    figure = plotting.figure(7.2, 3.8)
    ax = plotting.axes(figure)
    k = np.arange(1, len(error) + 1)
    blind = k[[not fix for fix in fixes[1:]]]
    for frame in blind:
        ax.axvspan(frame - 0.5, frame + 0.5, color="#d9d9d9", lw=0)
    if len(blind):
        ax.text(blind.mean(), 1.1e3, "no picture matches", ha="center", va="top", fontsize=9.5)
    radius = [np.sqrt(5.99 * np.linalg.eigvalsh(b.cov[:2, :2])[1]) for b in beliefs]
    ax.fill_between(k, 1e-3, radius, color=plotting.BAND, alpha=0.2, lw=0, label="its 95 % radius")
    ax.plot(k, np.hypot(*pose_residual(poses_of(fixes), truth)[1:, :2].T), "+", color=plotting.MEASUREMENT, label="fix")
    ax.plot(k, np.hypot(*error[:, :2].T), color=plotting.ESTIMATE, label="filter")
    ax.axvline(KIDNAPPED, color=plotting.TRUTH, lw=1, ls="--")
    ax.annotate("carried off", (KIDNAPPED, 1.1e3), xytext=(7, 0), textcoords="offset points", fontsize=9.5, va="top")
    ax.set(
        yscale="log", ylim=(8e-4, 2e3), xlim=(0.5, len(k) + 0.5), xlabel="frame", ylabel="distance from the truth [px]"
    )
    ax.set_title("Blind over sand it drifts, and says so; carried off, it doubts one picture")
    ax.legend(
        loc="upper left",
        bbox_to_anchor=(0.015, 0.98),
        handlelength=1.4,
        facecolor="white",
        frameon=True,
        edgecolor="none",
    )
    return figure


def on_the_map(dived: Dive, beliefs: Sequence[Gaussian], fixes: Sequence[Fix | Rejected]) -> Figure:
    """The dive on the map: the truth, the fixes, the filter's estimate and its ellipses."""
    figure = plotting.figure(7.2, 2.9)
    ax = plotting.axes(figure)
    draw_map(ax, "Rocks, sand, rocks, and somewhere else: truth, fixes and estimate")
    parts = np.split(dived.poses, [KIDNAPPED])
    for part in parts:
        ax.plot(*part[:, :2].T, color=plotting.TRUTH, lw=3.5, alpha=0.55)
    estimate = image_from_odometry(np.array([b.mean for b in beliefs]))
    ax.plot(*estimate[2:, :2].T, ".", color=plotting.ESTIMATE, ms=4, label="filter")
    seen = np.array([fix.pose for fix in fixes if isinstance(fix, Fix)])
    ax.plot(*seen[:, :2].T, "+", color=plotting.MEASUREMENT, ms=5, label="fix")
    for belief in beliefs[2:KIDNAPPED:4]:
        u, v = (belief.mean[:2] + ellipse(belief.cov[:2, :2])).T
        ax.plot(u, -v, color=plotting.ESTIMATE, lw=1)
    ax.legend(loc="lower left", ncols=2, facecolor="white", frameon=True, framealpha=0.8, edgecolor="none")
    return figure
