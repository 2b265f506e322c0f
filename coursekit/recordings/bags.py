"""ROS bags without ROS: ROS 1 and ROS 2 bags and MCAP files, read into the ``Recording`` that the world records.

Needs the package rosbags: ``pip install 'coursekit[ros]'``.  ``bag_writing`` is the way back.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from coursekit.recordings.recording import TRACK, Recording
from coursekit.recordings.ros_rows import KINDS, Row, stamp_of, wheels_from_poses, with_positions
from coursekit.recordings.rows import in_order
from coursekit.recordings.tables import Table, as_table
from coursekit.recordings.topics import choose_topics

EXACT = "/coursekit/"
"""Topics below this name hold a recording's own rows, as JSON: what no ROS message has a place for."""
CONTENTS = "/coursekit"
"""One message with the names of a recording's tables and what its reader had dropped."""
MOST_PIXELS = 2 * 10**9  # bytes of pictures that ``read_bag`` takes into memory


def read_bag(path: str | Path, topics: Mapping[str, str] | Iterable[str] | None = None) -> Recording:
    """A bag → Recording, in seconds, metres and radians.

    odometry becomes the track; truth and command join it where they carry the same stamps, and are streams of their
    own elsewhere; scan, image, camera, tags and tf are streams, with the columns that ``Recording`` names.  A tag's
    range and bearing, where the detector gives poses, are what ``Recording.run`` takes for measurements.

    Stamps are the sensors' own (the header's), or the recorder's where there is none.  A message is dropped and counted
    when its stamp runs backwards (as few as possible, so a clock that jumps costs what came before or after), when it
    cannot be decoded, when it holds NaN where the robot's motion should be, or when a scan or picture has another size
    than the first.  A bag of ``write_bag`` gives back the very recording that was written.

    Parameters
    ----------
    path : a ROS 1 ``.bag``, a ROS 2 folder, or a single ``.mcap`` or ``.db3`` file.
    topics : kind → topic, as in {"odometry": "/wheel_odom", "tags": "/tag_detections"}, or just the topics; only these
        are read.  The kinds are odometry, truth, command, scan, image, camera, tags, tf.  By default a kind's only
        topic is taken, or the one of the usual name (/odom, /scan, …); where that leaves a choice, the kind is left out
        and counted, odometry excepted.

    Raises ImportError without rosbags, FileNotFoundError, or ValueError for a bag that is cut off or no bag, a topic
    that is not in it or of another type, nothing that could be read, and more than 2 GB of pictures (``read_images``
    gives them one by one).

    Source: REP 103 for units and frames, REP 105 for odom and base_link.

    >>> import tempfile
    >>> from coursekit.recordings.bag_writing import write_bag
    >>> track = {"time": np.array([0.1, 0.2]), "v_odometry": np.array([0.5, 0.5]), "omega_odometry": np.zeros(2)}
    >>> bag = write_bag(Recording(track), Path(tempfile.mkdtemp(), "drive"))
    >>> read_bag(bag, topics={"odometry": "/odom"}).odometry
    array([[0.5, 0. ],
           [0.5, 0. ]])
    """
    with _opened(path) as reader:
        known = {c.topic: c.msgtype for c in reader.connections}
        exact = [topic for topic in known if topic.startswith(EXACT)] if topics is None else []
        contents = _own(reader, CONTENTS, Counter()) if topics is None else []
        chosen, dropped = choose_topics(known, topics, path)
        if contents:
            chosen = {kind: names for kind, names in chosen.items() if kind == "image"}
        if not chosen and not contents:
            listed = ", ".join(f"{topic} ({msgtype})" for topic, msgtype in sorted(known.items())) or "no topic"
            raise ValueError(f"{path}: expected a topic that a robot localises with, the bag has {listed}")
        rows, lost = _messages(reader, chosen, path)
        own = {topic.removeprefix(EXACT): _own(reader, topic, lost) for topic in exact}
    dropped.update(lost)
    tables = {kind: _table(kind, found, dropped) for kind, found in rows.items()}
    if contents:
        return _as_written(contents[0], own, tables, dropped)
    if "tags" in tables:
        tables["tags"] = with_positions(tables["tags"], tables.get("tf", {}))
    track, streams = _joined({kind: table for kind, table in tables.items() if table})
    counts = {reason: n for reason, n in dropped.items() if n}
    if not track and not streams:
        said = ", ".join(f"{n} × {reason}" for reason, n in counts.items()) or "none was there"
        raise ValueError(f"{path}: of {', '.join(chosen)}, no message is left; dropped: {said}")
    return Recording(track, {}, streams, counts)


