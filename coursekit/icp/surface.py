r"""Normals: which way a cloud's surface faces, from the neighbours of each point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from coursekit.geometry import Array
from coursekit.icp.acceleration import quasi_random_subset
from coursekit.icp.checks import check_cloud
from coursekit.icp.matching import distinct, tie

NEIGHBOURS = {2: 8, 3: 12}  # points that make a piece of surface, by dimension
FLAT = 0.2  # a piece is flat when its variance across is below this share of its variance along


@dataclass(frozen=True)
class Pieces:
    """Neighbourhoods of a cloud: centres (n, d), principal variances (n, d) from small to large.

    axes : (n, d, d), their directions, as columns.
    index : (n, k), the rows of the cloud's points that make each.   is_surface : whether most of them are flat.
    """

    centres: Array
    variances: Array
    axes: Array
    index: np.ndarray

    @property
    def points(self) -> int:
        """How many neighbours each was made of."""
        return self.index.shape[1]

    @property
    def normals(self) -> Array:
        """The direction in which each piece is thinnest, (n, d)."""
        return self.axes[:, :, 0]

    @property
    def flat(self) -> np.ndarray:
        # A thread in space is no surface: its second variance is rounding, beside its last.
        thread = self.variances[:, 1] <= 1e-12 * self.variances[:, -1]
        return ~thread & (self.variances[:, 0] <= FLAT * self.variances[:, 1])

    @property
    def is_surface(self) -> bool:
        return bool(self.flat.mean() >= 0.5)


def pieces(cloud: Array, at: Array, tree: cKDTree | None = None) -> Pieces:
    """The neighbourhoods in ``cloud`` of the points ``at``, (n, d).

    Where a cloud is sampled more finely than it is noisy, a few neighbours look like a ball; so their number grows,
    up to a tenth of the cloud, until most pieces are flat.  If none of these sizes is flat, the smallest is returned.
    """
    tree, k = tree or cKDTree(cloud), min(NEIGHBOURS[cloud.shape[1]], len(cloud))
    few = found = _principal(cloud, at, tree, k)
    while not found.is_surface and 4 * found.points <= len(cloud) // 10:
        found = _principal(cloud, at, tree, 4 * found.points)
    return found if found.is_surface else few


def normals(cloud: ArrayLike) -> Array:
    """Unit normals (n, d) of the surface that points (n, d), metres, sample; their sign is arbitrary.

    The normal is the direction in which a point's neighbours spread least: the eigenvector of their covariance with
    the smallest eigenvalue.  Raises ValueError for another shape, NaN, or fewer points than dimensions.

    Source: Hoppe, DeRose, Duchamp, McDonald & Stuetzle (1992), section 3.1.

    >>> floor = np.random.default_rng(0).uniform(-1, 1, (50, 3)) * [1, 1, 0]
    >>> np.abs(normals(floor)[0]).round(6)
    array([0., 0., 1.])
    """
    cloud = check_cloud(cloud, "cloud")
    first = distinct(cloud)
    places = cloud[first]
    tree = cKDTree(places)
    # A look at a few points tells how many neighbours are needed.
    k = pieces(places, places[:: max(1, len(places) // 200)], tree).points
    # Large neighbourhoods of neighbours hardly differ: one for each k/48 points costs as much as 48 for each point.
    centres = places[quasi_random_subset(len(places), max(len(places) * 48 // k, 1))]
    found = np.vstack([_principal(places, part, tree, k).normals for part in blocks(centres, 2**18 // k)])
    if len(centres) == len(cloud):
        return found
    return found[cKDTree(centres).query(cloud)[1]]


def blocks(points: Array, rows: int) -> list[Array]:
    """The points by so many rows at a time, so that what is computed of them fits the memory."""
    return [points[start : start + max(rows, 1)] for start in range(0, len(points), max(rows, 1))]


def _principal(cloud: Array, at: Array, tree: cKDTree, k: int) -> Pieces:
    index = tree.query(at, k=k)[1].reshape(len(at), k)
    points = cloud.take(index, axis=0)
    centres = points.mean(axis=1)
    points -= centres[:, None]
    variances, axes = np.linalg.eigh(np.swapaxes(points, 1, 2) @ points / k)
    variances[variances <= tie(cloud) ** 2] = 0.0  # copies of one point do not make a surface by their rounding
    return Pieces(centres, variances, axes, index)
