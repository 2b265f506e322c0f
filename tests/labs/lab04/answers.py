"""Right and wrong answers to the exercises of Lab 4."""

import math

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from coursekit.gaussian import chi2_band
from coursekit.geometry import wrap_angle
from coursekit.models import RangeBearing
from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def parts(x, landmark):
    dx, dy = landmark - x[:2]
    return dx, dy, math.hypot(dx, dy)


def jacobian(x, landmark):
    dx, dy, r = parts(x, landmark)
    return np.array([[-dx / r, -dy / r, 0.0], [dy / r**2, -dx / r**2, -1.0]])


def spoiled(change):
    def answer(x, landmark):
        H = jacobian(x, landmark)
        change(H, parts(x, landmark)[2])
        return H

    return answer


def repeat_column(H, r):
    H[0, 1] = H[0, 0]


def forget_heading(H, r):
    H[1, 2] = 0.0


def turn_heading(H, r):
    H[1, 2] = 1.0


def towards_landmark(H, r):
    H[:, :2] *= -1


def divide_once(H, r):
    H[1, :2] *= r


def wrong_way(H, r):
    H[1, :2] *= -1


def exchange(H, r):
    H[1, :2] = H[1, 1::-1].copy()


def divided_by_dx(x, landmark):
    """The derivative of arctan(Δy/Δx), as it comes."""
    with np.errstate(all="ignore"):
        dx, dy, r = parts(x, landmark)
        t = dy / dx
        return np.array([[-dx / r, -dy / r, 0], [t / dx / (1 + t**2), -1 / dx / (1 + t**2), -1]])


def numerical_jacobian(x, landmark):
    sensor, steps = RangeBearing(landmark), 1e-6 * np.eye(3)
    return np.stack([sensor.residual(sensor.h(x + s), sensor.h(x - s)) / 2e-6 for s in steps], axis=-1)


def gain(P, H, R):
    return np.linalg.solve(H @ P @ H.T + R, H @ P).T


def reference_correct(x, P, H, R, nu):
    K = gain(P, H, R)
    return x + K @ nu, (np.eye(len(x)) - K @ H) @ P


def correct_by_inverse(x, P, H, R, nu):
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    return x + K @ nu, (np.eye(len(x)) - K @ H) @ P


def joseph_correct(x, P, H, R, nu):
    K = cho_solve(cho_factor(H @ P @ H.T + R), H @ P).T
    A = np.eye(len(x)) - K @ H
    return [x + K @ nu, A @ P @ A.T + K @ R @ K.T]


def correct_with(mean=None, cov=None):
    def answer(x, P, H, R, nu):
        right = reference_correct(x, P, H, R, nu)
        K = gain(P, H, R)
        return (mean or (lambda *a: right[0]))(x, P, H, R, nu, K), (cov or (lambda *a: right[1]))(x, P, H, R, nu, K)

    return answer


def wrapped(z, z_hat):
    return np.array([z[0] - z_hat[0], wrap_angle(z[1] - z_hat[1])])


def by_complex_numbers(z, z_hat):
    return [z[0] - z_hat[0], np.angle(np.exp(1j * (z[1] - z_hat[1])))]


def inside(values, low, high):
    return np.mean((values > low) & (values < high))


def reference_share(values, dof):
    return inside(values.mean(axis=0), *chi2_band(dof, len(values)))


def second_share(values, dof):
    p = chi2.cdf(values.sum(axis=0), dof * len(values))
    return np.count_nonzero(np.abs(p - 0.5) < 0.475) / values.shape[1]


