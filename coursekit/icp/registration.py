r"""``align``: the iteration itself, and what comes out of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, count, number
from coursekit.geometry import Array
from coursekit.icp.acceleration import Anderson, quasi_random_subset, subset_sizes
from coursekit.icp.checks import check_cloud, check_motion, check_normals
from coursekit.icp.fit import KERNELS, DegenerateGeometry, rigid
from coursekit.icp.matching import BruteForce, KdTree, Search
from coursekit.icp.pairing import Iteration, Pairing
from coursekit.icp.soundness import doubts
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
    converged : True when the iteration settled *and* the clouds determine the answer *and* they lie on each other there
        (see ``soundness``); ``reason`` says why, or why not.
    matches : (m, 2) indices into source and target.
    history : each ``Iteration``, the start first.
    covariance : of [x, y, θ] (3, 3), or of [x, y, z, φ] (6, 6) with φ the rotation vector of a further turn in the
        target's axes; None without pairs.  See ``uncertainty`` for how it is found and what it leaves out.  Of clouds
        that do not lie on each other it is as large as they are.
    """

    T_target_source: Array
    rmse: float
    iterations: int
    converged: bool
    matches: np.ndarray
    history: tuple[Iteration, ...] = field(repr=False)
    reason: str = ""
    covariance: Array | None = field(default=None, repr=False)

    @property
    def pose(self) -> Array:
        """The source's frame as a planar pose [x, y, θ] in the target's.  2-D only."""
        if self.T_target_source.shape != (3, 3):
            raise ValueError("pose: a motion in three dimensions is no planar pose; use T_target_source")
        T = self.T_target_source
        return np.array([T[0, 2], T[1, 2], np.arctan2(T[1, 0], T[0, 0])])


@dataclass(frozen=True, eq=False)
class Target:
    """A cloud made ready to be aligned to, many times: its points (m, d), its search, and its normals or None.

    >>> room = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> ready = Target.of(room)
    >>> align(room - [0.05, 0.0], ready).pose.round(6) + 0.0
    array([0.05, 0.  , 0.  ])
    """

    points: Array
    search: Search
    normals: Array | None = None

    @classmethod
    def of(
        cls, points: ArrayLike, *, metric: str = "point_to_point", search: str = "kdtree",
        normals: ArrayLike | None = None,
    ) -> Target:  # fmt: skip
        """From points (m, d), metres; metric, search and normals as for ``align``, which raises the same errors."""
        points = check_cloud(points, "target")
        _check_choice("metric", metric, METRICS)
        _check_choice("search", search, tuple(SEARCHES))
        planes = None
        if metric == "point_to_plane":
            planes = estimate_normals(points) if normals is None else check_normals(normals, points.shape)
        return cls(points, SEARCHES[search](points), planes)


