"""Lab 6's report: its clouds, its transform, its two numbers, and the error over the iterations."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from coursekit import icp, plotting
from coursekit.datasets import DatasetUnavailable, load
from coursekit.geometry import Array, so3_exp
from coursekit.recordings import Clouds

REACH = 0.25  # pairs further apart than this do not count, m: the assignment's number
PUBLISHED = np.array(
    [
        [0.947817, -0.125278, -0.293168, 0.483643],
        [0.196485, 0.953703, 0.227703, -0.248299],
        [0.251068, -0.273425, 0.928550, 0.255736],
        [0.0, 0.0, 0.0, 1.0],
    ]
)


def clouds() -> tuple[Clouds, bool]:
    """The report's two clouds and True; where they cannot be had, a stand-in with the same motion, and False."""
    try:
        return load("icp_clouds"), True
    except DatasetUnavailable:
        rng = np.random.default_rng(6)
        x = rng.normal(size=(5750, 3))
        x /= np.linalg.norm(x, axis=1)[:, None]
        lumps = 1 + 0.35 * np.sin(3 * x[:, 0] + 1) * np.cos(2 * x[:, 1]) + 0.4 * np.maximum(x[:, 2], 0) ** 2
        lumps += 0.25 * np.sin(4 * x[:, 1] * x[:, 2] + x[:, 0])
        source = x * lumps[:, None] * [0.2, 0.4, 0.3] + [0.22, 0.5, 0.35]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = so3_exp([-0.2, -0.16, 0.13]), [0.5, -0.3, 0.3]
        return Clouds(source, icp.move(T, source) + rng.normal(0, 0.0043, source.shape)), False


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
    ax.set_title("RMSE [m]: thirty were not enough", loc="left")
    gap.plot(1000 * np.asarray(gaps), color=plotting.TRUTH)
    nearest = int(np.argmin(gaps))
    gap.plot(nearest, 1000 * gaps[nearest], "o", color=plotting.MEASUREMENT)
    gap.annotate(f"iteration {nearest}: {1000 * gaps[nearest]:.1f} mm", (nearest, 1000 * gaps[nearest]), (2, 1.1),
                 color=plotting.MEASUREMENT)  # fmt: skip
    gap.set(yscale="log", xlabel="iteration", ylim=(0.8, 1000))
    gap.set_title("from the published place [mm]", loc="left")
    return fig


def search_times(sizes: Sequence[int], repeats: int = 3) -> dict[str, list[float]]:
    """Seconds for one search of n points among n, by name of the search: the best of some repeats."""
    rng = np.random.default_rng(6)
    times: dict[str, list[float]] = {}
    searches: dict[str, Callable[[Array], icp.BruteForce | icp.KdTree]] = {
        "brute force": icp.BruteForce,
        "tree": icp.KdTree,
    }
    for name, search in searches.items():
        times[name] = []
        for n in sizes:
            target = rng.uniform(0, 1, (n, 3)) * [1, 1, 0.02]
            points, best = target + rng.normal(0, 0.004, target.shape), np.inf
            for _ in range(repeats):
                start = time.perf_counter()
                search(target).nearest(points, REACH)
                best = min(best, time.perf_counter() - start)
            times[name].append(best)
    return times
