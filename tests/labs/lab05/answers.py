"""Right and wrong answers to the exercises of Lab 5."""

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from coursekit.ekf import gate_threshold
from coursekit.models import RangeBearing
from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


# --- augment the mean ---------------------------------------------------------------------------------------------


def appended(place):
    """The mean with two numbers behind it that ``place(x, y, θ, r, β)`` gives."""
    return lambda mean, z: np.concatenate([mean, place(*mean[:3], *z)])


def reference_mean(mean, z):
    return np.concatenate([mean, RangeBearing.g(mean[:3], z)])


def by_complex_numbers(mean, z):
    there = complex(*mean[:2]) + z[0] * np.exp(1j * (mean[2] + z[1]))
    return [*mean, there.real, there.imag]


# --- augment the covariance ---------------------------------------------------------------------------------------


def reference_cov(P, Gx, Gz, R):
    cross = Gx @ P[:3]
    return np.block([[P, cross.T], [cross, Gx @ P[:3, :3] @ Gx.T + Gz @ R @ Gz.T]])


def by_one_jacobian(P, Gx, Gz, R):
    n = len(P)
    J = np.zeros((n + 2, n + 2))
    J[:n, :n], J[n:, :3], J[n:, n:] = np.eye(n), Gx, Gz
    return J @ block_diag(P, R) @ J.T


def grown(cross=None, corner=None):
    def answer(P, Gx, Gz, R):
        row = Gx @ P[:3] if cross is None else cross(P, Gx)
        block = Gx @ P[:3, :3] @ Gx.T
        block = block + Gz @ R @ Gz.T if corner is None else corner(block, Gz, R)
        return np.block([[P, row.T], [row, block]])

    return answer


def zeros(P, Gx):
    return np.zeros((2, len(P)))


def one_sided(P, Gx, Gz, R):
    out = reference_cov(P, Gx, Gz, R)
    out[: len(P), len(P) :] = 0
    return out


# --- what a measurement asks --------------------------------------------------------------------------------------


def marked(pose=((0, 0), (0, 1), (1, 0), (1, 1)), heading=((1, 2),), first=lambda j: 3 + 2 * j, width=2):
    def answer(j, n):
        out = np.zeros((2, 3 + 2 * n), dtype=bool)
        for row, column in (*pose, *heading):
            out[row, column] = True
        out[:, first(j) : first(j) + width] = True
        return out

    return answer


def by_differences(j, n):
    rng = np.random.default_rng(1)
    x, steps = rng.normal(size=3 + 2 * n), 1e-6 * np.eye(3 + 2 * n)

    def h(x):
        return RangeBearing(x[3 + 2 * j : 5 + 2 * j]).h(x[:3])

    return np.abs(np.stack([h(x + s) - h(x - s) for s in steps], axis=-1)) > 1e-12


# --- association --------------------------------------------------------------------------------------------------


def squared(nu, S):
    return np.array([v @ np.linalg.solve(C, v) for v, C in zip(nu, S, strict=True)])


def reference_associate(nu, S, gate):
    d2 = squared(nu, S)
    return int(np.argmin(d2)) if d2.min() < gate_threshold(gate, 2) else -1


def by_probability(nu, S, gate):
    p = chi2.cdf([w @ w for w in (np.linalg.solve(np.linalg.cholesky(C), v) for v, C in zip(nu, S, strict=True))], 2)
    return np.where(p.min() < gate, p.argmin(), -1)


def inverted(nu, S, gate):
    d2 = squared(nu, S)
    return -1 if d2.min() < chi2.ppf(gate, 2) else int(np.argmin(d2))


def with_threshold(threshold, distance=squared):
    def answer(nu, S, gate):
        d = distance(nu, S)
        return int(np.argmin(d)) if d.min() < threshold(gate) else -1

    return answer


# --- judging a map ------------------------------------------------------------------------------------------------


def reference_judge(landmarks, tags, within):
    nearest = np.linalg.norm(landmarks[:, None] - tags, axis=-1).min(axis=0)
    found = nearest < within
    return found.sum(), len(landmarks) - found.sum(), nearest[found].mean()


def by_assignment(landmarks, tags, within):
    d = np.linalg.norm(landmarks[:, None] - tags, axis=-1)
    kept = d[linear_sum_assignment(np.minimum(d, within))]
    kept = kept[kept < within]
    return [len(kept), len(landmarks) - len(kept), kept.mean()]


def judged(part, value):
    """The reference with one of its three parts replaced by ``value(d, landmarks, tags, within)``."""

    def answer(landmarks, tags, within):
        d = np.linalg.norm(landmarks[:, None] - tags, axis=-1)
        out = list(reference_judge(landmarks, tags, within))
        out[part] = value(d, landmarks, tags, within)
        return out

    return answer


def per_coordinate(d, landmarks, tags, within):
    found = d.min(axis=0) < within
    return np.abs(landmarks[d.argmin(axis=0)[found]] - tags[found]).mean()


