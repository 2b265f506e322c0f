r"""Logs of CARMEN, the Carnegie Mellon navigation toolkit, in which two decades of indoor recordings are kept.

A message a line, fields between spaces; each line ends with three fields of the logger: the time at which the message
was made, the host, and the seconds since the logger started.

    ODOM x y theta tv rv accel                                                                  time host logger_time
    FLASER n range₁ … rangeₙ laser_x laser_y laser_theta odom_x odom_y odom_theta               time host logger_time
    ROBOTLASER1 type start fov resolution max accuracy remission n range₁ … rangeₙ m remission₁ … remissionₘ
        laser_x laser_y laser_theta robot_x robot_y robot_theta tv rv forward side axis         time host logger_time

Source: the toolkit's own description, Montemerlo, Roy & Thrun (2003).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.recordings.recording import Recording
from coursekit.recordings.rows import in_order, lines_of, read_text, to_numbers
from coursekit.recordings.tables import Table, as_table

Row = dict[str, Any]
_DEGREES = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5}  # between the beams of the usual FLASER, which does not say it
_POSE = ("x_odometry", "y_odometry", "theta_odometry")


def read_carmen(path: str | Path, max_range: float = 80.0) -> Recording:
    r"""A CARMEN log → Recording: ODOM lines are the track, FLASER and ROBOTLASER1 lines the stream ``scan``.

    A scan has angles and ranges (n, beams), in radians and metres, and the odometry's pose of the robot at that moment.
    Where a log has no ODOM, its track is the scans' poses, with the speeds that a ROBOTLASER1 tells.  Other messages
    are not read.  Lines that are cut short, hold text or NaN, have another number of beams than the first scan, or a
    stamp that runs backwards are dropped and counted.

    Parameters
    ----------
    max_range : metres; a FLASER's range of 0, or of that and more, is ``inf``: nothing there.  A ROBOTLASER1 tells its
        own.

    Raises FileNotFoundError, or ValueError for a file that is empty, binary or not UTF-8, for one without a usable line
    and for a max_range that is not positive.

    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp(), "drive.log")
    >>> scan = "FLASER 3 2 81.9 4 1 0 0.1 1 0 0.1 10.1 robot 0.2"
    >>> _ = file.write_text(f"ODOM 1.0 0.0 0.1 0.5 0.2 0 10.0 robot 0.1\n{scan}\n")
    >>> log = read_carmen(file)
    >>> log.odometry, log.streams["scan"]["ranges"], log.streams["scan"]["angles"].round(3)
    (array([[0.5, 0.2]]), array([[ 2., inf,  4.]]), array([[-1.571,  0.   ,  1.571]]))
    """
    if not max_range > 0:
        raise ValueError(f"max_range: expected metres > 0, got {max_range}")
    path, dropped = Path(path), Counter[str]()
    found: dict[str, list[Row]] = {"ODOM": [], "FLASER": [], "ROBOTLASER1": []}
    for line in lines_of(read_text(path)):
        name, *fields = line.split() or [""]
        if name not in found:
            continue
        row = _row(name, fields, max_range)
        if isinstance(row, str):
            dropped[f"{name}: {row}"] += 1
        else:
            found[name].append(row)
    laser = "ROBOTLASER1" if found["ROBOTLASER1"] else "FLASER"
    if laser == "ROBOTLASER1" and found["FLASER"]:
        dropped["FLASER: the log has ROBOTLASER1, too"] = len(found["FLASER"])
    odom, scans = (_table(name, found[name], dropped) for name in ("ODOM", laser))
    if not odom and not scans:
        raise ValueError(
            f"{path}: expected ODOM, FLASER or ROBOTLASER1 lines, got none that is usable; {dict(dropped)}"
        )
    track = odom or {name: column for name, column in scans.items() if name not in ("angles", "ranges")}
    scan = {name: column for name, column in scans.items() if not name.startswith(("v_", "omega_"))}
    return Recording(track, {}, {"scan": scan} if scan else {}, {why: n for why, n in dropped.items() if n})


def _table(name: str, rows: Sequence[Row], dropped: Counter[str]) -> Table:
    """The rows that have as many beams as the first and stamps in order."""
    alike = [row for row in rows if np.shape(row.get("ranges", 0)) == np.shape(rows[0].get("ranges", 0))]
    kept = in_order([float(row["time"]) for row in alike])
    dropped[f"{name}: another number of beams than the first"] += len(rows) - len(alike)
    dropped[f"{name}: the stamp runs backwards"] += int(np.sum(~kept))
    return as_table([row for row, good in zip(alike, kept, strict=True) if good])


def _row(name: str, fields: Sequence[str], max_range: float) -> Row | str:
    """A line as a row, or why it is none."""
    if len(fields) < 4:
        return "a line that is cut short"
    numbers, reason = to_numbers([*fields[:-2], fields[-1]])  # all but the host
    if reason:
        return reason
    *body, time, _ = numbers
    if name == "ODOM":
        if len(body) != 6:
            return "a line that is cut short"
        return {"time": time, "v_odometry": body[3], "omega_odometry": body[4], **dict(zip(_POSE, body, strict=False))}
    return _flaser(body, time, max_range) if name == "FLASER" else _robotlaser(body, time)


def _flaser(body: Sequence[float], time: float, max_range: float) -> Row | str:
    n = int(body[0])
    if n < 2 or len(body) != 1 + n + 6:
        return "a line that is cut short"
    step = np.deg2rad(_DEGREES[n]) if n in _DEGREES else np.pi / (n - 1)
    return _scan(time, -np.pi / 2 + step * np.arange(n), body[1 : 1 + n], max_range, body[-3:], ())


def _robotlaser(body: Sequence[float], time: float) -> Row | str:
    n = int(body[7]) if len(body) > 8 else 0
    if n < 2 or len(body) < 9 + n or len(body) != 9 + n + int(body[8 + n]) + 11:
        return "a line that is cut short"
    _, start, _, step, limit = body[:5]
    return _scan(time, start + step * np.arange(n), body[8 : 8 + n], limit, body[-8:-5], body[-5:-3])


def _scan(
    time: float,
    angles: ArrayLike,
    ranges: Sequence[float],
    limit: float,
    pose: Sequence[float],
    speeds: Sequence[float],
) -> Row:
    far = np.asarray(ranges)
    named = dict(zip(("v_odometry", "omega_odometry"), speeds, strict=False))
    return {"time": time, **named, **dict(zip(_POSE, pose, strict=True)),
            "angles": angles, "ranges": np.where((far < limit) & (far > 0), far, np.inf)}  # fmt: skip
