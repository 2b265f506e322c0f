"""BLAS's triangular systems."""

import numpy as np


def _triangle(a, lower, trans):
    half = np.tril(a) if lower else np.triu(a)
    return half.T if trans else half


def dtrsv(a, x, lower=0, trans=0):
    """The y with op(a) y = x."""
    return np.linalg.solve(_triangle(a, lower, trans), x)


def dtrsm(alpha, a, b, side=0, lower=0, trans_a=0):
    """The Y with op(a) Y = alpha b; with side, Y op(a) = alpha b."""
    half = _triangle(a, lower, trans_a)
    return alpha * (np.linalg.solve(half.T, np.transpose(b)).T if side else np.linalg.solve(half, b))
