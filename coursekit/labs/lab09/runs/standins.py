"""What the lab shows where the recordings are not there: a drive, clouds and a log with the same faults, made here.

No stand-in takes part in a claim about a recording.  They let the lab run to its end, and their instruments are known.
"""

from __future__ import annotations

import numpy as np

from coursekit import geometry
from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive, range_bearing
from coursekit.recordings import Clouds, Mrclam

# What the stand-in's robot does and its camera says, of the constants that ``CalibratingDrive`` learns.
CONSTANTS = {"κ": 0.95, "λ": 0.94, "b": 0.07, "p": 1.0, "δ": 0.2, "γ": -0.05, "β": 0.0}
TICK, LOOK_EVERY = 0.05, 12  # s; every twelfth tick a picture
FIELD_OF_VIEW = 0.5  # rad to either side
ROOM = np.array([4.0, 3.0])  # m: half of its sides
COMMANDS = np.array([(0.15, 0.0), (0.15, 0.35), (0.15, -0.35), (0.1, 0.45)])  # what the pilot says, m/s and rad/s


def drive(rng: np.random.Generator, seconds: float = 300.0, misread: float = 0.01) -> Mrclam:
    """A robot among 15 landmarks, by commands that it carries out late; a share of the sightings is misread."""
    ids = np.arange(6.0, 21.0)
    places = ROOM * rng.uniform(-1.1, 1.1, (15, 2))
    until, pose, command = 0.0, np.array([0.0, 0.0, 0.5]), COMMANDS[0]
    odometry, sightings, truth = [], [], []
    late = round(CONSTANTS["δ"] / TICK)
    wheels = DifferentialDrive(0.02 / np.sqrt(TICK), 0.04 / np.sqrt(TICK), (0.0, 0.0, 0.0))
    for k in range(round(seconds / TICK)):
        t = 1000.0 + k * TICK
        if t >= until:
            command, until = _next(pose, rng), t + rng.uniform(1.5, 4.0)
        truth.append([t, *pose])
        odometry.append([t, *command])
        if k % LOOK_EVERY == 0:
            sightings += [[t, *row] for row in _look(pose, ids, places, misread, rng)]
        v, omega = odometry[max(k - late, 0)][1:]
        done = [CONSTANTS["λ"] * v, CONSTANTS["κ"] * omega + CONSTANTS["γ"] * v]
        pose = wheels.sample(pose, done, TICK, rng)
    landmarks = dict(zip(map(int, ids), places, strict=True))
    return Mrclam(np.array(odometry), np.array(sightings), landmarks, np.array(truth), {"unknown barcode": 0})


def _next(pose: Array, rng: np.random.Generator) -> Array:
    """A command by chance; near a wall, a turn towards the middle."""
    if np.all(np.abs(pose[:2]) < 0.7 * ROOM):
        return np.array(COMMANDS[rng.integers(len(COMMANDS))])
    home = wrap_angle(np.arctan2(-pose[1], -pose[0]) - pose[2])
    return np.array([0.12, 0.4 * np.sign(home)]) if abs(home) > 0.4 else np.array(COMMANDS[0])


def _look(pose: Array, ids: Array, places: Array, misread: float, rng: np.random.Generator) -> list[list[float]]:
    """Landmark, "range" and bearing of what the camera sees."""
    r, bearing = range_bearing.h(pose, places).T
    rows = []
    for i in np.flatnonzero((np.abs(bearing) < FIELD_OF_VIEW) & (r < 5.0) & (r > 0.3)):
        said = r[i] * np.cos(bearing[i]) ** CONSTANTS["p"] + CONSTANTS["b"]
        name = ids[i] if rng.random() >= misread else rng.choice(ids)
        rows.append([name, said + rng.normal(0, 0.05), bearing[i] + rng.normal(0, 0.015)])
    return rows


def clouds(rng: np.random.Generator) -> Clouds:
    """Two clouds of 5750 points of a wavy sheet, one moved and noisy."""
    x, y = rng.uniform(-1.2, 1.2, (2, 5750))
    target = np.stack([x, y, 0.3 * np.sin(2.5 * x) * np.cos(1.8 * y) + 0.2 * x], axis=-1)
    moved = (target - [0.1, -0.06, 0.05]) @ geometry.so3_exp(np.array([0.06, -0.09, 0.12]))
    return Clouds(moved + rng.normal(0, 0.004, moved.shape), target)
