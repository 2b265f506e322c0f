"""Lab 6's failures: a mirror, motions put together in the wrong order, and four numbers that are not what they say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coursekit import geometry, icp
from coursekit.geometry import Array
from coursekit.teaching.experiments import lab_seed
from coursekit.teaching.failures import Failure

# --- a rotation that is none -----------------------------------------------------------------------------------


def best_orthogonal(p: Array, q: Array) -> Array:
    """The best orthogonal matrix and shift for matched points; nobody asks whether it is a mirror."""
    U, _, Vt = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
    T = np.eye(p.shape[1] + 1)
    T[:-1, :-1] = U @ Vt
    T[:-1, -1] = q.mean(axis=0) - T[:-1, :-1] @ p.mean(axis=0)
    return T


def rotations_are_no_mirrors(fit: Callable[[Array, Array], Array]) -> bool:
    """Twenty thin clouds whose noise is larger than their thickness: det R must be +1 every time."""
    rng = np.random.default_rng(lab_seed(6))
    for _ in range(20):
        p = rng.normal(size=(12, 3)) * [1.0, 0.7, 0.005]
        q = p @ geometry.so3_exp(rng.normal(size=3)).T + rng.normal(0, 0.05, p.shape)
        if np.linalg.det(fit(p, q)[:3, :3]) < 0:
            return False
    return True


Failure(
    name="lab06.mirror",
    source="PythonRobotics, icp_matching.py, svd_motion_estimation: R = (u @ vh).T, and no determinant",
    wrong=best_orthogonal,
    right=icp.point_to_point,
    check=rotations_are_no_mirrors,
    lesson="Where a cloud is flatter than its noise, the best orthogonal matrix turns it inside out.",
)


# --- the order of motions --------------------------------------------------------------------------------------


def _compose_steps(source: Array, target: Array, latest_first: bool) -> Array:
    moved, T, search = source, np.eye(source.shape[1] + 1), icp.KdTree(target)
    for _ in range(30):
        index, _, _ = search.nearest(moved, np.inf)
        step = icp.point_to_point(moved, target[index])
        moved = icp.move(step, moved)
        T = step @ T if latest_first else T @ step
    return T


def earliest_first(source: Array, target: Array) -> Array:
    """The points are moved rightly, step by step; the motions are put together as T @ step."""
    return _compose_steps(source, target, latest_first=False)


def latest_first(source: Array, target: Array) -> Array:
    """Each step acts on points that the earlier ones have moved: step @ T."""
    return _compose_steps(source, target, latest_first=True)


def motion_takes_the_points_along(align: Callable[[Array, Array], Array]) -> bool:
    """The motion that is returned must do to the source what the iteration did."""
    target = np.random.default_rng(lab_seed(6)).uniform(-2, 2, (300, 2))
    source = geometry.transform([0.05, -0.04, 0.1], target)
    return bool(np.allclose(icp.move(align(source, target), source), target, atol=1e-6))


Failure(
    name="lab06.composed_backwards",
    source="PythonRobotics, icp_matching.py, update_homogeneous_matrix: Hin @ H for years, H @ Hin today",
    wrong=earliest_first,
    right=latest_first,
    check=motion_takes_the_points_along,
    lesson="The picture shows two clouds that meet, and the printed transform takes neither to the other.",
)


# --- numbers that are not what they say ------------------------------------------------------------------------


def rmse_of_pairs(moved: Array, target: Array) -> float:
    """Root of the mean squared distance from each moved point to its nearest neighbour."""
    return float(np.sqrt(np.mean(icp.KdTree(target).nearest(moved, np.inf)[1] ** 2)))


def mean_distance(moved: Array, target: Array) -> float:
    """The mean distance, called RMSE."""
    return float(np.mean(icp.KdTree(target).nearest(moved, np.inf)[1]))


def by_index(moved: Array, target: Array) -> float:
    """Distances between the points of equal index, whoever was paired with whom."""
    return float(np.sqrt(np.mean(np.sum((moved - target) ** 2, axis=1))))


def rmse_is_that_of_the_pairs(rmse: Callable[[Array, Array], float]) -> bool:
    """Four distances of 3, 3, 4 and 0 cm have the RMS √8.5 cm, and the target's order must not matter."""
    target = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    moved = target + np.array([[0.03, 0], [0, 0.03], [0.04, 0], [0, 0]])
    return all(abs(rmse(moved, target[order]) - np.sqrt(8.5) / 100) < 1e-9 for order in ([0, 1, 2, 3], [3, 1, 0, 2]))


