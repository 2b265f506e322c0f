"""Lab 0's robot: its settings, a recorded drive, ten thousand endings, and dead reckoning with its covariance.

Slip is given in per cent of a wheel's speed, as the lab's sliders show it.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np

from coursekit.gaussian import symmetrize
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive
from coursekit.teaching.experiments import lab_seed
from coursekit.world.arena import Arena
from coursekit.world.pilot import drive
from coursekit.world.robot import Robot, World

WAYPOINTS = [(2.2, -0.7), (2.4, 0.8), (0.6, 1.4), (-2.1, 1.3), (-2.0, -0.4), (-1.9, -2.0)]
SLIPS = (1, 3, 8)
SPEED, PERIOD = 0.5, 0.05
RADIUS_SQUARED = -2 * np.log(0.05)  # of the 95 % ellipse of a planar Gaussian; the lab derives it
ARC = DifferentialDrive()
START = np.diag(np.square([1e-3, 1e-3, 1e-3]))  # nobody sets a robot down more exactly than to a millimetre


def reckon(pose: Array, P: Array, u: Array, robot: Robot, dt: float) -> tuple[Array, Array]:
    """One step of dead reckoning: the pose (3,) and its covariance after odometry u = [v, ω], to first order."""
    F, G, M = ARC.F(pose, u, dt), ARC.G(pose, u, dt), robot.odometry_cov(float(u[0]), float(u[1]), dt)
    return ARC.f(pose, u, dt), symmetrize(F @ P @ F.T + G @ M @ G.T)


@cache
def recording(slip: float, seed: int) -> tuple[Array, Array, Array, Array]:
    """Truth (n + 1, 3), dead reckoning, its covariances, and the crates (n + 1, k, 3) of one drive."""
    world = World(Arena.load("lab"), seed=seed, robot=Robot(slip=slip / 100), dt=PERIOD)
    truth, crates, odometry = [world.pose], [world.crates], []
    for _ in drive(world, WAYPOINTS):
        truth.append(world.pose)
        crates.append(world.crates)
        odometry.append(world.odometry)
    told, covs = [truth[0]], [START]
    for u in odometry:
        pose, P = reckon(told[-1], covs[-1], u, world.robot, world.dt)
        told.append(pose)
        covs.append(P)
    return np.array(truth), np.array(told), np.array(covs), np.array(crates)


def endings(slip: float, omega: float, times: Iterable[float], seed: int, runs: int = 10_000) -> dict[float, Any]:
    """Where ``runs`` robots are at each of the times [s], and what linear algebra says about it.

    Each starts at [0, 0, 0] with the command [0.5 m/s, omega rad/s]; its wheels slip, anew in each control period.
    Returns time → (endings (runs, 3), mean (3,), covariance (3, 3)).
    """
    # Five periods at a time: the mean of five slips is one slip, smaller by √5.
    robot, dt, rng = Robot(slip=slip / 100 / np.sqrt(5)), 5 * PERIOD, np.random.default_rng(seed)
    u, M = np.array([SPEED, omega]), robot.odometry_cov(SPEED, omega, 5 * PERIOD)
    factor, found = np.linalg.cholesky(M).T, {}
    cloud, mean, P = np.zeros((runs, 3)), np.zeros(3), np.zeros((3, 3))
    for k in range(1, round(max(times) / dt) + 1):
        F, G = ARC.F(mean, u, dt), ARC.G(mean, u, dt)
        P, mean = F @ P @ F.T + G @ M @ G.T, ARC.f(mean, u, dt)
        cloud = ARC.f(cloud, u + rng.standard_normal((runs, 2)) @ factor, dt)
        for time in times:
            if round(time / dt) == k:
                found[time] = cloud, mean, P
    return found


def ways(n: int, slip: float = 8, time: float = 20.0) -> Array:
    """Where n straight drives end, (n, 2), m: what the opening question asks for."""
    cloud, _, _ = endings(slip, 0.0, [time], lab_seed(0) + 1, runs=n)[time]
    return np.asarray(cloud[:, :2])
