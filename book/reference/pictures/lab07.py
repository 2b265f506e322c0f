"""Lab 7's failures, drawn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit import particles
from coursekit.labs.lab07 import failures
from coursekit.particles import Particles
from reference.pictures.paper import RIGHT, TRUTH, WRONG, matrix, one, two


def _copies(ax: Any, method: Callable[..., Any], weights: np.ndarray, colour: str, name: str, shift: float) -> None:
    rng, n = np.random.default_rng(1), len(weights)
    mean = np.mean([np.bincount(method(weights, rng), minlength=n) for _ in range(1500)], axis=0)
    ax.bar(np.arange(n) + shift, mean, 0.4, color=colour, label=name)


def residual_without_n() -> Figure:
    """Mean copies of five particles over 1,500 draws; black marks are n times the weight, which they should meet."""
    weights = np.array([0.45, 0.25, 0.15, 0.1, 0.05])
    fig, ax = one(xlabel="particle", ylabel="mean copies")
    _copies(ax, failures.residual_without_n, weights, WRONG, "w - copies", -0.2)
    _copies(ax, particles.residual, weights, RIGHT, "n w - copies", 0.2)
    ax.plot(5 * weights, "_", color=TRUTH, ms=28)
    ax.legend()
    return fig


def slice_wheel() -> Figure:
    """Thirty particles without weight, then twenty with equal weights: the wheel that starts at an edge gives the first
    of the twenty too many copies.
    """
    weights = np.repeat([0.0, 0.05], [30, 20])
    fig, ax = one(xlabel="particle", ylabel="mean copies", xlim=(28, 50))
    _copies(ax, failures.slice_wheel, weights, WRONG, "from an edge", -0.2)
    _copies(ax, particles.wheel, weights, RIGHT, "from anywhere", 0.2)
    ax.axhline(2.5, color=TRUTH, lw=1)
    ax.legend(loc="lower right")
    return fig


def plain_weights() -> Figure:
    """The largest weight before it is normalised, over twenty measurements: the product falls below the least number
    that a computer holds, the sum of logs goes on.
    """
    steps = np.arange(1, 21)
    logs = -50.0 * steps / np.log(10)
    fig, ax = one(xlabel="measurements", ylabel="log₁₀ of the largest weight")
    ax.plot(steps, logs, color=RIGHT, lw=2, label="sum of logs")
    holds = logs > np.log10(5e-324)
    ax.plot(steps[holds], logs[holds], "o", color=WRONG, label="product of likelihoods")
    ax.axhline(np.log10(5e-324), color=TRUTH, ls="--")
    ax.text(1, np.log10(5e-324) - 8, "below this line a product is 0", va="top")
    ax.legend()
    return fig


def rows_from_two_times() -> Figure:
    """A matrix made of two times' rows: its two off-diagonal entries differ, so no cloud has it as a covariance."""
    rng = np.random.default_rng(0)
    clouds = [Particles(rng.normal(size=(200, 2)) @ rng.normal(size=(2, 2))) for _ in range(2)]
    fig, axes = two("rows of two times", "rows of one time")
    for ax, report in zip(axes, (failures.rows_from_two_times, failures.rows_from_one_time), strict=True):
        matrix(ax, report(clouds)[0])
    return fig


def resampling_every_step() -> Figure:
    """Five hundred particles, fifty measurements that say nothing: drawing each time leaves the copies of a few."""
    fig, ax = one(xlabel="measurements without information", ylabel="different particles left", ylim=(0, 520))
    carriers = (
        (failures.resampled_every_step, WRONG, "every step"),
        (failures.resampled_when_needed, RIGHT, "when needed"),
    )
    for carry, colour, name in carriers:
        cloud, rng, left = Particles(np.arange(500.0)[:, None]), np.random.default_rng(0), [500]
        for _ in range(50):
            cloud = carry(cloud, rng, 1)
            left.append(len(np.unique(cloud.states)))
        ax.plot(left, color=colour, lw=2, label=name)
    ax.legend(loc="center right")
    return fig


def noise_that_shrinks_with_the_step() -> Figure:
    """Spread of the heading after 10 s, cut into more and more steps: with the same σ in each step it melts away."""
    fig, ax = one(xlabel="steps", ylabel="σ of the heading [rad]", xscale="log", ylim=(0, 0.6))
    steps = [1, 2, 5, 10, 20, 50]
    laws = ((failures.same_sigma_in_every_step, WRONG, "same σ"), (failures.sigma_for_the_step, RIGHT, "σ √steps"))
    for law, colour, name in laws:
        ax.plot(
            steps, [law(0.05, 10.0, k, np.random.default_rng(k)).std() for k in steps], "o-", color=colour, label=name
        )
    ax.legend()
    return fig
