"""Models of one's own, without a base class; one has no Jacobian, and gets one by differences."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from coursekit import Gaussian, ekf
from coursekit.models import Numerical, jacobian

Array = NDArray[np.float64]


class Falling:
    """[height, speed] of a stone."""

    def f(self, state: Array, nothing: Any, seconds: float) -> Array:
        height, speed = state
        return np.array([height + speed * seconds - 4.905 * seconds**2, speed - 9.81 * seconds])

    def F(self, x: Array, u: Any, dt: float) -> Array:
        return np.array([[1.0, dt], [0.0, 1.0]])

    def Q(self, x: Array, u: Any, dt: float) -> Array:
        return 1e-6 * np.eye(2)


class Camera:
    """The angle under which a camera 10 m away sees the stone."""

    R = np.array([[1e-4]])

    def h(self, x: Array) -> Array:
        return np.array([np.arctan2(x[0], 10.0)])

    def residual(self, z: Array, z_hat: Array) -> Array:
        return z - z_hat


belief = Gaussian([20.0, 0.0], [[1.0, 0.0], [0.0, 0.1]])
belief = ekf.predict(belief, Falling(), None, 0.5)
belief = ekf.correct(belief, Numerical(Camera()), [1.08]).belief
assert belief.cov[0, 0] < 1.0
assert jacobian(lambda x: [x[0] ** 2, x[0] * x[1]], [3, 2]).shape == (2, 2)
