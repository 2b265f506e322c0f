r"""Which target point is nearest to each source point?  Two exact searches that agree match for match.

``BruteForce`` computes every distance, n·m of them, through one matrix product.  ``KdTree`` asks a tree, and only
about the points whose nearest neighbour may have changed since the last search.

Where two target points are equally near (within rounding) both take the one with the lower index, and count the tie;
both report distances from the same formula.  That is why the two can be compared with ``==``.  Points that repeat
an earlier one (a driver's zeros for "nothing there") are looked at once.

Source: Friedman, Bentley & Finkel (1977) for the tree; Greenspan & Godin (2001) for remembering its answers.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from coursekit.geometry import Array
from coursekit.icp.checks import check_cloud, check_shape

LARGE = 20_000  # points that are worth putting in order before a tree is asked about them
NO_MATCH = -1  # the index of "no target point within reach"


class Search(Protocol):
    """What ``align`` asks of a search: points (n, d) → indices (n,) or NO_MATCH, and distances (n,) or infinity.

    tree : of the target without its copies.
    """

    @property
    def tree(self) -> cKDTree: ...

    def nearest(self, points: ArrayLike, reach: float) -> tuple[np.ndarray, Array, int]: ...


class BruteForce:
    """All distances, as |p - q|² = |p|² - 2 p·q + |q|²: one matrix product, in blocks that fit the cache.

    The formula cancels: from 10 m away it cannot tell 1 nm from 10 nm.  So the clouds are centred first, and the
    candidates within rounding of the best are measured again, by differences.

    target : (m, d), metres.  Raises ValueError for another shape, NaN or no points.

    >>> index, distance, ties = BruteForce([[0, 0], [2, 0]]).nearest([[1.5, 0], [9, 0]], reach=1.0)
    >>> index, distance
    (array([ 1, -1]), array([0.5, inf]))
    """

    block = 2**16  # distances held at a time: they fit the cache, and BLAS takes so few without starting threads

    def __init__(self, target: ArrayLike) -> None:
        self.target = target = check_cloud(target, "target", at_least=1)
        self._first = distinct(target)
        self.places = target[self._first]
        self.centre = target.mean(axis=0)
        self._centred = (self.places - self.centre).T
        self._squares = np.sum(self._centred**2, axis=0)
        self._tie = tie(target)

    @cached_property
    def tree(self) -> cKDTree:
        """Of ``places``, for questions about neighbourhoods; ``nearest`` never asks it."""
        return cKDTree(self.places)

    def nearest(self, points: ArrayLike, reach: float) -> tuple[np.ndarray, Array, int]:
        """Indices (n,) of the nearest target points or NO_MATCH, distances (n,) [m] or infinity, number of ties."""
        points = check_shape(points, "points", self.target.shape[1])
        index, tied = np.empty(len(points), dtype=np.int64), np.empty(len(points), dtype=bool)
        rows = max(1, self.block // len(self.places))
        for start in range(0, len(points), rows):
            part = slice(start, start + rows)
            index[part], tied[part] = self._nearest(points[part])
        distance = distances(points, self.target[index])
        near = distance <= reach
        return np.where(near, index, NO_MATCH), np.where(near, distance, np.inf), int(np.count_nonzero(near & tied))

    def _nearest(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        """The lowest index among the equally near, and whether these are different places."""
        centred = points - self.centre
        squared = self._squares - 2 * centred @ self._centred  # |p|² is the same along a row
        rounding = 32 * np.finfo(float).eps * (np.sum(centred**2, axis=1) + self._squares.max())
        close = np.flatnonzero(squared <= (squared.min(axis=1) + rounding)[:, None])
        row, column = np.divmod(close, len(self.places))  # row by row, the lowest index first
        exact = distances(points[row], self.places[column])
        every = np.arange(len(points))
        best = np.minimum.reduceat(exact, np.searchsorted(row, every))
        equal = np.flatnonzero(exact <= best[row] + self._tie)
        row, column = row[equal], column[equal]
        starts = np.searchsorted(row, every)
        return self._first[column[starts]], _tied(self.places, column, starts, self._tie)


class KdTree:
    """A k-d tree with a memory.  Exact: it returns the nearest point, always.

    A point that has moved by less than half the gap between its nearest and its second nearest neighbour, since the
    tree was last asked about it, has kept its neighbour.  After the first iterations of an alignment almost every
    point keeps its neighbour, so the tree is hardly queried.

    The tree halves boxes instead of counting points, and does not shrink the boxes to their points: on clouds that
    still lie far apart this makes scipy's search 2 to 6 times faster, and the tree takes half the time to build.

    target : (m, d), metres.  Raises ValueError for another shape, NaN or no points.

    >>> index, distance, ties = KdTree([[0, 0], [2, 0]]).nearest([[1.5, 0], [9, 0]], reach=1.0)
    >>> index, distance
    (array([ 1, -1]), array([0.5, inf]))
    """

    def __init__(self, target: ArrayLike) -> None:
        self.target = target = check_cloud(target, "target", at_least=1)
        self._first = distinct(target)
        self.places = target if len(self._first) == len(target) else target[self._first]
        self.tree = _tree(self.places)
        self._tie = tie(target)
        self._reach = np.nan
        self._asked = np.empty((0, target.shape[1]))  # where each point was when the tree was asked about it,
        self._index = np.empty(0, dtype=np.int64)  # what the tree said,
        self._slack = np.empty(0)  # and how far the point may move before it has to ask again

    def nearest(self, points: ArrayLike, reach: float) -> tuple[np.ndarray, Array, int]:
        """Indices (n,) of the nearest target points or NO_MATCH, distances (n,) [m] or infinity, number of ties."""
        points = check_shape(points, "points", self.target.shape[1])
        if points.shape == self._asked.shape and reach == self._reach:
            ask = np.flatnonzero(distances(points, self._asked) >= self._slack)
            self._asked[ask] = points[ask]
            self._index[ask], self._slack[ask], tied = self._ask(points[ask], reach)  # a tied point has no slack
        else:
            self._asked, self._reach = points.copy(), reach
            self._index, self._slack, tied = self._ask(points, reach)
        distance = distances(
            points, self.target.take(self._index, axis=0)
        )  # NO_MATCH reads the last point, for a moment
        distance[self._index == NO_MATCH] = np.inf
        return self._index.copy(), distance, tied

    def _ask(self, points: Array, reach: float) -> tuple[np.ndarray, Array, int]:
        """The nearest, half the gap to the second nearest (or to the end of the reach), and the number of ties."""
        bound = np.nextafter(reach, np.inf)  # scipy's bound is open, ours is closed
        distance, index = _queried(self.tree, points, bound)
        first, gap = distance[:, 0], np.minimum(distance[:, 1], reach)
        found = np.isfinite(first)
        gap[found] -= first[found]
        gap[~found] = 0.0
        tied = np.flatnonzero(found & (gap <= self._tie))
        nearest, ties = np.append(self._first, NO_MATCH)[index[:, 0]], 0  # scipy's "none" is one past the end
        if tied.size:
            rounding = np.maximum(self._tie, 4 * np.finfo(float).eps * first[tied])  # seen from far away it is larger
            balls = self.tree.query_ball_point(points[tied], first[tied] + rounding, return_sorted=True)
            starts = np.cumsum([0, *(len(ball) for ball in balls[:-1])])
            equal = self._first[np.concatenate(balls)]
            nearest[tied] = equal[starts]
            ties = int(np.count_nonzero(_tied(self.target, equal, starts, self._tie)))
        return nearest, 0.5 * gap - self._tie, ties


def _tied(target: Array, equal: np.ndarray, starts: np.ndarray, tolerance: float) -> np.ndarray:
    """For each run of the equally near, which begins at ``starts``: do any two lie in different places?"""
    first = np.repeat(equal[starts], np.diff(starts, append=len(equal)))
    return np.asarray(np.maximum.reduceat(distances(target[first], target[equal]), starts) > tolerance)


def distinct(cloud: Array) -> np.ndarray:
    """The rows of a cloud (n, d) without those that repeat an earlier one to the bit, in their order: (k,) indices."""
    x = np.sort(cloud[:, 0])
    if np.all(x[1:] != x[:-1]):
        return np.arange(len(cloud))
    order = np.lexsort(cloud.T)  # stable: of copies the earliest comes first
    new = np.any(np.diff(cloud[order], axis=0) != 0, axis=1)
    return np.sort(order[np.r_[True, new]])


def _tree(target: Array) -> cKDTree:
    return cKDTree(target, balanced_tree=False, compact_nodes=False)


def _queried(tree: cKDTree, points: Array, bound: float) -> tuple[Array, np.ndarray]:
    """The two nearest, (n, 2) distances and indices.

    A large cloud asks in the order of its own tree: neighbours walk the same nodes, which then are in the cache.
    """
    if len(points) < LARGE:
        return tree.query(points, k=2, distance_upper_bound=bound)
    order = cKDTree(points, balanced_tree=False).indices
    distance, index = tree.query(points[order], k=2, distance_upper_bound=bound)
    back = np.argsort(order)
    return distance[back], index[back]


def distances(a: Array, b: Array) -> Array:
    """|aᵢ - bᵢ|, (n, d) and (n, d) → (n,).  Written out by columns: the same bits, however many rows."""
    squares = (a - b) ** 2
    return np.sqrt(sum((squares[:, k] for k in range(1, a.shape[1])), start=squares[:, 0]))


def closest(distance: Array, share: float) -> np.ndarray:
    """Indices of the points that found a neighbour; of these, the ``share`` with the shortest distances."""
    found = np.flatnonzero(np.isfinite(distance))
    if share == 1.0 or found.size == 0:
        return found
    keep = max(1, int(np.ceil(share * found.size)))
    return np.sort(found[np.argsort(distance[found], kind="stable")[:keep]])


def tie(target: Array) -> float:
    """How far two distances may differ and still count as equal, metres: rounding, and no more."""
    return float(64 * np.finfo(float).eps * np.abs(target).max())
