"""A particle filter that begins anywhere in the room, on the recorded drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coursekit import particles
from coursekit.geometry import Array
from coursekit.labs.lab09.localisation import (
    CalibratingDrive,
    CalibratingRangeBearing,
    moments,
    truth_at,
)
from coursekit.labs.lab09.runs.believing import R
from coursekit.models import pose_residual
from coursekit.recordings import Mrclam

SIZES = (500, 2000, 8000)
SECONDS = 60.0
MARGIN = 1.0  # m: how far beyond the outermost landmarks the robot may be
SHOWN = 400  # particles of each moment that are kept to be drawn
ROUGHENING = 0.1  # of the cloud's range, see ``particles.roughen``


@dataclass(frozen=True, eq=False)
class Cloud:
    """One moment with a sighting: time [s] from the start, some of the particles (SHOWN, 3), their mean and the truth
    (3,), and how many sightings there have been."""

    time: float
    states: Array
    mean: Array
    truth: Array
    sightings: int

    @property
    def error(self) -> float:
        """Of the mean's position, m."""
        return float(np.hypot(*pose_residual(self.mean, self.truth)[:2]))


def start(run: Mrclam, constants: Array, n: int, rng: np.random.Generator) -> particles.Particles:
    """n poses spread evenly over the room and all headings; every particle has the constants that were learnt."""
    places = np.array(list(run.landmarks.values()))
    low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
    poses = rng.uniform([*low, -np.pi], [*high, np.pi], (n, 3))
    return particles.Particles(np.hstack([poses, np.tile(constants, (n, 1))]), angles=(2,))


def locate(run: Mrclam, constants: Array, n: int, rng: np.random.Generator, seconds: float = SECONDS) -> list[Cloud]:
    """Predict, weigh, resample where few particles are left: the cloud at the start, and after each sighting."""
    cloud, motion = start(run, constants, n, rng), CalibratingDrive(run.odometry, sigma_drift=(0.0,) * 7)
    begin, count = max(run.odometry[0, 0], run.groundtruth[0, 0]), 0
    history = [_seen(cloud, run, begin, 0.0, count, rng)]
    for now, until, sightings in moments(run):
        if until - begin > seconds:
            break
        if until > now:
            cloud = particles.predict(cloud, motion, now, until - now, rng)
        if sightings:
            sensors = [CalibratingRangeBearing(run.landmarks[k], R) for k, _ in sightings]
            cloud = particles.weigh_together(cloud, sensors, [z for _, z in sightings]).cloud
            if particles.effective_sample_size(cloud.weights) < n / 2:
                cloud = particles.roughen(particles.resample(cloud, rng), rng, ROUGHENING)
            count += len(sightings)
            history.append(_seen(cloud, run, until, until - begin, count, rng))
    return history


def _seen(
    cloud: particles.Particles, run: Mrclam, stamp: float, time: float, count: int, rng: np.random.Generator
) -> Cloud:
    some = rng.choice(len(cloud), SHOWN, p=cloud.weights)
    return Cloud(time, cloud.states[some, :3], particles.mean(cloud)[:3], truth_at(run, stamp), count)