def read_images(path: str | Path, topic: str | None = None) -> Iterator[tuple[float, np.ndarray]]:
    """The pictures of a bag one by one: (stamp in seconds, (h, w, 3) BGR or (h, w)), so that an hour fits in memory.

    topic : which, where the bag has several.  Raises as ``read_bag``.

    >>> import tempfile
    >>> from coursekit.recordings.bag_writing import write_bag
    >>> pictures = {"time": [0.5, 1.0], "image": np.zeros((2, 4, 6, 3), np.uint8)}
    >>> bag = write_bag(Recording({}, {}, {"image": pictures}), Path(tempfile.mkdtemp(), "drive"))
    >>> [(stamp, picture.shape) for stamp, picture in read_images(bag)]
    [(0.5, (4, 6, 3)), (1.0, (4, 6, 3))]
    """
    with _opened(path) as reader:
        known = {c.topic: c.msgtype for c in reader.connections}
        if topic is None and len(pictures := [t for t, kind in known.items() if kind in KINDS["image"].types]) == 1:
            topic = pictures[0]
        if topic is None:
            raise ValueError(f"{path}: expected one topic with pictures, it has {', '.join(pictures) or 'none'}")
        chosen, _ = choose_topics(known, {"image": topic}, path)
        for _, stamp, row in _decoded(reader, chosen, Counter()):
            yield stamp, row["image"]


