"""One recording, many filters: each knows some of the instruments' constants and takes the others for ideal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.geometry import Array
from coursekit.labs.lab09.localisation import (
    IDEAL,
    CalibratingDrive,
    CalibratingRangeBearing,
    moments,
    start_of,
    truth_at,
)
from coursekit.labs.lab09.runs.sources import recordings
from coursekit.models import pose_residual
from coursekit.recordings import Mrclam

SYMBOLS = "κλbpδγβ"
PRIOR = np.array([0.2, 0.1, 0.1, 1.0, 0.2, 0.1, 0.05])  # σ of each, where it is learnt
R = np.diag([0.1, 0.03]) ** 2  # m², rad²: what ``CalibratingRangeBearing`` starts from
KNOWN = {"none": "", "p": "p", "p, δ": "pδ", "p, δ, b": "pδb", "p, δ, b, λ": "pδbλ", "all seven": SYMBOLS}
SCALES = (1 / 4, 1.0, 4.0)  # of R
SETTINGS = [(known, scale) for known in KNOWN.values() for scale in SCALES]
ALONE = [(s, 1.0) for s in SYMBOLS if (s, 1.0) not in SETTINGS]
WITHOUT = [(SYMBOLS.replace(s, ""), 1.0) for s in SYMBOLS]


@dataclass(frozen=True, eq=False)
class Followed:
    """One filter's track: time (n,) in s from the start, error (n, 3), sigma (n,) of the position in m, nees (n,);
    nats and nis: log density of a sighting, and its NIS, both averages that need no truth."""

    time: Array
    error: Array
    sigma: Array
    nees: Array
    nats: float
    nis: float

    @property
    def rmse(self) -> float:
        """Of the position, m; each step counts for as long as it lasted."""
        squares = np.sum(self.error[:, :2] ** 2, axis=1)
        return float(np.sqrt(np.average(squares, weights=np.gradient(self.time))))

    @property
    def inside(self) -> float:
        """Share of the steps whose NEES is below the 95 % quantile of χ² with 3 degrees of freedom."""
        return float(np.mean(self.nees < ekf.gate_threshold(0.95, 3)))


@cache
def believed() -> dict[tuple[str, float], Followed]:
    """Every setting (constants that are learnt, scale of R) on the recorded drive, all filtered at once."""
    settings = [*SETTINGS, *ALONE, *WITHOUT]
    return dict(zip(settings, follow(recordings().run, settings), strict=True))


def follow(run: Mrclam, settings: list[tuple[str, float]]) -> list[Followed]:
    """One filter for each setting, side by side through the recording; no gate, and constants that do not wander."""
    n, start = len(settings), start_of(run)
    cov = np.zeros((n, 10, 10))
    cov[:, :3, :3] = start.cov
    for i, (known, _) in enumerate(settings):
        learnt = np.array([s in known for s in SYMBOLS])
        cov[i, range(3, 10), range(3, 10)] = np.where(learnt, PRIOR, 1e-6) ** 2
    motion = CalibratingDrive(run.odometry, sigma_drift=(0.0,) * 7)
    sensors = {k: CalibratingRangeBearing(place) for k, place in run.landmarks.items()}
    Rs = np.array([scale * R for _, scale in settings])
    belief = Gaussian(np.tile([*start.mean, *IDEAL], (n, 1)), cov)
    times, means, covs, nats, scores = [], [], [], [], []
    for now, until, sightings in moments(run):
        if until > now:
            belief = ekf.predict(belief, motion, np.array(now), until - now)
        for k, z in sightings:
            seen = ekf.correct(belief, sensors[k], z, Rs)
            belief = seen.belief
            scores.append(seen.nis)
            nats.append(-0.5 * (seen.nis + np.log(np.linalg.det(2 * np.pi * seen.innovation_cov))))
        times.append(until)
        means.append(belief.mean[:, :3])
        covs.append(belief.cov[:, :3, :3])
    time = np.array(times)
    there = time <= run.groundtruth[-1, 0]
    error = pose_residual(np.array(means)[there], truth_at(run, time[there])[:, None])
    P = np.array(covs)[there]
    nees = np.sum(error * np.linalg.solve(P, error[..., None])[..., 0], axis=-1)
    sigma = np.sqrt(P[..., 0, 0] + P[..., 1, 1])
    return [Followed(time[there] - time[0], error[:, i], sigma[:, i], nees[:, i], *averages)
            for i, averages in enumerate(zip(np.mean(nats, axis=0), np.mean(scores, axis=0), strict=True))]  # fmt: skip
