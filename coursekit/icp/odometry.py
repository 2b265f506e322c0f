r"""Odometry from a lidar alone: where did the robot go, judged by how its view changed?

``scan_to_scan`` lays each scan on the one before.  Every step adds its own error, and nothing takes it away again:
the track drifts.  ``scan_to_map`` lays each scan on all that was seen so far; while the robot stays where it has been,
its error stays as small as the map's.

Source: Lu & Milios (1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, between, compose, homogeneous, transform
from coursekit.icp.registration import Registration, align


@dataclass(frozen=True)
class Track:
    """Poses (n, 3) of the robot in the world [m, m, rad], and the n - 1 registrations between or onto the map.

    cloud : (m, 2), what was seen, in the world: the map, of ``scan_to_map``; every scan, of ``scan_to_scan``.
    """

    poses: Array
    steps: tuple[Registration, ...]
    cloud: Array


def scan_to_scan(
    scans: Sequence[Array], *, motions: ArrayLike | None = None, start: ArrayLike = (0.0, 0.0, 0.0), **options: Any
) -> Track:
    """Lay each scan on the one before, and add the motions up.

    Parameters
    ----------
    scans : n clouds (m_k, 2) in the robot's frame.
    motions : (n - 1, 3), a guess at each step's T_before_now, as from wheels; the default is the last step's again.
    start : T_world_robot of the first scan.
    options : of ``align``; ``max_distance`` is 0.5 m unless given.
    """
    guesses = _guesses(scans, motions)
    poses, steps, guess = [np.asarray(start, dtype=float)], [], np.zeros(3)
    for k in range(1, len(scans)):
        guess = guess if guesses is None else guesses[k - 1]
        step = align(scans[k], scans[k - 1], initial=homogeneous(guess), **{"max_distance": 0.5} | options)
        guess = step.pose
        poses.append(compose(poses[-1], step.pose))
        steps.append(step)
    seen = [transform(pose, scan) for pose, scan in zip(poses, scans, strict=True)]
    return Track(np.array(poses), tuple(steps), np.vstack(seen))


def scan_to_map(
    scans: Sequence[Array],
    *,
    motions: ArrayLike | None = None,
    start: ArrayLike = (0.0, 0.0, 0.0),
    spacing: float = 0.3,
    cell: float = 0.05,
    **options: Any,
) -> Track:
    """Lay each scan on the map of those before it.

    Parameters
    ----------
    scans, motions, start, options : as in ``scan_to_scan``.
    spacing : a scan enters the map when the robot has gone so far, m, or turned by half a radian, since the last one.
    cell : the map keeps the first point in each square of this side, m, so that it stops growing where all is seen.
    """
    guesses = _guesses(scans, motions)
    poses, steps, guess = [np.asarray(start, dtype=float)], [], np.zeros(3)
    key, cloud = poses[0], thin(transform(poses[0], scans[0]), cell)
    for k in range(1, len(scans)):
        guess = guess if guesses is None else guesses[k - 1]
        initial = homogeneous(compose(poses[-1], guess))
        step = align(scans[k], cloud, initial=initial, **{"max_distance": 0.5} | options)
        guess = between(poses[-1], step.pose)
        poses.append(step.pose)
        steps.append(step)
        gone = between(key, step.pose)
        if np.hypot(*gone[:2]) > spacing or abs(gone[2]) > 0.5:
            key, cloud = step.pose, thin(np.vstack([cloud, transform(step.pose, scans[k])]), cell)
    return Track(np.array(poses), tuple(steps), cloud)


def thin(cloud: Array, cell: float) -> Array:
    """The first point in each square of side ``cell``, in their order: (n, 2) → (m, 2)."""
    _, first = np.unique(np.floor(cloud / cell), axis=0, return_index=True)
    return cloud[np.sort(first)]


def _guesses(scans: Sequence[Array], motions: ArrayLike | None) -> Array | None:
    if len(scans) == 0:
        raise ValueError("scans: expected at least one")
    if motions is None:
        return None
    motions = np.asarray(motions, dtype=float)
    if motions.shape != (len(scans) - 1, 3) or not np.all(np.isfinite(motions)):
        raise ValueError(f"motions: expected finite poses of shape {(len(scans) - 1, 3)}, got {motions.shape}")
    return motions
