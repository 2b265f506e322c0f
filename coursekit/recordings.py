"""Readers for the recordings that the labs use: text in, checked arrays out.

A recording is somebody's file, so nothing in it is taken on trust.  A file of the wrong kind (missing, empty,
binary, short of a column) is an error that says so.  A broken *row* (text in a number, NaN, a field too many, all
zeros, a stamp that runs backwards) is dropped, counted and named: never repaired, and never averaged in.  Nothing
is unpickled.

``coursekit.datasets`` knows where recordings live; these functions take any path.
"""

from __future__ import annotations

import csv
import warnings
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coursekit.geometry import Array, wrap_angle

LOG_COLUMNS = ("stamp", "measured_d", "measured_theta", "true_d", "true_theta")
ROBOTS = range(1, 6)  # MRCLAM's subjects 1 to 5 are the robots themselves; 6 to 20 are landmarks


class BrokenRow(NamedTuple):
    """A row that was not used: its line in the file, counted from 1, and why."""

    line: int
    reason: str


@dataclass(frozen=True, repr=False)
class Log:
    """Range and bearing to one landmark, measured and true, sample by sample: arrays of shape (n,).

    ``range`` and ``true_range`` in metres; ``bearing`` and ``true_bearing`` in radians, in (-π, π]; ``stamp`` in
    seconds, never decreasing (the sample's number where there is no clock); ``colour`` names the landmark.
    ``dropped`` counts the rows of the file that were not used, ``rejected`` lists them.  A log is sliced like an
    array, ``log[::2]`` or ``log[log.range < 5]``, and a slice remembers what its file dropped.
    """

    range: Array
    bearing: Array
    true_range: Array
    true_bearing: Array
    stamp: Array | None = None
    colour: Array | None = None
    dropped: int = 0
    rejected: tuple[BrokenRow, ...] = ()

    def __post_init__(self) -> None:
        n = np.size(self.range)
        given = {"stamp": np.arange(n) if self.stamp is None else self.stamp,
                 "colour": np.full(n, "") if self.colour is None else self.colour}  # fmt: skip
        for name in _LOG_ARRAYS:
            values = np.array(given.get(name, getattr(self, name)), dtype=str if name == "colour" else float)
            if values.ndim != 1 or values.shape != np.shape(self.range):
                raise ValueError(f"{name}: expected one entry a sample, {np.shape(self.range)}, got {values.shape}")
            if name != "colour" and not np.all(np.isfinite(values)):
                raise ValueError(f"{name}: expected finite numbers, got {values[~np.isfinite(values)][0]}")
            if name in ("range", "true_range") and not np.all(values > 0):
                raise ValueError(f"{name}: expected metres > 0, got {values[values <= 0][0]}")
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def range_error(self) -> Array:
        """Measured minus true range, metres, (n,)."""
        return self.range - self.true_range

    @property
    def bearing_error(self) -> Array:
        """Measured minus true bearing, radians in (-π, π], (n,)."""
        return wrap_angle(self.bearing - self.true_bearing)

    def __len__(self) -> int:
        return len(self.range)

    def __getitem__(self, which: Any) -> Log:
        if isinstance(which, (int, np.integer)):
            raise TypeError("a log takes a slice, a mask or an array of indices; for one sample write log[[i]]")
        return replace(self, **{name: getattr(self, name)[which] for name in _LOG_ARRAYS})

    def __repr__(self) -> str:
        span = f", {self.range.min():.2f} to {self.range.max():.2f} m" if len(self) else ""
        return f"Log({len(self)} samples{span}, {self.dropped} row{'s' * (self.dropped != 1)} dropped)"


_LOG_ARRAYS = tuple(f.name for f in fields(Log) if f.name not in ("dropped", "rejected"))


class Clouds(NamedTuple):
    """Two clouds to be registered, (n, 3) and (m, 3), metres."""

    source: Array
    target: Array


