"""Lab 4's failures, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.labs.lab04 import failures
from coursekit.models import ConstantVelocity, DifferentialDrive, RangeBearing, RangeOnly
from coursekit.teaching import plotting
from reference.pictures.paper import RIGHT, TRUTH, WRONG, one


def transpose_first() -> Figure:
    """After 3 m: the dots are the model's own samples. With the transpose first the ellipse does not grow across."""
    motion, start = DifferentialDrive(0.02, 0.01), Gaussian(np.array([0.0, 0.0, 0.6]), np.diag([0.03, 0.03, 0.1]) ** 2)
    rng = np.random.default_rng(4)
    fig, ax = one(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    ax.plot(*motion.sample(start.sample(rng, 1500), np.array([1.0, 0.0]), 3.0, rng)[:, :2].T, ".", color="0.7", ms=2)
    for predict, colour, name in ((failures.transpose_first, WRONG, "FᵀPF + Q"), (ekf.predict, RIGHT, "FPFᵀ + Q")):
        b = predict(start, motion, [1.0, 0.0], 3.0)
        plotting.draw_ellipse(ax, b.mean[:2], b.cov[:2, :2], colour=colour, lw=2, label=name)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def unwrapped_bearing() -> Figure:
    """A robot at rest, a landmark behind it, perfect looks: with a bare minus the estimate leaps at the seam of ±π."""
    rng = np.random.default_rng(1)
    fig, ax = one(xlabel="look", ylabel="distance from the truth [m]")
    for correct, colour, name in ((failures.unwrapped_bearing, WRONG, "bare minus"), (ekf.correct, RIGHT, "wrapped")):
        belief, off = Gaussian(np.zeros(3), np.diag([0.05, 0.05, 0.02]) ** 2), []
        behind = RangeBearing(np.array([-3.0, 0.0]), np.diag([0.05, 0.02]) ** 2)
        for k in range(30):
            z = [3.0 + rng.normal(0, 0.02), np.pi - 0.01 if k % 2 else -np.pi + 0.01]
            belief = correct(belief, behind, z).belief
            off.append(np.hypot(*belief.mean[:2]))
        ax.plot(off, "o-", color=colour, ms=3, label=name)
    ax.legend()
    return fig


def column_repeated() -> Figure:
    """Ranges to three landmarks, forty looks: with one column twice the estimate can only slide on a diagonal."""
    landmarks = np.array([[0.0, 4.0], [4.0, 0.0], [-3.0, -3.0]])
    fig, ax = one(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    for sensor, colour, name in (
        (failures.column_repeated, WRONG, "one column twice"),
        (RangeOnly, RIGHT, "both columns"),
    ):
        motion, belief = (
            ConstantVelocity(0.05),
            Gaussian(np.array([1.0, 0.0, 1.5, 0.0]), np.diag([1.0, 0.1, 1.0, 0.1]) ** 2),
        )
        path = [belief.mean[[0, 2]]]
        for _ in range(40):
            belief = ekf.predict(belief, motion, [], 0.1)
            for mark in landmarks:
                made = sensor(mark)
                belief = ekf.correct(belief, made, [np.hypot(*mark)]).belief
            path.append(belief.mean[[0, 2]])
        ax.plot(*np.array(path).T, "o-", color=colour, ms=3, label=name)
    ax.plot(0, 0, "*", color=TRUTH, ms=13, label="the truth")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def hard_gate() -> Figure:
    """A belief half a metre off and sure of itself: the gate refuses every look, the robust correction gives in."""
    truth, motion = np.array([0.5, 0.0, 0.0]), DifferentialDrive(0.02, 0.01)
    fig, ax = one(xlabel="time [s]", ylabel="position error [m]", ylim=(0, 0.6))
    for correct, colour, name in ((failures.hard_gate, WRONG, "hard gate"), (ekf.correct_robustly, RIGHT, "robust")):
        belief, off = Gaussian(np.zeros(3), np.diag([0.03, 0.03, 0.01]) ** 2), [0.5]
        for _ in range(30):
            belief = ekf.predict(belief, motion, [0.0, 0.0], 0.1)
            for mark in np.array([[4.0, 2.0], [4.0, -2.0]]):
                belief = correct(belief, RangeBearing(mark), RangeBearing(mark).h(truth)).belief
            off.append(np.hypot(*(belief.mean - truth)[:2]))
        ax.plot(0.1 * np.arange(31), off, color=colour, lw=2, label=name)
    ax.legend()
    return fig


def short_form() -> Figure:
    """Largest difference between P and its transpose, with a wide belief and a very sharp sensor: the short form loses
    the symmetry at the first corrections, the package never does.
    """
    fig, ax = one(xlabel="correction", ylabel="largest |P − Pᵀ|")
    for correct, colour, name in ((failures.short_form, WRONG, "(I − KH) P"), (ekf.correct, RIGHT, "the package")):
        belief, uneven = Gaussian(np.zeros(3), np.diag([1e3, 1e3, 1.0])), []
        for k in range(30):
            sensor = RangeBearing(np.array([3.0 + 0.01 * k, 1.0]), np.diag([1e-5, 1e-6]) ** 2)
            belief = correct(belief, sensor, sensor.h(belief.mean)).belief
            uneven.append(np.abs(belief.cov - belief.cov.T).max())
        ax.plot(range(1, 31), uneven, "o-", ms=3, color=colour, label=name)
    ax.legend()
    return fig
