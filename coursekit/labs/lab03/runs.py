"""Lab 3's halves of a log, its two models, and the scores that compare them."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from coursekit.geometry import Array
from coursekit.noise import Log, NoiseModel, fit_calibrated, fit_piecewise
from coursekit.recordings import datasets

PICTURE_AGES = np.arange(3, 8) / 120  # s: of the world's log, each as often; data/make_landmark_log.py says why


@cache
def halves() -> tuple[Log, Log]:
    """The world's log, every other sample: what a model is fitted to, and what it is judged on."""
    log = datasets.load("landmark_log")
    return log[::2], log[1::2]


def nats(error: Array, sigma: Array | float) -> Array:
    """Log density of errors (n,) under N(0, sigma²), nats."""
    return np.asarray(-0.5 * (np.log(2 * np.pi) + np.square(error / sigma)) - np.log(sigma))


def binned(x: Array, y: Array, edges: Array) -> tuple[Array, Array, Array]:
    """Middle, mean and standard deviation of y in the bins of x that hold at least three samples."""
    bins = [y[(a <= x) & (x < b)] for a, b in pairwise(edges)]
    kept = [i for i, values in enumerate(bins) if len(values) >= 3]
    middles = (0.5 * (edges[:-1] + edges[1:]))[kept]
    return middles, np.array([bins[i].mean() for i in kept]), np.array([bins[i].std(ddof=1) for i in kept])


def standardised(model: NoiseModel, log: Log) -> Array:
    """Corrected errors in units of the spread that the model states for each, (n, 2)."""
    R = model.R(log.range, log.bearing, log.turn_rate, log.speed)
    return model.residuals(log) / np.sqrt(np.diagonal(R, axis1=-2, axis2=-1))


def reports_and_ours(log: Log) -> dict[str, NoiseModel]:
    """Both models, fitted to one log."""
    return {"report": fit_piecewise(log), "calibrated": fit_calibrated(log)}


def held_out(log: Log) -> dict[str, dict[str, tuple[float, float]]]:
    """Nats a sample on what a model has not seen, for three ways to cut the log in two; each part is judged once."""
    scores: dict[str, dict[str, tuple[float, float]]] = {}
    for name, pieces in (("every other sample", len(log)), ("ten stretches", 10), ("two halves", 2)):
        odd = np.arange(len(log)) * pieces // len(log) % 2 == 1
        first, second = reports_and_ours(log[~odd]), reports_and_ours(log[odd])
        scores[name] = {
            label: (first[label].log_likelihood(log[odd]), second[label].log_likelihood(log[~odd])) for label in first
        }
    return scores
