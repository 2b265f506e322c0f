r"""A start from nothing: try rotations from all over, on a few points, and keep the best.

Source: Alexa (2022), super-Fibonacci spirals, for rotations spread evenly in space.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from coursekit.geometry import Array, rotation
from coursekit.icp.acceleration import spread_out
from coursekit.icp.fit import rigid
from coursekit.icp.matching import KdTree
from coursekit.icp.pairing import Pairing, Step
from coursekit.icp.registration import check_cloud, descend


def find_start(
    source: ArrayLike, target: ArrayLike, *, trim: float = 0.7, rotations: int | None = None, points: int = 200
) -> Array:
    """An ``initial`` for ``align`` when nothing is known of the motion: homogeneous, (d+1, d+1).

    Lays the clouds' centres on each other, tries ``rotations`` rotations (36 in 2-D, 200 in 3-D), lets each slide
    downhill for a moment, the five best for longer, and returns the one with the least trimmed error.  It needs an
    overlap that lets the centres meet roughly (more than half, as a rule), and it cannot tell apart what symmetry
    makes equal: a square room comes back in any of its four ways.  About half a second in 3-D.

    Parameters
    ----------
    trim : share of the closest pairs that is judged, at most the overlap.
    points : how many source points take part.
    """
    source, target = check_cloud(source, "source"), check_cloud(target, "target")
    d = source.shape[1]
    if target.shape[1] != d:
        raise ValueError(f"expected clouds of one dimension, got source {source.shape} and target {target.shape}")
    subset, few = spread_out(len(source), points), target[spread_out(len(target), 10 * points)]
    pairing = Pairing(source, few, KdTree(few), trim=trim)

    def slide(T: Array, iterations: int) -> Step:
        history: list[Step] = []
        descend(pairing, T, subset, history, iterations, 1e-6, accelerate=False)
        return min(history, key=lambda step: step.cost)

    centre, goal = source.mean(axis=0), target.mean(axis=0)
    candidates = [
        slide(rigid(R, goal - R @ centre), 8) for R in spread_rotations(rotations or (36 if d == 2 else 200), d)
    ]
    best = sorted(candidates, key=lambda step: step.cost)[:5]
    return min((slide(step.T_target_source, 40) for step in best), key=lambda step: step.cost).T_target_source


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
