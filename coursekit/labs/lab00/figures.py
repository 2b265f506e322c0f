"""Lab 0's pictures: guesses, the geometry of an arc, a whitened cloud, a bent drive, one curve for three robots."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from coursekit.gaussian import ellipse
from coursekit.geometry import Array, transform
from coursekit.labs.lab00.runs import ARC, RADIUS_SQUARED
from coursekit.teaching import plotting


def guesses() -> Figure:
    """Three answers to the lab's first question, side by side."""
    fig = plotting.figure(7.8, 2.9)
    answers = {"A": (0.9, 0.9), "B": (1.1, 0.12), "C": (0.06, 1.1)}
    for ax, (name, (along, across)) in zip(plotting.axes(fig, 1, 3, sharey=True), answers.items(), strict=True):
        ax.plot([0, 10], [0, 0], color=plotting.ODOMETRY, ls="--", lw=1)
        plotting.draw_robot(ax, [0, 0, 0], plotting.TRUTH, size=1.0)
        plotting.draw_ellipse(ax, [10, 0], np.diag([along**2, across**2]), plotting.HIGHLIGHT)
        ax.set(xlim=(-1.5, 13.5), ylim=(-4, 4), aspect="equal", xlabel="x [m]")
        ax.set_title(name, loc="left", weight="bold")
    fig.axes[0].set_ylabel("y [m]")
    return fig


def arc_and_chord() -> Figure:
    """Two wheels, their track width, the arc that they run and its chord, with every symbol of the derivation."""
    fig = plotting.figure(7.4, 4.3)
    ax = plotting.axes(fig)
    alpha, b = 1.1, 0.5  # rad; m
    start, end = np.zeros(3), ARC.f(np.zeros(3), [alpha, alpha], 1.0)  # an arc of radius 1 m
    centre = np.array([0.0, 1.0])
    for pose, colour in ((start, plotting.TRUTH), (end, plotting.ESTIMATE)):
        _two_wheels(ax, pose, b, colour)
        ax.plot(*np.stack([centre, pose[:2]]).T, color=plotting.ODOMETRY, lw=1, ls="--")
    turns = np.linspace(0, alpha, 60)
    arc = centre + np.stack([np.sin(turns), -np.cos(turns)], axis=-1)
    ax.plot(*arc.T, color=plotting.TRUTH, lw=2)
    ax.plot(*np.stack([start[:2], end[:2]]).T, color=plotting.MEASUREMENT, lw=2)
    ax.plot([0, 1.35], [0, 0], color=plotting.ODOMETRY, lw=1, ls=":")
    ax.plot(*centre, "o", color=plotting.ODOMETRY, ms=5)
    _angle(ax, centre, -np.pi / 2, -np.pi / 2 + alpha, 0.25, r"$\Delta\theta$", plotting.TRUTH)
    _angle(ax, start[:2], 0, alpha / 2, 0.62, r"$\frac{1}{2}\Delta\theta$", plotting.MEASUREMENT)
    for y, name, speed in ((b / 2, "v_l", 0.22), (-b / 2, "v_r", 0.4)):
        arrow = {"arrowstyle": "-|>", "color": plotting.BAND, "lw": 2}
        ax.annotate("", (speed, y), (0.0, y), arrowprops=arrow)
        ax.text(speed + 0.03, y, f"${name}$", color=plotting.BAND, va="center", fontsize=12)
    ax.annotate("", (-0.26, b / 2), (-0.26, -b / 2), arrowprops={"arrowstyle": "<|-|>", "color": plotting.TRUTH})
    words: list[tuple[float, float, str, str]] = [
        (-0.36, 0.0, "$b$", plotting.TRUTH),
        (1.0, 0.3, r"arc $\Delta s = v\,\Delta t$", plotting.TRUTH),
        (0.36, 0.34, r"chord $\Delta c$", plotting.MEASUREMENT),
        (-0.15, 0.6, r"$\Delta s/\Delta\theta$", plotting.ODOMETRY),
        (0.5, 0.86, r"$\Delta s/\Delta\theta$", plotting.ODOMETRY),
        (-0.28, 1.0, "centre of\nthe circle", plotting.ODOMETRY),
        (1.62, 0.0, r"old heading $\theta$", plotting.ODOMETRY),
        (1.27, 0.86, r"new heading $\theta + \Delta\theta$", plotting.ESTIMATE),
    ]
    for x, y, text, colour in words:
        ax.text(x, y, text, color=colour, ha="center", va="center", fontsize=12)
    ax.set(xlim=(-0.6, 1.85), ylim=(-0.38, 1.12), aspect="equal")
    ax.set_axis_off()
    ax.set_title(r"In $\Delta t$ the robot runs an arc and turns by $\Delta\theta = \omega\,\Delta t$", loc="left")
    return fig


