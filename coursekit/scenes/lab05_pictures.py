"""Lab 5's pictures: maps with their ellipses, who was taken for whom, covariances that fill, thresholds that fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coursekit import plotting
from coursekit.association import Euclidean, Mahalanobis
from coursekit.gaussian import ellipse, symmetrize
from coursekit.geometry import Array
from coursekit.scenes import lab05
from coursekit.scenes.lab05 import ARENA, TAGS, Track
from coursekit.world.tags import Detection

MAGNIFIED = 10  # so much larger are ellipses drawn: at true size they would hide behind a dot
SHOWN = 19  # rows of a covariance: a pose and eight landmarks
RULES: dict[str, Any] = {
    **{f"{t:g} m": Euclidean(t) for t in (0.25, 0.5, 1.0, 1.6, 2.5)},
    "χ² gate 0.99": Mahalanobis(0.99),
}


def room(ax: Axes) -> None:
    """The tags, each with its id, on fixed axes."""
    for tag, (x, y) in zip(ARENA.tags, TAGS, strict=True):
        half = np.array([-np.sin(tag.yaw), np.cos(tag.yaw)]) * tag.size
        ax.plot(*np.stack([tag.position - half, tag.position + half]).T, color=plotting.TRUTH, lw=4, zorder=1)
        behind = -0.24 * np.array([np.cos(tag.yaw), np.sin(tag.yaw)])
        ax.annotate(str(tag.id), (x + behind[0], y + behind[1]), ha="center", va="center", fontsize=9)
    ax.set(xlim=(-2.4, 3.4), ylim=(-2.3, 2.3), xlabel="x [m]", ylabel="y [m]")
    ax.set_aspect("equal")


class _Map:
    """Truth, track, landmarks and their ellipses, to be moved."""

    def __init__(self, ax: Axes, landmarks: int = 30) -> None:
        room(ax)
        (self.truth,) = ax.plot([], [], color=plotting.TRUTH, lw=1, label="truth")
        (self.track,) = ax.plot([], [], color=plotting.ESTIMATE, lw=1.2, label="estimate")
        (self.landmarks,) = ax.plot([], [], "o", color=plotting.ESTIMATE, ms=4)
        self.ellipses = [ax.plot([], [], color=plotting.ESTIMATE, lw=1)[0] for _ in range(landmarks)]
        self.moving: list[Artist] = [self.truth, self.track, self.landmarks, *self.ellipses]

    def show(self, track: Track, k: int) -> None:
        """What was believed after look k."""
        self.truth.set_data(*track.truth[: k + 1, :2].T)
        self.track.set_data(*track.poses[: k + 1, :2].T)
        mean, cov = track.means[k], track.covs[k]
        points = mean[3:].reshape(-1, 2)
        self.landmarks.set_data(*points.T)
        for j, line in enumerate(self.ellipses):
            a = 3 + 2 * j
            shape = ellipse(symmetrize(cov[a : a + 2, a : a + 2])) if j < len(points) else np.empty((0, 2))
            line.set_data(*(points[j] + MAGNIFIED * shape).T) if len(shape) else line.set_data([], [])


class Rules:
    """The map at a drive's end, and which tag was taken for which landmark, while rule, path, laps and start change."""

    def __init__(self) -> None:
        self.figure = plotting.figure(7.8, 4.2)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1.35, 1])
        self.map = _Map(axes[0])
        self.title, self.words = axes[0].set_title(" "), axes[1].set_title(" ")
        self.counts = axes[1].imshow(np.zeros((8, 12)), cmap="Blues", vmin=0, vmax=2, aspect="auto", animated=True)
        axes[1].set(xticks=range(12), xticklabels=range(1, 13),
                    yticks=range(8), yticklabels=[tag.id for tag in ARENA.tags],
                    xlabel="landmark of the map", ylabel="tag that was seen")  # fmt: skip
        axes[1].grid(visible=False)
        self.moving: list[Artist] = [*self.map.moving, self.title, self.words, self.counts]

    def update(self, rule: str, path: str, laps: int, start: str) -> None:
        """A rule of ``RULES``, the path, one or two laps, and where the robot begins."""
        track = lab05.mapped(RULES[rule], seed=1, path=path, laps=laps, start=start)
        self.map.show(track, len(track.means) - 1)
        found, error = lab05.map_error(track.landmarks)
        size = len(track.landmarks)
        self.title.set_text(f"{size} landmark{'s' * (size != 1)}, {found} of 8 tags found, {_length(error)} off")
        counts = association_matrix(track)
        self.counts.set_data(np.log10(1 + counts[:, :12]))
        mixed, doubled = (int(np.sum(np.count_nonzero(counts, axis=axis) > 1)) for axis in (0, 1))
        self.words.set_text(
            f"{mixed} landmark{' stands' if mixed == 1 else 's stand'} for several tags" if mixed
            else f"{doubled} tag{' has' if doubled == 1 else 's have'} several landmarks" if doubled
            else "each landmark stands for one tag"
        )  # fmt: skip


