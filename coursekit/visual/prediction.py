"""The density of a prediction that is a cloud: what a particle weighs that the motion did not draw."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp

from coursekit.geometry import Array, between
from coursekit.models import MotionModel, pose_residual
from coursekit.models.checks import has_parts
from coursekit.particles import Particles


def log_prediction(states: ArrayLike, before: Particles, motion: MotionModel, control: ArrayLike, dt: float) -> Array:
    r"""log p(x) with  p(x) = Σᵢ wᵢ p(x | xᵢ, u): one bell for each particle, where the motion takes it.

    Each bell is evaluated in the frame of its own particle, xᵢ⁻¹ x, where the motion's mean f(0, u) and its noise
    Q(0, u) are the same for all.

    Parameters
    ----------
    states : (k, 3) poses x at which the density is asked for.
    before : n weighted poses xᵢ before the motion.
    motion : a model over [x, y, θ] whose noise, seen from the robot, is the same everywhere.
    control, dt : as for ``motion.f``.

    Returns (k,), in nats.  It costs k · n evaluations; the filter uses a faster form of the same sum.

    Raises ValueError for states that are not (k, 3), TypeError for what is no cloud and no motion.

    >>> from coursekit.models import DifferentialDrive
    >>> cloud = Particles([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]], np.log([0.75, 0.25]), angles=(2,))
    >>> drive = DifferentialDrive(1.0, 0.1, (1.0, 1.0, 0.1))
    >>> log_prediction([[1.0, 0.0, 0.0], [6.0, 0.0, 0.0]], cloud, drive, [1.0, 0.0], 1.0).round(3)
    array([-1.435, -2.529])

    Source: Klaas, de Freitas & Doucet (2005), "Toward practical N² Monte Carlo: the marginal particle filter".
    """
    if not isinstance(before, Particles):
        raise TypeError(f"before: expected Particles, got {type(before).__name__}")
    has_parts(motion, "motion", ("f", "Q"))
    states = np.asarray(states, dtype=float)
    if states.ndim != 2 or states.shape[1] != 3:
        raise ValueError(f"states: expected shape (k, 3), got {states.shape}")
    origin = np.zeros(3)
    seen_from_particle = between(before.states, states[:, None])  # (k, n, 3)
    residual = pose_residual(seen_from_particle, motion.f(origin, control, dt))
    return np.asarray(logsumexp(before.log_weights + log_normal(residual, motion.Q(origin, control, dt)), axis=1))


def log_normal(residual: Array, cov: Array) -> Array:
    """log N(residual; 0, cov): (..., d) → (...)."""
    factor = np.linalg.cholesky(cov)
    white = residual @ np.linalg.solve(factor, np.eye(len(cov))).T
    constant = np.log(np.diag(factor)).sum() + 0.5 * len(cov) * np.log(2 * np.pi)
    return np.asarray(-0.5 * np.einsum("...i,...i->...", white, white) - constant)