def polar(r, angle):
    return r * np.cos(angle), r * np.sin(angle)


ANSWERS = {
    "lab05.augment_mean": Answers(
        stub=stub,
        reference=reference_mean,
        second=by_complex_numbers,
        wrong={
            "no heading": (
                appended(lambda x, y, t, r, b: np.add([x, y], polar(r, b))),
                "forgets which way the robot looks",
            ),
            "as seen from the robot": (appended(lambda x, y, t, r, b: polar(r, t + b)), "the map is in the world"),
            "bearing to the right": (
                appended(lambda x, y, t, r, b: np.add([x, y], polar(r, t - b))),
                "the two have the same sign",
            ),
            "sine and cosine": (
                appended(lambda x, y, t, r, b: np.add([x, y], polar(r, t + b)[::-1])),
                "have changed places",
            ),
            "raw": (lambda mean, z: np.concatenate([mean, z]), "are no place"),
            "in the middle": (
                lambda mean, z: np.concatenate([mean[:3], RangeBearing.g(mean[:3], z), mean[3:]]),
                "goes to the end",
            ),
            "landmark only": (lambda mean, z: RangeBearing.g(mean[:3], z), "the new landmark alone"),
        },
        both={
            "no heading, as seen from the robot": (
                appended(lambda x, y, t, r, b: polar(r, b)),
                ("which way the robot looks", "the map is in the world"),
            ),
            "landmark only, as seen from the robot": (
                lambda mean, z: polar(z[0], mean[2] + z[1]),
                ("the map is in the world", "The shape is"),
            ),
            "bearing to the right, as seen from the robot": (
                appended(lambda x, y, t, r, b: polar(r, t - b)),
                ("the two have the same sign", "the map is in the world"),
            ),
        },
    ),
    "lab05.augment_cov": Answers(
        stub=stub,
        reference=reference_cov,
        second=by_one_jacobian,
        wrong={
            "no cross": (grown(cross=zeros), "No cross-covariance"),
            "the report's": (lambda P, Gx, Gz, R: block_diag(P, 1000 * np.eye(2)), "A thousand and zeros"),
            "robot is sure": (grown(corner=lambda own, Gz, R: Gz @ R @ Gz.T), "inherits that"),
            "perfect sight": (grown(corner=lambda own, Gz, R: own), "where is R"),
            "R as it comes": (grown(corner=lambda own, Gz, R: own + R), "Gz turns it into metres"),
            "pose only": (
                grown(cross=lambda P, Gx: np.c_[Gx @ P[:3, :3], np.zeros((2, len(P) - 3))]),
                "fill the whole row",
            ),
            "noise taken away": (grown(corner=lambda own, Gz, R: own - Gz @ R @ Gz.T), "add their variances"),
            "one side": (one_sided, "block on the right is missing"),
            "later ones only": (
                lambda P, *a: reference_cov(P, *a) if len(P) > 3 else np.eye(5),
                "The first landmark of all",
            ),
        },
        both={
            "no cross, perfect sight": (
                grown(cross=zeros, corner=lambda own, Gz, R: own),
                ("No cross-covariance", "where is R"),
            ),
            "no cross, R as it comes": (
                grown(cross=zeros, corner=lambda own, Gz, R: own + R),
                ("No cross-covariance", "Gz turns it into metres"),
            ),
            "robot is sure, R as it comes": (
                grown(corner=lambda own, Gz, R: R),
                ("inherits that", "Gz turns it into metres"),
            ),
        },
    ),
    "lab05.nonzero": Answers(
        stub=stub,
        reference=marked(),
        second=by_differences,
        wrong={
            "one column": (marked(width=1), "half of each is never seen"),
            "no heading": (marked(heading=()), "the heading has an entry"),
            "heading twice": (marked(heading=((0, 2), (1, 2))), "one of the heading's entries is zero"),
            "no room for the pose": (marked(first=lambda j: 2 * j), "behind its three numbers"),
            "one place each": (marked(first=lambda j: 3 + j), "two places, not one"),
            "the next one": (marked(first=lambda j: 5 + 2 * j), "counted from zero"),
            "the one before": (marked(first=lambda j: 1 + 2 * j), "right behind the pose"),
            "everything": (lambda j, n: np.ones((2, 3 + 2 * n)), "K's doing"),
            "landmark only": (marked(pose=(), heading=()), "move *it*"),
            "never the last one": (
                lambda j, n: marked()(j, n) if j < n - 1 else marked(first=lambda j: 1 + 2 * j)(j, n),
                "the first or the last",
            ),
        },
        both={
            "one column, no heading": (marked(width=1, heading=()), ("half of each", "the heading has an entry")),
            "the next one, heading twice": (
                marked(first=lambda j: 5 + 2 * j, heading=((0, 2), (1, 2))),
                ("counted from zero", "one of the heading's entries"),
            ),
            "no room for the pose, no heading": (
                marked(first=lambda j: 2 * j, heading=()),
                ("behind its three numbers", "the heading has an entry"),
            ),
        },
    ),
    "lab05.associate": Answers(
        stub=stub,
        reference=reference_associate,
        second=by_probability,
        wrong={
            "inverted": (inverted, "Inverted"),
            "metres": (
                with_threshold(lambda gate: np.inf, lambda nu, S: np.linalg.norm(nu, axis=1)),
                "nearest in metres",
            ),
            "first in the gate": (
                lambda nu, S, gate: int(np.flatnonzero(np.r_[squared(nu, S), 0] < 9.21)[0]),
                "several may be",
            ),
            "worst": (lambda nu, S, gate: int(np.argmax(squared(nu, S))), "fits *worst*"),
            "probability": (with_threshold(lambda gate: gate), "The gate is a probability"),
            "no gate": (with_threshold(lambda gate: np.inf), "where is the gate"),
            "not squared": (
                with_threshold(lambda gate: chi2.ppf(gate, 2), lambda nu, S: np.sqrt(squared(nu, S))),
                "still under a root",
            ),
            "one number": (with_threshold(lambda gate: chi2.ppf(gate, 1)), "one degree of freedom"),
            "a list": (lambda nu, S, gate: [reference_associate(nu, S, gate)], "Return one number"),
            "None for none": (
                lambda nu, S, gate: None if reference_associate(nu, S, gate) < 0 else reference_associate(nu, S, gate),
                "each way through",
            ),
            "always 99 %": (with_threshold(lambda gate: 9.21), "whatever was asked for"),
            "axis by axis": (
                with_threshold(
                    lambda gate: chi2.ppf(gate, 2),
                    lambda nu, S: np.sum(nu**2 / np.diagonal(S, axis1=1, axis2=2), axis=1),
                ),
                "by its own σ",
            ),
        },
        both={
            "not squared, one number": (
                with_threshold(lambda gate: chi2.ppf(gate, 1), lambda nu, S: np.sqrt(squared(nu, S))),
                ("still under a root", "one degree of freedom"),
            ),
            "metres, no gate": (
                lambda nu, S, gate: int(np.argmin(np.linalg.norm(nu, axis=1))),
                ("nearest in metres", "where is the gate"),
            ),
            "worst, no gate": (
                lambda nu, S, gate: int(np.argmax(np.linalg.norm(nu, axis=1) / np.sqrt(S[:, 0, 0]))),
                ("fits *worst*", "d² = νᵀ"),
            ),
        },
    ),
    "lab05.judge_map": Answers(
        stub=stub,
        reference=reference_judge,
        second=by_assignment,
        wrong={
            "landmarks counted": (judged(0, lambda d, *_: (d.min(axis=1) < 0.2).sum()), "was found once"),
            "all tags": (judged(0, lambda d, landmarks, tags, w: len(tags)), "all the tags there are"),
            "size of the map": (judged(0, lambda d, landmarks, *_: len(landmarks)), "right or wrong"),
            "far ones only": (judged(1, lambda d, *_: (d.min(axis=1) >= 0.2).sum()), "one too many as well"),
            "difference": (judged(1, lambda d, landmarks, tags, w: len(landmarks) - len(tags)), "do not cancel"),
            "per coordinate": (judged(2, per_coordinate), "a landmark's error is a distance"),
            "root mean square": (
                judged(2, lambda d, *_: np.sqrt(np.mean(d.min(axis=0)[d.min(axis=0) < 0.2] ** 2))),
                "not the mean",
            ),
            "ghosts in the mean": (judged(2, lambda d, *_: d.min(axis=1).mean()), "A landmark out of reach"),
            "missing tags in the mean": (judged(2, lambda d, *_: d.min(axis=0).mean()), "counted as missing already"),
            "doubles in the mean": (
                judged(2, lambda d, *_: d.min(axis=1)[d.min(axis=1) < 0.2].mean()),
                "Twice-mapped",
            ),
            "missing tags for landmarks": (judged(1, lambda d, *_: (d.min(axis=0) >= 0.2).sum()), "stand for no tag"),
        },
        both={
            "per coordinate, root mean square": (
                judged(
                    2,
                    lambda d, landmarks, tags, w: np.sqrt(
                        np.mean((landmarks[d.argmin(axis=0)] - tags)[d.min(axis=0) < w] ** 2)
                    ),
                ),
                ("root mean square over",),
            ),
            "landmarks counted, far ones only": (
                lambda landmarks, tags, within: [
                    (np.linalg.norm(landmarks[:, None] - tags, axis=-1).min(axis=1) < within).sum(),
                    (np.linalg.norm(landmarks[:, None] - tags, axis=-1).min(axis=1) >= within).sum(),
                    0.1,
                ],
                ("was found once", "one too many as well"),
            ),
        },
    ),
}
