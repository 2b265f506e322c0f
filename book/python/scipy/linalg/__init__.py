"""Factors and solutions of positive definite systems, in NumPy."""

import numpy as np


# Functions of their own, so that an exercise can rule them out under this name, too.
def inv(a):
    """The inverse."""
    return np.linalg.inv(a)


def pinv(a):
    """The pseudo-inverse."""
    return np.linalg.pinv(a)


def cho_factor(a, lower=False):
    """(factor, lower): L with L Lᵀ = a, or U with Uᵀ U = a."""
    factor = np.linalg.cholesky(a)
    return (factor if lower else factor.T), lower


def cho_solve(factored, b):
    """The x with a x = b, from ``cho_factor(a)``."""
    factor, lower = factored
    root = factor if lower else factor.T
    return np.linalg.solve(root.T, np.linalg.solve(root, b))


def block_diag(*blocks):
    """The blocks along the diagonal, zeros elsewhere."""
    blocks = [np.atleast_2d(block) for block in blocks]
    out = np.zeros(np.sum([block.shape for block in blocks], axis=0))
    row = column = 0
    for block in blocks:
        rows, columns = block.shape
        out[row : row + rows, column : column + columns] = block
        row, column = row + rows, column + columns
    return out
