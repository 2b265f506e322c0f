r"""Angles, planar poses and spatial rotations.

A planar pose is an array ``[x, y, θ]`` (metres, metres, radians); ``T_world_robot`` takes coordinates in
the robot's frame to the world's.  Every function broadcasts over leading axes, so one pose and a million
particles go through the same line of code.  NaN and infinity come out as NaN.

>>> import numpy as np
>>> T_world_robot = np.array([1.0, 2.0, np.pi / 2])
>>> transform(T_world_robot, np.array([3.0, 0.0])).round(6)     # three metres ahead of the robot
array([1., 5.])
>>> compose(T_world_robot, inverse(T_world_robot)).round(12) + 0.0
array([0., 0., 0.])

Source: Murray, Li & Sastry (1994), chapter 2; Barfoot (2017), chapter 7.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.doors import LARGEST, as_numbers, number

Array = NDArray[np.float64]
_FLOAT = np.dtype(float)


def wrap_angle(angle: ArrayLike) -> Array:
    """Bring angles into (-π, π]: the one place where this project wraps.

    Parameters
    ----------
    angle : any shape, radians.

    Returns an array of the same shape (a 0-d input gives a float).  NaN and infinity give NaN.  Raises TypeError for
    what is no real number, ValueError for rows of different lengths.

    >>> float(wrap_angle(3 * np.pi))
    3.141592653589793
    """
    if type(angle) is float:  # one angle at a time is the filters' inner loop: 40 times faster than an array
        if not -np.inf < angle < np.inf:
            return np.nan
        turned: Any = angle if -np.pi < angle <= np.pi else np.pi - (np.pi - angle) % (2 * np.pi)
        return turned if turned != -np.pi else np.pi
    angle = as_numbers(angle, "angle")
    if angle.size and angle.min() > -np.pi and angle.max() <= np.pi:
        return angle.copy()[()]  # most headings need no turning, and to look costs half as much as to turn
    with np.errstate(invalid="ignore", over="ignore"):
        # Counting whole turns runs ten times faster than np.mod; rounding may end at, or a hair past, ±π.
        wrapped = angle - 2 * np.pi * np.ceil(angle / (2 * np.pi) - 0.5)
        if wrapped.size and not (wrapped.min() > -np.pi and wrapped.max() <= np.pi):
            wrapped = np.where(np.abs(wrapped) >= np.pi, np.pi, wrapped)
    return wrapped[()]


def rotation(angle: ArrayLike) -> Array:
    """The rotation matrices of angles: (...) radians → (..., 2, 2)."""
    angle = as_numbers(angle, "angle")
    with np.errstate(invalid="ignore", over="ignore"):
        c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


def compose(a: ArrayLike, b: ArrayLike) -> Array:
    """``T_world_b = compose(T_world_a, T_a_b)``: first b, seen from a; then a.  (..., 3) each, broadcasting.

    Raises ValueError when the last axis does not have length 3.

    >>> compose([1.0, 0.0, np.pi / 2], [2.0, 0.0, 0.0]).round(3)        # 2 m ahead of a robot that looks along +y
    array([1.   , 2.   , 1.571])
    """
    a, b = _poses(a, "a"), _poses(b, "b")
    _check_shapes(a.shape[:-1], b.shape[:-1])
    with np.errstate(invalid="ignore", over="ignore"):  # infinity gives NaN, as NaN does, and nobody is warned
        c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
        return np.stack(
            [
                a[..., 0] + c * b[..., 0] - s * b[..., 1],
                a[..., 1] + s * b[..., 0] + c * b[..., 1],
                wrap_angle(a[..., 2] + b[..., 2]),
            ],
            axis=-1,
        )


def inverse(a: ArrayLike) -> Array:
    """``T_a_world = inverse(T_world_a)``, (..., 3).  Raises as ``compose``.

    >>> compose(inverse([1.0, 2.0, 0.5]), [1.0, 2.0, 0.5]).round(9) + 0.0
    array([0., 0., 0.])
    """
    a = _poses(a, "a")
    with np.errstate(invalid="ignore", over="ignore"):
        c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
        return np.stack(
            [-c * a[..., 0] - s * a[..., 1], s * a[..., 0] - c * a[..., 1], wrap_angle(-a[..., 2])], axis=-1
        )


def between(a: ArrayLike, b: ArrayLike) -> Array:
    """``T_a_b = between(T_world_a, T_world_b)``: where b stands, as a sees it.  (..., 3) each, broadcasting.

    Raises as ``compose``.

    >>> between([1.0, 0.0, np.pi / 2], [1.0, 2.0, np.pi / 2]).round(3) + 0.0        # two metres ahead
    array([2., 0., 0.])
    """
    return compose(inverse(a), b)


def transform(pose: ArrayLike, points: ArrayLike) -> Array:
    """Points given in the pose's frame, in its parent's frame: (..., 3) and (..., 2) → (..., 2).

    One pose takes a whole ``(n, 2)`` cloud.  For many poses at once give the points an axis to broadcast
    over: poses ``(m, 1, 3)`` with points ``(n, 2)`` give ``(m, n, 2)``.

    Raises ValueError when a last axis does not have length 3, or 2.

    >>> transform([1.0, 0.0, np.pi / 2], [[2.0, 0.0], [0.0, 1.0]]).round(3) + 0.0
    array([[1., 2.],
           [0., 0.]])
    """
    pose, points = _poses(pose, "pose"), as_numbers(points, "points")
    if points.ndim == 0 or points.shape[-1] != 2:
        raise ValueError(f"points: expected shape (..., 2), got {points.shape}")
    _check_shapes(pose.shape[:-1], points.shape[:-1])
    x, y = points[..., 0], points[..., 1]
    with np.errstate(invalid="ignore", over="ignore"):
        c, s = np.cos(pose[..., 2]), np.sin(pose[..., 2])
        return np.stack([pose[..., 0] + c * x - s * y, pose[..., 1] + s * x + c * y], axis=-1)


def so3_exp(rotation_vector: ArrayLike) -> Array:
    """Rotation matrix of a rotation vector (axis times angle, radians): (3,) → (3, 3).  Rodrigues' formula."""
    w = as_numbers(rotation_vector, "rotation_vector")
    if w.shape != (3,) or not np.all(np.abs(w) < LARGEST):
        raise ValueError(f"rotation_vector: expected three finite numbers, got {rotation_vector!r}")
    angle = float(np.linalg.norm(w))
    W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
    # sinc keeps both factors exact at angle zero.
    a, b = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + a * W + b * W @ W


