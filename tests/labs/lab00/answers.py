"""Lab 0: who must pass, who must fail, and with which hint."""

import numpy as np
from scipy.stats import chi2

from coursekit import geometry
from coursekit.geometry import wrap_angle
from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


# --- compose ---------------------------------------------------------------------------------------------


def compose(a, b):
    c, s = np.cos(a[2]), np.sin(a[2])
    return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap_angle(a[2] + b[2])])


def compose_by_matrices(a, b):
    T, U = ([[np.cos(t), -np.sin(t), x], [np.sin(t), np.cos(t), y], [0, 0, 1]] for x, y, t in (a, b))
    T = np.array(T) @ U
    return [T[0, 2], T[1, 2], np.arctan2(T[1, 0], T[0, 0])]


def compose_turning_by(angle):
    def wrong(a, b):
        c, s = np.cos(angle(a, b)), np.sin(angle(a, b))
        return np.array([a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap_angle(a[2] + b[2])])

    return wrong


def compose_in_place(a, b):
    a[:] = compose(a, b)
    return a


# --- arc -------------------------------------------------------------------------------------------------


def arc(pose, control, dt):
    x, y, heading = pose
    v, omega = control
    if omega == 0:
        return np.array([x + v * dt * np.cos(heading), y + v * dt * np.sin(heading), heading])
    after = heading + omega * dt
    return np.array(
        [
            x + v / omega * (np.sin(after) - np.sin(heading)),
            y - v / omega * (np.cos(after) - np.cos(heading)),
            wrap_angle(after),
        ]
    )


def arc_by_small_steps(pose, control, dt):
    x, y, heading = pose
    steps = 20_000
    moments = heading + control[1] * dt * (np.arange(steps) + 0.5) / steps
    step = control[0] * dt / steps
    return [x + step * np.cos(moments).sum(), y + step * np.sin(moments).sum(), wrap_angle(heading + control[1] * dt)]


def straight(direction):
    def wrong(pose, control, dt):
        way, towards = control[0] * dt, direction(pose[2], control[1] * dt)
        after = wrap_angle(pose[2] + control[1] * dt)
        return np.array([pose[0] + way * np.cos(towards), pose[1] + way * np.sin(towards), after])

    return wrong


def arc_without_straight_lines(pose, control, dt):
    (x, y, heading), (v, omega) = pose, control
    after = heading + omega * dt
    return np.array(
        [
            x + v / omega * (np.sin(after) - np.sin(heading)),
            y - v / omega * (np.cos(after) - np.cos(heading)),
            wrap_angle(after),
        ]
    )


def arc_to_the_right(pose, control, dt):
    after = wrap_angle(pose[2] + control[1] * dt)
    return np.array([*arc(pose, control * [1, -1], dt)[:2], after])


def arc_as_if_heading_were_zero(pose, control, dt):
    way = arc([0.0, 0.0, 0.0], control, dt)
    return np.array([pose[0] + way[0], pose[1] + way[1], wrap_angle(pose[2] + way[2])])


def arc_with_a_sinc_of_its_own(pose, control, dt):
    half = control[1] * dt / 2
    chord = control[0] * dt * np.sinc(half)
    x, y = pose[0] + chord * np.cos(pose[2] + half), pose[1] + chord * np.sin(pose[2] + half)
    return np.array([x, y, wrap_angle(pose[2] + 2 * half)])


def arc_round_the_other_centre(pose, control, dt):
    """The centre to the right, the turn to the left."""
    radius, after = control[0] / (control[1] or 1e-9), pose[2] + control[1] * dt
    x, y = pose[0] + radius * np.sin(pose[2]), pose[1] - radius * np.cos(pose[2])
    return np.array([x + radius * np.sin(after), y - radius * np.cos(after), wrap_angle(after)])


def arc_straight_below(limit):
    return lambda pose, control, dt: (
        arc(pose, control, dt)
        if abs(control[1]) > limit
        else np.array([*arc(pose, [control[0], 0.0], dt)[:2], pose[2] + control[1] * dt])
    )


