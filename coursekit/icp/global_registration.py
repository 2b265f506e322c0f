r"""Global registration by brute force: try rotations from all over, on a few points, and keep the best.

Source: Alexa (2022), super-Fibonacci spirals, for rotations spread evenly in space.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from coursekit.doors import count, number
from coursekit.geometry import Array, rotation
from coursekit.icp.acceleration import quasi_random_subset
from coursekit.icp.checks import check_cloud
from coursekit.icp.fit import rigid
from coursekit.icp.matching import KdTree
from coursekit.icp.pairing import Iteration, Pairing
from coursekit.icp.registration import iterate


def find_start(
    source: ArrayLike, target: ArrayLike, *, trim: float = 0.7, rotations: int | None = None, points: int = 200
) -> Array:
    """An ``initial`` for ``align`` when nothing is known of the motion: homogeneous, (d+1, d+1).

    Lays the clouds' centres on each other, tries ``rotations`` rotations (36 in 2-D, 200 in 3-D), runs 8 iterations of
    ICP from each and 40 more from the five best, and returns the one with the least trimmed error.  It needs an
    overlap that lets the centres meet roughly (more than half, as a rule), and it cannot tell apart what symmetry
    makes equal: a square room comes back in one of its four ways, the first that was tried.  The cost is that of
    some 500 iterations of ICP in 2-D and 1,800 in 3-D on ``points`` points, whatever the clouds' sizes: one to a few
    seconds in 3-D.

    Parameters
    ----------
    source, target : (n, d) and (m, d), metres, d = 2 or 3.
    trim : share of the closest pairs that is judged, in (0, 1], at most the overlap.
    rotations : how many rotations are tried.     points : how many source points take part.

    Raises ValueError for clouds that ``align`` would not take and options out of range.

    Source: Besl & McKay (1992), section V, for starting from many rotations; Alexa (2022) for their spread.

    >>> from coursekit import geometry
    >>> target = np.random.default_rng(0).uniform(-2, 2, (300, 2)) * [1, 0.4] + [0.2, 1]
    >>> source = geometry.transform([0.3, -0.2, 2.5], target)          # turned by 143 degrees
    >>> T = find_start(source, target)
    >>> bool(np.abs(geometry.transform([0.3, -0.2, 2.5], [0, 0]) @ T[:2, :2].T + T[:2, 2]).max() < 0.05)
    True
    """
    source, target = check_cloud(source, "source"), check_cloud(target, "target")
    d = source.shape[1]
    if target.shape[1] != d:
        raise ValueError(f"expected clouds of one dimension, got source {source.shape} and target {target.shape}")
    tries = count((36 if d == 2 else 200) if rotations is None else rotations, "rotations")
    points = count(points, "points")
    if not 0 < number(trim, "trim") <= 1:
        raise ValueError(f"trim: expected a share in (0, 1], got {trim}")
    subset, few = quasi_random_subset(len(source), points), target[quasi_random_subset(len(target), 10 * points)]
    pairing = Pairing(source, few, KdTree(few), trim=trim)

    def descend(T: Array, iterations: int) -> Iteration:
        history: list[Iteration] = []
        iterate(pairing, T, subset, history, iterations, 1e-6, accelerate=False)
        return min(history, key=lambda step: step.cost)

    nothing = 1e-10 * float(np.mean((few - few.mean(axis=0)) ** 2))  # m²: what sliding leaves undecided

    def rank(step: Iteration) -> float:
        """The cost, in logarithms to six digits: what is equal but for rounding keeps its order in a sort."""
        return float(np.round(np.log(step.cost + nothing + np.finfo(float).tiny), 6))

    centre, goal = source.mean(axis=0), target.mean(axis=0)
    candidates = [descend(rigid(R, goal - R @ centre), 8) for R in spread_rotations(tries, d)]
    best = sorted(candidates, key=rank)[:5]
    return min((descend(step.T_target_source, 40) for step in best), key=rank).T_target_source


def spread_rotations(n: int, d: int) -> Array:
    """``n`` rotations, evenly spread: (n, d, d)."""
    s = np.arange(n) + 0.5
    if d == 2:
        return rotation(2 * np.pi * (s - 0.5) / n)
    near, far = np.sqrt(s / n), np.sqrt(1 - s / n)
    a, b = 2 * np.pi * s / np.sqrt(2), 2 * np.pi * s / 1.533751168755204288
    return Rotation.from_quat(
        np.stack([near * np.sin(a), near * np.cos(a), far * np.sin(b), far * np.cos(b)], 1)
    ).as_matrix()
