"""Right and wrong answers to the exercises of Lab 9."""

import numpy as np

from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def integral(odometry, t):
    """∫ [v, ω] dt from the first stamp, by interpolation: it is made of straight lines."""
    stamps = np.append(odometry[:, 0], odometry[-1, 0] + 1e3)
    until = np.vstack([np.zeros(2), np.cumsum(odometry[:, 1:] * np.diff(stamps)[:, None], axis=0)])
    return np.array([np.interp(t, stamps, column) for column in until.T])


def by_pieces(odometry, begin, end):
    edges = np.append(odometry[:, 0], np.inf)
    held = np.clip(edges[1:], begin, end) - np.clip(edges[:-1], begin, end)
    return held @ odometry[:, 1:]


def in_a_loop(odometry, begin, end):
    total, now = np.zeros(2), begin
    for row, (_, v, omega) in enumerate(odometry):
        until = min(end, odometry[row + 1, 0]) if row + 1 < len(odometry) else end
        if until > now:
            total, now = total + np.array([v, omega]) * (until - now), until
    return total


def pieces(odometry, begin, end):
    """Widths and middles of the intervals between begin, end and the stamps."""
    edges = np.array([begin, *(t for t in odometry[:, 0] if begin < t < end), end])
    return np.diff(edges), 0.5 * (edges[1:] + edges[:-1])


def straight_lines(odometry, begin, end):
    widths, middles = pieces(odometry, begin, end)
    return np.array([widths @ np.interp(middles, odometry[:, 0], column) for column in odometry[:, 1:].T])


def until_its_stamp(odometry, begin, end):
    widths, middles = pieces(odometry, begin, end)
    rows = np.searchsorted(odometry[:, 0], middles, side="right")
    return widths @ odometry[np.minimum(rows, len(odometry) - 1), 1:]


def rows_inside(odometry, begin, end):
    inside = odometry[(odometry[:, 0] >= begin) & (odometry[:, 0] < end)]
    return np.diff(np.append(inside[:, 0], end)) @ inside[:, 1:]


def whole_rows(odometry, begin, end):
    gaps = np.diff(np.append(odometry[:, 0], end))
    inside = (odometry[:, 0] >= begin) & (odometry[:, 0] < end)
    return gaps[inside] @ odometry[inside, 1:]


def mean_of_rows(odometry, begin, end):
    inside = (odometry[:, 0] >= begin) & (odometry[:, 0] < end)
    return odometry[inside if inside.any() else slice(None), 1:].mean(axis=0) * (end - begin)


def at(odometry, t):
    return odometry[np.searchsorted(odometry[:, 0], t, side="right") - 1, 1:]


def derivative(odometry, t, dt, delay):
    return at(odometry, t - delay) - at(odometry, t + dt - delay)


def by_differences(odometry, t, dt, delay):
    def step(d):
        return integral(odometry, t + dt - d) - integral(odometry, t - d)

    return (step(delay + 1e-4) - step(delay - 1e-4)) / 2e-4


def rms(a, b):
    return np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1)))


def centred(points):
    return points - points.mean(axis=0)


def rotation(p, q, mirrors=False):
    U, _, Vt = np.linalg.svd(q.T @ p)
    return U @ np.diag([1, 1 if mirrors else np.linalg.det(U @ Vt)]) @ Vt


def aligned(estimate, truth):
    p, q = centred(estimate), centred(truth)
    return p @ rotation(p, q).T, q


def reference_rmse(estimate, truth):
    return rms(*aligned(estimate, truth))


def complex_rmse(estimate, truth):
    p, q = (centred(points) @ [1, 1j] for points in (estimate, truth))
    turn = np.sum(q * p.conj())
    return np.sqrt(np.mean(np.abs(p * turn / abs(turn) - q) ** 2))


def with_a_mirror(estimate, truth):
    p, q = centred(estimate), centred(truth)
    return rms(p @ rotation(p, q, mirrors=True).T, q)


def with_a_scale(estimate, truth):
    p, q = aligned(estimate, truth)
    return rms(np.sum(p * q) / np.sum(p * p) * p, q)


def turned_back(estimate, truth):
    p, q = centred(estimate), centred(truth)
    return rms(p @ rotation(p, q), q)


ANSWERS = {
    "lab09.commanded": Answers(
        stub=stub,
        reference=by_pieces,
        second=lambda odometry, begin, end: integral(odometry, end) - integral(odometry, begin),
        more=[in_a_loop],
        wrong={
            "straight lines": (straight_lines, "joined the rows by straight lines"),
            "a row holds until its stamp": (until_its_stamp, "until its own stamp"),
            "nothing before the first row inside": (rows_inside, "you left its part out"),
            "whole rows": (whole_rows, "You added whole rows"),
            "mean of the rows": (mean_of_rows, "mean of the rows"),
            "from the first row": (lambda o, begin, end: integral(o, end), "You counted from the first row"),
            "sign": (lambda o, begin, end: integral(o, begin) - integral(o, end), "wrong sign"),
            "a rate": (lambda o, begin, end: by_pieces(o, begin, end) / (end - begin), "the mean command"),
            "only the turn": (lambda o, begin, end: by_pieces(o, begin, end)[1], "Return two numbers"),
        },
    ),
    "lab09.delay_derivative": Answers(
        stub=stub,
        reference=derivative,
        second=by_differences,
        wrong={
            "sign": (lambda o, t, dt, d: -derivative(o, t, dt, d), "The sign is wrong"),
            "per second": (lambda o, t, dt, d: derivative(o, t, dt, d) / dt, "you divided by dt"),
            "times dt": (lambda o, t, dt, d: derivative(o, t, dt, d) * dt, "You multiplied by dt"),
            "ahead": (lambda o, t, dt, d: derivative(o, t, dt, -d), "A delay looks back"),
            "no delay": (lambda o, t, dt, d: derivative(o, t, dt, 0.0), "You forgot the delay"),
            "one end": (lambda o, t, dt, d: -at(o, t + dt - d), "only the end that is lost"),
            "the other end": (lambda o, t, dt, d: at(o, t - d), "only the end that is gained"),
            "only the turn": (lambda o, t, dt, d: derivative(o, t, dt, d)[1], "Return two numbers"),
        },
    ),
    "lab09.aligned_rmse": Answers(
        stub=stub,
        reference=reference_rmse,
        second=complex_rmse,
        wrong={
            "not aligned": (rms, "did not align"),
            "means only": (lambda e, t: rms(centred(e), centred(t)), "the mean on the mean"),
            "mean distance": (
                lambda e, t: np.mean(np.linalg.norm(np.subtract(*aligned(e, t)), axis=1)),
                "That is the mean distance",
            ),
            "per coordinate": (
                lambda e, t: np.sqrt(np.mean(np.subtract(*aligned(e, t)) ** 2)),
                "RMS of the coordinates",
            ),
            "a mirror": (with_a_mirror, "contains a mirror"),
            "a scale": (with_a_scale, "let the scale change"),
            "no root": (lambda e, t: reference_rmse(e, t) ** 2, "the root is missing"),
            "turned back": (turned_back, "turned the wrong way"),
            "each point": (lambda e, t: np.linalg.norm(np.subtract(*aligned(e, t)), axis=1), "Return one number"),
        },
    ),
}