def so3_log(R: ArrayLike) -> Array:
    """Rotation vector of a rotation matrix, with angle in [0, π]: (3, 3) → (3,).  Inverse of ``so3_exp``."""
    from scipy.spatial.transform import Rotation

    R = as_numbers(R, "R")
    if R.shape != (3, 3) or not is_rotation(R):
        raise ValueError(f"R: expected a (3, 3) rotation matrix, got {R!r}")
    return np.asarray(Rotation.from_matrix(R).as_rotvec(), dtype=float)


def is_rotation(R: ArrayLike, tolerance: float = 1e-6) -> bool:
    """True when R is square, orthonormal within ``tolerance`` and not a reflection."""
    R, tolerance = as_numbers(R, "R"), number(tolerance, "tolerance")
    if not 0 <= tolerance < np.inf:
        raise ValueError(f"tolerance: expected a finite number ≥ 0, got {tolerance}")
    if R.ndim != 2 or R.shape[0] != R.shape[1] or not R.size or not np.all(np.abs(R) < 2):
        return False
    return bool(np.allclose(R @ R.T, np.eye(len(R)), rtol=0, atol=tolerance) and np.linalg.det(R) > 0)


def homogeneous(pose: ArrayLike) -> Array:
    """The (3, 3) homogeneous matrix of a planar pose (3,)."""
    pose = _poses(pose, "pose")
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"pose: expected one pose [x, y, θ], finite, got {pose} of shape {pose.shape}")
    T = np.eye(3)
    T[:2, :2], T[:2, 2] = rotation(pose[2]), pose[:2]
    return T


def _poses(pose: ArrayLike, name: str) -> Array:
    if type(pose) is not np.ndarray or pose.dtype is not _FLOAT:
        pose = as_numbers(pose, name)
    if pose.ndim == 0 or pose.shape[-1] != 3:
        raise ValueError(f"{name}: expected poses [x, y, θ] of shape (..., 3), got {pose.shape}")
    return pose


def _check_shapes(a: tuple[int, ...], b: tuple[int, ...]) -> None:
    if a and b and a != b:
        try:
            np.broadcast_shapes(a, b)
        except ValueError:
            raise ValueError(f"expected numbers of poses that go together, got shapes {a} and {b}") from None
