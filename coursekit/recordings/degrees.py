"""Degrees where radians are expected: what a log's own geometry says about the unit of its angles.

A large number alone proves nothing: a heading that was never wrapped may be 40 rad.  So each test here reads the angles
both ways, and doubts the radians only where the robot's own path, range or clock fits the degrees, and not them.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from coursekit.geometry import Array, wrap_angle
from coursekit.recordings.tables import Table

CLEARLY = 2.0  # how many times better the degrees must fit
TURN = 360.0
FASTEST = 4 * np.pi  # rad/s: two turns a second; what measures a landmark while it turns is a good deal slower
WINDOW = 0.1  # s over which a rate is taken: the noise of a bearing is not a rate


class UnitWarning(UserWarning):
    """A column is named like an angle, and the log's own geometry says that its numbers are degrees.

    ``warnings.simplefilter("error", UnitWarning)`` makes an error of it.
    """


def warn(path: Path, column: str, angle: Array, why: str) -> None:
    """Say so, where there is a reason."""
    if why:
        warnings.warn(
            f"{path}: {column}: expected radians, got numbers up to {np.abs(angle).max():.4g}, and {why}: are they "
            f"degrees?  Then name the unit in the header, as in {column}_deg",
            UnitWarning,
            stacklevel=3,
        )


def wraps(angle: Array) -> str:
    """Why angles (n,) in the order of time cannot be radians by themselves: they jump by a turn of 360, or ""."""
    if not _large(angle) or np.abs(angle).max() > TURN:
        return ""
    return "they jump by 360 where they wrap" if np.any(np.abs(np.abs(np.diff(angle)) - TURN) < TURN / 12) else ""


def turns(stamp: Array, angle: Array) -> str:
    """The same by their clock, stamps (n,) in seconds: for a twentieth of the time the robot would spin like a top."""
    if not _large(angle):
        return ""
    later = np.searchsorted(stamp, stamp + WINDOW)
    start = np.flatnonzero(later < len(stamp))
    seconds = stamp[later[start]] - stamp[start]
    if not start.size:
        return ""
    # A bearing from 0 to 2π jumps by a turn.
    rates = np.abs(wrap_angle(angle[later[start]] - angle[start])) / seconds
    often = float(np.quantile(rates, 0.95))
    return f"by radians the robot would turn {often / (2 * np.pi):.1f} times a second" if often > FASTEST else ""


def agree(angle: Array, other: Array) -> str:
    """The same for angles (n,) beside others that mean the same and are radians."""
    if not _large(angle) or _large(other):
        return ""
    as_radians, as_degrees = (np.mean(np.abs(wrap_angle(phi - other))) for phi in _both(angle))
    return "they agree with the other bearing by degrees" if as_radians > CLEARLY * as_degrees else ""


def seen_from_a_drive(distance: Array, bearing: Array) -> str:
    """The same for ranges (n,) and bearings (n,) of one landmark at rest, seen in turn from a robot that drives on.

    Over a short while the speed v hardly changes, and dr/dt = -v cos φ: two steps dr in a row then stand in the
    proportion of their cosines.  Wheels that slip sideways are not in this equation.
    """
    if not _large(bearing):
        return ""
    step = np.diff(distance)
    as_radians, as_degrees = (_unsteady(step, np.cos(_middle(phi))) for phi in _both(bearing))
    return "the range changes as it does by degrees" if as_radians > CLEARLY * as_degrees else ""


def along_the_path(x: Array, y: Array, theta: Array) -> str:
    """The same for the headings (n,) of a robot whose wheels do not slip sideways: it drives along them, or back."""
    dx, dy = np.diff(x), np.diff(y)
    length = np.hypot(dx, dy)
    if not _large(theta) or not length.any():
        return ""
    course = np.arctan2(dy, dx)
    as_radians, as_degrees = (
        np.average(1 - np.cos(2 * (course - _middle(phi))), weights=length) for phi in _both(theta)
    )
    # Half of what a heading that has nothing to do with the path would give, and a tenth.
    return "the robot drives along them by degrees" if as_degrees < 0.1 and as_radians > 0.5 else ""


def at_rest(poses: Array, ids: Array, distance: Array, bearing: Array) -> str:
    """The same for bearings (n,) of landmarks at rest, by their ids, from known poses (n, 3): each stays in its place.

    What it needs are two sightings of a landmark.
    """
    if not _large(bearing):
        return ""
    as_radians, as_degrees = (_scatter(poses, ids, distance, phi) for phi in _both(bearing))
    return "the landmarks stay in their places by degrees" if as_radians > CLEARLY * as_degrees else ""


def of_one_landmark(stamp: Array, distance: Array, bearing: Array) -> str:
    """All that the sightings of one landmark, in any order, say without a pose of the robot."""
    order = np.argsort(stamp, kind="stable")
    stamp, distance, bearing = stamp[order], distance[order], bearing[order]
    return wraps(bearing) or turns(stamp, bearing) or seen_from_a_drive(distance, bearing)


def of_recording(track: Table, measurements: Table) -> Iterator[tuple[str, Array, str]]:
    """The angles of a drive and its sightings, by their columns' names, and why they are no radians, or ""."""
    poses: Array | None = None
    for of in ("_odometry", ""):  # the truth last: by it the sightings are judged
        x, y, theta = (track.get(f"{name}{of}") for name in ("x", "y", "theta"))
        if theta is None:
            continue
        why = wraps(theta) or turns(track["time"], theta)
        if x is not None and y is not None:
            why = why or along_the_path(x, y, theta)
            poses = np.stack([x, y, np.deg2rad(theta) if why else theta], axis=-1)
        yield f"theta{of}", theta, why
    if not {"range", "bearing"} <= measurements.keys():
        return
    time, distance, bearing = (measurements[name] for name in ("time", "range", "bearing"))
    ids = measurements.get("id", np.zeros(len(time), dtype=np.int64))
    if poses is not None and "id" in measurements:
        where = poses[np.searchsorted(track["time"], time, side="right") - 1]
        yield "bearing", bearing, at_rest(where, ids, distance, bearing)
        return
    one_by_one = (of_one_landmark(time[ids == i], distance[ids == i], bearing[ids == i]) for i in np.unique(ids))
    yield "bearing", bearing, next(filter(None, one_by_one), "")


