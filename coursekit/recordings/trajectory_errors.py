r"""How far an estimated trajectory is from the true one, as the field measures it.

The absolute error asks for the map: how far is each pose from where it should be, after the two are laid on each
other?  The relative error asks for the drift: how wrong is the motion over one step, or over one metre?

Source: Sturm et al. (2012) for both; Umeyama (1991) for the alignment.  The numbers are those of the package evo.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from coursekit.doors import LARGEST, as_numbers, number
from coursekit.geometry import Array
from coursekit.recordings.trajectories import Trajectory

ALIGNMENTS = ("none", "origin", "rigid", "similarity")


@dataclass(frozen=True, repr=False)
class TrajectoryError:
    """What is left between two trajectories, pose by pose or step by step.

    translation : (n,) metres.     rotation : (n,) radians, in [0, π].     time : (n,) seconds, of the (later) pose.
    T_truth_estimate : (4, 4), what laid the estimate on the truth.     scale : what the estimate was multiplied by.
    """

    translation: Array
    rotation: Array
    time: Array
    T_truth_estimate: Array
    scale: float = 1.0

    @property
    def rmse(self) -> float:
        """Root mean square of the translation's error, metres."""
        return float(np.sqrt(np.mean(self.translation**2)))

    @property
    def rotation_rmse(self) -> float:
        """Root mean square of the rotation's error, radians."""
        return float(np.sqrt(np.mean(self.rotation**2)))

    def __repr__(self) -> str:
        return (f"TrajectoryError({len(self.time)} compared: rmse {self.rmse:.4g} m, {self.rotation_rmse:.4g} rad; "
                f"median {np.median(self.translation):.4g} m, worst {self.translation.max():.4g} m)")  # fmt: skip


def matched(estimate: Trajectory, truth: Trajectory, max_difference: float = 0.01) -> tuple[Trajectory, Trajectory]:
    """The poses of two trajectories that belong together: for each of the shorter the other's nearest in time.

    max_difference : seconds; a pose with no partner that near is left out.

    Raises ValueError when nothing belongs together, and for a difference that is negative.

    >>> a = Trajectory.planar([0.0, 1.0, 2.0], np.zeros((3, 3)))
    >>> b = Trajectory.planar([0.001, 2.001], np.ones((2, 3)))
    >>> matched(a, b)[0].time
    array([0., 2.])
    """
    for name, trajectory in (("estimate", estimate), ("truth", truth)):
        if not isinstance(trajectory, Trajectory):
            raise TypeError(f"{name}: expected a Trajectory, got {type(trajectory).__name__}")
    if not number(max_difference, "max_difference") >= 0:
        raise ValueError(f"max_difference: expected seconds ≥ 0, got {max_difference}")
    few, many = (estimate, truth) if len(estimate) <= len(truth) else (truth, estimate)
    if not len(few):
        raise ValueError("expected trajectories with poses, got an empty one")
    at = np.clip(np.searchsorted(many.time, few.time), 1, max(len(many) - 1, 1))
    near = np.where(few.time - many.time[at - 1] <= many.time[np.minimum(at, len(many) - 1)] - few.time, at - 1, at)
    near = np.minimum(near, len(many) - 1)
    kept = np.abs(many.time[near] - few.time) <= max_difference
    if not kept.any():
        raise ValueError(
            f"no two stamps are within {max_difference} s: estimate {estimate.time[0]:g} to {estimate.time[-1]:g} s, "
            f"truth {truth.time[0]:g} to {truth.time[-1]:g} s"
        )
    a = Trajectory(few.time[kept], few.T_world_robot[kept])
    b = Trajectory(many.time[near[kept]], many.T_world_robot[near[kept]])
    return (a, b) if few is estimate else (b, a)


def absolute_error(
    estimate: Trajectory | ArrayLike, truth: Trajectory | ArrayLike, align: str = "rigid", max_difference: float = 0.01
) -> TrajectoryError:
    """The absolute trajectory error (ATE, evo's APE): how far each pose is from the true one.

    Parameters
    ----------
    estimate, truth : trajectories, matched by their stamps (see ``matched``); or poses [x, y, θ], (n, 3) each, that
        belong together row by row.
    align : "rigid" lays the estimate on the truth by the rotation and translation that fit the positions best;
        "similarity" fits a scale too; "origin" lets the first poses agree; "none" takes both as they are.

    Raises ValueError for another alignment, for what does not match, and where the positions lie on a line or a point,
    so that a rotation about it would change nothing ("origin" and "none" need no more than one pose).

    >>> truth = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [2.0, 1.0, 0.2], [3.0, 3.0, 0.3]])
    >>> absolute_error(truth + [5.0, 5.0, 0.0], truth).rmse < 1e-12
    True
    >>> round(absolute_error(truth + [3.0, 4.0, 0.0], truth, align="none").rmse, 6)
    5.0
    """
    if not isinstance(align, str) or align not in ALIGNMENTS:
        raise ValueError(f"align: expected one of {', '.join(ALIGNMENTS)}, got {align!r}")
    est, ref = _pair(estimate, truth, max_difference)
    P, Q = est.T_world_robot, ref.T_world_robot
    T, scale = np.eye(4), 1.0
    if align == "origin":
        T = Q[0] @ _inverse(P[:1])[0]
    elif align != "none":
        T, scale = umeyama(P[:, :3, 3], Q[:, :3, 3], scale=align == "similarity")
    P = P.copy()
    P[:, :3, 3] *= scale
    return _errors(_inverse(Q) @ (T @ P), ref.time, T, scale)


