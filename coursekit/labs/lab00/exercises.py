"""Checks of lab 0: poses, arcs, covariances, containment, and a region that stays honest when the banana bends."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import chi2

from coursekit import geometry
from coursekit.geometry import Array, compose, transform
from coursekit.models import DifferentialDrive
from coursekit.teaching.exercises import Misconception, call, close, exercise, expect


@exercise("lab00.compose")
def poses(answer: Any, rng: np.random.Generator) -> None:
    """T_world_b from T_world_a and T_a_b, without the package."""
    across = [*rng.uniform(1, 3, 2), rng.uniform(1.8, 3.0)], [*rng.uniform(1, 3, 2), rng.uniform(1.5, 2.9)]
    _poses(answer, *np.array(across))  # over the seam of the headings
    _poses(answer, *(np.array(across) * [1, 1, -1]))
    _poses(answer, *rng.uniform([-3, -3, -3], [3, 3, 3], (2, 3)))
    _poses(answer, rng.uniform(-3, 3, 3), np.array([0.0, 0.0, rng.uniform(-3, 3)]))
    _poses(answer, np.zeros(3), rng.uniform(-3, 3, 3))


def _poses(answer: Any, a: Array, b: Array) -> None:
    right = compose(a, b)

    def turned_by(angle: float) -> Array:
        return np.array([*transform([*a[:2], angle], b[:2]), right[2]])

    added, backwards, in_degrees = [*(a + b)[:2], right[2]], turned_by(-a[2]), turned_by(np.degrees(a[2]))
    ready_made = "That is the package's own function. Write the two sines and two cosines yourself."
    close(
        call(answer, a, b, without={ready_made: (geometry.compose, geometry.transform, geometry.homogeneous)}),
        right,
        misconceptions={
            "You added the two poses, and the heading left (-π, π] on top of it.": a + b,
            "The heading is outside (-π, π]: wrap the sum of the two.": [*right[:2], a[2] + b[2]],
            "You added the two poses entry by entry; but b is given along a's axes, which are turned.": added,
            "You turned the wrong way: T_world_a takes a's axes to the world's. Where does x point?": backwards,
            "You turned by b's heading; b's place is written in a's axes.": turned_by(b[2]),
            "The two poses changed places: first a, seen from the world; then b, seen from a.": compose(b, a),
            "cos and sin want radians, and they got degrees.": in_degrees,
            "You turned b into the world's axes and stopped there: the way begins at a, not at the origin.":
                [*(right - a)[:2], right[2]],
            "Your heading is a's alone, and b is turned against a.": [*right[:2], a[2]],
            "Your heading is b's alone, and that counts from a's.": [*right[:2], b[2]],
        },
        otherwise="Stand at a, look along its x-axis: b lies b[0] ahead of you and b[1] to your left. Draw it.",
    )  # fmt: skip


@exercise("lab00.arc")
def arc(answer: Any, rng: np.random.Generator) -> None:
    """The pose after dt seconds at constant [v, ω], straight line included."""
    motion, turning = DifferentialDrive(), np.array([rng.uniform(0.5, 1.5), rng.uniform(0.9, 1.4)])
    place, dt = rng.uniform(-2, 2, 2), rng.uniform(1.3, 2.0)
    _arc(answer, np.array([*place, rng.uniform(2.2, 3.0)]), turning, dt)  # over the seam of the headings
    _arc(answer, np.array([*place, rng.uniform(-3.0, -2.2)]), turning * [1, -1], dt)
    _arc(answer, np.array([*place, rng.uniform(-3, 3)]), turning * rng.choice([-1, 1], 2), dt)
    for slow in (rng.uniform(0.01, 0.05), -rng.uniform(0.01, 0.05)):
        pose, control = np.array([*place, rng.uniform(-1.5, 1.5)]), np.array([turning[0], slow])
        got = np.asarray(call(answer, pose, control, dt), dtype=float)
        straight_on = np.array([*motion.f(pose, [turning[0], 0.0], dt)[:2], pose[2] + slow * dt])
        hint = "A slow turn is still a turn: you took the straight line where ω is small, and not zero."
        expect(got.shape != (3,) or not np.allclose(got[:2], straight_on[:2]), hint)
        close(got, motion.f(pose, control, dt), otherwise="Fast turns come out right, slow ones do not.")
    for heading, speed in ((rng.uniform(0.3, 1.2), 1.0), (rng.uniform(-3, 3), -1.0), (0.0, 1.0)):
        pose, straight = np.array([*place, heading]), np.array([speed * turning[0], 0.0])
        got = np.asarray(call(answer, pose, straight, dt), dtype=float)
        expect(
            bool(np.all(np.isfinite(got))),
            "Curves are right, but on a straight line ω is 0 and v/ω is not a number. What is the limit?",
        )
        close(
            got,
            motion.f(pose, straight, dt),
            otherwise="Curves are right; a straight line (ω = 0) ends in the wrong place. It wants its own limit, "
            "along the heading; a tiny ω in its place loses digits.",
            tolerance=1e-10,
            together=False,
        )


def _arc(answer: Any, pose: Array, turning: Array, dt: float) -> None:
    motion, turn = DifferentialDrive(), turning[1] * dt
    right = motion.f(pose, turning, dt)

    def straight_on(angle: float) -> Array:
        """The length of the arc, driven in one direction."""
        return np.array([*transform([*pose[:2], pose[2] + angle], [turning[0] * dt, 0.0]), right[2]])

    mirrored = [*motion.f(pose, turning * [1, -1], dt)[:2], right[2]]
    as_if_at_zero = [*(pose + motion.f(np.zeros(3), turning, dt))[:2], right[2]]
    chord = turning[0] * dt * np.sinc(turn / 2)
    without_pi = [*transform([*pose[:2], pose[2] + turn / 2], [chord, 0.0]), right[2]]
    close(
        call(answer, pose, turning, dt, stops={"ZeroDivision": "Here ω was not zero: what else stands under a line?"}),
        right,
        misconceptions={
            "The heading is outside (-π, π]: wrap it.": [*right[:2], pose[2] + turn],
            "You forgot to turn: the heading is still the old one.": [*right[:2], pose[2]],
            "You drove straight along the old heading; the robot turns all the way.": straight_on(0),
            "You turned first and then drove straight; the robot turns all the way.": straight_on(turn),
            "The direction is right, that of half-way; but a chord is shorter than the arc.": straight_on(turn / 2),
            "You curve to the other side: ω > 0 is a turn to the left. Look at the signs.": mirrored,
            "That is the arc of a robot that looked along x. Where to its left is, depends on the old heading.":
                as_if_at_zero,
            "NumPy's sinc(t) is sin(πt)/(πt): what must you give it for sin(t)/t?": without_pi,
        },
        otherwise="To the left is the direction θ + π/2. And seen from the centre: in which direction do you stand "
        "before the turn, in which after it?",
    )  # fmt: skip


@exercise("lab00.propagate")
def propagation(answer: Any, rng: np.random.Generator) -> None:
    """P after one step: F P Fᵀ + G diag(σ²) Gᵀ."""
    A = rng.normal(size=(3, 3))
    P, sigmas = A @ A.T + 0.1 * np.eye(3), rng.uniform(0.2, 0.6, 2)
    pose, control = rng.uniform(-3, 3, 3), rng.uniform(0.5, 1.5, 2) * rng.choice([-1, 1], 2)
    F, G = DifferentialDrive().F(pose, control, 1.0), DifferentialDrive().G(pose, control, 1.0)
    Q = G @ np.diag(sigmas**2) @ G.T
    close(
        call(answer, P, F, G, sigmas, stops={"core dimension": "sigmas**2 is a row of two numbers, and M is a matrix: "
                                             "which function puts them on a diagonal?"}),
        F @ P @ F.T + Q,
        misconceptions={
            "In NumPy, * multiplies entry by entry; a product of matrices is written @.": F * P * F.T + Q,
            "The σ are squared twice there: once makes them variances.": F @ P @ F.T + G @ np.diag(sigmas**4) @ G.T,
            "FᵀPF is the other way round: the error e becomes F e. What becomes of e eᵀ?": F.T @ P @ F + Q,
            "The σ are standard deviations; a covariance wants their squares.": F @ P @ F.T + G @ np.diag(sigmas) @ G.T,
            "You moved the old doubt on, but this step's wheels added none.": F @ P @ F.T,
            "This step's noise is there, but the old doubt was not moved: it is still P.": P + Q,
            "That is only what this step adds. What of the doubt from before?": Q,
            "F P F is no covariance (is it symmetric?). One of the two wants a transpose.": F @ P @ F + Q,
            "G Gᵀ is the noise of wheels that err by 1 m/s and 1 rad/s: there is no σ in it.": F @ P @ F.T + G @ G.T,
            "Your v and ω err in step, always with the same sign. They are independent: what is off their diagonal?":
                F @ P @ F.T + np.outer(G @ sigmas, G @ sigmas),
        },
        otherwise="If e is the old error and w the wheels', the new one is F e + G w. What is its covariance?",
    )  # fmt: skip


@exercise("lab00.containment")
def containment(answer: Any, rng: np.random.Generator) -> None:
    """The share of points inside the ellipse of a given confidence."""
    mean, confidence = rng.uniform(2, 4, 2) * rng.choice([-1, 1], 2), rng.uniform(0.55, 0.85)
    turn = rng.uniform(0.5, 1.0) + rng.integers(4) * np.pi / 2
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    cov = axes @ np.diag([rng.uniform(3.0, 5.0), rng.uniform(0.3, 0.6)]) @ axes.T
    points = rng.multivariate_normal(mean, cov, size=4000)
    error, radius = points - mean, chi2.ppf(confidence, 2)
    squared = _mahalanobis(error, cov)

    def share(distance: Array, limit: float) -> float:
        return float(np.mean(distance <= limit))

    got = call(answer, points, mean, cov, confidence)
    expect(np.ndim(got) == 0, "Wanted is one number, the share of points inside; you gave one for each point.")
    one_dimension, metres = share(squared, chi2.ppf(confidence, 1)), share(np.sum(error**2, axis=1), radius)
    multiplied, rooted = share(np.sum(error * (error @ cov), axis=1), radius), share(np.sqrt(squared), radius)
    from_origin = share(_mahalanobis(points, cov), radius)
    close(
        got,
        share(squared, radius),
        misconceptions={
            "1.96 belongs to 95 % of a single number. In the plane, and for another confidence, the radius is another.":
                share(squared, 1.96**2),
            "That quantile is of one dimension (1.96 for 95 %). In the plane the radius is longer.": one_dimension,
            "The distance was compared with a squared radius: one of them wants a square, or a root.": rooted,
            "You measured from the origin; the ellipse is centred on the mean.": from_origin,
            "That is a percentage; wanted is a share between 0 and 1.": 100 * share(squared, radius),
            "You counted the points outside.": 1 - share(squared, radius),
            "You measured in metres. How far is far depends on the direction, says the covariance.": metres,
            "The covariance multiplies where it must divide.": multiplied,
            "You used 95 %, whatever confidence was asked for.": share(squared, chi2.ppf(0.95, 2)),
            "You took the logarithm of the share inside; e^(-d²/2) is what stays outside.":
                share(squared, -2 * np.log(confidence)),
            "The exponent is -d²/2: there is a factor 2 that you lost on the way to d².": share(squared, radius / 2),
            "You divided each coordinate by its own σ. But the two errors go together: use the whole covariance.":
                share(np.sum(error**2 / np.diag(cov), axis=1), radius),
            "That is how many points are inside; wanted is which share of them.":
                float(np.sum(squared <= radius)),
            "That is the percentage of the points outside: wanted is the share inside, between 0 and 1.":
                100 * (1 - share(squared, radius)),
            "That quantile is of one dimension, and you gave a percentage.": 100 * one_dimension,
            "That quantile is of one dimension, and you counted the points outside.": 1 - one_dimension,
            "You compared with a squared radius, and counted the points outside.": 1 - rooted,
        },
        otherwise="Two steps: d² of each point from the mean and the covariance; then the d² at which the share "
        "inside, 1 - e^(-d²/2), is the one that was asked for.",
        tolerance=1e-9,
        together=False,  # shares of counted points agree by chance
    )  # fmt: skip


@exercise("lab00.honest_region")
def region(answer: Any, rng: np.random.Generator) -> None:
    """A region of the plane, learnt from endings, that holds 95 % of new ones and is smaller than any ellipse."""
    track = rng.uniform(0.25, 0.35)
    sigma = rng.uniform(0.25, 0.4)
    distance = rng.uniform(8.0, 10.0) * track / sigma
    seen, fresh = (_endings(rng, n, sigma, distance, track) for n in (1000, 1500))
    low, high = seen.min(axis=0), seen.max(axis=0)
    everywhere = rng.uniform(1.4 * low - 0.4 * high, 1.4 * high - 0.4 * low, (3000, 2))

    inside = _mask(call(answer, seen, fresh), len(fresh))
    share = inside.mean()
    expect(share < 0.985, "Nearly everything counts as inside: never wrong, and never of use. Make it smaller.")
    expect(share > 0.9, f"Only {100 * share:.0f} % of new endings are inside, where 95 % are wanted.")
    edge = np.argsort(fresh[:, 0])[:60]
    alone = _mask(call(answer, seen, fresh[edge]), len(edge))
    expect(
        bool(np.array_equal(alone, inside[edge])),
        "Whether a point is inside changes with the other points you are asked about. Learn from `seen` alone.",
    )
    covered = _mask(call(answer, seen, everywhere), len(everywhere))
    ellipse = _mahalanobis(everywhere - seen.mean(axis=0), np.cov(seen.T)) <= chi2.ppf(0.95, 2)
    if np.mean(covered != ellipse) < 0.005:
        raise Misconception(
            "An ellipse again: the right share, but it covers much ground where no robot ever ends. Follow the bend."
        )
    expect(
        covered.mean() < 0.7 * ellipse.mean(),
        "The share is right, but your region is not much smaller than an ellipse with the same share. "
        "In which coordinates does the banana look straight?",
    )


def _endings(rng: np.random.Generator, runs: int, sigma: float, distance: float, track: float) -> Array:
    """Endings (runs, 2) of a straight drive whose heading drifts by ``sigma`` rad in all."""
    steps = 40
    turn = rng.standard_normal((runs, steps)) * sigma / np.sqrt(steps)
    way = distance / steps + rng.standard_normal((runs, steps)) * 0.5 * track * sigma / np.sqrt(steps)
    direction = np.cumsum(turn, axis=1) - 0.5 * turn
    return np.stack([np.sum(way * np.cos(direction), axis=1), np.sum(way * np.sin(direction), axis=1)], axis=-1)


def _mahalanobis(error: Array, cov: Array) -> Array:
    """Squared Mahalanobis distances of errors (n, 2)."""
    return np.asarray(np.sum(error * np.linalg.solve(cov, error.T).T, axis=1))


def _mask(got: Any, size: int) -> Array:
    mask = np.asarray(got)
    expect(
        mask.shape == (size,) and mask.dtype == bool,
        "Wanted is True or False for each point asked about: an array of booleans, as long as `asked`.",
    )
    return mask
