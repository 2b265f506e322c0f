"""A recording in the order of its stamps: where it starts, what happened when, and what was true then."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import Gaussian
from coursekit.geometry import Array, wrap_angle
from coursekit.recordings import Mrclam

LONGEST_STEP = 0.2  # s: equal controls in a row are driven in one step of at most this


def start_of(run: Mrclam) -> Gaussian:
    """The true pose [x m, y m, θ rad] where odometry and truth are first both there, known to 0.1 m and 0.1 rad.

    Raises AttributeError for what is no recording.
    """
    return Gaussian(truth_at(run, begin_of(run)), np.diag([0.1, 0.1, 0.1]) ** 2)


def begin_of(run: Mrclam) -> float:
    """The stamp [s] from which odometry and truth are both there."""
    return float(max(run.odometry[0, 0], run.groundtruth[0, 0]))


def part(run: Mrclam, begin: float, end: float) -> Mrclam:
    """The recording from ``begin`` to ``end`` seconds after its start, both included: to learn from a first minute.

    Raises ValueError for an end that is not after the beginning, and where no odometry or truth is left.
    """
    if not begin < end:
        raise ValueError(f"expected begin < end in seconds, got {begin} and {end}")
    start = begin_of(run)
    kept = {}
    for name in ("odometry", "measurements", "groundtruth"):
        rows = getattr(run, name)
        kept[name] = rows[(rows[:, 0] >= start + begin) & (rows[:, 0] <= start + end)]
    if not len(kept["odometry"]) or not len(kept["groundtruth"]):
        raise ValueError(f"run: expected odometry and truth from {begin} to {end} s, got none")
    return replace(run, **kept)


def truth_at(run: Mrclam, times: ArrayLike) -> Array:
    """The true poses at some times, (..., 3), interpolated between stamps, the heading on the short way round.

    times : stamps in seconds, any shape; before the first and after the last the pose is held.  Raises ValueError for
    what is no number.
    """
    t, x, y, theta = run.groundtruth.T
    times = np.asarray(times, dtype=float)
    heading = wrap_angle(np.interp(times, t, np.unwrap(theta)))
    return np.stack([np.interp(times, t, x), np.interp(times, t, y), heading], axis=-1)


def events(run: Mrclam, delay: float = 0.0) -> Iterator[tuple[float, Array, float, list[tuple[int, Array]]]]:
    """The recording in the order of time: (stamp, control that held until then, for how long, what was seen then).

    The robot holds a control until the next one is stamped.  It is driven on to each measurement, to each change of
    the control, and at least every ``LONGEST_STEP``.

    delay : s, how much later than its stamp a control takes effect; ``localise`` finds it, for a filter with a model
        that knows no delay.

    Raises IndexError for a recording without odometry.
    """
    begin = begin_of(run)
    held = run.odometry + np.array([delay, 0.0, 0.0])
    odometry = held[held[:, 0] >= begin]
    changed = np.ones(len(odometry), dtype=bool)
    changed[1:] = np.any(np.diff(odometry[:, 1:], axis=0) != 0, axis=1)
    first = np.searchsorted(held[:, 0], begin, side="right") - 1  # truth may start after odometry
    control, k = held[first, 1:] if first >= 0 else np.zeros(2), 0
    for now, until, sightings in moments(run, odometry[changed, 0]):
        while k < len(odometry) and odometry[k, 0] <= now:
            control, k = odometry[k, 1:], k + 1
        yield until, control, until - now, sightings


def moments(run: Mrclam, stamps: ArrayLike = ()) -> Iterator[tuple[float, float, list[tuple[int, Array]]]]:
    """The recording in steps from one moment to the next: (from [s], until [s], what was seen then).

    They end at each measurement, at the last odometry, at each of ``stamps``, and last ``LONGEST_STEP`` at most; for a
    motion model that looks up by itself what was commanded, such as ``CalibratingDrive``.  What was seen is (landmark,
    [range m, bearing rad]).  Raises IndexError for a recording without odometry.
    """
    now, m = begin_of(run), 0
    measurements = run.measurements[run.measurements[:, 0] >= now]
    ends = np.concatenate([np.asarray(stamps, dtype=float), run.odometry[-1:, 0], measurements[:, 0]])
    for end in np.unique(ends[ends >= now]).tolist():
        for part in range(pieces := max(1, math.ceil((end - now) / LONGEST_STEP - 1e-9))):
            until = now + (end - now) / (pieces - part)
            sightings = []
            while until >= end - 1e-9 and m < len(measurements) and measurements[m, 0] <= end:
                sightings.append((int(measurements[m, 1]), measurements[m, 2:]))
                m += 1
            yield now, until, sightings
            now = until
