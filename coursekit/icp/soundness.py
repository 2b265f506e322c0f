r"""Do the clouds lie on each other at the answer?  An iteration settles on any two clouds, also on unrelated ones.

On surfaces each cloud says by itself how noisy it is: its points scatter about their own pieces of surface.  If source
and target show one surface, the source's points scatter about the target's pieces as much, however large the noise is
and however sparse the samples.  So a pair *fits* when its height over the target's surface is within three sigma of
both clouds' own noise (and a quarter of the target's spacing, where pieces guess).  Fewer than half of the kept pairs
fit for a cloud against its double, its mirror image, or another cloud.

Scattered points have no surface.  Landmarks that are the same in both clouds lie closer to their partners than the
target's points lie to each other.  If they do not, the answer must at least be better than others: a shift of 0.4
times the cloud's size in any direction makes the pairs longer by half (of points that stay in the target's box), or
the pairing is chance.

Source: Censi (2007) for surfaces as the measurement; the thresholds lie between what sound and unsound clouds give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from coursekit.geometry import Array
from coursekit.icp.acceleration import quasi_random_subset
from coursekit.icp.fit import move
from coursekit.icp.matching import distinct, tie
from coursekit.icp.residuals import Heights, heights
from coursekit.icp.surface import pieces

SAMPLE = 200  # so many pairs are looked at
FITTING = 0.5  # share of the pairs that must fit; sound clouds have more than 0.6, unsound ones less than 0.4
SHIFT, RISE = 0.4, 1.45  # a shift by so much of the cloud's size makes the pairs of landmarks so much longer


def doubts(T: Array, source: Array, target: Array, matches: np.ndarray, tree: cKDTree | None = None) -> str:
    """Why the pairs are no evidence that the clouds belong together; empty when they are.

    T : (d+1, d+1), the answer.     source, target : (n, d), (m, d), metres.     matches : (k, 2), the pairs kept.
    tree : of the target without copies, if there is one.

    >>> turn = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    >>> circle, pairs = np.stack([np.cos(turn), np.sin(turn)], axis=1), np.stack([np.arange(100)] * 2, axis=1)
    >>> doubts(np.eye(3), circle, circle, pairs)
    ''
    >>> doubts(np.eye(3), circle, 2 * circle, pairs)
    'only 0 % of the pairs lie on one surface: the clouds do not fit each other'
    """
    tree = tree or cKDTree(target[distinct(target)])
    if len(tree.data) < 2:
        return ""
    i, j = matches[quasi_random_subset(len(matches), SAMPLE)].T
    moved, q = move(T, source), target[j]
    p = moved[i]
    over = _surface(p, q, tree)
    share = 0.0 if over is None else _fitting(over, over.found.noise)
    if share < FITTING:  # the source may be noisier than the target, or it alone is dense enough to be a surface
        under = _surface(q, p, cKDTree(moved[distinct(moved)]))
        if over is not None and under is not None:
            share = _fitting(over, float(np.hypot(over.found.noise, under.found.noise)))
        elif under is not None:
            share = _fitting(under, under.found.noise)
        elif over is None:
            return _chance(moved, p, q, tree, len(matches) / len(source))
    if share >= FITTING:
        return ""
    return f"only {100 * share:.0f} % of the pairs lie on one surface: the clouds do not fit each other"


@dataclass(frozen=True)
class _Surface:
    """Heights of points over a cloud's flat pieces, how many pairs lie at flat pieces, and the cloud's spacing."""

    found: Heights
    pairs: int
    spacing: float


def _surface(p: Array, at: Array, tree: cKDTree) -> _Surface | None:
    """Of the cloud that a tree holds: p over its pieces around ``at``, (n, d) and (n, d); None if it is no surface."""
    cloud = np.asarray(tree.data)
    piece = pieces(cloud, at, tree)
    if not piece.is_surface or len(cloud) < 3 * piece.points:
        return None
    return _Surface(heights(p, piece, cloud), int(np.count_nonzero(piece.flat)), _spacing(at, tree))


def _spacing(at: Array, tree: cKDTree) -> float:
    """How far the points of a cloud are apart, near some of them, metres."""
    return float(np.median(tree.query(at, k=2)[0][:, 1]))


def _fitting(over: _Surface, sigma: float) -> float:
    """Share of the pairs over flat pieces that fit; beside its piece a point does not."""
    bound = 3 * sigma * np.sqrt(1 + np.sum(over.found.weights**2, axis=1)) + over.spacing / 4
    return float(np.count_nonzero(np.abs(over.found.values) <= bound)) / over.pairs


def _chance(moved: Array, p: Array, q: Array, tree: cKDTree, share: float) -> str:
    """The doubts about scattered points: are the pairs close, or at least closer than anywhere near?"""
    apart, spacing = float(np.median(np.linalg.norm(q - p, axis=1))), _spacing(q, tree)
    if apart <= max(spacing / 2, tie(p)):
        return ""
    everyone = moved[quasi_random_subset(len(moved), SAMPLE)]
    size = float(np.sqrt(np.mean(np.sum((everyone - everyone.mean(axis=0)) ** 2, axis=1))))
    low, high = tree.mins, tree.maxes

    def longer(way: Array) -> float:
        """How much longer the pairs become when all points move; who leaves the target's box says nothing."""
        there = everyone + SHIFT * size * way
        inside = np.all((low <= there) & (there <= high), axis=1)
        kept = max(int(np.ceil(share * np.count_nonzero(inside))), 1)
        lengths = (np.sort(tree.query(points[inside])[0])[:kept].sum() for points in (there, everyone))
        moved_away, now = lengths
        return float(moved_away / now) if now > 0 else np.inf

    d = everyone.shape[1]
    rise = min(longer(way) for way in np.vstack([np.eye(d), -np.eye(d)]))
    if rise >= RISE:
        return ""
    return f"the pairs are {apart / spacing:.1f} times as long as the target's points are apart: chance does as well"