def arc_that_stays_on_straight_lines(pose, control, dt):
    return arc(pose, control, dt) if control[1] else np.array(pose)


# --- propagate -------------------------------------------------------------------------------------------


def propagate(P, F, G, sigmas):
    return F @ P @ F.T + G @ np.diag(sigmas**2) @ G.T


def propagate_by_columns(P, F, G, sigmas):
    return np.einsum("ij,jk,lk->il", F, P, F) + sum(s**2 * np.outer(g, g) for s, g in zip(sigmas, G.T, strict=True))


# --- containment -----------------------------------------------------------------------------------------


def containment(points, mean, cov, confidence):
    error = points - mean
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(cov, error.T).T)
    return np.mean(squared <= chi2.ppf(confidence, 2))


def containment_by_whitening(points, mean, cov, confidence):
    white = np.linalg.solve(np.linalg.cholesky(cov), (points - mean).T)
    return float((np.hypot(*white) <= np.sqrt(-2 * np.log(1 - confidence))).sum() / len(points))


def counted(squared, radius_squared):
    return lambda points, mean, cov, confidence: np.mean(squared(points, mean, cov) <= radius_squared(confidence))


def mahalanobis(points, mean, cov):
    return np.einsum("ni,ni->n", points - mean, np.linalg.solve(cov, (points - mean).T).T)


def plane(confidence):
    return chi2.ppf(confidence, 2)


# --- honest region ---------------------------------------------------------------------------------------


def polar(points):
    return np.stack([np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])], axis=-1)


def honest_region(seen, asked):
    """An ellipse in polar coordinates, where the banana is nearly straight."""
    known, error = polar(seen), polar(asked) - polar(seen).mean(axis=0)
    squared = np.sum(error * np.linalg.solve(np.cov(known.T), error.T).T, axis=1)
    return squared <= chi2.ppf(0.95, 2)


def honest_region_by_parabola(seen, asked):
    """A box round the parabola that fits best."""
    bend = np.polynomial.Polynomial.fit(seen[:, 1], seen[:, 0], 2)
    straight = np.stack([seen[:, 0] - bend(seen[:, 1]), seen[:, 1]], axis=-1)
    low, high = np.quantile(straight, [0.012, 0.988], axis=0)
    x, y = asked[:, 0] - bend(asked[:, 1]), asked[:, 1]
    return (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])


def one_distance(seen, asked):
    return mahalanobis(asked, seen.mean(axis=0), np.cov(seen.T))


def one_ellipse(seen, asked):
    return one_distance(seen, asked) <= chi2.ppf(0.95, 2)


def one_box(seen, asked):
    low, high = np.quantile(seen, [0.0127, 0.9873], axis=0)
    return np.all((asked >= low) & (asked <= high), axis=1)


def learns_from_the_question(seen, asked):
    known = polar(asked)
    squared = mahalanobis(known, known.mean(axis=0), np.cov(known.T))
    return squared <= np.quantile(squared, 0.95)


