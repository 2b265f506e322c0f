"""Lab 3's failures: bias that is called variance, limits on what nobody knows, a biased variance, counted repeats."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coursekit.geometry import Array
from coursekit.noise import effective_samples
from coursekit.teaching.failures import Failure

# An implementation takes errors (n,) and gives (mean, variance) of the model; the mean is what a filter subtracts.
Moments = Callable[[Array], tuple[float, float]]
# An implementation takes measured and true ranges (n,) and limits, and gives the variance inside the limits.
InLimits = Callable[[Array, Array, tuple[float, float]], float]


def variance_and_no_mean(errors: Array) -> tuple[float, float]:
    """A variance, taken about a mean that is then forgotten: the filter goes on as if it were zero."""
    return 0.0, float(np.var(errors, ddof=1))


def mean_and_variance(errors: Array) -> tuple[float, float]:
    """The bias, to be subtracted, and what scatters round it."""
    return float(np.mean(errors)), float(np.var(errors, ddof=1))


def stated_variance_is_the_error_left(model: Moments) -> bool:
    """Mean square of what is left, over the stated variance: 1 within a quarter, on 2000 samples that are 2σ off."""
    errors = np.random.default_rng(0).normal(-0.2, 0.1, 2000)
    mean, variance = model(errors)
    return bool(abs(np.mean((errors - mean) ** 2) / variance - 1) < 0.25)


def limits_on_the_truth(measured: Array, true: Array, limits: tuple[float, float]) -> float:
    """The samples are chosen by the true range, which the log has and a robot has not."""
    chosen = (limits[0] <= true) & (true <= limits[1])
    return float(np.var((measured - true)[chosen], ddof=1))


def limits_on_the_measurement(measured: Array, true: Array, limits: tuple[float, float]) -> float:
    """The samples are chosen by what the model will be asked with."""
    chosen = (limits[0] <= measured) & (measured <= limits[1])
    return float(np.var((measured - true)[chosen], ddof=1))


def covers_what_is_measured_inside_the_limits(variance_inside: InLimits) -> bool:
    """Among measurements inside the limits, is the spread the one that was stated?  A tenth off is a no.

    One reading in fifty is wild; the wild ones lie inside the limits by what was measured and outside by the truth.
    """
    rng = np.random.default_rng(1)
    true = rng.uniform(1, 30, 20_000)
    measured = np.where(rng.random(20_000) < 0.02, 0.4 * true, true) + rng.normal(0, 0.1, 20_000)
    met = (measured - true)[(measured >= 1) & (measured <= 10)]
    return bool(abs(variance_inside(measured, true, (1.0, 10.0)) / np.var(met, ddof=1) - 1) < 0.1)


def variance_over_n(errors: Array) -> tuple[float, float]:
    """The mean of the squared deviations from a mean that the same samples were fitted to."""
    return float(np.mean(errors)), float(np.var(errors))


def five_samples_give_the_variance_on_average(model: Moments) -> bool:
    """Over 20,000 draws of five samples the mean of the variances is right to 3 %, which is four standard errors."""
    draws = np.random.default_rng(2).normal(0.3, 2.0, (20_000, 5))
    return bool(abs(np.mean([model(draw)[1] for draw in draws]) / 4.0 - 1) < 0.03)


def error_of_the_mean_counting_repeats(errors: Array) -> float:
    """σ/√n, with n the rows of the file."""
    return float(np.std(errors, ddof=1) / np.sqrt(len(errors)))


def error_of_the_mean(errors: Array) -> float:
    """σ/√n, with n the independent samples that the rows are worth."""
    return float(np.std(errors, ddof=1) / np.sqrt(effective_samples(errors)))


def two_standard_errors_hold_the_truth(standard_error: Callable[[Array], float]) -> bool:
    """In 300 logs of 100 values, each written four times: is the true mean within 2 standard errors in 90 %?"""
    logs = np.repeat(np.random.default_rng(3).standard_normal((300, 100)), 4, axis=1)
    return bool(np.mean([abs(log.mean()) < 2 * standard_error(log) for log in logs]) > 0.9)


_REPORT = "the landmark report, assignment 4"

Failure(
    name="lab03.bias_called_variance",
    source=f"{_REPORT}: base var_d = 1.76e-02 over 1 to 10 m, used round the uncorrected measurement",
    wrong=variance_and_no_mean,
    right=mean_and_variance,
    check=stated_variance_is_the_error_left,
    lesson="The band is drawn round zero, the dots lie round somewhere else: no variance makes up for that.",
)

Failure(
    name="lab03.limits_on_the_truth",
    source=f"what {_REPORT}, avoided: its limits are on the measured range, and its figures come out only so",
    wrong=limits_on_the_truth,
    right=limits_on_the_measurement,
    check=covers_what_is_measured_inside_the_limits,
    lesson="The truth sorts out exactly the readings that the filter will meet and cannot sort out.",
)

Failure(
    name="lab03.divided_by_n",
    source="numpy.var and many a script built on it: ddof is 0 unless one asks for 1",
    wrong=variance_over_n,
    right=mean_and_variance,
    check=five_samples_give_the_variance_on_average,
    lesson="The samples lie nearer to their own mean than to the true one; with five of them, by a fifth.",
)

Failure(
    name="lab03.repeats_taken_as_independent",
    source=f"{_REPORT}: N samples = 1842, of which 408 repeat the range before them",
    wrong=error_of_the_mean_counting_repeats,
    right=error_of_the_mean,
    check=two_standard_errors_hold_the_truth,
    lesson="Writing a number down four times halves its standard error on paper and tells nothing new.",
)
