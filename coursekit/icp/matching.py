r"""Which target point is nearest to each source point?  Two exact searches that agree match for match.

``BruteForce`` looks at every pair: n·m distances, through one matrix product.  ``KdTree`` asks a tree, and only
about the points that may have changed their mind since it was last asked.

Where two target points are equally near (within rounding) both take the one with the lower index, and count the tie;
both report distances from the same formula.  That is why the two can be compared with ``==``.

Source: Friedman, Bentley & Finkel (1977) for the tree; Greenspan & Godin (2001) for remembering its answers.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from coursekit.geometry import Array

NOBODY = -1  # the index that stands for "no target point within reach"


class Search(Protocol):
    """What ``align`` asks of a search: points (n, d) → indices (n,) or NOBODY, and distances (n,) or infinity."""

    @property
    def tree(self) -> cKDTree: ...

    def nearest(self, points: Array, reach: float) -> tuple[np.ndarray, Array, int]: ...


class BruteForce:
    """All distances, as |p - q|² = |p|² - 2 p·q + |q|²: one matrix product, in blocks that fit the cache.

    That formula cancels: from 10 m away it cannot tell 1 nm from 10 nm.  So the clouds are centred first, and
    whoever is within rounding of the best is measured again, by differences.
    """

    block = 2**16  # distances held at a time: they fit the cache, and BLAS takes so few without starting threads

    def __init__(self, target: Array) -> None:
        self.target, self.centre = target, target.mean(axis=0)
        self._centred = (target - self.centre).T
        self._squares = np.sum(self._centred**2, axis=0)
        self._tie = tie(target)

    @cached_property
    def tree(self) -> cKDTree:
        """For questions about neighbourhoods; ``nearest`` never asks it."""
        return cKDTree(self.target)

    def nearest(self, points: Array, reach: float) -> tuple[np.ndarray, Array, int]:
        index, second = np.empty(len(points), dtype=np.int64), np.empty(len(points), dtype=np.int64)
        rows = max(1, self.block // len(self.target))
        for start in range(0, len(points), rows):
            part = slice(start, start + rows)
            index[part], second[part] = self._nearest(points[part])
        distance = distances(points, self.target[index])
        near = distance <= reach
        tied = near & (distances(self.target[index], self.target[second]) > self._tie)
        return np.where(near, index, NOBODY), np.where(near, distance, np.inf), int(np.count_nonzero(tied))

    def _nearest(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        """The lowest and the highest index among the equally near."""
        centred = points - self.centre
        squared = self._squares - 2 * centred @ self._centred  # |p|² is the same along a row
        rounding = 32 * np.finfo(float).eps * (np.sum(centred**2, axis=1) + self._squares.max())
        close = np.flatnonzero(squared <= (squared.min(axis=1) + rounding)[:, None])
        row, column = np.divmod(close, len(self.target))  # row by row, the lowest index first
        exact = distances(points[row], self.target[column])
        every = np.arange(len(points))
        best = np.minimum.reduceat(exact, np.searchsorted(row, every))
        equal = np.flatnonzero(exact <= best[row] + self._tie)
        row, column = row[equal], column[equal]
        return column[np.searchsorted(row, every)], column[np.searchsorted(row, every, side="right") - 1]


class KdTree:
    """A k-d tree that remembers.  Exact: it never returns anything but the nearest point.

    A point that has moved by less than half the gap between its nearest and its second nearest neighbour, since
    the tree was last asked about it, has kept its neighbour.  Late in an alignment, when the cloud moves by
    micrometres, almost nobody has to ask.

    The tree halves boxes instead of counting points, and does not shrink the boxes to their points: on clouds that
    still lie far apart this makes scipy's search 2 to 6 times faster, and the tree takes half the time to build.
    """

    def __init__(self, target: Array) -> None:
        self.target = target
        self.tree = cKDTree(target, balanced_tree=False, compact_nodes=False)
        self._tie = tie(target)
        self._reach = np.nan
        self._asked = np.empty((0, target.shape[1]))  # where each point was when the tree was asked about it,
        self._index = np.empty(0, dtype=np.int64)  # what the tree said,
        self._slack = np.empty(0)  # and how far the point may move before it has to ask again

    def nearest(self, points: Array, reach: float) -> tuple[np.ndarray, Array, int]:
        if points.shape == self._asked.shape and reach == self._reach:
            ask = np.flatnonzero(distances(points, self._asked) >= self._slack)
            self._asked[ask] = points[ask]
            self._index[ask], self._slack[ask], tied = self._ask(points[ask], reach)  # a tied point has no slack
        else:
            self._asked, self._reach = points.copy(), reach
            self._index, self._slack, tied = self._ask(points, reach)
        distance = distances(points, self.target.take(self._index, axis=0))  # NOBODY reads the last point, for a moment
        distance[self._index == NOBODY] = np.inf
        return self._index.copy(), distance, tied

    def _ask(self, points: Array, reach: float) -> tuple[np.ndarray, Array, int]:
        """The nearest, half the gap to the second nearest (or to the end of the reach), and the number of ties."""
        bound = np.nextafter(reach, np.inf)  # scipy's bound is open, ours is closed
        distance, index = self.tree.query(points, k=2, distance_upper_bound=bound)
        first, gap = distance[:, 0], np.minimum(distance[:, 1], reach)
        found = np.isfinite(first)
        gap[found] -= first[found]
        gap[~found] = 0.0
        nearest, ties = np.where(found, index[:, 0], NOBODY), 0
        for i in np.flatnonzero(found & (gap <= self._tie)):
            equal = sorted(self.tree.query_ball_point(points[i], first[i] + self._tie))
            nearest[i] = equal[0]
            ties += bool(distances(self.target[equal[:1]], self.target[equal[-1:]])[0] > self._tie)
        return nearest, 0.5 * gap - self._tie, ties


def distances(a: Array, b: Array) -> Array:
    """|aᵢ - bᵢ|, (n, d) and (n, d) → (n,).  Written out by columns: the same bits, however many rows."""
    squares = (a - b) ** 2
    return np.sqrt(sum((squares[:, k] for k in range(1, a.shape[1])), start=squares[:, 0]))


def closest(distance: Array, share: float) -> np.ndarray:
    """Which points take part: those that found a neighbour, and of these the ``share`` with the shortest distances."""
    found = np.flatnonzero(np.isfinite(distance))
    if share == 1.0 or found.size == 0:
        return found
    keep = max(1, int(np.ceil(share * found.size)))
    return np.sort(found[np.argsort(distance[found], kind="stable")[:keep]])


def tie(target: Array) -> float:
    """How far two distances may differ and still count as equal, metres: rounding, and no more."""
    return float(64 * np.finfo(float).eps * np.abs(target).max())
