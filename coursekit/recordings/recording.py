"""A drive as it was recorded, by the simulated world or by a robot: one kind of log for both.

>>> log = Recording({"time": np.array([0.0, 0.1]), "v_odometry": np.array([0.5, 0.5]), "omega_odometry": np.zeros(2)})
>>> log
Recording(0.1 s; track: 2 rows of v_odometry, omega_odometry)
>>> log.odometry.shape
(2, 2)
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, transform
from coursekit.recordings.mrclam import Mrclam
from coursekit.recordings.tables import Table, plain

TRACK = ("time", "x", "y", "theta", "v", "omega", "v_odometry", "omega_odometry",
         "x_odometry", "y_odometry", "theta_odometry", "v_command", "omega_command")  # fmt: skip
"""The columns that a track may have, in their order."""


@dataclass(frozen=True, repr=False)
class Recording:
    """A drive: what the robot did, what it measured, and what its other sensors saw.

    track : a row for each moment.  time [s]; x, y, theta and v, omega (true pose and speeds, where somebody knows
        them); v_odometry, omega_odometry [m/s, rad/s] (the wheels' speeds over the period that ends then);
        x_odometry, y_odometry, theta_odometry (the pose that the wheels add up to); v_command, omega_command.
    measurements : a row for each thing that was measured: ``time`` or ``stamp``, and the recorder's own columns.
    streams : further tables, by name, each with its own ``time``.  Those with a meaning for ROS tools and robots:
        scan (angles, ranges: (n, beams); inf where nothing was hit), image (image: (n, h, w, 3) BGR or (n, h, w)),
        camera (fx, fy, cx, cy, width, height), tags (id, corners (n, 4, 2) px, or range, bearing), tf (parent, child,
        x, y, z, qx, qy, qz, qw).
    dropped : reason → how many rows or messages were not used for it.

    The simulated world records into it (``coursekit.world.recorder.record``); ``read_bag``, ``read_carmen`` and
    ``read_csv_log`` read real robots into it.
    """

    track: Table
    measurements: Table = field(default_factory=dict)
    streams: dict[str, Table] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=dict)

    @property
    def tables(self) -> dict[str, Table]:
        """All tables by name: track, measurements, and the streams."""
        return {"track": self.track, "measurements": self.measurements, **self.streams}

    @property
    def poses(self) -> Array:
        """True poses, (n, 3).  Raises ValueError where the track has none."""
        return self._columns("x", "y", "theta")

    @property
    def odometry(self) -> Array:
        """Measured [v, ω] over each period, (n, 2).  Raises ValueError where the track has none."""
        return self._columns("v_odometry", "omega_odometry")

    @property
    def odometry_poses(self) -> Array:
        """The poses that the wheels add up to, (n, 3).  Raises ValueError where the track has none."""
        return self._columns("x_odometry", "y_odometry", "theta_odometry")

    @property
    def controls(self) -> Array:
        """Commanded [v, ω], (n, 2).  Raises ValueError where the track has none."""
        return self._columns("v_command", "omega_command")

    def run(
        self,
        landmarks: Mapping[int, ArrayLike],
        start: ArrayLike | None = None,
        T_robot_camera: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Mrclam:
        """The drive as ``localisation.localise`` takes it: odometry, range and bearing by landmark, truth.

        Sightings come from ``measurements``, or from ``streams["tags"]`` where that has no id, range and bearing; those
        without a position and those of ids that are not on the map are dropped and counted.

        Parameters
        ----------
        landmarks : id → [x, y], metres; ``read_map`` reads them.
        start : [x, y, θ] where the robot stood at its first odometry, for a robot that nobody tracked: then this is all
            the truth there is.
        T_robot_camera : [x, y, θ] of the camera on the robot, metres and radians; ranges and bearings are moved from
            there to the robot's centre.

        Raises ValueError when there is no odometry, no such sighting, or for a landmark or pose of another shape.

        >>> track = {"time": [0.0, 0.1], "v_odometry": [0.5, 0.5], "omega_odometry": [0.0, 0.0]}
        >>> seen = {"time": [0.1, 0.1], "id": [6, 9], "range": [2.0, 3.0], "bearing": [0.0, 0.0]}
        >>> run = Recording(track, seen).run({6: [2.0, 0.2]}, start=[0.0, 0.0, 0.0], T_robot_camera=[0.1, 0.0, 0.0])
        >>> run.measurements, run.groundtruth, run.dropped
        (array([[0.1, 6. , 2.1, 0. ]]), array([[0., 0., 0., 0.]]), {'not on the map': 1})
        """
        places = {int(key): np.array(place, dtype=float) for key, place in landmarks.items()}
        if bad := [key for key, place in places.items() if place.shape != (2,) or not np.isfinite(place).all()]:
            raise ValueError(f"landmarks: expected [x, y] in metres for each id, got {places[bad[0]]} for {bad[0]}")
        wanted = ("id", "range", "bearing")
        tables = [self.measurements, self.streams.get("tags", {})]
        seen = next((table for table in tables if all(name in table for name in wanted)), None)
        if seen is None:
            raise ValueError(f"expected id, range and bearing in measurements or tags, got {[list(t) for t in tables]}")
        stamps = seen["time"] if "time" in seen else seen["stamp"]
        sightings = np.stack([np.asarray(c, dtype=float) for c in (stamps, *(seen[name] for name in wanted))], axis=-1)
        placed = np.isfinite(sightings).all(axis=1)
        known = np.isin(sightings[:, 1], list(places))
        sightings = sightings[placed & known]
        r, bearing = sightings[:, 2], sightings[:, 3]
        x, y = transform(_pose(T_robot_camera), np.stack([r * np.cos(bearing), r * np.sin(bearing)], axis=-1)).T
        sightings[:, 2], sightings[:, 3] = np.hypot(x, y), np.arctan2(y, x)
        odometry = self._columns("time", "v_odometry", "omega_odometry")
        if {"x", "y", "theta"} <= self.track.keys():
            truth = self._columns("time", "x", "y", "theta")
        elif self.streams.get("truth"):
            truth = np.stack([self.streams["truth"][name] for name in ("time", "x", "y", "theta")], axis=-1)
        else:
            truth = np.empty((0, 4)) if start is None else np.array([[odometry[0, 0], *_pose(start)]])
        counts = {"a sighting without a position": int(np.sum(~placed)), "not on the map": int(np.sum(placed & ~known))}
        return Mrclam(odometry, sightings, places, truth, {**self.dropped, **{k: n for k, n in counts.items() if n}})

    def save(self, path: str | Path) -> None:
        """Write all tables to one ``.npz``; the same recording gives the same bytes.

        Raises ValueError for a column that only a pickle could hold.
        """
        columns = {f"{name}/{key}": plain(values, key) for name, t in self.tables.items() for key, values in t.items()}
        if self.dropped:
            columns |= {"dropped/reason": np.array([*self.dropped]), "dropped/rows": np.array([*self.dropped.values()])}
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
                    tables.setdefault(table, {})[column] = stored[key]
        except (ValueError, KeyError, AttributeError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path}: expected a recording without pickles, got one that says: {error}") from None
        lost = tables.pop("dropped", {"reason": np.array([]), "rows": np.array([])})
        dropped = dict(zip(lost["reason"].tolist(), lost["rows"].tolist(), strict=True))
        return cls(tables.pop("track"), tables.pop("measurements"), tables, dropped)

    def __repr__(self) -> str:
        def rows(name: str, table: Table) -> str:
            columns = [key for key in table if key not in ("time", "stamp")]
            return f"{name}: {len(next(iter(table.values())))} rows of {', '.join(columns)}"

        time = np.asarray(self.track.get("time", [0.0]))
        parts = [rows(name, table) for name, table in self.tables.items() if table]
        parts += [f"dropped: {count} × {reason}" for reason, count in self.dropped.items() if count]
        return f"Recording({'; '.join([f'{time[-1] - time[0] if len(time) else 0:g} s', *parts])})"

    def _columns(self, *names: str) -> Array:
        if missing := [name for name in names if name not in self.track]:
            raise ValueError(f"the track lacks {', '.join(missing)}; it has {', '.join(self.track)}")
        return np.stack([np.asarray(self.track[name], dtype=float) for name in names], axis=-1)


def _pose(values: ArrayLike) -> Array:
    pose = np.asarray(values, dtype=float)
    if pose.shape != (3,) or not np.isfinite(pose).all():
        raise ValueError(f"start, T_robot_camera: expected a finite [x, y, θ], got {values!r}")
    return pose