class OverTime:
    """A drive as it goes: the map with its ellipses, and the covariance behind it."""

    TIMES = tuple(range(2, 52, 2))

    def __init__(self) -> None:
        self.figure = plotting.figure(7.8, 3.6)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1.35, 1])
        self.map = _Map(axes[0])
        self.title, self.words = axes[0].set_title(" "), axes[1].set_title(" ")
        self.image = covariance_image(axes[1], np.eye(3), animated=True)
        self.figure.colorbar(self.image, ax=axes[1], shrink=0.6, label="log₁₀ of an entry's size")
        self.moving: list[Artist] = [*self.map.moving, self.title, self.words, self.image]

    def update(self, time: float, path: str, jacobians: str) -> None:
        """Seconds since the start, the path, and whose filter: "derived" or "the report's"."""
        track = (
            lab05.mapped(RULES["χ² gate 0.99"], 1, path) if jacobians == "derived" else lab05.reported(1.6, 1, path, 2)
        )
        k = min(int(np.searchsorted(track.time, time + 1e-9)), len(track.time) - 1)
        self.map.show(track, k)
        error = float(np.hypot(*(track.poses[k] - track.truth[k])[:2]))
        landmarks = (len(track.means[k]) - 3) // 2
        self.title.set_text(f"{landmarks} landmark{'s' * (landmarks != 1)}; the robot is {_length(error)} off")
        self.image.set_data(_log_size(track.covs[k]))
        largest = float(np.diag(track.covs[k])[3:].max(initial=0.0))
        size = f"{largest:.0f} m²" if largest >= 1 else f"({1000 * np.sqrt(largest):.1f} mm)²"
        self.words.set_text(f"largest variance {size}" if landmarks else "no landmark yet")


def association_matrix(track: Track) -> Array:
    """How often each tag (row) was taken for each landmark (column)."""
    ids, chosen = (np.concatenate([pair[i] for pair in track.taken_for]) for i in (0, 1))
    rows = (ids[:, None] == [tag.id for tag in ARENA.tags]) & (chosen[:, None] >= 0)
    columns = chosen[:, None] == np.arange(max(len(track.landmarks), 12))
    return np.asarray(rows.astype(float).T @ columns)


def covariance_image(ax: Axes, cov: Array, **style: Any) -> Any:
    """The sizes of a covariance's entries as colours, on a fixed raster: the pose first, then landmark by landmark."""
    image = ax.imshow(_log_size(cov), cmap="viridis", vmin=-8, vmax=3, **style)
    ax.set(xticks=[1, *range(4, SHOWN, 4)], yticks=[1, *range(4, SHOWN, 4)])
    names = ["pose", *(f"$l_{{{i}}}$" for i in range(1, 9, 2))]
    ax.set_xticklabels(names)
    ax.set_yticklabels(names)
    ax.grid(visible=False)
    return image


def correlation_figure(track: Track, looks: Sequence[int]) -> Figure:
    """Correlations of pose and landmarks after some of the looks."""
    fig = plotting.figure(7.8, 3.0)
    axes: Any = plotting.axes(fig, 1, len(looks))
    for ax, k in zip(axes, looks, strict=True):
        s = np.sqrt(np.diag(track.covs[k]))
        image = ax.imshow(np.abs(track.covs[k] / np.outer(s, s)), cmap="magma", vmin=0, vmax=1)
        ax.set_title(f"{track.time[k]:.0f} s, {(len(s) - 3) // 2} landmarks")
        ax.set(xticks=[], yticks=[], xlabel="pose, landmarks")
        for at in range(3, len(s), 2):
            ax.axhline(at - 0.5, color="white", lw=0.4)
            ax.axvline(at - 0.5, color="white", lw=0.4)
        ax.grid(visible=False)
    fig.colorbar(image, ax=list(axes), shrink=0.8, label="|correlation|")
    return fig


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
    closed = next(i for i in range(1, len(known)) if lately[i] < 0.5 * lately[i - 1])
    at = 0.5 * (track.time[known[closed - 1]] + track.time[known[closed]])
    ax.axvline(at, color=plotting.TRUTH, lw=1, ls=":")
    ax.annotate("loop closure", (at, 100), xytext=(5, 0), textcoords="offset points", va="top", fontsize=9)
    ax.set(yscale="log", xlabel="time [s]", ylabel="σ in the worst direction [mm]", xlim=(0, track.time[-1]))
    ax.set(ylim=(0.3, 110), yticks=[0.5, 1, 2, 5, 10, 20, 50, 100])
    ax.minorticks_off()
    ax.yaxis.set_major_formatter("{x:g}")
    ax.legend(loc="lower right")
    return fig


