"""What comes in at the door: clouds, pairs and rigid motions, or an error that says what is wrong with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.geometry import Array, is_rotation


def check_shape(points: ArrayLike, name: str, dimension: int | None = None) -> Array:
    """The points as a contiguous array (n, 2) or (n, 3), or (n, dimension)."""
    points = np.ascontiguousarray(as_numbers(points, name))
    allowed = (2, 3) if dimension is None else (dimension,)
    if points.ndim != 2 or points.shape[1] not in allowed:
        expected = " or ".join(f"(n, {d})" for d in allowed)
        raise ValueError(f"{name}: expected points of shape {expected}, got {points.shape}")
    return points


def check_cloud(points: ArrayLike, name: str, dimension: int | None = None, at_least: int | None = None) -> Array:
    """Points as in ``check_shape``, finite, and enough of them: as many as dimensions unless told otherwise."""
    points = check_shape(points, name, dimension)
    if not np.all(np.abs(points) < LARGEST):
        bad = np.flatnonzero(~(np.abs(points) < LARGEST).all(axis=1))
        raise ValueError(
            f"{name}: expected finite coordinates, got {points[bad[0]]} in row {bad[0]} ({len(bad)} such rows)"
        )
    if len(points) < (at_least or points.shape[1]):
        raise ValueError(f"{name}: expected at least {at_least or points.shape[1]} points, got {len(points)}")
    return points


def check_pairs(p: ArrayLike, q: ArrayLike, weights: ArrayLike | None = None) -> tuple[Array, Array, Array]:
    """Matched points (n, d), and weights that sum to one or to zero."""
    p = check_cloud(p, "p", at_least=1)
    q = check_cloud(q, "q", p.shape[1], at_least=1)
    if len(p) != len(q):
        raise ValueError(f"expected one partner for each point, got p {p.shape} and q {q.shape}")
    if weights is None:
        return p, q, np.full(len(p), 1 / len(p))
    weights = as_numbers(weights, "weights")
    if weights.shape != (len(p),) or not np.all((weights >= 0) & (weights < LARGEST)):
        raise ValueError(f"weights: expected {len(p)} finite numbers ≥ 0, got shape {weights.shape}:\n{weights}")
    total = weights.sum()
    return p, q, weights / total if total > 0 else weights


def check_motion(T: ArrayLike, d: int, name: str = "T") -> Array:
    """A homogeneous rigid motion (d+1, d+1)."""
    T = as_numbers(T, name)
    if T.shape != (d + 1, d + 1):
        hint = "; geometry.homogeneous makes one of a pose" if T.shape == (3,) else ""
        raise ValueError(f"{name}: expected a homogeneous matrix of shape {(d + 1, d + 1)}, got {T.shape}{hint}")
    if not np.all(np.abs(T) < LARGEST) or not np.array_equal(T[-1], np.eye(d + 1)[-1]) or not is_rotation(T[:d, :d]):
        raise ValueError(f"{name}: expected a rotation and a translation over a row [0 … 0 1], got\n{T}")
    return T


def check_normals(normals: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Vectors of this shape, as unit vectors."""
    normals = as_numbers(normals, "normals")
    if normals.shape != shape or not np.all(np.abs(normals) < LARGEST):
        raise ValueError(f"normals: expected finite vectors of shape {shape}, got {normals.shape}")
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    if np.any(length <= 1 / LARGEST):
        raise ValueError(f"normals: expected finite vectors of shape {shape}, none of them zero, got one that is")
    return normals / length