@dataclass(frozen=True)
class Mrclam:
    """One robot's run from the UTIAS multi-robot data set (Leung, Halpern, Barfoot & Liu, IJRR 30(8), 2011).

    odometry (n, 3) : stamp [s], v [m/s], ω [rad/s], at irregular times.
    measurements (m, 4) : stamp [s], landmark, range [m], bearing [rad]; landmarks seen together share a stamp.
    landmarks : landmark → its position [x, y], metres.
    groundtruth (k, 4) : stamp [s], x [m], y [m], θ [rad], with gaps of up to a third of a second.
    dropped : reason → how many rows were not used for it.
    """

    odometry: Array
    measurements: Array
    landmarks: dict[int, Array]
    groundtruth: Array
    dropped: dict[str, int]


def read_landmark_log(path: str | Path) -> Log:
    """The CSV log of a drive around a landmark → Log.

    The header must name stamp, measured_d, measured_theta, true_d and true_theta, in any order; ``color`` is kept
    when it is there, and errors are computed, not read.  Stamps may repeat but not run backwards: as few rows as
    possible are dropped for that, so one wild stamp costs one row.

    Raises FileNotFoundError, or ValueError for an empty file, a binary one, missing or repeated columns or no usable
    row.
    """
    path = Path(path)
    records = [(line, _fields(text)) for line, text in enumerate(_text(path).splitlines(), start=1) if text.strip()]
    header = [name.strip() for name in records[0][1]]
    if missing := [name for name in LOG_COLUMNS if name not in header]:
        raise ValueError(f"{path}: the header lacks {', '.join(missing)}; it reads {','.join(header)}")
    if doubles := [name for name in LOG_COLUMNS if header.count(name) > 1]:
        raise ValueError(f"{path}: expected each column once, the header names {', '.join(doubles)} twice or more")
    lines, rows, colours, rejected = [], [], [], []
    for line, record in records[1:]:
        if len(record) != len(header):
            rejected.append(BrokenRow(line, f"{len(record)} fields where the header names {len(header)}"))
            continue
        named = dict(zip(header, record, strict=True))
        row, reason = _numbers([named[name] for name in LOG_COLUMNS])
        if reason := reason or _implausible(*row[1:]):
            rejected.append(BrokenRow(line, reason))
        else:
            lines.append(line)
            rows.append(row)
            colours.append(named.get("color", "").strip())
    kept = _in_order([row[0] for row in rows])
    rejected += [BrokenRow(lines[i], "the stamp runs backwards") for i in np.flatnonzero(~kept)]
    if not kept.any():
        raise ValueError(f"{path}: no usable row; {_summary(rejected)}")
    stamp, d, theta, true_d, true_theta = np.array(rows)[kept].T
    colour = np.array(colours)[kept]
    return Log(
        d, wrap_angle(theta), true_d, wrap_angle(true_theta), stamp, colour, len(rejected), tuple(sorted(rejected))
    )


def read_cloud(path: str | Path) -> Array:
    """A text file with a point a line, x y z in metres → (n, 3).

    Broken rows, and rows of zeros (how a sensor writes "nothing there"), are dropped with a warning that counts
    them.  Raises FileNotFoundError, or ValueError for a file without a usable row.
    """
    points, rejected = _table(Path(path), 3, zeros=False)
    if rejected:
        warnings.warn(f"{path}: {_summary(rejected)}", stacklevel=2)
    return points


def read_mrclam(folder: str | Path, robot: int = 1) -> Mrclam:
    """The four files of one robot's run, with barcodes translated to landmarks.

    Sightings of other robots, and barcodes that belong to nobody (misreadings), are dropped and counted.
    Raises FileNotFoundError, or ValueError for a file without a usable row.
    """
    folder = Path(folder)
    dropped: Counter[str] = Counter()

    def table(name: str, width: int, stamped: bool = True) -> Array:
        rows, rejected = _table(folder / name, width)
        dropped.update(f"{name}: {row.reason}" for row in rejected)
        if stamped:
            kept = _in_order(rows[:, 0])
            dropped.update({f"{name}: the stamp runs backwards": int(np.sum(~kept))} if not kept.all() else {})
            rows = rows[kept]
        return rows

    subject_of = {int(barcode): int(subject) for subject, barcode in table("Barcodes.dat", 2, stamped=False)}
    landmarks = {int(row[0]): row[1:3] for row in table("Landmark_Groundtruth.dat", 5, stamped=False)}
    sightings = table(f"Robot{robot}_Measurement.dat", 4)
    subject = np.array([subject_of.get(int(barcode), 0) for barcode in sightings[:, 1]])
    is_landmark, is_robot = np.isin(subject, list(landmarks)), np.isin(subject, ROBOTS)
    dropped["another robot"] = int(np.sum(is_robot))
    dropped["unknown barcode"] = int(np.sum(~is_landmark & ~is_robot))
    sightings[:, 1] = subject
    return Mrclam(
        odometry=table(f"Robot{robot}_Odometry.dat", 3),
        measurements=sightings[is_landmark],
        landmarks=landmarks,
        groundtruth=table(f"Robot{robot}_Groundtruth.dat", 4),
        dropped=dict(dropped),
    )


