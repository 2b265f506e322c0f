"""Least squares for a few unknowns."""

from types import SimpleNamespace

import numpy as np


def least_squares(fun, x0):
    """The x that makes Σ fun(x)² small, by Levenberg and Marquardt's steps with differences for derivatives."""
    x, damping = np.array(x0, dtype=float), 1e-3
    miss = np.asarray(fun(x), dtype=float)
    for _ in range(200):
        steps = 1e-7 * (1 + np.abs(x))
        J = np.stack([(fun(x + d) - fun(x - d)) / (2 * s) for s, d in zip(steps, np.diag(steps))], axis=-1)
        A, g = J.T @ J, J.T @ miss
        step = np.linalg.solve(A + damping * np.diag(A.diagonal() + 1e-12), -g)
        trial = np.asarray(fun(x + step), dtype=float)
        if trial @ trial < miss @ miss:
            x, miss, damping = x + step, trial, damping / 10
        else:
            damping *= 10
        if np.abs(step).max() < 1e-12 * (1 + np.abs(x).max()):
            break
    return SimpleNamespace(x=x, fun=miss, cost=0.5 * miss @ miss)
