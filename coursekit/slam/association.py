r"""Lab 5: which landmark was that?  Nearest neighbours, gates, and joint compatibility.

A rule looks at ``Observations`` (what was measured, what the map expects, and how unsure both are) and answers with one
number for each measurement: the landmark it belongs to, ``NEW``, or ``AMBIGUOUS``.  No landmark is given twice.  A rule
never sees an id, except ``Known``, which sees nothing else.

======================  ===========================================================================================
``Euclidean``           the report's: nearest in metres, whatever the uncertainty; beyond the threshold it is new
``Mahalanobis``         nearest in standard deviations of the innovation, within a chi-square gate
``JointCompatibility``  the largest set of pairs that agree *with each other*, not only each by itself
``Known``               the ids are given
======================  ===========================================================================================

Between "matches" and "new" the last two gates leave a gap on purpose.  One honest measurement in a hundred falls
outside a gate of 0.99; a filter that took each of those for a new landmark would double its map in a minute.  Only
what is farther from every landmark than ``new_landmark_gate`` allows starts a new one; what lies between is
``AMBIGUOUS`` and not used.

>>> rule = Mahalanobis(gate=0.99)
>>> from coursekit.gaussian import Gaussian
>>> from coursekit.models import DifferentialDrive
>>> from coursekit.slam import EkfSlam
>>> slam = EkfSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), rule, n_init=1)
>>> R = np.diag([0.05, 0.01]) ** 2
>>> slam.observe([[2.0, 0.0], [2.0, 0.5]], R).tolist()      # both are new, and get rows 0 and 1 of the map
[0, 1]
>>> slam.observe([[2.02, 0.5], [2.0, -0.01]], R).tolist()   # the same two, in another order
[1, 0]

Against a map that is known beforehand, ``KnownMap`` asks the same rules, and knows the row of each id:

>>> KnownMap({6: [2.0, 0.0], 7: [0.0, 2.5]}).match(slam.pose, [[2.5, 1.57]], R, rule).rows
array([1])

Each rule raises ValueError for a setting out of range and TypeError for one that is no number.

Source: Bar-Shalom & Fortmann (1988), section 6.3; Neira & Tardós (2001).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from coursekit.doors import count, number
from coursekit.ekf import gate_threshold
from coursekit.geometry import Array
from coursekit.slam._branch_and_bound import JointTest, largest_compatible_set
from coursekit.slam.known_map import KnownMap, Matches
from coursekit.slam.observations import AMBIGUOUS, NEW, Association, Indices, Observations

__all__ = [
    "AMBIGUOUS",
    "NEW",
    "Association",
    "Euclidean",
    "Indices",
    "JointCompatibility",
    "Known",
    "KnownMap",
    "Mahalanobis",
    "Matches",
    "Observations",
]


@dataclass(frozen=True)
class Euclidean:
    """Nearest in metres: within ``threshold`` it is that landmark, beyond it is new.

    The report's rule, put the right way round.  It uses neither the robot's uncertainty nor the camera's: no
    threshold is right both near and far, both before and after a turn.

    threshold : metres, > 0; any other raises ValueError.

    >>> Euclidean(0.25)
    Euclidean(threshold=0.25)
    """

    threshold: float

    def __post_init__(self) -> None:
        if not 0 < number(self.threshold, "threshold") < np.inf:
            raise ValueError(f"threshold: expected metres > 0, got {self.threshold}")

    def __call__(self, observations: Observations) -> Indices:
        return _nearest(observations.metres, self.threshold, self.threshold)


@dataclass(frozen=True)
class Mahalanobis:
    """Nearest in standard deviations of the innovation, if it lies within the gate.

    gate : share of honest measurements inside, a probability.
    new_landmark_gate : a measurement outside this larger gate, for every landmark, starts a new one.
    Raises ValueError for gates that are no probabilities, or the second not above the first.

    >>> Mahalanobis(0.999).gate
    0.999

    Source: Bar-Shalom & Fortmann (1988), section 6.3.
    """

    gate: float = 0.99
    new_landmark_gate: float = 1 - 1e-6

    def __post_init__(self) -> None:
        _check_gates(self.gate, self.new_landmark_gate)

    def __call__(self, observations: Observations) -> Indices:
        near, far = gate_threshold(self.gate, 2), gate_threshold(self.new_landmark_gate, 2)
        return _nearest(observations.squared_distances, near, far)


@dataclass(frozen=True)
class JointCompatibility:
    """The largest set of pairs whose innovations agree as a whole; among equals, the one that agrees best.

    Two tags 0.4 m apart and a robot unsure by as much: each measurement by itself may belong to either.  But the
    robot's error is the *same* for both, so the pair as a whole fits one way only.  The search is branch and bound;
    after ``max_nodes`` steps the best so far is taken, which keeps a crowd of measurements affordable.

    gate, new_landmark_gate : as ``Mahalanobis``; a set of k pairs is tested with 2k degrees of freedom.
    max_nodes : sets of pairs that are looked at, at most.  Raises ValueError as ``Mahalanobis``, and below 1.

    >>> JointCompatibility(0.99).max_nodes
    20000

    Source: Neira & Tardós (2001).
    """

    gate: float = 0.99
    new_landmark_gate: float = 1 - 1e-6
    max_nodes: int = 20_000

    def __post_init__(self) -> None:
        _check_gates(self.gate, self.new_landmark_gate)
        count(self.max_nodes, "max_nodes")

    def __call__(self, observations: Observations) -> Indices:
        squared = observations.squared_distances
        near, far = gate_threshold(self.gate, 2), gate_threshold(self.new_landmark_gate, 2)
        # Only pairs that are compatible by themselves can be part of a compatible set.
        options = [[int(j) for j in np.argsort(row) if row[j] < near] for row in squared]
        chosen = np.full(len(squared), AMBIGUOUS, dtype=np.intp)
        chosen[np.all(squared > far, axis=1)] = NEW
        # The measurements with the fewest choices first: their branches are the cheapest to cut.
        order = sorted((i for i, option in enumerate(options) if option), key=lambda i: len(options[i]))
        for i, j in largest_compatible_set(JointTest(observations, options), order, options, self.gate, self.max_nodes):
            chosen[i] = j
        return chosen


@dataclass(frozen=True)
class Known:
    """The ids are given, and believed; an id that was not seen before is a new landmark.

    No tag is in two places: of measurements with one id at one moment at least one is wrong, and nothing says which, so
    all of them are ``AMBIGUOUS`` and the others are used.  Raises ValueError without ids.

    >>> Known()
    Known()
    """

    def __call__(self, observations: Observations) -> Indices:
        ids, labels = observations.ids, observations.labels
        if ids is None:
            raise ValueError("ids: Known() needs the id of each measurement, got none")
        times = Counter(ids)
        return np.array([labels.get(i, NEW) if times[i] == 1 else AMBIGUOUS for i in ids], dtype=np.intp)


def _nearest(distances: Array, near: float, far: float) -> Indices:
    """Each measurement's nearest landmark; of two that want the same one, the nearer gets it."""
    chosen = np.full(len(distances), AMBIGUOUS, dtype=np.intp)
    chosen[np.all(distances > far, axis=1)] = NEW
    taken = set()
    for i, j in zip(*np.unravel_index(np.argsort(distances, axis=None), distances.shape), strict=True):
        if not distances[i, j] <= near:  # NaN, for a landmark under the robot, comes last
            break
        if chosen[i] < 0 and j not in taken:
            chosen[i] = j
            taken.add(j)
    return chosen


def _check_gates(gate: float, new_landmark_gate: float) -> None:
    if not 0 < number(gate, "gate") <= number(new_landmark_gate, "new_landmark_gate") < 1:
        raise ValueError(
            "expected probabilities 0 < gate ≤ new_landmark_gate < 1, "
            f"got gate={gate}, new_landmark_gate={new_landmark_gate}"
        )
