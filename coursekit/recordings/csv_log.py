r"""Any CSV of a drive, with a mapping from what is wanted to the names that its header has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from coursekit.geometry import Array
from coursekit.recordings import degrees
from coursekit.recordings.columns import chosen
from coursekit.recordings.recording import TRACK, Recording
from coursekit.recordings.rows import in_order, lines_of, read_text, split_fields, to_numbers
from coursekit.recordings.tables import Table

SIGHTING = ("id", "range", "bearing")
"""The columns of ``measurements`` that a CSV log may have, beside ``time``."""


def read_csv_log(path: str | Path, columns: Mapping[str, str] | None = None) -> Recording:
    r"""A CSV with a line for each moment or each sighting → Recording, in seconds, metres and radians.

    The track's columns are those of ``Recording``; id, range and bearing become ``measurements``.  A log in two files
    is read twice and joined: ``Recording(wheels.track, camera.measurements)``.  The separator is a comma, a semicolon
    or a tab.  A sighting may be left empty in a line that has none; any other field that is no finite number drops its
    line, and so do a stamp that runs backwards, a range that is not positive and an id that is no whole number: they
    are counted.

    Parameters
    ----------
    columns : wanted → the name in the header, as in {"time": "t [ms]", "v_odometry": "speed"}; a unit at the end of
        that name is honoured.  By default every wanted column that the header names as it stands is taken.

    Raises FileNotFoundError, or ValueError for a file that is empty, binary or not UTF-8, for a mapping that does not
    fit the header, no ``time``, nothing beside it, and no usable line.  Warns (``UnitWarning``) of headings and
    bearings beyond π that the drive itself shows to be degrees: by its path, its clock, or landmarks that would move.

    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp(), "drive.csv")
    >>> _ = file.write_text("t_ms,speed,turn,tag,distance\n0,0.5,0.1,,\n100,0.5,0.1,7,2.5\n")
    >>> wanted = {"time": "t_ms", "v_odometry": "speed", "omega_odometry": "turn", "id": "tag", "range": "distance"}
    >>> log = read_csv_log(file, wanted)
    >>> log.odometry, log.measurements["id"], log.measurements["time"]
    (array([[0.5, 0.1],
           [0.5, 0.1]]), array([7]), array([0.1]))
    """
    path = Path(path)
    (_, first), *others = [(n, text) for n, text in enumerate(lines_of(read_text(path)), 1) if text.strip()]
    delimiter = max(",;\t", key=first.count)
    header = [name.strip() for name in split_fields(first, delimiter)]
    wanted = [*TRACK, *SIGHTING]
    try:
        where = chosen(header, columns or {name: name for name in wanted if name in header}, wanted)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if "time" not in where or len(where) < 2:
        raise ValueError(
            f"{path}: expected time and one of {', '.join(wanted[1:])}, the header reads {','.join(header)}; "
            "say which column is which by columns={'time': 'its name', …}"
        )
    dropped: Counter[str] = Counter()
    sighted = [name for name in SIGHTING if name in where]
    moving = [name for name in TRACK if name in where]
    track, sightings = [], []
    for _, text in others:
        record = split_fields(text, delimiter)
        if len(record) != len(header):
            dropped[f"{len(record)} fields where the header names {len(header)}"] += 1
            continue
        fields = {name: record[column.place].strip() for name, column in where.items()}
        seen = sighted if any(fields[name] for name in sighted) else []
        numbers, reason = to_numbers([fields[name] for name in [*moving, *seen]])
        if not reason:
            row = {name: x * where[name].scale for name, x in zip([*moving, *seen], numbers, strict=True)}
            reason = _implausible(row)
        if reason:
            dropped[reason] += 1
            continue
        track.append([row[name] for name in moving])
        sightings.append([row[name] for name in ["time", *seen]] if seen else [])
    kept = in_order([row[0] for row in track])
    dropped["the stamp runs backwards"] += int(np.sum(~kept))
    if not kept.any():
        raise ValueError(f"{path}: no usable row; {dict(dropped)}")
    measured = [row for row, good in zip(sightings, kept, strict=True) if good and row]
    log = Recording(
        _table(moving, np.array(track)[kept]) if len(moving) > 1 else {},
        _table(["time", *sighted], np.array(measured).reshape(-1, 1 + len(sighted))) if sighted else {},
        dropped={reason: n for reason, n in dropped.items() if n},
    )
    for name, angle, why in degrees.of_recording(log.track, log.measurements):
        degrees.warn(path, header[where[name].place], angle, why)
    return log


def _implausible(row: Mapping[str, float]) -> str:
    if row.get("range", 1.0) <= 0:
        return "a range that is not positive"
    return "an id that is no whole number" if row.get("id", 0.0) % 1 else ""


def _table(names: list[str], rows: Array) -> Table:
    columns = dict(zip(names, rows.T.copy(), strict=True))
    return {name: column.astype(np.int64) if name == "id" else column for name, column in columns.items()}
