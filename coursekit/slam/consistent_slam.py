r"""Two EKF-SLAMs that do not grow sure of what nobody can measure (Lab 5, going further).

Move and turn the whole world, robot and landmarks together: no range and no bearing changes.  These three directions
must never gain information.  In ``EkfSlam`` the heading does, for two Jacobians of one landmark that were taken at two
estimates disagree about which direction that is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import Gaussian
from coursekit.geometry import Array, wrap_angle
from coursekit.models import MotionModel, range_bearing
from coursekit.slam.ekf_slam import EkfSlam, jacobian
from coursekit.slam.observations import Association, Indices, Observations

_STRAIGHT = 2e-3  # m and rad: over a correction this small h is straight to a few micrometres
_MOST_ITERATIONS = 6
_SURE_HEADING = 0.01  # rad: below it, association needs no second linearization
_FIT_ITERATIONS = 3
_QUARTER_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


class FirstEstimateSlam(EkfSlam):
    """EKF-SLAM whose Jacobians are taken where pose and landmarks were *first* estimated.

    The directions that cannot be observed stay unobserved, so the pose is nearly honest.  The map is not, once the
    heading was badly known: a linear correction moves it along tangents, and a first estimate that was bad stays the
    linearization point for ever.  On a long drive it can run away, and then ``lost`` says so; use ``InvariantSlam``.
    Arguments and results as ``EkfSlam``; raises as ``EkfSlam``.

    >>> from coursekit.models import DifferentialDrive
    >>> from coursekit.slam.association import Known
    >>> slam = FirstEstimateSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Known())
    >>> slam.observe([[2.0, 0.0]], np.diag([0.05, 0.01]) ** 2, ids=["door"])
    array([0])

    Source: Huang, Mourikis & Roumeliotis (2010), section 4.
    """

    def __init__(self, pose: Gaussian, motion: MotionModel, associate: Association, **options: Any) -> None:
        super().__init__(pose, motion, associate, **options)
        self._predicted = self._x[:3].copy()  # the pose before the last correction
        self._first = np.empty((0, 2))

    def _motion(self, control: ArrayLike, dt: float) -> tuple[Array, Array, Array]:
        x, F, Q = super()._motion(control, dt)
        # The step as seen from where the pose was predicted, not from where it was corrected to.
        F = F.copy()
        F[0, 2] -= self._x[1] - self._predicted[1]
        F[1, 2] += self._x[0] - self._predicted[0]
        return x, F, Q

    def predict(self, control: ArrayLike, dt: float) -> None:
        """As ``EkfSlam.predict``."""
        super().predict(control, dt)
        self._predicted = self._x[:3].copy()

    def _observations(self, z: Array, R: Array, ids: Any) -> Observations:
        return replace(super()._observations(z, R, ids), linearization_point=(self._predicted, self._first))

    def _linearized_at(self, j: int) -> tuple[Array, Array]:
        return self._predicted, self._first[j]

    def _grow(self, places: Array, cross: Array, corner: Array) -> None:
        super()._grow(places, cross, corner)
        self._first = np.vstack([self._first, places])

    def _own_numbers(self) -> dict[str, Any]:
        return {"predicted": self._predicted, "first": self._first}

    def _take_own_numbers(self, numbers: Mapping[str, Any]) -> None:
        self._predicted, self._first = numbers["predicted"], numbers["first"]

    def _keep(self, kept: list[int]) -> None:
        super()._keep(kept)
        self._first = self._first[kept]


class InvariantSlam(EkfSlam):
    r"""EKF-SLAM in which a corrected heading turns the map along the arc, and every look is linearized where it ends.

    The state's error is that of a rigid motion of robot and landmarks.  A correction δ with the turn δθ moves each
    point p by V(δθ) δp instead of δp, where V(δθ) = [[sin δθ, cos δθ - 1], [1 - cos δθ, sin δθ]] / δθ is the chord
    that belongs to an arc's tangent.  The covariance is carried along by C = I + g e_θᵀ, with g each point's move
    turned by a quarter.  Then the unobservable directions are the same at every estimate, and stay unobserved.

    Each correction is iterated (Gauss-Newton): linearized again at its own result until that no longer moves.  The
    distances that ``associate`` sees are linearized where the best single pair would put the robot, so that an old
    landmark is known again although the heading was off by a tenth of a radian.

    Arguments and results as ``EkfSlam``; raises as ``EkfSlam``.

    >>> from coursekit.models import DifferentialDrive
    >>> from coursekit.slam.association import Mahalanobis
    >>> slam = InvariantSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Mahalanobis(0.99))
    >>> [slam.observe([[2.0, 0.0]], np.diag([0.05, 0.01]) ** 2).tolist() for _ in range(2)]
    [[-1], [0]]

    Source: Barrau & Bonnabel (2015); Zhang, Wu, Song, Huang & Dissanayake (2017).  Iterated update: Bar-Shalom, Li &
    Kirubarajan (2001), section 10.5.
    """

    def _observations(self, z: Array, R: Array, ids: Any) -> Observations:
        plain = super()._observations(z, R, ids)
        return _Relinearized(
            plain.z, plain.R, plain.pose, plain.landmarks, plain.linearization_point, plain.covariances, plain.between,
            plain.ids, plain.labels, columns=self._P.columns,
        )  # fmt: skip

    def _correct(self, observations: Observations, chosen: Indices) -> None:
        """Gauss-Newton for min δᵀ P⁻¹ δ + νᵀ R⁻¹ ν over the matched pairs, then P in the coordinates of its end."""
        matched = [(i, j) for i, j in enumerate(chosen.tolist()) if j >= 0]
        self.nis, self.dof = 0.0, 0
        if not matched:
            return
        z, delta = observations.z[[i for i, _ in matched]], np.zeros_like(self._x)
        for _ in range(_MOST_ITERATIONS):
            x = displaced(self._x, delta)
            g = carried(self._x, x)
            H = [_with_turn(jacobian(x[:3], x[3 + 2 * j : 5 + 2 * j], j), g, j) for _, j in matched]
            nu = np.concatenate([
                range_bearing.residual(z_i, range_bearing.h(x[:3], x[3 + 2 * j : 5 + 2 * j]))
                + H_j.dot(delta[[0, 1, 2, 3 + 2 * j, 4 + 2 * j]])
                for z_i, H_j, (_, j) in zip(z, H, matched, strict=True)
            ])  # fmt: skip
            W, w, _ = self._gain(H, nu, matched, observations.R)
            before, delta = delta, W.dot(w)
            if np.abs(delta - before).max() < _STRAIGHT:
                break
        self._shift(W, w)
        self.nis, self.dof = float(w.dot(w)), len(nu)

    def _shift(self, W: Array, w: Array) -> None:
        x = displaced(self._x, W.dot(w))
        self._P.downdate(W)
        self._P.turn(carried(self._x, x))
        self._x = x
        self._x[2] = wrap_angle(float(x[2]))


def displaced(x: Array, delta: Array) -> Array:
    """A state (n,) after a correction (n,): each point moves along the arc to which δp is tangent.

    >>> displaced(np.array([0.0, 0.0, 0.0, 1.0, 0.0]), np.array([0.0, 0.0, np.pi / 2, 0.0, np.pi / 2])).round(3) + 0.0
    array([0.   , 0.   , 1.571, 0.   , 1.   ])
    """
    moved = x + delta
    V = chord(delta[2])
    moved[:2] = x[:2] + V.dot(delta[:2])
    moved[3:] = x[3:] + (delta[3:].reshape(-1, 2) @ V.T).ravel()
    return moved


def chord(turn: ArrayLike) -> Array:
    """V(δθ), (...) → (..., 2, 2): the mean of the rotations by 0 … δθ."""
    turn = np.asarray(turn, dtype=float)
    s, c = np.sinc(turn / np.pi), np.sin(0.5 * turn) * np.sinc(0.5 * turn / np.pi)  # sin δθ / δθ, (1 - cos δθ) / δθ
    return np.stack([np.stack([s, -c], axis=-1), np.stack([c, s], axis=-1)], axis=-2)


def carried(x: Array, moved: Array) -> Array:
    """g (n,) of C = I + g e_θᵀ: each point's move turned by a quarter, nothing for the heading itself."""
    g = np.zeros_like(x)
    g[:2] = _QUARTER_TURN.dot(moved[:2] - x[:2])
    g[3:] = ((moved[3:] - x[3:]).reshape(-1, 2) @ _QUARTER_TURN.T).ravel()
    return g


