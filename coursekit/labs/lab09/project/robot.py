"""The package's own design for the capstone: wheels and lidar make a step, the tags make the map."""

from __future__ import annotations

import numpy as np

from coursekit import geometry, icp
from coursekit.gaussian import Gaussian, mahalanobis_squared, symmetrize
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive, pose_residual
from coursekit.slam import InvariantSlam
from coursekit.slam.association import Mahalanobis
from coursekit.world.pilot import Pilot

ARC = DifferentialDrive()
STILL = Gaussian(np.zeros(3), 1e-12 * np.eye(3))
GATE = 30.7  # χ² with three degrees of freedom: one honest error in a million is larger; a drive has a hundred scans
AHEAD, BESIDE = 0.65, 0.28  # m: something that stands so near in front of the robot stops it


def along_the_arc(belief: Gaussian, control: Array, control_cov: Array, dt: float) -> Gaussian:
    """A belief over a pose, or over a step, after one period of odometry [v, ω] with this covariance (2, 2)."""
    x = belief.mean
    F, G = ARC.F(x, control, dt), ARC.G(x, control, dt)
    cov = F @ belief.cov @ F.T + G @ control_cov @ G.T + STILL.cov
    return Gaussian(ARC.f(x, control, dt), symmetrize(cov))


class Step:
    """A motion model whose control is a step [dx, dy, dθ] in the robot's own frame, with a covariance of its own."""

    def __init__(self) -> None:
        self.cov = STILL.cov

    def f(self, x: Array, u: Array, dt: float) -> Array:
        """The pose after the step."""
        return geometry.compose(x, u)

    def F(self, x: Array, u: Array, dt: float) -> Array:
        """∂f/∂x."""
        F = np.eye(3)
        F[:2, 2] = geometry.rotation(x[2] + np.pi / 2) @ u[:2]
        return F

    def Q(self, x: Array, u: Array, dt: float) -> Array:
        """The step's covariance, turned into the world."""
        G = np.eye(3)
        G[:2, :2] = geometry.rotation(x[2])
        return G @ self.cov @ G.T

    def sample(self, states: Array, u: Array, dt: float, rng: np.random.Generator) -> Array:
        """Poses after steps with drawn errors."""
        errors = rng.standard_normal((len(states), 3)) @ np.linalg.cholesky(self.cov).T
        return geometry.compose(states, u + errors)


class Starter:
    """A robot that drives by its wheels alone, in parts.  A design may begin as a subclass and replace any of them.

    mean (3,), cov (3, 3) : the belief over [x, y, θ].     landmarks (n, 2) : the map.     points (m, 2) : last scan.
    """

    def __init__(self, mean: Array, cov: Array, waypoints: Array) -> None:
        self.mean, self.cov, self.waypoints = mean, cov, waypoints
        self.points = np.empty((0, 2))
        self.pilot, self.goal = Pilot(speed=0.4, turn_rate=1.0, tolerance=0.06), 0

    @property
    def landmarks(self) -> Array:
        """The map: none."""
        return np.empty((0, 2))

    def move(self, control: Array, control_cov: Array, dt: float) -> None:
        """Wheels: the belief moves along the arc."""
        belief = along_the_arc(Gaussian(self.mean, self.cov), control, control_cov, dt)
        self.mean, self.cov = belief.mean, belief.cov

    def scan(self, points: Array) -> None:
        """Lidar: kept, and not used."""
        self.points = points

    def see(self, ids: np.ndarray, z: Array, R: Array) -> None:
        """Camera: not used."""

    def command(self) -> Array | None:
        """Towards the next waypoint, by the estimate; no step ahead while something stands there; None at the end."""
        if np.hypot(*(self.waypoints[self.goal] - self.mean[:2])) < self.pilot.tolerance:
            self.goal += 1
            self.pilot.reset()
        if self.goal == len(self.waypoints):
            return None
        v, omega = self.pilot.control(self.mean, self.waypoints[self.goal], 0.1)
        return np.array([0.0 if self.blocked() else v, omega])

    def blocked(self) -> bool:
        """Does something stand close ahead?  Not looked at."""
        return False


class Reference(Starter):
    """The package's own: what is in front of the robot stops it, lidar mends the step, the tags make the map."""

    def __init__(self, mean: Array, cov: Array, waypoints: Array) -> None:
        super().__init__(mean, cov, waypoints)
        self.model = Step()
        self.slam = InvariantSlam(Gaussian(mean, cov), self.model, Mahalanobis(0.999), n_init=3)
        self.step = STILL  # since the last scan, in the frame of the pose there

    @property
    def landmarks(self) -> Array:
        """The tags that were seen three times or more, (n, 2)."""
        return self.slam.landmarks

    def move(self, control: Array, control_cov: Array, dt: float) -> None:
        """Wheels: the step grows along the arc."""
        self.step = along_the_arc(self.step, control, control_cov, dt)
        self._believe()

    def scan(self, points: Array) -> None:
        """Lidar: ICP measures the whole step once more.  Then the map's pose makes it."""
        if min(len(points), len(self.points)) >= 20:
            self.step = self.registered(points)
        self.model.cov = self.step.cov
        self.slam.predict(self.step.mean, 1.0)
        self.step, self.points = STILL, points
        self._believe()

    def see(self, ids: np.ndarray, z: Array, R: Array) -> None:
        """Camera: the map's gate says which tag it was.  The ids are misread now and then, so they are not used."""
        self.slam.observe(z, R)
        self._believe()

    def registered(self, points: Array) -> Gaussian:
        """The step by wheels and ICP together; by wheels alone where the two disagree."""
        wheels, start = self.step, np.eye(3)
        start[:2, :2], start[:2, 2] = geometry.rotation(wheels.mean[2]), wheels.mean[:2]
        fit = icp.align(points, self.points, initial=start, metric="point_to_plane", kernel="cauchy",
                        max_distance=0.3, tolerance=1e-4)  # fmt: skip
        if fit.covariance is None:
            return wheels
        nu, S = pose_residual(fit.pose, wheels.mean), wheels.cov + fit.covariance
        if mahalanobis_squared(nu, S) > GATE:
            return wheels
        K = np.linalg.solve(S, wheels.cov).T
        return Gaussian(wheels.mean + K @ nu, symmetrize(wheels.cov - K @ S @ K.T))

    def blocked(self) -> bool:
        """Did the last scan see something close ahead?"""
        x, y = self.points.T
        return bool(np.any((x > 0) & (x < AHEAD) & (np.abs(y) < BESIDE)))

    def _believe(self) -> None:
        """The pose now: the map's, and the step since."""
        x, P, u = self.slam.pose.mean, self.slam.pose.cov, self.step.mean
        self.model.cov = self.step.cov
        F = self.model.F(x, u, 0.0)
        self.mean, self.cov = geometry.compose(x, u), symmetrize(F @ P @ F.T + self.model.Q(x, u, 0.0))
