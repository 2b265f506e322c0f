r"""Closing a loop: poses that are tied together by what was measured between them.

Each edge says where pose j stood as seen from pose i, with a covariance.  A chain of edges fits any track exactly;
one more edge, from the end of a loop to its beginning, contradicts it.  ``relax`` finds the poses that satisfy all
edges best, each according to how sure it was: the loop's error is spread over the whole way.

Source: Lu & Milios (1997); Grisetti, Kümmerle, Stachniss & Burgard (2010).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from coursekit.gaussian import check_covariance
from coursekit.geometry import Array, rotation, wrap_angle


@dataclass(frozen=True)
class Edge:
    """T_i_j was measured as ``pose`` [x, y, θ], with the covariance ``cov`` (3, 3) of these three numbers."""

    i: int
    j: int
    pose: Array
    cov: Array

    def __post_init__(self) -> None:
        pose = np.array(self.pose, dtype=float)
        if pose.shape != (3,) or not np.all(np.isfinite(pose)):
            raise ValueError(f"pose: expected a finite [x, y, θ], got {self.pose!r}")
        object.__setattr__(self, "pose", pose)
        object.__setattr__(self, "cov", check_covariance(self.cov, size=3))


def residuals(a: ArrayLike, b: ArrayLike, measured: ArrayLike) -> tuple[Array, Array, Array]:
    """How far T_a_b is from what was measured, with ∂/∂a and ∂/∂b: poses (..., 3) → (..., 3), (..., 3, 3) twice."""
    a, b, measured = (np.asarray(pose, dtype=float) for pose in (a, b, measured))
    R_world_a = rotation(a[..., 2])
    R_a_world = np.swapaxes(R_world_a, -1, -2)
    place = (R_a_world @ (b - a)[..., :2, None])[..., 0]
    turn = wrap_angle(b[..., 2] - a[..., 2] - measured[..., 2])
    A, B = np.zeros((*a.shape, 3)), np.zeros((*a.shape, 3))
    A[..., :2, :2], B[..., :2, :2] = -R_a_world, R_a_world
    A[..., 0, 2], A[..., 1, 2] = place[..., 1], -place[..., 0]
    A[..., 2, 2], B[..., 2, 2] = -1.0, 1.0
    return np.concatenate([place - measured[..., :2], turn[..., None]], axis=-1), A, B


def relax(poses: ArrayLike, edges: Sequence[Edge], iterations: int = 30) -> Array:
    """The poses (n, 3) that minimise Σ rᵀ cov⁻¹ r over the edges, by Gauss-Newton from ``poses``; the first stays.

    Raises ValueError for bad poses, an edge that names a pose that is not there, and a pose that hangs on no edge.
    """
    poses = np.array(poses, dtype=float)
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.all(np.isfinite(poses)):
        raise ValueError(f"poses: expected finite poses of shape (n, 3), got shape {poses.shape}:\n{poses}")
    n = len(poses)
    if not edges or any(not (0 <= e.i < n and 0 <= e.j < n and e.i != e.j) for e in edges):
        raise ValueError(f"edges: expected one or more, each between two different poses of 0 … {n - 1}")
    i, j = np.array([(e.i, e.j) for e in edges]).T
    measured = np.array([e.pose for e in edges])
    roots = np.linalg.cholesky(np.array([e.cov for e in edges]))
    places = np.concatenate([3 * i[:, None] + np.arange(3), 3 * j[:, None] + np.arange(3)], axis=1)
    rows, columns = np.broadcast_arrays(places[:, :, None], places[:, None, :])
    for _ in range(iterations):
        r, A, B = residuals(poses[i], poses[j], measured)
        white = np.linalg.solve(roots, np.concatenate([A, B, r[..., None]], axis=-1))
        J, r = white[..., :6], white[..., 6:]
        # H's pattern is the graph: a block where an edge is, nothing elsewhere.
        H = coo_array(((np.swapaxes(J, -1, -2) @ J).ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, 3 * n))
        g = np.zeros(3 * n)
        np.add.at(g, places, (np.swapaxes(J, -1, -2) @ r)[..., 0])
        try:
            step = splu(H.tocsc()[3:, 3:]).solve(-g[3:]).reshape(-1, 3)
        except RuntimeError:
            raise ValueError("edges: expected a chain of edges from the first pose to every other") from None
        poses[1:] += step
        poses[:, 2] = wrap_angle(poses[:, 2])
        if np.abs(step).max() < 1e-9:
            break
    return poses
