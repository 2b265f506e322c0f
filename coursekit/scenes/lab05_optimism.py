"""Lab 5's advanced section: a circle on which plain EKF-SLAM grows sure of what it cannot know."""

from __future__ import annotations

import numpy as np

from coursekit.association import Known
from coursekit.gaussian import Gaussian, nees
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive, RangeBearing, pose_residual
from coursekit.scenes.lab05 import TAGS
from coursekit.slam import EkfSlam

POOR = DifferentialDrive(0.1, 0.3, sigma_slip=(5e-3, 5e-3, 1e-3))
SHARP = np.diag([0.05, 0.02]) ** 2


def optimism(kind: type[EkfSlam], rng: np.random.Generator, steps: int = 100) -> Array:
    """NEES of the pose at each step of a circle whose turns are badly known, the ids given: nothing but the filter."""
    pose, u, dt = np.array([0.0, -1.0, 0.0]), np.array([0.3, 0.3]), 0.4
    slam, scores = kind(Gaussian(pose, 1e-8 * np.eye(3)), POOR, Known()), []
    for _ in range(steps):
        pose = POOR.sample(pose[None], u, dt, rng)[0]
        slam.predict(u, dt)
        z = np.array([RangeBearing(tag).h(pose) for tag in TAGS]) + rng.standard_normal((8, 2)) * np.sqrt(
            np.diag(SHARP)
        )
        seen = np.flatnonzero((np.abs(z[:, 1]) < 0.54) & (z[:, 0] > 0.1))
        slam.observe(z[seen], SHARP, ids=seen.tolist())
        scores.append(nees(slam.pose, pose, pose_residual))
    return np.array(scores)
