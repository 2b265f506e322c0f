"""Checks of lab 3: bias and variance, what a pixel is worth, a likelihood, a calibration, and a latency."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.teaching.exercises import call, close, exercise, expect


@exercise("lab03.moments")
def moments(answer: Any, rng: np.random.Generator) -> None:
    """[bias, variance, root mean square] of a range's errors."""
    n = int(rng.integers(5, 12))
    true = rng.uniform(1, 10, n)
    measured = true + rng.choice([-1, 1]) * rng.uniform(0.3, 0.6) + rng.normal(0, 0.2, n)
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
            "That grows like the range itself. Differentiate r = h f / n by n, then put n = h f / r in.": s
            * d
            / (h * f),
            "Read it as Python does: d**2 / h * f multiplies by f. What must stand under the line?": s * d**2 / h * f,
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
        otherwise="σ_r is |∂r/∂n| times σ of the pixels, with r = h f / n; write it with r in place of n.",
    )


@exercise("lab03.log_likelihood")
def log_likelihood(answer: Any, rng: np.random.Generator) -> None:
    """Mean log density of errors under N(0, σ²), with a σ for each."""
    n = int(rng.integers(4, 9))
    sigma = rng.uniform(0.05, 0.6, n)
    e = sigma * rng.standard_normal(n)
    z, two_pi = (e / sigma) ** 2, np.log(2 * np.pi)
    right = np.mean(-0.5 * (two_pi + z) - np.log(sigma))
    got = call(answer, e, sigma)
    expect(np.shape(got) != e.shape, "That is one number for each sample; their mean is asked for.")
    close(
        got,
        right,
        misconceptions={
            "You took σ for a variance: it is a standard deviation, so log σ² and e²/σ² hold its square.": np.mean(
                -0.5 * (two_pi + np.log(sigma) + e**2 / sigma)
            ),
            "log σ is missing: without it, the widest σ always wins.": np.mean(-0.5 * (two_pi + z)),
            "The constant ½ log 2π is missing: it cancels between models, not against anyone else's nats.": np.mean(
                -0.5 * z - np.log(sigma)
            ),
            "That is what an optimiser wants to make small; the log-likelihood has the other sign.": -right,
            "That is the sum. Per sample, so that logs of any length can be compared.": n * right,
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
    """[offset, inverse-range bias] of ranges whose noise is nearly nothing."""
    _calibrate(answer, rng, rng.uniform(0.1, 0.3), rng.uniform(0.003, 0.006))
    _calibrate(answer, rng, -rng.uniform(0.1, 0.3), rng.uniform(0.003, 0.006))
    _calibrate(answer, rng, rng.uniform(0.1, 0.3), -rng.uniform(0.003, 0.006))


def _calibrate(answer: Any, rng: np.random.Generator, offset: float, shortfall: float) -> None:
    true = rng.uniform(1.2, 20, 300)
    measured = 1 / (1 / (true - offset) - shortfall)
    slope, cut = np.polyfit(measured, true, 1)
    got = call(answer, measured, true)
    # Near a minimum that is not the one: an optimiser that starts where 1/r + bias changes sign ends there.
    elsewhere = np.shape(got) == (2,) and not _is_text(got) and bool(np.all(np.isfinite(np.asarray(got, dtype=float))))
    if elsewhere:
        a, b = np.asarray(got, dtype=float)
        expect(
            not (abs(a) > 1 and 0.05 < abs(b) < 5),
            f"Your optimiser stopped elsewhere, at {a:.3g} m and {b:.3g} /m. Look where it starts: a bias of 1 /m "
            "(curve_fit's default) is hundreds of times too large. Both constants are small, so start at 0 and 0.",
        )
    close(
        got,
        [offset, shortfall],
        misconceptions={
            "The offset has the wrong sign: what is added to a measured range to get the true one?": [
                -offset,
                shortfall,
            ],
            "The inverse-range bias has the wrong sign: asked for is what to add to 1/r, not what was taken.": [
                offset,
                -shortfall,
            ],
            "Offset first, then inverse-range bias.": [shortfall, offset],
            "That is a straight line through true against measured; the bias is not straight.": [cut, slope - 1],
            "Your inverse-range bias is 0: a mean error alone. Look at the residuals against range once more.": [
                np.mean(true - measured),
                0.0,
            ],
            "The offset is added to a measured range: an offset is the mean of true - measured, not the reverse. And "
            "there is an inverse-range bias, too.": [np.mean(measured - true), 0.0],
            "That is the inverse of the inverse-range bias, in metres.": [offset, 1 / shortfall],
        },
        otherwise="Which two numbers lay the corrected ranges on the true ones? Minimise a sum of squares over both.",
        tolerance=2e-4,
    )


def _is_text(got: Any) -> bool:
    return np.asarray(got).dtype.kind not in "biuf"


@exercise("lab03.latency")
def latency(answer: Any, rng: np.random.Generator) -> None:
    """Seconds by which the measured bearing lags behind a robot that turns."""
    late, bias = rng.uniform(0.05, 0.1), rng.choice([-1, 1]) * rng.uniform(0.02, 0.04)
    drift = rng.choice([-1, 1]) * rng.uniform(0.2, 0.3)
    stamp = 40 + np.cumsum(rng.uniform(0.03, 0.1, 400))
    true = 0.5 * np.sin(0.9 * stamp) + drift * (stamp - 40)
    rate = np.gradient(true, stamp)
    error = bias - late * rate + rng.normal(0, 1e-4, 400)
    got = call(answer, stamp, true, error)
    expect(np.ndim(got) == 0, "One number, in seconds, is asked for.")
    per_sample = np.gradient(true)
    by_error = np.polyfit(error, rate, 1)[0]

    def near(value: float) -> bool:
        return bool(abs(float(got) - value) < 0.01 * abs(value))

    through_zero = -float(rate @ error / (rate @ rate))
    correlation = float(np.corrcoef(rate, error)[0, 1])
    expect(not near(-late), "The sign: an old bearing lags behind, so a bearing that grows is measured too small.")
    for hint, values in {
        "That is in milliseconds.": [1e3 * late],
        "That is a number of samples: the turn rate is a change per second, and the stamps are not evenly spaced.":
            [-np.polyfit(per_sample, error, 1)[0]],
        "You fitted the turn rate to the error; the error is what wants explaining.": [by_error, 1 / late],
        "That is a correlation, which has no unit. How many seconds does the slope say?": [correlation],
        "You fitted the error to the bearing itself; it goes with the turn rate.": [np.polyfit(true, error, 1)[0]],
        "That is the constant part of the error, in radians, not the slope.": [np.polyfit(rate, error, 1)[1]],
        "Your line runs through zero; but there is a constant error too, and it pulls the slope.": [through_zero],
    }.items():  # fmt: skip
        expect(near(late) or not any(near(value) or near(-value) for value in values), hint)
    expect(
        bool(np.isfinite(got)) and abs(float(got) - late) < 2e-3,
        "Error against turn rate (np.gradient takes stamps as its second argument) is a line; what is its slope?",
    )
