r"""A differential-drive robot in a flat world with mass, friction and contacts, simulated by pymunk.

Seen from above there is no gravity in the plane; the floor acts through friction.  Motors turn the wheels at the
commanded speeds as fast as their acceleration allows.  Tyres drag the body after the wheels with a force that
friction bounds, so a robot that pushes a wall spins its wheels and its odometry counts metres that it never
went.  Tyres also creep: over a control period each wheel's ground speed is off by a random share of its rim
speed.  Encoders count ticks of the wheels and know nothing of any of this.

>>> from coursekit.world.arena import Arena
>>> world = World(Arena("nowhere"), seed=1)
>>> for _ in range(40):
...     world.step(0.5, 0.0)
>>> print(f"{world.time:.2f} s, {world.pose[0]:.1f} m ahead")
2.00 s, 0.9 m ahead

Deterministic: the same arena, seed and commands give the same bytes.

Source: Siegwart, Nourbakhsh & Scaramuzza (2011), section 3.2, for the kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pymunk
from numpy.typing import ArrayLike

from coursekit.geometry import Array, wrap_angle
from coursekit.world.arena import Arena, Crate

GRAVITY = 9.81
FLOOR_FRICTION = 0.3  # of a crate
ROBOT, OBSTACLE = 1, 2  # collision types, and bits of the shapes' filter categories


@dataclass(frozen=True)
class Robot:
    """What the robot is made of; the defaults are about a TurtleBot3 Waffle with a stronger motor.

    radius, wheel_radius, track : m; the body is a disc, the wheels stand ``track`` apart on its diameter.
    mass : kg.     traction : friction coefficient of the tyres.
    max_speed, max_acceleration : of a wheel's rim, m/s and m/s².
    slip : standard deviation of a wheel's creep over one control period, as a share of its rim speed.
    ticks : encoder ticks in one turn of a wheel.
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
            low_enough = value >= 0 if name == "slip" else value > 0
            if not (np.isfinite(value) and low_enough):
                raise ValueError(f"{name}: expected a number {'≥' if name == 'slip' else '>'} 0, got {value!r}")

    def rim_speeds(self, v: float, omega: float) -> Array:
        """[left, right] rim speeds in m/s for a body that moves at [v m/s, ω rad/s]."""
        return np.array([v - 0.5 * omega * self.track, v + 0.5 * omega * self.track])

    def body_speeds(self, rims: ArrayLike) -> Array:
        """[v, ω] of rim speeds [left, right]; the inverse of ``rim_speeds``."""
        left, right = np.asarray(rims, dtype=float)
        return np.array([0.5 * (left + right), (right - left) / self.track])

    def odometry_cov(self, v: float, omega: float, dt: float) -> Array:
        """Covariance of the odometry's error [v, ω] over one control period of ``dt`` s: creep and ticks, (2, 2)."""
        tick = 2 * np.pi * self.wheel_radius / self.ticks / dt
        # A tick count is off by the difference of two uniform roundings, variance tick²/6.
        variance = (self.slip * self.rim_speeds(v, omega)) ** 2 + tick**2 / 6
        to_body = np.array([[0.5, 0.5], [-1 / self.track, 1 / self.track]])
        return to_body * variance @ to_body.T


