"""What happened, kept: truth, odometry and commands at every step, and whatever a sensor said.

A recording is two tables, ``track`` with a row for each control period and ``measurements`` with a row for each
thing a sensor returned, and as many further tables as there are ``sensors``.  A table is a dict of equally long arrays,
one a column.  It goes to disk as CSV (``write_csv``: for people and spreadsheets), as part of an NPZ
(``Recording.save``: for images and scans too), or as a ROS 2 bag (``recordings.write_bag``: for rviz and its like).
What is read back is the same, to the bit and the type.  None of them holds a pickle, and reading refuses one: opening
a recording never runs code.

>>> from coursekit.world.arena import Arena
>>> from coursekit.world.pilot import drive
>>> from coursekit.world.robot import World
>>> world = World(Arena("nowhere"), seed=1)
>>> log = record(world, drive(world, [[1, 0]]), lambda world: {"to_go": 1 - world.pose[0]})
>>> log.poses.shape == log.odometry_poses.shape, bool(log.measurements["to_go"][-1] < 0.03)
(True, True)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

import numpy as np

from coursekit.models import DifferentialDrive
from coursekit.recordings.recording import TRACK, Recording
from coursekit.recordings.tables import Table, as_table, read_csv, write_csv
from coursekit.world.robot import World

__all__ = ["LANDMARK_COLUMNS", "Recording", "Table", "as_table", "read_csv", "record", "write_csv"]

Measure = Callable[[World], Mapping[str, Any] | Iterable[Mapping[str, Any]] | None]

LANDMARK_COLUMNS = ("stamp", "measured_d", "measured_theta", "true_d", "true_theta", "err_d", "err_theta", "color")
"""The columns of the landmark log of labs 1 to 3, in the order of the report's file."""


class HasControl(Protocol):
    """What ``record`` asks of a step: the command it carried out."""

    @property
    def control(self) -> Any: ...


def record(
    world: World,
    steps: Iterable[HasControl],
    measure: Measure | None = None,
    sensors: Mapping[str, Measure] | None = None,
) -> Recording:
    """Keep what happens while ``steps`` (most often ``pilot.drive``) move the world.

    Parameters
    ----------
    steps : advances the world by a control period each time it is asked; each thing it yields has a ``control`` [v, ω].
    measure : ``measure(world)`` after each step → one row as a mapping from column to value, several rows, or
        None for no measurement.  All rows have the same columns.
    sensors : further ones by name, each with a table of its own in ``streams``: scan, image, camera and tags, with
        the columns that ``Recording`` names, are what a ROS 2 bag of the recording shows to rviz.

    Odometry's poses start at the true one: how far they have drifted is the difference of the two.

    Raises ValueError when nothing was recorded, or when the rows of one sensor differ in their columns.
    """
    track: list[list[float]] = []
    asked = {"": measure or (lambda world: None), **(sensors or {})}
    rows: dict[str, list[Mapping[str, Any]]] = {name: [] for name in asked}
    wheels, before, reckoned = DifferentialDrive(), world.time, world.pose
    for step in steps:
        if (dt := world.time - before) > 0:
            reckoned = wheels.f(reckoned, world.odometry, dt)
        before, (forward, _, turning) = world.time, world.velocity
        track.append([world.time, *world.pose, forward, turning, *world.odometry, *reckoned, *step.control])
        for name, look in asked.items():
            got = look(world)
            for row in [got] if isinstance(got, Mapping) else got or []:
                rows[name].append(row if "time" in row or "stamp" in row else {"time": world.time, **row})
    if not track:
        raise ValueError("steps: expected at least one, got none")
    tables = {name: as_table(found) for name, found in rows.items()}
    return Recording(dict(zip(TRACK, np.array(track).T.copy(), strict=True)), tables.pop(""), tables)
