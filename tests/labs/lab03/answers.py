"""Lab 3's answers: right ones, and the wrong turns that each hint is for."""

import numpy as np
from scipy.optimize import curve_fit, least_squares
from scipy.stats import norm

from tests.labs.answers import Answers


def stub(*_):
    raise NotImplementedError


def _moments(measured, true):
    e = measured - true
    return np.array([e.mean(), e.var(ddof=1), np.sqrt(np.mean(e**2))])


def _moments_by_sums(measured, true):
    e = [m - t for m, t in zip(measured, true, strict=True)]
    n, bias = len(e), sum(e) / len(e)
    return [bias, sum((x - bias) ** 2 for x in e) / (n - 1), (sum(x * x for x in e) / n) ** 0.5]


def _changed(index, value):
    def answer(measured, true):
        result, e = list(_moments(measured, true)), measured - true
        result[index] = value(e)
        return result

    return answer


def _shifted_in_place(measured, true):
    measured -= true
    return [measured.mean(), measured.var(ddof=1), np.sqrt(np.mean(measured**2))]


def _nats(e, sigma):
    return np.mean(-0.5 * np.log(2 * np.pi) - np.log(sigma) - 0.5 * (e / sigma) ** 2)


def _calibrate(measured, true):
    return least_squares(lambda p: 1 / (1 / measured + p[1]) + p[0] - true, [0.0, 0.0]).x


def _corrected(measured, offset, shortfall):
    return 1 / (1 / measured + shortfall) + offset


def _calibrate_from_the_default_start(measured, true):
    return curve_fit(_corrected, measured, true)[0]


def _calibrate_in_inverse_range(measured, true):
    offset, shortfall = 0.0, 0.0
    for _ in range(30):  # Gauss-Newton on 1/(true - offset) - shortfall = 1/measured
        rim = true - offset
        A = np.stack([rim**-2, -np.ones_like(rim)], axis=-1)
        step = np.linalg.lstsq(A, 1 / measured - (1 / rim - shortfall), rcond=None)[0]
        offset, shortfall = offset + step[0], shortfall + step[1]
    return [offset, shortfall]


def _latency(stamp, bearing, error):
    return -np.polyfit(np.gradient(bearing, stamp), error, 1)[0]


def _latency_by_covariance(stamp, bearing, error):
    rate = np.gradient(bearing, stamp)
    return -np.cov(rate, error)[0, 1] / np.var(rate, ddof=1)


