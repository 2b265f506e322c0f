r"""Lab 5: which landmark was that?  Nearest neighbours, gates, and joint compatibility.

A rule looks at ``Sightings`` (what was measured, what the map expects, and how unsure both are) and answers with one
number for each measurement: the landmark it belongs to, ``NEW``, or ``UNSURE``.  No landmark is given twice.  A rule
never sees an id, except ``Known``, which sees nothing else.

===================  ==============================================================================================
``Euclidean``        the report's: nearest in metres, whatever the uncertainty; beyond the threshold it is new
``Mahalanobis``      nearest in standard deviations of the innovation, within a chi-square gate
``JointCompatibility``  the largest set of pairs that agree *with each other*, not only each by itself
``Known``            the ids are given
===================  ==============================================================================================

Between "matches" and "new" the last two gates leave a gap on purpose.  One honest measurement in a hundred falls
outside a gate of 0.99; a filter that took each of those for a new landmark would double its map in a minute.  Only
what is farther from every landmark than ``novelty`` allows founds a new one; what lies between is ``UNSURE``, unused.

Source: Bar-Shalom & Fortmann (1988), section 6.3; Neira & Tardós (2001).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsv

from coursekit.ekf import gate_threshold
from coursekit.geometry import Array, wrap_angle
from coursekit.models import RangeBearing

NEW = -1
UNSURE = -2
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Sightings:
    """m measurements of range and bearing, and the n landmarks of a map that they may belong to.

    z (m, 2), R (m, 2, 2) : the measurements and their noise.
    pose (3,), landmarks (n, 2) : the map's mean.
    linearised_at : the pose (3,) and the landmarks (n, 2) where Jacobians are taken.
    covariances : () → covariance of the pose (3, 3), of each landmark with the pose (n, 2, 3), of each landmark
        (n, 2, 2).  A function, for some rules never ask.
    between : indices (k,) → the covariance (2k, 2k) of those landmarks with each other.
    ids, labels : for ``Known`` only: what each measurement says it saw, and the landmark each id stands for.
    """

    z: Array
    R: Array
    pose: Array
    landmarks: Array
    linearised_at: tuple[Array, Array]
    covariances: Callable[[], tuple[Array, Array, Array]]
    between: Callable[[Indices], Array]
    ids: Sequence[Any] | None = None
    labels: Mapping[Any, int] = field(default_factory=dict)

    @cached_property
    def jacobians(self) -> tuple[Array, Array]:
        """∂h/∂pose (n, 2, 3) and ∂h/∂landmark (n, 2, 2) of each landmark."""
        return jacobians(*self.linearised_at)

    @cached_property
    def innovations(self) -> Array:
        """Measurement i minus what landmark j would give, the bearing wrapped, (m, n, 2)."""
        innovations = self.z[:, None, :] - expected(self.pose, self.landmarks)
        innovations[..., 1] = wrap_angle(innovations[..., 1])
        return innovations

    @cached_property
    def squared_distances(self) -> Array:
        """Squared Mahalanobis distances of measurement i from landmark j, (m, n)."""
        Hx, Hl = self.jacobians
        pose_cov, cross_cov, landmark_cov = self.covariances()
        cross = Hl @ cross_cov @ Hx.swapaxes(1, 2)
        landmark_part = Hl @ landmark_cov @ Hl.swapaxes(1, 2)
        known = Hx @ pose_cov @ Hx.swapaxes(1, 2) + cross + cross.swapaxes(1, 2) + landmark_part
        S = known + self.R[:, None]
        a, b, c = S[..., 0, 0], S[..., 0, 1], S[..., 1, 1]
        u, v = self.innovations[..., 0], self.innovations[..., 1]
        return np.asarray((c * u**2 - 2 * b * u * v + a * v**2) / (a * c - b * b))

    @cached_property
    def metres(self) -> Array:
        """How far from landmark j measurement i puts its own landmark, (m, n)."""
        seen = RangeBearing.g(self.pose, self.z)
        return np.linalg.norm(seen[:, None] - self.landmarks, axis=-1)


def expected(pose: Array, landmarks: Array) -> Array:
    """Range and bearing of each landmark, (3,) and (n, 2) → (n, 2): ``RangeBearing.h`` for a whole map.

    The bearing is left as it comes; differences are wrapped where they are taken.
    """
    dx, dy = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    z = np.empty((len(landmarks), 2))
    z[:, 0], z[:, 1] = np.hypot(dx, dy), np.arctan2(dy, dx) - pose[2]
    return z


def jacobians(pose: Array, landmarks: Array) -> tuple[Array, Array]:
    """∂h/∂pose (n, 2, 3) and ∂h/∂landmark (n, 2, 2) of ``expected``."""
    dx, dy = landmarks[:, 0] - pose[0], landmarks[:, 1] - pose[1]
    r = np.maximum(np.hypot(dx, dy), 1e-9)
    H = np.empty((len(landmarks), 2, 3))
    H[:, 0, 0], H[:, 0, 1], H[:, 0, 2] = -dx / r, -dy / r, 0.0
    H[:, 1, 0], H[:, 1, 1], H[:, 1, 2] = dy / r**2, -dx / r**2, -1.0
    return H, -H[:, :, :2]


class Association(Protocol):
    """What SLAM asks of a rule: one landmark, ``NEW`` or ``UNSURE`` for each measurement, no landmark twice."""

    def __call__(self, sightings: Sightings) -> Indices: ...


@dataclass(frozen=True)
class Euclidean:
    """Nearest in metres: within ``threshold`` it is that landmark, beyond it is new.

    The report's rule, put the right way round.  It knows neither how well the robot knows where it is nor how well
    it sees: no threshold is right both near and far, both before and after a turn.
    """

    threshold: float

    def __post_init__(self) -> None:
        if not 0 < self.threshold < np.inf:
            raise ValueError(f"threshold: expected metres > 0, got {self.threshold}")

    def __call__(self, sightings: Sightings) -> Indices:
        return _nearest(sightings.metres, self.threshold, self.threshold)


@dataclass(frozen=True)
class Mahalanobis:
    """Nearest in standard deviations of the innovation, if it lies within the gate.

    gate : share of honest measurements inside, a probability.
    novelty : a measurement outside this larger gate, for every landmark, founds a new one.
    """

    gate: float = 0.99
    novelty: float = 1 - 1e-6

    def __post_init__(self) -> None:
        _check_gates(self.gate, self.novelty)

    def __call__(self, sightings: Sightings) -> Indices:
        near, far = gate_threshold(self.gate, 2), gate_threshold(self.novelty, 2)
        return _nearest(sightings.squared_distances, near, far)


@dataclass(frozen=True)
class JointCompatibility:
    """The largest set of pairs whose innovations agree as a whole; among equals, the one that agrees best.

    Two tags 0.4 m apart and a robot unsure by as much: each measurement by itself may belong to either.  But the
    robot's error is the *same* for both, so the pair as a whole fits one way only.  The search is branch and bound;
    after ``most_nodes`` steps the best so far is taken, which keeps a crowd of measurements affordable.

    Source: Neira & Tardós (2001).
    """

    gate: float = 0.99
    novelty: float = 1 - 1e-6
    most_nodes: int = 20_000

    def __post_init__(self) -> None:
        _check_gates(self.gate, self.novelty)
        if self.most_nodes < 1:
            raise ValueError(f"most_nodes: expected at least 1, got {self.most_nodes}")

    def __call__(self, sightings: Sightings) -> Indices:
        squared = sightings.squared_distances
        near, far = gate_threshold(self.gate, 2), gate_threshold(self.novelty, 2)
        # Only pairs that are compatible by themselves can be part of a compatible set.
        options = [[int(j) for j in np.argsort(row) if row[j] < near] for row in squared]
        chosen = np.full(len(squared), UNSURE, dtype=np.intp)
        chosen[np.all(squared > far, axis=1)] = NEW
        # The measurements with the fewest choices first: their branches are the cheapest to cut.
        order = sorted((i for i, option in enumerate(options) if option), key=lambda i: len(options[i]))
        for i, j in _largest_set(_JointTest(sightings, options), order, options, self.gate, self.most_nodes):
            chosen[i] = j
        return chosen


@dataclass(frozen=True)
class Known:
    """The ids are given, and believed; an id that was not seen before is a new landmark.

    Raises ValueError without ids and for an id that comes twice: no tag is in two places.
    """

    def __call__(self, sightings: Sightings) -> Indices:
        ids, labels = sightings.ids, sightings.labels
        if ids is None:
            raise ValueError("ids: Known() needs the id of each measurement, got none")
        if len(set(ids)) < len(ids):
            doubles = sorted({str(i) for i in ids if list(ids).count(i) > 1})
            raise ValueError(f"ids: expected each landmark once, got two measurements of {', '.join(doubles)}")
        return np.array([labels.get(i, NEW) for i in ids], dtype=np.intp)


def _nearest(distances: Array, near: float, far: float) -> Indices:
    """Each measurement's nearest landmark; of two that want the same one, the nearer gets it."""
    chosen = np.full(len(distances), UNSURE, dtype=np.intp)
    chosen[np.all(distances > far, axis=1)] = NEW
    taken = set()
    for i, j in zip(*np.unravel_index(np.argsort(distances, axis=None), distances.shape), strict=True):
        if distances[i, j] > near:
            break
        if chosen[i] < 0 and j not in taken:
            chosen[i] = j
            taken.add(j)
    return chosen


