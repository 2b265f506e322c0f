"""Checks of lab 3: bias and variance, what a pixel is worth, a likelihood, a calibration, and a latency."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.exercises import call, close, exercise, expect


@exercise("lab03.moments")
def moments(answer: Any, rng: np.random.Generator) -> None:
    """[bias, variance, root mean square] of a range's errors."""
    true = rng.uniform(1, 10, 8)
    measured = true + rng.choice([-1, 1]) * rng.uniform(0.3, 0.6) + rng.normal(0, 0.2, 8)
    e = measured - true
    right = np.array([e.mean(), e.var(ddof=1), np.sqrt(np.mean(e**2))])
    close(
        call(answer, measured, true),
        right,
        misconceptions={
            "The sign of the bias: an error is measured minus true, so a range that comes out long is positive.": right
            * [-1, 1, 1],
            "You divided by n. The mean was fitted to the same samples, and that cost one of them.": [
                right[0],
                e.var(),
                right[2],
            ],
            "Your variance is taken about zero, so the bias is in it a second time.": [
                right[0],
                np.mean(e**2),
                right[2],
            ],
            "Your second number is a standard deviation; a variance is its square.": [
                right[0],
                e.std(ddof=1),
                right[2],
            ],
            "bias² + variance is the mean square only with a variance over n; yours is over n - 1.": [
                *right[:2],
                np.sqrt(right[0] ** 2 + right[1]),
            ],
            "Your third number is the mean square. Take its root: it should be in metres.": [
                *right[:2],
                np.mean(e**2),
            ],
            "Your third number knows nothing of the bias: a root mean square error is taken about zero.": [
                *right[:2],
                e.std(),
            ],
        },
        otherwise="Three numbers in this order: the mean error, the variance about it, and the root mean square error.",
    )


@exercise("lab03.range_sigma")
def range_sigma(answer: Any, rng: np.random.Generator) -> None:
    """The standard deviation of a range, from that of a height in pixels."""
    d, s, h, f = rng.uniform(2, 20, 5), rng.uniform(0.2, 0.9), rng.uniform(0.3, 0.8), rng.uniform(300, 800)
    close(
        call(answer, d, s, h, f),
        s * d**2 / (h * f),
        misconceptions={
            "That grows like the range itself. Differentiate d = h f / n by n, then put n = h f / d in.": s
            * d
            / (h * f),
            "The landmark's own height is missing: a taller one has more pixels to share the error.": s * d**2 / f,
            "The landmark's height stands in the numerator; does a taller landmark make the range worse?": s
            * d**2
            * h
            / f,
            "That is metres into pixels. You want pixels into metres, the other way up.": s * h * f / d**2,
            "That is a variance. The standard deviation is asked for.": (s * d**2 / (h * f)) ** 2,
            "A standard deviation is never negative: take the size of the derivative.": -s * d**2 / (h * f),
            "You squared the pixels' σ: that is their variance, and a standard deviation is asked for.": s**2
            * d**2
            / (h * f),
            "You left the pixels' own σ out: that is what one pixel is worth.": d**2 / (h * f),
        },
        otherwise="σ_d is |∂d/∂n| times σ of the pixels, with d = h f / n; write it with d in place of n.",
    )


@exercise("lab03.log_likelihood")
def log_likelihood(answer: Any, rng: np.random.Generator) -> None:
    """Mean log density of errors under N(0, σ²), with a σ for each."""
    sigma = rng.uniform(0.05, 0.6, 6)
    e = sigma * rng.standard_normal(6)
    z, two_pi = (e / sigma) ** 2, np.log(2 * np.pi)
    right = np.mean(-0.5 * (two_pi + z) - np.log(sigma))
    got = call(answer, e, sigma)
    expect(np.shape(got) != e.shape, "That is one number for each sample; their mean is asked for.")
    close(
        got,
        right,
        misconceptions={
            "log σ is missing: without it, the widest σ always wins.": np.mean(-0.5 * (two_pi + z)),
            "The constant ½ log 2π is missing: it cancels between models, not against anyone else's nats.": np.mean(
                -0.5 * z - np.log(sigma)
            ),
            "That is what an optimiser wants to make small; the log-likelihood has the other sign.": -right,
            "That is the sum. Per sample, so that logs of any length can be compared.": 6 * right,
            "That is the log of the mean density; densities are multiplied, so their logs are added.": np.log(
                np.mean(np.exp(-0.5 * (two_pi + z)) / sigma)
            ),
            "That is the mean density. Take the logarithm of each, then their mean.": np.mean(
                np.exp(-0.5 * (two_pi + z)) / sigma
            ),
            "One half is missing: the square enters as e²/(2σ²).": np.mean(-0.5 * two_pi - np.log(sigma) - z),
            "log σ counts once: ½ log(2πσ²) holds one log σ.": np.mean(-0.5 * (two_pi + z) - 2 * np.log(sigma)),
            "The error is squared, its σ is not.": np.mean(-0.5 * (two_pi + e**2 / sigma) - np.log(sigma)),
            "You used one σ, some average, for all; each error has its own.": np.mean(
                -0.5 * (two_pi + (e / sigma.mean()) ** 2) - np.log(sigma.mean())
            ),
            "log σ counts half: ½ log σ² is log σ.": np.mean(-0.5 * (two_pi + z) - 0.5 * np.log(sigma)),
        },
        otherwise="Write down the Gaussian density of one error, take its log term by term, and average.",
    )