Failure(
    name="lab06.mean_called_rmse",
    source="the homework report, table 1: 0.0202175 is the mean distance from X to Y, 0.0220894 that from Y to X",
    wrong=mean_distance,
    right=rmse_of_pairs,
    check=rmse_is_that_of_the_pairs,
    lesson="Two exact searches must agree; two different numbers under one name need not.",
)

Failure(
    name="lab06.error_by_index",
    source="PythonRobotics, icp_matching.py, nearest_neighbor_association: previous_points - current_points",
    wrong=by_index,
    right=rmse_of_pairs,
    check=rmse_is_that_of_the_pairs,
    lesson="It works while both clouds list the same points in the same order, which no sensor ever does.",
)


def thirty_and_done(source: Array, target: Array) -> tuple[Array, bool]:
    """Thirty iterations, and then it is called the result."""
    return icp.align(source, target, max_iterations=30).T_target_source, True


def settled_or_not(source: Array, target: Array) -> tuple[Array, bool]:
    """Thirty iterations, and whether the last one still changed anything."""
    result = icp.align(source, target, max_iterations=30)
    return result.T_target_source, result.converged


def running_out_is_not_converging(align: Callable[[Array, Array], tuple[Array, bool]]) -> bool:
    """What is called done must not move when the iteration goes on."""
    a = np.linspace(0, np.pi, 400)
    target = np.stack([np.cos(a), 1.1 * np.sin(a)], axis=1)  # nearly a circle: it turns slowly
    T, done = align(geometry.transform([0, 0, 0.7], target), target)
    further = icp.align(geometry.transform([0, 0, 0.7], target), target, initial=T, max_iterations=400)
    return not done or bool(np.abs(further.T_target_source - T).max() < 1e-3)


Failure(
    name="lab06.thirty_is_enough",
    source="the homework report, section 2: 30 iterations on clouds that need about 44",
    wrong=thirty_and_done,
    right=settled_or_not,
    check=running_out_is_not_converging,
    lesson="The curve of the error still slopes where the report stopped; a result must say why it ended.",
)


def frozen_pairs(result: icp.Registration, source: Array, target: Array) -> Array:
    """The covariance of [x, y, θ] that least squares would claim if the pairs were measurements: (JᵀJ)⁻¹ σ²."""
    i, j = result.matches.T
    moved = icp.move(result.T_target_source, source[i])
    arm = moved - result.T_target_source[:2, 2]
    J = np.zeros((len(i), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -arm[:, 1], arm[:, 0]
    rows = J.reshape(-1, 3)
    variance = np.sum((target[j] - moved) ** 2) / (len(rows) - 3)
    return np.asarray(np.linalg.solve(rows.T @ rows, np.eye(3)) * variance)


def pairs_as_measurements(source: Array, target: Array) -> Array:
    """Every coordinate of every pair taken for a measurement."""
    return frozen_pairs(icp.align(source, target), source, target)


def surfaces_as_measurements(source: Array, target: Array) -> Array:
    """What the walls say, along their normals."""
    covariance = icp.align(source, target).covariance
    assert covariance is not None
    return covariance


def a_bare_corridor_says_nothing_along_itself(covariance: Callable[[Array, Array], Array]) -> bool:
    """Two walls, 10 m long, sampled anew and shifted by half a metre along: sigma must admit the half metre."""
    rng = np.random.default_rng(lab_seed(6))
    target, source = (
        np.stack([rng.uniform(-5, 5, 300), 2.0 * rng.integers(0, 2, 300) - 1], axis=1) + rng.normal(0, 0.01, (300, 2))
        for _ in range(2)
    )
    return bool(np.sqrt(covariance(source + np.array([0.5, 0.0]), target)[0, 0]) > 0.25)


Failure(
    name="lab06.frozen_pairs",
    source="the covariance that a least-squares routine prints when ICP hands it its last pairs",
    wrong=pairs_as_measurements,
    right=surfaces_as_measurements,
    check=a_bare_corridor_says_nothing_along_itself,
    lesson="Pairs are made anew in each iteration: along a wall they say where the samples happened to lie.",
)