class _JointTest:
    """The covariance of many innovations at once, and the Cholesky factor of a growing set of them."""

    def __init__(self, sightings: Sightings, options: list[list[int]]) -> None:
        self.pairs = {pair: k for k, pair in enumerate((i, j) for i, row in enumerate(options) for j in row)}
        used = np.unique([j for _, j in self.pairs]).astype(np.intp)
        Hx, Hl = (H[used] for H in sightings.jacobians)
        n = len(used)
        landmark_rows = np.einsum("iab,ibjc,jdc->iajd", Hl, sightings.between(used).reshape(n, 2, n, 2), Hl)
        pose_cov, cross_cov, _ = sightings.covariances()
        pose_rows = np.einsum("iab,bc,jdc->iajd", Hx, pose_cov, Hx)
        mixed = np.einsum("iab,ibc,jdc->iajd", Hl, cross_cov[used], Hx)
        self.known = landmark_rows + pose_rows + mixed + mixed.transpose(2, 3, 0, 1)
        self.slot = {int(j): s for s, j in enumerate(used)}
        self.sightings = sightings

    def extended(self, state: _State, i: int, j: int) -> _State:
        """The set with (i, j) added: two more rows of the factor, and what they add to the joint distance."""
        slot = self.slot[j]
        S = self.known[slot, :, slot] + self.sightings.R[i]
        innovation = self.sightings.innovations[i, j]
        rows = np.empty((2, 0))
        if state.pairs:
            with_set = self.known[slot][:, [self.slot[b] for _, b in state.pairs]].reshape(2, -1)
            rows = np.stack([dtrsv(state.factor, row, lower=1) for row in with_set])
            S = S - rows @ rows.T
            innovation = innovation - rows @ state.whitened
        L = np.linalg.cholesky(S)
        w = np.array([innovation[0] / L[0, 0], 0.0])
        w[1] = (innovation[1] - L[1, 0] * w[0]) / L[1, 1]
        k = 2 * len(state.pairs)
        factor = np.zeros((k + 2, k + 2), order="F")
        factor[:k, :k], factor[k:, :k], factor[k:, k:] = state.factor, rows, L
        return _State((*state.pairs, (i, j)), factor, np.append(state.whitened, w), state.squared + float(w @ w))


