"""The explorer on the front page, made of the project's own models.

A robot drives past five landmarks, slipping a little all the way.  Orange: five hundred drives with the same
commands, which is all that its wheels know.  Blue: what is left of the doubt when it measures the landmarks as well.
"""

from __future__ import annotations

import numpy as np

from coursekit.gaussian import Gaussian, ellipse
from coursekit.models import DifferentialDrive, RangeBearing
from coursekit.teaching import plotting
from coursekit.teaching.explore import Explorer, Slider, explore

DT, STEPS, EVERY = 0.2, 210, 10
LANDMARKS = {"red": (2.6, 2.0), "green": (4.4, -1.6), "blue": (7.6, 2.7), "cyan": (10.4, -1.6), "magenta": (12.6, 2.6)}
REACH = 3.4  # metres at which the camera still sees a landmark
WHEELS, BOTH = "its wheels", "its wheels and the landmarks"


def controls() -> np.ndarray:
    """A gentle S between the landmarks, (STEPS, 2) of [v m/s, ω rad/s]."""
    t = np.arange(STEPS) * DT
    return np.stack([np.full(STEPS, 0.32), 0.13 * np.sin(2 * np.pi * t / 27.0 + 1.4)], axis=-1)


def drive(seed: int = 11) -> tuple[np.ndarray, list[np.ndarray], list[Gaussian]]:
    """The true path (STEPS + 1, 3); each EVERY steps, the cloud of the wheels (500, 3) and the corrected belief."""
    rng = np.random.default_rng(seed)
    wheels = DifferentialDrive(sigma_v=0.08, sigma_omega=0.055)
    pose = np.array([0.0, 0.0, -0.15])
    belief, cloud = Gaussian(pose, np.diag([0.02, 0.02, 0.01]) ** 2), np.tile(pose, (500, 1))
    path, clouds, beliefs = [pose], [cloud], [belief]
    for k, u in enumerate(controls(), 1):
        pose = wheels.sample(pose[None], u, DT, rng)[0]
        cloud = wheels.sample(cloud, u, DT, rng)
        F = wheels.F(belief.mean, u, DT)
        belief = Gaussian(wheels.f(belief.mean, u, DT), F @ belief.cov @ F.T + wheels.Q(belief.mean, u, DT))
        for landmark in LANDMARKS.values():
            sensor = RangeBearing(landmark, R=np.diag([0.3**2, 0.06**2]))
            if sensor.h(pose)[0] < REACH and k % 8 == 0:
                belief = correct(belief, sensor, sensor.h(pose) + rng.multivariate_normal([0, 0], sensor.R))
        path.append(pose)
        if k % EVERY == 0:
            clouds.append(cloud)
            beliefs.append(belief)
    return np.array(path), clouds, beliefs


def correct(belief: Gaussian, sensor: RangeBearing, z: np.ndarray) -> Gaussian:
    """Kalman's correction; Lab 4 derives it."""
    H = sensor.H(belief.mean)
    K = np.linalg.solve(H @ belief.cov @ H.T + sensor.R, H @ belief.cov).T
    A = np.eye(3) - K @ H
    cov = A @ belief.cov @ A.T + K @ sensor.R @ K.T
    return Gaussian(belief.mean + K @ sensor.residual(z, sensor.h(belief.mean)), 0.5 * (cov + cov.T))


def doubt(points: np.ndarray) -> float:
    """The radius [m] around their middle that holds 95 % of the points (n, 2)."""
    return float(np.quantile(np.linalg.norm(points - points.mean(axis=0), axis=-1), 0.95))


class Cover:
    """The scene: the way so far, where the robot really is, and where it may be for all it knows."""

    def __init__(self) -> None:
        self.path, self.clouds, self.beliefs = drive()
        self.figure = plotting.figure(8.4, 3.7)
        self.figure.get_layout_engine().set(rect=(0, 0, 1, 0.95))  # the axes fill the height: room for the title
        ax = plotting.axes(self.figure)
        for colour, (x, y) in LANDMARKS.items():
            ax.plot(x, y, "o", ms=11, color=plotting.LANDMARK_COLOURS[colour], mec=plotting.WALL, mew=0.8)
        self.rays = [ax.plot([], [], color=plotting.ODOMETRY, lw=0.9, alpha=0.8)[0] for _ in LANDMARKS]
        (self.dots,) = ax.plot([], [], ".", ms=4, color=plotting.MEASUREMENT, alpha=0.45, mew=0)
        (self.way,) = ax.plot([], [], color=plotting.TRUTH, lw=1.3, ls=(0, (4, 2)))
        self.robot = plotting.draw_robot(ax, self.path[0], colour=plotting.TRUTH, size=0.36)
        (self.ring,) = ax.plot([], [], color=plotting.ESTIMATE, lw=2.4, zorder=6)
        self.title = ax.set_title("After", loc="left")  # so that the layout leaves room for it
        ax.set(xlim=(-0.6, 14.4), ylim=(-2.5, 3.3), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        self.moving = [*self.rays, self.dots, self.way, self.robot, self.ring, self.title]

    def now(self, time: float) -> tuple[np.ndarray, np.ndarray, Gaussian]:
        """The true pose, the cloud and the belief at a time."""
        k = round(time / DT)
        return self.path[k], self.clouds[k // EVERY], self.beliefs[k // EVERY]

    def update(self, time: float, trust: str) -> None:
        pose, cloud, belief = self.now(time)
        sees = trust == BOTH
        for ray, landmark in zip(self.rays, LANDMARKS.values(), strict=True):
            seen = sees and np.linalg.norm(landmark - pose[:2]) < REACH
            ray.set_data(*(zip(pose[:2], landmark, strict=True) if seen else ([], [])))
        self.way.set_data(*self.path[: round(time / DT) + 1, :2].T)
        self.robot.set_xy(plotting.robot_outline(pose, 0.36))
        self.dots.set_data(*(np.empty((0, 2)) if sees else cloud[:, :2]).T)
        contour = belief.mean[:2] + ellipse(belief.cov[:2, :2])
        self.ring.set_data(*(contour if sees else np.empty((0, 2))).T)
        self.title.set_text(f"After {time:.0f} s it knows its place to {self.within(time, trust)}")

    def within(self, time: float, trust: str) -> str:
        """How well the place is known, in centimetres or metres: 95 % of the cloud, or the longer half-axis."""
        _, cloud, belief = self.now(time)
        contour = ellipse(belief.cov[:2, :2])
        radius = np.linalg.norm(contour, axis=-1).max() if trust == BOTH else doubt(cloud[:, :2])
        return f"{radius:.1f} m" if radius >= 0.995 else f"{100 * radius:.0f} cm"

    def words(self, time: float, trust: str) -> str:
        shape = "a small blue ellipse" if trust == BOTH else "a cloud of orange dots, five hundred drives"
        return f"A robot among five landmarks; it is somewhere in {shape}, known to {self.within(time, trust)}"


def explorer() -> Explorer:
    """Two controls, 44 pictures; it starts at the end of the drive, with the wheels alone."""
    scene = Cover()
    times = [float(t) for t in range(0, round(STEPS * DT) + 1, round(EVERY * DT))]
    time = Slider(times, label="Time", unit="s", start=times[-1], play=True)
    return explore(scene, alt=scene.words, time=time, trust=Slider([WHEELS, BOTH], label="The robot trusts"))
