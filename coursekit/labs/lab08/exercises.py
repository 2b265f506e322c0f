"""The checks of Lab 8: two frames, a homography's pose, a starved cloud, weights of a mixture, a doubtful cloud."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.geometry import rotation, wrap_angle
from coursekit.teaching.exercises import call, close, exercise, expect

HEIGHT = 800  # of the lab's map, px


@exercise("lab08.odometry_from_image")
def odometry_from_image(answer: Any, rng: np.random.Generator) -> None:
    _odometry(answer, *rng.uniform([100, 100, -3.1], [700, 700, -1.6]))  # where π/2 - yaw leaves (-π, π]
    for quarter in range(4):
        u, v, yaw = rng.uniform([0, 0, 0.05], [700, 700, 1.5])
        _odometry(answer, u, v, yaw + (quarter - 2) * np.pi / 2)


def _odometry(answer: Any, u: float, v: float, yaw: float) -> None:
    got = call(answer, np.array([u, v, yaw]))
    right = np.pi / 2 - yaw
    close(
        got,
        [u, -v, wrap_angle(right)],
        misconceptions={
            "The heading is off by a whole turn: it has to lie in (-π, π].": [u, -v, right],
            "v grows downwards on the picture and y upwards on the map of the odometry.": [u, v, wrap_angle(right)],
            "The origin stays at the map's top left: turn the sign of v round, and add no height.": [
                u,
                HEIGHT - v,
                wrap_angle(right),
            ],
            "Clockwise and anticlockwise: when the yaw grows, the other heading must shrink.": [
                u,
                -v,
                wrap_angle(yaw + np.pi / 2),
            ],
            "North is zero for one and east for the other: a robot that heads north must not get heading zero.": [
                u,
                -v,
                wrap_angle(-yaw),
            ],
            "A quarter turn, but the wrong way: test it with a robot that heads east.": [
                u,
                -v,
                wrap_angle(-np.pi / 2 - yaw),
            ],
            "The axes are not swapped: east stays to the right in both frames.": [-v, u, wrap_angle(right)],
        },
        otherwise="Write down the pose of a robot that heads north, then of one that heads east, in both frames.",
    )


@exercise("lab08.pose_from_homography")
def pose_from_homography(answer: Any, rng: np.random.Generator) -> None:
    for quarter in (0, 1, 2, 3):
        yaw = float(wrap_angle(quarter * np.pi / 2 + rng.uniform(0.3, 1.2)))
        h, w = (int(n) for n in rng.integers(200, 500, 2))
        _pose(answer, h, w, yaw, rng.uniform(0.8, 1.25), rng.uniform(500, 900, 2), rng.uniform(0.3, 0.8))


def _pose(answer: Any, h: int, w: int, yaw: float, scale: float, place: Any, factor: float) -> None:
    centre = np.array([w - 1, h - 1]) / 2
    H = np.eye(3)
    H[:2, :2] = scale * rotation(yaw)
    H[:2, 2] = place - H[:2, :2] @ centre
    H *= factor  # a homography is known up to a factor
    got = call(answer, H, (h, w))
    x, y = place
    half = H[:2, :2] @ [w / 2, h / 2] / H[2, 2] + H[:2, 2] / H[2, 2]
    swapped = H[:2, :2] @ centre[::-1] / H[2, 2] + H[:2, 2] / H[2, 2]
    lost = H[:2, :2] @ centre + H[:2, 2]
    cosine, sine = H[:2, 0] / np.hypot(*H[:2, 0])
    wrong_sense = "The sense of rotation is the wrong one: v points down, so a positive angle is clockwise already."
    angles = {
        **({wrong_sense: -yaw} if np.sin(yaw) > 0 else {}),
        "That is the angle from the other axis: which entry of the first column is the cosine?": np.pi / 2 - yaw,
        "That is the angle of another column of H, or of a row: take the first column.": yaw + np.pi / 2,
        "A homography's entry is scale times cosine; the arc cosine of it needs the scale taken out.":
            np.arccos(np.clip(H[0, 0] / H[2, 2], -1, 1)),
        "A homography's entry is scale times sine; the arc sine of it needs the scale taken out.":
            np.arcsin(np.clip(H[1, 0] / H[2, 2], -1, 1)),
        "The arc tangent of a quotient cannot tell a direction from its opposite: give arctan2 both numbers.":
            np.arctan(sine / cosine),
        "A cosine alone cannot tell a left turn from a right one: use the sine as well.": np.arccos(cosine),
        "A sine alone cannot tell a direction from its mirror image: use the cosine as well.": np.arcsin(sine),
        wrong_sense: -yaw,
    }  # fmt: skip
    places = {
        "Half a pixel off: pixel 0 is a pixel's centre, so the middle of 400 pixels is not at 200.": half,
        "That is where the picture's corner lands; the camera looks out of its middle.": H[:2, 2] / H[2, 2],
        "A homography is known only up to a factor: divide by the third coordinate.": lost,
        "A shape is (rows, columns), a point is (u, v): one of them has to be turned round.": swapped,
        "Half a pixel off, and a shape is (rows, columns), where a point is (u, v).":
            H[:2, :2] @ [h / 2, w / 2] / H[2, 2] + H[:2, 2] / H[2, 2],
        "A homography is known only up to a factor: divide by the third coordinate. And you are half a pixel off.":
            H[:2, :2] @ [w / 2, h / 2] + H[:2, 2],
    }  # fmt: skip
    hints = {hint: [*place, yaw] for hint, place in places.items()}
    hints |= {hint: [x, y, wrap_angle(angle)] for hint, angle in angles.items()}
    close(
        got,
        [x, y, yaw],
        misconceptions=hints,
        otherwise="Send the middle of the picture through H, then look at where H sends the direction (1, 0).",
    )
    close(
        call(answer, -H, (h, w)),
        [x, y, yaw],
        misconceptions={
            "The factor may be negative, and takes the sign of sine and cosine with it: divide all of H by it.":
                [x, y, wrap_angle(yaw - np.pi)],
        },
        otherwise="H and -H are the same homography, and give the same pose.",
    )  # fmt: skip


@exercise("lab08.effective_share")
def effective_share(answer: Any, rng: np.random.Generator) -> None:
    for d in (3, 2, 1):
        _effective_share(answer, _slanted(rng, rng.uniform(1.0, 3.0, d)), _slanted(rng, rng.uniform(0.3, 0.6, d)))


def _effective_share(answer: Any, cloud: Any, fix: Any) -> None:
    got = call(answer, cloud, fix)

    def share(P: Any, R: Any) -> Any:
        return np.sqrt(np.linalg.det(R) * np.linalg.det(R + 2 * P)) / np.linalg.det(R + P)

    det, straight = np.linalg.det, share(np.diag(np.diag(cloud)), np.diag(np.diag(fix)))
    p, r = np.diag(cloud), np.diag(fix)
    close(
        got,
        share(cloud, fix),
        misconceptions={
            "The cloud is slanted: what stands beside the diagonal counts, too.": straight,
            "A covariance's diagonal holds variances, and those were taken for standard deviations.": share(
                np.diag(p**2), np.diag(r**2)
            ),
            "That is the mean weight, E[w]; the effective share is E[w]² / E[w²].": np.sqrt(
                det(fix) / det(fix + cloud)
            ),
            "That is E[w²]; the effective share is E[w]² / E[w²].": np.sqrt(det(fix) / det(fix + 2 * cloud)),
            "A Gaussian's integral goes with the root of the determinant.": share(cloud, fix) ** 2,
            "Nearly, for a sharp fix: that is the limit, and the exact expression is as short.": np.sqrt(
                2.0 ** len(fix) * det(fix) / det(cloud)
            ),
            "The two have changed places: a sharper fix must leave fewer.": share(fix, cloud),
            "Upside down: that is how many particles one effective one costs.": 1 / share(cloud, fix),
        },
        otherwise="E[w] and E[w²] are integrals of exp(-½ eᵀ M e), with a matrix M each: which?",
        tolerance=1e-9,  # shares are small: a coarser one takes two wrong turns for one
    )


def _slanted(rng: np.random.Generator, sigma: Any) -> Any:
    """A covariance (n, n) with standard deviations ``sigma`` in about that order, turned out of the axes."""
    A = np.diag(sigma) @ (np.eye(len(sigma)) + 0.4 * rng.standard_normal((len(sigma), len(sigma))))
    return A @ A.T


@exercise("lab08.mixture_log_weights")
def mixture_log_weights(answer: Any, rng: np.random.Generator) -> None:
    _mixture(answer, rng, float(rng.uniform(0.05, 0.45)))
    _mixture(answer, rng, float(rng.uniform(0.55, 0.95)))


def _mixture(answer: Any, rng: np.random.Generator, share: float) -> None:
    n = 20
    log_prior, log_fix = rng.normal(-12, 2, n), rng.normal(-9, 3, n)
    log_prior[:3], log_fix[:3] = -900.0, -880.0  # far from both: exp underflows
    log_likelihood = np.logaddexp(np.log(0.98) + log_fix, np.log(0.02) - 16)
    got = call(answer, log_prior, log_fix, log_likelihood, share)
    top = log_prior + log_likelihood

    def below(a: float, b: float) -> Any:
        return np.logaddexp(np.log(a) + log_prior, np.log(b) + log_fix)

    with np.errstate(divide="ignore", invalid="ignore"):
        naive = np.log(np.exp(log_prior) * np.exp(log_likelihood)
                       / ((1 - share) * np.exp(log_prior) + share * np.exp(log_fix)))  # fmt: skip
        half_naive = top - np.log((1 - share) * np.exp(log_prior) + share * np.exp(log_fix))
    expected = top - below(1 - share, share)
    hints = {
        "Zero over zero: the densities underflowed. logaddexp adds two numbers that live in logs.": naive,
        "The logarithm of zero: the densities underflowed. logaddexp adds two numbers that live in logs.": half_naive,
        "A share multiplies a density; to the density's logarithm its own logarithm is added.": top
        - np.logaddexp((1 - share) * log_prior, share * log_fix),
        "The shares have changed places: which part of the particles came from the fix?": top - below(share, 1 - share),
        "Every particle came from one of two sources: leave out neither in the denominator.": top - log_fix,
        "That is the plain filter: what came from the fix would not pay for its source.": log_likelihood,
        "Half the answer: the particles pay for their source, but nobody asked the motion.": log_likelihood
        - below(1 - share, share),
        "The measurement is missing from the numerator.": log_prior - below(1 - share, share),
        "A sum of densities is no sum of logs: that is their geometric mean.": top
        - ((1 - share) * log_prior + share * log_fix),
        "Those are the weights; the caller asked for their logs.": np.exp(expected),
        "Those are weights that add up to one, and no logarithms.": np.exp(expected) / np.sum(np.exp(expected)),
    }
    got_array = np.asarray(got, dtype=float)
    if got_array.shape == expected.shape:  # a common constant does not matter, and neither do hints about it
        got = (
            got_array - np.nan_to_num(got_array[-1] - expected[-1])
            if _differ_by_a_constant(got_array, expected)
            else got
        )
    close(
        got,
        expected,
        misconceptions=hints,
        otherwise="Write w = target / proposal with the target prior × likelihood, then take the logarithm.",
        tolerance=1e-8,
    )


def _differ_by_a_constant(a: Any, b: Any) -> bool:
    difference = a - b
    return bool(np.all(np.isfinite(difference)) and np.ptp(difference) < 1e-8)


@exercise("lab08.best_estimate")
def best_estimate(answer: Any, rng: np.random.Generator) -> None:
    # A fixed grid has an edge through one of these places, whatever its cell is: 600 is a multiple of most round
    # sizes, and the others lie half-way between two.
    for place in (600.0, 630.0, 625.0, 640.0, 650.0, 675.0):
        _estimate(answer, rng, np.full(2, place), np.pi)
    _estimate(answer, rng, rng.uniform(200, 800, 2), rng.uniform(-3, 3))


def _estimate(answer: Any, rng: np.random.Generator, heavy: Any, heading: float) -> None:
    light, few, many = rng.uniform(1500, 2300, 2), 150, 340
    spread = np.array([4.0, 4.0, 0.15])
    crowd = spread * rng.standard_normal((few, 3))
    crowd -= crowd.mean(axis=0)
    states = np.vstack([
        np.array([*heavy, heading]) + crowd,
        [*light, 0.5] + np.array([50.0, 50.0, 1.0]) * rng.standard_normal((many, 3)),
        [light[0] + 300.0, light[1] - 300.0, 1.0] + 0.01 * rng.standard_normal((1, 3)),
    ])  # fmt: skip
    states[:, 2] = wrap_angle(states[:, 2])
    # More weight on one side, so that the plain mean misses it; no particle outweighs the stray one.
    uneven = np.exp(0.3 * np.minimum(crowd[:, :2].sum(axis=1) / np.sqrt(2), 6.0))
    weights = np.concatenate([0.58 * uneven / uneven.sum(), np.full(many, 0.39 / many), [0.03]])
    centre = weights[:few] @ states[:few, :2] / weights[:few].sum()
    order = rng.permutation(len(weights))
    states, weights = states[order], weights[order]
    got = np.asarray(call(answer, states, weights), dtype=float)
    expect(got.shape == (3,), f"A pose [x, y, θ] is wanted, of shape (3,); yours has {got.shape}.")
    expect(bool(np.all(np.isfinite(got))), "Some of your numbers are NaN or infinite.")

    def at(place: Any, reach: float) -> bool:
        return bool(np.hypot(*(got[:2] - place)) < reach)

    expect(not at(states[np.argmax(weights), :2], 1.0), "That is the particle of greatest weight: it stands alone, and "
           "nearly all of the belief lies elsewhere.")  # fmt: skip
    expect(not at(weights @ states[:, :2], 30.0), "That is the mean of the whole cloud: the robot is surely not there.")
    expect(not at(states[:, :2].mean(axis=0), 30.0), "Your mean takes no notice of the weights.")
    expect(not at(np.median(states[:, :2], axis=0), 100) and not at(light, 150), "You went where the most particles "
           "are; go where the most weight is (a fixed grid may have cut that crowd in two).")  # fmt: skip
    expect(at(heavy, 40.0), "Group the particles by place, sum the weight of each group, and stay with the heaviest.")
    alone = np.hypot(*(states[:, :2] - got[:2]).T).min() < 1e-9
    expect(not alone, "The right group, but one particle of it: its mean would wander less.")
    expect(not at(heavy, 0.3), "The right group, but in its mean all particles count alike: weigh them there as well.")
    expect(at(centre, 1.0), "The right group, but only a part of it (a fixed grid may have cut the crowd in two) "
           "or not its weighted mean.")  # fmt: skip
    expect(abs(float(wrap_angle(got[2] - heading))) < 0.15, "The place is right. The headings lie on both sides of ±π, "
           "where a plain mean points backwards.")  # fmt: skip
