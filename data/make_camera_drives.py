"""Record ``camera_drives.csv``: sixty drives through the lab's room, photographed, as Lab 4's filters get them.

    python data/make_camera_drives.py

Each row is one step of 0.2 s: the true pose at its end, the mean odometry over it, and of each cylinder the range and
bearing that the newest picture gave, empty where none could be measured.  The first row of a drive is its start.  The
camera is that of ``landmark_log.csv``: whole pixels, nothing corrected, pictures 25 to 58 ms old.

The same seeds give the same rows; numbers are rounded to the micrometre and the microradian.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TextIO

import numpy as np

from coursekit.geometry import Array
from coursekit.labs.lab04.runs import COLUMNS, Drives, photographed

FIRST_SEED, DRIVES = 4000, 60


def as_rows(drives: Drives, number: int) -> Array:
    """One drive as rows, (n + 1, 19); the first holds the start alone."""
    n = drives.control.shape[1]
    rows = np.full((n + 1, len(COLUMNS)), np.nan)
    rows[:, 0], rows[:, 1], rows[:, 2:5] = number, drives.dt * np.arange(n + 1), drives.truth[0]
    rows[1:, 5:7], rows[1:, 7:] = drives.control[0], drives.z[0].reshape(n, -1)
    return rows


def write(file: TextIO, drives: int = DRIVES, steps: int = 100) -> None:
    """The header, and one drive after the other."""
    print(*COLUMNS, sep=",", file=file)
    for number in range(drives):
        for row in as_rows(photographed(np.random.default_rng(FIRST_SEED + number), steps), number):
            print(number, *("" if np.isnan(value) else f"{value:.6f}" for value in row[1:]), sep=",", file=file)
        print(f"drive {number + 1} of {drives}", file=sys.stderr)


if __name__ == "__main__":
    with Path(__file__).with_name("camera_drives.csv").open("w", encoding="utf-8", newline="\n") as out:
        write(out)