def _two_wheels(ax: Axes, pose: Array, b: float, colour: str) -> None:
    wheel = np.array([[0.1, 0.03], [-0.1, 0.03], [-0.1, -0.03], [0.1, -0.03]])
    for side in (b / 2, -b / 2):
        ax.add_patch(Polygon(transform(pose, wheel + np.array([0.0, side])), facecolor=colour, zorder=3))
    ax.plot(*transform(pose, np.array([[0, b / 2], [0, -b / 2]])).T, color=colour, lw=2)
    ax.plot(*pose[:2], "o", color=colour, ms=6, zorder=4)


def _angle(ax: Axes, at: Array, low: float, high: float, radius: float, name: str, colour: str) -> None:
    turns = np.linspace(low, high, 40)
    ax.plot(*(at[:, None] + radius * np.stack([np.cos(turns), np.sin(turns)])), color=colour, lw=1)
    x, y = at + (radius + 0.11) * np.array([np.cos((low + high) / 2), np.sin((low + high) / 2)])
    ax.text(x, y, name, color=colour, ha="center", va="center", fontsize=12)


def whitened(cloud: Array, mean: Array, P: Array) -> Figure:
    """A cloud (n, 2) with its 95 % ellipse, and the same cloud in units of its own spread, with a polar patch."""
    fig = plotting.figure(7.4, 3.5)
    left, right = plotting.axes(fig, 1, 2)
    dots: dict[str, Any] = {"ls": "none", "marker": ".", "ms": 2.5, "mew": 0, "color": plotting.ODOMETRY}
    left.plot(*cloud.T, **dots)
    plotting.draw_ellipse(left, mean, P)
    left.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    left.set_title("The cloud and its 95 % ellipse", loc="left")
    right.plot(*np.linalg.solve(np.linalg.cholesky(P), (cloud - mean).T), **dots)
    right.plot(*ellipse(np.eye(2)).T, color=plotting.ESTIMATE)
    radii, turns = np.array([1.5, 1.95]), np.linspace(0.45, 0.85, 20)
    inner, outer = (r * np.stack([np.cos(turns), np.sin(turns)]) for r in radii)
    right.fill(*np.concatenate([inner, outer[:, ::-1]], axis=1), color=plotting.HIGHLIGHT, alpha=0.8, zorder=4)
    right.plot([0, inner[0, 0]], [0, inner[1, 0]], color=plotting.TRUTH, lw=1.2)
    right.text(0.85, -0.12, "$d$", fontsize=12, bbox={"fc": "white", "ec": "none", "pad": 1.0})
    right.annotate(r"area $d\;\mathrm{d}d\;\mathrm{d}\gamma$", (1.4, 1.05), (0.4, 3.05), fontsize=11,
                   arrowprops={"arrowstyle": "-", "lw": 1, "color": plotting.TRUTH})  # fmt: skip
    right.set(aspect="equal", xlim=(-4, 4), ylim=(-4, 4), xlabel=r"$\zeta_1$", ylabel=r"$\zeta_2$")
    right.set_title("Turned and stretched: round", loc="left")
    return fig


