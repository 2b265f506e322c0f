r"""SLAM for recordings: it learns what its instruments mean, bears misreadings, and keeps the way that it came.

A real robot's odometry is what was *commanded*, its camera takes depth for range, and its clocks disagree.  A filter
that is not told takes all of that for a robot that moves strangely.  ``CalibratingSlam`` has five more numbers in its
state (see ``instruments``) and learns them from the innovations while it maps.

The past is in the state, too: every ``spacing`` metres the pose is kept as a copy that has the covariances of the pose.
Whatever is learnt later, at a closed loop above all, corrects these copies as well; ``track`` is the whole way as it is
believed *now*, while ``pose`` after each step is what could be known *then*.

Source: InvariantSlam's, for the correction; Bar-Shalom, Li & Kirubarajan (2001), section 11.9, for parameters in the
state; Roumeliotis & Burdick (2002), for copies of the pose; Huber (1981), section 7.8, for R outside the gate.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.ekf import gate_threshold
from coursekit.gaussian import Gaussian, factored, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.models import MotionModel, range_bearing
from coursekit.models.checks import has_parts, moved
from coursekit.slam._checks import check_share
from coursekit.slam._map_covariance import MapCovariance
from coursekit.slam.consistent_slam import chord
from coursekit.slam.ekf_slam import EkfSlam
from coursekit.slam.instruments import KAPPA, LAMBDA, ROBOT, CalibratedObservations, Instruments, meant, placed, seen
from coursekit.slam.observations import NEW, Association, Indices, Observations

_STRAIGHT = 1e-3  # m and rad: over a correction this small h is straight
_MOST_ITERATIONS = 8
_SETTLED = 3  # iterations after which the softening of R stands still
_TURN = 0.5  # rad: a turn that is worth a copy of the pose


@dataclass(frozen=True, eq=False)
class Track:
    """The way so far, as it is believed now: time [s] since the start (k,), and a belief over each pose (k, 3)."""

    time: Array
    poses: Gaussian


class CalibratingSlam(EkfSlam):
    """``InvariantSlam`` for a real robot: it learns its instruments, softens what surprises, and keeps its way.

    Parameters (others as ``EkfSlam``)
    ----------
    motion : of a pose, with control [v, ω] and with G = ∂f/∂u as well, such as ``DifferentialDrive``; for stamps that
        come as they like ``SteadyNoiseDrive``.
    instruments : what is known of them beforehand.
    gate : beyond this share of honest measurements R grows with the surprise, as in ``ekf.correct_robustly``.
    spacing : metres between two copies of the pose, > 0; math.inf keeps none.  k copies make a step O((n + k)²).

    Raises as ``EkfSlam``, TypeError for a motion without G, and ValueError for a gate or spacing out of range.

    >>> from coursekit.models import DifferentialDrive
    >>> from coursekit.slam.association import Known
    >>> slam = CalibratingSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Known())
    >>> for _ in range(20):
    ...     slam.predict([0.5, 0.0], 0.1)
    >>> slam.observe([[2.0, 0.0]], np.diag([0.05, 0.01]) ** 2, ids=["door"]), slam.rows
    (array([0]), {'door': 0})
    >>> slam.instruments.mean.round(2), slam.track.poses.mean.shape
    (array([1. , 1. , 0. , 0.5, 0. ]), (1, 3))
    """

    def __init__(
        self,
        pose: Gaussian,
        motion: MotionModel,
        associate: Association,
        *,
        instruments: Instruments | None = None,
        gate: float = 0.99,
        spacing: float = 0.3,
        **options: Any,
    ) -> None:
        super().__init__(pose, motion, associate, **options)
        has_parts(motion, "motion", ("f", "F", "Q", "G"))
        if not spacing > 0:
            raise ValueError(f"spacing: expected metres > 0, got {spacing}")
        self._known = Instruments() if instruments is None else instruments
        self._soft, self._spacing = gate_threshold(gate, 2), float(spacing)
        cov = np.diag([1.0] * 3 + [sigma**2 for sigma in self._known.sigma])
        cov[:3, :3] = pose.cov
        self._x, self._P = np.concatenate([pose.mean, self._known.mean]), MapCovariance(cov)
        self._control = np.zeros(2)
        self._starts: list[int] = []  # of each landmark, its first row in the state
        self._copies: list[tuple[int, float]] = []  # of each copy of the pose, its first row and its time

    # What the outside may know.

    @property
    def instruments(self) -> Gaussian:
        """The belief over [κ, λ, b m, p, τ s]."""
        return Gaussian(self._x[3:ROBOT], factored(self._P.block(np.arange(3, ROBOT)))[0])

    @property
    def track(self) -> Track:
        """The way so far.  Raises ValueError before anything was seen."""
        if not self._copies:
            raise ValueError("track: expected at least one observation before the way is asked for")
        rows = np.array([row for row, _ in self._copies])[:, None] + np.arange(3)
        covs = np.array([factored(self._P.block(of_copy))[0] for of_copy in rows])
        return Track(np.array([time for _, time in self._copies]), Gaussian(self._x[rows], covs))

    # How it is done.

    def predict(self, control: ArrayLike, dt: float) -> None:
        """Drive on, at what the odometry is believed to mean.  Arguments as ``EkfSlam.predict``."""
        said = as_numbers(control, "control").copy()
        if said.shape != (2,):
            raise ValueError(f"control: expected [v, ω], got shape {said.shape}")
        u, pose, F = meant(self._x, said), self._x[:3].copy(), np.eye(ROBOT)
        x, F[:3, :3], Q = moved(self.motion, pose, u, dt)
        G = self.motion.G(pose, u, dt)  # type: ignore[attr-defined]
        F[:3, KAPPA], F[:3, LAMBDA] = G[:, 1] * said[1], G[:, 0] * said[0]
        robot = np.arange(ROBOT)
        grown = F @ self._P.block(robot) @ F.T
        grown[:3, :3] += Q
        grown.flat[3 * ROBOT + 3 :: ROBOT + 1] += self._known.drift**2 * float(dt)
        self._watch.time += float(dt)
        try:
            grown, _ = factored(symmetrize(grown))
        except ValueError:
            self._watch.give_up("the covariance of pose and instruments is not positive definite any more")
            return
        self._P.move(F, grown)
        self._x[:3], self._control = x, said

    def observe(self, z: ArrayLike, R: ArrayLike, ids: Sequence[Any] | None = None) -> Indices:
        """As ``EkfSlam.observe``; afterwards the pose is copied if the robot has come far enough."""
        indices = super().observe(z, R, ids)
        since = 0.0
        if self._copies:
            last = self._x[self._copies[-1][0] :][:3]
            turned = abs(float(wrap_angle(self._x[2] - last[2])))
            since = math.inf if turned > _TURN and self._spacing < math.inf else math.dist(self._x[:2], last[:2])
        if since > self._spacing or (not self._copies and self._spacing < math.inf):
            columns = self._P.columns([0, 1, 2])
            self._copies.append((len(self._x), self._watch.time))
            self._x = np.concatenate([self._x, self._x[:3]])
            self._P.grow(columns.T.copy(), columns[:3].copy())
        return indices

    def _observations(self, z: Array, R: Array, ids: Sequence[Any] | None) -> Observations:
        rows = np.array(self._starts, dtype=np.intp)[:, None] + np.arange(2)
        landmarks, robot = self._x[rows].reshape(-1, 2), np.arange(ROBOT)

        def covariances() -> tuple[Array, Array, Array]:
            columns = self._P.columns(robot)
            own = np.array([self._P.block(of_one) for of_one in rows]).reshape(-1, 2, 2)
            return columns[:ROBOT].copy(), columns[rows.ravel()].reshape(-1, 2, ROBOT), own

        pose = self._x[:3].copy()
        return CalibratedObservations(
            z, R, pose, landmarks, (pose, landmarks), covariances, lambda which: self._P.block(rows[which].ravel()),
            ids, self._labels, robot=self._x[:ROBOT].copy(), control=self._control,
        )  # fmt: skip

    def _correct(self, observations: Observations, chosen: Indices) -> None:
        """Gauss-Newton as in ``InvariantSlam``, with R of what surprises made softer."""
        matched = [(i, j) for i, j in enumerate(chosen.tolist()) if j >= 0]
        self.nis, self.dof = 0.0, 0
        if not matched:
            return
        which, js = [i for i, _ in matched], [j for _, j in matched]
        z, R, x, delta, g = observations.z[which], observations.R.copy(), self._x, 0 * self._x, 0 * self._x
        for iteration in range(_MOST_ITERATIONS):
            at = np.array([x[self._starts[j] :][:2] for j in js])
            z_hat, Hx, Hl = seen(x[:ROBOT], self._control, at)
            H = [np.concatenate([a, b], axis=1) for a, b in zip(Hx, Hl, strict=True)]
            for H_j, j in zip(H, js, strict=True):
                H_j[:, 2] += H_j @ g[self._columns(j)]
            moved_on = np.array([H_j @ delta[self._columns(j)] for H_j, j in zip(H, js, strict=True)])
            nu = range_bearing.residual(z, z_hat) + moved_on
            if iteration < _SETTLED:
                nis = self._soften(R, observations.R, H, nu, matched)
            W, w, _ = self._gain(H, nu.ravel(), matched, R)
            before, delta = delta, W.dot(w)
            x, g = self._displaced(delta)
            if np.abs(delta - before).max() < _STRAIGHT:
                break
        self._shift(W, w)
        self.nis, self.dof = nis, 2 * len(matched)

    def _shift(self, W: Array, w: Array) -> None:
        x, g = self._displaced(W.dot(w))
        self._P.downdate(W)
        self._P.turn(g)
        self._x = x
        self._x[2] = wrap_angle(float(x[2]))

    def _soften(self, R: Array, given: Array, H: list[Array], nu: Array, matched: list[tuple[int, int]]) -> float:
        """R of each match, raised to where its surprise is the gate's; the sum of the softened surprises."""
        total = 0.0
        for (i, j), H_j, nu_j in zip(matched, H, nu, strict=True):
            S = H_j @ self._P.block(np.array(self._columns(j))) @ H_j.T + given[i]
            surprise = float(nu_j @ np.linalg.solve(S, nu_j))
            R[i] = given[i] * max(1.0, surprise / self._soft)
            total += surprise
        return total

    def _displaced(self, delta: Array) -> tuple[Array, Array]:
        """The state after a correction, each point along its arc, and g: its move turned by a quarter."""
        points = np.array([0, *self._starts, *(row for row, _ in self._copies)])[:, None] + np.arange(2)
        x, g = self._x + delta, 0 * delta
        move = delta[points] @ chord(delta[2]).T
        x[points] = self._x[points] + move
        g[points] = np.stack([-move[:, 1], move[:, 0]], axis=-1)
        return x, g

    def _columns(self, j: int) -> list[int]:
        return [*range(ROBOT), self._starts[j], self._starts[j] + 1]

    def _inverse(self, z: Array) -> tuple[Array, Array, Array]:
        """Where landmarks seen as z are (n, 2), with the derivatives by the robot (n, 2, 8) and by z (n, 2, 2)."""
        points = placed(self._x[:ROBOT], self._control, z)
        _, Hx, Hl = seen(self._x[:ROBOT], self._control, points)
        by_robot, by_z = np.linalg.solve(Hl, Hx), np.linalg.solve(Hl, np.broadcast_to(np.eye(2), Hl.shape))
        return points, -np.asarray(by_robot), np.asarray(by_z)

    def _check_new(self, z: Array, R: Array, chosen: Indices) -> None:
        new, P = np.flatnonzero(chosen == NEW), self._P.block(np.arange(ROBOT))
        for i, Gx, Gz in zip(new, *self._inverse(z[new])[1:], strict=True):
            noise = Gz @ R[i] @ Gz.T
            check_share(noise, Gx @ P @ Gx.T + noise, 1, R[i])

    def _augment(self, z: Array, R: Array) -> None:
        points, Gx, Gz = self._inverse(z)
        k = len(z)
        cross = Gx.reshape(2 * k, ROBOT) @ self._P.columns(np.arange(ROBOT)).T
        corner = cross[:, :ROBOT] @ Gx.reshape(2 * k, ROBOT).T
        for i, noise in enumerate(Gz @ R @ Gz.swapaxes(1, 2)):
            corner[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += noise
        self._grow(points, cross, corner)
        self._tentative.update({len(self._index) + i: (0, 0) for i in range(k)})
        self._index += [NEW] * k

    def _grow(self, places: Array, cross: Array, corner: Array) -> None:
        self._starts += [len(self._x) + 2 * i for i in range(len(places))]
        super()._grow(places, cross, corner)

    def _own_numbers(self) -> dict[str, Any]:
        known = self._known
        return {
            "starts": np.array(self._starts, dtype=np.intp), "copies": np.array(self._copies).reshape(-1, 2),
            "control": self._control, "known": np.array([known.mean, known.sigma]), "drift": known.drift,
            "gate": np.array([self._soft, self._spacing]),
        }  # fmt: skip

    def _take_own_numbers(self, numbers: Mapping[str, Any]) -> None:
        mean, sigma = (tuple(row) for row in numbers["known"].tolist())
        self._known = Instruments(mean, sigma, float(numbers["drift"]))
        self._starts, self._control = numbers["starts"].tolist(), numbers["control"]
        self._copies = [(int(row), time) for row, time in numbers["copies"].tolist()]
        self._soft, self._spacing = numbers["gate"].tolist()

    def _keep(self, kept: list[int]) -> None:
        gone = [self._starts[j] + a for j in range(len(self._starts)) if j not in kept for a in (0, 1)]
        rows = np.setdiff1d(np.arange(len(self._x)), gone)
        place = {int(row): new for new, row in enumerate(rows)}
        self._x = self._x[rows]
        self._P.keep(rows)
        self._starts = [place[self._starts[j]] for j in kept]
        self._copies = [(place[row], time) for row, time in self._copies]
        self._index = [self._index[j] for j in kept]
        self._tentative = {kept.index(j): counts for j, counts in self._tentative.items() if j in kept}
        self._labels = {name: kept.index(j) for name, j in self._labels.items() if j in kept}

    def _handed_out(self) -> Indices:
        order = sorted((index, j) for j, index in enumerate(self._index) if index != NEW)
        rows = [self._starts[j] + a for _, j in order for a in (0, 1)]
        return np.array([0, 1, 2, *rows], dtype=np.intp)