def _large(angle: Array) -> bool:
    """Do they go beyond π, and not just in a broken row or two?"""
    return int(np.sum(np.abs(angle) > np.pi)) >= max(5, 0.01 * len(angle))


def _both(angle: Array) -> tuple[Array, Array]:
    return angle, np.deg2rad(angle)


def _middle(angle: Array) -> Array:
    """Half way from each angle to the next, by the shorter way round: one from 0 to 2π may jump by a turn."""
    return angle[:-1] + 0.5 * wrap_angle(np.diff(angle))


def _unsteady(step: Array, cosine: Array) -> float:
    """How far steps in a row are from the proportion of their cosines: 0 where they are in it, 1 at the most."""
    a, b = step[1:] * cosine[:-1], step[:-1] * cosine[1:]
    return float(np.sum(np.abs(a - b)) / max(np.sum(np.abs(a) + np.abs(b)), np.finfo(float).tiny))


def _scatter(poses: Array, ids: Array, distance: Array, bearing: Array) -> float:
    """Root mean square distance of the sighted places from their landmark's mean, metres."""
    way = poses[:, 2] + bearing
    place = poses[:, :2] + distance[:, None] * np.stack([np.cos(way), np.sin(way)], axis=-1)
    _, which = np.unique(ids, return_inverse=True)
    count = np.bincount(which)
    mean = np.stack([np.bincount(which, place[:, k]) / count for k in (0, 1)], axis=-1)
    return float(np.sqrt(np.mean((place - mean[which]) ** 2)))
