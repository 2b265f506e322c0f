"""One robot's run from the UTIAS multi-robot data set: odometry, measurements, landmarks and ground truth."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coursekit.geometry import Array, wrap_angle
from coursekit.recordings.rows import BEYOND, in_order, read_table

ROBOTS = range(1, 6)  # MRCLAM's subjects 1 to 5 are the robots themselves; 6 to 20 are landmarks


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


def read_mrclam(folder: str | Path, robot: int = 1) -> Mrclam:
    r"""The four files of one robot's run, with barcodes translated to landmarks.

    Sightings of other robots, and barcodes that belong to nobody (misreadings), are dropped and counted; so are rows
    that cannot be: a range that is not positive, a bearing beyond a full turn, a barcode or subject that is no whole
    number, a row of the two maps that is there twice.

    Raises FileNotFoundError, or ValueError for a file without a usable row, for a barcode that two subjects carry, a
    subject with two barcodes and a landmark in two places: which of them is right, the file does not say.

    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> for name, text in {"Barcodes": "6 63", "Landmark_Groundtruth": "6 1 2 0.1 0.1", "Robot1_Odometry": "0 0.1 0",
    ...                    "Robot1_Groundtruth": "0 0 0 0", "Robot1_Measurement": "0 63 2.2 1.1\n0 63 -2 1.1"}.items():
    ...     _ = (folder / f"{name}.dat").write_text(text)
    >>> run = read_mrclam(folder)
    >>> run.measurements, run.dropped["Robot1_Measurement.dat: a range that is not positive"]
    (array([[0. , 6. , 2.2, 1.1]]), 1)
    """
    folder = Path(folder)
    dropped: Counter[str] = Counter()

    def table(name: str, width: int, stamped: bool = True) -> Array:
        rows, rejected = read_table(folder / name, width)
        dropped.update(f"{name}: {row.reason}" for row in rejected)
        return usable(rows, in_order(rows[:, 0]), name, "the stamp runs backwards") if stamped else rows

    def usable(rows: Array, good: np.ndarray, name: str, reason: str) -> Array:
        if not good.all():
            dropped[f"{name}: {reason}"] += int(np.sum(~good))
        if not good.any():
            raise ValueError(f"{folder / name}: no usable row; every one has {reason}")
        return rows[good]

    def pairs(name: str, width: int, columns: int) -> Array:
        """A map's rows, each once, with ``columns`` whole numbers in front."""
        rows = table(name, width, stamped=False)
        whole = np.all(rows[:, :columns] % 1 == 0, axis=1)
        rows = usable(rows, whole, name, "a barcode or subject that is no whole number")
        first = np.isin(np.arange(len(rows)), np.unique(rows, axis=0, return_index=True)[1])
        rows = usable(rows, first, name, "a row that is there twice")
        for column, what in enumerate(("subject", "barcode")[:columns]):
            values, counts = np.unique(rows[:, column], return_counts=True)
            if np.any(counts > 1):
                value = values[counts > 1][0]
                lines = [row.tolist() for row in rows[rows[:, column] == value]]
                raise ValueError(f"{folder / name}: expected each {what} once, {value:g} stands in the rows {lines}")
        return rows

    subject_of = {int(barcode): int(subject) for subject, barcode in pairs("Barcodes.dat", 2, 2)}
    landmarks = {int(row[0]): row[1:3] for row in pairs("Landmark_Groundtruth.dat", 5, 1)}
    name = f"Robot{robot}_Measurement.dat"
    sightings = table(name, 4)
    sightings = usable(sightings, sightings[:, 1] % 1 == 0, name, "a barcode or subject that is no whole number")
    sightings = usable(sightings, sightings[:, 2] > 0, name, "a range that is not positive")
    sightings = usable(sightings, np.abs(sightings[:, 3]) <= 2 * np.pi, name, BEYOND)
    sightings[:, 3] = wrap_angle(sightings[:, 3])
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