def bent_drive() -> Figure:
    """A straight drive with one error of the heading: what it does to the side, and what it costs ahead."""
    fig = plotting.figure(7.4, 2.9)
    ax = plotting.axes(fig)
    D, s, delta = 10.0, 4.0, 0.42
    end = np.array([s + (D - s) * np.cos(delta), (D - s) * np.sin(delta)])
    ax.plot([0, D], [0, 0], color=plotting.ODOMETRY, ls="--", lw=1)
    ax.plot([0, s, end[0]], [0, 0, end[1]], color=plotting.TRUTH, lw=2)
    plotting.draw_robot(ax, [0, 0, 0], plotting.TRUTH, size=0.6)
    plotting.draw_robot(ax, [*end, delta], plotting.TRUTH, size=0.6)
    turns = np.linspace(-0.25, delta + 0.12, 40)
    ax.plot(s + (D - s) * np.cos(turns), (D - s) * np.sin(turns), color=plotting.PREDICTION, lw=1.5)
    _angle(ax, np.array([s, 0.0]), 0, delta, 1.6, "", plotting.TRUTH)
    for tail, head, colour in (
        ((end[0], 0.0), (end[0], end[1]), plotting.MEASUREMENT),
        ((end[0], -0.35), (D, -0.35), plotting.ESTIMATE),
    ):
        ax.annotate("", head, tail, arrowprops={"arrowstyle": "<|-|>", "color": colour, "lw": 1.5})
    words = [
        (s / 2, -0.4, "$x$", plotting.TRUTH),
        (s + 1.95, 0.36, r"$\delta$", plotting.TRUTH),
        (s + 2.6, 1.6, "$D - x$", plotting.TRUTH),
        (end[0] - 0.95, 0.9, r"$\approx (D - x)\,\delta$", plotting.MEASUREMENT),
        (end[0] - 0.6, -0.85, r"$\approx \frac{1}{2}(D - x)\,\delta^2$", plotting.ESTIMATE),
        (11.1, 0.0, "as\ncommanded", plotting.ODOMETRY),
    ]
    for x, y, text, colour in words:
        ax.text(x, y, text, color=colour, ha="center", va="center", fontsize=12)
    ax.set(xlim=(-0.6, 11.8), ylim=(-1.2, 3.0), aspect="equal")
    ax.set_axis_off()
    ax.set_title(r"One error $\delta$ of the heading: far to the side, and a little less far ahead", loc="left")
    return fig


def collapse(curves: dict[str, tuple[Array, Array]], runs: int) -> Figure:
    """Containment against turn noise × distance in track widths, one curve (n,), (n,) for each robot."""
    fig = plotting.figure(7.2, 3.9)
    ax = plotting.axes(fig)
    spread = 2 * np.sqrt(0.95 * 0.05 / runs)
    ax.axhspan(0.95 - spread, 0.95 + spread, color=plotting.BAND, alpha=0.25, lw=0, label=f"95 % ± 2σ of {runs:,} runs")
    for (name, (bend, share)), marker in zip(curves.items(), "os^", strict=False):
        ax.plot(bend, share, marker=marker, ms=5, lw=1, label=name)
    ax.set(xscale="log", xlabel=r"$D\,\sigma_\theta / b$ [track widths]", ylabel="share inside the 95 % ellipse")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_title("Three robots, one curve: the share falls when the banana bends", loc="left")
    ax.legend(loc="lower left")
    return fig


def broken(draws: Array, squared_radii: dict[str, float], tracks: dict[str, Array]) -> Figure:
    """Two failures: circles of some squared radii over standard draws (n, 2), and half circles (m, 3) by steps."""
    fig = plotting.figure(7.4, 4.0)
    left, right = plotting.axes(fig, 1, 2)
    left.plot(*draws[:2000].T, ls="none", marker=".", ms=2.5, color=plotting.ODOMETRY, mew=0)
    circle = ellipse(np.eye(2)) / np.sqrt(RADIUS_SQUARED)
    colours = (plotting.MEASUREMENT, plotting.ESTIMATE)
    for (name, squared), colour in zip(squared_radii.items(), colours, strict=True):
        share = np.mean(np.sum(draws**2, axis=1) <= squared)
        left.plot(*(np.sqrt(squared) * circle).T, color=colour, label=f"{name}: {100 * share:.0f} % inside")
    left.set(aspect="equal", xlim=(-4, 4), ylim=(-4, 4), xlabel="standard deviations", ylabel="standard deviations")
    left.set_title("An ellipse sold as 95 %", loc="left")
    for (name, track), colour in zip(tracks.items(), colours, strict=True):
        off = np.hypot(*(track[-1, :2] - [0, 2]))
        right.plot(*track[:, :2].T, "o-", ms=4, color=colour, label=f"{name}: ends {off:.2f} m off")
    turn = np.linspace(0, np.pi, 60)
    right.plot(np.sin(turn), 1 - np.cos(turn), color=plotting.TRUTH, lw=1, ls="--", label="truth")
    right.set(aspect="equal", xlim=(-0.9, 1.9), ylim=(-0.3, 2.5), xlabel="x [m]", ylabel="y [m]")
    right.set_title("Half a circle in ten steps", loc="left")
    for ax in (left, right):
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18))
    return fig
