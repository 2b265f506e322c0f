"""What happened, kept: truth, odometry and commands at every step, and whatever a sensor said.

A recording is two tables, ``track`` with a row for each control period and ``measurements`` with a row for each
thing a sensor returned.  A table is a dict of equally long arrays, one a column, and goes to disk as CSV (for people
and spreadsheets; numbers survive to the last bit) or as part of an NPZ (for images and scans too).  Neither format
holds a pickle, and reading refuses one: opening a recording never runs code.

>>> from coursekit.world.arena import Arena
>>> from coursekit.world.pilot import drive
>>> from coursekit.world.robot import World
>>> world = World(Arena("nowhere"), seed=1)
>>> log = record(world, drive(world, [[1, 0]]), lambda world: {"to_go": 1 - world.pose[0]})
>>> sorted(log.track), bool(log.measurements["to_go"][-1] < 0.03)
(['omega', 'omega_command', 'omega_odometry', 'theta', 'time', 'v', 'v_command', 'v_odometry', 'x', 'y'], True)
"""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from coursekit.world.robot import World

Table = dict[str, np.ndarray]

LANDMARK_COLUMNS = ("stamp", "measured_d", "measured_theta", "true_d", "true_theta", "err_d", "err_theta", "color")
"""The columns of the landmark log of labs 1 to 3, in the order of the report's file."""


class HasControl(Protocol):
    """What ``record`` asks of a step: the command it carried out."""

    @property
    def control(self) -> Any: ...


@dataclass(frozen=True)
class Recording:
    """Everything that ``record`` kept.

    track : time [s]; x, y, theta (true pose); v, omega (true speeds); v_odometry, omega_odometry;
        v_command, omega_command.
    measurements : the callback's own columns, and ``time`` when it gave neither ``time`` nor ``stamp``.
    """

    track: Table
    measurements: Table

    @property
    def poses(self) -> np.ndarray:
        """True poses, (n, 3)."""
        return np.stack([self.track[k] for k in ("x", "y", "theta")], axis=-1)

    @property
    def odometry(self) -> np.ndarray:
        """Measured [v, ω] over each period, (n, 2)."""
        return np.stack([self.track[k] for k in ("v_odometry", "omega_odometry")], axis=-1)

    @property
    def controls(self) -> np.ndarray:
        """Commanded [v, ω], (n, 2)."""
        return np.stack([self.track[k] for k in ("v_command", "omega_command")], axis=-1)

    def save(self, path: str | Path) -> None:
        """Write both tables to one ``.npz``; the same recording gives the same bytes."""
        tables = {"track": self.track, "measurements": self.measurements}
        columns = {f"{name}/{key}": _plain(values, key) for name, t in tables.items() for key, values in t.items()}
        with Path(path).open("wb") as file:
            np.savez_compressed(file, **columns)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Read what ``save`` wrote.  Raises ValueError for any other file, and for one that holds a pickle."""
        tables: dict[str, Table] = {"track": {}, "measurements": {}}
        try:
            with np.load(path, allow_pickle=False) as stored:
                for key in stored.files:
                    table, column = key.split("/", 1)
                    tables[table][column] = stored[key]
        except (ValueError, KeyError, AttributeError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path}: expected a recording without pickles, got one that says: {error}") from None
        return cls(**tables)


def record(
    world: World,
    steps: Iterable[HasControl],
    measure: Callable[[World], Mapping[str, Any] | Iterable[Mapping[str, Any]] | None] | None = None,
) -> Recording:
    """Keep what happens while ``steps`` (most often ``pilot.drive``) move the world.

    Parameters
    ----------
    steps : advances the world each time it is asked; each thing it yields has a ``control`` [v, ω].
    measure : ``measure(world)`` after each step → one row as a mapping from column to value, several rows, or
        None for no measurement.  All rows have the same columns.

    Raises ValueError when nothing was recorded, or when rows differ in their columns.
    """
    track: list[list[float]] = []
    rows: list[Mapping[str, Any]] = []
    for step in steps:
        forward, _, turning = world.velocity
        track.append([world.time, *world.pose, forward, turning, *world.odometry, *step.control])
        got = measure(world) if measure else None
        for row in [got] if isinstance(got, Mapping) else got or []:
            rows.append(row if "time" in row or "stamp" in row else {"time": world.time, **row})
    if not track:
        raise ValueError("steps: expected at least one, got none")
    names = ["time", "x", "y", "theta", "v", "omega", "v_odometry", "omega_odometry", "v_command", "omega_command"]
    return Recording(dict(zip(names, np.array(track).T.copy(), strict=True)), as_table(rows))


def as_table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Rows to columns.  Raises ValueError when a row has other columns than the first."""
    rows = list(rows)
    for i, row in enumerate(rows):
        if list(row) != list(rows[0]):
            raise ValueError(f"row {i}: expected the columns {list(rows[0])}, got {list(row)}")
    return {key: _plain([row[key] for row in rows], key) for key in (rows[0] if rows else ())}


def write_csv(table: Mapping[str, ArrayLike], path: str | Path) -> None:
    """Write a table with a header; numbers are written so that reading gives back every bit.

    Raises ValueError for a column that is not one value a row (use ``Recording.save``), or of unequal length.
    """
    columns = {key: _plain(values, key) for key, values in table.items()}
    for key, values in columns.items():
        if values.ndim != 1:
            raise ValueError(f"{key}: a CSV holds one value a row, got shape {values.shape}")
    if len({len(values) for values in columns.values()}) != 1:
        raise ValueError(f"expected columns of one length, got { {k: len(v) for k, v in columns.items()} }")
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))


def read_csv(path: str | Path) -> Table:
    """Read what ``write_csv`` wrote: columns of numbers where every entry is one, of text elsewhere.

    Raises ValueError naming file and line for a row of the wrong length, and for an empty file.
    """
    with Path(path).open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    if not header or len(set(header)) != len(header):
        raise ValueError(f"{path}: expected a header of distinct names in the first line, got {header}")
    for line, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise ValueError(f"{path}, line {line}: expected {len(header)} values, got {len(row)}")
    return {key: _parsed([row[i] for row in rows]) for i, key in enumerate(header)}


def _parsed(column: list[str]) -> np.ndarray:
    try:
        return np.array([float(entry) for entry in column])
    except ValueError:
        return np.array(column, dtype=str)


def _plain(values: ArrayLike, name: str) -> np.ndarray:
    """The values as an array of numbers, truth values or text; anything else would need a pickle."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name}: expected rows of one shape, got {error}") from None
    if array.dtype.kind not in "biufU":
        raise ValueError(f"{name}: expected numbers or text, got {array.dtype}, which only a pickle could hold")
    return array
