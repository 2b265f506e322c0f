"""The log of a drive around one landmark: range and bearing, measured and true, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.geometry import Array, wrap_angle
from coursekit.recordings import degrees
from coursekit.recordings.columns import Column, chosen, match
from coursekit.recordings.rows import (
    BEYOND,
    BrokenRow,
    in_order,
    lines_of,
    read_text,
    split_fields,
    summary,
    to_numbers,
)

LOG_COLUMNS = ("stamp", "measured_d", "measured_theta", "true_d", "true_theta")


@dataclass(frozen=True, repr=False)
class Log:
    """Range and bearing to one landmark, measured and true, sample by sample: arrays of shape (n,).

    ``range`` and ``true_range`` in metres; ``bearing`` and ``true_bearing`` in radians, in (-π, π], from the robot's
    centre, positive to the left; ``stamp`` in seconds, never decreasing (the sample's number where there is no clock);
    ``colour`` names the landmark.  ``dropped`` counts the rows of the file that were not used, ``rejected`` lists
    them.  A log is sliced like an array, ``log[::2]`` or ``log[log.range < 5]``; a slice remembers what its file
    dropped.

    ``speed`` (m/s, forward) and ``turn_rate`` (rad/s, counter-clockwise) are the robot's own motion.  Where they are
    not given they are computed from the truth and the clock by ``motion``, before any slicing, so that ``log[::2]``
    keeps the rates of the full log.  A log without a clock has no rates: they are zero.

    Raises ValueError for arrays that are not one-dimensional and of one length, for values that are not finite and for
    ranges that are not positive.

    >>> log = Log(range=[1.9, 1.8], bearing=[0.0, 0.1], true_range=[2.0, 2.0], true_bearing=[0.0, 0.1], stamp=[0, 0.5])
    >>> log.range_error.round(3), log.turn_rate.round(3)
    (array([-0.1, -0.2]), array([-0.2, -0.2]))
    """

    range: Array
    bearing: Array
    true_range: Array
    true_bearing: Array
    stamp: Array = None  # type: ignore[assignment]  # where None is given, it is replaced in __post_init__
    colour: Array = None  # type: ignore[assignment]
    dropped: int = 0
    rejected: tuple[BrokenRow, ...] = ()
    speed: Array = None  # type: ignore[assignment]
    turn_rate: Array = None  # type: ignore[assignment]

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self,
            range: ArrayLike,
            bearing: ArrayLike,
            true_range: ArrayLike,
            true_bearing: ArrayLike,
            stamp: ArrayLike | None = None,
            colour: ArrayLike | None = None,
            dropped: int = 0,
            rejected: tuple[BrokenRow, ...] = (),
            speed: ArrayLike | None = None,
            turn_rate: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        n = as_numbers(self.range, "range").size
        given = {"stamp": np.arange(n) if self.stamp is None else self.stamp,
                 "colour": np.full(n, "") if self.colour is None else self.colour,
                 "speed": np.zeros(n) if self.speed is None else self.speed,
                 "turn_rate": np.zeros(n) if self.turn_rate is None else self.turn_rate}  # fmt: skip
        has_clock, knows = self.stamp is not None, (self.speed is not None, self.turn_rate is not None)
        for name in _LOG_ARRAYS:
            taken = given.get(name, getattr(self, name))
            values = np.array(taken, dtype=str) if name == "colour" else as_numbers(taken, name).copy()
            if values.ndim != 1 or values.shape != np.shape(self.range):
                raise ValueError(f"{name}: expected one entry a sample, {np.shape(self.range)}, got {values.shape}")
            if name != "colour" and not np.all(np.abs(values) < LARGEST):
                raise ValueError(f"{name}: expected finite numbers, got {values[~(np.abs(values) < LARGEST)][0]}")
            if name in ("range", "true_range") and not np.all(values > 1 / LARGEST):
                raise ValueError(f"{name}: expected metres > 0, got {values[values <= 1 / LARGEST][0]}")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if has_clock and not all(knows) and n:
            rates = motion(self.stamp, self.true_range, self.true_bearing)
            for name, known, values in zip(("speed", "turn_rate"), knows, rates, strict=True):
                if not known:
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
RATE_WINDOW = 0.08  # s back from each sample: three samples of a log with thirty a second
LEAST_COSINE = 0.1  # a landmark straight abeam says nothing about the speed


def motion(stamp: ArrayLike, true_range: ArrayLike, true_bearing: ArrayLike) -> tuple[Array, Array]:
    """The robot's speed v (m/s) and turn rate ω (rad/s) from where a landmark at rest stood in its frame, (n,) each.

    A robot that drives forward at v and turns at ω sees a landmark at range r and bearing φ move by

        dr/dt = -v cos φ,      dφ/dt = -ω + v sin φ / r,

    which is solved for v and ω.  Each rate of change is the slope of a straight line through the samples of the last
    ``RATE_WINDOW``, at least two: what a robot can know of its motion at that moment.  (The first sample looks ahead.)
    Wheels that slip sideways are not in these equations.

    Parameters: seconds, metres, radians; (n,) each, the stamps never decreasing.  A sample alone has no rates: 0, 0.

    Source: the unicycle of Thrun, Burgard & Fox (2005), section 5.3, in polar coordinates around the robot.

    >>> v, omega = motion([0.0, 0.1, 0.2], [2.0, 1.9, 1.8], [0.0, 0.0, 0.0])
    >>> v.round(6), omega.round(6) + 0.0
    (array([1., 1., 1.]), array([0., 0., 0.]))
    """
    t, r, phi = (np.asarray(values, dtype=float) for values in (stamp, true_range, true_bearing))
    dr, dphi = _slopes(t, r), _slopes(t, np.unwrap(phi))
    cos = np.cos(phi)
    v = -dr * cos / np.maximum(cos**2, LEAST_COSINE**2)
    return v, v * np.sin(phi) / r - dphi


def _slopes(t: Array, y: Array) -> Array:
    """Slope of the straight line through each sample and those just before it; 0 where they share one moment."""
    slopes = np.zeros(len(t))
    for i, a in enumerate(np.searchsorted(t, t - RATE_WINDOW)):
        window = slice(min(a, max(i - 1, 0)), max(i, 1) + 1)
        dt = t[window] - np.mean(t[window])
        if (spread := dt @ dt) > 0:
            slopes[i] = dt @ y[window] / spread
    return slopes


def read_landmark_log(path: str | Path, columns: Mapping[str, str] | None = None) -> Log:
    r"""The CSV log of a drive around a landmark → Log, in seconds, metres and radians.

    Columns are matched by what their names mean, in any order: ``measured_d``, ``d_meas``, ``meas_d`` and ``Range (m)``
    are the measured range.  Wanted are a stamp and range and bearing, each measured and true; where one of the two is
    missing, the error (measured minus true) gives it.  Units in the names are honoured (deg, cm, ms, ns, …); a colour
    is kept when it is there.  Stamps may repeat but not run backwards: as few rows as possible are dropped for that, so
    one wild stamp costs one row.

    Parameters
    ----------
    columns : for names that mean nothing to us, meaning → the name in the header.  The meanings are those of
        ``LOG_COLUMNS``, err_d, err_theta and color.

    Raises FileNotFoundError, or ValueError for a file that is empty, binary or not UTF-8, for columns that are missing
    or that two names could be, and for a file without a usable row.  Warns (``UnitWarning``) of bearings beyond π that
    the log itself shows to be degrees: by the other bearing, the clock or the range.

    Source: the report's assignment 4, whose program writes the columns of ``LOG_COLUMNS``.

    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "log.csv"
    >>> _ = file.write_text("unix_time,d_meas,bearing_deg,d_true,psi\n0.1,1.9,1.0,2.0,0.01\n0,0,0,0,0\n")
    >>> read_landmark_log(file, columns={"true_theta": "psi"})
    Log(1 samples, 1.90 to 1.90 m, 1 row dropped)
    """
    path = Path(path)
    numbered = enumerate(lines_of(read_text(path)), start=1)
    (_, first), *others = [(line, text) for line, text in numbered if text.strip()]
    delimiter = max(",;\t", key=first.count)
    header = [name.strip() for name in split_fields(first, delimiter)]
    where, sources = _places(header, columns or {}, path)
    lines, rows, colours, rejected, angles = [], [], [], [], []
    for line, text in others:
        record = split_fields(text, delimiter)
        if len(record) != len(header):
            rejected.append(BrokenRow(line, f"{len(record)} fields where the header names {len(header)}"))
            continue
        numbers, reason = to_numbers([record[where[name].place] for name in sources])
        if not reason:
            given = {name: where[name].scale * x for name, x in zip(sources, numbers, strict=True)}
            row = [_value(given, name) for name in LOG_COLUMNS]
            reason = _implausible(*row[1:])
            if reason in ("", BEYOND):  # what is dropped for that, too, says which unit it is in
                angles.append(row)
        if reason:
            rejected.append(BrokenRow(line, reason))
        else:
            lines.append(line)
            rows.append(row)
            colours.append(record[where["color"].place].strip() if "color" in where else "")
    stamps, _, measured, true_range, truth = np.array(angles).reshape(-1, len(LOG_COLUMNS)).T
    for name, angle, other in (("measured_theta", measured, truth), ("true_theta", truth, measured)):
        why = degrees.agree(angle, other) or degrees.of_one_landmark(stamps, true_range, angle)
        degrees.warn(path, header[where[name].place] if name in where else name, angle, why)
    kept = in_order([row[0] for row in rows])
    rejected += [BrokenRow(lines[i], "the stamp runs backwards") for i in np.flatnonzero(~kept)]
    if not kept.any():
        raise ValueError(f"{path}: no usable row; {summary(rejected)}")
    stamp, d, theta, true_d, true_theta = np.array(rows)[kept].T
    colour = np.array(colours)[kept]
    return Log(
        d, wrap_angle(theta), true_d, wrap_angle(true_theta), stamp, colour, len(rejected), tuple(sorted(rejected))
    )


def _places(header: list[str], columns: Mapping[str, str], path: Path) -> tuple[dict[str, Column], list[str]]:
    """Where each meaning stands in a row, and the meanings that hold the numbers of ``LOG_COLUMNS``."""
    errors = ("err_d", "err_theta")
    try:
        mine = chosen(header, columns, [*LOG_COLUMNS, *errors, "color"])
        taken = {column.place for column in mine.values()}
        where = match(["" if i in taken else name for i, name in enumerate(header)], skip=mine) | mine
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    sources, missing = ["stamp"], ["stamp"] * ("stamp" not in where)
    for quantity in ("d", "theta"):
        names = [f"measured_{quantity}", f"true_{quantity}", f"err_{quantity}"]
        here = [name for name in names if name in where]
        sources += here[:2]
        missing += [name for name in names[:2] if name not in where] if len(here) < 2 else []
    if missing:
        raise ValueError(
            f"{path}: the header lacks {', '.join(missing)}; it reads {','.join(header)}.  "
            f"If a column means that, say so: columns={{{missing[0]!r}: 'its name'}}"
        )
    return where, sources


def _value(given: Mapping[str, float], name: str) -> float:
    """The number of a column, or, where the file lacks that column, what the error makes of the other."""
    if name in given:
        return given[name]
    role, _, quantity = name.partition("_")
    error = given[f"err_{quantity}"]
    return given[f"measured_{quantity}"] - error if role == "true" else given[f"true_{quantity}"] + error


def _implausible(d: float, theta: float, true_d: float, true_theta: float) -> str:
    if not any((d, theta, true_d, true_theta)):
        return "a row of zeros"
    if d <= 0 or true_d <= 0:
        return "a range that is not positive"
    return BEYOND if max(abs(theta), abs(true_theta)) > 2 * np.pi else ""
