r"""Trajectories to and from the files of other people's tools: TUM (with stamps) and KITTI (without).

>>> import tempfile
>>> drive = Trajectory.planar([0.0, 0.1], [[0.0, 0.0, 0.0], [1.0, 0.5, np.pi / 2]])
>>> path = Path(tempfile.mkdtemp(), "drive.tum")
>>> write_tum(drive, path)
>>> read_tum(path).poses.round(6)
array([[0.      , 0.      , 0.      ],
       [1.      , 0.5     , 1.570796]])

Source: Sturm et al. (2012) for the TUM format; Geiger et al. (2012) for KITTI's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from coursekit.doors import LARGEST, as_numbers
from coursekit.geometry import Array
from coursekit.recordings.rows import BrokenRow, in_order, lines_of, read_text, summary, to_numbers


@dataclass(frozen=True, repr=False)
class Trajectory:
    """Where a robot was, and when.

    time : (n,) seconds, never decreasing.     T_world_robot : (n, 4, 4), poses in space.
    rejected : the lines of the file that were not used, and why.

    Raises ValueError for arrays of other shapes, for what is not finite, for a clock that runs backwards and for a
    matrix that is no pose.

    >>> Trajectory.planar([0.0, 0.1], [[0.0, 0.0, 0.0], [1.0, 0.5, 0.1]])
    Trajectory(2 poses, 0.1 s, 1.12 m)
    """

    time: Array
    T_world_robot: Array
    rejected: tuple[BrokenRow, ...] = ()

    def __post_init__(self) -> None:
        time = as_numbers(self.time, "time").copy()
        T = as_numbers(self.T_world_robot, "T_world_robot").copy()
        if time.ndim != 1 or T.shape != (len(time), 4, 4):
            raise ValueError(f"expected time (n,) and T_world_robot (n, 4, 4), got {time.shape} and {T.shape}")
        if not (np.all(np.abs(time) < LARGEST) and np.all(np.abs(T) < LARGEST)):
            raise ValueError("expected finite stamps and poses, got NaN or infinity")
        if np.any(np.diff(time) < 0):
            i = int(np.argmax(np.diff(time) < 0))
            raise ValueError(f"time: expected stamps that do not decrease, got {time[i]} before {time[i + 1]}")
        if not (good := _are_poses(T)).all():
            i = int(np.argmin(good))
            raise ValueError(f"T_world_robot: expected a rotation over 0 0 0 1, number {i} is none: {T[i].tolist()}")
        for name, values in (("time", time), ("T_world_robot", T)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @classmethod
    def planar(cls, time: ArrayLike, poses: ArrayLike) -> Trajectory:
        """A trajectory of poses [x, y, θ], (n, 3), at z = 0.  Raises as the class does."""
        poses = as_numbers(poses, "poses")
        if poses.ndim != 2 or poses.shape[1] != 3 or not np.all(np.abs(poses) < LARGEST):
            raise ValueError(f"poses: expected finite [x, y, θ], (n, 3), got {poses} of shape {poses.shape}")
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        T = np.tile(np.eye(4), (len(poses), 1, 1))
        T[:, 0, 0], T[:, 0, 1], T[:, 1, 0], T[:, 1, 1] = c, -s, s, c
        T[:, :2, 3] = poses[:, :2]
        return cls(time, T)  # type: ignore[arg-type]  # which makes arrays of what comes

    @property
    def positions(self) -> Array:
        """(n, 3), metres."""
        return self.T_world_robot[:, :3, 3]

    @property
    def poses(self) -> Array:
        """The poses seen from above, [x, y, θ], (n, 3): height, roll and pitch are left out."""
        T = self.T_world_robot
        return np.stack([T[:, 0, 3], T[:, 1, 3], np.arctan2(T[:, 1, 0], T[:, 0, 0])], axis=-1)

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        length = np.linalg.norm(np.diff(self.positions, axis=0), axis=1).sum()
        seconds = self.time[-1] - self.time[0] if len(self) else 0
        dropped = f", {len(self.rejected)} rows dropped" if self.rejected else ""
        return f"Trajectory({len(self)} poses, {seconds:g} s, {length:.2f} m{dropped})"


def read_tum(path: str | Path) -> Trajectory:
    """A TUM file, ``time x y z qx qy qz qw`` a line and # for comments → Trajectory, in seconds and metres.

    Quaternions are brought to length 1.  Lines that are cut short or hold text, NaN or no rotation, and stamps that run
    backwards, are dropped and named in ``rejected``.  Raises FileNotFoundError, or ValueError for a file that is empty,
    binary or not UTF-8, and for one without a usable line.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "drive.tum")
    >>> _ = path.write_text("# time x y z qx qy qz qw\\n0 0 0 0 0 0 0 1\\n1 2 0 0 0 0 0 2\\n2 3 0 0 0 0 0 0\\n")
    >>> read_tum(path)
    Trajectory(2 poses, 1 s, 2.00 m, 1 rows dropped)
    """
    numbered, rejected = _numbers(Path(path), 8)
    turning = [np.linalg.norm(row[4:]) > 0 for _, row in numbered]
    rejected += [BrokenRow(line, "a quaternion of length 0") for (line, _), ok in zip(numbered, turning) if not ok]
    numbered = [pair for pair, ok in zip(numbered, turning, strict=True) if ok]
    kept = in_order([row[0] for _, row in numbered])
    rejected += [BrokenRow(line, "the stamp runs backwards") for (line, _), ok in zip(numbered, kept) if not ok]
    if not kept.any():
        raise ValueError(f"{path}: no usable row; {summary(rejected)}")
    rows = np.array([row for _, row in numbered])[kept]
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = Rotation.from_quat(rows[:, 4:]).as_matrix(), rows[:, 1:4]
    return Trajectory(rows[:, 0], T, tuple(sorted(rejected)))


def write_tum(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory as a TUM file; stamps and positions come back to the bit, rotations to 1e-14.

    Raises TypeError for what is no Trajectory.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "drive.tum")
    >>> write_tum(Trajectory.planar([0.5], [[1.0, 2.0, 0.0]]), path)
    >>> path.read_text().splitlines()[1]
    '0.5 1.0 2.0 0.0 0.0 0.0 0.0 1.0'
    """
    T = _checked(trajectory).T_world_robot
    quaternions = Rotation.from_matrix(T[:, :3, :3]).as_quat() if len(T) else np.empty((0, 4))
    _write(path, np.column_stack([trajectory.time, T[:, :3, 3], quaternions]), "# time x y z qx qy qz qw")