ANSWERS = {
    "lab04.innovation": Answers(
        stub=stub,
        reference=wrapped,
        second=by_complex_numbers,
        wrong={
            "bare minus": (lambda z, z_hat: z - z_hat, "nearly a whole turn"),
            "expected minus measured": (lambda z, z_hat: -wrapped(z, z_hat), "in this order"),
            "range wrapped": (lambda z, z_hat: wrap_angle(z - z_hat), "wrapped the range"),
            "no sign": (lambda z, z_hat: np.abs(wrapped(z, z_hat)), "threw the sign away"),
            "wrapped to [0, 2π)": (
                lambda z, z_hat: np.array([z[0] - z_hat[0], (z[1] - z_hat[1]) % (2 * np.pi)]),
                "into [0, 2π)",
            ),
            "in place": (lambda z, z_hat: z.__isub__(z_hat), "changes its argument"),
            "always a turn": (
                lambda z, z_hat: (
                    wrapped(z, z_hat) if abs((z - z_hat)[1]) > 3 else np.add(wrapped(z, z_hat), [0, 2 * np.pi])
                ),
                "a plain difference will do",
            ),
        },
        both={
            "bare, expected minus measured": (
                lambda z, z_hat: z_hat - z,
                ("nearly a whole turn", "in this order"),
            ),
            "range wrapped, expected minus measured": (
                lambda z, z_hat: wrap_angle(z_hat - z),
                ("wrapped the range", "in this order"),
            ),
            "range's sign, bearing bare": (
                lambda z, z_hat: np.array([z_hat[0] - z[0], z[1] - z_hat[1]]),
                ("nearly a whole turn", "in this order"),
            ),
        },
    ),
    "lab04.predict_covariance": Answers(
        stub=stub,
        reference=lambda P, F, Q: F @ P @ F.T + Q,
        second=lambda P, F, Q: np.einsum("ij,jk,lk->il", F, P, F) + Q,
        wrong={
            "transpose first": (lambda P, F, Q: F.T @ P @ F + Q, "transpose stands on the wrong side"),
            "no noise": (lambda P, F, Q: F @ P @ F.T, "where is its own noise"),
            "one side": (lambda P, F, Q: F @ P + Q, "has to move both"),
            "noise moved": (lambda P, F, Q: F @ (P + Q) @ F.T, "F does not touch it"),
            "not moved": (lambda P, F, Q: P + Q, "left the old covariance"),
            "noise taken away": (lambda P, F, Q: F @ P @ F.T - Q, "Noise does not cancel"),
            "entry by entry": (lambda P, F, Q: F * P * F.T + Q, "is written @"),
            "no transpose": (lambda P, F, Q: F @ P @ F + Q, "wants a transpose"),
        },
        both={
            "entry by entry, noise taken away": (
                lambda P, F, Q: F * P * F.T - Q,
                ("is written @", "Noise does not cancel"),
            ),
            "transpose first, no noise": (
                lambda P, F, Q: F.T @ P @ F,
                ("transpose stands on the wrong side", "where is its own noise"),
            ),
            "one side, noise taken away": (
                lambda P, F, Q: F @ P - Q,
                ("has to move both", "Noise does not cancel"),
            ),
        },
    ),
    "lab04.correct": Answers(
        stub=stub,
        reference=reference_correct,
        second=joseph_correct,
        wrong={
            "wrong way": (correct_with(mean=lambda x, P, H, R, nu, K: x - K @ nu), "wrong sign"),
            "no R": (
                correct_with(mean=lambda x, P, H, R, nu, K: x + gain(P, H, 0 * R) @ nu),
                "believes the measurement",
            ),
            "no S": (correct_with(mean=lambda x, P, H, R, nu, K: x + P @ H.T @ nu), "Without S⁻¹"),
            "R alone": (
                correct_with(mean=lambda x, P, H, R, nu, K: x + P @ H.T @ np.linalg.solve(R, nu)),
                "weighs by R alone",
            ),
            "grows": (correct_with(cov=lambda x, P, H, R, nu, K: P + K @ H @ P), "less sure"),
            "unchanged": (correct_with(cov=lambda x, P, H, R, nu, K: P), "has not changed"),
            "factor": (correct_with(cov=lambda x, P, H, R, nu, K: np.eye(3) - K @ H), "returned the factor"),
            "half of Joseph": (
                correct_with(cov=lambda x, P, H, R, nu, K: (np.eye(3) - K @ H) @ P @ (np.eye(3) - K @ H).T),
                "half of Joseph",
            ),
            "mean only": (lambda x, P, H, R, nu: x, "Return two things"),
            "an inverse": (correct_by_inverse, "You used an inverse"),
            "solved from the wrong side": (
                lambda x, P, H, R, nu: x + np.linalg.solve(H @ P @ H.T + R, P @ H.T) @ nu,
                "solve S Kᵀ = H P",
            ),
            "what is taken away": (correct_with(cov=lambda x, P, H, R, nu, K: P @ H.T @ K.T), "not yet taken from P"),
        },
        both={
            "no S, wrong way": (
                correct_with(mean=lambda x, P, H, R, nu, K: x - P @ H.T @ nu),
                ("Without S⁻¹", "wrong sign"),
            ),
            "R alone, wrong way": (
                correct_with(mean=lambda x, P, H, R, nu, K: x - P @ H.T @ np.linalg.solve(R, nu)),
                ("weighs by R alone", "wrong sign"),
            ),
            "wrong way, grows": (
                correct_with(mean=lambda x, P, H, R, nu, K: x - K @ nu, cov=lambda x, P, H, R, nu, K: P + K @ H @ P),
                ("wrong sign", "less sure"),
            ),
        },
    ),
    "lab04.range_bearing_jacobian": Answers(
        stub=stub,
        reference=jacobian,
        second=numerical_jacobian,
        wrong={
            "Eq. (10)": (spoiled(repeat_column), "repeats the first"),
            "no heading": (spoiled(forget_heading), "measured from the heading"),
            "heading turned": (spoiled(turn_heading), "goes *down*"),
            "by the landmark": (spoiled(towards_landmark), "derivative by the landmark"),
            "bearing the wrong way": (spoiled(wrong_way), "two signs turned in row two"),
            "Δx and Δy exchanged": (spoiled(exchange), "exchange Δx and Δy"),
            "r instead of r²": (spoiled(divide_once), "short of a division"),
            "transposed": (lambda x, landmark: jacobian(x, landmark).T, "yours are exchanged"),
            "divided by Δx": (divided_by_dx, "what do you divide by"),
        },
        both={
            "no heading, r instead of r²": (
                spoiled(lambda H, r: (forget_heading(H, r), divide_once(H, r))),
                ("measured from the heading", "short of a division"),
            ),
            "by the landmark, r instead of r²": (
                spoiled(lambda H, r: (towards_landmark(H, r), divide_once(H, r))),
                ("derivative by the landmark", "short of a division"),
            ),
            "heading turned, exchanged": (
                spoiled(lambda H, r: (turn_heading(H, r), exchange(H, r))),
                ("goes *down*", "exchange Δx and Δy"),
            ),
            "Eq. (10), transposed": (
                lambda x, landmark: spoiled(repeat_column)(x, landmark).T,
                ("repeats the first", "yours are exchanged"),
            ),
        },
    ),
    "lab04.share_inside": Answers(
        stub=stub,
        reference=reference_share,
        second=second_share,
        wrong={
            "one side": (
                lambda v, dof: np.mean(v.mean(axis=0) < chi2.ppf(0.95, dof * len(v)) / len(v)),
                "two sides",
            ),
            "band of one run": (lambda v, dof: inside(v.mean(axis=0), *chi2_band(dof, 1)), "the band of one run"),
            "every run": (lambda v, dof: inside(v, *chi2_band(dof, 1)), "every single run"),
            "band of the sum": (
                lambda v, dof: inside(v.mean(axis=0), *chi2.ppf([0.025, 0.975], dof * len(v))),
                "that of the *sum*",
            ),
            "over time": (lambda v, dof: inside(v.mean(axis=1), *chi2_band(dof, len(v))), "averaged over time"),
            "tails of 5 %": (
                lambda v, dof: inside(v.mean(axis=0), *chi2_band(dof, len(v), 0.9)),
                "half of the 5 %",
            ),
            "outside": (lambda v, dof: 1 - reference_share(v, dof), "outside the band"),
            "count": (lambda v, dof: round(v.shape[1] * reference_share(v, dof)), "how many steps"),
            "per cent": (lambda v, dof: 100 * reference_share(v, dof), "in per cent"),
        },
        both={
            "one side, band of one run": (
                lambda v, dof: np.mean(v.mean(axis=0) < chi2.ppf(0.95, dof)),
                ("One side only", "the band of one run"),
            ),
            "one side, every run": (lambda v, dof: np.mean(v < chi2.ppf(0.95, dof)), ("Every single run",)),
        },
    ),
}