@exercise("lab03.calibrate")
def calibrate(answer: Any, rng: np.random.Generator) -> None:
    """[offset, shortfall] of ranges whose noise is nearly nothing."""
    offset, shortfall = rng.uniform(0.1, 0.3), rng.uniform(0.003, 0.006)
    true = rng.uniform(1.2, 20, 300)
    measured = 1 / (1 / (true - offset) - shortfall)
    slope, cut = np.polyfit(measured, true, 1)
    got = call(answer, measured, true)
    close(
        got,
        [offset, shortfall],
        misconceptions={
            "The offset has the wrong sign: what is added to a measured range to get the true one?": [
                -offset,
                shortfall,
            ],
            "The shortfall has the wrong sign: pixels are missing, so 1/d is too small and something is to be added.": [
                offset,
                -shortfall,
            ],
            "Offset first, then shortfall.": [shortfall, offset],
            "That is a straight line through true against measured; the bias is not straight.": [cut, slope - 1],
            "Your shortfall is 0: a mean error alone. Look at the residuals against range once more.": [
                np.mean(true - measured),
                0.0,
            ],
            "The offset is added to a measured range: an offset is the mean of true - measured, not the reverse. And "
            "there is a shortfall, too.": [np.mean(measured - true), 0.0],
            "That is the shortfall's inverse, in metres.": [offset, 1 / shortfall],
        },
        otherwise="Which two numbers lay the corrected ranges on the true ones? Minimise a sum of squares over both.",
        tolerance=2e-4,
    )


@exercise("lab03.latency")
def latency(answer: Any, rng: np.random.Generator) -> None:
    """Seconds by which the measured bearing lags behind a robot that turns."""
    late, bias = rng.uniform(0.02, 0.08), rng.choice([-1, 1]) * rng.uniform(0.02, 0.04)
    stamp = 40 + np.cumsum(rng.uniform(0.03, 0.1, 400))
    true = 0.5 * np.sin(0.9 * stamp) + 0.05 * (stamp - 40) / 10
    rate = np.gradient(true, stamp)
    error = bias - late * rate + rng.normal(0, 1e-4, 400)
    got = call(answer, stamp, true, error)
    expect(np.ndim(got) == 0, "One number, in seconds, is asked for.")
    per_sample = np.gradient(true)
    by_error = np.polyfit(error, rate, 1)[0]

    def near(value: float) -> bool:
        return bool(abs(float(got) - value) < 0.03 * abs(value))

    expect(not near(-late), "The sign: an old bearing lags behind, so a bearing that grows is measured too small.")
    expect(not near(1e3 * late), "That is in milliseconds.")
    expect(
        not (near(-np.polyfit(per_sample, error, 1)[0]) or near(np.polyfit(per_sample, error, 1)[0])),
        "That is a number of samples: the turn rate is a change per second, and the stamps are not evenly spaced.",
    )
    expect(
        not (near(by_error) or near(-by_error) or near(1 / late)),
        "You fitted the turn rate to the error; the error is what wants explaining.",
    )
    through_zero = -float(rate @ error / (rate @ rate))
    expect(
        not (abs(float(got) - through_zero) < 1e-6 and abs(through_zero - late) > 5e-4),
        "Your line runs through zero; but there is a constant error too, and it pulls the slope.",
    )
    expect(
        not near(float(np.corrcoef(rate, error)[0, 1])) and not near(-float(np.corrcoef(rate, error)[0, 1])),
        "That is a correlation, which has no unit. How many seconds does the slope say?",
    )
    for value, hint in {
        float(np.polyfit(true, error, 1)[0]): "You fitted the error to the bearing itself; it goes with the turn rate.",
        float(np.polyfit(rate, error, 1)[1]): "That is the constant part of the error, in radians, not the slope.",
    }.items():
        expect(near(late) or not (near(value) or near(-value)), hint)
    expect(
        bool(np.isfinite(got)) and abs(float(got) - late) < 2e-3,
        "Error against turn rate (np.gradient takes stamps as its second argument) is a line; what is its slope?",
    )
