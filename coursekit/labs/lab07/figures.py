"""Lab 7's pictures: a bent cloud, one step of the filter, error against particles, copies, and silence."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from coursekit import gaussian, particles
from coursekit.geometry import Array
from coursekit.labs.lab07.runs import BEACONS, FIX, LAB, planned_path
from coursekit.particles import Particles
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed


def banana(cloud: Particles, fix: Array) -> Figure:
    """Where the robot may be, the ellipse of its mean and covariance, and the fix that is about to arrive."""
    fig = plotting.figure(7.2, 4.2)
    ax = plotting.axes(fig)
    ax.plot(*planned_path(10)[:, :2].T, color=plotting.ODOMETRY, lw=1, ls="--", label="path of perfect wheels")
    ax.plot(*cloud.states[:, :2].T, ".", color=plotting.PREDICTION, ms=2, alpha=0.4)
    ax.plot([], [], "o", color=plotting.PREDICTION, ms=4, label=f"{len(cloud)} guesses after 10 s")
    ax.plot(*cloud_ellipse(cloud).T, color=plotting.TRUTH, lw=1.4, label="95 % ellipse of their covariance")
    ax.plot(*(fix + gaussian.ellipse(FIX.R)).T, color=plotting.MEASUREMENT, label="the fix, 95 %")
    ax.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", xlim=(-3.0, 3.7), ylim=(-0.3, 4.3))
    ax.set_title("How many of these guesses survive the fix?", loc="left")
    fig.legend(loc="outside lower center", ncols=2)
    return fig


def one_step() -> Figure:
    """Four particles on a line go through one step, with the names that the derivation uses: the hand example."""
    before, after, z = np.array([-0.8, 0.1, 0.9, 3.1]), np.array([0.0, 1.0, 2.0, 4.0]), 2.0
    likelihood = np.exp(-0.5 * (z - after) ** 2)
    w = likelihood / likelihood.sum()
    fig = plotting.figure(7.4, 4.4)
    ax = plotting.axes(fig)
    levels = {"start": 3.0, "predict": 2.0, "weigh": 1.0, "resample": 0.0}
    for y in levels.values():
        ax.axhline(y, color=plotting.ODOMETRY, lw=0.6, zorder=0)
    ax.plot(before, np.full(4, 3.0), "o", color=plotting.ODOMETRY, ms=9)
    for i, (a, b) in enumerate(zip(before, after)):
        ax.annotate("", (b, 2.06), (a, 2.93), arrowprops={"arrowstyle": "->", "color": plotting.PREDICTION, "lw": 1.4})
        ax.text(a, 3.14, rf"$x_{{k-1}}^{{({i + 1})}}$", ha="center", fontsize=11)
    ax.plot(after, np.full(4, 2.0), "o", color=plotting.PREDICTION, ms=9)
    x = np.linspace(-1.2, 5.0, 300)
    ax.plot(x, 1.0 + 0.72 * np.exp(-0.5 * (z - x) ** 2), color=plotting.MEASUREMENT)
    ax.plot([z, z], [1.0, 1.72], ":", color=plotting.MEASUREMENT)
    ax.text(z + 0.07, 1.78, "$z_k$", color=plotting.MEASUREMENT, fontsize=12)
    ax.text(3.2, 1.42, "$p(z_k\\,|\\,x)$", color=plotting.MEASUREMENT, fontsize=11)
    ax.scatter(after, np.ones(4), s=900 * w, color=plotting.ESTIMATE, alpha=0.8, zorder=3)
    for i, (b, weight) in enumerate(zip(after, w)):
        ax.text(b, 0.66, rf"$w_k^{{({i + 1})}}={weight:.2f}$", ha="center", fontsize=10)
    for b, copies in ((1.0, 2), (2.0, 2)):
        ax.plot(b + 0.13 * (np.arange(copies) - 0.5), np.zeros(copies), "o", color=plotting.ESTIMATE, ms=9)
    ax.text(3.75, 2.62, "$u_k$ moves each,\nwith its own noise", color=plotting.PREDICTION, fontsize=10)
    ax.text(
        2.6, 0.07, "two copies each of particles 2\nand 3, all of the same weight", color=plotting.ESTIMATE, fontsize=10
    )
    ax.set_yticks(list(levels.values()), list(levels))
    ax.set(xlim=(-1.3, 5.4), ylim=(-0.35, 3.5), xlabel="x [m]")
    ax.grid(visible=False)
    ax.set_title("Move, weigh by the measurement, draw again", loc="left")
    return fig


def error_against_particles(errors: dict[str, dict[int, float]]) -> Figure:
    """RMS error of a mean for each number of particles, a line for each resampler, with 1/√N."""
    fig = plotting.figure(6.6, 3.8)
    ax = plotting.axes(fig)
    for name, by_n in errors.items():
        ax.plot(list(by_n), [1000 * e for e in by_n.values()], ".-", label=name)
    n = np.array(list(next(iter(errors.values()))), dtype=float)
    first = 1200 * max(e[int(n[0])] for e in errors.values())
    ax.plot(n, first * np.sqrt(n[0] / n), color=plotting.TRUTH, lw=1, ls="--", label="1/√N")
    ax.set(xscale="log", yscale="log", xlabel="number of particles N", ylabel="RMS error of the mean [mm]")
    ax.set_title("Four times the particles, half the error", loc="left")
    ax.legend(ncols=2)
    return fig


def mean_copies(weights: Array, methods: dict[str, Any], draws: int = 3000) -> Figure:
    """Mean copies of each particle, wrong beside right, against N times its weight."""
    fig = plotting.figure(7.2, 3.4)
    ax = plotting.axes(fig)
    rng, n = np.random.default_rng(lab_seed(7)), weights.size
    ax.bar(range(n), n * weights, color="#d9e6ef", width=0.9, label="N × weight")
    for marker, colour, (name, method) in zip("Do", (plotting.MEASUREMENT, plotting.ESTIMATE), methods.items()):
        copies = np.mean([np.bincount(method(weights, rng), minlength=n) for _ in range(draws)], axis=0)
        ax.plot(range(n), copies, marker, color=colour, ms=5, label=name, clip_on=False)
    ax.set(xlabel="particle", ylabel=f"mean copies, {draws} draws")
    ax.legend(loc="upper right" if weights[0] > weights[-1] else "upper left")
    return fig


def cloud_ellipse(cloud: Particles) -> Any:
    """The 95 % ellipse of a cloud's position; a point when the cloud has collapsed onto fewer than three states."""
    mean, cov = particles.mean(cloud)[:2], particles.covariance(cloud)[:2, :2]
    try:
        return mean + gaussian.ellipse(cov)
    except ValueError:
        return mean[None]


