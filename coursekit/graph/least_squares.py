r"""Least squares over everything at once: poses and landmarks, tied together by what was measured.

Each measurement is a ``Factor``: a residual r of a few unknowns, with its covariance Σ.  The estimate minimises

    χ² = Σ rᵀ Σ⁻¹ r        over all factors,

by Gauss-Newton: every factor is linearized at the newest estimate, r(x + δ) ≈ r + J δ, and the sparse normal equations
(Jᵀ J) δ = -Jᵀ r are solved, again and again until nothing moves.  A filter linearizes each measurement once.

>>> here, there = np.zeros(3), np.array([0.9, 0.1, 0.0])                     # first guesses
>>> factors = [prior(0, here, 1e-6 * np.eye(3)), between_poses(0, 1, [1.0, 0.0, 0.1], 0.01 * np.eye(3))]
>>> solution = optimize([here, there], factors)
>>> solution.values[1].round(6) + 0.0, round(solution.chi2, 6)
(array([1. , 0. , 0.1]), 0.0)

``optimize_pose_graph`` is the case of poses alone (Lab 6 closes a loop with it); Lab 5, going further, smooths a whole
drive of EKF-SLAM with ``optimize``.

Source: Lu & Milios (1997); Dellaert & Kaess (2006); Grisetti, Kümmerle, Stachniss & Burgard (2010).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from coursekit.doors import LARGEST, as_numbers, count, number, several
from coursekit.gaussian import check_covariance, chi2_quantile
from coursekit.geometry import Array, rotation, wrap_angle
from coursekit.models import MotionModel, pose_residual, range_bearing
from coursekit.models.checks import has_parts


@dataclass(frozen=True, eq=False)
class Factor:
    """One measurement of the unknowns ``at``.

    cov (m, m) : of the residual.     linearize : their values → r (m,), and ∂r/∂value (m, size) of each of them.

    Raises ValueError for a covariance that is none.
    """

    at: tuple[int, ...]
    cov: Array
    linearize: Callable[..., tuple[Array, Sequence[Array]]]

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self, at: tuple[int, ...], cov: ArrayLike, linearize: Callable[..., tuple[Array, Sequence[Array]]]
        ) -> None: ...

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", tuple(count(i, "at", least=0) for i in self.at))
        object.__setattr__(self, "cov", check_covariance(self.cov))


def prior(i: int, mean: ArrayLike, cov: ArrayLike) -> Factor:
    """Pose i is known beforehand as N(mean, cov): mean [x, y, θ] in m and rad, cov (3, 3)."""
    mean = _pose(mean, "mean")
    return Factor((i,), as_numbers(cov, "cov"), lambda pose: (pose_residual(pose, mean), [np.eye(3)]))


def motion_step(i: int, j: int, motion: MotionModel, control: ArrayLike, dt: float, near: ArrayLike) -> Factor:
    """Pose j is f(pose i, control, dt) but for N(0, Q), with Q taken at the pose ``near``."""
    has_parts(motion, "motion", ("f", "F", "Q"))
    u = as_numbers(control, "control")

    def linearize(here: Array, there: Array) -> tuple[Array, Sequence[Array]]:
        return pose_residual(there, motion.f(here, u, dt)), [-motion.F(here, u, dt), np.eye(3)]

    return Factor((i, j), motion.Q(_pose(near, "near"), u, dt), linearize)


def sight(i: int, j: int, z: ArrayLike, R: ArrayLike) -> Factor:
    """From pose i landmark j was seen at z = [range m, bearing rad], with noise R (2, 2)."""
    z = _point(z, "z")

    def linearize(pose: Array, landmark: Array) -> tuple[Array, Sequence[Array]]:
        r = range_bearing.residual(range_bearing.h(pose, landmark), z)
        return r, [range_bearing.H(pose, landmark), range_bearing.H_landmark(pose, landmark)]

    return Factor((i, j), as_numbers(R, "R"), linearize)


def point_from(i: int, j: int, point: ArrayLike, cov: ArrayLike) -> Factor:
    """From pose i landmark j was seen at ``point`` [x, y] in the pose's frame, m, with the covariance cov (2, 2)."""
    measured = _point(point, "point")

    def linearize(pose: Array, landmark: Array) -> tuple[Array, Sequence[Array]]:
        r, A, B = residuals(pose, np.append(landmark, 0.0), np.append(measured, 0.0))
        return r[:2], [A[:2], B[:2, :2]]

    return Factor((i, j), as_numbers(cov, "cov"), linearize)


def between_poses(i: int, j: int, pose: ArrayLike, cov: ArrayLike) -> Factor:
    """T_i_j was measured as ``pose`` [x, y, θ], with the covariance cov (3, 3) of these three numbers."""
    measured = _pose(pose, "pose")

    def linearize(a: Array, b: Array) -> tuple[Array, Sequence[Array]]:
        r, A, B = residuals(a, b, measured)
        return r, [A, B]

    return Factor((i, j), as_numbers(cov, "cov"), linearize)


