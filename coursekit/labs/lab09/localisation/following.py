"""The filter: predict with what was commanded, correct with what was seen, and say what could not be used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coursekit import ekf
from coursekit.gaussian import Gaussian, check_belief
from coursekit.geometry import Array
from coursekit.labs.lab09.localisation.clock import moments, truth_at
from coursekit.labs.lab09.localisation.instruments import IDEAL, SIZE, CalibratingDrive, CalibratingRangeBearing
from coursekit.models import pose_residual
from coursekit.models.checks import array_of
from coursekit.recordings import Mrclam

_DRIFT = 0.005  # of its prior, what a constant may wander in √s: a seventh of it in a quarter of an hour
_VERDICTS = 20  # of the gate, the last so many
_WIDER = np.diag([1.0, 1.0, 0.5] + [0.0] * (SIZE - 3)) ** 2  # m², m², rad²: what a lost robot knows less


class Refusal(NamedTuple):
    """A measurement that was not used: its stamp [s], the landmark that it named, and why."""

    time: float
    landmark: int
    reason: str


@dataclass(frozen=True, eq=False)
class Track:
    """What the filter believed, step by step: time [s] (n,), mean (n, 10), cov (n, 10, 10).

    seen, nis : of each measurement that could be compared with the map, its time (m,) and NIS (m,) before any of its
        moment was used, chi-square with 2 degrees of freedom when the filter is honest.
    refused : the measurements that were not used, with their reasons.
    lost : when the gate had refused most of the last twenty, and the pose was widened [s].
    """

    time: Array
    mean: Array
    cov: Array
    seen: Array
    nis: Array
    refused: tuple[Refusal, ...] = ()
    lost: tuple[float, ...] = ()

    def errors(self, run: Mrclam) -> Array:
        """Estimated minus true pose wherever there is truth, (k, 3)."""
        known = self._known(run)
        return pose_residual(self.mean[known, :3], truth_at(run, self.time[known]))

    def rmse(self, run: Mrclam) -> float:
        """Root mean square of the position's error in metres, each step counted by how long it lasted."""
        known, e = self._known(run), self.errors(run)
        return float(np.sqrt(np.average(np.sum(e[:, :2] ** 2, axis=1), weights=np.gradient(self.time)[known])))

    def nees(self, run: Mrclam) -> Array:
        """Of the pose, wherever there is truth, (k,): chi-square with 3 degrees of freedom for an honest filter."""
        e, P = self.errors(run), self.cov[self._known(run), :3, :3]
        return np.einsum("ki,ki->k", e, np.linalg.solve(P, e[..., None])[..., 0])

    def _known(self, run: Mrclam) -> Any:
        return (self.time >= run.groundtruth[0, 0]) & (self.time <= run.groundtruth[-1, 0])


def localise(
    run: Mrclam,
    start: Gaussian,
    motion: CalibratingDrive | None = None,
    R: ArrayLike | None = None,
    *,
    prior: Sequence[float] = (0.2, 0.1, 0.1, 1.0, 0.2, 0.1, 0.05),
    gate: float = 0.99,
) -> Track:
    """Follow a robot among known landmarks through a whole recording.

    A measurement that cannot be used is one of ``Track.refused``, with its reason: numbers that no camera gives, a
    landmark that is not on the map, a landmark that one moment shows twice, a surprise outside the gate.  A gate cannot
    tell a wild measurement from a wrong belief.  The share that it refuses can: where most of the last twenty were
    refused it is the belief that is wrong, and its pose is widened by 1 m and 0.5 rad (``Track.lost``).

    Parameters
    ----------
    start : the pose [x, y, θ] at the first odometry that truth accompanies, see ``start_of``.
    motion, R : what the wheels and the camera are believed to add, see the two models.  By default the constants wander
        by a two-hundredth of their prior in √s.
    prior : standard deviations of κ, λ about 1, b [m], p, δ [s], γ [rad/m] and β [rad] about 0; next to nothing, 1e-6,
        for what is known.
    gate : share of honest measurements that is let in, a probability.

    Raises ValueError for a start that is no pose, for a prior that is no seven deviations > 0, and when nothing was
    recorded after the start; TypeError for a start that is no ``Gaussian``.
    """
    check_belief(start, "start")
    if start.mean.shape != (3,):
        raise ValueError(f"start: expected a belief over [x, y, θ], got one over {start.mean.size} numbers")
    if not len(run.odometry) or not len(run.groundtruth):
        raise ValueError(f"run: expected odometry and truth, got {len(run.odometry)} and {len(run.groundtruth)} rows")
    sigmas = array_of(prior, "prior", IDEAL.shape)
    if not np.all(sigmas > 0):
        raise ValueError(f"prior: expected seven standard deviations > 0, got {prior}")
    if motion is None:
        motion = CalibratingDrive(run.odometry, sigma_drift=tuple((_DRIFT * sigmas).tolist()))
    ekf.gate_threshold(gate, 2)  # which says what is wrong with a gate
    sensors = {k: CalibratingRangeBearing(p) if R is None else CalibratingRangeBearing(p, np.asarray(R))
               for k, p in run.landmarks.items()}  # fmt: skip
    cov = np.zeros((SIZE, SIZE))
    cov[:3, :3], cov[3:, 3:] = start.cov, np.diag(sigmas**2)
    belief = Gaussian(np.array([*start.mean, *IDEAL]), cov)
    steps, scores, refused, lost, verdicts = [], [], [], [], [True] * _VERDICTS
    for now, until, sightings in moments(run):
        if until > now:
            belief = ekf.predict(belief, motion, now, until - now)
        if sightings:
            usable, why = _sort(sightings, sensors)
            names = list(usable)
            seen = ekf.correct_together(belief, [sensors[k] for k in names], [usable[k] for k in names], gate=gate)
            belief = seen.belief
            why += [(names[i], rejected.reason) for i, rejected in seen.rejected.items()]
            refused += [Refusal(until, k, reason) for k, reason in why]
            compared = np.isfinite(seen.each)
            scores += [(until, nis) for nis in seen.each[compared].tolist()]
            verdicts = [*verdicts, *(i in seen.used for i in np.flatnonzero(compared).tolist())][-_VERDICTS:]
            if sum(verdicts) < _VERDICTS / 2:
                belief, verdicts = Gaussian(belief.mean, belief.cov + _WIDER), [True] * _VERDICTS
                lost.append(until)
        steps.append((until, belief))
    if not steps:
        raise ValueError("run: expected odometry or measurements after the start of the truth, got none")
    times, means, covs = [t for t, _ in steps], [b.mean for _, b in steps], [b.cov for _, b in steps]
    table = np.array(scores).reshape(-1, 2)
    return Track(
        np.array(times), np.array(means), np.array(covs), table[:, 0], table[:, 1], tuple(refused), tuple(lost)
    )


def _sort(
    sightings: list[tuple[int, Array]], sensors: dict[int, Any]
) -> tuple[dict[int, Array], list[tuple[int, str]]]:
    """What was seen at one moment, by landmark; and which sightings cannot be used, with the reason."""
    seen = Counter(k for k, _ in sightings)
    why = [(k, "no landmark of the map" if k not in sensors else "seen twice at one moment")
           for k, _ in sightings if k not in sensors or seen[k] > 1]  # fmt: skip
    return {k: z for k, z in sightings if k in sensors and seen[k] == 1}, why
