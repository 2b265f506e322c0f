"""Lab 8's dives: their water and places, and what a matcher finds in each frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from coursekit.geometry import Array
from coursekit.results import Rejected
from coursekit.teaching.experiments import lab_seed
from coursekit.visual import Fix, MapMatcher, MotionCalibration, calibrate, odometry_from_image
from coursekit.world import seafloor
from coursekit.world.seafloor import DT, Dive, dive, frame_to_map

WATER: dict[str, dict[str, float]] = {
    "clear": {"blur": 0.7, "noise": 4.0},
    "sun ripples": {"blur": 0.7, "noise": 4.0, "caustics": 0.35},
    "noisy": {"blur": 0.7, "noise": 30.0},
    "murky": {"blur": 9.0, "noise": 4.0},
}
PLACES = [
    (420.0, 400.0, 0.6), (640.0, 350.0, -2.2), (860.0, 430.0, 1.9), (1060.0, 380.0, 0.3), (1280.0, 400.0, 1.2),
    (1560.0, 420.0, -0.8), (1840.0, 360.0, 2.8), (2120.0, 430.0, -1.4),
]  # fmt: skip
KIDNAPPED = 52
FIX_ERROR = (0.015, 0.015, 1e-4)  # px, px, rad: of a fix over rocks


def story() -> Dive:
    """The lab's dive: rocks, bare sand, rocks again; before frame 52 the swell carries the robot off, to the west."""
    seed = lab_seed(8)
    sea, rng = seafloor.load(), np.random.default_rng(seed)
    before = dive(sea, KIDNAPPED - 1, seed, start=[880, 400, np.pi / 2], targets=[[1900, 400]])
    landing = [560 + rng.uniform(-60, 60), 400 + rng.uniform(-40, 40), rng.uniform(-np.pi, np.pi)]
    after = dive(sea, 12, seed + 1, start=landing, targets=[[420, 400], [700, 380]])
    poses, light = np.vstack([before.poses, after.poses]), np.vstack([before.light, after.light])
    # No command tells of the swell: the robot believes that it went on as before.
    commands = np.vstack([before.commands, before.commands[-1:], after.commands])
    return Dive(sea, poses, commands, light, seed)


def training() -> Dive:
    """A dive over rocks and weed, all frames of which match."""
    targets = [[820, 420], [600, 360], [500, 440]]
    return dive(seafloor.load(), 24, lab_seed(8) + 2, start=[420, 380, 1.0], targets=targets)


def calibration() -> MotionCalibration:
    """What a command does, from 200 steps over rocks.

    Their frames are not rendered: each pose is the truth and an error as large as a fix's.
    """
    seed, targets = lab_seed(8) + 3, [[820, 420], [420, 360], [780, 460], [400, 440]] * 2
    dived = dive(seafloor.load(), 200, seed, start=[420, 380, 1.0], targets=targets)
    poses = odometry_from_image(dived.poses)
    return calibrate(poses + np.random.default_rng(seed).standard_normal(poses.shape) * FIX_ERROR, dived.commands, DT)


def look_at(dived: Dive, matcher: MapMatcher) -> list[Fix | Rejected]:
    """What the matcher says to every frame of a dive."""
    return [matcher.locate(dived.frame(k)) for k in range(len(dived))]


def poses_of(fixes: Sequence[Fix | Rejected]) -> Array:
    """The fixes in the odometry's frame, (n, 3); NaN where there was none."""
    return np.array([fix.belief.mean if isinstance(fix, Fix) else [np.nan] * 3 for fix in fixes])


@dataclass(frozen=True)
class Ratios:
    """Features of a frame against those of the map around it.

    keypoints : OpenCV's, n of them.     nearest, second : distances of descriptors to the map's closest two, (n,).
    is_right : whether the nearest one lies within 3 px of the place where the feature really is, (n,).
    """

    keypoints: Sequence[Any]
    nearest: Array
    second: Array
    is_right: Any


def descriptor_ratios(dived: Dive, k: int) -> Ratios:
    """The 800 strongest features of frame k, each with its two most similar features on the map."""
    u, v = dived.poses[k, :2].astype(int)
    left, top = max(u - 400, 0), max(v - 400, 0)
    sift, strongest = (cv2.SIFT.create(n, enable_precise_upscale=True) for n in (0, 800))
    grey = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in (dived.frame(k), dived.map_image)]
    keypoints, descriptors = strongest.detectAndCompute(grey[0], None)
    on_map, known = sift.detectAndCompute(np.ascontiguousarray(grey[1][top : top + 800, left : left + 800]), None)
    both = cv2.BFMatcher().knnMatch(descriptors, known, k=2)
    found = np.array([on_map[a.trainIdx].pt for a, _ in both]) + np.array([left, top])
    affine = frame_to_map(dived.poses[k], dived.light[k, 0])
    there = np.column_stack([[p.pt for p in keypoints], np.ones(len(keypoints))]) @ affine.T
    near, second = np.array([[a.distance, b.distance] for a, b in both]).T
    return Ratios(keypoints, near, second, np.hypot(*(found - there).T) < 3)
