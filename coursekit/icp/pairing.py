r"""One iteration's two halves: match the points, then estimate the motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from coursekit.geometry import Array
from coursekit.icp.fit import KERNELS, move, point_to_plane, point_to_point
from coursekit.icp.matching import Search, closest, tie


@dataclass(frozen=True)
class Iteration:
    """One state of the algorithm: a motion, and the pairs that are nearest under it.

    T_target_source : (d+1, d+1) homogeneous.
    matches : (m, 2) indices into source and target, ordered by the source's.
    rmse : RMS distance of these pairs under this motion, metres; infinite when there are none.
    cost : what the iteration lowers, m²: the mean squared distance (for planes: along the normal; with a kernel: cut
        off at three of its scales), where a point without a partner counts as one at max_distance.
    tied : how many points were equally near to two different places, and took the one with the lower index.
    """

    T_target_source: Array
    matches: np.ndarray
    rmse: float
    cost: float
    tied: int = 0


@dataclass(frozen=True)
class Pairing:
    """The clouds and options, which stay the same from one iteration to the next."""

    source: Array
    target: Array
    search: Search
    normals: Array | None = None
    reach: float = np.inf
    trim: float = 1.0
    kernel: str | None = None
    kernel_scale: float | None = None

    def match(self, T: Array, subset: np.ndarray) -> Iteration:
        """Pair the points of ``subset`` with their nearest neighbours under T."""
        moved = move(T, self.source.take(subset, axis=0))
        index, distance, tied = self.search.nearest(moved, self.reach)
        near = closest(distance, self.trim)
        matches = np.column_stack([subset[near], index[near]])
        rmse = float(np.sqrt(np.mean(distance[near] ** 2))) if near.size else np.inf
        residual = distance[near] if self.normals is None else self._residual(moved[near], matches)
        if self.kernel and near.size:
            residual = np.minimum(residual, 3 * self._scale(residual))
        lonely = np.count_nonzero(np.isinf(distance))
        missing = lonely * self.trim * self.reach**2 if lonely else 0.0
        return Iteration(T, matches, rmse, float(np.sum(residual**2) + missing) / len(subset), tied)

    def estimate(self, step: Iteration) -> Array:
        """The motion that minimises the cost of these pairs."""
        i, j = step.matches.T
        p, q = self.source.take(i, axis=0), self.target.take(j, axis=0)
        moved = move(step.T_target_source, p) if self.kernel or self.normals is not None else p
        weights = None
        if self.kernel:
            residual = self._residual(moved, step.matches)
            weights = KERNELS[self.kernel](residual / self._scale(residual))
        if self.normals is None:
            return point_to_point(p, q, weights)
        return point_to_plane(moved, q, self.normals.take(j, axis=0), weights) @ step.T_target_source

    def _residual(self, moved: Array, matches: np.ndarray) -> Array:
        """Distance of each pair, ≥ 0: for planes, along the normal."""
        apart = self.target.take(matches[:, 1], axis=0) - moved
        if self.normals is None:
            return np.sqrt(np.sum(apart**2, axis=1))
        return np.abs(np.sum(apart * self.normals.take(matches[:, 1], axis=0), axis=1))

    def _scale(self, residual: Array) -> float:
        """Sigma of the good pairs: given, or from the median, which half the pairs being wrong cannot spoil.

        1.4826 makes it that of a Gaussian, half of which lies within 0.6745 σ.  Pairs that meet within rounding are
        all good.
        """
        return self.kernel_scale or max(1.4826 * float(np.median(residual)), self._rounding)

    @cached_property
    def _rounding(self) -> float:
        return max(tie(self.target), tie(self.source), np.finfo(float).tiny)
