"""The checks of Lab 9: commands that hold until the next, what a delay does to a step, and an error after alignment."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit import geometry
from coursekit.geometry import Array
from coursekit.teaching.exercises import call, close, exercise, expect


def _odometry(rng: np.random.Generator) -> Array:
    """Eight rows [t, v, ω] at irregular stamps, no two commands alike."""
    stamps = 100.0 + np.cumsum(rng.uniform(0.2, 1.5, 8))
    return np.column_stack([stamps, rng.uniform(0.05, 0.4, 8), rng.uniform(0.2, 0.9, 8) * rng.choice([-1, 1], 8)])


def _until(odometry: Array, t: float) -> Array:
    """∫ [v, ω] dt from the first stamp to t."""
    steps = np.diff(np.append(np.minimum(odometry[:, 0], t), t))
    return np.asarray(steps @ odometry[:, 1:])


def _at(odometry: Array, t: float) -> Array:
    """The command that holds at t."""
    return odometry[np.searchsorted(odometry[:, 0], t, side="right") - 1, 1:]


@exercise("lab09.commanded")
def commanded(answer: Any, rng: np.random.Generator) -> None:
    odometry = _odometry(rng)
    stamps = odometry[:, 0]
    middles = 0.5 * (stamps[:-1] + stamps[1:])
    _commanded(answer, odometry, rng.uniform(stamps[1], middles[1]), rng.uniform(middles[5], stamps[6]))
    _commanded(answer, odometry, middles[2] - 0.04, middles[2] + 0.03)  # within one command
    _commanded(answer, odometry, middles[3], stamps[-1] + rng.uniform(0.5, 2.0))  # the last command holds on
    _commanded(answer, odometry, stamps[0], stamps[4])


def _commanded(answer: Any, odometry: Array, begin: float, end: float) -> None:
    got = call(answer, odometry, begin, end)
    expect(np.shape(got) == (2,), "Return two numbers: metres and radians.")
    t, u = odometry[:, 0], odometry[:, 1:]
    inside = (t >= begin) & (t < end)
    edges = np.unique(np.concatenate([[begin, end], t[(t > begin) & (t < end)]]))
    widths, middles = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    straight = widths @ np.stack([np.interp(middles, t, column) for column in u.T], axis=-1)
    later = widths @ u[np.minimum(np.searchsorted(t, middles, side="right"), len(t) - 1)]
    gaps = np.diff(np.append(t, end))
    rows = gaps[inside] @ u[inside] if inside.any() else np.zeros(2)
    held = np.diff(np.append(t[inside], end)) @ u[inside] if inside.any() else np.zeros(2)
    chosen = u[inside] if inside.any() else u
    close(
        got,
        _until(odometry, end) - _until(odometry, begin),
        misconceptions={
            "You joined the rows by straight lines. A command holds until the next one is stamped.": straight,
            "You let a row hold until its own stamp. It holds from its stamp on, until the next.": later,
            "The command that was given before `begin` still holds at `begin`; you left its part out.": held,
            "You added whole rows. The first and the last interval are cut by `begin` and `end`.": rows,
            "The stamps are irregular, so the mean of the rows is not the mean over time.":
                chosen.mean(axis=0) * (end - begin),
            "You counted from the first row. Take away what was commanded before `begin`.": _until(odometry, end),
            "The interval runs from `begin` to `end`; yours has the wrong sign.":
                _until(odometry, begin) - _until(odometry, end),
            "That is the mean command, in m/s and rad/s. Multiply by the time.":
                (_until(odometry, end) - _until(odometry, begin)) / (end - begin),
        },
        otherwise="Draw the commands as steps over time. The answer is the area under each between `begin` and `end`.",
        tolerance=1e-6,
        together=False,
    )  # fmt: skip


@exercise("lab09.delay_derivative")
def delay_derivative(answer: Any, rng: np.random.Generator) -> None:
    odometry, delay, dt = _odometry(rng), rng.uniform(0.1, 0.18), 0.04
    t = odometry[2, 0] + 1.0
    # The command changes within the step, within the delayed step, and within one that looks ahead.
    odometry[3:6, 0] = t + 0.02 + delay * np.array([-1.0, 0.0, 1.0])
    odometry[6:, 0] = t + rng.uniform(1.0, 2.0) * np.array([1.0, 2.0])
    _derivative(answer, odometry, t, dt, delay)
    _derivative(answer, odometry, odometry[6, 0] + 0.2 + delay, 0.05, delay)  # within one command: nothing changes
    _derivative(answer, odometry, odometry[1, 0], odometry[7, 0] - odometry[1, 0], delay)  # many commands in a step


def _derivative(answer: Any, odometry: Array, t: float, dt: float, delay: float) -> None:
    got = call(answer, odometry, t, dt, delay)
    expect(np.shape(got) == (2,), "Return two numbers: one for v and one for ω.")
    first, last = _at(odometry, t - delay), _at(odometry, t + dt - delay)
    hints = {
        "The sign is wrong: with a longer delay the step loses the command at its end and gains the one at its "
        "beginning.": last - first,
        "That is the derivative of the mean command: you divided by dt. The step itself is wanted, in m and rad.":
            (first - last) / dt,
        "A delay looks back: what the robot does at t was commanded at t - delay.":
            _at(odometry, t + delay) - _at(odometry, t + dt + delay),
        "You forgot the delay: take the commands at t - delay and at t + dt - delay.":
            _at(odometry, t) - _at(odometry, t + dt),
        "That is only the end that is lost. The beginning moves as well.": -last,
        "That is only the end that is gained. The other end of the step moves as well.": first,
        "You multiplied by dt. Moving an interval by a little changes the area by its two edges, not by its width.":
            (first - last) * dt,
    }  # fmt: skip
    close(
        got,
        first - last,
        misconceptions={hint: value for hint, value in hints.items() if not np.allclose(value, first - last)},
        otherwise="The step is U(t + dt - delay) - U(t - delay), with U the integral of the commands. What is U'?",
        together=False,
    )


@exercise("lab09.aligned_rmse")
def aligned_rmse(answer: Any, rng: np.random.Generator) -> None:
    n = int(rng.integers(30, 60))
    truth = np.cumsum(rng.normal(0.02, 0.3, (n, 2)), axis=0)
    turn = rng.uniform(0.4, 2.6) * rng.choice([-1, 1])
    moved = geometry.transform(np.array([*rng.uniform(1, 3, 2), turn]), truth)
    _aligned(answer, moved + rng.normal(0, 0.15, moved.shape), truth)
    _aligned(answer, moved * [1.0, -1.0] + rng.normal(0, 0.05, moved.shape), truth)  # a mirror is not allowed to help
    _aligned(answer, 1.3 * moved + rng.normal(0, 0.05, moved.shape), truth)  # nor a scale


def _aligned(answer: Any, estimate: Array, truth: Array) -> None:
    got = call(answer, estimate, truth)
    expect(np.ndim(got) == 0, "Return one number, in metres.")
    p, q = estimate - estimate.mean(axis=0), truth - truth.mean(axis=0)
    U, s, Vt = np.linalg.svd(q.T @ p)
    sign = np.diag([1.0, np.sign(np.linalg.det(U @ Vt))])
    rotation = U @ sign @ Vt

    def rms(a: Array, b: Array) -> float:
        return float(np.sqrt(np.mean(np.sum((a - b) ** 2, axis=1))))

    apart = np.linalg.norm(p @ rotation.T - q, axis=1)
    scale = np.trace(np.diag(s) @ sign) / np.sum(p**2)
    start = geometry.rotation(
        float(np.arctan2(*(truth[1] - truth[0])[::-1]) - np.arctan2(*(estimate[1] - estimate[0])[::-1]))
    )
    right = rms(p @ rotation.T, q)
    hints = {
        "You did not align the tracks: a map's own frame may be shifted and turned.": rms(estimate, truth),
        "You moved the mean on the mean. The track may be turned, too.": rms(p, q),
        "That is the mean distance; RMS is the root of the mean square.": float(apart.mean()),
        "That is the RMS of the coordinates. A distance has two of them: sum their squares first.":
            right / np.sqrt(2),
        "Your motion contains a mirror. No motion of a robot turns left into right.": rms(p @ (U @ Vt).T, q),
        "You let the scale change. A robot that takes 1.3 m for 1 m is wrong.": rms(scale * p @ rotation.T, q),
        "That is the mean square; the root is missing.": right**2,
        "You turned the wrong way: check which cloud is moved onto which.": rms(p @ rotation, q),
        "You aligned the first points only. The first step's error then spoils the rest.":
            rms((estimate - estimate[0]) @ start.T, truth - truth[0]),
    }  # fmt: skip
    close(
        got,
        right,
        misconceptions={hint: value for hint, value in hints.items() if not np.isclose(value, right, rtol=1e-6)},
        otherwise="Two steps: the best rotation and shift (Lab 6), then the root of the mean squared distance.",
        together=False,
    )
