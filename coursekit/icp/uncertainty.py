r"""How sure is the answer?  Its covariance, and the directions in which nothing holds it.

A laser never hits the same point of a wall twice.  A pair of points says how far the wall is, along its normal n, and
nothing about where along the wall.  So at the answer each source point is measured once more, against the line (in
3-D the sheet) of degree two that fits the target's points around its partner.  With r the arm from the cloud's centre,
a small shift and turn change this distance by J = (n, r × n); pairs beyond three sigma of the others are left out.

The distances are not independent: neighbours are measured against the same target points.  With A the weights of the
target's points in each surface (module ``residuals``), and σ the noise of one point, estimated from what is left,

    C = σ² (JᵀJ)⁻¹ Jᵀ (I + A Aᵀ) J (JᵀJ)⁻¹      the noise of both clouds: Censi's formula for this estimate,
    δ = (JᵀJ)⁻¹ Jᵀ distance                     how far the answer lies from what the surfaces say,
    P = C + s δ δᵀ                              the mean square of the answer's error, with its bias.

The bias is what the metric, the share kept and the kernel did to the answer: point-to-point is held back by the places
where the samples happen to lie, normals bend at a corner, trimming keeps the pairs that agree with the start.  Noise
moves δ as well, and adds C to the mean of δ δᵀ; James and Stein's share s = (1 - (k - 2)/δᵀC⁻¹δ)₊ takes it off again,
k = 3 in 2-D and 6 in 3-D.

Where neighbouring distances err alike beyond that (a bent mirror, a wrong range scale), sums over patches of the
surface vary more than I + A Aᵀ says, and C grows with them.  P is still too sure where the whole cloud shares its
error, where surfaces are sampled too sparsely for a piece to be of degree two, and where the pairs are in the wrong
basin: ``soundness`` looks for the last.

Least squares that takes every coordinate of every pair for a measurement claims to know the place along a bare
corridor: lab 6 shows these "frozen pairs".

Source: Censi (2007); James & Stein (1961), in its positive part; Liang & Zeger (1986) for patches; Gelfand, Ikemoto,
Rusinkiewicz & Levoy (2003) for what slides.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh
from scipy.spatial import cKDTree

from coursekit.gaussian import with_margin
from coursekit.geometry import Array
from coursekit.icp.acceleration import quasi_random_subset
from coursekit.icp.checks import check_cloud, check_motion
from coursekit.icp.fit import KERNELS, move, turning_matrix
from coursekit.icp.matching import distinct, tie
from coursekit.icp.residuals import Residuals, landmark_directions, to_landmarks, to_surfaces
from coursekit.icp.surface import pieces

SAMPLE = 400  # so many source points tell the shape of the information; the rest only scale it
CUT = 3.0  # pairs this many sigma from the surface are taken for wrong pairs
WITHIN = 0.9733  # the variance of a unit Gaussian within this cut


def uncertainty(
    T: Array,
    source: Array,
    target: Array,
    matches: np.ndarray,
    *,
    metric: str = "point_to_point",
    max_distance: float = np.inf,
    normals: Array | None = None,
    tree: cKDTree | None = None,
) -> tuple[Array, list[str]]:
    """Covariance of T_target_source, and in words the motions that the pairs leave free.

    The covariance is that of [x, y, θ] in 2-D, (3, 3); of [x, y, z, φ] in 3-D, (6, 6), where φ is the rotation
    vector of a further turn in the target's axes, R = exp(φ) R̂.  A free motion gets the cloud's own size (or one
    radian) as its standard deviation.  Positive definite with the margin of ``gaussian.with_margin``.

    Parameters
    ----------
    T : (d+1, d+1), the answer.     source, target : (n, d), (m, d), metres.     matches : (k, 2), the answer's pairs.
    metric, max_distance, normals : as for ``align``.     tree : of the target without copies, if there is one.

    Raises ValueError for clouds or a motion that ``align`` would not take, and for no pairs.

    Source: Censi (2007); James & Stein (1961); Liang & Zeger (1986).

    >>> wall = np.stack([np.linspace(-2, 2, 80), np.random.default_rng(0).normal(2, 0.01, 80)], axis=1)
    >>> pairs = np.stack([np.arange(80)] * 2, axis=1)
    >>> uncertainty(np.eye(3), wall + [0.02, 0], wall, pairs)[1]      # a straight wall, and nothing else
    ['slides along (1.00, 0.00)']
    """
    source, target = check_cloud(source, "source"), check_cloud(target, "target")
    T, matches = check_motion(T, source.shape[1]), np.asarray(matches)
    if matches.ndim != 2 or matches.shape[1] != 2 or len(matches) == 0:
        raise ValueError(f"matches: expected one or more pairs of indices, (k, 2), got shape {matches.shape}")
    d = source.shape[1]
    partners = target[matches[quasi_random_subset(len(matches), SAMPLE), 1]]
    centre = partners.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((partners - centre) ** 2, axis=1))))
    if size <= 2 * tie(target):  # all in one point: what a turn does cannot even be measured
        return np.eye(3 if d == 2 else 6), ["slides and turns every way"]
    surfaces, thinned = _surfaces(T, source, target, centre, size, max_distance, tree)
    if surfaces is not None:
        used, step = _robust_least_squares(surfaces)
        kept, fitted, within = surfaces.only(used), len(step), WITHIN
    else:  # too few points for a surface, or too scattered: the pairs themselves, and the answer is their motion
        kept, thinned = _landmarks(T, source, target, matches, centre, size, metric, normals)
        step, fitted, within = np.zeros(kept.J.shape[1]), 0, 1.0
    observable, free, info = _observable_subspace(kept.J.T @ kept.J / len(kept.J), kept.tilt)
    rows, left = kept.J @ observable, kept.values - kept.J @ step
    white = left / np.sqrt(kept.weight)
    variance = float(np.sum(white**2)) / max(len(left) - fitted, 1) / within + (1e-6 * size) ** 2
    every, sample = _spread(rows, info * len(rows), kept, thinned)
    variance *= _correlation(rows, left, kept.places, sample, float(np.mean(kept.weight)))
    certainty = float(observable.T @ step @ np.linalg.solve(variance * sample, observable.T @ step)) if len(info) else 0
    share = max(0.0, 1 - (len(kept.tilt) - 2) / certainty) if certainty > 0 else 0.0
    spread, own = np.linalg.eigh(variance * (every + share * (sample - every)))
    observable = observable @ own
    bias = np.sqrt(share) * observable @ (observable.T @ step)
    cov = observable * (spread / (1 + spread / size**2)) @ observable.T + np.outer(bias, bias) + size**2 * free @ free.T
    # From a turn about the cloud's centre, in metres, to a turn about the source's origin, in radians.
    change = np.diag([1.0] * d + [1 / size] * (len(cov) - d))
    change[:d, d:] = turning_matrix(centre - T[:-1, -1]) / size
    return with_margin(change @ cov @ change.T), [_describe(mode, d) for mode in _plainly(free)]


def _surfaces(
    T: Array, source: Array, target: Array, centre: Array, size: float, max_distance: float, tree: cKDTree | None
) -> tuple[Residuals | None, float]:
    """The distances of a sample of the source, and how many source points stand behind each of the sample."""
    tree = tree or cKDTree(target[distinct(target)])
    places = np.asarray(tree.data)
    chosen = quasi_random_subset(len(source), SAMPLE)
    p = move(T, source[chosen])
    reached, nearest = tree.query(p, distance_upper_bound=np.nextafter(max_distance, np.inf))
    p, nearest = p[np.isfinite(reached)], nearest[np.isfinite(reached)]
    piece = pieces(places, places[nearest], tree)
    if not piece.is_surface or len(places) < 3 * piece.points:
        return None, 1.0
    return to_surfaces(p, piece, places, centre, size), len(source) / len(chosen)


def _landmarks(
    T: Array, source: Array, target: Array, matches: np.ndarray, centre: Array, size: float, metric: str,
    normals: Array | None,
) -> tuple[Residuals, float]:  # fmt: skip
    """The pairs of a sample, in all directions; by point-to-plane only along its normals."""
    i, j = matches[quasi_random_subset(len(matches), SAMPLE)].T
    p, q = move(T, source[i]), target[j]
    if metric == "point_to_plane":
        directions = [pieces(target, q).normals if normals is None else normals[j]]
    else:
        directions = [np.tile(axis, (len(q), 1)) for axis in landmark_directions(target, q - p)]
    return to_landmarks(p, q, j, directions, centre, size), len(matches) / len(i)


def _spread(rows: Array, info: Array, kept: Residuals, thinned: float) -> tuple[Array, Array]:
    """(Σ JᵀJ)⁻¹ Jᵀ (I + A Aᵀ) J (Σ JᵀJ)⁻¹ of all points, and of the sample alone: covariances for σ = 1.

    In a sample two distances share target points less often than among all: thinned² instead of thinned.
    """
    inverse = np.linalg.solve(info, np.eye(len(info)))
    sums = (kept.shared.T @ rows) @ inverse
    together, alone = sums.T @ sums, inverse @ (rows.T * (kept.weight - 1)) @ rows @ inverse
    ratio = np.trace(alone) / max(np.trace(together), np.finfo(float).tiny)
    return inverse / thinned + together * (ratio / thinned + max(1 - ratio, 0.0)), inverse + together


def _robust_least_squares(residuals: Residuals) -> tuple[np.ndarray, Array]:
    """Which of the residuals count, and the motion that minimises these.

    Cauchy's weights come first: a far wall that alone determines a direction keeps its influence.  Then a cut at
    three sigma.
    """
    observable, *_ = _observable_subspace(residuals.J.T @ residuals.J / len(residuals.J), residuals.tilt)
    rows: Array = residuals.J @ observable
    left: Array = residuals.values
    x: Array = np.zeros(observable.shape[1])
    used: np.ndarray = np.full(len(left), True)
    sigmas, rounding = np.sqrt(residuals.weight), 1e-12 * float(np.abs(left).max()) + np.finfo(float).tiny
    for k in range(10):
        white = np.abs(left) / sigmas
        scale = max(1.4826 * float(np.median(white[used])), rounding)
        weights = KERNELS["cauchy"](white / scale) if k < 5 else (white <= CUT * scale).astype(float)
        used = np.asarray(weights > 0)
        weighted = weights[:, None] * rows
        x[:] = np.linalg.solve(rows.T @ weighted + 1e-9 * np.eye(len(x)), weighted.T @ residuals.values)
        left = residuals.values - rows @ x
    return used, observable @ x


def _correlation(rows: Array, left: Array, places: Array, sample: Array, weight: float) -> float:
    """How much wider the answer is than shared points explain, ≥ 1: more where neighbours err alike.

    Sums of J r over cells of half the cloud's size vary more than they should, if a whole wall shares its error.  Up
    to 1.5 × that may be chance.  Source: Liang & Zeger (1986), the sandwich with clusters.
    """
    _, cell = np.unique(np.floor(2 * places), axis=0, return_inverse=True)
    sums = np.zeros((cell.max() + 1, rows.shape[1]))
    np.add.at(sums, cell.ravel(), rows * left[:, None])
    independent = rows.T @ rows * np.mean(left**2)
    if len(sums) <= 2 * rows.shape[1] or np.linalg.matrix_rank(independent) < len(independent):
        return 1.0
    seen = np.trace(np.linalg.solve(independent, sums.T @ sums)) / rows.shape[1]
    seen *= len(sums) / (len(sums) - rows.shape[1])  # what the fit has taken away
    expected = np.trace(rows.T @ rows @ sample) / rows.shape[1] / weight
    return float(seen / expected) if seen > 1.5 * expected else 1.0


def _observable_subspace(info: Array, noise: Array) -> tuple[Array, Array, Array]:
    """Bases of the observable motions (k, a) and of the free ones (k, b), and the information on the observable.

    Observable is what has more information than tilted normals make up.  The two are kept apart, so that no rounding
    of the one is information on the other.
    """
    prior = 3 * noise + 1e-4 * np.eye(len(info))
    strength, modes = eigh(info, prior)  # information, in units of what counts as none
    held = strength > 1
    basis = prior @ modes[:, held]
    axes = np.linalg.qr(basis, mode="complete")[0]
    observable, free = np.split(axes, [basis.shape[1]], axis=1)
    return observable, free, (observable.T @ basis) * strength[held] @ (observable.T @ basis).T


def _plainly(free: Array) -> Array:
    """Another basis (k, n) of the columns (n, k): each vector as near to one coordinate axis as the span allows.

    Any basis of two slides and a turn would do, and which of them an eigensolver returns is decided by rounding.
    """
    shadow, found = free @ free.T, []  # the columns are the axes, projected
    for _ in range(free.shape[1]):
        length = np.linalg.norm(shadow, axis=0)
        i = int(np.argmax(length > length.max() - 1e-6))  # the first of equals
        found.append(shadow[:, i] / length[i])
        shadow = shadow - np.outer(found[-1], found[-1] @ shadow)
    return np.array(found).reshape(-1, len(free))


def _describe(mode: Array, d: int) -> str:
    shift, turn = mode[:d], mode[d:]
    kind, axis = ("slides along", shift) if np.linalg.norm(shift) >= np.linalg.norm(turn) else ("turns about", turn)
    if axis.size == 1:
        return "turns"
    told = np.round(axis / np.linalg.norm(axis), 2) + 0.0  # no -0.00
    return f"{kind} ({', '.join(f'{x:.2f}' for x in told)})"