ANSWERS = {
    "lab03.moments": Answers(
        stub=stub,
        reference=_moments,
        second=_moments_by_sums,
        wrong={
            "sign of the bias": (_changed(0, lambda e: -e.mean()), "The sign of the bias"),
            "divided by n": (_changed(1, lambda e: e.var()), "You divided by n"),
            "variance about zero": (_changed(1, lambda e: np.mean(e**2)), "about zero, so the bias"),
            "standard deviation for variance": (_changed(1, lambda e: e.std(ddof=1)), "a variance is its square"),
            "mean square from the unbiased variance": (
                _changed(2, lambda e: np.sqrt(e.mean() ** 2 + e.var(ddof=1))),
                "yours is over n - 1",
            ),
            "mean square for its root": (_changed(2, lambda e: np.mean(e**2)), "Take its root"),
            "spread for root mean square": (_changed(2, lambda e: e.std()), "knows nothing of the bias"),
            "changed in place": (_shifted_in_place, "in place"),
        },
        both={
            "sign of the bias, divided by n": (
                lambda m, t: [np.mean(t - m), np.var(m - t), _moments(m, t)[2]],
                ("The sign of the bias", "You divided by n"),
            ),
            "standard deviation, mean square": (
                lambda m, t: [np.mean(m - t), np.std(m - t, ddof=1), np.mean((m - t) ** 2)],
                ("a variance is its square", "Take its root"),
            ),
        },
    ),
    "lab03.range_sigma": Answers(
        stub=stub,
        reference=lambda d, s, h, f: s * d**2 / (h * f),
        second=lambda d, s, h, f: np.abs(-h * f / (h * f / d) ** 2) * s,
        wrong={
            "linear": (lambda d, s, h, f: s * d / (h * f), "grows like the range itself"),
            "no height": (lambda d, s, h, f: s * d**2 / f, "own height is missing"),
            "height upside down": (lambda d, s, h, f: s * d**2 * h / f, "taller landmark make the range worse"),
            "upside down": (lambda d, s, h, f: s * h * f / d**2, "the other way up"),
            "variance": (lambda d, s, h, f: (s * d**2 / (h * f)) ** 2, "That is a variance"),
            "negative": (lambda d, s, h, f: -s * d**2 / (h * f), "never negative"),
            "pixels' variance": (lambda d, s, h, f: s**2 * d**2 / (h * f), "squared the pixels"),
            "one pixel": (lambda d, s, h, f: d**2 / (h * f), "what one pixel is worth"),
            "no brackets": (lambda d, s, h, f: d**2 / h * f * s, "as Python does"),
        },
        both={
            "linear, negative": (lambda d, s, h, f: -s * d / (h * f), ("grows like the range", "never negative")),
            "no height, pixels' variance": (
                lambda d, s, h, f: s**2 * d**2 / f,
                ("own height is missing", "squared the pixels"),
            ),
            "linear, one pixel": (lambda d, s, h, f: d / (h * f), ("grows like the range", "one pixel is worth")),
        },
    ),
    "lab03.log_likelihood": Answers(
        stub=stub,
        reference=_nats,
        second=lambda e, sigma: norm(0, sigma).logpdf(e).mean(),
        wrong={
            "no log σ": (lambda e, s: np.mean(-0.5 * np.log(2 * np.pi) - 0.5 * (e / s) ** 2), "the widest σ"),
            "no constant": (lambda e, s: np.mean(-np.log(s) - 0.5 * (e / s) ** 2), "The constant"),
            "negative": (lambda e, s: -_nats(e, s), "the other sign"),
            "one each": (lambda e, s: norm(0, s).logpdf(e), "one number for each sample"),
            "no logarithm": (lambda e, s: norm(0, s).pdf(e).mean(), "mean density. Take"),
            "no half": (lambda e, s: _nats(e, s) - 0.5 * np.mean((e / s) ** 2), "One half is missing"),
            "log σ twice": (lambda e, s: _nats(e, s) - np.mean(np.log(s)), "counts once"),
            "sum": (lambda e, s: len(e) * _nats(e, s), "That is the sum"),
            "log of the mean": (lambda e, s: np.log(norm(0, s).pdf(e).mean()), "log of the mean density"),
            "σ not squared": (
                lambda e, s: np.mean(-0.5 * np.log(2 * np.pi) - np.log(s) - 0.5 * e**2 / s),
                "its σ is not",
            ),
            "one σ": (lambda e, s: norm(0, s.mean()).logpdf(e).mean(), "each error has its own"),
            "half of log σ": (
                lambda e, s: np.mean(-0.5 * np.log(2 * np.pi) - 0.5 * np.log(s) - 0.5 * (e / s) ** 2),
                "counts half",
            ),
            "a variance": (lambda e, s: norm(0, np.sqrt(s)).logpdf(e).mean(), "took σ for a variance"),
        },
        both={
            "sum, negative": (lambda e, s: -len(e) * _nats(e, s), ("That is the sum", "the other sign")),
            "no log σ, no constant": (
                lambda e, s: np.mean(-0.5 * (e / s) ** 2),
                ("the widest σ", "The constant"),
            ),
            "no half, no constant": (
                lambda e, s: np.mean(-np.log(s) - (e / s) ** 2),
                ("One half is missing", "The constant"),
            ),
        },
    ),
    "lab03.calibrate": Answers(
        stub=stub,
        reference=_calibrate,
        second=_calibrate_in_inverse_range,
        wrong={
            "offset's sign": (lambda m, t: _calibrate(m, t) * [-1, 1], "offset has the wrong sign"),
            "shortfall's sign": (lambda m, t: _calibrate(m, t) * [1, -1], "inverse-range bias has the wrong sign"),
            "order": (lambda m, t: _calibrate(m, t)[::-1], "Offset first"),
            "a line": (lambda m, t: np.polyfit(m, t, 1)[::-1] - [0, 1], "not straight"),
            "mean error": (lambda m, t: [np.mean(t - m), 0.0], "a mean error alone"),
            "mean error's sign": (lambda m, t: [np.mean(m - t), 0.0], "not the reverse"),
            "inverse": (lambda m, t: _calibrate(m, t) ** np.array([1, -1]), "inverse of the inverse-range bias"),
            "another minimum": (_calibrate_from_the_default_start, "stopped elsewhere"),
        },
        more=[lambda m, t: curve_fit(_corrected, m, t, p0=[0, 0])[0]],
        both={
            "both signs": (lambda m, t: -_calibrate(m, t), ("Only the sign", "has the wrong sign")),
            "order, offset's sign": (
                lambda m, t: _calibrate(m, t)[::-1] * [1, -1],
                ("Offset first", "has the wrong sign"),
            ),
        },
    ),
    "lab03.latency": Answers(
        stub=stub,
        reference=_latency,
        second=_latency_by_covariance,
        wrong={
            "sign": (lambda t, b, e: -_latency(t, b, e), "The sign"),
            "milliseconds": (lambda t, b, e: 1e3 * _latency(t, b, e), "milliseconds"),
            "per sample": (lambda t, b, e: -np.polyfit(np.gradient(b), e, 1)[0], "a number of samples"),
            "the other way round": (lambda t, b, e: np.polyfit(e, np.gradient(b, t), 1)[0], "wants explaining"),
            "through zero": (
                lambda t, b, e: -(np.gradient(b, t) @ e) / (np.gradient(b, t) @ np.gradient(b, t)),
                "runs through zero",
            ),
            "against the bearing": (lambda t, b, e: np.polyfit(b, e, 1)[0], "bearing itself"),
            "intercept": (lambda t, b, e: np.polyfit(np.gradient(b, t), e, 1)[1], "constant part of the error"),
            "correlation": (lambda t, b, e: np.corrcoef(np.gradient(b, t), e)[0, 1], "That is a correlation"),
            "all of them": (lambda t, b, e: np.gradient(b, t), "One number"),
        },
        both={
            "sign, milliseconds": (lambda t, b, e: -1e3 * _latency(t, b, e), ("milliseconds", "The sign")),
            "sign, per sample": (
                lambda t, b, e: np.polyfit(np.gradient(b), e, 1)[0],
                ("a number of samples", "The sign"),
            ),
            "sign, through zero": (
                lambda t, b, e: (np.gradient(b, t) @ e) / (np.gradient(b, t) @ np.gradient(b, t)),
                ("runs through zero", "The sign"),
            ),
        },
    ),
}
