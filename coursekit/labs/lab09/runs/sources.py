"""The three recordings of the lab, or stand-ins; and what a drive says once its instruments are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, wrap_angle
from coursekit.labs.lab09.localisation import events, start_of
from coursekit.labs.lab09.runs import standins
from coursekit.models import DifferentialDrive
from coursekit.recordings import Clouds, Log, Mrclam, datasets
from coursekit.teaching.experiments import lab_seed


@dataclass(frozen=True, eq=False)
class Recordings:
    """The cylinder log, the two clouds and the drive.  ``missing`` is "" where all are real; otherwise all three are
    stand-ins, and it says why, and how to get the real ones."""

    log: Log
    clouds: Clouds
    run: Mrclam
    missing: str

    @property
    def real(self) -> bool:
        """Are these the recordings?"""
        return not self.missing


@cache
def recordings() -> Recordings:
    """Loaded once, from where ``datasets.load`` finds them; stand-ins where it finds them nowhere."""
    try:
        log, clouds, run = (datasets.load(name) for name in ("landmark_log_real", "icp_clouds", "mrclam7_robot1"))
        return Recordings(log, clouds, run, "")
    except datasets.DatasetUnavailable as error:
        rng = np.random.default_rng(lab_seed(9))
        return Recordings(
            datasets.load("landmark_log"), standins.clouds(rng), standins.drive(rng, misread=0.0), str(error)
        )


def commanded(odometry: Array, times: ArrayLike) -> Array:
    """∫ [v, ω] dt up to some times, (..., 2): metres and radians; a command holds until the next is stamped."""
    steps = odometry[:-1, 1:] * np.diff(odometry[:, 0])[:, None]
    until = np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])
    return np.stack([np.interp(np.asarray(times, dtype=float), odometry[:, 0], column) for column in until.T], axis=-1)


def dead_reckoning(run: Mrclam) -> tuple[Array, Array]:
    """Times (n,) and poses (n, 3) by the commands alone, from the true start."""
    arc, pose = DifferentialDrive(), start_of(run).mean
    times, poses = [], []
    for t, control, dt, _ in events(run):
        pose = arc.f(pose, control, dt) if dt > 0 else pose
        times.append(t)
        poses.append(pose)
    return np.array(times), np.array(poses)


def corrected(run: Mrclam, constants: ArrayLike) -> Mrclam:
    """The drive as ideal instruments would have recorded it, for constants [κ, λ, b, p, δ, γ, β].

    Commands are stamped δ later and scaled; a depth becomes a range; bearings count from straight ahead.
    """
    kappa, lam, b, p, delta, gamma, beta = np.asarray(constants, dtype=float)
    t, v, omega = run.odometry.T
    odometry = np.stack([t + delta, lam * v, kappa * omega + gamma * v], axis=-1)
    sightings = run.measurements.copy()
    sightings[:, 2] = (sightings[:, 2] - b) / np.cos(sightings[:, 3]) ** p
    sightings[:, 3] = wrap_angle(sightings[:, 3] + beta)
    return replace(run, odometry=odometry, measurements=sightings[sightings[:, 2] > 0])
