"""One pose from a weighted cloud: the dominant cluster's mean, the mean of all, the heaviest particle."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from coursekit import particles
from coursekit.gaussian import Gaussian, with_margin
from coursekit.geometry import Array
from coursekit.particles import Particles


def dominant_cluster(cloud: Particles, cell: float = 40.0) -> Gaussian:
    """Mean and covariance of the cluster that holds the most weight.

    A cloud that is divided between two places has its mean where the robot is certainly not.  Particles belong to
    one cluster when their cells of ``cell`` px touch: connected components of a grid's occupied cells.

    Parameters
    ----------
    cloud : poses [x, y, θ] in px and rad, of which only x and y decide about the cluster.
    cell : side of a cell, px.

    Raises TypeError for what is no cloud, ValueError for a cell that is not > 0.

    >>> two_places = Particles([[0.0, 0, 0], [2.0, 0, 0], [900.0, 0, 1]], np.log([0.3, 0.3, 0.4]), angles=(2,))
    >>> dominant_cluster(two_places).mean
    array([1., 0., 0.])
    """
    _check(cloud)
    if not (np.isfinite(cell) and cell > 0):
        raise ValueError(f"cell: expected a size > 0 px, got {cell}")
    heavy = np.flatnonzero(cloud.weights > 1e-6 / len(cloud))
    cells = np.floor(cloud.states[heavy, :2] / cell).astype(int)
    cells -= cells.min(axis=0)
    wide = cells[:, 1].max() + 1
    # Only occupied cells are looked at: a grid over all between two far clusters would fill the memory.
    occupied, cell_of = np.unique(cells[:, 0] * wide + cells[:, 1], return_inverse=True)
    i, j = KDTree(np.column_stack(divmod(occupied, wide))).query_pairs(1, p=np.inf, output_type="ndarray").T
    touching = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(len(occupied), len(occupied)))
    cluster = connected_components(touching, directed=False)[1][cell_of]
    mass = np.bincount(cluster, weights=cloud.weights[heavy])
    inside = heavy[cluster == np.argmax(mass > (1 - 1e-9) * mass.max())]  # the first of equals
    return mean(Particles(cloud.states[inside], cloud.log_weights[inside], angles=cloud.angles))


def mean(cloud: Particles) -> Gaussian:
    """Mean and covariance of the whole cloud of poses.

    A cloud of copies has no spread: a thousandth of a pixel keeps its covariance positive definite.

    Raises TypeError for what is no cloud.

    >>> mean(Particles([[0.0, 0, 3.1], [2.0, 0, -3.1]], angles=(2,))).mean.round(2)
    array([1.  , 0.  , 3.14])
    """
    _check(cloud)
    return Gaussian(particles.mean(cloud), with_margin(particles.covariance(cloud) + np.diag([1e-6, 1e-6, 1e-10])))


def heaviest(cloud: Particles) -> Array:
    """The particle of greatest weight, (3,): the report's estimate.

    After resampling all weigh the same, and it is whichever comes first.

    Raises TypeError for what is no cloud.

    >>> heaviest(Particles([[0.0, 0, 0], [2.0, 0, 1]], np.log([0.4, 0.6]), angles=(2,)))
    array([2., 0., 1.])
    """
    _check(cloud)
    return np.array(cloud.states[int(np.argmax(cloud.log_weights))])


def _check(cloud: Any) -> None:
    if not isinstance(cloud, Particles):
        raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
