r"""A differential-drive robot in a flat world with mass, friction and contacts, simulated by pymunk.

Seen from above there is no gravity in the plane; the floor acts through friction.  Motors turn the wheels at the
commanded speeds as fast as their acceleration allows.  Tyres drag the body after the wheels with a force that
friction bounds, so a robot that pushes a wall spins its wheels and its odometry counts metres that it never
went.  Tyres also slip a little all the time:
over a control period each wheel's ground speed is off by a random share of its rim speed.  Encoders count ticks of
the wheels and know nothing of any of this.

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

import math

import numpy as np
import pymunk
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array, wrap_angle
from coursekit.world._checks import count, number
from coursekit.world.arena import Arena, Crate
from coursekit.world.barriers import Barriers, too_thin
from coursekit.world.drive import GRAVITY, ROBOT, Drive, Robot

__all__ = ["GRAVITY", "OBSTACLE", "ROBOT", "Drive", "Robot", "World"]

FLOOR_FRICTION = 0.3  # of a crate
OBSTACLE = 2  # collision type, and bit of the shapes' filter categories


class World:
    """A robot in an arena, alone or in company.

    Parameters
    ----------
    arena : what stands where; the robot starts at ``arena.start``.
    seed : of the slip, an int or a ``numpy.random.Generator``.
    robot : what it is made of.
    dt : the control period in seconds; physics runs ``substeps`` times in it.
    others : (k, 3), where further robots of the same make start, [x, y, θ].  ``world.others`` are these robots, each
        with ``pose``, ``velocity``, ``odometry``, ``encoders``, ``wheels`` and ``contact`` of its own; a lidar of
        theirs is ``lidar.scan(world, pose=other.pose)``.  Cameras do not see robots, lidars do.

    Nothing passes a wall, a cylinder or a crate.  Raises ValueError when the robot would start inside something, and
    where one substep is too long to see a narrow robot or crate meet a wall; TypeError for what is no arena.

    Two robots that drive at each other, and meet:

    >>> world = World(Arena("hall"), seed=1, others=[[1.5, 0.0, np.pi]])
    >>> for _ in range(60):
    ...     world.step(0.5, 0.0, others=[[0.5, 0.0]])
    >>> world.contact, world.others[0].contact, bool(abs(world.pose[0] - 0.75 + world.robot.radius) < 0.1)
    (True, True, True)
    """

    def __init__(
        self,
        arena: Arena,
        seed: int | np.random.Generator,
        robot: Robot | None = None,
        dt: float = 0.05,
        substeps: int = 10,
        others: ArrayLike = (),
    ) -> None:
        robot = Robot() if robot is None else robot
        for name, value, kind in (("arena", arena, Arena), ("robot", robot, Robot)):
            if not isinstance(value, kind):
                hint = f"; Arena.load({value!r}) reads one" if isinstance(value, str) else ""
                raise TypeError(f"{name}: expected {kind.__name__}(…), got {value!r}{hint}")
        self.arena, self.robot = arena, robot
        self.dt, self.substeps = number(dt, "dt", above=0.0), count(substeps, "substeps")
        starts = as_numbers(others, "others") if np.size(others) else np.empty((0, 3))
        if starts.ndim != 2 or starts.shape[1] != 3 or not np.isfinite(starts).all():
            raise ValueError(f"others: expected a finite start [x, y, θ] for each, got {others!r}")
        self._steps, rng = 0, np.random.default_rng(seed)
        self._drive = Drive(robot, arena.start, rng)
        own = rng.spawn(len(starts)) if len(starts) else []  # the first robot's slip is the same in company
        self.others = tuple(Drive(robot, tuple(at), one) for at, one in zip(starts.tolist(), own, strict=True))
        self._drives = (self._drive, *self.others)
        self.space = pymunk.Space()
        self._build()
        self._refuse_what_could_pass_a_wall()
        reach = dict.fromkeys((drive.body for drive in self._drives), 0.0)
        reach |= {body: 0.5 * math.hypot(*crate.size) for body, crate in zip(self._crates, arena.crates, strict=True)}
        self._barriers = Barriers(self.space, reach, robot.top_speed)
        self.space.on_collision(ROBOT, None, post_solve=self._touch)

    # What the outside may know.

    @property
    def pose(self) -> Array:
        """T_world_robot = [x, y, θ], true."""
        return self._drive.pose

    @property
    def velocity(self) -> Array:
        """[forward, leftward, turning] in m/s, m/s, rad/s in the robot's frame, true."""
        return self._drive.velocity

    @property
    def time(self) -> float:
        """Seconds since the start."""
        return self._steps * self.dt

    @property
    def odometry(self) -> Array:
        """Measured [v m/s, ω rad/s] over the last control period, from whole encoder ticks."""
        return self._drive.odometry

    @property
    def encoders(self) -> np.ndarray:
        """Ticks counted since the start, [left, right]."""
        return self._drive.encoders

    @property
    def wheels(self) -> Array:
        """True angular speeds of the wheels, [left, right] in rad/s."""
        return self._drive.wheels

    @property
    def contact(self) -> bool:
        """Did the robot touch anything during the last control period?"""
        return self._drive.contact

    @property
    def crates(self) -> Array:
        """Where the crates are now, in the arena's order, (n, 3)."""
        poses = [[*body.position, wrap_angle(body.angle)] for body in self._crates]
        return np.array(poses, dtype=float).reshape(-1, 3)

    # What moves it.

    def step(self, v: float, omega: float, others: ArrayLike = ()) -> None:
        """Drive for one control period with the command [v m/s, ω rad/s].

        others : (k, 2), the commands of the other robots; without them they brake.

        A command beyond ``max_speed`` is scaled down as a whole, which keeps the curvature of the path.
        Raises ValueError for a command that is not two finite numbers, or commands that are not one for each of the
        others; TypeError for what is no number.
        """
        command = as_numbers(v, "command"), as_numbers(omega, "command")
        if any(c.ndim or not np.isfinite(c) for c in command):
            raise ValueError(f"command: expected finite [v, ω], got [{v}, {omega}]")
        commands = as_numbers(others, "others") if np.size(others) else np.zeros((len(self.others), 2))
        if commands.shape != (len(self.others), 2) or not np.isfinite(commands).all():
            raise ValueError(f"others: expected finite [v, ω] for each of {len(self.others)}, got {others!r}")
        for drive, aim in zip(self._drives, [(v, omega), *commands.tolist()], strict=True):
            drive.aim(*aim)
        h = self.dt / self.substeps
        for i in range(self.substeps):
            for drive in self._drives:
                drive.turn_wheels(h, last=i == self.substeps - 1)
            self._barriers.step(h)
        self._steps += 1
        for drive in self._drives:
            drive.count(self.dt)

    def _touch(self, arbiter: pymunk.Arbiter, space: pymunk.Space, data: object) -> None:
        for drive in self._drives:
            drive.contact |= drive.disc in arbiter.shapes

    def _build(self) -> None:
        static = self.space.static_body
        fixed: list[pymunk.Shape] = [pymunk.Segment(static, w.start, w.end, 0.0) for w in self.arena.walls]
        fixed += [pymunk.Circle(static, c.radius, c.position) for c in self.arena.cylinders]
        self._crates = [self._add_crate(crate) for crate in self.arena.crates]
        for shape in fixed:
            shape.friction = 0.5
            shape.filter = pymunk.ShapeFilter(categories=OBSTACLE)
        self.space.add(*fixed)
        for drive in self._drives:
            self.space.add(drive.body, drive.disc)
        for drive in self._drives:
            for hit in self.space.shape_query(drive.disc):
                if hit.shape is not drive.disc and max(abs(p.distance) for p in hit.contact_point_set.points) > 1e-6:
                    raise ValueError(f"arena {self.arena.name!r}: the robot (radius {self.robot.radius} m) would start "
                                     f"inside something at {drive.pose.tolist()}")  # fmt: skip

    def _refuse_what_could_pass_a_wall(self) -> None:
        arena, widths = self.arena, [("the robot", 2 * self.robot.radius)]
        widths += [(f"crates[{i}]", min(crate.size)) for i, crate in enumerate(arena.crates)]
        if not (arena.walls or arena.cylinders or arena.crates or self.others):
            return
        if found := too_thin(widths, self.robot.top_speed, self.dt / self.substeps):
            raise ValueError(f"arena {arena.name!r}, dt={self.dt:g} s in {self.substeps} substeps: {found}")

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