def read_kitti(path: str | Path, times: ArrayLike | str | Path | None = None) -> Trajectory:
    """A KITTI file, the upper three rows of a pose's matrix on each line → Trajectory, in metres.

    Parameters
    ----------
    times : (n,) seconds, or a file with one a line (KITTI's times.txt); one for each line of the poses.  By default the
        line's number, from 0.

    Lines that are cut short or hold text, NaN or no rotation are dropped, with their times, and named in ``rejected``.
    Raises FileNotFoundError, or ValueError for a file that is empty, binary or not UTF-8, for one without a usable
    line, and for another number of times than lines.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "poses.txt")
    >>> _ = path.write_text("1 0 0 0 0 1 0 0 0 0 1 0\\n1 0 0 2 0 1 0 0 0 0 1 0\\n")
    >>> read_kitti(path, times=[0.0, 0.5])
    Trajectory(2 poses, 0.5 s, 2.00 m)
    """
    numbered, rejected = _numbers(Path(path), 12)
    lines = sorted([line for line, _ in numbered] + [row.line for row in rejected])
    if isinstance(times, (str, Path)):
        stamps, broken = _numbers(Path(times), 1)
        if broken:
            raise ValueError(f"{times}: expected one number a line; {summary(broken)}")
        times = [row[0] for _, row in stamps]
    time = np.arange(float(len(lines))) if times is None else np.asarray(times, dtype=float)
    if time.shape != (len(lines),):
        raise ValueError(f"times: expected one for each of the {len(lines)} lines of {path}, got {time.shape}")
    T = np.tile(np.eye(4), (len(numbered), 1, 1))
    T[:, :3] = np.reshape([row for _, row in numbered], (-1, 3, 4))
    good = _are_poses(T)
    rejected += [BrokenRow(line, "a matrix that is no rotation") for (line, _), ok in zip(numbered, good) if not ok]
    if not good.any():
        raise ValueError(f"{path}: no usable row; {summary(rejected)}")
    at = np.searchsorted(lines, [line for line, _ in numbered])
    return Trajectory(time[at[good]], T[good], tuple(sorted(rejected)))


def write_kitti(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory's poses as a KITTI file, to the bit; the stamps have no place in it.

    Raises TypeError for what is no Trajectory.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "poses.txt")
    >>> write_kitti(Trajectory.planar([0.5], [[1.0, 2.0, 0.0]]), path)
    >>> path.read_text()
    '1.0 0.0 0.0 1.0 0.0 1.0 0.0 2.0 0.0 0.0 1.0 0.0\\n'
    """
    _write(path, _checked(trajectory).T_world_robot[:, :3].reshape(-1, 12))


def _numbers(path: Path, width: int) -> tuple[list[tuple[int, list[float]]], list[BrokenRow]]:
    """The lines with ``width`` numbers, and the others that are neither blank nor a comment."""
    good, rejected = [], []
    for line, text in enumerate(lines_of(read_text(path)), start=1):
        entries = text.partition("#")[0].replace(",", " ").split()
        if entries:
            row, reason = to_numbers(entries)
            reason = reason or ("" if len(row) == width else f"a row without exactly {width} numbers")
            good += [] if reason else [(line, row)]
            rejected += [BrokenRow(line, reason)] if reason else []
    return good, rejected


def _write(path: str | Path, rows: Array, *header: str) -> None:
    lines = [*header, *(" ".join(repr(x + 0.0) for x in row) for row in rows.tolist())]
    Path(path).write_bytes(("\n".join(lines) + "\n").encode())


def _checked(trajectory: Trajectory) -> Trajectory:
    if not isinstance(trajectory, Trajectory):
        got = type(trajectory).__name__
        raise TypeError(f"trajectory: expected a Trajectory, got {got}; Trajectory.planar makes one")
    return trajectory


def _are_poses(T: Array) -> np.ndarray:
    """Which of the matrices (n, 4, 4) are poses, (n,); files often hold six digits of a rotation."""
    R = T[:, :3, :3]
    orthonormal = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0) < 1e-3
    return orthonormal & (np.linalg.det(R) > 0) & np.all(T[:, 3] == [0, 0, 0, 1], axis=1)
