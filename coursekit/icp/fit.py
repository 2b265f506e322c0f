r"""The closed forms: the motion that takes matched points onto their partners, given the matches.

``point_to_point`` minimises Σ w |q - (R p + t)|² exactly, through a singular value decomposition.
``point_to_plane`` minimises Σ w (n·(q - (R p + t)))² for a small motion, through one linear system.

Source: Arun, Huang & Blostein (1987); Umeyama (1991) for the reflection case; Chen & Medioni (1992) for planes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.geometry import Array, rotation, so3_exp
from coursekit.icp.checks import check_motion, check_normals, check_pairs, check_shape


class DegenerateGeometry(Exception):
    """These pairs leave the motion open: more than one rotation fits them equally well."""


def point_to_point(p: ArrayLike, q: ArrayLike, weights: ArrayLike | None = None) -> Array:
    r"""The rigid motion that minimises Σ wᵢ |qᵢ - (R pᵢ + t)|², as a homogeneous matrix (d+1, d+1).

    With H = Σ w (q - q̄)(p - p̄)ᵀ = U S Vᵀ, the rotation is R = U diag(1, …, ±1) Vᵀ and t = q̄ - R p̄.  The last sign
    is det(U Vᵀ): without it the best orthogonal matrix may be a mirror.

    Parameters
    ----------
    p, q : (n, d) matched points, d = 2 or 3, metres; the answer takes p's frame to q's.
    weights : (n,) ≥ 0, or None for all equal.

    Raises DegenerateGeometry when all weights are zero, and when the best rotation is not unique: in 3-D when the
    pairs lie on a line, in any dimension when they lie on one point or when the two best rotations are equally good.
    Raises ValueError or TypeError for points that are no finite (n, d) arrays of one shape, or weights below zero.

    Source: Arun, Huang & Blostein (1987); Umeyama (1991) for the sign.

    >>> point_to_point([[0, 0], [2, 0], [0, 1]], [[5, 1], [5, 3], [4, 1]]).round(3) + 0.0   # a quarter turn left
    array([[ 0., -1.,  5.],
           [ 1.,  0.,  1.],
           [ 0.,  0.,  1.]])
    """
    p, q, w = _pairs(p, q, weights)
    p_mean, q_mean = w @ p, w @ q
    H, spread_p, spread_q = np.zeros((p.shape[1], p.shape[1])), 0.0, 0.0
    for rows in _blocks(len(p)):
        a, b = p[rows] - p_mean, q[rows] - q_mean
        H += (w[rows, None] * b).T @ a
        spread_p, spread_q = spread_p + np.einsum("ij,ij->", a, a), spread_q + np.einsum("ij,ij->", b, b)
    U, S, Vt = np.linalg.svd(H)
    handed = 1.0 if np.linalg.det(U @ Vt) > 0 else -1.0
    # To turn the two weakest axes together costs S[-2] ± S[-1]; if that is nothing, one turn is as good as another.
    offset = max(np.abs(p_mean).max() * np.sqrt(spread_q), np.abs(q_mean).max() * np.sqrt(spread_p))
    rounding = 1e-14 * offset / np.sqrt(len(p))
    if S[-2] + handed * S[-1] <= 1e-9 * S[0] + rounding:
        raise DegenerateGeometry(
            "the matched pairs do not determine the rotation: they lie on a line or a point, or are too symmetric"
        )
    U[:, -1] *= handed
    return rigid(U @ Vt, q_mean - U @ Vt @ p_mean)


def point_to_plane(p: ArrayLike, q: ArrayLike, normals: ArrayLike, weights: ArrayLike | None = None) -> Array:
    r"""One Gauss-Newton step for Σ wᵢ (nᵢ·(qᵢ - (R pᵢ + t)))², as a homogeneous matrix (d+1, d+1).

    For a small turn φ about the cloud's centre c, R p + t ≈ p + u + φ × (p - c): linear in (u, φ).  A direction in
    which no normal points (along a corridor) is left where it is by a little damping, 1/1000 of what evenly
    spread normals would say; the damping slows such a direction down, and moves no solution.

    Parameters
    ----------
    p, q : (n, d) matched points, d = 2 or 3, metres.     normals : (n, d) of the surface at q.
    weights : (n,) ≥ 0, or None for all equal.

    Raises DegenerateGeometry when all weights are zero or all of p is one point; ValueError or TypeError for points
    and normals that are no finite (n, d) arrays of one shape.

    Source: Chen & Medioni (1992).

    >>> wall = np.array([[2.0, -1], [2, 0], [2, 1]])
    >>> point_to_plane(wall - [0.1, 0], wall, [[1, 0]] * 3)[:2, 2].round(3)     # 0.1 m towards the wall
    array([0.1, 0. ])
    """
    p, q, w = _pairs(p, q, weights)
    normals = check_normals(normals, p.shape)
    centre = w @ p
    J = np.hstack([normals, turning(p - centre, normals)])
    size = np.sqrt((w @ (p - centre) ** 2).sum())  # metres, the arm of a turn
    if size <= 1e-14 * np.abs(centre).max():
        raise DegenerateGeometry("the matched pairs do not determine the rotation: the source's points are one point")
    d = p.shape[1]
    even = np.diag([1.0] * d + [size**2] * (J.shape[1] - d)) / d
    residual = ((q - p) * normals).sum(axis=1)
    step = np.linalg.solve(J.T @ (w[:, None] * J) + 1e-3 * even, J.T @ (w * residual))
    R = rotation(step[2]) if d == 2 else so3_exp(step[3:])
    return rigid(R, centre + step[:d] - R @ centre)


def turning(arm: Array, direction: Array) -> Array:
    """How fast a turn carries a point along ``direction``: n·(φ × r) = φ·(r × n).  (n, d) → (n, 1) or (n, 3)."""
    if arm.shape[1] == 2:
        return (arm[:, 0] * direction[:, 1] - arm[:, 1] * direction[:, 0])[:, None]
    return np.cross(arm, direction)


def turning_matrix(arm: Array) -> Array:
    """-φ × r as a matrix times φ: what a turn does to the place of the point that it does not turn about."""
    if arm.size == 2:
        return np.array([[arm[1]], [-arm[0]]])
    return np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])


def rigid(R: Array, t: Array) -> Array:
    """[[R, t], [0, 1]]."""
    T = np.eye(len(t) + 1)
    T[:-1, :-1], T[:-1, -1] = R, t
    return T


def move(T: ArrayLike, points: ArrayLike) -> Array:
    """Points (n, d), metres, through a homogeneous matrix (d+1, d+1): rows R p + t.

    Raises ValueError for shapes that do not fit each other, TypeError for what is no array of numbers.

    >>> from coursekit.geometry import homogeneous
    >>> move(homogeneous([1, 0, np.pi / 2]), [[2, 0]]).round(3)
    array([[1., 2.]])
    """
    points, T = check_shape(points, "points"), as_numbers(T, "T")
    if T.shape != (points.shape[1] + 1,) * 2:
        T = check_motion(T, points.shape[1])
    for name, array in (("points", points), ("T", T)):
        if array.size and not (array.min() > -LARGEST and array.max() < LARGEST):
            raise ValueError(f"{name}: expected finite numbers, got some that are not")
    R = np.ascontiguousarray(T[:-1, :-1].T)
    moved = np.empty_like(points)
    for rows in _blocks(len(points)):
        np.matmul(points[rows], R, out=moved[rows])
    moved += T[:-1, -1]
    return moved


def _pairs(p: ArrayLike, q: ArrayLike, weights: ArrayLike | None) -> tuple[Array, Array, Array]:
    p, q, w = check_pairs(p, q, weights)
    if not w.any():
        raise DegenerateGeometry("no pair has any weight: kernel_scale is far smaller than the distances")
    return p, q, w


def _blocks(n: int) -> list[slice]:
    """Rows by the thousand: so many fit the cache, and for more of them BLAS starts threads that only wait."""
    return [slice(start, start + 8192) for start in range(0, n, 8192)]


# Weights of the robust kernels at the residual u = r/scale.  The constants give 95 % efficiency on Gaussian noise.
KERNELS: dict[str, Callable[[Array], Array]] = {
    "huber": lambda u: 1 / np.maximum(1, u / 1.345),
    "cauchy": lambda u: 1 / (1 + (u / 2.385) ** 2),
    "tukey": lambda u: np.maximum(0, 1 - (u / 4.685) ** 2) ** 2,
}
