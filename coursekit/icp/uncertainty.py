r"""How well the matched surfaces hold the answer: its covariance, and the directions in which nothing holds it.

A laser never hits the same point of a wall twice.  A pair of points says how far the wall is, along its normal n, and
nothing about where along the wall.  With r the arm from the cloud's centre and (u, φ) a small shift and turn, each
pair adds J Jᵀ / σ² to the information, J = (n, r × n).  Its inverse is the covariance of point-to-plane.

Point-to-point also listens to the pairs' offsets *along* the wall, which are nothing but where the samples happen to
lie.  They do not hold the answer (the pairs are made anew in each iteration), but they push it about: with J_t the
same for the tangents, σ_t the offsets' spread and C the covariance above, they add C (Σ J_t J_tᵀ σ_t²/σ⁴) C.

Where this is still too sure: noise that neighbours share (a bent mirror, a robot that moved during the scan), corners
that the normals cut, pairs in the wrong basin; above all, point-to-point stops short, held between two samples, at a
place that depends on the start.  Lab 6 measures how much.  Taking the pairs for granted instead, and every
coordinate of theirs for a measurement, as least squares would, claims to know the place along a bare corridor.

Source: Censi (2007); Gelfand, Ikemoto, Rusinkiewicz & Levoy (2003) for what slides.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.spatial import cKDTree

from coursekit.gaussian import symmetrize
from coursekit.geometry import Array
from coursekit.icp.acceleration import spread_out
from coursekit.icp.fit import move, turning, turning_matrix
from coursekit.icp.surface import NEIGHBOURS, pieces

THIN = 1e-3  # a small cloud lies on a line or a plane when its variance across is below this share of its largest
SAMPLE = 200  # so many pairs tell the shape of the information; the rest only scale it


def uncertainty(
    T: Array,
    source: Array,
    target: Array,
    matches: np.ndarray,
    *,
    metric: str = "point_to_point",
    normals: Array | None = None,
    tree: cKDTree | None = None,
) -> tuple[Array, list[str]]:
    """Covariance of T_target_source, and in words the motions that the pairs leave free.

    The covariance is that of [x, y, θ] in 2-D, (3, 3); of [x, y, z, φ] in 3-D, (6, 6), where φ is the rotation
    vector of a further turn in the target's axes, R = exp(φ) R̂.  A free motion gets the cloud's own size (or one
    radian) as its standard deviation.
    """
    d = source.shape[1]
    i, j = matches[spread_out(len(matches), SAMPLE)].T
    p, q = move(T, source[i]), target[j]
    centre = q.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((p - centre) ** 2, axis=1))))
    if size == 0:  # all in one point: what a turn does cannot even be measured
        return np.eye(3 if d == 2 else 6), ["slides and turns every way"]
    piece = pieces(target, q, tree)

    # J is in metres: a turn counts by what it does at the arm `size`.
    if piece.is_surface and len(target) >= 3 * NEIGHBOURS[d]:  # each flat piece speaks along its normal
        flat, axes = piece.flat, piece.axes[piece.flat]
        arms, count = piece.centres[flat] - centre, len(matches) * flat.mean()
        info = _information(arms, axes[:, :, 0], size)
        # Among many noisy points some lie nearer than the surface does: then measure to the middle of the piece.
        surface = piece.centres if piece.points > NEIGHBOURS[d] else q
        variance = _spread((surface - p)[flat], axes[:, :, 0])
        # Noise tilts a normal towards each tangent, and a tilted normal seems to say something.
        tilts = [piece.variances[flat, 0] / piece.variances[flat, a] / (piece.points - d + 1) for a in range(1, d)]
        tangents = [axes[:, :, a] for a in range(1, d)]
        doubt = np.sum([_information(arms, np.sqrt(v)[:, None] * t, size) for v, t in zip(tilts, tangents)], axis=0)
        push = np.sum([_information(arms, t, size) * _spread((q - p)[flat], t) for t in tangents], axis=0)
    else:  # too few points for a surface, or too scattered
        if metric == "point_to_plane":  # nothing but the normals was listened to
            ways = [piece.normals if normals is None else normals[j]]
        else:
            ways = [np.tile(axis, (len(q), 1)) for axis in _directions(target, q - p)]
        info, count = np.sum([_information(q - centre, way, size) for way in ways], axis=0), float(len(matches))
        variance = float(np.mean([_spread(q - p, way) for way in ways]))
        doubt = push = np.zeros_like(info)
    doubt = 3 * doubt + 1e-4 * np.eye(len(info))
    strength, modes = eigh(info, doubt)  # information in units of doubt
    held = strength > 1
    basis = doubt @ modes[:, held]
    info = basis * strength[held] @ basis.T

    repeats = np.bincount(matches[:, 1])
    count /= 0.5 * (1 + np.sum(repeats**2) / len(matches))  # pairs on one target point share its noise
    variance += (1e-6 * size) ** 2
    precision, axes = np.linalg.eigh(info * count / variance)
    cov = axes / (np.maximum(precision, 0.0) + 1 / size**2) @ axes.T
    if metric == "point_to_point":
        firm = axes[:, precision > 1 / size**2]  # what is free is as wide as it gets, pushed or not
        gain = cov @ firm @ firm.T
        cov = cov + gain @ push @ gain.T * count / variance**2
    # From a turn about the cloud's centre, in metres, to a turn about the source's origin, in radians.
    change = np.diag([1.0] * d + [1 / size] * (len(cov) - d))
    change[:d, d:] = turning_matrix(centre - T[:-1, -1]) / size
    return symmetrize(change @ cov @ change.T), [_describe(mode, d) for mode in modes.T[~held]]


def _directions(target: Array, offsets: Array) -> Array:
    """In which directions, (k, d), scattered points speak: each is a landmark, and speaks in all of them.

    Unless they lie on one line or plane, and the pairs are no closer than the points: then who belongs to whom is
    anybody's guess, and only the directions across are left.
    """
    spread, axes = np.linalg.eigh(np.atleast_2d(np.cov(target.T)))
    thin = spread <= THIN * spread[-1]
    gap = np.median(cKDTree(target).query(target, k=2)[0][:, 1])
    own = np.sqrt(np.mean(np.sum(offsets**2, axis=1))) <= gap / 4
    return np.eye(target.shape[1]) if own or not thin.any() else axes.T[thin]


def _spread(offsets: Array, directions: Array) -> float:
    """Mean squared offset along the directions."""
    return float(np.mean(np.sum(offsets * directions, axis=1) ** 2))


def _information(arms: Array, directions: Array, size: float) -> Array:
    """Mean of J Jᵀ with J = (n, r × n / size)."""
    J = np.hstack([directions, turning(arms, directions) / size])
    return J.T @ J / len(J)


def _describe(mode: Array, d: int) -> str:
    shift, turn = mode[:d], mode[d:]
    kind, axis = ("slides along", shift) if np.linalg.norm(shift) >= np.linalg.norm(turn) else ("turns about", turn)
    if axis.size == 1:
        return "turns"
    return f"{kind} ({', '.join(f'{x:.2f}' for x in axis / np.linalg.norm(axis))})"
