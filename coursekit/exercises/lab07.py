"""The checks of Lab 7: weights in logs, one comb, headings on a circle, noise and its step, clouds sized by need."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import logsumexp

from coursekit import particles
from coursekit.exercises import call, close, exercise, expect
from coursekit.geometry import wrap_angle


@exercise("lab07.effective_size")
def effective_size(answer: Any, rng: np.random.Generator) -> None:
    n = int(rng.integers(20, 60))
    log_weights = rng.normal(-800, 2, size=n)
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


@exercise("lab07.weigh")
def weigh(answer: Any, rng: np.random.Generator) -> None:
    prior = np.log(rng.dirichlet(np.full(12, 2.0)))
    gained = rng.normal(-900, 3, size=12)
    gained[rng.integers(12)] = -np.inf
    got = call(answer, prior, gained)
    expected = prior + gained - logsumexp(prior + gained)
    with np.errstate(invalid="ignore"):
        times = prior * gained
        mixed = prior + gained
        close(
            got,
            expected,
            misconceptions={
                "That forgets what each particle weighed before the measurement.": gained - logsumexp(gained),
                "Those are weights; the caller asked for their logs, because the weights may underflow.": np.exp(
                    expected
                ),
                "A product of weights is a sum of logs: you multiplied the logs.": times - logsumexp(times),
                "The heaviest is at zero now, but the weights do not sum to one yet.": mixed - mixed.max(),
                "The weights do not sum to one: Bayes' rule has a denominator.": mixed,
                "Dividing logs by their sum normalises nothing: dividing weights is subtracting a log.": mixed
                / mixed[np.isfinite(mixed)].sum(),
                "Everything underflowed: subtract the largest before you take the exponential.": np.full(12, -np.inf),
                "Zero over zero: the weights underflowed. Subtract the largest log first.": np.full(12, np.nan),
                "The logarithm of zero: the sum underflowed. Subtract the largest log before you add up.": mixed
                + np.inf,
            },
            otherwise="Write Bayes' rule for one particle, take its logarithm, then look at the denominator.",
        )


@exercise("lab07.systematic")
def systematic(answer: Any, rng: np.random.Generator) -> None:
    n = int(rng.integers(12, 20))
    weights, u = rng.dirichlet(np.full(n, 0.4)) * 3.0 + 1e-4, float(rng.uniform(0.3, 0.9))
    got = call(answer, weights, u)
    rim = np.cumsum(weights) / weights.sum()
    teeth = (np.arange(n) + u) / n
    expected = np.searchsorted(rim, teeth)
    copies = np.bincount(expected, minlength=n)
    close(
        got,
        expected,
        misconceptions={
            "Your teeth ran over a strip that is not one long: the weights need not sum to one.": np.searchsorted(
                np.cumsum(weights), teeth
            ),
            "u says where in its own 1/n each tooth stands; you moved the comb by the whole of u.": np.searchsorted(
                rim, np.minimum(np.arange(n) / n + u, 1.0)
            ),
            "Those are the numbers of copies; asked for are the indices, one for each tooth.": copies,
            "Counting from one: the first particle is number 0.": expected + 1,
            "The teeth stand at k/n: where is u?": np.searchsorted(rim, np.arange(n) / n),
            "Each tooth chose the slice before its own: the slice i ends at the sum of the weights up to and with i.": (
                np.maximum(expected - 1, 0)
            ),
        },
        otherwise="Draw the strip [0, 1] with the weights laid end to end, the n teeth (k + u)/n above it, and read "
        "off the slice under each.",
    )


@exercise("lab07.mean_heading")
def mean_heading(answer: Any, rng: np.random.Generator) -> None:
    n, centre = 15, float(wrap_angle(np.pi + rng.uniform(-0.25, 0.25)))
    headings = wrap_angle(centre + rng.normal(0, 0.5, size=n))
    headings[:2] = [3.0, -3.0]  # both sides of ±π, always
    weights = rng.dirichlet(np.full(n, 0.7))
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
            "The right direction, written in [0, 2π): headings live in (-π, π] here.": np.mod(expected, 2 * np.pi)
            if expected < 0
            else expected - 2 * np.pi,
            "Wrapping the plain mean does not help: the harm was done in the sum.": wrap_angle(
                weights @ headings + np.pi
            ),
        },
        otherwise="Turn each heading into a unit vector, take the weighted mean of the vectors, ask for its direction.",
    )


@exercise("lab07.sigma_for_steps")
def sigma_for_steps(answer: Any, rng: np.random.Generator) -> None:
    sigma, steps = float(rng.uniform(0.05, 0.8)), int(rng.integers(2, 200))
    got = call(answer, sigma, steps)
    close(
        got,
        sigma * np.sqrt(steps),
        misconceptions={
            "The same σ in each step: independent errors cancel in part, and the heading's spread shrinks.": sigma,
            "Upside down: with σ/√k the spread falls twice over.": sigma / np.sqrt(steps),
            "Dividing makes the noise weaker still; in a shorter step it has to be stronger.": sigma / steps,
            "That would be right for errors that add up without ever cancelling.": sigma * steps,
            "That is σ²k, a variance: take its root.": sigma**2 * steps,
        },
        otherwise="The heading after T is the sum of k independent terms ω_i·T/k: what is its variance, and what was "
        "it in one step?",
    )


@exercise("lab07.kld_resample")
def kld_resample(answer: Any, rng: np.random.Generator) -> None:
    n = 6000
    states = rng.uniform(0, 20, size=(n, 2))
    centre = rng.uniform(6, 14, size=2)
    weights = np.exp(-0.5 * np.sum(((states - centre) / 0.8) ** 2, axis=1))
    weights /= weights.sum()
    bin_size = np.array([0.5, 2.0])
    got = np.asarray(call(answer, states, weights, bin_size, rng))
    expect(got.ndim == 1 and got.dtype.kind in "iu", "Return the indices of the particles drawn, whole numbers, (m,).")
    expect(got.size > 0 and got.min() >= 0 and got.max() < n, "Some indices name particles that do not exist.")
    expect(got.size != n, "As many as before: the point is that the cloud's size follows from what was drawn.")
    heavy = weights > np.median(weights)
    expect(heavy[got].mean() > 0.9, "Light particles are as common as heavy ones: draw in proportion to the weights.")
    m, bins = got.size, particles.occupied_bins(states[got], bin_size)
    enough = particles.kld_size(bins)
    everywhere = particles.kld_size(particles.occupied_bins(states, bin_size))
    expect(
        not 0.95 * everywhere < m < 1.05 * everywhere,
        "You counted the bins that the old cloud fills; count those that hold a particle you have drawn.",
    )
    distinct = particles.kld_size(len(np.unique(got)))
    expect(
        not (distinct > 1.2 * enough and m > 0.9 * distinct),
        "You counted particles, not bins: two particles in one bin are one bin.",
    )
    for wrong in (np.full(2, bin_size[0]), np.full(2, bin_size[1])):
        counted = particles.kld_size(particles.occupied_bins(states[got], wrong))
        expect(
            not (abs(m - counted) <= 3 + 0.03 * counted and abs(m - enough) > 0.15 * enough),
            "Your bins are square; bin_size has one side for each column.",
        )
    expect(m >= enough, "You stopped too early: more particles are called for by the bins that you have filled.")
    expect(m <= 1.1 * enough + 5, "You went on drawing after the bins that you have filled asked for no more.")
