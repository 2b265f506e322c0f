"""Lab 9's failures, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import chi2

from coursekit.gaussian import Gaussian
from coursekit.geometry import wrap_angle
from coursekit.labs.lab09 import failures
from coursekit.models import DifferentialDrive, RangeBearing, pose_residual
from reference.pictures.paper import RIGHT, TRUTH, WRONG, one, two


def heading_the_long_way() -> Figure:
    """The truth's heading, stamped once a second, looks across west: interpolated like a length it turns once round."""
    stamps = np.arange(8.0)
    headings = wrap_angle(np.pi - 0.2 + 0.06 * stamps)
    truth = np.c_[stamps, np.zeros((8, 2)), headings]
    fine = np.linspace(0, 7, 141)
    fig, ax = one(xlabel="time [s]", ylabel="heading [rad]")
    kinds = (
        (failures.heading_as_any_number, WRONG, "as any number"),
        (failures.heading_the_short_way, RIGHT, "the short way"),
    )
    for resample, colour, name in kinds:
        ax.plot(fine, resample(truth, fine), ".", color=colour, ms=4, label=name)
    ax.plot(stamps, headings, "o", mfc="none", color=TRUTH, label="stamps")
    ax.legend()
    return fig


def gain_from_before() -> Figure:
    """NEES of 400 first steps, sorted: honest ones follow the black line, the quantiles of χ² with three
    degrees of freedom.
    """
    rng, sensor = np.random.default_rng(9), RangeBearing(np.array([3.0, 1.0]), np.diag([0.05, 0.02]) ** 2)
    start, control = Gaussian(np.zeros(3), 0.01 * np.eye(3)), np.array([0.5, 0.2])
    truths = DifferentialDrive().sample(start.sample(rng, 400), control, 1.0, rng)
    seen = [sensor.h(t) + rng.standard_normal(2) * np.sqrt(np.diag(sensor.R)) for t in truths]
    expected = chi2.ppf((np.arange(400) + 0.5) / 400, 3)
    fig, ax = one(xlabel="expected NEES", ylabel="NEES")
    for step, colour, name in (
        (failures.gain_from_before, WRONG, "gain from before"),
        (failures.gain_from_after, RIGHT, "from after"),
    ):
        scores = sorted(
            failures.nees(step(start, control, 1.0, sensor, z), t, pose_residual)
            for t, z in zip(truths, seen, strict=True)
        )
        ax.plot(expected, scores, ".", color=colour, label=f"{name}: mean {np.mean(scores):.1f}")
    ax.plot([0, 14], [0, 14], color=TRUTH, lw=1)
    ax.legend()
    return fig


def nine_equal_numbers() -> Figure:
    """Starts drawn from each covariance, x and y: nine equal numbers put all of them on one line."""
    rng = np.random.default_rng(0)
    fig, axes = two("0.01 in nine places", "0.01 on the diagonal", sharex=True, sharey=True)
    for ax, start, colour in zip(
        axes, (failures.nine_equal_numbers, failures.three_on_the_diagonal), (WRONG, RIGHT), strict=True
    ):
        ax.plot(*rng.multivariate_normal(np.zeros(3), start(), 300)[:, :2].T, ".", color=colour, ms=3)
        ax.set(xlabel="x [m]", aspect="equal")
    axes[0].set_ylabel("y [m]")
    return fig
