r"""Normals: which way a cloud's surface faces, from the neighbours of each point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from coursekit.geometry import Array

NEIGHBOURS = {2: 8, 3: 12}  # points that make a piece of surface, by dimension
FLAT = 0.2  # a piece is flat when its variance across is below this share of its variance along


@dataclass(frozen=True)
class Pieces:
    """Pieces of a cloud: centres (n, d), principal variances (n, d) from small to large, axes (n, d, d) as columns.

    points : neighbours that each was made of.   is_surface : whether most of them are flat.
    """

    centres: Array
    variances: Array
    axes: Array
    points: int

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
    """The pieces of ``cloud`` around the points ``at``, (n, d).

    Where a cloud is sampled more finely than it is noisy, a few neighbours look like a ball; so their number grows,
    up to a tenth of the cloud, until most pieces are flat.
    """
    tree, k = tree or cKDTree(cloud), min(NEIGHBOURS[cloud.shape[1]], len(cloud))
    found = _principal(cloud, at, tree, k)
    while not found.is_surface and 4 * found.points <= len(cloud) // 10:
        found = _principal(cloud, at, tree, 4 * found.points)
    return found


def normals(cloud: Array) -> Array:
    """Unit normals (n, d) of the surface that points (n, d) sample; their sign is arbitrary."""
    # A look at a few points tells how many neighbours are needed.
    k = pieces(cloud, cloud[:: max(1, len(cloud) // 200)]).points
    return _principal(cloud, cloud, cKDTree(cloud), k).normals


def _principal(cloud: Array, at: Array, tree: cKDTree, k: int) -> Pieces:
    points = cloud.take(tree.query(at, k=k)[1].reshape(len(at), k), axis=0)
    centres = points.mean(axis=1)
    points -= centres[:, None]
    variances, axes = np.linalg.eigh(np.swapaxes(points, 1, 2) @ points / k)
    return Pieces(centres, np.maximum(variances, 0.0), axes, k)
