"""A recording as a ROS 2 bag, so that rviz, PlotJuggler and Foxglove can play a drive of the simulated world.

Needs the package rosbags: ``pip install 'coursekit[ros]'``.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from coursekit.recordings.bags import CONTENTS, EXACT
from coursekit.recordings.recording import Recording
from coursekit.recordings.ros_messages import Messages, row_time, type_store
from coursekit.recordings.tables import Table

TOPICS = {
    "/odom": "nav_msgs/msg/Odometry",
    "/ground_truth": "nav_msgs/msg/Odometry",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/camera/image_raw": "sensor_msgs/msg/Image",
    "/camera/camera_info": "sensor_msgs/msg/CameraInfo",
    "/tag_detections": "apriltag_msgs/msg/AprilTagDetectionArray",
}
"""What ``write_bag`` writes, where the recording has it."""
LATEST = 2**31  # seconds that a ROS stamp can hold


def write_bag(recording: Recording, path: str | Path, storage: str = "mcap") -> Path:
    """Write a recording as a ROS 2 bag: a new folder ``path`` with the messages and their metadata.

    The track becomes /odom, /ground_truth, /cmd_vel and the transforms map → odom → base_link on /tf; the streams scan,
    image, camera and tags become the messages of ``TOPICS``.  Beside them, topics below /coursekit/ carry each row as
    it was, as JSON: with them ``read_bag`` gives back the same recording to the bit, where a LaserScan would round to
    32 bits and a quaternion would turn a heading in its last digit.  (Every number
    comes back with 64 bits.)

    Parameters
    ----------
    storage : "mcap" or "sqlite3".

    Returns the folder.  Raises ImportError without rosbags, FileExistsError for a path that is there already, and
    ValueError for another storage, for stamps that ROS cannot hold and for columns that are not what ``Recording``
    says; nothing is left behind then.

    >>> import tempfile
    >>> track = {"time": np.array([0.1, 0.2]), "v_odometry": np.array([0.5, 0.5]), "omega_odometry": np.zeros(2)}
    >>> bag = write_bag(Recording(track), Path(tempfile.mkdtemp(), "drive"))
    >>> sorted(file.suffix for file in bag.iterdir())
    ['.mcap', '.yaml']
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    plugins = {"mcap": StoragePlugin.MCAP, "sqlite3": StoragePlugin.SQLITE3}
    if storage not in plugins:
        raise ValueError(f"storage: expected mcap or sqlite3, got {storage!r}")
    path = Path(path)
    if path.exists():
        raise FileExistsError(f"{path}: there is something already; a bag is written as a new folder")
    store = type_store()
    try:
        with Writer(path, version=8, storage_plugin=plugins[storage]) as writer:
            connections: dict[str, Any] = {}
            for topic, msgtype, time, message in sorted(_messages(recording, Messages(store)), key=lambda m: m[2]):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, msgtype, typestore=store)
                writer.write(connections[topic], time, store.serialize_cdr(message, msgtype))
    except BaseException:
        shutil.rmtree(path, ignore_errors=True)
        raise
    return path


def _messages(recording: Recording, make: Messages) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, type, nanoseconds and message of everything in the recording."""
    began = min((row_time(_rows(table, name)[0]) for name, table in recording.tables.items() if table), default=0)
    contents = {"tables": [*recording.tables], "dropped": recording.dropped}
    yield CONTENTS, "std_msgs/msg/String", began, make.text(json.dumps(contents))
    for name, table in recording.tables.items():
        for row in _rows(table, name):
            own = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in row.items() if (name, k) != _PIXELS}
            yield f"{EXACT}{name}", "std_msgs/msg/String", row_time(row), make.text(json.dumps(own))
    shown = {"track": make.track, "scan": make.scan, "image": make.image, "camera": make.camera, "tags": make.tags}
    for name, convert in shown.items():
        table = recording.tables.get(name, {})
        groups = _by_time(_rows(table, name)) if name == "tags" else ([row] for row in _rows(table, name))
        for rows in groups:
            for topic, message in convert(rows):
                yield topic, TOPICS[topic], row_time(rows[0]), message


_PIXELS = ("image", "image")


def _rows(table: Table, name: str) -> list[dict[str, Any]]:
    """The rows of a table, numbers as Python has them.  Raises ValueError for one without stamps that ROS can hold."""
    if not table:
        return []
    clock = "time" if "time" in table else "stamp"
    stamps = np.asarray(table.get(clock, [np.nan]), dtype=float)
    if not np.all((stamps >= 0) & (stamps < LATEST)):
        raise ValueError(f"{name}: expected stamps of 0 to 2³¹ s in time or stamp, got {list(table)}, {stamps[:3]}")
    columns = [column.tolist() if np.ndim(column) == 1 else column for column in map(np.asarray, table.values())]
    return [dict(zip(table, values, strict=True)) for values in zip(*columns, strict=True)]


def _by_time(rows: list[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    """Rows of one moment together, as one message holds all the tags of a picture."""
    group: list[dict[str, Any]] = []
    for row in rows:
        if group and row_time(row) != row_time(group[0]):
            yield group
            group = []
        group.append(row)
    if group:
        yield group