@dataclass(frozen=True, eq=False)
class _State:
    """A set of pairs, the Cholesky factor of its innovations' covariance, and its joint squared distance."""

    pairs: tuple[tuple[int, int], ...] = ()
    factor: Array = field(default_factory=lambda: np.zeros((0, 0), order="F"))
    whitened: Array = field(default_factory=lambda: np.zeros(0))
    squared: float = 0.0


def _largest_set(
    test: _JointTest, order: list[int], options: list[list[int]], gate: float, most_nodes: int
) -> tuple[tuple[int, int], ...]:
    best, stack, nodes = _State(), [(0, _State())], 0
    while stack and nodes < most_nodes:
        level, state = stack.pop()
        nodes += 1
        if (len(state.pairs), -state.squared) > (len(best.pairs), -best.squared):
            best = state
        if level == len(order) or len(state.pairs) + len(order) - level < len(best.pairs):
            continue
        i, taken = order[level], {b for _, b in state.pairs}
        stack.append((level + 1, state))  # i belongs to nobody: tried last
        threshold = gate_threshold(gate, 2 * len(state.pairs) + 2)
        for j in reversed(options[i]):
            if j not in taken and (longer := test.extended(state, i, j)).squared < threshold:
                stack.append((level + 1, longer))
    return best.pairs


def _check_gates(gate: float, novelty: float) -> None:
    if not 0 < gate <= novelty < 1:
        raise ValueError(f"expected probabilities 0 < gate ≤ novelty < 1, got gate={gate}, novelty={novelty}")
