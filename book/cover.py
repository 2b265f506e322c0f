"""The picture on the front page, drawn by the project's own models.

A robot drives among landmarks.  Orange: where it might be if it trusts its wheels alone, at a few moments, as a
cloud of five hundred simulated drives.  Blue: what is left of the doubt once it measures the landmarks.
"""

from __future__ import annotations

from io import BytesIO

import numpy as np

from coursekit import plotting
from coursekit.gaussian import Gaussian
from coursekit.models import DifferentialDrive, RangeBearing

DT, STEPS, MOMENTS = 0.2, 211, (50, 105, 160, 210)
LANDMARKS = {"red": (2.6, 2.0), "green": (4.4, -1.6), "blue": (7.6, 2.7), "magenta": (12.6, 2.6), "cyan": (10.4, -1.6)}
REACH = 3.4  # metres at which the camera still sees a landmark


def controls() -> np.ndarray:
    """A gentle S through the landmarks, (STEPS, 2) of [v m/s, ω rad/s]."""
    t = np.arange(STEPS) * DT
    return np.stack([np.full(STEPS, 0.32), 0.13 * np.sin(2 * np.pi * t / 27.0 + 1.4)], axis=-1)


def drive(seed: int = 7) -> tuple[np.ndarray, np.ndarray, list[Gaussian]]:
    """The true path (n, 3), the clouds of dead reckoning (moments, 500, 3), and the corrected beliefs."""
    rng = np.random.default_rng(seed)
    wheels = DifferentialDrive(sigma_v=0.08, sigma_omega=0.055)
    pose = np.array([0.0, 0.0, -0.15])
    belief, cloud = Gaussian(pose, np.diag([0.02, 0.02, 0.01]) ** 2), np.tile(pose, (500, 1))
    path, clouds, beliefs = [pose], [], []
    for k, u in enumerate(controls()):
        pose = wheels.sample(pose[None], u, DT, rng)[0]
        cloud = wheels.sample(cloud, u, DT, rng)
        F = wheels.F(belief.mean, u, DT)
        belief = Gaussian(wheels.f(belief.mean, u, DT), F @ belief.cov @ F.T + wheels.Q(belief.mean, u, DT))
        for landmark in LANDMARKS.values():
            sensor = RangeBearing(landmark, R=np.diag([0.3**2, 0.06**2]))
            if sensor.h(pose)[0] < REACH and k % 8 == 0:
                belief = correct(belief, sensor, sensor.h(pose) + rng.multivariate_normal([0, 0], sensor.R))
        path.append(pose)
        if k in MOMENTS:
            clouds.append(cloud)
            beliefs.append(belief)
    return np.array(path), np.array(clouds), beliefs


def correct(belief: Gaussian, sensor: RangeBearing, z: np.ndarray) -> Gaussian:
    """Kalman's correction; Lab 4 derives it."""
    H = sensor.H(belief.mean)
    K = np.linalg.solve(H @ belief.cov @ H.T + sensor.R, H @ belief.cov).T
    A = np.eye(3) - K @ H
    cov = A @ belief.cov @ A.T + K @ sensor.R @ K.T
    return Gaussian(belief.mean + K @ sensor.residual(z, sensor.h(belief.mean)), 0.5 * (cov + cov.T))


def pictures() -> dict[str, bytes]:
    """File name → content."""
    path, clouds, beliefs = drive()
    fig = plotting.figure(10.5, 3.9)
    ax = plotting.axes(fig)
    for colour, (x, y) in LANDMARKS.items():
        ax.plot(x, y, "o", ms=13, color=plotting.LANDMARK_COLOURS[colour], mec=plotting.WALL, mew=0.8, zorder=4)
    for cloud in clouds:
        ax.plot(*cloud[:, :2].T, ".", ms=4, color=plotting.MEASUREMENT, alpha=0.4, mew=0)
    ax.plot(*path[:, :2].T, color=plotting.TRUTH, lw=1.4, ls=(0, (4, 2)))
    for k, belief in zip(MOMENTS, beliefs, strict=True):
        pose = path[k + 1]
        for x, y in LANDMARKS.values():
            if np.hypot(x - pose[0], y - pose[1]) < REACH:
                ax.plot([pose[0], x], [pose[1], y], color=plotting.ODOMETRY, lw=0.8, alpha=0.7)
        plotting.draw_ellipse(ax, belief.mean, belief.cov, lw=2.4, zorder=6)
        plotting.draw_robot(ax, pose, colour=plotting.TRUTH, size=0.5)
    ax.set_aspect("equal")
    ax.grid(False)
    ax.set_axis_off()
    ax.set_xlim(-0.4, 14.0)
    ax.set_ylim(-2.2, 3.1)
    buffer = BytesIO()
    fig.savefig(buffer, format="webp", dpi=160, pil_kwargs={"quality": 85, "method": 6})
    return {"cover.webp": buffer.getvalue()}
