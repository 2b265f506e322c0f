"""Lab 7's second half: a robot that is lost in the lab, six radio beacons, and pictures of how it is found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from coursekit import gaussian, plotting
from coursekit.geometry import Array
from coursekit.particles import Particles
from coursekit.world.arena import Arena
from coursekit.world.robot import World


@dataclass(frozen=True)
class Leg:
    """Half a second of a drive among beacons.  controls (10, 2): odometry [v m/s, ω rad/s] of each 0.05 s;
    ranges (6,) m to the beacons at the end; truth (3,): the pose then."""

    controls: Array
    ranges: Array
    truth: Array


LAB = Arena.load("lab")
BEACONS = np.array([cylinder.position for cylinder in LAB.cylinders])
BEACON_SIGMA, TICK = 0.3, 0.05


def drive_among_beacons(rng: np.random.Generator, seconds: float = 12.0) -> list[Leg]:
    """The world's robot on a circle; six cylinders of the lab carry radios that tell a range, good to 0.3 m."""
    world, legs = World(LAB, rng), []
    for _ in range(round(seconds / (10 * TICK))):
        controls = []
        for _ in range(10):
            world.step(0.35, 0.4)
            controls.append(world.odometry)
        ranges = np.linalg.norm(BEACONS - world.pose[:2], axis=1) + BEACON_SIGMA * rng.standard_normal(len(BEACONS))
        legs.append(Leg(np.array(controls), ranges, world.pose))
    return legs


def found_robot(history: list[tuple[Particles, Array]], legs: tuple[int, ...] = (0, 2, 9)) -> Figure:
    """The drive in the lab's plan, then some of the cloud after some of the legs, as arrows around the robot."""
    fig = plotting.figure(7.4, 6.2)
    plan, *views = plotting.axes(fig, 2, 2).ravel()
    plotting.draw_arena(plan, LAB)
    plan.plot(*BEACONS.T, "o", mfc="none", mec=plotting.MEASUREMENT, ms=12, mew=1.5, label="beacons")
    plan.plot(*np.array([truth for _, truth in history]).T[:2], ".-", color=plotting.TRUTH, label="the drive")
    plan.set_title("to be searched", loc="left")
    plan.legend(loc="upper center", ncols=2, fontsize=8.5)
    plan.set(ylim=(-3.2, 4.3))
    for ax, k in zip(views, legs):
        cloud, truth = history[k]
        x, y, heading = cloud.states[np.random.default_rng(k).choice(len(cloud), size=120, p=cloud.weights)].T
        ax.quiver(x, y, np.cos(heading), np.sin(heading), color=plotting.ESTIMATE, angles="xy", scale=14, width=0.006,
                  alpha=0.6, zorder=4)  # fmt: skip
        plotting.draw_robot(ax, truth, colour="none", size=0.5, edgecolor=plotting.TRUTH, lw=2, zorder=6)
        ax.set(xlim=truth[0] + [-1.1, 1.1], ylim=truth[1] + [-1.1, 1.1], aspect="equal", xlabel="x [m]", ylabel="y [m]")
        ax.set_title(f"{(k + 1) / 2:g} s: {len(cloud):,d} particles", loc="left")
    return fig


def nees_of(values: dict[str, Array]) -> Figure:
    """Average NEES over runs against time for some filters, (runs, steps) each, with the two-sided band."""
    fig = plotting.figure(7.2, 3.4)
    ax = plotting.axes(fig)
    for (name, nees), colour in zip(values.items(), (plotting.MEASUREMENT, plotting.ESTIMATE)):
        seconds = 0.5 * np.arange(1, nees.shape[1] + 1)
        ax.plot(seconds, nees.mean(axis=0), ".-", color=colour, label=name)
    low, high = gaussian.chi2_band(3, runs=len(nees))
    ax.axhspan(low, high, color=plotting.BAND, alpha=0.2, lw=0, label=f"95 % band, {len(nees)} runs")
    ax.set(yscale="log", xlabel="time [s]", ylabel="average NEES of the pose")
    ax.set_yticks([1, 3, 10, 30, 100], ["1", "3", "10", "30", "100"])
    ax.set_yticks([], minor=True)
    ax.set_title("Too few particles at the start: sure, and wrong", loc="left")
    ax.legend()
    return fig
