"""Lab 4's pictures: the geometry, the corridor, one update as contours, and the strips that judge a filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from coursekit.gaussian import Gaussian, chi2_band, ellipse
from coursekit.geometry import Array
from coursekit.labs.lab04.runs import LANDMARKS, ROOM, Drives, Tracks
from coursekit.teaching import plotting


def two_filters(drives: Drives, filters: dict[str, Tracks]) -> Figure:
    """One drive, as each filter sees it: its track, its ellipses, and the truth at their moments."""
    fig = plotting.figure(7.8, 3.9)
    for ax, (name, tracks) in zip(plotting.axes(fig, 1, 2, sharey=True), filters.items(), strict=True):
        ax.plot(*LANDMARKS[: drives.z.shape[2]].T, "s", color=plotting.WALL, ms=7, label="landmark")
        ax.plot(*drives.truth[0, :, :2].T, color=plotting.TRUTH, lw=1.0, label="truth")
        ax.plot(*drives.truth[0, 0, :2], "o", color=plotting.TRUTH, mfc="white", ms=6, label="start")
        ax.plot(*tracks.mean[0, :, :2].T, color=plotting.ESTIMATE, lw=1.0, label="estimate")
        inside = 0
        shown = range(5, tracks.mean.shape[1], 8)
        for k in shown:
            line = plotting.draw_ellipse(ax, tracks.mean[0, k], tracks.cov[0, k], lw=1.2)
            line.set_label("95 % claim" if k == 5 else "_")
            error = drives.truth[0, k + 1, :2] - tracks.mean[0, k, :2]
            inside += bool(error @ np.linalg.solve(tracks.cov[0, k, :2, :2], error) < 5.99)
            ax.plot(*drives.truth[0, k + 1, :2], ".", color=plotting.TRUTH, ms=5)
        ax.set_aspect("equal")
        ax.set(xlim=(-1.7, 3.7), ylim=(-2.6, 2.0), xlabel="x [m]")
        ax.set_title(f"{name}: truth in {inside} of {len(shown)} ellipses")
    fig.axes[0].set_ylabel("y [m]")
    fig.legend(*fig.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return fig


def geometry() -> Figure:
    """The robot, one landmark, and every symbol of h."""
    fig = plotting.figure(6.6, 3.9)
    ax = plotting.axes(fig)
    x, y, theta, lx, ly = 1.0, 0.8, 0.45, 4.0, 3.0
    line: dict[str, Any] = {"color": plotting.WALL, "lw": 1.0}
    ax.plot([x, lx], [y, ly], color=plotting.MEASUREMENT, lw=2)
    ax.plot([x, lx, lx], [y, y, ly], ls=":", **line)
    ax.plot([x, x + 2.3 * np.cos(theta)], [y, y + 2.3 * np.sin(theta)], ls="--", color=plotting.ESTIMATE, lw=1.4)
    plotting.draw_robot(ax, [x, y, theta], size=0.5)
    ax.plot(lx, ly, "s", color=plotting.WALL, ms=10)
    toward = np.degrees(np.arctan2(ly - y, lx - x))
    for radius, low, high, colour in (
        (1.9, 0.0, np.degrees(theta), plotting.ESTIMATE),
        (1.45, np.degrees(theta), toward, plotting.MEASUREMENT),
    ):
        ax.add_patch(Arc((x, y), 2 * radius, 2 * radius, theta1=low, theta2=high, color=colour, lw=1.6))
    for text, at, colour in (
        (r"$\theta$", (3.03, 1.14), plotting.ESTIMATE),
        (r"$\varphi$", (2.36, 1.6), plotting.MEASUREMENT),
        ("$r$", (2.75, 2.25), plotting.MEASUREMENT),
        (r"$\Delta x = \ell_x - x$", (2.2, 0.53), plotting.WALL),
        (r"$\Delta y = \ell_y - y$", (4.08, 1.8), plotting.WALL),
        ("pose $(x, y, \\theta)$", (0.35, 0.38), plotting.TRUTH),
        (r"landmark $(\ell_x, \ell_y)$", (4.15, 2.95), plotting.TRUTH),
        ("heading", (3.1, 1.83), plotting.ESTIMATE),
    ):
        ax.text(*at, text, color=colour, fontsize=12)
    ax.set_aspect("equal")
    ax.set(xlim=(0, 6.2), ylim=(0.2, 3.4), xlabel="x [m]", ylabel="y [m]")
    ax.set_title("Range r and bearing φ from a pose to a landmark")
    return fig


def corridor(beliefs: Sequence[tuple[str, float, float]], measured: Sequence[float], truth: Sequence[float]) -> Figure:
    """A belief over several steps: rows of (name, mean, σ) in pairs predicted, corrected; one panel a step."""
    steps = len(measured)
    fig = plotting.figure(7.4, 4.2)
    axes: Any = plotting.axes(fig, steps + 1, 1, sharex=True)
    at = np.linspace(0, 6, 601)
    for k, ax in enumerate(axes):
        shown = beliefs[:1] if k == 0 else beliefs[2 * k - 1 : 2 * k + 1]
        for (name, mean, sigma), colour in zip(
            shown, (plotting.ODOMETRY,) if k == 0 else (plotting.PREDICTION, plotting.ESTIMATE), strict=True
        ):
            density = np.exp(-0.5 * ((at - mean) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
            ax.plot(at, density, color=colour, lw=1.6, label=f"{name}: {mean:.2f} ± {sigma:.2f} m")
        if k:
            z = measured[k - 1]
            ax.plot(z, 0.1, "^", color=plotting.MEASUREMENT, ms=7, label=f"measured: {z:.2f} m")
        ax.axvline(truth[k], color=plotting.TRUTH, lw=1, ls="--", label="truth")
        ax.set(ylim=(0, 2.3), yticks=[0, 1, 2], ylabel="1/m", xlim=(0, 6))
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[-1].set_xlabel("position [m]")
    axes[0].set_title("Each step: the prediction is wider, the correction narrower")
    return fig


def update_as_contours(before: Gaussian, after: Gaussian, z: Array, R: Array, landmark: int) -> Figure:
    """Prior, likelihood and posterior over the plane, for one range to one landmark; heading known.

    Beside the exact band and the exact posterior stand what an EKF puts in their place: a straight band, an ellipse.
    """
    fig = plotting.figure(8.2, 3.6)
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 121), np.linspace(-1.5, 1.5, 121))
    points = np.stack([x, y], axis=-1)
    e = points - before.mean
    prior = -0.5 * np.sum(e * np.linalg.solve(before.cov, e[..., None])[..., 0], axis=-1)
    r = np.hypot(*np.moveaxis(LANDMARKS[landmark] - points, -1, 0))
    likelihood = -0.5 * (z[0] - r) ** 2 / R[0, 0]
    levels = [-0.5 * 5.99, -0.5 * 2.28, 0.0]  # how far a Gaussian's density falls at its 95 % and its 68 % ellipse
    panels = (("prior", prior, plotting.PREDICTION), ("likelihood of one range", likelihood, plotting.MEASUREMENT),
              ("posterior: their product", prior + likelihood, plotting.TRUTH))  # fmt: skip
    axes: Any = plotting.axes(fig, 1, 3, sharey=True)
    for ax, (name, density, colour) in zip(axes, panels, strict=True):
        ax.contourf(x, y, density - density.max(), levels=levels, colors=[colour], alpha=0.25)
        ax.contour(x, y, density - density.max(), levels=levels[:2], colors=[colour], linewidths=1)
        ax.set_aspect("equal")
        ax.set(title=name, xlabel="x [m]")
    away = before.mean - LANDMARKS[landmark]
    expected = np.hypot(*away)  # the range at the prior's mean, and its derivative there: a range made straight
    straight = -0.5 * (z[0] - expected - e @ (away / expected)) ** 2 / R[0, 0]
    axes[1].contour(x, y, straight, levels=levels[:1], colors=[plotting.ESTIMATE], linewidths=2, linestyles="solid")
    axes[1].plot(*before.mean, "+", color=plotting.PREDICTION, ms=10, mew=2)
    axes[2].plot(*(after.mean + ellipse(after.cov)).T, color=plotting.ESTIMATE, lw=2)
    axes[0].plot([], [], color=plotting.ESTIMATE, lw=2, label="EKF (outer line): the range made straight at +")
    axes[0].plot([], [], color=plotting.WALL, lw=1, ls="--", label="exact: levels of the 68 % and 95 % ellipse")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    axes[0].set_ylabel("y [m]")
    return fig


def strips(filters: dict[str, Tracks], dt: float) -> Figure:
    """NEES over time, averaged over each filter's drives, on its two-sided band; the average NIS in the title."""
    fig = plotting.figure(7.4, 0.5 + 1.3 * len(filters))
    axes: Any = plotting.axes(fig, len(filters), 1, sharex=True, sharey=True, squeeze=False)
    for ax, (name, tracks) in zip(axes.flat, filters.items(), strict=True):
        n, steps = tracks.nees.shape
        inside = plotting.consistency_strip(ax, dt * np.arange(1, steps + 1), tracks.nees.mean(axis=0), 3, n)
        score, surprise = tracks.nees.mean(), np.nanmean(tracks.nis)
        ax.set_title(f"{name}: NEES {score:.1f}, {100 * inside:.0f} % of steps inside; NIS {surprise:.1f}")
    for ax in axes[:-1].flat:
        ax.set_xlabel("")
    return fig