def _with_turn(H: Array, g: Array, j: int) -> Array:
    """H C for one landmark: its five columns, of which only the heading's changes."""
    H = H.copy()
    H[:, 2] += H[:, :2].dot(g[:2]) + H[:, 3:].dot(g[3 + 2 * j : 5 + 2 * j])
    return H


@dataclass(frozen=True, eq=False)
class _Relinearized(Observations):
    """Observations linearized where the best single pair would put robot and map; ``columns`` are those of P."""

    columns: Callable[[list[int]], Array] = field(kw_only=True)

    @cached_property
    def delta(self) -> Array:
        """The correction of the state (3 + 2n,) by the pair of measurement and landmark that fits best."""
        pose_cov, cross, landmark_cov = self.covariances()
        m, n = len(self.z), len(self.landmarks)
        if not n or pose_cov[2, 2] < _SURE_HEADING**2:
            return np.zeros(3 + 2 * n)
        P = np.empty((n, 5, 5))  # of the pose and one landmark
        P[:, :3, :3], P[:, 3:, :3], P[:, :3, 3:], P[:, 3:, 3:] = pose_cov, cross, cross.swapaxes(1, 2), landmark_cov
        delta = np.zeros((m, n, 5))
        for _ in range(_FIT_ITERATIONS):
            V = chord(delta[..., 2])
            place, landmarks = self.pose[:2] + _times(V, delta[..., :2]), self.landmarks + _times(V, delta[..., 3:])
            pose = np.concatenate([place, self.pose[2] + delta[..., 2:3]], axis=-1)
            H = np.concatenate([range_bearing.H(pose, landmarks), range_bearing.H_landmark(pose, landmarks)], axis=-1)
            H[..., 2] += _times(H[..., :2], (place - self.pose[:2]) @ _QUARTER_TURN.T)
            H[..., 2] += _times(H[..., 3:], (landmarks - self.landmarks) @ _QUARTER_TURN.T)
            nu = range_bearing.residual(self.z[:, None], range_bearing.h(pose, landmarks)) + _times(H, delta)
            weights = np.linalg.solve(H @ P @ H.swapaxes(-1, -2) + self.R[:, None], nu[..., None])[..., 0]
            delta = np.nan_to_num(_times(P @ H.swapaxes(-1, -2), weights))  # NaN: a landmark under the robot
        i, j = np.unravel_index(np.nanargmin(np.sum(nu * weights, axis=-1)), (m, n))
        return self.columns([0, 1, 2, 3 + 2 * int(j), 4 + 2 * int(j)]) @ (H[i, j].T @ weights[i, j])

    @cached_property
    def _moved(self) -> tuple[Array, Array, Array]:
        """The pose (3,) and the landmarks (n, 2) of the linearization point, and g (3 + 2n,)."""
        x = np.concatenate([self.pose, self.landmarks.ravel()])
        moved = displaced(x, self.delta)
        return moved[:3], moved[3:].reshape(-1, 2), carried(x, moved)

    @cached_property
    def jacobians(self) -> tuple[Array, Array]:
        """∂h/∂pose (n, 2, 3) and ∂h/∂landmark (n, 2, 2) there, in the coordinates of the state."""
        pose, landmarks, g = self._moved
        Hx, Hl = range_bearing.H(pose, landmarks), range_bearing.H_landmark(pose, landmarks)
        Hx[..., 2] += Hx[..., :2] @ g[:2] + _times(Hl, g[3:].reshape(-1, 2))
        return Hx, Hl

    @cached_property
    def innovations(self) -> Array:
        """ν (m, n, 2), as the linearization there predicts them for the state as it is."""
        (pose, landmarks, _), (Hx, Hl) = self._moved, self.jacobians
        nu = range_bearing.residual(self.z[:, None], range_bearing.h(pose, landmarks))
        return nu + Hx @ self.delta[:3] + _times(Hl, self.delta[3:].reshape(-1, 2))


def _times(matrices: Array, vectors: Array) -> Array:
    """(..., a, b) and (..., b) → (..., a)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