def silence(clouds: dict[str, Particles], heard: NDArray[np.bool_], place: Array, reach: float) -> Figure:
    """Clouds of positions, (n, 2), by weight, among the beacons of the lab; circles around those that are not heard."""
    fig = plotting.figure(8.4, 3.9)
    for ax, (name, cloud) in zip(plotting.axes(fig, 1, len(clouds), sharey=True), clouds.items(), strict=True):
        plotting.draw_arena(ax, LAB)
        for beacon in BEACONS[~heard]:
            ax.add_patch(Circle(tuple(beacon), reach, fill=False, ls="--", lw=1, edgecolor=plotting.ODOMETRY))
        chosen = np.random.default_rng(lab_seed(7)).choice(len(cloud), size=500, p=cloud.weights)
        ax.plot(*cloud.states[chosen].T, ".", color=plotting.ESTIMATE, ms=3, alpha=0.6, label="500 of the particles")
        ax.plot(*BEACONS[heard].T, "o", mfc="none", mec=plotting.MEASUREMENT, ms=14, mew=2, label="the beacon heard")
        ax.plot([], [], ls="--", lw=1, color=plotting.ODOMETRY, label=f"{reach:g} m around a silent one")
        ax.plot(*place, "x", color=plotting.TRUTH, ms=8, mew=2, label="true place")
        ax.set(xlim=(-4.1, 4.1), ylim=(-3.1, 3.1), ylabel="")
        ax.set_title(f"{name}: {particles.effective_sample_size(cloud.weights):.0f} count", loc="left")
    fig.axes[0].set_ylabel("y [m]")
    fig.legend(*fig.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return fig


SURE = 6.0  # twice what the NEES of an honest pose averages


def too_sure(nees: Array, settled: int = 4) -> int:
    """How many drives have a NEES, (runs, steps), that averages above ``SURE`` after the first ``settled`` steps."""
    return int(np.sum(nees[:, settled:].mean(axis=1) > SURE))


def nees_of(values: dict[str, Array]) -> Figure:
    """Average NEES over runs against time for some filters, (runs, steps) each, with the two-sided band."""
    fig = plotting.figure(7.4, 3.8)
    ax = plotting.axes(fig)
    for (name, nees), colour in zip(values.items(), (plotting.MEASUREMENT, plotting.ESTIMATE)):
        seconds = 0.5 * np.arange(1, nees.shape[1] + 1)
        ax.plot(seconds, nees.mean(axis=0), ".-", color=colour, label=f"{name}: {too_sure(nees)} drives too sure")
    runs = len(next(iter(values.values())))
    low, high = gaussian.chi2_band(3, runs=runs)
    ax.axhspan(low, high, color=plotting.BAND, alpha=0.2, lw=0, label="95 % band of an honest filter")
    ax.set(yscale="log", xlabel="time [s]", ylabel=f"average NEES of the pose, {runs} drives")
    ax.set_yticks([1, 3, 10, 30, 100, 300], ["1", "3", "10", "30", "100", "300"])
    ax.set_yticks([], minor=True)
    counts = " and ".join(str(too_sure(nees)) for nees in values.values())
    ax.set_title(f"Too sure of themselves: {counts} of {runs} drives", loc="left")
    fig.legend(loc="outside lower center", ncols=2)
    return fig
