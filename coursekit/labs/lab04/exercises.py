"""The checks of Lab 4: an angle's innovation, a covariance moved and one corrected, a Jacobian, a band."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from scipy.stats import chi2

from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive, RangeBearing
from coursekit.teaching.exercises import call, close, exercise, expect


def _covariance(rng: np.random.Generator, n: int) -> Array:
    A = rng.normal(size=(n, n))
    return np.asarray(A @ A.T + 0.3 * np.eye(n))


@exercise("lab04.innovation")
def innovation(answer: Any, rng: np.random.Generator) -> None:
    there = np.array([rng.uniform(8, 10), np.pi - rng.uniform(0.05, 0.2)])
    here = np.array([rng.uniform(2, 4), -np.pi + rng.uniform(0.05, 0.2)])
    for z, z_hat in ((here, there), (there, here)):  # across the seam, from either side
        bare = z - z_hat
        right = np.array([bare[0], wrap_angle(bare[1])])
        close(
            call(answer, z, z_hat),
            right,
            misconceptions={
                "Wrapped into [0, 2π), a small turn to one side looks like almost a whole one to the other.":
                    np.array([bare[0], bare[1] % (2 * np.pi)]),
                "Two directions a few degrees apart came out as nearly a whole turn: bring it into (-π, π].": bare,
                "Measured minus expected, in this order: yours pushes the belief the wrong way.": -right,
                "You wrapped the range as well; metres do not go round in a circle.": wrap_angle(bare),
                "You threw the sign away; left and right are different surprises.": np.abs(right),
            },
            otherwise="The range's difference stays as it is; the bearing's goes through wrap_angle.",
        )  # fmt: skip
    for near, far in ((rng.uniform(-1.5, 0, 2), rng.uniform(0, 1.5, 2)), (np.zeros(2), np.zeros(2))):
        z, z_hat = np.array([2.0, near[0]]), np.array([2.0, far[0]])
        for a, b in ((z, z_hat), (z_hat, z)):
            close(
                call(answer, a, b),
                a - b,
                otherwise="Right across ±π, and wrong where both bearings are ahead; a plain difference will do there.",
            )


@exercise("lab04.predict_covariance")
def predict_covariance(answer: Any, rng: np.random.Generator) -> None:
    motion, x, u = DifferentialDrive(0.3, 0.2), rng.normal(size=3), rng.uniform(0.5, 1.5, 2)
    _predict(answer, _covariance(rng, 3), motion.F(x, u, 1.0), motion.Q(x, u, 1.0))
    n = int(rng.integers(4, 7))
    _predict(answer, _covariance(rng, n), rng.normal(size=(n, n)), _covariance(rng, n))


def _predict(answer: Any, P: Array, F: Array, Q: Array) -> None:
    close(
        call(answer, P, F, Q),
        F @ P @ F.T + Q,
        misconceptions={
            "In NumPy, * multiplies entry by entry; a product of matrices is written @.": F * P * F.T + Q,
            "F P F is not symmetric, so it is no covariance: one of the two wants a transpose.": F @ P @ F + Q,
            "The transpose stands on the wrong side: in F P Fᵀ the errors are moved first, then squared.":
                F.T @ P @ F + Q,
            "A robot that moves gets less sure, and nothing here says so: where is its own noise?": F @ P @ F.T,
            "A covariance is a product of two errors: F has to move both of them.": F @ P + Q,
            "The noise is added to the errors after they were moved, so F does not touch it.": F @ (P + Q) @ F.T,
            "You left the old covariance where it was: a wrong heading has to become a wrong position.": P + Q,
            "Noise does not cancel noise: two independent errors add their variances.": F @ P @ F.T - Q,
        },
        otherwise="Write the error after the step as F e + w, and take the mean of its product with its transpose.",
    )  # fmt: skip


@exercise("lab04.correct")
def correct(answer: Any, rng: np.random.Generator) -> None:
    _correct(answer, rng, 3, 2)
    _correct(answer, rng, int(rng.integers(4, 7)), 3)
    _correct(answer, rng, 4, 1)


def _correct(answer: Any, rng: np.random.Generator, n: int, m: int) -> None:
    x, P, H = rng.normal(size=n), _covariance(rng, n), rng.normal(size=(m, n))
    R, nu = _covariance(rng, m) * 0.3, rng.normal(size=m)
    no_inverse = (
        "You used an inverse. K S = P Hᵀ is a set of linear equations, and np.linalg.solve solves them as "
        "they are: quicker, and with smaller errors."
    )
    inverses = (np.linalg.inv, np.linalg.pinv, scipy.linalg.inv, scipy.linalg.pinv)
    got = call(
        answer, x, P, H, R, nu,
        without={no_inverse: inverses},
        stops={"solve(A, B)": "In K S = P Hᵀ the unknown stands on the left. S is symmetric: solve S Kᵀ = H P for Kᵀ."},
    )  # fmt: skip
    expect(isinstance(got, (tuple, list)) and len(got) == 2, "Return two things: the new mean and the new covariance.")
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    hint_mean = "Straight from the definition: K = P Hᵀ S⁻¹ with S = H P Hᵀ + R, then add K ν to the mean."
    expect(np.shape(got[0]) == x.shape, f"The mean has shape {x.shape}; yours has {np.shape(got[0])}.")
    close(
        got[0] - x,
        K @ nu,
        misconceptions={
            "The mean has not changed, although something was learned: add K ν.": 0 * x,
            "That is the correction K ν alone: it is added to the old mean.": K @ nu - x,
            "The correction has the wrong sign: ν is measured minus expected, and the belief goes towards it.":
                -K @ nu,
            "That gain believes the measurement completely: S has two parts, and R is one of them.":
                np.linalg.solve(H @ P @ H.T, H @ P).T @ nu,
            "Without S⁻¹ this is no gain: divide by how surprising the innovation may be.": P @ H.T @ nu,
            "Your gain weighs by R alone; S also holds what the belief itself leaves open, H P Hᵀ.":
                P @ H.T @ np.linalg.solve(R, nu),
        },
        otherwise=hint_mean,
    )  # fmt: skip
    close(
        got[1],
        P - K @ S @ K.T,
        misconceptions={
            "A measurement made your filter less sure: the term is taken away, not added.": P + K @ H @ P,
            "The covariance has not changed, although something was learned.": P,
            "I - K H has to multiply P: you returned the factor.": np.eye(n) - K @ H,
            "K S Kᵀ is what the measurement takes away; it is not yet taken from P.": K @ S @ K.T,
            "What is taken away is K S Kᵀ; R alone is not S.": P - K @ R @ K.T,
            "That is half of Joseph's form: it has a second term, K R Kᵀ.":
                (np.eye(n) - K @ H) @ P @ (np.eye(n) - K @ H).T,
        },
        otherwise="The covariance falls by K S Kᵀ, which is the same as (I - K H) P.",
    )  # fmt: skip


@exercise("lab04.range_bearing_jacobian")
def range_bearing_jacobian(answer: Any, rng: np.random.Generator) -> None:
    for quadrant in ([1, 1], [-1, 1], [-1, -1], [1, -1]):
        _jacobian(answer, rng.uniform([-1, -1, -3], [1, 1, 3]), rng.uniform(2, 5, 2) * quadrant)
    x = rng.uniform([-1, -1, -3], [1, 1, 3])
    for ahead in (np.array([1.0, 0.0]), np.array([0.0, -1.0])):  # Δy = 0, then Δx = 0
        H, hint = RangeBearing(x[:2] + 2 * ahead).H(x), "Right, but not where Δx or Δy is zero: what do you divide by?"
        got = call(answer, x, x[:2] + 2 * ahead)
        expect(_finite(got), hint)
        close(got, H, otherwise=hint)


def _finite(got: Any) -> bool:
    numbers = np.asarray(got)
    return numbers.dtype.kind not in "fc" or bool(np.all(np.isfinite(numbers)))


def _jacobian(answer: Any, x: Array, landmark: Array) -> None:
    H = RangeBearing(landmark).H(x)
    repeated, towards, scaled = H.copy(), H.copy(), H.copy()
    repeated[0, 1] = H[0, 0]
    towards[:, :2] *= -1
    scaled[1, :2] *= np.hypot(*(landmark - x[:2]))
    headless = H.copy()
    headless[1, 2] = 0.0
    turned = H.copy()
    turned[1, 2] = 1.0
    sideways = H.copy()
    sideways[1, :2] *= -1
    swapped = H.copy()
    swapped[1, :2] = H[1, 1::-1]
    close(
        call(answer, x, landmark),
        H,
        misconceptions={
            "The second column repeats the first: there Δy belongs. It is the homework's Eq. (10).": repeated,
            "The bearing is measured from the heading: turn left, and everything moves to the right.": headless,
            "Turn left, and a landmark's bearing goes *down*: look at the sign of the last column.": turned,
            "That is the derivative by the landmark: step towards it, and the range must fall.": towards,
            "Step to your left, and a landmark ahead moves to the right: two signs turned in row two.": sideways,
            "To move towards a landmark does not change its bearing: exchange Δx and Δy there.": swapped,
            "The bearing's row is short of a division: r², not r, since the angle shrinks with the distance.": scaled,
            "Rows are measurements and columns are the state: yours are exchanged.": H.T,
        },
        otherwise="Differentiate √(Δx² + Δy²) and atan2(Δy, Δx) - θ by x, y and θ; then compare with differences.",
    )  # fmt: skip


@exercise("lab04.share_inside")
def share_inside(answer: Any, rng: np.random.Generator) -> None:
    _share_inside(answer, rng, 3)
    _share_inside(answer, rng, int(rng.integers(1, 8)))


def _share_inside(answer: Any, rng: np.random.Generator, dof: int) -> None:
    runs, steps = int(rng.integers(20, 40)), 1009  # shares of many steps seldom agree by chance
    values = rng.chisquare(dof, size=(runs, steps)) * np.linspace(0.3, 3.5, steps) * np.linspace(0.1, 1, runs)[:, None]
    average = values.mean(axis=0)
    low, high = chi2.ppf([0.025, 0.975], dof * runs) / runs
    single = chi2.ppf([0.025, 0.975], dof)
    every = np.mean((values > single[0]) & (values < single[1]))
    close(
        call(answer, values, dof),
        np.mean((average > low) & (average < high)),
        misconceptions={
            "You asked only whether it is too sure. A covariance that is far too large is wrong as well: two sides.":
                np.mean(average < chi2.ppf(0.95, dof * runs) / runs),
            "That is the band of one run; an average of many scatters less.":
                np.mean((average > single[0]) & (average < single[1])),
            "You tested every single run; average over the runs first, at each step.": every,
            "The band is that of the *sum* over the runs; yours still has to be divided by their number.":
                np.mean((average > low * runs) & (average < high * runs)),
            "You averaged over time: a filter that is too sure now and too modest later would pass.":
                np.mean((values.mean(axis=1) > low) & (values.mean(axis=1) < high)),
            "That is the share of the steps outside the band; inside is asked for.":
                1 - np.mean((average > low) & (average < high)),
            "That is how many steps are inside; wanted is their share.": np.sum((average > low) & (average < high)),
            "Right, but in per cent: the share is asked for as a number from 0 to 1.":
                100 * np.mean((average > low) & (average < high)),
            "One side only, and with the band of one run: an average of many scatters less.":
                np.mean(average < chi2.ppf(0.95, dof)),
            "The upper end of the band is right; a covariance that is far too large is wrong as well: two sides.":
                np.mean(average < high),
            "Every single run, and on one side only: average over the runs first, then look at both sides.":
                np.mean(values < chi2.ppf(0.95, dof)),
            "Each tail has to hold half of the 5 %.":
                np.mean((average > chi2.ppf(0.05, dof * runs) / runs) & (average < chi2.ppf(0.95, dof * runs) / runs)),
        },
        otherwise="Average over runs at each step, then compare with chi2_band(dof, runs) on both sides.",
        together=False,  # shares of counted steps agree by chance
    )  # fmt: skip
