"""Lab 5's failures, drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.gaussian import Gaussian
from coursekit.labs.lab05 import failures
from coursekit.models import DifferentialDrive
from coursekit.slam.plain_slam import PlainSlam
from reference.pictures.paper import RIGHT, TRUTH, WRONG, matrix, one, two

R = np.diag([0.03, 0.01]) ** 2
NAMES = ["x", "y", "θ", "$\\ell_x$", "$\\ell_y$"]


def _made(slam: Any, spread: float = 1e-3, noise: float = 0.05) -> Any:
    return slam(Gaussian(np.zeros(3), spread**2 * np.eye(3)), DifferentialDrive(noise, noise))


def inverted_rule() -> Figure:
    """A robot at rest sees the same two tags ten times. With the rule upside down both are one landmark at first;
    then each look adds two.
    """
    fig, ax = one(xlabel="look", ylabel="landmarks in the map")
    for slam, colour, name in ((failures.Inverted, WRONG, "near is new"), (PlainSlam, RIGHT, "near is known")):
        rng, made, counts = np.random.default_rng(5), _made(slam), []
        for _ in range(10):
            made.observe(np.array([[2.0, 0.5], [2.0, -0.5]]) + rng.normal(size=(2, 2)) * [0.03, 0.01], R)
            counts.append(len(made.landmarks))
        ax.plot(range(1, 11), counts, "o-", color=colour, label=name)
    ax.legend()
    return fig


def one_column() -> Figure:
    """The Jacobian of range and bearing by the pose and the landmark: the report's has holes where numbers belong."""
    fig, axes = two("the report's H", "the derivative")
    for ax, slam in zip(axes, (failures.OneColumn, PlainSlam), strict=True):
        made = _made(slam)
        made.observe([[2.0, 0.5]], R)
        matrix(ax, made.H(0), "{:.2f}")
        ax.set_xticks(range(5), NAMES)
        ax.set_yticks(range(2), ["range", "bearing"])
    return fig


def thousand() -> Figure:
    """Correlations of the pose and a new landmark: started with zeros, the landmark shares no error with the robot; in
    truth the heading's error moves it along.
    """
    pose = Gaussian(np.zeros(3), np.diag([0.05, 0.05, 0.1]) ** 2)
    fig, axes = two("1000 and zeros", "through the Jacobians of g")
    for ax, slam in zip(axes, (failures.Thousand, PlainSlam), strict=True):
        made = slam(pose, DifferentialDrive())
        made.augment(np.array([2.0, 0.4]), R)
        sigma = np.sqrt(np.diag(made.P))
        matrix(ax, made.P / np.outer(sigma, sigma), "{:.2f}")
        ax.set_xticks(range(5), NAMES)
        ax.set_yticks(range(5), NAMES)
    return fig


def metres() -> Figure:
    """Distance of a second sight of one tag, and of a neighbour, in metres and in standard deviations: between the two
    no threshold in metres fits both robots; in standard deviations one gate does.
    """
    fig, axes = two("in metres", "in standard deviations")
    cases = {"sure robot, neighbour": (0.4, 0.05), "unsure robot, same tag": (0.6, 0.4)}
    for ax, value in zip(axes, (lambda d, s: d, lambda d, s: d / s), strict=True):
        for k, (name, (d, s)) in enumerate(cases.items()):
            ax.barh(1 - k, value(d, s), color=("0.6", RIGHT)[k])
            ax.text(value(d, s), 1 - k, f" {name}", va="center", fontsize=8)
        ax.set(yticks=[])
        ax.margins(x=0.9)
    axes[1].axvline(3.03, color=TRUTH, ls="--")
    axes[1].set_xlabel("gate at 99 %: dashed")
    axes[0].set_xlabel("[m]: the neighbour is the nearer one")
    return fig


def stuck_variances() -> Figure:
    """Variances of two landmarks that are seen thirty times: in the report's filter two of the four stay at 1000."""
    fig, ax = one(xlabel="look", ylabel="variance [m²]", yscale="log")
    for slam, colour, name in ((failures.Report, WRONG, "the report's filter"), (PlainSlam, RIGHT, "sound")):
        made, kept = _made(slam, 1e-2), []
        for _ in range(30):
            made.observe([[2.0, 0.5], [2.2, -0.5]], R)
            kept.append(np.diag(made.P)[3:7])
        lines = ax.plot(np.array(kept), color=colour, lw=2)
        lines[0].set_label(name)
    ax.legend()
    return fig