class World:
    """One robot in one arena.

    Parameters
    ----------
    arena : what stands where; the robot starts at ``arena.start``.
    seed : of the slip, an int or a ``numpy.random.Generator``.
    robot : what it is made of.
    dt : the control period in seconds; physics runs ``substeps`` times in it.

    Raises ValueError when the robot would start inside something.
    """

    def __init__(
        self,
        arena: Arena,
        seed: int | np.random.Generator,
        robot: Robot | None = None,
        dt: float = 0.05,
        substeps: int = 10,
    ) -> None:
        if not (np.isfinite(dt) and dt > 0) or substeps < 1:
            raise ValueError(f"expected dt > 0 s and substeps ≥ 1, got dt={dt}, substeps={substeps}")
        self.arena, self.robot, self.dt, self.substeps = arena, robot or Robot(), float(dt), int(substeps)
        self._rng = np.random.default_rng(seed)
        self._steps = 0
        self._rims = [0.0, 0.0]  # m/s, left and right: what the motors have reached
        self._slip = self._creep()
        self._travel = np.zeros(2)  # m that each rim has turned since the start
        self._odometry = np.zeros(2)
        self._contact = False
        self.space = pymunk.Space()
        self.space.on_collision(ROBOT, None, post_solve=self._touch)
        self._build()

    # What the outside may know.

    @property
    def pose(self) -> Array:
        """T_world_robot = [x, y, θ], true."""
        body = self._body
        return np.array([*body.position, wrap_angle(body.angle)])

    @property
    def velocity(self) -> Array:
        """[forward, leftward, turning] in m/s, m/s, rad/s in the robot's frame, true."""
        body = self._body
        return np.array([*body.velocity.rotated(-body.angle), body.angular_velocity])

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self._steps * self.dt

    @property
    def odometry(self) -> Array:
        """Measured [v m/s, ω rad/s] over the last control period, from whole encoder ticks."""
        return self._odometry.copy()

    @property
    def encoders(self) -> np.ndarray:
        """Ticks counted since the start, [left, right]."""
        return self._ticks()

    @property
    def wheels(self) -> Array:
        """True angular speeds of the wheels, [left, right] in rad/s."""
        return np.array(self._rims) / self.robot.wheel_radius

    @property
    def contact(self) -> bool:
        """Did the robot touch anything during the last control period?"""
        return self._contact

    @property
    def crates(self) -> Array:
        """Where the crates are now, in the arena's order, (n, 3)."""
        poses = [[*body.position, wrap_angle(body.angle)] for body in self._crates]
        return np.array(poses, dtype=float).reshape(-1, 3)

    # What moves it.

    def step(self, v: float, omega: float) -> None:
        """Drive for one control period with the command [v m/s, ω rad/s].

        A command beyond ``max_speed`` is scaled down as a whole, which keeps the curvature of the path.
        Raises ValueError for a command that is not finite.
        """
        if not (np.isfinite(v) and np.isfinite(omega)):
            raise ValueError(f"command: expected finite [v, ω], got [{v}, {omega}]")
        rims = self.robot.rim_speeds(v, omega)
        goal = (rims / max(1.0, np.abs(rims).max() / self.robot.max_speed)).tolist()
        self._contact = False
        before, h = self._ticks(), self.dt / self.substeps
        ramp = self.robot.max_acceleration * h
        for i in range(self.substeps):
            # pymunk moves bodies first and updates velocities after, so what is set now acts from the next substep
            # on; the last one already belongs to the next period's creep.
            if i == self.substeps - 1:
                self._slip = self._creep()
            self._travel += np.multiply(self._rims, h)
            self._rims = [rim + min(max(g - rim, -ramp), ramp) for rim, g in zip(self._rims, goal, strict=True)]
            self.space.step(h)
        self._steps += 1
        turned = (self._ticks() - before) * (2 * np.pi / self.robot.ticks)
        self._odometry = self.robot.body_speeds(turned * self.robot.wheel_radius / self.dt)

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

    def _touch(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        self._contact = True

    def _creep(self) -> list[float]:
        """Ground speed over rim speed, left and right, for one control period."""
        return [1.0 + self.robot.slip * float(n) for n in self._rng.standard_normal(2)]

    def _ticks(self) -> np.ndarray:
        per_metre = self.robot.ticks / (2 * np.pi * self.robot.wheel_radius)
        return np.floor(self._travel * per_metre).astype(np.int64)

    def _build(self) -> None:
        static = self.space.static_body
        fixed: list[pymunk.Shape] = [pymunk.Segment(static, w.start, w.end, 0.0) for w in self.arena.walls]
        fixed += [pymunk.Circle(static, c.radius, c.position) for c in self.arena.cylinders]
        self._body = pymunk.Body(self.robot.mass, pymunk.moment_for_circle(self.robot.mass, 0, self.robot.radius))
        self._body.position, self._body.angle = self.arena.start[:2], self.arena.start[2]
        self._body.velocity_func = self._roll
        disc = pymunk.Circle(self._body, self.robot.radius)
        disc.collision_type, disc.friction = ROBOT, 0.3
        disc.filter = pymunk.ShapeFilter(categories=ROBOT)
        self._crates = [self._add_crate(crate) for crate in self.arena.crates]
        for shape in fixed:
            shape.friction = 0.5
            shape.filter = pymunk.ShapeFilter(categories=OBSTACLE)
        self.space.add(*fixed, self._body, disc)
        for hit in self.space.shape_query(disc):
            if hit.shape is not disc and min(p.distance for p in hit.contact_point_set.points) < -1e-6:
                raise ValueError(f"arena {self.arena.name!r}: the robot (radius {self.robot.radius} m) would start "
                                 f"inside something at {list(self.arena.start)}")  # fmt: skip

    def _add_crate(self, crate: Crate) -> pymunk.Body:
        body = pymunk.Body(crate.mass, pymunk.moment_for_box(crate.mass, crate.size))
        body.position, body.angle = crate.pose[:2], crate.pose[2]
        box = pymunk.Poly(body, [tuple(c) for c in crate.corners])
        box.friction, box.filter = 0.3, pymunk.ShapeFilter(categories=OBSTACLE)
        self.space.add(body, box)
        # Friction with the floor, in Chipmunk's idiom: joints to the ground that never correct a position
        # (max_bias 0) and yield beyond a force, here µ m g, and a torque, µ m g times the mean lever arm.
        slide = pymunk.PivotJoint(self.space.static_body, body, (0, 0), (0, 0))
        spin = pymunk.GearJoint(self.space.static_body, body, 0.0, 1.0)
        slide.max_bias = spin.max_bias = 0.0
        slide.max_force = FLOOR_FRICTION * crate.mass * GRAVITY
        spin.max_force = slide.max_force * 0.38 * np.sqrt(crate.size[0] * crate.size[1])
        self.space.add(slide, spin)
        return body


def _bounded(pull: float, slide: float, limit: float) -> tuple[float, float]:
    """An impulse in the ground plane, shortened to what friction can give."""
    size = (pull * pull + slide * slide) ** 0.5
    scale = 1.0 if size <= limit else limit / size
    return pull * scale, slide * scale
