r"""What the source's points measure at the answer: distances to the target's surfaces, or to its landmarks.

A distance depends on more than one noisy point.  The surface below a source point is a fit to k points of the target,
so its height there is Σ aⱼ qⱼ, with weights a from least squares; a neighbour's height uses some of the same points.
So with the noise σ of one point the distances have the covariance σ² (I + A Aᵀ), A with a row of weights for each.

Source: Censi (2007), for the covariance from how the answer depends on every point; Fan & Gijbels (1996), chapter 3,
for local polynomials and their weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from coursekit.geometry import Array
from coursekit.icp.fit import turning
from coursekit.icp.matching import tie
from coursekit.icp.surface import Pieces

THIN = 1e-3  # a small cloud lies on a line or a plane when its variance across is below this share of its largest


@dataclass(frozen=True)
class Residuals:
    """m distances, linearised in a small motion (shift, turn × size) about the centre, k numbers in metres.

    J : (m, k), the derivative of each distance by the motion.     values : (m,), the distances, metres.
    places : (m, d), where they were measured, in units of the cloud's size from its centre.
    shared : (m, t) sparse, the weight of each target point in each distance, A above.
    tilt : (k, k), the mean information that noise alone makes up, by tilting normals.
    """

    J: Array
    values: Array
    places: Array
    shared: Any
    tilt: Array

    def only(self, rows: np.ndarray) -> Residuals:
        """Those of some rows, by mask."""
        return Residuals(self.J[rows], self.values[rows], self.places[rows], self.shared[rows], self.tilt)

    @property
    def weight(self) -> Array:
        """Variance of each distance in units of σ², (m,)."""
        return np.asarray(1 + (self.shared**2).sum(axis=1))


@dataclass(frozen=True)
class Heights:
    """How far some points p lie from the bent line, or sheet, through their pieces: a polynomial of degree two.

    rows : of p, those that lie over a flat piece; beside it the polynomial only guesses.
    weights : (m, k), of the piece's points in each height.     values : (m,), the heights along the normals, metres.
    noise : of the cloud's own points about their pieces, metres; its median, which corners do not spoil.
    """

    rows: np.ndarray
    weights: Array
    values: Array
    noise: float


def heights(p: Array, piece: Pieces, cloud: Array) -> Heights:
    """Least squares of degree two in each piece of ``cloud``, taken at the foot of p, (n, d)."""
    d, k, flat = p.shape[1], piece.points, np.flatnonzero(piece.flat)
    apart = np.einsum("nkd,nda->nka", cloud[piece.index[flat]] - p[flat, None], piece.axes[flat])
    scale = np.sqrt(piece.variances[flat, -1])[:, None, None]
    u, height = apart[..., 1:] / scale, apart[..., 0]  # along the piece, and across it
    bent = [u[..., a] * u[..., b] for a in range(d - 1) for b in range(a, d - 1)]
    X = np.concatenate([np.ones_like(height)[..., None], u, np.stack(bent, axis=-1)], axis=-1)
    Xt = np.swapaxes(X, 1, 2)
    fit = np.linalg.solve(Xt @ X + 1e-9 * k * np.eye(X.shape[2]), Xt)
    left = height - (X @ (fit @ height[..., None]))[..., 0]
    noise = float(np.sqrt(np.median(np.sum(left**2, axis=1)) / max(k - X.shape[2], 1))) if len(flat) else 0.0
    weights = fit[:, 0]
    inside = np.sum(weights**2, axis=1) <= 1.0  # no more noise than a single point has
    return Heights(flat[inside], weights[inside], np.sum(weights * height, axis=1)[inside], noise)


def to_surfaces(p: Array, piece: Pieces, cloud: Array, centre: Array, size: float) -> Residuals:
    """Distances from ``p`` to the surfaces of its pieces, where there are any."""
    d, k, found = p.shape[1], piece.points, heights(p, piece, cloud)
    arms, axes, variances = p[found.rows] - centre, piece.axes[found.rows], piece.variances[found.rows]
    places = (found.weights.ravel(), piece.index[found.rows].ravel(), np.arange(0, found.weights.size + 1, k))
    # Noise tilts a normal towards each tangent, and a tilted normal looks like information along the wall.
    tilt: Array = np.zeros((d * (d + 1) // 2,) * 2)
    for a in range(1, d):
        share = np.sqrt(variances[:, 0] / np.maximum(variances[:, a], np.finfo(float).tiny) / (k - d + 1))
        tilt += _information(arms, share[:, None] * axes[:, :, a], size)
    shared = csr_array(places, shape=(len(arms), len(cloud)))
    return Residuals(rows(arms, axes[:, :, 0], size), found.values, arms / size, shared, tilt)


def to_landmarks(
    p: Array, q: Array, partner: np.ndarray, directions: list[Array], centre: Array, size: float
) -> Residuals:
    """Distances of pairs p → q, (m, d), in each of some directions (m, d); ``partner`` names the points q, (m,)."""
    m, n = len(q), len(directions)
    J = np.vstack([rows(q - centre, way, size) for way in directions])
    values = np.concatenate([np.sum((q - p) * way, axis=1) for way in directions])
    _, column = np.unique(partner, return_inverse=True)
    columns = np.concatenate([column + a * m for a in range(n)])  # what two directions say of one point is independent
    shared = csr_array((np.ones(m * n), columns, np.arange(m * n + 1)), shape=(m * n, m * n))
    return Residuals(J, values, np.tile((q - centre) / size, (n, 1)), shared, np.zeros((J.shape[1],) * 2))


def landmark_directions(target: Array, offsets: Array) -> Array:
    """The directions (k, d) that scattered points measure: all of them, since each point is a landmark.

    If the points lie on one line or plane and the pairs are no closer than the points, the pairing is arbitrary, and
    only the directions across are left.
    """
    spread, axes = np.linalg.eigh(np.atleast_2d(np.cov(target.T)))
    thin = spread <= max(THIN * spread[-1], tie(target) ** 2)
    gap = np.median(cKDTree(target).query(target, k=2)[0][:, 1])
    own = np.sqrt(np.mean(np.sum(offsets**2, axis=1))) <= max(gap / 4, tie(target))
    return np.eye(target.shape[1]) if own or not thin.any() else axes.T[thin]


def rows(arms: Array, directions: Array, size: float) -> Array:
    """J = (n, r × n / size)."""
    return np.hstack([directions, turning(arms, directions) / size])


def _information(arms: Array, directions: Array, size: float) -> Array:
    """Mean of Jᵀ J."""
    J = rows(arms, directions, size)
    return J.T @ J / len(J)
