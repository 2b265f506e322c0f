"""The checks of Lab 7: effective sample size, resampling, the mean of headings, noise and its step, KLD-sampling."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import logsumexp

from coursekit import particles
from coursekit.geometry import wrap_angle
from coursekit.teaching.exercises import call, close, exercise, expect


@exercise("lab07.effective_size")
def effective_size(answer: Any, rng: np.random.Generator) -> None:
    n = int(rng.integers(20, 60))
    _effective_size(answer, rng.normal(-800, 2, size=n))
    wide = (
        "Your number is right for weights of one size, and not when logs lie between -800 and 0: add the same number "
    )
    wide += "to all, but one that depends on them. Which?"
    logs = np.r_[0.0, -1.0, rng.uniform(-800, -5, n)]
    for few in (rng.permutation(logs), np.array([-800.0]), np.full(n, -3.0), logs + 700):
        w = np.exp(few - logsumexp(few))
        close(call(answer, few), 1 / np.sum(w**2), misconceptions={wide: np.nan, wide + " ": np.inf}, otherwise=wide)


def _effective_size(answer: Any, log_weights: Any) -> None:
    n = len(log_weights)
    got = call(answer, log_weights)
    shifted = np.exp(log_weights - log_weights.max())
    w = shifted / shifted.sum()
    close(
        got,
        1 / np.sum(w**2),
        misconceptions={
            "exp(-800) is zero in double precision, and zero over zero is not a number. What may you add to every "
            "log weight without changing the normalised weights?": np.nan,
            "exp(-800) is zero in double precision, and one over zero is no number of particles. Which number, "
            "added to every log weight, cancels when the weights are normalised?": np.inf,
            "The weights have to sum to one before you square them.": 1 / np.sum(shifted**2),
            "That counts the weights above zero; a particle with a millionth of the weight is not a whole one.": n,
            "That looks at the heaviest particle alone; the others count too, through Σw².": 1 / w.max(),
            "Those are the logs themselves; the formula wants weights.": log_weights.sum() ** 2
            / np.sum(log_weights**2),
            "That is the perplexity, the exponential of the entropy: a relative, but not this one.": np.exp(
                -np.sum(w * np.log(w))
            ),
        },
        otherwise="Try equal weights: all n must count; then one weight that rules: one must count.",
    )


@exercise("lab07.systematic")
def systematic(answer: Any, rng: np.random.Generator) -> None:
    n = int(rng.integers(12, 20))
    weights = rng.dirichlet(np.full(n, 0.4)) * 3.0 + 1e-4
    # Among weights that are nearly even, every mistake shows; among uneven ones an answer without u may be right.
    _systematic(answer, rng.dirichlet(np.full(n, 4.0)) * 3.0, float(rng.uniform(0.3, 0.9)))
    _systematic(answer, weights / 5, float(rng.uniform(0.02, 0.3)))
    zeros = np.r_[0.0, weights, 0.0]
    for some, u, hint in (
        (weights, 0.0, "Right, but not when u is 0: the first position is then 0, and it belongs to the first "
                       "interval."),
        (zeros, rng.uniform(0.3, 0.7), "A particle of weight zero has no interval, so no position may choose it."),
        (np.array([2.5]), 0.5, "One particle alone gets the one position: an index array of one zero."),
    ):  # fmt: skip
        cumulative = np.cumsum(some) / some.sum()
        close(call(answer, some, float(u)), np.searchsorted(cumulative, (np.arange(len(some)) + u) / len(some)),
              otherwise=hint, together=False)  # fmt: skip


def _systematic(answer: Any, weights: Any, u: float) -> None:
    n = len(weights)
    got = call(answer, weights, u)
    cumulative = np.cumsum(weights) / weights.sum()
    positions = (np.arange(n) + u) / n
    expected = np.searchsorted(cumulative, positions)
    copies = np.bincount(expected, minlength=n)
    close(
        got,
        expected,
        misconceptions={
            "Your cumulative weights do not end at one: the weights need not sum to one.": np.searchsorted(
                np.cumsum(weights), positions
            ),
            "u moves each position within its own 1/N; you moved all of them by the whole of u.": np.searchsorted(
                cumulative, np.minimum(np.arange(n) / n + u, 1.0)
            ),
            "Those are the numbers of copies; asked for are the indices, one for each position.": copies,
            "Counting from one: the first particle is number 0.": expected + 1,
            "Your positions are j/N: where is u?": np.searchsorted(cumulative, np.arange(n) / n),
            "Each position chose the interval before its own: interval i ends at the sum of weights 0 to i.": (
                np.maximum(expected - 1, 0)
            ),
        },
        otherwise="Draw [0, 1] with the weights laid end to end, the N positions (j + u)/N above it, and read "
        "off the interval under each.",
        tolerance=1e-9,
    )


@exercise("lab07.mean_heading")
def mean_heading(answer: Any, rng: np.random.Generator) -> None:
    n, off = 15, rng.uniform(0.15, 0.4)
    weights = np.r_[0.03, 0.02, 0.95 * rng.dirichlet(np.full(n - 2, 2.0))]
    for centre in (np.pi - off, off - np.pi):  # to either side of the seam
        headings = wrap_angle(centre + rng.uniform(-0.5, 0.5, size=n))
        headings[:2] = [3.0, -3.0]  # both sides of ±π, always
        _mean_heading(answer, headings, weights)
    for centre in np.pi / 4 * np.arange(-3, 4) + rng.uniform(-0.1, 0.1):
        _mean_heading(answer, wrap_angle(centre + rng.uniform(-0.8, 0.8, size=n)), weights)


def _mean_heading(answer: Any, headings: Any, weights: Any) -> None:
    got = call(answer, headings, weights)
    s, c = weights @ np.sin(headings), weights @ np.cos(headings)
    expected = np.arctan2(s, c)
    close(
        got,
        expected,
        misconceptions={
            "A plain mean: of 3.1 and -3.1 rad it makes 0, which is the opposite way.": weights @ headings,
            "All particles counted alike: where are the weights?": np.arctan2(
                np.sin(headings).mean(), np.cos(headings).mean()
            ),
            "atan of a quotient cannot tell a direction from its opposite: use two arguments.": np.arctan(s / c),
            "You measured the angle from the y axis: which argument of atan2 comes first?": np.arctan2(c, s),
            "The right direction, written in [0, 2π): headings live in (-π, π] here.": np.mod(expected, 2 * np.pi),
            "A plain mean, and without the weights.": headings.mean(),
            "You measured the angle from the y axis, and all particles counted alike.": np.arctan2(
                np.cos(headings).mean(), np.sin(headings).mean()
            ),
            "Wrapping the plain mean does not help: the harm was done in the sum.": wrap_angle(
                weights @ headings + np.pi
            ),
        },
        otherwise="Turn each heading into a unit vector, take the weighted mean of the vectors, ask for its direction.",
    )


@exercise("lab07.sigma_for_steps")
def sigma_for_steps(answer: Any, rng: np.random.Generator) -> None:
    sigma, steps = float(rng.uniform(0.05, 0.8)), int(rng.integers(5, 200))  # for 4, half of the right answer is σ
    got = call(answer, sigma, steps)
    close(
        got,
        sigma * np.sqrt(steps),
        misconceptions={
            "The same σ in each step: independent errors cancel in part, and the heading's spread shrinks.": sigma,
            "Upside down: with σ/√steps the spread falls twice over.": sigma / np.sqrt(steps),
            "Dividing makes the noise weaker still; in a shorter step it has to be stronger.": sigma / steps,
            "That would be right for errors that add up without ever cancelling.": sigma * steps,
            "That is σ²·steps, a variance: take its root.": sigma**2 * steps,
        },
        otherwise="The heading after T is the sum of `steps` independent terms ω_i·T/steps: what is its variance, and "
        "what was it in one step?",
    )


@exercise("lab07.kld_resample")
def kld_resample(answer: Any, rng: np.random.Generator) -> None:
    one_bin = rng.uniform([1.0, 4.0], [1.4, 5.9], (400, 2))
    _enough_for_many_bins(answer, rng)
    # Everything in one bin: nothing but the floor of 50 asks for more than one particle.
    got = _drawn(answer, one_bin, np.full(400, 1 / 400), np.array([0.5, 2.0]), rng)
    expect(
        len(got) >= 50, f"You drew {len(got)} when all of them fell into one bin; the exercise asks for 50 at least."
    )
    _not_too_many(len(got), 100)


def _drawn(answer: Any, states: Any, weights: Any, bin_size: Any, rng: np.random.Generator) -> Any:
    first = (
        "Before the first particle is drawn no bin is filled, and kld_size answers for one bin at least: draw first, "
    )
    first += "then ask."
    got = np.asarray(call(answer, states, weights, bin_size, rng, stops={"bins: expected": first}))
    expect(got.ndim == 1 and got.dtype.kind in "iu", "Return the indices of the particles drawn, whole numbers, (m,).")
    expect(
        got.size > 0 and got.min() >= 0 and got.max() < len(states), "Some indices name particles that do not exist."
    )
    return got


def _enough_for_many_bins(answer: Any, rng: np.random.Generator) -> None:
    n = 6000
    states = rng.uniform(0, 24, size=(n, 2))
    centre = rng.uniform(6, 18, size=2)
    weights = np.exp(-0.5 * np.sum(((states - centre) / 0.8) ** 2, axis=1))
    weights /= weights.sum()
    bin_size = np.array([0.4, 3.0])
    got = _drawn(answer, states, weights, bin_size, rng)
    expect(got.size != n, "As many as before: the point is that the cloud's size follows from what was drawn.")
    heavy = weights > np.median(weights)
    expect(heavy[got].mean() > 0.9, "Light particles are as common as heavy ones: draw in proportion to the weights.")
    m, bins = got.size, particles.occupied_bins(states[got], bin_size)
    enough = particles.kld_size(bins)
    distinct = particles.kld_size(len(np.unique(got)))
    expect(
        not (distinct > 1.2 * enough and 0.9 * distinct < m < 1.15 * distinct),
        "You counted particles, not bins: two particles in one bin are one bin.",
    )
    everywhere = particles.kld_size(particles.occupied_bins(states, bin_size))
    expect(
        not 0.95 * everywhere < m < 1.05 * everywhere,
        "You counted the bins that the old cloud fills; count those that hold a particle you have drawn.",
    )
    for side in bin_size:
        counted = particles.kld_size(particles.occupied_bins(states[got], np.full(2, side)))
        expect(
            not (abs(m - counted) <= 3 + 0.02 * counted and not 0.5 * enough < m < 1.5 * enough),
            "Your bins are square; bin_size has one side for each column.",
        )
    expect(m >= enough, "You stopped too early: more particles are called for by the bins that you have filled.")
    _not_too_many(m, 1.25 * enough + 60)


def _not_too_many(drawn: int, limit: float) -> None:
    expect(
        drawn <= limit,
        f"You went on drawing after the bins that you have filled asked for no more ({drawn} in all). Ask after each "
        "particle, or leave out what is too many.",
    )