def _text(path: Path) -> str:
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected a text file, got a binary one") from None
    if "\0" in text:
        raise ValueError(f"{path}: expected a text file, got a binary one")
    if not text.strip():
        raise ValueError(f"{path}: the file is empty")
    return text


def _fields(line: str) -> list[str]:
    """The fields of one line, read by itself: a stray quote spoils its own row and no other."""
    try:
        return next(csv.reader([line]))
    except csv.Error:  # a field beyond 128 kB
        return [line]


def _numbers(entries: Sequence[str]) -> tuple[list[float], str]:
    """The entries as finite numbers and no reason, or whatever came out and the reason to drop it."""
    try:
        row = [float(entry) for entry in entries]
    except ValueError:
        return [], "text where a number belongs"
    if any("_" in entry for entry in entries):  # Python reads 1_000 as a number; no recorder writes it
        return row, "text where a number belongs"
    return row, "" if np.all(np.isfinite(row)) else "NaN or infinity"


def _implausible(d: float, theta: float, true_d: float, true_theta: float) -> str:
    if not any((d, theta, true_d, true_theta)):
        return "a row of zeros"
    if d <= 0 or true_d <= 0:
        return "a range that is not positive"
    return "a bearing beyond a full turn; is it in degrees?" if max(abs(theta), abs(true_theta)) > 2 * np.pi else ""


def _table(path: Path, width: int, zeros: bool = True) -> tuple[Array, list[BrokenRow]]:
    """Rows of ``width`` numbers between spaces, # for comments: the usable rows, and the others."""
    rows, rejected = [], []
    for line, text in enumerate(_text(path).splitlines(), start=1):
        entries = text.partition("#")[0].split()
        if not entries:
            continue
        row, reason = _numbers(entries)
        if not reason and len(row) != width:
            reason = f"a row without exactly {width} numbers"
        if not reason and not zeros and not any(row):
            reason = "a row of zeros"
        if reason:
            rejected.append(BrokenRow(line, reason))
        else:
            rows.append(row)
    if not rows:
        raise ValueError(f"{path}: no usable row; {_summary(rejected)}")
    return np.array(rows), rejected


def _in_order(stamps: Iterable[float]) -> np.ndarray:
    """Mask of the longest subsequence that never decreases; of two as long, the one that starts earlier."""
    stamps = np.asarray(list(stamps))
    kept = np.ones(len(stamps), dtype=bool)
    if np.all(np.diff(stamps) >= 0):
        return kept
    best: list[float] = []  # from the end: -best[k] is the greatest stamp that k more in order can follow
    followers = np.empty(len(stamps), dtype=int)
    for i in reversed(range(len(stamps))):
        followers[i] = bisect_right(best, -stamps[i])
        best[followers[i] : followers[i] + 1] = [-stamps[i]]
    wanted, floor = len(best) - 1, -np.inf
    for i, stamp in enumerate(stamps):
        kept[i] = followers[i] == wanted and stamp >= floor
        if kept[i]:
            wanted, floor = wanted - 1, stamp
    return kept


def _summary(rejected: Sequence[BrokenRow]) -> str:
    if not rejected:
        return "it holds no rows"
    reasons = ", ".join(f"{count} × {reason}" for reason, count in Counter(row.reason for row in rejected).items())
    return f"{len(rejected)} rows dropped: {reasons} (the first on line {min(rejected).line})"