@contextmanager
def _opened(path: str | Path) -> Iterator[Any]:
    """rosbags' reader of this bag, or an error that says what to do."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such bag")
    files = [p for end in ("*.mcap", "*.db3") for p in path.glob(end)] if path.is_dir() else []
    alone = len(files) == 1 and not (path / "metadata.yaml").exists()  # a recorder that was killed writes no metadata
    try:
        reader = AnyReader([files[0] if alone else path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except Exception as error:  # each of three formats fails in its own ways, for the same few causes
        raise ValueError(
            f"{path}: this is no bag, or one that was cut off ({type(error).__name__}: {error}).  A recording that was "
            "not closed can often be mended: rosbag reindex (ROS 1), ros2 bag reindex (ROS 2), mcap recover (MCAP)"
        ) from error
    try:
        yield reader
    finally:
        reader.close()


def _messages(
    reader: Any, chosen: Mapping[str, list[str]], path: str | Path
) -> tuple[dict[str, list[Row]], Counter[str]]:
    rows: dict[str, list[Row]] = {kind: [] for kind in chosen}
    lost: Counter[str] = Counter()
    pixels = 0
    for kind, stamp, row in _decoded(reader, chosen, lost):
        if kind == "image" and (pixels := pixels + row["image"].nbytes) > MOST_PIXELS:
            raise ValueError(f"{path}: its pictures take more than {MOST_PIXELS / 1e9:g} GB; read them one by one with "
                             f"read_images, and the rest by naming it in topics")  # fmt: skip
        rows[kind].append({"time": stamp, **row})
    return rows, lost


def _decoded(reader: Any, chosen: Mapping[str, list[str]], lost: Counter[str]) -> Iterator[tuple[str, float, Row]]:
    """Kind, stamp and row of each message, in the order in which they were recorded."""
    kind_of = {topic: kind for kind, names in chosen.items() for topic in names}
    connections = [c for c in reader.connections if c.topic in kind_of]
    for connection, received, raw in _raw(reader, connections, lost):
        kind = kind_of[connection.topic]
        try:
            message = reader.deserialize(raw, connection.msgtype)
            rows = list(KINDS[kind].rows(message))
        except Exception as error:  # one message that nobody can decode must not cost the bag
            lost[f"{kind}: {error if isinstance(error, ValueError) else 'a message that cannot be decoded'}"] += 1
            continue
        for row in rows:
            header = row.pop("header", getattr(message, "header", None))
            yield kind, stamp_of(header, received), row


def _table(kind: str, rows: list[Row], dropped: Counter[str]) -> Table:
    """The rows in the order of their stamps: those that are finite, of one size, and do not run backwards."""
    moves = kind in ("odometry", "truth", "command")
    finite = [row for row in rows if not moves or np.all(np.isfinite([*row.values()]))]
    dropped[f"{kind}: NaN or infinity"] += len(rows) - len(finite)
    shapes = [{name: np.shape(value) for name, value in row.items()} for row in finite]
    alike = [row for row, shape in zip(finite, shapes, strict=True) if shape == shapes[0]]
    dropped[f"{kind}: another size than the first"] += len(finite) - len(alike)
    # A transform's publishers run on clocks of their own; each must be in order, not all together.
    groups: dict[Any, list[Row]] = {}
    for row in alike:
        groups.setdefault(row.get("child"), []).append(row)
    kept = [
        row for group in groups.values()
        for row, good in zip(group, in_order([r["time"] for r in group]), strict=True) if good
    ]  # fmt: skip
    dropped[f"{kind}: the stamp runs backwards"] += len(alike) - len(kept)
    return as_table(sorted(kept, key=lambda row: row["time"]))


def _joined(tables: dict[str, Table]) -> tuple[Table, dict[str, Table]]:
    """The track, and what has a clock of its own."""
    if "odometry" in tables:
        tables["odometry"] = wheels_from_poses(tables["odometry"])
    base = next((kind for kind in ("odometry", "truth", "command") if kind in tables), None)
    if base is None:
        return {}, tables
    track = dict(tables.pop(base))
    for kind in ("truth", "command"):
        if kind in tables and np.array_equal(tables[kind]["time"], track["time"]):
            track |= tables.pop(kind)
    return {name: track[name] for name in TRACK if name in track}, tables


def _raw(reader: Any, connections: list[Any], lost: Counter[str]) -> Iterator[tuple[Any, int, bytes]]:
    """The messages of these connections, as far as the file goes; how many it lacks of those that its index names."""
    promised = sum(connection.msgcount for connection in connections)
    messages = reader.messages(connections) if connections else iter(())
    why = "damaged"
    while True:
        try:
            message = next(messages, None)
        except Exception as error:  # the file ends, or makes no sense, where the index promised a message
            message, why = None, f"damaged or cut off: {type(error).__name__}"
        if message is None:
            break
        promised -= 1
        yield message
    if promised > 0 or why != "damaged":
        lost[f"messages that the bag lost ({why})"] += max(promised, 1)


def _own(reader: Any, topic: str, lost: Counter[str]) -> list[Row]:
    connections = [c for c in reader.connections if c.topic == topic]
    return [json.loads(reader.deserialize(raw, c.msgtype).data) for c, _, raw in _raw(reader, connections, lost)]


def _as_written(
    contents: Row, own: dict[str, list[Row]], native: Mapping[str, Table], dropped: Mapping[str, int]
) -> Recording:
    """The recording that ``write_bag`` took apart: its own rows, and pictures from the messages that hold them."""
    tables = {name: as_table(own.get(name, [])) for name in contents["tables"]}
    if "image" in tables and "image" in native:
        n = min(len(tables["image"]["time"]), len(native["image"]["image"]))  # a damaged bag may lack one
        stamps = {name: column[:n] for name, column in tables["image"].items()}
        tables["image"] = {**stamps, "image": native["image"]["image"][:n]}
    counts = {**contents["dropped"], **{reason: n for reason, n in dropped.items() if n}}
    return Recording(tables.pop("track"), tables.pop("measurements"), tables, counts)
