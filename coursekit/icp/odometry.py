r"""Lidar odometry: the robot's motion from its scans alone.

``scan_to_scan`` aligns each scan to the one before.  Every step adds its own error, so the track drifts.
``scan_to_map`` aligns each scan to all that was seen so far; while the robot stays where it has been, its error stays
as small as the map's.

A step whose clouds do not lie on each other (``soundness``) is tried again from starts turned all round, and the one
of least cost is taken.  If none of them helps, the step says so in its ``reason``, and its scan does not enter the map.

Source: Lu & Milios (1994) for aligning scans; Zhang & Singh (2014), section V, for odometry against a growing map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, number, several
from coursekit.gaussian import symmetrize
from coursekit.geometry import Array, between, compose, homogeneous, rotation, transform
from coursekit.icp.checks import check_cloud
from coursekit.icp.registration import Registration, Target, align
from coursekit.icp.soundness import doubts
from coursekit.icp.thinning import voxel_downsample, voxel_rows

DEFAULTS: dict[str, Any] = {"max_distance": 0.5, "tolerance": 1e-6}  # m; share of the scan's radius
TURNS = np.radians([sign * turn for turn in range(20, 181, 20) for sign in (1, -1)])  # from the guess, second tries


@dataclass(frozen=True)
class LidarTrack:
    """Poses (n, 3) of the robot in the world [m, m, rad], and the n - 1 registrations between or onto the map.

    cloud : (m, 2), the points seen, in the world: the map, of ``scan_to_map``; every scan, of ``scan_to_scan``.
    covariances : (n, 3, 3), of the poses, if the first is exact: of ``scan_to_scan`` the steps' covariances composed,
        as if they were independent; of ``scan_to_map`` the step's, and that of the poses from which its part of the
        map was seen, weighted by the pairs.
    """

    poses: Array
    steps: tuple[Registration, ...]
    cloud: Array
    covariances: Array = field(repr=False)


def scan_to_scan(
    scans: Sequence[Array], *, motions: ArrayLike | None = None, start: ArrayLike = (0.0, 0.0, 0.0), **options: Any
) -> LidarTrack:
    """Align each scan to the one before, and compose the motions.

    Parameters
    ----------
    scans : n clouds (m_k, 2) in the robot's frame, metres.
    motions : (n - 1, 3), a guess at each step's T_before_now, as from wheels; the default is the last step's again.
    start : T_world_robot of the first scan, [m, m, rad].
    options : of ``align``; ``max_distance`` is 0.5 m and ``tolerance`` 1e-6 unless given.

    Raises ValueError for no scans, motions of another shape, and whatever ``align`` refuses.  A step that did not
    converge is a result: see ``steps[k].converged``.

    Source: Lu & Milios (1994).

    >>> from coursekit.geometry import inverse
    >>> room = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> poses = np.array([[0, 0, 0], [0.05, 0, 0.02], [0.1, 0.01, 0.04]])
    >>> scan_to_scan([transform(inverse(pose), room) for pose in poses]).poses.round(3)
    array([[0.  , 0.  , 0.  ],
           [0.05, 0.  , 0.02],
           [0.1 , 0.01, 0.04]])
    """
    scans = several(scans, "scans")
    guesses, options = _guesses(scans, motions), DEFAULTS | options
    poses, steps, guess = [_start(start)], [], np.zeros(3)
    covariances: list[Array] = [np.zeros((3, 3))]
    for k in range(1, len(scans)):
        guess = guess if guesses is None else guesses[k - 1]
        step, _ = _step(scans[k], _ready(scans[k - 1], options), guess, options, guesses is not None)
        guess = step.pose
        way = compose(poses[-1], step.pose) - poses[-1]
        poses.append(compose(poses[-1], step.pose))
        steps.append(step)
        turned = np.eye(3)
        turned[:2, :2] = rotation(poses[-2][2])
        carried = _carried(covariances[-1], way)
        covariances.append(symmetrize(carried + turned @ _covariance(step) @ turned.T))
    seen = [transform(pose, scan) for pose, scan in zip(poses, scans, strict=True)]
    return LidarTrack(np.array(poses), tuple(steps), np.vstack(seen), np.array(covariances))


def scan_to_map(
    scans: Sequence[Array],
    *,
    motions: ArrayLike | None = None,
    start: ArrayLike = (0.0, 0.0, 0.0),
    spacing: float = 0.3,
    cell: float = 0.05,
    **options: Any,
) -> LidarTrack:
    """Align each scan to the map of those before it.

    Parameters
    ----------
    scans, motions, start, options : as in ``scan_to_scan``.
    spacing : a scan enters the map when the robot has gone so far, m, or turned by half a radian, since the last one.
    cell : the map keeps the first point in each square of this side, m, so that it stops growing where all is seen.

    The covariance of a step is that of one scan against the map; that of the pose, in ``covariances``, counts the
    error of the map as well.
    Raises ValueError as ``scan_to_scan`` does, and for ``spacing`` or ``cell`` that are not lengths > 0.

    Source: Zhang & Singh (2014), section V.

    >>> from coursekit.geometry import inverse
    >>> room = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> poses = np.array([[0, 0, 0], [0.05, 0, 0.02], [0.1, 0.01, 0.04]])
    >>> scan_to_map([transform(inverse(pose), room) for pose in poses], cell=0.001).poses.round(3)
    array([[0.  , 0.  , 0.  ],
           [0.05, 0.  , 0.02],
           [0.1 , 0.01, 0.04]])
    """
    if not number(spacing, "spacing") > 0:
        raise ValueError(f"spacing: expected a length > 0 m, got {spacing}")
    scans = several(scans, "scans")
    guesses, options = _guesses(scans, motions), DEFAULTS | options
    poses, steps, guess = [_start(start)], [], np.zeros(3)
    covariances: list[Array] = [np.zeros((3, 3))]
    cloud = voxel_downsample(transform(poses[0], scans[0]), cell)
    keys, seen_from, ready = [0], np.zeros(len(cloud), dtype=int), _ready(cloud, options)  # scans that made the map
    for k in range(1, len(scans)):
        guess = guess if guesses is None else guesses[k - 1]
        step, sound = _step(scans[k], ready, compose(poses[-1], guess), options, guesses is not None)
        guess = between(poses[-1], step.pose)
        poses.append(step.pose)
        steps.append(step)
        weights = np.bincount(seen_from[step.matches[:, 1]], minlength=k) / max(len(step.matches), 1)
        of_map = [w * _carried(covariances[i], step.pose - poses[i]) for i, w in enumerate(weights) if w > 0]
        covariances.append(symmetrize(_covariance(step) + np.sum(of_map, axis=0)))
        gone = between(poses[keys[-1]], step.pose)
        if sound and (np.hypot(*gone[:2]) > spacing or abs(gone[2]) > 0.5):
            keys.append(k)
            every = np.vstack([cloud, transform(step.pose, scans[k])])
            kept = voxel_rows(every, cell)
            cloud, seen_from = every[kept], np.append(seen_from, np.full(len(scans[k]), k))[kept]
            ready = _ready(cloud, options)
    return LidarTrack(np.array(poses), tuple(steps), cloud, np.array(covariances))


def _start(start: ArrayLike) -> Array:
    pose = as_numbers(start, "start")
    if pose.shape != (3,) or not np.all(np.abs(pose) < LARGEST):
        raise ValueError(f"start: expected a finite [x, y, θ], got {start!r}")
    return pose


def _ready(cloud: Array, options: dict[str, Any]) -> Target:
    return Target.of(cloud, **{name: options[name] for name in ("metric", "search") if name in options})


def _step(
    scan: Array, target: Target, guess: Array, options: dict[str, Any], guessed: bool
) -> tuple[Registration, bool]:
    """The alignment from the guess, or the one from a turned start that fits best; and whether the clouds fit there.

    Without wheels the guess may be far off.  A scan that leaves a fifth of its points without a partner is then looked
    at again, too: in the wrong basin half of a room may fit.
    """
    first = align(scan, target, initial=homogeneous(guess), **options)
    sound = _sound(first, scan, target)
    if sound and (guessed or len(first.matches) >= 0.8 * len(scan)):
        return first, True
    turned = (homogeneous(compose(guess, [0.0, 0.0, turn])) for turn in TURNS)
    tries = [step for step in (align(scan, target, initial=T, **options) for T in turned) if step.converged]
    best = min(tries, key=lambda step: step.history[-1].cost, default=first)
    if best.converged and not (sound and first.history[-1].cost <= best.history[-1].cost):
        return best, True
    if sound:
        return first, True
    return replace(first, reason=first.reason + "; lost: starts turned by up to 180° ended no better"), False


def _sound(step: Registration, scan: Array, target: Target) -> bool:
    if step.converged or len(step.matches) < 2:
        return step.converged
    return not doubts(step.T_target_source, check_cloud(scan, "scan"), target.points, step.matches, target.search.tree)


def _covariance(step: Registration) -> Array:
    """Without a single pair nothing is known: a metre and a radian."""
    return np.eye(3) if step.covariance is None else step.covariance


def _carried(cov: Array, way: Array) -> Array:
    """What the covariance of a pose means for a place that hangs on it rigidly, ``way`` [m] off in the world."""
    arm = np.eye(3)
    arm[:2, 2] = -way[1], way[0]
    return np.asarray(arm @ cov @ arm.T)


def _guesses(scans: Sequence[Array], motions: ArrayLike | None) -> Array | None:
    if not scans:
        raise ValueError("scans: expected at least one")
    for k, scan in enumerate(scans):
        check_cloud(scan, f"scans[{k}]", 2)
    if motions is None:
        return None
    motions = as_numbers(motions, "motions")
    if motions.shape != (len(scans) - 1, 3) or not np.all(np.abs(motions) < LARGEST):
        raise ValueError(f"motions: expected finite poses of shape {(len(scans) - 1, 3)}, got {motions.shape}")
    return motions
