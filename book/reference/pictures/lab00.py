"""Lab 0's failures, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from coursekit.labs.lab00 import failures
from reference.pictures.paper import RIGHT, TRUTH, WRONG, one


def three_is_not_95_percent() -> Figure:
    """Two thousand draws: the orange circle, sold as 95 %, leaves out four times as many as the blue one."""
    draws = np.random.default_rng(0).standard_normal((2000, 2))
    fig, ax = one(xlabel="standard deviations", ylabel="standard deviations", aspect="equal")
    ax.plot(*draws.T, ".", color="0.7", ms=2)
    a = np.linspace(0, 2 * np.pi, 100)
    for radius, colour in ((failures.three_sigma_squared(), WRONG), (failures.planar_quantile(), RIGHT)):
        share = np.mean(np.sum(draws**2, axis=1) <= radius)
        ax.plot(
            np.sqrt(radius) * np.cos(a), np.sqrt(radius) * np.sin(a), color=colour, lw=2, label=f"holds {share:.0%}"
        )
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def euler_step() -> Figure:
    """Half a circle in ten steps: along the old heading the robot swings wide; along arcs it ends where it should."""
    fig, ax = one(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    for step, colour, name in ((failures.euler_step, WRONG, "old heading"), (failures.arc_step, RIGHT, "arc")):
        poses = [np.zeros(3)]
        for _ in range(10):
            poses.append(step(poses[-1], np.array([np.pi / 8, np.pi / 8]), 0.8))
        ax.plot(*np.array(poses)[:, :2].T, "o-", color=colour, ms=4, label=name)
    ax.plot(0, 2, "*", color=TRUTH, ms=13, label="where it is")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig
