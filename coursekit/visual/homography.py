r"""Homographies: how a flat map looks to a camera that is tilted, fitted to pairs with heavy-tailed residuals.

A camera that looks straight down shows a similarity, 4 parameters; a tilted one, a homography, 8.  Fitted to a tilted
picture, a similarity is wrong by many of its own standard deviations: a tilt of ten degrees moves it by pixels.

Source: Hartley & Zisserman (2004), section 4; Lange, Little & Taylor (1989) for the t-distributed residuals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array
from coursekit.visual.similarity import FREEDOM, scale_of


def fit_homography(start: Array, centre: Array, source: Array, target: Array) -> tuple[Array, Array, Array]:
    r"""The homography of target = H source, under t-distributed residuals, and the pose that it gives its centre.

    Gauss-Newton on u' = (a u + b v + x)/(1 + p u + q v), v' = (c u + d v + y)/(1 + p u + q v), with (u, v) counted from
    ``centre``, weighted as in ``fit_similarity``.

    start : (3, 3), roughly the answer.     centre : (2,) the picture's centre.     source, target : (n, 2), n > 4.

    Returns H (3, 3), the pose [x, y, yaw, scale] (4,) and its covariance (4, 4).
    """
    n, length = len(source), float(np.sqrt(np.mean((source - centre) ** 2)))
    to_centre = np.array([[length, 0, centre[0]], [0, length, centre[1]], [0, 0, 1]])
    (u, v), H = (source - centre).T / length, start @ to_centre
    theta = (H / H[2, 2])[[0, 0, 1, 1, 0, 1, 2, 2], [0, 1, 0, 1, 2, 2, 0, 1]]  # a, b, c, d, x, y, p, q
    one, zero, w = np.ones(n), np.zeros(n), np.ones(n)
    for _ in range(10):
        a, b, c, d, x, y, p, q = theta
        D = 1 + p * u + q * v
        X, Y = (a * u + b * v + x) / D, (c * u + d * v + y) / D
        of_X = np.stack([u, v, zero, zero, one, zero, -X * u, -X * v], axis=-1)
        of_Y = np.stack([zero, zero, u, v, zero, one, -Y * u, -Y * v], axis=-1)
        A = np.stack([of_X, of_Y], axis=1) / D[:, None, None]
        residual = target - np.stack([X, Y], axis=-1)
        squared = np.sum(residual**2, axis=1)
        s2 = scale_of(squared)
        w = (FREEDOM + 2) / (FREEDOM + squared / s2)
        weighted = w[:, None, None] * A
        step = np.linalg.solve(np.einsum("nij,nik->jk", weighted, A), np.einsum("nij,ni->j", weighted, residual))
        theta = theta + step
        if np.abs(step).max() < 1e-9 * np.abs(theta).max():
            break
    information = np.einsum("nij,nik->jk", A, A)
    cov = s2 * (FREEDOM + 4) / (FREEDOM + 2) * n / (n - 4) * np.linalg.solve(information, np.eye(8))
    a, b, c, d, x, y, p, q = theta
    H = np.array([[a, b, x], [c, d, y], [p, q, 1]]) @ np.linalg.solve(to_centre, np.eye(3))
    pose, slopes = _pose(theta)
    pose[3] /= length
    slopes[3] /= length
    return H / H[2, 2], pose, slopes @ cov @ slopes.T


def _pose(theta: Array) -> tuple[Array, Array]:
    """[x, y, yaw, scale] at the origin, (4,), and its derivatives by the eight parameters, (4, 8).

    The homography stretches and turns a small neighbourhood by J.  Its rotation is the one nearest to J, which is the
    camera's heading whichever way it leans; its scale is the root of the area's.
    """
    a, b, c, d, x, y, p, q = theta
    e, f, g, h = a - x * p, b - x * q, c - y * p, d - y * q  # J = [[e, f], [g, h]]
    dJ = np.array([[1, 0, 0, 0, -p, 0, -x, 0], [0, 1, 0, 0, -q, 0, 0, -x],
                   [0, 0, 1, 0, 0, -p, -y, 0], [0, 0, 0, 1, 0, -q, 0, -y]])  # fmt: skip
    sine, cosine, scale = g - f, e + h, np.sqrt(e * h - f * g)
    of_yaw = np.array([-sine, -cosine, cosine, -sine]) / (sine**2 + cosine**2)
    of_scale = np.array([h, -g, -f, e]) / (2 * scale)
    shift = np.eye(8)[4:6]
    return np.array([x, y, np.arctan2(sine, cosine), scale]), np.vstack([shift, of_yaw @ dJ, of_scale @ dJ])


def project(homography: Array, points: Array) -> Array:
    """Points through a homography, (n, 2) → (n, 2)."""
    moved = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return moved[:, :2] / moved[:, 2:]


def jacobian(homography: Array, point: ArrayLike) -> Array:
    """How the homography stretches and turns a small neighbourhood of ``point``: (2, 2)."""
    moved = homography @ np.append(np.asarray(point, dtype=float), 1.0)
    return (homography[:2, :2] - np.outer(moved[:2] / moved[2], homography[2, :2])) / moved[2]