def relative_error(
    estimate: Trajectory | ArrayLike,
    truth: Trajectory | ArrayLike,
    delta: float = 1,
    unit: str = "frames",
    every: bool = False,
    max_difference: float = 0.01,
) -> TrajectoryError:
    """The relative pose error (RPE): how wrong the motion over a step, or a stretch of the way, is.

    Parameters
    ----------
    estimate, truth : as for ``absolute_error``.  No alignment: a motion is the same in every frame.
    delta, unit : "frames" compares the motion over ``delta`` poses; "metres" over stretches of at least that much of
        the estimate's way.
    every : start a stretch at every pose, so that they overlap; by default one begins where the last one ends.  Only
        for frames.

    Raises ValueError for another unit, a delta that is not positive (whole, for frames), trajectories shorter than
    that, and what does not match.

    >>> truth = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    >>> relative_error(truth * [1.1, 1, 1], truth).translation.round(6)       # 10 % too far in each step
    array([0.1, 0.1])
    """
    if not isinstance(unit, str) or unit not in ("frames", "metres") or (every and unit != "frames"):
        raise ValueError(f"unit: expected frames or metres (every: frames only), got {unit!r}, every={every}")
    if not 0 < number(delta, "delta") < LARGEST or (unit == "frames" and delta != int(delta)):
        raise ValueError(f"delta: expected a positive number of {unit}, got {delta}")
    est, ref = _pair(estimate, truth, max_difference)
    starts, ends = _stretches(est.positions, delta) if unit == "metres" else _steps(len(est), int(delta), every)
    if not len(starts):
        raise ValueError(f"delta: expected a trajectory of at least {delta:g} {unit}, got {est}")
    P, Q = est.T_world_robot, ref.T_world_robot
    moved, should = _inverse(P[starts]) @ P[ends], _inverse(Q[starts]) @ Q[ends]
    return _errors(_inverse(should) @ moved, ref.time[ends], np.eye(4), 1.0)


def umeyama(source: ArrayLike, target: ArrayLike, scale: bool = False) -> tuple[Array, float]:
    """The motion, and the scale, that bring points onto others best in least squares: T (4, 4) and s.

    source, target : (n, 3), metres; target ≈ R (s · source) + t.

    Raises ValueError for other shapes, and for points on a line or a point, about which any rotation fits as well.

    Source: Umeyama (1991), equations 34 to 43.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> T, s = umeyama(square, 2 * square + [1, 2, 3], scale=True)
    >>> T[:3, 3].round(6) + 0.0, round(s, 6)
    (array([1., 2., 3.]), 2.0)
    """
    x, y = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
    if x.ndim != 2 or x.shape != y.shape or x.shape[1] != 3:
        raise ValueError(f"expected two sets of points (n, 3) of one size, got {x.shape} and {y.shape}")
    dx, dy = x - x.mean(axis=0), y - y.mean(axis=0)
    U, d, Vt = np.linalg.svd(dy.T @ dx / len(x))
    if np.sum(d > np.finfo(float).eps * max(1.0, d[0])) < 2:
        raise ValueError("the positions lie on a line or a point, so no alignment is best; align by 'origin' or 'none'")
    S = np.diag([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    s = float(np.sum(d * np.diag(S)) / np.mean(np.sum(dx**2, axis=1))) if scale else 1.0
    T = np.eye(4)
    T[:3, :3] = U @ S @ Vt
    T[:3, 3] = y.mean(axis=0) - s * T[:3, :3] @ x.mean(axis=0)
    return T, s


def _pair(
    estimate: Trajectory | ArrayLike, truth: Trajectory | ArrayLike, max_difference: float
) -> tuple[Trajectory, Trajectory]:
    if isinstance(estimate, Trajectory) and isinstance(truth, Trajectory):
        return matched(estimate, truth, max_difference)
    if isinstance(estimate, Trajectory) or isinstance(truth, Trajectory):
        raise ValueError(
            "expected two trajectories or two arrays of poses, got one of each; Trajectory.planar makes one"
        )
    a, b = as_numbers(estimate, "estimate"), as_numbers(truth, "truth")
    if a.ndim != 2 or a.shape != b.shape or a.shape[1] != 3 or not len(a):
        raise ValueError(f"expected poses [x, y, θ], (n, 3) each, row by row, got {a.shape} and {b.shape}")
    return Trajectory.planar(np.arange(len(a)), a), Trajectory.planar(np.arange(len(b)), b)


def _errors(E: Array, time: Array, T: Array, scale: float) -> TrajectoryError:
    rotation = Rotation.from_matrix(E[:, :3, :3]).magnitude()
    return TrajectoryError(np.linalg.norm(E[:, :3, 3], axis=1), rotation, time, T, scale)


def _inverse(T: Array) -> Array:
    out = np.tile(np.eye(4), (len(T), 1, 1))
    out[:, :3, :3] = T[:, :3, :3].transpose(0, 2, 1)
    out[:, :3, 3] = -(out[:, :3, :3] @ T[:, :3, 3:])[..., 0]
    return out


def _steps(n: int, delta: int, every: bool) -> tuple[np.ndarray, np.ndarray]:
    starts = np.arange(n - delta) if every else np.arange(0, n - delta, delta)
    return starts, starts + delta


def _stretches(positions: Array, delta: float) -> tuple[np.ndarray, np.ndarray]:
    ids, gone = [0], 0.0
    for i, step in enumerate(np.linalg.norm(np.diff(positions, axis=0), axis=1), start=1):
        gone += step
        if gone >= delta:
            ids.append(i)
            gone = 0.0
    return np.array(ids[:-1], dtype=int), np.array(ids[1:], dtype=int)
