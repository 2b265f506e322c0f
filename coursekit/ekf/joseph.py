"""Joseph's form of the correction, for covariances of which a measurement leaves next to nothing."""

from __future__ import annotations

import numpy as np

from coursekit.gaussian import factored
from coursekit.geometry import Array

_SMALLEST_R = 1e-26  # of S: rounding of K moves H P Hᵀ by some 1e-31 of itself, and R must stand out of that


def joseph(P: Array, H: Array, R: Array, S: Array) -> tuple[Array, Array]:
    """(I - K H) P (I - K H)ᵀ + K R Kᵀ, which no rounding of K can make indefinite (Bucy & Joseph, 1968); its factor."""
    sigma = np.sqrt(S.diagonal())
    if np.linalg.eigvalsh(R / np.outer(sigma, sigma))[0] < _SMALLEST_R:
        raise ValueError(f"R: too small beside the belief's covariance: 64-bit numbers cannot hold what is left.\n"
                         f"R is\n{R}\nand H P Hᵀ is\n{S - R}")  # fmt: skip
    K = np.linalg.solve(S, H @ P).T
    AL = (np.eye(len(P)) - K @ H) @ np.linalg.cholesky(P)
    KL = K @ np.linalg.cholesky(R)
    return factored(AL @ AL.T + KL @ KL.T)
