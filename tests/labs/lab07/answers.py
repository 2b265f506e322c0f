"""Lab 7: who must pass, who must fail, and with which hint."""

import numpy as np
from scipy.special import logsumexp

from coursekit import particles
from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def normalised(log_weights):
    return np.exp(log_weights - logsumexp(log_weights))


def ess_shifted(log_weights, by):
    w = np.exp(log_weights + by)
    return w.sum() ** 2 / np.sum(w**2)


def ess(log_weights):
    w = np.exp(log_weights - log_weights.max())
    w /= w.sum()
    return 1 / np.sum(w**2)


def systematic(weights, u):
    n = len(weights)
    return np.searchsorted(np.cumsum(weights) / np.sum(weights), (np.arange(n) + u) / n)


def systematic_by_hand(weights, u):
    n, chosen, i = len(weights), [], 0
    below = weights[0]
    for k in range(n):
        while below < (k + u) / n * sum(weights):
            i += 1
            below += weights[i]
        chosen.append(i)
    return chosen


def mean_heading(headings, weights):
    return np.arctan2(weights @ np.sin(headings), weights @ np.cos(headings))


def sequential(states, weights, bin_size, rng):
    """Fox's loop, one particle at a time."""
    order = rng.choice(len(weights), size=len(weights), p=weights)
    seen, drawn, enough = set(), 0, 50
    while drawn < enough:
        bin_ = tuple(np.floor(states[order[drawn]] / bin_size))
        drawn += 1
        if bin_ not in seen:
            seen.add(bin_)
            enough = max(50, particles.kld_size(len(seen)))
    return order[:drawn]


def no_floor(states, weights, bin_size, rng):
    order = rng.choice(len(weights), size=len(weights), p=weights)
    seen, drawn = set(), 0
    while not seen or drawn < particles.kld_size(len(seen)):
        seen.add(tuple(np.floor(states[order[drawn]] / bin_size)))
        drawn += 1
    return order[:drawn]


def asks_first(states, weights, bin_size, rng):
    drawn = []
    while len(drawn) < max(50, particles.kld_size(filled(states, bin_size, np.array(drawn, dtype=int)))):
        drawn.append(rng.choice(len(weights), p=weights))
    return np.array(drawn)


def in_batches_of(size):
    def answer(states, weights, bin_size, rng):
        drawn = rng.choice(len(weights), size=size, p=weights)
        while len(drawn) < max(50, particles.kld_size(filled(states, bin_size, drawn))):
            drawn = np.append(drawn, rng.choice(len(weights), size=size, p=weights))
        return drawn

    return answer


def filled(states, bin_size, chosen):
    return particles.occupied_bins(states[chosen], bin_size)


def settled(states, weights, bin_size, rng, count=filled, factor=1):
    """Draw, count, draw as many as the count asks for, until that is what was drawn."""
    m = 50
    while True:
        chosen = particles.systematic(weights, rng, size=m)
        wanted = max(50, factor * particles.kld_size(count(states, bin_size, chosen)))
        if wanted <= m <= 1.02 * wanted + 3:
            return chosen
        m = wanted


def counting(count, factor=1):
    return lambda states, weights, bin_size, rng: settled(states, weights, bin_size, rng, count, factor)