@dataclass(frozen=True, eq=False)
class Solution:
    """values : one array for each unknown.  chi2 : Σ rᵀ Σ⁻¹ r there.  converged : did the last step move nothing?

    dof : numbers measured less numbers sought; chi2 is near it where all factors are honest.
    each : rᵀ Σ⁻¹ r of each factor.     reason : why the factors contradict each other; empty while they do not.

    A loop that was closed at the wrong place bends the whole map, and least squares settles all the same: ``reason``
    tells that χ² is beyond what chance gives once in a thousand times, and names the factor that is most strained.  The
    culprit is often that one, and not always, for its neighbours bend with it.
    """

    values: list[Array]
    chi2: float
    converged: bool
    dof: int
    each: Array = field(repr=False)
    _starts: Array = field(repr=False)
    _normal: Any = field(repr=False)

    @property
    def reason(self) -> str:
        """Why the factors contradict each other; empty while they do not."""
        allowed = float(chi2_quantile(0.999, self.dof)) if self.dof else 0.0
        if not self.dof or self.chi2 <= allowed:
            return ""
        worst = int(np.argmax(self.each))
        return (
            f"the factors contradict each other: χ² is {self.chi2:.4g} over {self.dof} degrees of freedom, where "
            f"one in a thousand is above {allowed:.4g}; factor {worst} alone has {self.each[worst]:.4g}"
        )

    def cov(self, *unknowns: int) -> Array:
        """The covariance of some unknowns, stacked, from the curvature of χ²: rows and columns of (Jᵀ J)⁻¹."""
        rows = np.concatenate([np.arange(self._starts[i], self._starts[i + 1]) for i in unknowns])
        columns = np.zeros((self._starts[-1], len(rows)))
        columns[rows, np.arange(len(rows))] = 1.0
        return np.asarray(self._normal.solve(columns)[rows])


def optimize(
    values: Sequence[ArrayLike], factors: Sequence[Factor], iterations: int = 30, tolerance: float = 1e-9
) -> Solution:
    """The values of all unknowns that explain all factors best, by Gauss-Newton from ``values``.

    values : a first guess for each unknown, a pose [x, y, θ] or a point [x, y].  The nearer, the safer: Gauss-Newton
        finds the minimum in whose valley it starts.
    tolerance : stop when no number moves by more, m and rad.

    Raises ValueError for values that are not finite, for a factor that names an unknown that is not there, and where
    the factors leave an unknown free.

    >>> point = optimize([np.zeros(3), [1.0, 1.0]], [prior(0, np.zeros(3), 1e-6 * np.eye(3)),
    ...                                              sight(0, 1, [2.0, 0.0], np.diag([0.01, 0.01]))]).values[1]
    >>> point.round(6) + 0.0
    array([2., 0.])

    Source: Dellaert & Kaess (2006).
    """
    iterations, tolerance = count(iterations, "iterations", least=0), number(tolerance, "tolerance")
    values, factors = several(values, "values"), several(factors, "factors")
    if strange := [factor for factor in factors if not isinstance(factor, Factor)]:
        raise TypeError(f"factors: expected Factor(at, cov, linearize), got {strange[0]!r}")
    x = [as_numbers(value, f"values[{i}]").copy() for i, value in enumerate(values)]
    if not all(value.shape in ((2,), (3,)) and np.isfinite(value).all() for value in x):
        raise ValueError("values: expected finite poses [x, y, θ] and points [x, y]")
    if not factors or not all(0 <= i < len(x) for factor in factors for i in factor.at):
        raise ValueError(f"factors: expected one or more, over unknowns 0 … {len(x) - 1}")
    starts, converged = np.cumsum([0, *map(len, x)]), False
    roots: list[Array] = [np.asarray(np.linalg.cholesky(factor.cov)) for factor in factors]
    for _ in range(iterations):
        J, r = _whitened(x, factors, roots, starts)
        normal = _factored(J)
        step = normal.solve(-J.T @ r)
        for i, value in enumerate(x):
            value += step[starts[i] : starts[i + 1]]
            value[2:] = wrap_angle(value[2:])
        if converged := bool(np.abs(step).max() < tolerance):
            break
    J, r = _whitened(x, factors, roots, starts)
    sizes = [len(root) for root in roots]
    each = np.add.reduceat(r * r, np.cumsum([0, *sizes[:-1]]))
    return Solution(x, float(r @ r), converged, len(r) - int(starts[-1]), each, starts, _factored(J))


def _whitened(x: list[Array], factors: Sequence[Factor], roots: Sequence[Any], starts: Array) -> tuple[Any, Array]:
    """All residuals in units of their own standard deviations, and their sparse Jacobian."""
    residual, rows, columns, entries, row = [], [], [], [], 0
    for factor, root in zip(factors, roots, strict=True):
        r, jacobians = factor.linearize(*(x[i] for i in factor.at))
        white = np.linalg.solve(root, np.column_stack([r, *jacobians]))
        residual.append(white[:, 0])
        names = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in factor.at])
        rows.append(np.repeat(np.arange(row, row + len(r)), len(names)))
        columns.append(np.tile(names, len(r)))
        entries.append(white[:, 1:].ravel())
        row += len(r)
    placed = (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns)))
    return csc_array(coo_array(placed, shape=(row, starts[-1]))), np.concatenate(residual)


