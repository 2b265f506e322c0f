"""Lab 5's explorers: maps with their ellipses, who was taken for whom, and covariances that fill."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from coursekit.gaussian import ellipse, symmetrize
from coursekit.labs.lab05.figures import association_matrix, covariance_image, log_size, room
from coursekit.labs.lab05.runs import ARENA, Track, map_error, mapped, reported
from coursekit.slam import EkfSlam
from coursekit.slam.association import Euclidean, Mahalanobis
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed

RULES: dict[str, Any] = {
    **{f"{t:g} m": Euclidean(t) for t in (0.25, 0.5, 1.0, 1.6, 2.5)},
    "χ² gate 0.99": Mahalanobis(0.99),
}


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
            line.set_data(*(points[j] + shape).T) if len(shape) else line.set_data([], [])


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
        track = mapped(RULES[rule], seed=lab_seed(5), path=path, laps=laps, start=start)
        self.map.show(track, len(track.means) - 1)
        self.counts.set_data(np.log10(1 + association_matrix(track)[:, :12]))
        for title, text in zip((self.title, self.words), self.results(track), strict=True):
            title.set_text(text)

    @staticmethod
    def results(track: Track) -> tuple[str, str]:
        """How good the map is, and how many mistakes of association are in it."""
        found, error = map_error(track.landmarks)
        size, counts = len(track.landmarks), association_matrix(track)
        mixed, doubled = (int(np.sum(np.count_nonzero(counts, axis=axis) > 1)) for axis in (0, 1))
        return f"{size} landmark{'s' * (size != 1)}, {found} of 8 tags found, {_length(error)} off", (
            f"{mixed} landmark{' stands' if mixed == 1 else 's stand'} for several tags" if mixed
            else f"{doubled} tag{' has' if doubled == 1 else 's have'} several landmarks" if doubled
            else "each landmark stands for one tag"
        )  # fmt: skip

    @staticmethod
    def said(rule: str, path: str, laps: int, start: str) -> str:
        """What a frame shows, with its result."""
        quality, mistakes = Rules.results(mapped(RULES[rule], seed=lab_seed(5), path=path, laps=laps, start=start))
        return f"A map with {quality}; {mistakes}"


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
        track, k = self.reached(time, path, jacobians)
        self.map.show(track, k)
        self.image.set_data(log_size(track.covs[k]))
        for title, text in zip((self.title, self.words), self.results(track, k), strict=True):
            title.set_text(text)

    @staticmethod
    def reached(time: float, path: str, jacobians: str) -> tuple[Track, int]:
        """The drive, and its last look by then."""
        track = (
            mapped(RULES["χ² gate 0.99"], lab_seed(5), path, kind=EkfSlam)
            if jacobians == "derived"
            else reported(1.6, lab_seed(5), path, 2)
        )
        return track, min(int(np.searchsorted(track.time, time + 1e-9)), len(track.time) - 1)

    @staticmethod
    def results(track: Track, k: int) -> tuple[str, str]:
        """How good map and pose are after look k, and how large the covariance has become."""
        error = float(np.hypot(*(track.poses[k] - track.truth[k])[:2]))
        landmarks = (len(track.means[k]) - 3) // 2
        largest = float(np.diag(track.covs[k])[3:].max(initial=0.0))
        size = f"{largest:.0f} m²" if largest >= 1 else f"({1000 * np.sqrt(largest):.1f} mm)²"
        return (
            f"{landmarks} landmark{'s' * (landmarks != 1)}; the robot is {_length(error)} off",
            f"largest variance {size}" if landmarks else "no landmark yet",
        )

    @staticmethod
    def said(time: float, path: str, jacobians: str) -> str:
        """What a frame shows, with its result."""
        quality, size = OverTime.results(*OverTime.reached(time, path, jacobians))
        return f"The map so far has {quality}; beside it the covariance, {size}"


def _length(metres: float) -> str:
    return f"{1000 * metres:.0f} mm" if metres < 0.1 else f"{metres:.2f} m"