def align(
    source: ArrayLike,
    target: ArrayLike | Target,
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
    r"""The rigid motion that takes ``source`` onto ``target``, found by iteration from ``initial``.

    Each iteration pairs every source point with its nearest target point and minimises Σ w |q - (R p + t)|² over
    the pairs (or the distances along the target's normals).  It ends in the minimum whose basin holds the start;
    for a start from nothing see ``find_start``.

    Parameters
    ----------
    source, target : (n, d) and (m, d), metres, d = 2 or 3, at least d points each.  A target that many sources are
        aligned to is made ready once, by ``Target.of``, with its metric, search and normals.
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

    Source: Besl & McKay (1992); Chen & Medioni (1992); Chetverikov, Svirko, Stepanov & Krsek (2002) for trimming.

    >>> import numpy as np
    >>> from coursekit.geometry import inverse, transform
    >>> target = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> result = align(transform(inverse([0.05, -0.02, 0.03]), target), target)
    >>> result.converged, result.pose.round(3)
    (True, array([ 0.05, -0.02,  0.03]))
    """
    source = check_cloud(source, "source")
    _check_options(metric, search, max_distance, trim, max_iterations, tolerance, kernel, kernel_scale)
    if not isinstance(target, Target):
        target = Target.of(target, metric=metric, search=search, normals=normals)
    if source.shape[1] != target.points.shape[1]:
        raise ValueError(
            f"expected clouds of one dimension, got source {source.shape} and target {target.points.shape}"
        )
    if not isinstance(accelerate, (bool, np.bool_)):
        raise TypeError(f"accelerate: expected True or False, got {accelerate!r}")
    T = _start(initial, source.shape[1])
    pairing = Pairing(source, target.points, target.search, target.normals, max_distance, trim, kernel, kernel_scale)

    history: list[Iteration] = []
    sizes = subset_sizes(len(source)) if accelerate else [len(source)]
    for size in sizes:
        subset = quasi_random_subset(len(source), size)
        settled, reason = iterate(pairing, T, subset, history, max_iterations, tolerance, accelerate)
        T = history[-1].T_target_source
    end, covariance = history[-1], None
    if settled and any(2 * step.tied > len(step.matches) for step in history):
        settled, reason = False, "settled, but most points once stood halfway between two: the clouds are too symmetric"
    if len(end.matches) >= source.shape[1]:
        covariance, free = uncertainty(
            T, source, target.points, end.matches,
            metric=metric, max_distance=max_distance, normals=target.normals, tree=target.search.tree,
        )  # fmt: skip
        doubt = doubts(T, source, target.points, end.matches, target.search.tree)
        if settled and (free or doubt):
            open_ways = "the clouds do not determine the answer: it " + ", ".join(free)
            settled, reason = False, "settled, but " + (open_ways if free else doubt)
        if doubt:  # the pairs say nothing, so the answer is as unsure as the cloud is large
            covariance = _unknown(source, covariance)
    iterations = len(history) - len(sizes)
    return Registration(T, end.rmse, iterations, settled, end.matches, tuple(history), reason, covariance)


def iterate(
    pairing: Pairing,
    T: Array,
    subset: np.ndarray,
    history: list[Iteration],
    limit: int,
    tolerance: float,
    accelerate: bool,
) -> tuple[bool, str]:  # fmt: skip
    """Iterate on a subset of the source until nothing changes; every step goes into ``history``."""
    cloud = pairing.source[subset]
    still = tolerance * float(np.sqrt(np.mean(np.sum((cloud - cloud.mean(axis=0)) ** 2, axis=1))))
    sampled = len(subset) < len(pairing.source)
    mixing = Anderson(cloud)
    now = pairing.match(T, subset)
    history.append(now)
    best, patience, change = now, PATIENCE, np.inf
    for _ in range(limit):
        if len(now.matches) == 0:
            return False, f"no target point within max_distance = {pairing.reach:g} m of any source point"
        try:
            fitted = pairing.estimate(now)
        except DegenerateGeometry as why:
            return False, str(why)
        length = mixing.step_length(now.T_target_source, fitted)
        if sampled and length <= 0.1 * now.rmse / np.sqrt(len(now.matches)):
            return True, "settled as far as a subset can tell"
        ahead = pairing.match(mixing.propose(now.T_target_source, fitted) if accelerate else fitted, subset)
        if accelerate and ahead.cost > now.cost:  # the safeguard: looking ahead may help, never harm
            mixing.forget()
            ahead = pairing.match(fitted, subset)
        history.append(ahead)
        before, now = now, ahead
        patience = PATIENCE if now.cost < (1 - 1e-12) * best.cost else patience - 1  # a gain by rounding is none
        best = min(best, now, key=lambda step: step.cost)
        change = abs(now.rmse - before.rmse)
        # A fit that moves the cloud by `length` lowers the squared RMSE of its pairs by length²: both must be still.
        if change <= still and len(now.matches) == len(before.matches) and length**2 <= (2 * now.rmse + still) * still:
            return True, f"settled: the last iteration changed the RMSE by {change:.1e} m"
        if patience == 0:
            history.append(best)
            return True, f"settled: going round in a circle for {PATIENCE} iterations, so back to the lowest cost"
    return False, f"stopped after {limit} iterations; the last one still changed the RMSE by {change:.1e} m"


def _unknown(source: Array, covariance: Array) -> Array:
    """That, or at least the cloud's own size and one radian as standard deviations in all directions."""
    d = source.shape[1]
    size = float(np.sqrt(np.mean(np.sum((source - source.mean(axis=0)) ** 2, axis=1))))
    return covariance + np.diag([size**2] * d + [1.0] * (len(covariance) - d))


def _start(initial: ArrayLike | None, d: int) -> Array:
    if initial is None:
        return np.eye(d + 1)
    T = check_motion(initial, d, "initial")
    U, _, Vt = np.linalg.svd(T[:d, :d])  # what is a rotation within 1e-6 becomes one within rounding
    return rigid(U @ Vt, T[:d, d])


def _check_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    if not isinstance(value, str) or value not in choices:
        raise ValueError(f"{name}: expected one of {', '.join(choices)}, got {value!r}")


def _check_options(
    metric: str, search: str, max_distance: float, trim: float, max_iterations: int, tolerance: float,
    kernel: str | None, kernel_scale: float | None,
) -> None:  # fmt: skip
    _check_choice("metric", metric, METRICS)
    _check_choice("search", search, tuple(SEARCHES))
    if kernel is not None and (not isinstance(kernel, str) or kernel not in KERNELS):
        raise ValueError(f"kernel: expected None or one of {', '.join(KERNELS)}, got {kernel!r}")
    if not number(max_distance, "max_distance") > 0:
        raise ValueError(f"max_distance: expected a distance > 0 m, got {max_distance}")
    if not 0 < number(trim, "trim") <= 1:
        raise ValueError(f"trim: expected a share in (0, 1], got {trim}")
    count(max_iterations, "max_iterations")
    if not 0 <= number(tolerance, "tolerance") < np.inf:
        raise ValueError(f"tolerance: expected a number ≥ 0, got {tolerance}")
    if kernel_scale is not None and not 1 / LARGEST < number(kernel_scale, "kernel_scale") < LARGEST:
        raise ValueError(f"kernel_scale: expected a distance > 0 m, got {kernel_scale}")
