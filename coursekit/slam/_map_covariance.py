"""The covariance of a growing map, changed in place, of which only the lower triangle is kept up to date.

Only for speed: ``tests/slam`` holds ``EkfSlam`` equal to ``PlainSlam``, which multiplies whole matrices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg.blas import dsyr2k, dsyrk

from coursekit.geometry import Array
from coursekit.slam.observations import Indices

POSE: Indices = np.arange(3, dtype=np.intp)


def landmark_rows(landmarks: Indices) -> Indices:
    """Where landmarks stand in the state: two rows each, (k,) → (2k,)."""
    return np.asarray((3 + 2 * landmarks[:, None] + [0, 1]).ravel())


class MapCovariance:
    """P of [x, y, θ, l₁, l₂, …], (n, n)."""

    def __init__(self, pose_cov: Array) -> None:
        self._P = np.asfortranarray(pose_cov)

    @property
    def stored(self) -> Array:
        """P as it is kept: only the lower triangle counts."""
        return self._P

    def block(self, rows: Indices) -> Array:
        """Rows and columns of P, read from the triangle that holds them, (k, k)."""
        return np.asarray(self._P[np.maximum(rows[:, None], rows), np.minimum(rows[:, None], rows)])

    def columns(self, columns: Any) -> Array:
        """Whole columns of P, (n, k): below the diagonal as stored, above it from the rows."""
        out = np.empty((len(self._P), len(columns)), order="F")
        for k, c in enumerate(columns):
            out[c:, k], out[:c, k] = self._P[c:, c], self._P[c, :c]
        return out

    def block_of_landmarks(self, landmarks: Indices) -> Array:
        """The covariance of landmarks with each other, (k,) → (2k, 2k)."""
        return self.block(landmark_rows(landmarks))

    @property
    def pose(self) -> Array:
        """P of the pose, (3, 3)."""
        P = self._P[:3, :3].copy()
        P[0, 1], P[0, 2], P[1, 2] = P[1, 0], P[2, 0], P[2, 1]
        return P

    def pose_and_landmarks(self) -> tuple[Array, Array, Array]:
        """P of the pose (3, 3), of each landmark with the pose (n, 2, 3), of each landmark (n, 2, 2)."""
        a = np.arange(3, len(self._P), 2)
        landmark_cov = np.empty((len(a), 2, 2))
        landmark_cov[:, 0, 0], landmark_cov[:, 1, 1] = self._P[a, a], self._P[a + 1, a + 1]
        landmark_cov[:, 0, 1] = landmark_cov[:, 1, 0] = self._P[a + 1, a]
        return self.pose, self._P[3:, :3].reshape(len(a), 2, 3), landmark_cov

    def move(self, F: Array, pose_cov: Array) -> None:
        """The pose, first in the state, moved on: P_lr Fᵀ beside the new P of the pose, O(n)."""
        k = len(F)
        self._P[k:, :k] = self._P[k:, :k].dot(F.T)
        self._P[:k, :k] = pose_cov

    def downdate(self, W: Array) -> None:
        """P - W Wᵀ, O(n² k)."""
        self._P = dsyrk(-1.0, W, beta=1.0, c=self._P, overwrite_c=1, lower=1)

    def turn(self, g: Array) -> None:
        """C P Cᵀ with C = I + g e_θᵀ, g (n,) without an entry for θ: a rank-two update, O(n²)."""
        theta = self.columns([2])
        b = theta + (0.5 * self._P[2, 2]) * g[:, None]
        self._P = dsyr2k(1.0, np.asfortranarray(g[:, None]), np.asfortranarray(b), beta=1.0, c=self._P,
                         overwrite_c=1, lower=1)  # fmt: skip

    def grow(self, cross: Array, corner: Array) -> None:
        """New rows and columns: ``cross`` (k, n) beside the old P, ``corner`` (k, k) at its end."""
        n, k = len(self._P), len(cross)
        P = np.empty((n + k, n + k), order="F")
        P[:n, :n], P[n:, :n], P[n:, n:] = self._P, cross, corner
        self._P = P

    def keep(self, rows: Indices) -> None:
        """Drop all others: the marginal of a Gaussian."""
        self._P = np.asfortranarray(self._P[np.ix_(rows, rows)])
