"""Two frames for one robot: the map image's and the odometry's, converted here and nowhere else."""

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle


def odometry_from_image(pose: ArrayLike) -> Array:
    """Poses on the map image, in the odometry's frame: (..., 3) → (..., 3).

    ========  ==============================  ================================
    frame     position                        heading
    ========  ==============================  ================================
    image     u right, v down (px)            yaw clockwise from north (up)
    odometry  x east = u, y north = -v (px)   θ counter-clockwise from east
    ========  ==============================  ================================

    (u, v, yaw) ↦ (u, -v, π/2 - yaw).  Doing it twice gives the pose back, so the way home is the same function,
    ``image_from_odometry``.

    Raises ValueError when the last axis does not have length 3, TypeError for what is no number.

    >>> odometry_from_image([100.0, 50.0, 0.0]).round(6)      # heading north
    array([100.      , -50.      ,   1.570796])

    Source: REP 103 for the odometry's axes.
    """
    pose = as_numbers(pose, "pose")
    if pose.ndim == 0 or pose.shape[-1] != 3:
        raise ValueError(f"pose: expected [u, v, yaw] of shape (..., 3), got {pose.shape}")
    return np.stack([pose[..., 0], -pose[..., 1], wrap_angle(np.pi / 2 - pose[..., 2])], axis=-1)


image_from_odometry = odometry_from_image
