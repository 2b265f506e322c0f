"""The search behind ``JointCompatibility``: branch and bound over sets of pairs (Neira & Tardós, 2001).

The nodes of the tree are sets of pairs (measurement, landmark).  At each level one measurement is given one of the
landmarks that it may be, or none.  A set is kept while its joint squared distance νᵀ S⁻¹ ν is within the gate of as
many degrees of freedom as it has numbers.  One more pair adds two rows to the Cholesky factor of S, so a node costs
O(k²) and not O(k³).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg.blas import dtrsv

from coursekit.ekf import gate_threshold
from coursekit.geometry import Array
from coursekit.slam.observations import Observations


class JointTest:
    """The covariance of many innovations at once, and the Cholesky factor of a growing set of them."""

    def __init__(self, observations: Observations, options: list[list[int]]) -> None:
        self.pairs = {pair: k for k, pair in enumerate((i, j) for i, row in enumerate(options) for j in row)}
        used = np.unique([j for _, j in self.pairs]).astype(np.intp)
        Hx, Hl = (H[used] for H in observations.jacobians)
        n = len(used)
        landmark_rows = np.einsum("iab,ibjc,jdc->iajd", Hl, observations.between(used).reshape(n, 2, n, 2), Hl)
        pose_cov, cross_cov, _ = observations.covariances()
        pose_rows = np.einsum("iab,bc,jdc->iajd", Hx, pose_cov, Hx)
        mixed = np.einsum("iab,ibc,jdc->iajd", Hl, cross_cov[used], Hx)
        self.expected_cov = landmark_rows + pose_rows + mixed + mixed.transpose(2, 3, 0, 1)
        self.slot = {int(j): s for s, j in enumerate(used)}
        self.observations = observations

    def extended(self, state: PairSet, i: int, j: int) -> PairSet:
        """The set with (i, j) added: two more rows of the factor, and what they add to the joint distance."""
        slot = self.slot[j]
        S = self.expected_cov[slot, :, slot] + self.observations.R[i]
        innovation = self.observations.innovations[i, j]
        rows = np.empty((2, 0))
        if state.pairs:
            with_set = self.expected_cov[slot][:, [self.slot[b] for _, b in state.pairs]].reshape(2, -1)
            rows = np.stack([dtrsv(state.factor, row, lower=1) for row in with_set])
            S = S - rows @ rows.T
            innovation = innovation - rows @ state.whitened
        L = np.linalg.cholesky(S)
        w = np.array([innovation[0] / L[0, 0], 0.0])
        w[1] = (innovation[1] - L[1, 0] * w[0]) / L[1, 1]
        k = 2 * len(state.pairs)
        factor = np.zeros((k + 2, k + 2), order="F")
        factor[:k, :k], factor[k:, :k], factor[k:, k:] = state.factor, rows, L
        return PairSet((*state.pairs, (i, j)), factor, np.append(state.whitened, w), state.squared + float(w @ w))


@dataclass(frozen=True, eq=False)
class PairSet:
    """A set of pairs, the Cholesky factor of its innovations' covariance, and its joint squared distance."""

    pairs: tuple[tuple[int, int], ...] = ()
    factor: Array = field(default_factory=lambda: np.zeros((0, 0), order="F"))
    whitened: Array = field(default_factory=lambda: np.zeros(0))
    squared: float = 0.0


def largest_compatible_set(
    test: JointTest, order: list[int], options: list[list[int]], gate: float, max_nodes: int
) -> tuple[tuple[int, int], ...]:
    """The pairs of the largest jointly compatible set; among sets of one size, those of the least joint distance.

    order : the measurements in the order in which the tree branches.  options : the landmarks that each may be.
    A branch is left when even pairing every remaining measurement could not beat the best set so far.  One more pair
    never makes the joint distance less, so a branch that could only draw level is left where its distance is no less.
    """
    best, stack, nodes = PairSet(), [(0, PairSet())], 0
    while stack and nodes < max_nodes:
        level, state = stack.pop()
        nodes += 1
        if (len(state.pairs), -state.squared) > (len(best.pairs), -best.squared):
            best = state
        reachable = len(state.pairs) + len(order) - level
        if level == len(order) or (reachable, -state.squared) <= (len(best.pairs), -best.squared):
            continue
        i, taken = order[level], {b for _, b in state.pairs}
        stack.append((level + 1, state))  # the branch in which i is left out, tried last
        threshold = gate_threshold(gate, 2 * len(state.pairs) + 2)
        for j in reversed(options[i]):
            if j not in taken and (longer := test.extended(state, i, j)).squared < threshold:
                stack.append((level + 1, longer))
    return best.pairs
