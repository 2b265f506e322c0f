"""Lab 3's failures, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from coursekit.labs.lab03 import failures
from reference.pictures.paper import RIGHT, TRUTH, WRONG, bars, one, two


def bias_called_variance() -> Figure:
    """The same errors twice: a band of two standard deviations round zero misses most; round the mean it fits."""
    errors = np.random.default_rng(0).normal(-0.2, 0.1, 300)
    fig, axes = two("round zero", "round the mean", sharey=True)
    models = (failures.variance_and_no_mean, failures.mean_and_variance)
    for ax, model, colour in zip(axes, models, (WRONG, RIGHT), strict=True):
        mean, variance = model(errors)
        ax.plot(errors, ".", color="0.5", ms=3)
        ax.axhspan(mean - 2 * variance**0.5, mean + 2 * variance**0.5, color=colour, alpha=0.25)
        ax.axhline(mean, color=colour)
        ax.set(xlabel="sample")
    axes[0].set_ylabel("range error [m]")
    return fig


def limits_on_the_truth() -> Figure:
    """One reading in fifty is wild. Chosen by the true range the sample has none of them; the filter will meet them."""
    rng = np.random.default_rng(1)
    true = rng.uniform(1, 30, 3000)
    measured = np.where(rng.random(3000) < 0.02, 0.4 * true, true) + rng.normal(0, 0.1, 3000)
    fig, axes = two("1 to 10 m by the truth", "1 to 10 m by the measurement", sharey=True)
    for ax, chosen, colour in zip(axes, (true <= 10, measured <= 10), (WRONG, RIGHT), strict=True):
        ax.plot(measured, measured - true, ".", color="0.8", ms=3)
        ax.plot(measured[chosen], (measured - true)[chosen], ".", color=colour, ms=3)
        ax.set(xlabel="measured range [m]")
    axes[0].set_ylabel("error [m]")
    return fig


def divided_by_n() -> Figure:
    """Mean of the variances of five samples over many draws: divided by n it is a fifth too small, by n - 1 right."""
    draws = np.random.default_rng(2).normal(0.3, 2.0, (5000, 5))
    fig, ax = one(xlabel="mean of the estimated variances")
    means = [float(np.mean([m(d)[1] for d in draws])) for m in (failures.variance_over_n, failures.mean_and_variance)]
    bars(ax, ["divided by n", "divided by n - 1"], means, [WRONG, RIGHT], "{:.2f}")
    ax.axvline(4.0, color=TRUTH, ls="--")
    return fig


def repeats_taken_as_independent() -> Figure:
    """Forty logs with every value written four times: intervals that count the rows miss the true mean, zero, often."""
    logs = np.repeat(np.random.default_rng(3).standard_normal((40, 100)), 4, axis=1)
    rules = (failures.error_of_the_mean_counting_repeats, failures.error_of_the_mean)
    fig, axes = two("rows counted", "independent samples counted", sharey=True)
    for ax, rule, colour in zip(axes, rules, (WRONG, RIGHT), strict=True):
        for k, log in enumerate(logs):
            error = 2 * rule(log)
            missed = abs(log.mean()) > error
            ax.plot(
                [k, k],
                [log.mean() - error, log.mean() + error],
                color=TRUTH if missed else colour,
                lw=2.5 if missed else 1.5,
            )
        ax.axhline(0, color="0.5", lw=1)
        ax.set(xlabel="log (black: zero is missed)")
    axes[0].set_ylabel("mean ± 2 standard errors")
    return fig