def sweep_figure(
    thresholds: Sequence[float], counts: Mapping[str, Mapping[str, Array]], gates: Mapping[str, Array]
) -> Figure:
    """Landmarks in the map against the threshold in metres, beside the same with a gate.

    counts : path → name → (thresholds, seeds); gates : path → (gates, seeds).
    """
    fig = plotting.figure(7.8, 3.7)
    axes: Any = plotting.axes(fig, 1, 2 * len(counts), sharey=True, width_ratios=[2.1, 1] * len(counts))
    for left, right, (path, rows) in zip(axes[::2], axes[1::2], counts.items(), strict=True):
        for (name, values), colour in zip(rows.items(), (plotting.MEASUREMENT, plotting.HIGHLIGHT), strict=False):
            left.plot(thresholds, values.mean(axis=1), "o-", color=colour, lw=1.2, ms=4, label=name)
        right.plot(range(len(gates[path])), gates[path].mean(axis=1), "o", color=plotting.ESTIMATE, ms=6)
        for ax in (left, right):
            ax.axhline(8, color=plotting.BAND, lw=1.2, label="as many as tags", zorder=1)
        left.set(title=path, xlabel="threshold [m]", yscale="log", ylim=(2, 90), yticks=[2, 4, 8, 16, 32, 64])
        left.set_xticks(thresholds, [f"{t:g}" for t in thresholds], fontsize=8.5)
        left.yaxis.set_major_formatter("{x:g}")
        left.minorticks_off()
        right.set(xlim=(-0.6, len(gates[path]) - 0.4), xlabel="χ² gate [%]")
        right.set_xticks(range(3), ["90", "99", "99.9"], fontsize=8.5)
        right.minorticks_off()
    axes[0].set_ylabel("landmarks in the map")
    axes[0].legend(loc="upper right", fontsize=8.5)
    return fig


def comparison_figure(errors: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Mean landmark error of each run, in millimetres: one panel for each question, a bar at the median."""
    fig = plotting.figure(7.8, 3.3)
    axes: Any = plotting.axes(fig, 1, len(errors), sharey=True, width_ratios=[len(e) for e in errors.values()])
    for ax, (question, groups) in zip(axes, errors.items(), strict=True):
        for x, values in enumerate(groups.values()):
            spread = x + np.linspace(-0.14, 0.14, len(values))
            ax.plot(spread, 1000 * np.array(values), "o", color=plotting.ESTIMATE, ms=4, alpha=0.7)
            ax.plot([x - 0.28, x + 0.28], [1000 * np.median(values)] * 2, color=plotting.TRUTH, lw=1.6)
        ax.set_xticks(range(len(groups)), ["\n".join(name.rsplit(" ", 1)) for name in groups], fontsize=8.5)
        ax.set(title=question, xlim=(-0.5, len(groups) - 0.5), yscale="log")
        ax.yaxis.set_major_formatter("{x:g}")
    axes[0].set(ylabel="mean landmark error [mm]")
    return fig


def _log_size(cov: Array) -> Array:
    """log₁₀ of the entries' sizes on the raster; NaN where there is nothing, the least colour where there is a zero."""
    out, n = np.full((SHOWN, SHOWN), np.nan), min(len(cov), SHOWN)
    out[:n, :n] = np.log10(np.maximum(np.abs(cov[:n, :n]), 1e-12))
    return out


def _length(metres: float) -> str:
    return f"{1000 * metres:.0f} mm" if metres < 0.1 else f"{metres:.2f} m"