def _factored(J: Any) -> Any:
    try:
        # Jᵀ J is symmetric and positive definite: an order and pivots for such matrices leave far fewer numbers in it.
        symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        return splu((J.T @ J).tocsc(), **symmetric)
    except RuntimeError:  # exactly singular
        raise ValueError("factors: they leave an unknown free; a prior on one pose fixes where the map is") from None


@dataclass(frozen=True)
class Edge:
    """T_i_j was measured as ``pose`` [x, y, θ], with the covariance ``cov`` (3, 3) of these three numbers.

    Raises ValueError for a pose that is not finite and a covariance that is none.

    >>> Edge(0, 1, [1.0, 0.0, 0.1], 0.01 * np.eye(3)).pose
    array([1. , 0. , 0.1])
    """

    i: int
    j: int
    pose: Array
    cov: Array

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, i: int, j: int, pose: ArrayLike, cov: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        _name_ends(self)
        object.__setattr__(self, "pose", _pose(self.pose, "pose"))
        object.__setattr__(self, "cov", check_covariance(self.cov, size=3))


@dataclass(frozen=True)
class PointEdge:
    """From pose i landmark j was seen at ``point`` [x, y] in the pose's frame, m, with the covariance ``cov`` (2, 2).

    Raises ValueError for a point that is not finite and a covariance that is none.

    >>> PointEdge(0, 1, [1.0, 0.5], 0.01 * np.eye(2)).point
    array([1. , 0.5])
    """

    i: int
    j: int
    point: Array
    cov: Array

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, i: int, j: int, point: ArrayLike, cov: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        _name_ends(self)
        object.__setattr__(self, "point", _point(self.point, "point"))
        object.__setattr__(self, "cov", check_covariance(self.cov, size=2))


def _name_ends(edge: Any) -> None:
    for end in ("i", "j"):
        object.__setattr__(edge, end, count(getattr(edge, end), end, least=0))


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


def optimize_pose_graph(poses: ArrayLike, edges: Sequence[Edge], iterations: int = 30) -> Array:
    """The poses (n, 3) that minimise χ² = Σ rᵀ cov⁻¹ r over the edges, from ``poses``; the first stays where it is.

    Raises ValueError for bad poses, an edge that names a pose that is not there, and a pose that hangs on no edge;
    TypeError for what is no ``Edge``.

    >>> edges = [Edge(0, 1, [1.0, 0.0, 0.0], np.eye(3)), Edge(0, 1, [1.2, 0.0, 0.0], np.eye(3))]
    >>> optimize_pose_graph(np.zeros((2, 3)), edges)[1].round(6) + 0.0
    array([1.1, 0. , 0. ])

    Source: Lu & Milios (1997); Grisetti, Kümmerle, Stachniss & Burgard (2010).
    """
    poses = as_numbers(poses, "poses")
    if poses.ndim != 2 or poses.shape[1] != 3 or not np.all(np.isfinite(poses)):
        raise ValueError(f"poses: expected finite poses of shape (n, 3), got shape {poses.shape}:\n{poses}")
    n, edges = len(poses), several(edges, "edges")
    if wrong := [edge for edge in edges if not isinstance(edge, Edge)]:
        raise TypeError(f"edges: expected Edge(i, j, pose, cov), got {wrong[0]!r}")
    if not edges or any(not (0 <= e.i < n and 0 <= e.j < n and e.i != e.j) for e in edges):
        raise ValueError(f"edges: expected one or more, each between two different poses of 0 … {n - 1}")
    i, j = np.array([(e.i, e.j) for e in edges]).T
    if connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)[0] > 1:
        raise ValueError("edges: expected a chain of edges from the first pose to every other")
    factors = [between_poses(e.i, e.j, e.pose, e.cov) for e in edges]
    # χ² does not change when all poses move together, so a prior on the first one costs nothing: it is kept exactly.
    held = prior(0, poses[0], np.mean([e.cov for e in edges], axis=0))
    return np.array(optimize(list(poses), [held, *factors], iterations).values)


def _pose(pose: ArrayLike, name: str) -> Array:
    pose = as_numbers(pose, name).copy()
    if pose.shape != (3,) or not np.all(np.abs(pose) < LARGEST):
        raise ValueError(f"{name}: expected a finite [x, y, θ], got {pose!r}")
    return pose


def _point(point: ArrayLike, name: str) -> Array:
    point = as_numbers(point, name).copy()
    if point.shape != (2,) or not np.all(np.abs(point) < LARGEST):
        raise ValueError(f"{name}: expected a finite pair of numbers, got {point!r}")
    return point
