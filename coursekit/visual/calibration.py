"""From commands to pixels: what a robot really does when it is told to, estimated from where it was seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle
from coursekit.models import DifferentialDrive

LEAST_ERROR = 1e-6  # px, rad, of a step: nothing is known better, so the motion's noise stays positive definite
CUT = 4.0  # robust standard deviations: a step further off than that had a wrong fix at one of its ends


@dataclass(frozen=True)
class MotionCalibration:
    """What a command [v m/s, ω rad/s] comes to on the map: rate = gain · command + bias, plus noise.

    gain (2,) [px per m, rad per rad]; bias (2,) [px/s, rad/s].  sigma_v px/s and sigma_omega rad/s are the
    rates' errors over a step, sigma_pose px a step is what neither explains.  steps : how many were used.

    ``calibrate`` makes it, with its example.
    """

    gain: Array
    bias: Array
    sigma_v: float
    sigma_omega: float
    sigma_pose: float
    steps: int

    def control(self, command: ArrayLike) -> Array:
        """[v m/s, ω rad/s] as commanded → [v px/s, ω rad/s] as expected on the map, (..., 2)."""
        return self.gain * np.asarray(command, dtype=float) + self.bias

    @property
    def motion(self) -> DifferentialDrive:
        """The motion model in pixels of the map, odometry's frame, with the noise that was measured."""
        return DifferentialDrive(self.sigma_v, self.sigma_omega, (self.sigma_pose, self.sigma_pose, 1e-3))


def calibrate(poses: ArrayLike, commands: ArrayLike, dt: float) -> MotionCalibration:
    r"""Fit gains, biases and noise to a recorded drive, by least squares on the rates that the fixes show.

    Two poses determine the arc between them: it turns by Δθ, its chord lies Δθ/2 from the first heading and is
    v dt sinc(Δθ/2) long.  What of the step points across the chord's direction is slip.

    Parameters
    ----------
    poses : (n + 1, 3) in the odometry's frame, px and rad; a row of NaN where there was no fix.
    commands : (n, 2) [v m/s, ω rad/s]; ``commands[k]`` led from ``poses[k]`` to ``poses[k + 1]``.

    dt : seconds from one pose to the next.

    Steps more than four robust standard deviations off are left out, as wrong fixes, and the rest fitted again.

    Raises ValueError for shapes that disagree, a dt that is not positive, fewer than 10 usable steps, and a command
    that is always zero; TypeError for what is no number.

    >>> speeds = np.linspace(0.2, 0.4, 12)  # m/s, straight to the east at 60 px/m; and it is told to turn and does not
    >>> x = np.concatenate([[0.0], np.cumsum(60 * speeds * 0.5)])
    >>> commands = np.column_stack([speeds, np.tile([0.1, -0.1], 6)])
    >>> calibrate(np.column_stack([x, 0 * x, 0 * x]), commands, 0.5).gain.round(2) + 0.0
    array([60.,  0.])

    Source: Thrun, Burgard & Fox (2005), section 5.4, for rates with noise that add up to an arc.
    """
    poses, commands = as_numbers(poses, "poses"), as_numbers(commands, "commands")
    if commands.ndim != 2 or commands.shape[1] != 2 or poses.shape != (len(commands) + 1, 3):
        raise ValueError(f"expected poses (n + 1, 3) and commands (n, 2), got {poses.shape} and {commands.shape}")
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt: expected a time step > 0 s, got {dt}")
    step, turn = np.diff(poses[:, :2], axis=0), wrap_angle(np.diff(poses[:, 2]))
    direction = poses[:-1, 2] + turn / 2
    c, s = np.cos(direction), np.sin(direction)
    along, across = step[:, 0] * c + step[:, 1] * s, step[:, 1] * c - step[:, 0] * s
    rates = np.stack([along / np.sinc(turn / (2 * np.pi)), turn], axis=-1) / dt
    usable = np.all(np.isfinite(np.column_stack([rates, commands])), axis=1)
    for _ in range(10):
        if usable.sum() < 10:
            raise ValueError(f"poses: expected at least 10 steps with a fix at both ends, got {usable.sum()}")
        fits = [_line(commands[usable, j], rates[usable, j], "vω"[j]) for j in (0, 1)]
        (gain, bias) = np.array(fits).T
        errors = np.column_stack([rates - gain * commands - bias, across / dt])
        spread = 1.4826 * np.median(np.abs(errors[usable]), axis=0) + LEAST_ERROR / dt
        usable_now = np.all(np.abs(errors) < CUT * spread, axis=1)  # NaN compares false
        if np.array_equal(usable_now, usable):
            break
        usable = usable_now
    along_2, turning_2, slip_2 = np.mean(errors[usable] ** 2, axis=0)
    sigma_v, sigma_omega, sigma_pose = np.sqrt(
        np.maximum([along_2 - slip_2, turning_2, slip_2 * dt**2], np.square([1 / dt, 1 / dt, 1]) * LEAST_ERROR**2)
    )
    return MotionCalibration(gain, bias, float(sigma_v), float(sigma_omega), float(sigma_pose), int(usable.sum()))


def _line(x: Array, y: Array, name: str) -> tuple[float, float]:
    """Slope and intercept; the slope alone when the command hardly varies, for then the two cannot be told apart."""
    if np.ptp(x) > 1e-3 * (1 + np.abs(x).max()):
        slope, intercept = np.polyfit(x, y, 1)
        return float(slope), float(intercept)
    if np.abs(x).max() < 1e-9:
        raise ValueError(f"commands: {name} is always 0, so its gain cannot be seen")
    return float(x @ y / (x @ x)), 0.0
