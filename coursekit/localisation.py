r"""A filter over a recording: events in the order of their stamps, and instruments that are calibrated on the way.

A real robot's numbers are not what their names say.  On the MRCLAM recordings the turn rate is what was *commanded*,
about an eighth more than the robot turns, and the "range" is, as in the report of labs 1 to 3, a depth: it lacks the
1/cos of the bearing.  Neither is told to this filter.  Four more numbers stand in its state and are learnt from the
innovations, while it drives:

    x = [x, y, θ, κ, λ, b, p]:  the robot runs at λ v and turns at κ ω;  its camera says range · cos(bearing)^p + b.

κ = λ = 1, b = p = 0 are instruments as one wishes for, and with wide priors that is where the filter starts; p = 1 is a
camera that takes depth for range.  The truth is used for nothing but the start and the score.

>>> from coursekit import datasets
>>> run = datasets.load("mrclam7_robot1")              # doctest: +SKIP
>>> track = localise(run, start_of(run))               # doctest: +SKIP
>>> track.rmse(run) < 0.17                             # doctest: +SKIP
True

Source: Leung, Halpern, Barfoot & Liu (2011) for the recordings; Bar-Shalom, Li & Kirubarajan (2001), section 11.9, for
estimating a parameter by augmenting the state.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive, RangeBearing, pose_residual
from coursekit.recordings import Mrclam

LONGEST_STEP = 0.2  # s: equal controls in a row are driven in one step of at most this
_WIDEST = 1.4  # rad: beyond, cos(bearing)^p is held, for no camera sees there


@dataclass(frozen=True)
class CalibratingDrive:
    """A differential drive that learns what its odometry means: state [x, y, θ, κ, λ, b, p], control [v, ω].

    ``sigma_v`` [m/√s] and ``sigma_omega`` [rad/√s] are intensities: what the wheels add to the variance in a second, in
    however many steps, because a recording's stamps come as they like.  The defaults, a third of the robots' walking
    pace of 0.1 m/s and six degrees, are meant to be generous: a filter that trusts its wheels too much gets lost, one
    that trusts them too little is merely a little worse.  ``sigma_drift`` is how far the other four may wander in √s.
    """

    sigma_v: float = 0.03
    sigma_omega: float = 0.1
    sigma_drift: float = 1e-3

    def f(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """The state after ``dt`` seconds, (7,)."""
        x = np.asarray(x, dtype=float)
        return np.concatenate([self._drive(dt).f(x[:3], self._meant(x, u), dt), x[3:]])

    def F(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """∂f/∂x, (7, 7)."""
        x = np.asarray(x, dtype=float)
        F, drive, meant, (v, omega) = np.eye(7), self._drive(dt), self._meant(x, u), np.asarray(u, dtype=float)
        G = drive.G(x[:3], meant, dt)
        F[:3, :3], F[:3, 3], F[:3, 4] = drive.F(x[:3], meant, dt), G[:, 1] * omega, G[:, 0] * v
        return F

    def Q(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """The wheels' noise on the pose and the drift of the rest, (7, 7)."""
        x = np.asarray(x, dtype=float)
        Q = self.sigma_drift**2 * dt * np.eye(7)
        Q[:3, :3] = self._drive(dt).Q(x[:3], self._meant(x, u), dt)
        return Q

    def sample(self, states: ArrayLike, u: ArrayLike, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 7) → (n, 7)."""
        states, (v, omega) = np.asarray(states, dtype=float), np.asarray(u, dtype=float)
        controls = np.stack([states[:, 4] * v, states[:, 3] * omega], axis=-1)
        poses = self._drive(dt).sample(states[:, :3], controls, dt, rng)
        drift = self.sigma_drift * math.sqrt(dt) * rng.standard_normal((len(states), 4))
        return np.concatenate([poses, states[:, 3:] + drift], axis=1)

    def _drive(self, dt: float) -> DifferentialDrive:
        if not 0 < dt < math.inf:
            raise ValueError(f"dt: expected a time step > 0 s, got {dt}")
        s = 1 / math.sqrt(dt)
        return DifferentialDrive(self.sigma_v * s, self.sigma_omega * s, (0.0, 0.0, 0.0))

    @staticmethod
    def _meant(x: Array, u: ArrayLike) -> Array:
        v, omega = np.asarray(u, dtype=float)
        return np.array([x[4] * v, x[3] * omega])


@dataclass(frozen=True)
class CalibratingRangeBearing:
    """Range and bearing to a landmark [x, y] by a camera that is not sure what its range means; state as above.

    R by default: 0.1 m, for some two pixels in the height of a landmark at four metres, and 0.03 rad.
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2, 0.03**2]))

    def __post_init__(self) -> None:
        ideal = RangeBearing(self.landmark, self.R)
        object.__setattr__(self, "_ideal", ideal)
        object.__setattr__(self, "landmark", ideal.landmark)
        object.__setattr__(self, "R", ideal.R)

    def h(self, x: ArrayLike) -> Array:
        """[range · cos(bearing)^p + b, bearing], (2,)."""
        *pose, _, _, b, p = np.asarray(x, dtype=float).tolist()
        r, bearing = self._seen(pose).tolist()
        return np.array([r * math.cos(_held(bearing)) ** p + b, bearing])

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (2, 7)."""
        *pose, _, _, _, p = np.asarray(x, dtype=float).tolist()
        r, bearing = self._seen(pose).tolist()
        cosine, slope = math.cos(_held(bearing)), math.tan(bearing) if abs(bearing) < _WIDEST else 0.0
        H = np.zeros((2, 7))
        H[:, :3] = self._sensor.H(pose)
        H[0] = cosine**p * (H[0] - r * p * slope * H[1])
        H[0, 5], H[0, 6] = 1.0, r * cosine**p * math.log(cosine)
        return H

    residual = staticmethod(RangeBearing.residual)
    wrap_state = staticmethod(lambda x: np.concatenate([RangeBearing.wrap_state(x[:3]), x[3:]]))

    @property
    def _sensor(self) -> RangeBearing:
        ideal: RangeBearing = self.__dict__["_ideal"]
        return ideal

    def _seen(self, pose: list[float]) -> Array:
        return self._sensor.h(pose)


@dataclass(frozen=True, eq=False)
class Track:
    """What the filter believed, step by step: time [s] (n,), mean (n, 7), cov (n, 7, 7); and of each measurement its
    time (m,) and nis (m,), which is chi-square with 2 degrees of freedom when the filter is honest."""

    time: Array
    mean: Array
    cov: Array
    seen: Array
    nis: Array

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


def start_of(run: Mrclam) -> Gaussian:
    """The true pose where odometry and truth are first both there, known to 0.1 m and 0.1 rad."""
    t = max(run.odometry[0, 0], run.groundtruth[0, 0])
    return Gaussian(truth_at(run, t), np.diag([0.1, 0.1, 0.1]) ** 2)


def truth_at(run: Mrclam, times: ArrayLike) -> Array:
    """The true poses at some times, (..., 3), interpolated between stamps, the heading on the short way round."""
    t, x, y, theta = run.groundtruth.T
    times = np.asarray(times, dtype=float)
    heading = wrap_angle(np.interp(times, t, np.unwrap(theta)))
    return np.stack([np.interp(times, t, x), np.interp(times, t, y), heading], axis=-1)


def localise(
    run: Mrclam,
    start: Gaussian,
    motion: CalibratingDrive | None = None,
    R: ArrayLike | None = None,
    *,
    prior: tuple[float, float, float, float] = (0.2, 0.05, 0.1, 1.0),
    gate: float = 0.99,
) -> Track:
    """Follow a robot among known landmarks through a whole recording.

    Parameters
    ----------
    start : the pose [x, y, θ] at the first odometry that truth accompanies, see ``start_of``.
    motion, R : what the wheels and the camera are believed to add, see the two models.
    prior : standard deviations of κ and λ about 1, of b about 0 m and of p about 0.
    gate : beyond this share of honest measurements they are trusted less and less, but never turned away: see
        ``ekf.correct_robustly``.  Misreadings come in bursts, and beliefs can be wrong; only patience tells which.

    Raises ValueError for a start that is no pose, for a measurement of a landmark whose place is not known, and when
    nothing was recorded after the start.
    """
    if start.mean.shape != (3,):
        raise ValueError(f"start: expected a belief over [x, y, θ], got one over {start.mean.size} numbers")
    if not len(run.odometry) or not len(run.groundtruth):
        raise ValueError(f"run: expected odometry and truth, got {len(run.odometry)} and {len(run.groundtruth)} rows")
    if unknown := set(run.measurements[:, 1].tolist()) - set(run.landmarks):
        raise ValueError(f"run: expected measurements of its landmarks {sorted(run.landmarks)}, got {sorted(unknown)}")
    motion = motion or CalibratingDrive()
    sensors = {k: CalibratingRangeBearing(p) if R is None else CalibratingRangeBearing(p, np.asarray(R))
               for k, p in run.landmarks.items()}  # fmt: skip
    cov = np.zeros((7, 7))
    cov[:3, :3], cov[3:, 3:] = start.cov, np.diag(np.square(prior))
    belief = Gaussian(np.array([*start.mean, 1.0, 1.0, 0.0, 0.0]), cov)
    steps, scores = [], []
    for time, control, dt, sightings in events(run):
        if dt > 0:
            belief = ekf.predict(belief, motion, control, dt)
        for landmark, z in sightings:
            seen = ekf.correct_robustly(belief, sensors[landmark], z, gate=gate)
            belief = seen.belief
            scores.append((time, seen.nis))
        steps.append((time, belief))
    if not steps:
        raise ValueError("run: expected odometry or measurements after the start of the truth, got none")
    times, means, covs = [t for t, _ in steps], [b.mean for _, b in steps], [b.cov for _, b in steps]
    table = np.array(scores).reshape(-1, 2)
    return Track(np.array(times), np.array(means), np.array(covs), table[:, 0], table[:, 1])


def events(run: Mrclam) -> Iterator[tuple[float, Array, float, list[tuple[int, Array]]]]:
    """The recording in the order of time: (stamp, control that held until then, for how long, what was seen then).

    The robot holds a control until the next one is stamped.  It is driven on to each measurement, to each change of
    the control, and at least every ``LONGEST_STEP``.
    """
    begin = max(run.odometry[0, 0], run.groundtruth[0, 0])
    odometry = run.odometry[run.odometry[:, 0] >= begin]
    measurements = run.measurements[run.measurements[:, 0] >= begin]
    changed = np.ones(len(odometry), dtype=bool)
    changed[1:] = np.any(np.diff(odometry[:, 1:], axis=0) != 0, axis=1)
    stamps = np.unique(np.concatenate([odometry[changed, 0], odometry[-1:, 0], measurements[:, 0]]))
    held = np.searchsorted(run.odometry[:, 0], begin, side="right") - 1  # truth may start after odometry
    now, control, k, m = begin, run.odometry[held, 1:], 0, 0
    for stamp in stamps.tolist():
        for part in range(pieces := max(1, math.ceil((stamp - now) / LONGEST_STEP - 1e-9))):
            until = now + (stamp - now) / (pieces - part)
            sightings = []
            while until >= stamp - 1e-9 and m < len(measurements) and measurements[m, 0] <= stamp:
                sightings.append((int(measurements[m, 1]), measurements[m, 2:]))
                m += 1
            yield until, control, until - now, sightings
            now = until
        while k < len(odometry) and odometry[k, 0] <= stamp:
            control, k = odometry[k, 1:], k + 1


def _held(bearing: float) -> float:
    return min(max(bearing, -_WIDEST), _WIDEST)
