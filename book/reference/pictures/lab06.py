"""Lab 6's failures, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from coursekit import geometry, icp
from coursekit.labs.lab06 import failures
from reference.pictures.paper import GREY, RIGHT, TRUTH, WRONG, bars, one, two


def mirror() -> Figure:
    """Determinants of twenty fitted matrices for clouds that are flatter than their noise: −1 is a mirror, no turn."""
    rng = np.random.default_rng(6)
    fig, ax = one(xlabel="cloud", ylabel="det R", ylim=(-1.4, 1.4))
    clouds = []
    for _ in range(20):
        p = rng.normal(size=(12, 3)) * [1.0, 0.7, 0.005]
        clouds.append((p, p @ geometry.so3_exp(rng.normal(size=3)).T + rng.normal(0, 0.05, p.shape)))
    for fit, marker, colour, name in (
        (failures.best_orthogonal, "o", WRONG, "best orthogonal"),
        (icp.point_to_point, "x", RIGHT, "best rotation"),
    ):
        ax.plot([np.linalg.det(fit(*pair)[:3, :3]) for pair in clouds], marker, color=colour, label=name)
    ax.legend(loc="center right")
    return fig


def composed_backwards() -> Figure:
    """Two steps take the source to the target. Put together in the wrong order, their product does not."""
    target = np.random.default_rng(6).uniform(-2, 2, (80, 2))
    source = geometry.transform([0.4, -0.3, 0.5], target)
    second = np.array([0.2, 0.1, -0.2])
    first = geometry.compose(geometry.inverse(second), geometry.inverse([0.4, -0.3, 0.5]))
    ends = geometry.compose(first, second), geometry.compose(second, first)
    fig, axes = two("T @ step", "step @ T", sharey=True)
    for ax, end, colour in zip(axes, ends, (WRONG, RIGHT), strict=True):
        ax.plot(*target.T, "o", mfc="none", color=TRUTH, ms=5)
        ax.plot(*geometry.transform(end, source).T, ".", color=colour, ms=4)
        ax.set(xlabel="x [m]", aspect="equal")
    axes[0].set_ylabel("y [m]")
    return fig


def mean_called_rmse() -> Figure:
    """Four distances of 3, 3, 4 and 0 cm: their mean is 2.5 cm, the root of their mean square 2.9 cm."""
    target = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    moved = target + np.array([[0.03, 0], [0, 0.03], [0.04, 0], [0, 0]])
    fig, ax = one(xlabel="[cm]")
    values = [100 * f(moved, target) for f in (failures.mean_distance, failures.rmse_of_pairs)]
    bars(ax, ["mean distance", "RMSE"], values, [WRONG, RIGHT], "{:.2f}")
    return fig


def error_by_index() -> Figure:
    """The same target, listed in another order: by index the lines lead to anywhere, by neighbour to the partner."""
    rng = np.random.default_rng(2)
    target = rng.uniform(-1, 1, (12, 2))
    moved, shuffled = target + rng.normal(0, 0.06, target.shape), target[rng.permutation(12)]
    fig, axes = two("by index", "by nearest neighbour", sharey=True)
    nearest = shuffled[icp.KdTree(shuffled).nearest(moved, np.inf)[0]]
    for ax, partner, colour in zip(axes, (shuffled, nearest), (WRONG, RIGHT), strict=True):
        ax.plot(*np.stack([moved, partner], axis=1).T, color=colour, lw=1.2)
        ax.plot(*shuffled.T, "o", mfc="none", color=TRUTH)
        ax.plot(*moved.T, ".", color=GREY)
        ax.set(xlabel="x [m]", aspect="equal")
    axes[0].set_ylabel("y [m]")
    return fig


def thirty_is_enough() -> Figure:
    """Error of the angle over the iterations, on a curve that is nearly a circle: at thirty it is still falling."""
    a = np.linspace(0, np.pi, 400)
    target = np.stack([np.cos(a), 1.1 * np.sin(a)], axis=1)
    source = geometry.transform([0, 0, 0.7], target)
    result = icp.align(source, target, max_iterations=400)
    angles = [abs(np.arctan2(s.T_target_source[1, 0], s.T_target_source[0, 0]) + 0.7) for s in result.history]
    fig, ax = one(xlabel="iteration", ylabel="angle still to turn [rad]")
    ax.plot(angles, color=RIGHT, lw=2)
    ax.plot(29, angles[29], "o", color=WRONG, ms=9)
    ax.annotate("“the result”", (29, angles[29]), (12, 8), textcoords="offset points", color=WRONG)
    return fig


def frozen_pairs() -> Figure:
    """A bare corridor, twelve pairs of scans half a metre apart: where ICP ends, and two standard deviations as each
    covariance states them. The truth, black, lies outside nearly every orange bar.
    """
    fig, axes = two("pairs as measurements", "surfaces as measurements")
    covariances = (failures.pairs_as_measurements, failures.surfaces_as_measurements)
    for ax, covariance, colour in zip(axes, covariances, (WRONG, RIGHT), strict=True):
        for k in range(12):
            rng = np.random.default_rng(k)
            target, source = (
                np.c_[rng.uniform(-5, 5, 200), 2.0 * rng.integers(0, 2, 200) - 1] + rng.normal(0, 0.01, (200, 2))
                for _ in range(2)
            )
            source = source + np.array([0.5, 0.0])
            end = icp.align(source, target).pose[0]
            error = 2 * np.sqrt(covariance(source, target)[0, 0])
            ax.plot([k, k], [end - error, end + error], color=colour, lw=3)
        ax.axhline(-0.5, color=TRUTH)
        ax.set(xlabel="pair of scans")
    axes[0].set_ylabel("shift along [m]")
    return fig
