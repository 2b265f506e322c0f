r"""Fewer and cheaper iterations, same answer: begin with a few points, and look ahead along the way.

Source: Walker & Ni (2011) for Anderson's mixing as a fixed-point accelerator; Pavlov, Ovchinnikov, Derbyshev,
Tsetserukou & Oseledets (2018) and Zhang, Yao & Deng (2021) for its use in ICP, with the safeguard.
"""

from __future__ import annotations

import numpy as np

from coursekit.geometry import Array
from coursekit.icp.fit import move, point_to_point


def subset_sizes(n: int, smallest: int = 64, growth: int = 8) -> list[int]:
    """How many points to look at, stage by stage: …, n/growth, n; never fewer than ``smallest``."""
    sizes = [n]
    while sizes[-1] // growth >= smallest:
        sizes.append(sizes[-1] // growth)
    return sizes[::-1]


def quasi_random_subset(n: int, size: int) -> np.ndarray:
    """``size`` of the indices 0 … n-1, sorted: evenly spread by the golden ratio, so in step with no scanner's rows."""
    if size >= n:
        return np.arange(n)
    return np.unique((n * np.mod(np.arange(size) * 0.6180339887498949, 1)).astype(np.int64))


class Anderson:
    """Anderson's mixing for ICP's fixed-point iteration T ← G(T).

    If the iteration were linear, its last few steps would give the fixed point away: the combination of them whose
    step would be zero.  ``propose`` solves for that combination.  A rigid motion is written as what it does to
    a few anchor points (as far from the centre as the cloud is wide), so combining motions is combining points,
    the length of a difference is metres moved, and the way back to a motion is ICP's own closed form.
    """

    def __init__(self, cloud: Array, memory: int = 5) -> None:
        centre = cloud.mean(axis=0)
        d = cloud.shape[1]
        arms = np.sqrt(np.mean((cloud - centre) ** 2) * d) * np.vstack([np.eye(d), -np.eye(d)])
        self.anchors, self.memory = centre + arms, memory
        self.forget()

    def forget(self) -> None:
        self._steps: list[Array] = []
        self._images: list[Array] = []

    def step_length(self, before: Array, after: Array) -> float:
        """How far a change of motion moves the cloud, RMS metres."""
        return float(np.sqrt(np.mean(np.sum((move(after, self.anchors) - move(before, self.anchors)) ** 2, axis=1))))

    def propose(self, T: Array, G_T: Array) -> Array:
        """Where the iteration seems to be heading, from T, G(T) and what came before."""
        image = move(G_T, self.anchors).ravel()
        self._images = [*self._images[-self.memory :], image]
        self._steps = [*self._steps[-self.memory :], image - move(T, self.anchors).ravel()]
        if len(self._steps) == 1:
            return G_T
        step_changes, image_changes = np.diff(self._steps, axis=0).T, np.diff(self._images, axis=0).T
        share = np.linalg.lstsq(step_changes, self._steps[-1], rcond=1e-6)[0]
        ahead = image - image_changes @ share
        return point_to_point(self.anchors, ahead.reshape(self.anchors.shape))