ANSWERS = {
    "lab07.effective_size": Answers(
        stub=stub,
        reference=ess,
        second=lambda l: float(np.exp(2 * logsumexp(l) - logsumexp(2 * l))),
        wrong={
            "no shift": (lambda l: 1 / np.sum((np.exp(l) / np.exp(l).sum()) ** 2), "What may you add"),
            "squared at once": (lambda l: 1 / np.sum(np.exp(l) ** 2), "no number of particles"),
            "shifted, not normalised": (lambda l: 1 / np.sum(np.exp(l - l.max()) ** 2), "sum to one before you square"),
            "counts the living": (lambda l: np.sum(normalised(l) > 0), "not a whole one"),
            "one over the largest": (lambda l: 1 / normalised(l).max(), "heaviest particle alone"),
            "logs as weights": (lambda l: l.sum() ** 2 / np.sum(l**2), "the logs themselves"),
            "perplexity": (lambda l: np.exp(-np.sum(normalised(l) * np.log(normalised(l)))), "perplexity"),
            "something else": (lambda l: ess(l) + 1, "Try equal weights"),
            "a constant of its own": (lambda l: ess_shifted(l, 800), "one that depends on them"),
        },
        both={
            "root of the perplexity": (
                lambda l: np.exp(-0.5 * np.sum(normalised(l) * np.log(normalised(l)))),
                ("perplexity",),
            ),
            "upside down": (lambda l: np.sum(normalised(l) ** 2), ("upside down",)),
            "the largest weight": (lambda l: normalised(l).max(), ("heaviest particle alone", "sum to one")),
        },
    ),
    "lab07.systematic": Answers(
        stub=stub,
        reference=systematic,
        second=systematic_by_hand,
        wrong={
            "not normalised": (
                lambda w, u: np.searchsorted(np.cumsum(w), (np.arange(len(w)) + u) / len(w)),
                "do not end at one",
            ),
            "whole of u": (
                lambda w, u: np.searchsorted(
                    np.cumsum(w) / w.sum(), np.minimum(np.arange(len(w)) / len(w) + u, 1.0)
                ).clip(0, len(w)),
                "by the whole of u.",
            ),
            "copies": (lambda w, u: np.bincount(systematic(w, u), minlength=len(w)), "numbers of copies"),
            "from one": (lambda w, u: systematic(w, u) + 1, "Counting from one"),
            "no offset": (
                lambda w, u: np.searchsorted(np.cumsum(w) / w.sum(), np.arange(len(w)) / len(w)),
                "where is u?",
            ),
            "interval before": (lambda w, u: np.maximum(systematic(w, u) - 1, 0), "the interval before its own"),
            "something else": (lambda w, u: np.argsort(w), "the weights laid end to end"),
            "lost at zero": (
                lambda w, u: systematic(w, u) if u else [*systematic_by_hand(w, u)[1:], len(w) - 1],
                "not when u is 0",
            ),
            "takes particles of no weight": (
                lambda w, u: np.where(np.arange(len(w)) == 0, 0, systematic(w, u)) if not w[0] else systematic(w, u),
                "no position may choose it",
            ),
        },
        both={
            "from one, no offset": (
                lambda w, u: np.searchsorted(np.cumsum(w) / w.sum(), np.arange(len(w)) / len(w)) + 1,
                ("Counting from one", "where is u?"),
            ),
            "not normalised, from one": (
                lambda w, u: np.searchsorted(np.cumsum(w), (np.arange(len(w)) + u) / len(w)) + 1,
                ("Counting from one", "do not end at one"),
            ),
        },
    ),
    "lab07.mean_heading": Answers(
        stub=stub,
        reference=mean_heading,
        second=lambda h, w: float(np.angle(np.sum(w * np.exp(1j * h)))),
        wrong={
            "plain": (lambda h, w: w @ h, "the opposite way"),
            "no weights": (lambda h, w: np.angle(np.exp(1j * h).mean()), "where are the weights"),
            "quotient": (lambda h, w: np.arctan((w @ np.sin(h)) / (w @ np.cos(h))), "use two arguments"),
            "arguments swapped": (lambda h, w: np.arctan2(w @ np.cos(h), w @ np.sin(h)), "from the y axis"),
            "range": (
                lambda h, w: mean_heading(h, w) % (2 * np.pi),
                "written in [0, 2π)",
            ),
            "something else": (lambda h, w: np.median(h), "unit vector"),
        },
        both={
            "plain, no weights": (lambda h, w: h.mean(), ("A plain mean",)),
            "quotient, no weights": (
                lambda h, w: np.arctan(np.sin(h).mean() / np.cos(h).mean()),
                ("use two arguments", "where are the weights"),
            ),
            "arguments swapped, no weights": (
                lambda h, w: np.arctan2(np.cos(h).mean(), np.sin(h).mean()),
                ("counted alike"),
            ),
        },
    ),
    "lab07.sigma_for_steps": Answers(
        stub=stub,
        reference=lambda sigma, steps: sigma * np.sqrt(steps),
        second=lambda sigma, steps: (sigma**2 * steps) ** 0.5,
        wrong={
            "the same": (lambda sigma, steps: sigma, "cancel in part"),
            "upside down": (lambda sigma, steps: sigma / np.sqrt(steps), "Upside down"),
            "divided": (lambda sigma, steps: sigma / steps, "has to be stronger"),
            "multiplied": (lambda sigma, steps: sigma * steps, "without ever cancelling"),
            "variance": (lambda sigma, steps: sigma**2 * steps, "take its root"),
            "something else": (lambda sigma, steps: sigma + steps, "what is its variance"),
        },
        both={
            "upside down, variance": (
                lambda sigma, steps: sigma**2 / steps,
                ("Upside down", "take its root", "stronger"),
            ),
            "halved": (lambda sigma, steps: sigma * np.sqrt(steps) / 2, ("A factor 2",)),
        },
    ),
    "lab07.kld_resample": Answers(
        stub=stub,
        reference=sequential,
        second=settled,
        wrong={
            "as many as before": (lambda s, w, b, rng: particles.systematic(w, rng), "As many as before"),
            "weights ignored": (
                lambda s, w, b, rng: sequential(s, np.full(len(w), 1 / len(w)), b, rng),
                "in proportion to the weights",
            ),
            "bins of the old cloud": (
                counting(lambda s, b, chosen: particles.occupied_bins(s, b)),
                "the old cloud fills",
            ),
            "square bins": (
                counting(lambda s, b, chosen: filled(s, b[0], chosen)),
                "one side for each column",
            ),
            "particles for bins": (
                counting(lambda s, b, chosen: len(np.unique(chosen))),
                "counted particles, not bins",
            ),
            "too few": (lambda s, w, b, rng: settled(s, w, b, rng)[::2], "stopped too early"),
            "too many": (
                counting(filled, factor=2),
                "went on drawing",
            ),
            "states for indices": (lambda s, w, b, rng: s[settled(s, w, b, rng)], "Return the indices"),
            "past the end": (lambda s, w, b, rng: settled(s, w, b, rng) + len(s), "do not exist"),
            "no floor": (no_floor, "50 at least"),
            "asks before it draws": (asks_first, "draw first, then ask"),
        },
        more=[in_batches_of(20)],
        both={
            "right, but 200 at once": (in_batches_of(200), ("Ask after each particle",)),
            "square bins, no floor": (
                lambda s, w, b, rng: no_floor(s, w, b[0], rng),
                ("one side for each column", "50 at least"),
            ),
            "weights ignored, 200 at once": (
                lambda s, w, b, rng: in_batches_of(200)(s, np.full(len(w), 1 / len(w)), b, rng),
                ("in proportion to the weights",),
            ),
        },
    ),
}