ANSWERS = {
    "lab00.compose": Answers(
        stub=stub,
        reference=compose,
        second=compose_by_matrices,
        wrong={
            "added": (lambda a, b: np.array([*(a + b)[:2], wrap_angle(a[2] + b[2])]), "entry by entry"),
            "added, unwrapped": (lambda a, b: a + b, "added the two poses, and the heading left"),
            "unwrapped": (lambda a, b: np.array([*compose(a, b)[:2], a[2] + b[2]]), "wrap the sum of the two"),
            "turned backwards": (compose_turning_by(lambda a, b: -a[2]), "the wrong way"),
            "turned by b": (compose_turning_by(lambda a, b: b[2]), "by b's heading"),
            "swapped": (lambda a, b: compose(b, a), "changed places"),
            "degrees": (compose_turning_by(lambda a, b: np.degrees(a[2])), "want radians"),
            "in place": (compose_in_place, "changes its argument"),
            "a forgotten": (lambda a, b: np.array([*(compose(a, b) - a)[:2], compose(a, b)[2]]), "not at the origin"),
            "a's heading": (lambda a, b: np.array([*compose(a, b)[:2], a[2]]), "is a's alone"),
            "b's heading": (lambda a, b: np.array([*compose(a, b)[:2], b[2]]), "is b's alone"),
            "ready made": (lambda a, b: geometry.compose(a, b), "the package's own function"),
        },
        both={
            "turned backwards, unwrapped": (
                lambda a, b: [*compose_turning_by(lambda a, b: -a[2])(a, b)[:2], a[2] + b[2]],
                ("wrap the sum", "the wrong way"),
            ),
            "swapped, b's heading": (
                lambda a, b: [*compose(b, a)[:2], b[2]],
                ("changed places", "is b's alone"),
            ),
            "added, a's heading": (lambda a, b: [*(a + b)[:2], a[2]], ("entry by entry", "is a's alone")),
        },
    ),
    "lab00.arc": Answers(
        stub=stub,
        reference=arc,
        second=arc_by_small_steps,
        wrong={
            "Euler": (straight(lambda heading, turn: heading), "along the old heading"),
            "turn first": (straight(lambda heading, turn: heading + turn), "turned first"),
            "midpoint": (straight(lambda heading, turn: heading + turn / 2), "shorter than the arc"),
            "unwrapped": (
                lambda pose, control, dt: [*arc(pose, control, dt)[:2], pose[2] + control[1] * dt],
                "outside (-π, π]: wrap it",
            ),
            "right for left": (arc_to_the_right, "curve to the other side"),
            "heading kept": (lambda pose, control, dt: [*arc(pose, control, dt)[:2], pose[2]], "forgot to turn"),
            "no straight lines": (arc_without_straight_lines, "v/ω is not a number"),
            "as if along x": (arc_as_if_heading_were_zero, "looked along x"),
            "sinc without π": (arc_with_a_sinc_of_its_own, "sin(πt)/(πt)"),
            "the other centre": (arc_round_the_other_centre, "direction θ + π/2"),
            "stands still when straight": (arc_that_stays_on_straight_lines, "wants its own limit"),
            "straight when slow": (arc_straight_below(0.1), "A slow turn is still a turn"),
        },
        both={
            "Euler, unwrapped": (
                lambda p, u, dt: p + dt * np.array([u[0] * np.cos(p[2]), u[0] * np.sin(p[2]), u[1]]),
                ("outside (-π, π]", "along the old heading"),
            ),
            "a tiny ω on straight lines": (
                lambda p, u, dt: arc(p, [u[0], u[1] + 1e-6], dt) if u[1] == 0 else arc(p, u, dt),
                ("loses digits",),
            ),
            "right for left, heading kept": (
                lambda p, u, dt: [*arc(p, u * [1, -1], dt)[:2], p[2]],
                ("forgot to turn", "curve to the other side"),
            ),
        },
    ),
    "lab00.propagate": Answers(
        stub=stub,
        reference=propagate,
        second=propagate_by_columns,
        wrong={
            "FᵀPF": (lambda P, F, G, s: F.T @ P @ F + G @ np.diag(s**2) @ G.T, "the other way round"),
            "σ not squared": (lambda P, F, G, s: F @ P @ F.T + G @ np.diag(s) @ G.T, "wants their squares"),
            "no noise": (lambda P, F, G, s: F @ P @ F.T, "wheels added none"),
            "P not moved": (lambda P, F, G, s: P + G @ np.diag(s**2) @ G.T, "it is still P"),
            "only Q": (lambda P, F, G, s: G @ np.diag(s**2) @ G.T, "only what this step adds"),
            "FPF": (lambda P, F, G, s: F @ P @ F + G @ np.diag(s**2) @ G.T, "wants a transpose"),
            "unit noise": (lambda P, F, G, s: F @ P @ F.T + G @ G.T, "no σ in it"),
            "in step": (lambda P, F, G, s: F @ P @ F.T + G @ np.outer(s, s) @ G.T, "err in step"),
            "entry by entry": (lambda P, F, G, s: F * P * F.T + G @ np.diag(s**2) @ G.T, "is written @"),
            "a row for a matrix": (lambda P, F, G, s: F @ P @ F.T + G @ s**2 @ G.T, "puts them on a diagonal"),
        },
        both={
            "FᵀPF, σ not squared": (
                lambda P, F, G, s: F.T @ P @ F + G @ np.diag(s) @ G.T,
                ("the other way round", "wants their squares"),
            ),
            "entry by entry, σ not squared": (
                lambda P, F, G, s: F * P * F.T + G @ np.diag(s) @ G.T,
                ("is written @", "wants their squares"),
            ),
            "P not moved, unit noise": (lambda P, F, G, s: P + G @ G.T, ("it is still P", "no σ in it")),
        },
    ),
    "lab00.containment": Answers(
        stub=stub,
        reference=containment,
        second=containment_by_whitening,
        wrong={
            "one dimension": (counted(mahalanobis, lambda c: chi2.ppf(c, 1)), "one dimension"),
            "root forgotten": (counted(lambda *a: np.sqrt(mahalanobis(*a)), plane), "wants a square, or a root"),
            "origin": (counted(lambda p, m, c: mahalanobis(p, 0 * m, c), plane), "centred on the mean"),
            "percent": (lambda *a: 100 * containment(*a), "percentage"),
            "outside": (lambda *a: 1 - containment(*a), "the points outside"),
            "metres": (counted(lambda p, m, c: np.sum((p - m) ** 2, axis=1), plane), "measured in metres"),
            "times cov": (counted(lambda p, m, c: np.sum((p - m) * ((p - m) @ c), axis=1), plane), "must divide"),
            "log of the share": (counted(mahalanobis, lambda c: -2 * np.log(c)), "what stays outside"),
            "factor lost": (counted(mahalanobis, lambda c: -np.log(1 - c)), "a factor 2"),
            "axis by axis": (
                counted(lambda p, m, c: np.sum((p - m) ** 2 / np.diag(c), axis=1), plane),
                "by its own σ",
            ),
            "count": (lambda p, m, c, q: np.sum(mahalanobis(p, m, c) <= plane(q)), "how many"),
            "radius² 3": (counted(mahalanobis, lambda c: 3.0), "Two steps"),
            "always 95 %": (counted(mahalanobis, lambda c: plane(0.95)), "whatever confidence"),
            "mask": (lambda p, m, c, q: mahalanobis(p, m, c) <= plane(q), "one number"),
            "always 1.96²": (counted(mahalanobis, lambda c: 1.96**2), "1.96 belongs to"),
        },
        both={
            "one dimension, outside": (
                lambda p, m, c, q: np.mean(mahalanobis(p, m, c) > chi2.ppf(q, 1)),
                ("one dimension", "points outside"),
            ),
            "root forgotten, outside": (
                lambda p, m, c, q: np.mean(np.sqrt(mahalanobis(p, m, c)) > plane(q)),
                ("squared radius", "points outside"),
            ),
            "outside, in percent": (
                lambda *a: 100 * (1 - containment(*a)),
                ("the points outside", "percentage"),
            ),
        },
    ),
    "lab00.honest_region": Answers(
        stub=stub,
        reference=honest_region,
        second=honest_region_by_parabola,
        wrong={
            "everything": (lambda seen, asked: np.ones(len(asked), bool), "Nearly everything"),
            "the core only": (lambda seen, asked: one_distance(seen, asked) < 1, "95 % are wanted"),
            "one ellipse": (one_ellipse, "An ellipse again"),
            "a box": (one_box, "look straight"),
            "learns from the question": (learns_from_the_question, "Learn from `seen` alone"),
            "distances": (one_distance, "True or False"),
        },
    ),
}  # fmt: skip
