r"""``align``: the iteration itself, and what comes out of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, is_rotation
from coursekit.icp.acceleration import Anderson, spread_out, subset_sizes
from coursekit.icp.fit import KERNELS, Undetermined, rigid
from coursekit.icp.matching import BruteForce, KdTree, Search
from coursekit.icp.pairing import Pairing, Step
from coursekit.icp.surface import normals as estimate_normals
from coursekit.icp.uncertainty import uncertainty

SEARCHES: dict[str, Callable[[Array], Search]] = {"kdtree": KdTree, "brute": BruteForce}
METRICS = ("point_to_point", "point_to_plane")
PATIENCE = 10  # iterations without a lower cost; point-to-plane can go round between a few sets of pairs for ever


@dataclass(frozen=True)
class Registration:
    """What ``align`` found.

    T_target_source : (d+1, d+1) homogeneous, takes source coordinates to target coordinates.  Always a rotation and
        a translation, never a mirror.
    rmse : RMS distance of ``matches`` under T_target_source, metres: the pairs within max_distance, of which the
        share ``trim`` is kept.  Infinite when there are none.
    iterations : motions tried.
    converged : True when the iteration settled *and* the clouds hold the answer; ``reason`` says why, or why not.
    matches : (m, 2) indices into source and target.
    history : each ``Step``, the start first.
    covariance : of [x, y, θ] (3, 3), or of [x, y, z, φ] (6, 6) with φ the rotation vector of a further turn in the
        target's axes; None without pairs.  See ``uncertainty`` for what it leaves out.
    """

    T_target_source: Array
    rmse: float
    iterations: int
    converged: bool
    matches: np.ndarray
    history: tuple[Step, ...] = field(repr=False)
    reason: str = ""
    covariance: Array | None = field(default=None, repr=False)

    @property
    def pose(self) -> Array:
        """The source's frame as a planar pose [x, y, θ] in the target's.  2-D only."""
        if self.T_target_source.shape != (3, 3):
            raise ValueError("pose: a motion in three dimensions is no planar pose; use T_target_source")
        T = self.T_target_source
        return np.array([T[0, 2], T[1, 2], np.arctan2(T[1, 0], T[0, 0])])


def align(
    source: ArrayLike,
    target: ArrayLike,
    *,
    initial: ArrayLike | None = None,
    metric: str = "point_to_point",
    search: str = "kdtree",
    max_distance: float = np.inf,
    trim: float = 1.0,
    max_iterations: int = 50,
    tolerance: float = 1e-9,
    kernel: str | None = None,
    kernel_scale: float | None = None,
    normals: ArrayLike | None = None,
    accelerate: bool = False,
) -> Registration:
    r"""The rigid motion that lays ``source`` on ``target``, found from ``initial`` downhill.

    Each iteration pairs every source point with its nearest target point and minimises Σ w |q - (R p + t)|² over
    the pairs (or the distances along the target's normals).  It ends in the minimum whose basin holds the start;
    for a start from nothing see ``find_start``.

    Parameters
    ----------
    source, target : (n, d) and (m, d), metres, d = 2 or 3, at least d points each.
    initial : (d+1, d+1) homogeneous rigid motion to start from; the identity by default.
    metric : "point_to_point", or "point_to_plane": fewer iterations on surfaces, and free to slide along them.
    search : "kdtree" or "brute"; the same pairs, at another price.
    max_distance : pairs further apart do not count, metres.  It should exceed the error of the start.
    trim : share of the closest pairs kept, in (0, 1]: at most the clouds' overlap.
    max_iterations : limit of iterations (when accelerated: on each subset).
    tolerance : settled when an iteration changes the RMSE by no more than this share of the source's RMS radius,
        and the number of pairs not at all.
    kernel : "huber", "cauchy" or "tukey" lowers the weight of pairs far apart; None for plain least squares.
    kernel_scale : metres, the residual's sigma among good pairs; by default its robust estimate in each iteration.
    normals : (m, d) of the target, for point_to_plane; estimated from neighbours by default.
    accelerate : begin with a subset of the source, and mix iterations after Anderson.  Reaches a minimum of the same
        cost several times sooner.

    Raises ValueError for what cannot be aligned: wrong shapes, NaN, too few points, an ``initial`` that is not rigid,
    an option that does not exist.  What goes wrong on good input is a result, with ``converged=False`` and its reason.

    Source: Besl & McKay (1992); Chen & Medioni (1992); Chetverikov, Stepanov & Krsek (2005) for trimming.
    """
    source, target = check_cloud(source, "source"), check_cloud(target, "target")
    if source.shape[1] != target.shape[1]:
        raise ValueError(f"expected clouds of one dimension, got source {source.shape} and target {target.shape}")
    T = np.eye(source.shape[1] + 1) if initial is None else _rigid(initial, source.shape[1])
    _check_options(metric, search, max_distance, trim, max_iterations, tolerance, kernel, kernel_scale)
    plane_normals = _normals(normals, target) if metric == "point_to_plane" else None
    pairing = Pairing(source, target, SEARCHES[search](target), plane_normals, max_distance, trim, kernel, kernel_scale)

    history: list[Step] = []
    sizes = subset_sizes(len(source)) if accelerate else [len(source)]
    for size in sizes:
        subset = spread_out(len(source), size)
        settled, reason = descend(pairing, T, subset, history, max_iterations, tolerance, accelerate)
        T = history[-1].T_target_source
    end, covariance = history[-1], None
    if settled and any(2 * step.tied > len(step.matches) for step in history):
        settled, reason = False, "settled, but most points once stood halfway between two: the clouds are too symmetric"
    if len(end.matches) >= source.shape[1]:
        covariance, free = uncertainty(
            T, source, target, end.matches, metric=metric, normals=plane_normals, tree=pairing.search.tree
        )
        if settled and free:
            settled, reason = False, "settled, but the clouds do not hold the answer: it " + ", ".join(free)
    iterations = len(history) - len(sizes)
    return Registration(T, end.rmse, iterations, settled, end.matches, tuple(history), reason, covariance)


def descend(
    pairing: Pairing, T: Array, subset: np.ndarray, history: list[Step], limit: int, tolerance: float, accelerate: bool
) -> tuple[bool, str]:
    """Iterate on a subset of the source until nothing changes; every step goes into ``history``."""
    cloud = pairing.source[subset]
    still = tolerance * float(np.sqrt(np.mean(np.sum((cloud - cloud.mean(axis=0)) ** 2, axis=1))))
    sampled = len(subset) < len(pairing.source)
    mixing = Anderson(cloud)
    now = pairing.look(T, subset)
    history.append(now)
    best, patience, change = now, PATIENCE, np.inf
    for _ in range(limit):
        if len(now.matches) == 0:
            return False, f"no target point within max_distance = {pairing.reach:g} m of any source point"
        try:
            fitted = pairing.fit(now)
        except Undetermined as why:
            return False, str(why)
        length = mixing.step_length(now.T_target_source, fitted)
        if sampled and length <= 0.1 * now.rmse / np.sqrt(len(now.matches)):
            return True, "settled as far as a subset can tell"
        ahead = pairing.look(mixing.propose(now.T_target_source, fitted) if accelerate else fitted, subset)
        if accelerate and ahead.cost > now.cost:  # the safeguard: looking ahead may help, never harm
            mixing.forget()
            ahead = pairing.look(fitted, subset)
        history.append(ahead)
        before, now = now, ahead
        best, patience = (now, PATIENCE) if now.cost < best.cost else (best, patience - 1)
        change = abs(now.rmse - before.rmse)
        # A fit that moves the cloud by `length` lowers the squared RMSE of its pairs by length²: both must be still.
        if change <= still and len(now.matches) == len(before.matches) and length**2 <= (2 * now.rmse + still) * still:
            return True, f"settled: the last iteration changed the RMSE by {change:.1e} m"
        if patience == 0:
            history.append(best)
            return True, f"settled: going round in a circle for {PATIENCE} iterations, so back to the lowest cost"
    return False, f"stopped after {limit} iterations; the last one still changed the RMSE by {change:.1e} m"


def check_cloud(points: ArrayLike, name: str) -> Array:
    """The points as a contiguous (n, 2) or (n, 3) array, or a ValueError that says what is wrong with them."""
    points = np.ascontiguousarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise ValueError(f"{name}: expected points of shape (n, 2) or (n, 3), got {points.shape}")
    if not np.all(np.isfinite(points)):
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        raise ValueError(
            f"{name}: expected finite coordinates, got {points[bad[0]]} in row {bad[0]} ({len(bad)} such rows)"
        )
    if len(points) < points.shape[1]:
        raise ValueError(f"{name}: expected at least {points.shape[1]} points, got {len(points)}")
    return points


def _rigid(T: ArrayLike, d: int) -> Array:
    T = np.asarray(T, dtype=float)
    if T.shape != (d + 1, d + 1):
        raise ValueError(f"initial: expected a homogeneous matrix of shape {(d + 1, d + 1)}, got {T.shape}")
    if not np.all(np.isfinite(T)) or not np.array_equal(T[-1], np.eye(d + 1)[-1]) or not is_rotation(T[:d, :d]):
        raise ValueError(f"initial: expected a rotation and a translation over a row [0 … 0 1], got\n{T}")
    U, _, Vt = np.linalg.svd(T[:d, :d])  # what is a rotation within 1e-6 becomes one within rounding
    return rigid(U @ Vt, T[:d, d])


def _normals(normals: ArrayLike | None, target: Array) -> Array:
    if normals is None:
        return estimate_normals(target)
    normals = np.asarray(normals, dtype=float)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    if normals.shape != target.shape or not np.all(np.isfinite(normals)) or np.any(length == 0):
        raise ValueError(
            f"normals: expected finite vectors of shape {target.shape}, none of them zero, got {normals.shape}"
        )
    return normals / length


def _check_options(
    metric: str, search: str, max_distance: float, trim: float, max_iterations: int, tolerance: float,
    kernel: str | None, kernel_scale: float | None,
) -> None:  # fmt: skip
    for name, value, choices in (("metric", metric, METRICS), ("search", search, tuple(SEARCHES))):
        if value not in choices:
            raise ValueError(f"{name}: expected one of {', '.join(choices)}, got {value!r}")
    if kernel is not None and kernel not in KERNELS:
        raise ValueError(f"kernel: expected None or one of {', '.join(KERNELS)}, got {kernel!r}")
    if not max_distance > 0:
        raise ValueError(f"max_distance: expected a distance > 0 m, got {max_distance}")
    if not 0 < trim <= 1:
        raise ValueError(f"trim: expected a share in (0, 1], got {trim}")
    if not (int(max_iterations) == max_iterations and max_iterations >= 1):
        raise ValueError(f"max_iterations: expected a whole number ≥ 1, got {max_iterations}")
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise ValueError(f"tolerance: expected a number ≥ 0, got {tolerance}")
    if kernel_scale is not None and not (np.isfinite(kernel_scale) and kernel_scale > 0):
        raise ValueError(f"kernel_scale: expected a distance > 0 m, got {kernel_scale}")
