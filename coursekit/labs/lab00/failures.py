"""Lab 0's failures: an ellipse that promises too much, and an arc taken for a straight line."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import chi2

from coursekit.geometry import Array
from coursekit.models import DifferentialDrive
from coursekit.teaching.experiments import lab_seed
from coursekit.teaching.failures import Failure


def three_sigma_squared(confidence: float = 0.95) -> float:
    """Squared radius of "the 95 % ellipse", after a docstring that many plots were copied from: 3."""
    return 3.0


def planar_quantile(confidence: float = 0.95) -> float:
    """Squared radius, in standard deviations, that holds a share of a planar Gaussian."""
    return float(chi2.ppf(confidence, 2))


def holds_its_share_of_the_cloud(squared_radius: Callable[[float], float]) -> bool:
    """Does an ellipse of that size hold 95 % of 20,000 draws?  Off by 6 standard errors is a no.

    A false alarm in one of 500 million.
    """
    draws = np.random.default_rng(lab_seed(0) + 6).standard_normal((20_000, 2))
    share = np.mean(np.sum(draws**2, axis=1) <= squared_radius(0.95))
    return bool(abs(share - 0.95) < 6 * np.sqrt(0.95 * 0.05 / len(draws)))


def euler_step(pose: Array, control: Array, dt: float) -> Array:
    """Drive straight along the old heading, then turn."""
    x, y, heading = pose
    v, omega = control
    return np.array([x + v * np.cos(heading) * dt, y + v * np.sin(heading) * dt, heading + omega * dt])


def arc_step(pose: Array, control: Array, dt: float) -> Array:
    """Drive along the arc."""
    return DifferentialDrive().f(pose, control, dt)


def half_a_circle_ends_opposite_its_start(step: Callable[[Array, Array, float], Array]) -> bool:
    """Half a circle of radius 1 m in steps of 0.8 s ends 2 m to the left, within a millimetre."""
    pose, omega, dt = np.zeros(3), np.pi / 8.0, 0.8
    for _ in range(10):
        pose = step(pose, np.array([omega * 1.0, omega]), dt)
    return bool(np.hypot(pose[0], pose[1] - 2.0) < 1e-3)


Failure(
    name="lab00.three_is_not_95_percent",
    source="PythonRobotics, utils/plot.py, plot_covariance_ellipse: a squared radius of 3.0 for ~95 % in the plane",
    wrong=three_sigma_squared,
    right=planar_quantile,
    check=holds_its_share_of_the_cloud,
    lesson="Count the dots: the ellipse that was sold as 95 % holds 78 % of them.",
)

Failure(
    name="lab00.euler_step",
    source="the EKF-SLAM report, predict step: dx = v cos(θ) dt with the heading from before the turn, every 0.8 s",
    wrong=euler_step,
    right=arc_step,
    check=half_a_circle_ends_opposite_its_start,
    lesson="Each step leaves along the old heading, so a turning robot is told to swing wide, and no noise is needed.",
)
