"""Voxel thinning: one point for each cell of a grid, so that a cloud is as dense near the sensor as far away."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, number
from coursekit.geometry import Array
from coursekit.icp.checks import check_cloud


def voxel_rows(cloud: ArrayLike, cell: float) -> np.ndarray:
    """The rows of the first point in each square, or cube, of side ``cell`` [m], in their order: (n, d) → (m,).

    For what belongs to the points: colours, times, the scan that each came from.  Raises as ``voxel_downsample``.

    >>> voxel_rows([[0.01, 0.01], [0.2, 0.0], [0.02, 0.02]], cell=0.1)
    array([0, 1])
    """
    cloud = check_cloud(cloud, "cloud", at_least=1)
    if not 1 / LARGEST < number(cell, "cell") < LARGEST:
        raise ValueError(f"cell: expected a length > 0 m, got {cell}")
    cells = np.floor(cloud / cell)
    order = np.lexsort(cells.T)  # stable: the first point of each cell comes first
    new = np.any(np.diff(cells[order], axis=0) != 0, axis=1)
    return np.sort(order[np.r_[True, new]])


def voxel_downsample(cloud: ArrayLike, cell: float) -> Array:
    """The first point in each square, or cube, of side ``cell`` [m], in their order: (n, d) → (m, d), d = 2 or 3.

    Raises ValueError for another shape, NaN, and a cell that is no length > 0.

    Source: Rusu & Cousins (2011), the voxel grid filter, which keeps a cell's centroid where this keeps a point.

    >>> voxel_downsample([[0.01, 0.01], [0.2, 0.0], [0.02, 0.02]], cell=0.1)
    array([[0.01, 0.01],
           [0.2 , 0.  ]])
    """
    cloud = check_cloud(cloud, "cloud", at_least=1)
    return cloud[voxel_rows(cloud, cell)]
