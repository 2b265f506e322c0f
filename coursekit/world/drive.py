"""One robot and its motion: motors, wheels that slip, tyres that pull a body after them, encoders that count.

``Robot`` says what it is made of, ``Drive`` is one of them in a world.

Source: Siegwart, Nourbakhsh & Scaramuzza (2011), section 3.2, for the kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymunk
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle

GRAVITY = 9.81
ROBOT = 1  # collision type, and bit of the shape's filter categories


@dataclass(frozen=True)
class Robot:
    """What the robot is made of; the defaults are about a TurtleBot3 Waffle with a stronger motor.

    radius, wheel_radius, track : m; the body is a disc, the wheels stand ``track`` apart on its diameter.
    mass : kg.     traction : friction coefficient of the tyres.
    max_speed, max_acceleration : of a wheel's rim, m/s and m/s².
    slip : standard deviation of a wheel's slip over one control period, as a share of its rim speed.
    ticks : encoder ticks in one turn of a wheel.

    Raises ValueError for a value that is not a number > 0; ``slip`` may be 0.

    >>> robot = Robot(slip=0.03)
    >>> robot.rim_speeds(0.5, 1.0).round(4)       # to the left: the right wheel is faster
    array([0.3565, 0.6435])
    >>> np.sqrt(np.diag(robot.odometry_cov(0.5, 0.0, dt=0.05))).round(4)      # of v [m/s] and of ω [rad/s]
    array([0.0106, 0.0739])
    """

    radius: float = 0.18
    mass: float = 1.8
    wheel_radius: float = 0.033
    track: float = 0.287
    max_speed: float = 1.3
    max_acceleration: float = 2.0
    traction: float = 0.8
    slip: float = 0.03
    ticks: int = 4096

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number = as_numbers(value, name)
            low_enough = np.all(number >= 0) if name == "slip" else np.all(number > 0)
            if number.ndim or not (np.isfinite(number) and low_enough):
                raise ValueError(f"{name}: expected a number {'≥' if name == 'slip' else '>'} 0, got {value!r}")

    @property
    def top_speed(self) -> float:
        """m/s over the ground that the fastest wheels reach by slipping forwards, but for less than 1 in 10⁷ times."""
        return self.max_speed * (1 + 4 * self.slip)

    def rim_speeds(self, v: float, omega: float) -> Array:
        """[left, right] rim speeds in m/s for a body that moves at [v m/s, ω rad/s]."""
        return np.array([v - 0.5 * omega * self.track, v + 0.5 * omega * self.track])

    def body_speeds(self, rims: ArrayLike) -> Array:
        """[v, ω] of rim speeds [left, right]; the inverse of ``rim_speeds``."""
        left, right = np.asarray(rims, dtype=float)
        return np.array([0.5 * (left + right), (right - left) / self.track])

    def odometry_cov(self, v: float, omega: float, dt: float) -> Array:
        """Covariance of the odometry's error [v m/s, ω rad/s] over one control period of ``dt`` s, (2, 2).

        Each wheel's error has the variance of its slip and of its tick count; both become errors of the body's v and ω.
        """
        tick = 2 * np.pi * self.wheel_radius / self.ticks / dt
        # A tick count is off by the difference of two uniform roundings, variance tick²/6.
        variance = (self.slip * self.rim_speeds(v, omega)) ** 2 + tick**2 / 6
        to_body = np.array([[0.5, 0.5], [-1 / self.track, 1 / self.track]])
        return to_body * variance @ to_body.T


class Drive:
    """A robot in a world: its body, its wheels, and what its encoders say.  ``World`` makes and moves it.

    robot : what it is made of.     start : [x, y, θ].     rng : of its slip.
    """

    def __init__(self, robot: Robot, start: tuple[float, ...], rng: np.random.Generator) -> None:
        self.robot, self._rng = robot, rng
        self._rims = [0.0, 0.0]  # m/s, left and right: what the motors have reached
        self._goal = [0.0, 0.0]
        self._slip = self._draw_slip()
        self._travel = np.zeros(2)  # m that each rim has turned since the start
        self._before = self.encoders
        self._odometry = np.zeros(2)
        self.contact = False
        self.body = pymunk.Body(robot.mass, pymunk.moment_for_circle(robot.mass, 0, robot.radius))
        self.body.position, self.body.angle = start[:2], start[2]
        self.body.velocity_func = self._roll
        self.disc = pymunk.Circle(self.body, robot.radius)
        self.disc.collision_type, self.disc.friction = ROBOT, 0.3
        self.disc.filter = pymunk.ShapeFilter(categories=ROBOT)

    @property
    def pose(self) -> Array:
        """T_world_robot = [x, y, θ], true."""
        return np.array([*self.body.position, wrap_angle(self.body.angle)])

    @property
    def velocity(self) -> Array:
        """[forward, leftward, turning] in m/s, m/s, rad/s in the robot's frame, true."""
        body = self.body
        return np.array([*body.velocity.rotated(-body.angle), body.angular_velocity])

    @property
    def odometry(self) -> Array:
        """Measured [v m/s, ω rad/s] over the last control period, from whole encoder ticks."""
        return self._odometry.copy()

    @property
    def encoders(self) -> np.ndarray:
        """Ticks counted since the start, [left, right]."""
        per_metre = self.robot.ticks / (2 * np.pi * self.robot.wheel_radius)
        return np.floor(self._travel * per_metre).astype(np.int64)

    @property
    def wheels(self) -> Array:
        """True angular speeds of the wheels, [left, right] in rad/s."""
        return np.array(self._rims) / self.robot.wheel_radius

    # What World calls, once a control period and once a substep.

    def aim(self, v: float, omega: float) -> None:
        """A new command; beyond ``max_speed`` it is scaled down as a whole, which keeps the curvature of the path."""
        rims = self.robot.rim_speeds(v, omega)
        self._goal = (rims / max(1.0, np.abs(rims).max() / self.robot.max_speed)).tolist()
        self.contact, self._before = False, self.encoders

    def turn_wheels(self, h: float, last: bool) -> None:
        """The wheels over a substep of ``h`` s.

        pymunk moves bodies first and updates velocities after, so what is set now acts from the next substep on; the
        last one already belongs to the next period's slip.
        """
        if last:
            self._slip = self._draw_slip()
        ramp = self.robot.max_acceleration * h
        self._travel += np.multiply(self._rims, h)
        self._rims = [r + min(max(g - r, -ramp), ramp) for r, g in zip(self._rims, self._goal, strict=True)]

    def count(self, dt: float) -> None:
        """Odometry of the control period of ``dt`` s that is over."""
        turned = (self.encoders - self._before) * (2 * np.pi / self.robot.ticks)
        self._odometry = self.robot.body_speeds(turned * self.robot.wheel_radius / dt)

    def _roll(self, body: pymunk.Body, gravity: tuple[float, float], damping: float, h: float) -> None:
        """pymunk's velocity update: tyres pull the body to the wheels' speeds, as hard as friction lets them."""
        robot = self.robot
        left, right = self._rims[0] * self._slip[0], self._rims[1] * self._slip[1]
        turn = (right - left) / robot.track
        # The velocity set here is held for h: aim it along the heading of half-way, and the arc comes out right.
        heading = body.angle + 0.5 * turn * h
        forward, sideways = body.velocity.rotated(-heading)
        # Impulses that would bring each contact point to its wheel's speed.
        grip = robot.traction * body.mass * GRAVITY * h
        along = 0.5 * body.mass * (0.5 * (left + right) - forward)
        about = body.moment * (turn - body.angular_velocity) / robot.track
        across = -0.5 * body.mass * sideways
        pull_left, slide_left = _bounded(along - about, across, 0.5 * grip)
        pull_right, slide_right = _bounded(along + about, across, 0.5 * grip)
        body.velocity += pymunk.Vec2d(pull_left + pull_right, slide_left + slide_right).rotated(heading) / body.mass
        body.angular_velocity += 0.5 * robot.track * (pull_right - pull_left) / body.moment

    def _draw_slip(self) -> list[float]:
        """Ground speed over rim speed, left and right, for one control period."""
        return [1.0 + self.robot.slip * float(n) for n in self._rng.standard_normal(2)]


def _bounded(pull: float, slide: float, limit: float) -> tuple[float, float]:
    """An impulse in the ground plane, shortened to what friction can give."""
    size = (pull * pull + slide * slide) ** 0.5
    scale = 1.0 if size <= limit else limit / size
    return pull * scale, slide * scale
