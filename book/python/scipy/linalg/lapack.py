"""LAPACK's Cholesky factor, which tells rather than raises when there is none."""

import numpy as np


def dpotrf(a, lower=0):
    """(factor, info): info is 0 for a positive definite a, of which one triangle is read."""
    half = np.tril(a) if lower else np.triu(a).T
    try:
        # An entry that is not finite: LAPACK finds no positive pivot, NumPy returns NaN.
        root = np.linalg.cholesky(half + np.tril(half, -1).T)
        info = 0 if np.isfinite(root.diagonal()).all() else 1
    except np.linalg.LinAlgError:
        root, info = half, 1
    return (root if lower else root.T), info
