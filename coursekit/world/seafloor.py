"""A sea floor from above: the map, the diving robot's way over it, and what its downward camera sees.

Everything here speaks the *map image's* language: a pose is ``[u, v, yaw]``, u to the right and v down in pixels of
the map (pixel centres at whole numbers), yaw clockwise from north, which is the top of the map.  Lab 8 derives the
way to the odometry's frame and back; this module knows nothing of it, so that a test can hold one against the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle
from coursekit.world._checks import count, number

Image = NDArray[np.uint8]

FRAME = 400  # the camera's picture is square
DT = 0.5  # seconds from one frame to the next

# What the thrusters and the water do to a command; a filter has to find it out from recordings.
PIXELS_PER_METRE = 62.5
TURN_GAIN = 0.9  # a commanded rad/s turns the robot by this much
TURN_BIAS = 0.015  # rad/s to the left, all the time: one thruster is stronger
SIGMA_V, SIGMA_OMEGA, SIGMA_SLIP = 4.0, 0.05, 0.4  # px/s, rad/s over a step; px a step


@lru_cache(maxsize=1)
def load() -> Image:
    """The committed map, (800, 2560, 3) uint8 BGR, read-only."""
    from coursekit.recordings.datasets import project_file

    image = np.asarray(cv2.imread(str(project_file("seafloor.jpg")), cv2.IMREAD_COLOR), dtype=np.uint8)
    image.flags.writeable = False
    return image


def look(
    map_image: Image,
    pose: ArrayLike,
    *,
    scale: float = 1.0,
    gain: float = 1.0,
    offset: float = 0.0,
    blur: float = 0.0,
    noise: float = 0.0,
    caustics: float = 0.0,
    time: float = 0.0,
    size: int = FRAME,
    rng: np.random.Generator | None = None,
) -> Image:
    """What a downward camera sees from ``pose`` = [u, v, yaw]: (size, size[, 3]) uint8, up is the robot's forward.

    Parameters
    ----------
    scale : pixels of the map per pixel of the frame (higher above the floor: more).
    gain, offset : brightness, frame = gain · map + offset (grey levels).
    blur, noise : standard deviations, in pixels of the frame and in grey levels.
    caustics : strength of the net of light that waves cast on the floor, 0.1 to 0.3; it moves with ``time`` (s).
    rng : draws the noise; needed when ``noise`` is not 0.

    Raises ValueError for a pose that is not three finite numbers, a setting that is negative or not finite, and noise
    without a generator; TypeError for what is no number.
    """
    pose = as_numbers(pose, "pose")
    number(scale, "scale", above=0.0)
    number(offset, "offset")
    number(time, "time")
    for name, value in {"gain": gain, "blur": blur, "noise": noise, "caustics": caustics}.items():
        number(value, name, least=0.0)
    size = count(size, "size")
    if pose.shape != (3,) or not np.all(np.isfinite(pose)):
        raise ValueError(f"pose: expected a finite [u, v, yaw], got {pose}")
    if noise and rng is None:
        raise ValueError("rng: noise needs a generator")
    frame = cv2.warpAffine(
        map_image,
        frame_to_map(pose, scale, size),
        (size, size),
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
    ).astype(np.float32)
    light = np.full((size, size), gain, np.float32)
    if caustics:
        light *= 1 + caustics * _net(size, time)
    frame *= light if frame.ndim == 2 else light[..., None]
    if blur:
        frame = cv2.GaussianBlur(frame, (0, 0), blur)
    if noise and rng is not None:
        frame += noise * rng.standard_normal(frame.shape, dtype=np.float32)
    return np.clip(np.round(frame + offset), 0, 255).astype(np.uint8)


def frame_to_map(pose: ArrayLike, scale: float = 1.0, size: int = FRAME) -> Array:
    """The true (2, 3) affine matrix from the frame's pixels to the map's: scale, turn clockwise by yaw, shift."""
    u, v, yaw = np.asarray(pose, dtype=float)
    c, s = scale * np.cos(yaw), scale * np.sin(yaw)
    middle = (size - 1) / 2
    return np.array([[c, -s, u - (c - s) * middle], [s, c, v - (s + c) * middle]])


@dataclass(frozen=True)
class Dive:
    """A recorded dive: frame k was taken at ``poses[k]``; ``commands[k]`` was carried out from frame k to k + 1.

    poses (n + 1, 3) [u px, v px, yaw rad]: the truth.     commands (n, 2) [v m/s, ω rad/s, positive to the left].
    light (n + 1, 3) [scale, gain, offset] of each frame.  ``frame(k)`` is a pure function of k.
    """

    map_image: Image
    poses: Array
    commands: Array
    light: Array
    seed: int
    blur: float = 0.7
    noise: float = 4.0
    caustics: float = 0.12

    def __len__(self) -> int:
        return len(self.poses)

    def frame(self, k: int) -> Image:
        """(400, 400, 3) uint8 BGR."""
        scale, gain, offset = self.light[k]
        optics: dict[str, Any] = {"blur": self.blur, "noise": self.noise, "caustics": self.caustics, "time": k * DT}
        rng = np.random.default_rng([self.seed, k])
        return look(self.map_image, self.poses[k], scale=scale, gain=gain, offset=offset, rng=rng, **optics)


def dive(
    map_image: Image,
    steps: int,
    seed: int,
    *,
    start: ArrayLike | None = None,
    targets: ArrayLike | None = None,
    kidnap_at: int | None = None,
    **optics: float,
) -> Dive:
    """Steer over the map from target to target for ``steps`` steps; with ``kidnap_at`` a swell carries the robot off.

    Parameters
    ----------
    start, targets : first pose [u, v, yaw] and the places (n, 2) to swim to; drawn over the whole map when not given.
        The camera's view never leaves the map.
    kidnap_at : the step before whose end the robot is put down anywhere; no command tells of it.
    optics : blur, noise, caustics of the frames.

    Raises ValueError when the map is too small for the view, for steps that are no whole number ≥ 0, a start that is no
    pose and targets that are no points.
    """
    steps = count(steps, "steps", least=0)
    for name, value, width in (("start", start, 3), ("targets", targets, 2)):
        if value is not None:
            given = np.atleast_2d(as_numbers(value, name))
            if given.ndim != 2 or given.shape[1] != width or not np.isfinite(given).all():
                raise ValueError(f"{name}: expected {width} finite numbers each, got {value!r}")
    rng = np.random.default_rng([seed, 2**31])
    room = np.array(map_image.shape[1::-1], dtype=float)
    low, high = np.full(2, 0.9 * FRAME), room - 0.9 * FRAME
    if np.any(high <= low):
        raise ValueError(f"map_image: expected more than {2 * 0.9 * FRAME:.0f} pixels each way, got {map_image.shape}")
    ahead = [*np.atleast_2d(np.asarray(targets, dtype=float))] if targets is not None else []
    pose = np.append(rng.uniform(low, high), rng.uniform(-np.pi, np.pi)) if start is None else np.array(start, float)
    poses, commands = [pose], []
    for k in range(steps):
        while not ahead or np.linalg.norm(ahead[0] - pose[:2]) < 40:
            ahead = ahead[1:] or [rng.uniform(low, high)]
        east, south = ahead[0] - pose[:2]
        turn_left = wrap_angle(pose[2] - np.arctan2(east, -south))
        command = np.array([0.4 * np.maximum(0.2, np.cos(turn_left)), np.clip(1.2 * turn_left, -0.6, 0.6)])
        pose = _swim(pose, command, rng)
        if k + 1 == kidnap_at:
            pose = np.append(rng.uniform(low, high), rng.uniform(-np.pi, np.pi))
        poses.append(pose)
        commands.append(command)
    t = np.arange(steps + 1) * DT
    # The swell lifts the robot, clouds pass, the camera's exposure follows late.
    a, b, c = rng.uniform(0, 2 * np.pi, 3)
    light = [1 + 0.05 * np.sin(t / 6 + a), 1 + 0.15 * np.sin(t / 9 + b), 8 * np.sin(t / 5 + c)]
    return Dive(map_image, np.array(poses), np.array(commands).reshape(-1, 2), np.stack(light, axis=-1), seed, **optics)


def _swim(pose: Array, command: Array, rng: np.random.Generator) -> Array:
    """One step of the real robot, in twenty short straight pieces."""
    v = PIXELS_PER_METRE * command[0] + SIGMA_V * rng.standard_normal()
    left = TURN_GAIN * command[1] + TURN_BIAS + SIGMA_OMEGA * rng.standard_normal()
    u_v, yaw, pieces = pose[:2].copy(), pose[2], 20
    for _ in range(pieces):
        yaw -= 0.5 * left * DT / pieces
        u_v += v * DT / pieces * np.array([np.sin(yaw), -np.cos(yaw)])
        yaw -= 0.5 * left * DT / pieces
    return np.append(u_v + SIGMA_SLIP * rng.standard_normal(2), wrap_angle(yaw))


def _net(size: int, time: float) -> Array:
    """Caustics: bright lines where slow waves focus the light, mean about 0, peaks about 2; (size, size)."""
    v, u = np.mgrid[:size, :size].astype(np.float32) / 30
    total = np.zeros_like(u)
    for j in range(4):
        angle = 0.4 + 1.7 * j
        along = np.cos(angle) * u + np.sin(angle) * v
        across = np.cos(angle) * v - np.sin(angle) * u
        total += np.sin(along * (1 + 0.3 * j) + 1.3 * np.sin(0.7 * across + 0.9 * time + j) + (1.1 + 0.4 * j) * time)
    return np.exp(-3 * np.abs(total)) * 2.4 - 0.4