def seen(picture: Any, z: Array, pose: Array, drives: Drives, tracks: Tracks) -> Figure:
    """The camera's picture, and the drive that it is from."""
    fig = plotting.figure(8.2, 2.6)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.1, 1])
    left.imshow(picture[..., ::-1])
    left.set_axis_off()
    found = [f"{c.colour} {r:.2f} m" for c, (r, _) in zip(ROOM.cylinders, z, strict=True) if np.isfinite(r)]
    left.set_title("measured: " + (", ".join(found) or "nothing"))
    plotting.draw_arena(right, ROOM)
    right.plot(*drives.truth[0, :, :2].T, color=plotting.TRUTH, lw=1.2, label="truth")
    right.plot(*tracks.mean[0, :, :2].T, color=plotting.ESTIMATE, lw=1.2, label="estimate")
    right.plot(*drives.truth[0, 0, :2], "o", color=plotting.TRUTH, mfc="white", ms=6, label="start")
    plotting.draw_robot(right, pose, colour=plotting.HIGHLIGHT, size=0.4)
    right.set_title(f"RMS error {100 * np.sqrt(np.mean(tracks.error(drives) ** 2)):.1f} cm")
    right.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return fig


class Strips:
    """NEES over NIS, each averaged over N runs, on its two-sided 95 % band: they stand beside what can be moved."""

    def __init__(self, fig: Any, duration: float, dofs: tuple[int, int], runs: int, axes: Any = None) -> None:
        axes = plotting.axes(fig, 2, 1, sharex=True) if axes is None else axes
        self.bands = [chi2_band(dof, runs) for dof in dofs]
        for ax, dof, band, name in zip(axes, dofs, self.bands, ("NEES", "NIS"), strict=True):
            ax.axhspan(*band, color=plotting.BAND, alpha=0.25, lw=0)
            ax.axhline(dof, color=plotting.BAND, ls="--", lw=1)
            ax.set(xlim=(0, duration), ylim=(0.1, 100), yscale="log", ylabel=name)
            ax.set_yticks([0.1, 1, 10, 100], ["0.1", "1", "10", "100"])
        axes[-1].set_xlabel("time [s]")
        (self.nees,) = axes[0].plot([], [], color=plotting.ESTIMATE, lw=1.4)
        (self.nis,) = axes[1].plot([], [], ".", color=plotting.ESTIMATE, ms=4)
        self.titles = [ax.set_title(" ") for ax in axes]
        self.moving: list[Artist] = [self.nees, self.nis, *self.titles]

    def show(self, t: Any, scores: Any, surprises: Any, nis: float) -> None:
        """The averages at each time, NaN where nothing was measured; nis, the average over all measurements."""
        self.nees.set_data(t, np.clip(scores, 0.12, 85))
        self.nis.set_data(t[: len(surprises)], np.clip(surprises, 0.12, 85))
        low, high = self.bands[0]
        inside = np.mean((scores > low) & (scores < high))
        self.titles[0].set_text(f"NEES {np.mean(scores):.1f}; {100 * inside:.0f} % of steps inside")
        self.titles[1].set_text(f"NIS {nis:.1f}" if np.isfinite(nis) else "NIS: none yet")


def average_nis(nis: Array) -> Array:
    """The mean over all that was measured in a step, (N, n, L) → (n,); NaN for nothing."""
    counts = np.isfinite(nis).sum(axis=(0, 2))
    return np.divide(np.nansum(nis, axis=(0, 2)), counts, out=np.full(len(counts), np.nan), where=counts > 0)
