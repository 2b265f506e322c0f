r"""Two other corrections, to stand beside the EKF's: linearised again at its own result, and with sigma points.

Both take a belief and a measurement as ``ekf.correct`` does, one belief or many, and leave a belief whose measurement
is NaN as it was.  The package filters with neither: on a belief as small as a robot usually has, all three agree.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.ekf import Correction
from coursekit.gaussian import Gaussian
from coursekit.geometry import Array
from coursekit.models import SensorModel


def iterated(
    belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None, *, rounds: int = 5
) -> Correction:
    r"""Linearise h where the estimate x now is:  x ← μ + K (z - h(x) - H (μ - x)),  ``rounds`` times from x = μ.

    These are Gauss-Newton steps to the most probable state; one round is the EKF's correction.  P - K S Kᵀ is taken
    at the last x.  innovation, its covariance and nis are those of the first round, for they judge the prediction.

    Parameters
    ----------
    belief : over the state, n entries; or many, (..., n).
    sensor : with h, H, R and residual, see ``models``.
    z : (..., m) in the sensor's units; NaN where nothing was measured.
    R : (m, m) or (..., m, m), takes the place of ``sensor.R``.

    Raises what the sensor raises for a z or a state that does not fit it, and ValueError for fewer than one round.

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 10.5.2; Bell & Cathey (1993).

    >>> from coursekit.models import RangeBearing
    >>> wide, beacon = Gaussian([0.0, 0.0, 0.0], np.diag([1.0, 1.0, 0.5]) ** 2), RangeBearing([2.0, 0.0])
    >>> iterated(wide, beacon, [2.0, 1.0]).belief.mean.round(2)
    array([ 0.26, -0.98, -0.49])
    """
    if rounds < 1:
        raise ValueError(f"rounds: expected at least 1, got {rounds}")
    mu, P = belief.mean, belief.cov
    made, z, R = _measured(belief, sensor, z, R)
    x, seen = mu, []
    for _ in range(rounds):
        H, nu = sensor.H(x), sensor.residual(z, sensor.h(x))
        S = H @ P @ _T(H) + R
        K = _T(np.linalg.solve(S, H @ P))
        x = mu + _times(K, nu - _times(H, mu - x))
        seen.append((nu, S))
    return _correction(belief, sensor, made, x, P - K @ S @ _T(K), *seen[0])


def unscented(belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Correction:
    r"""Send 2n sigma points through h itself, and take means and covariances of what comes out.

    The points are μ ± √n times each column of the Cholesky factor of P: together they have mean μ and covariance P.
    With d the points less μ and y their measurements less the mean of these, S = mean(y yᵀ) + R and
    K = mean(d yᵀ) S⁻¹.  No Jacobian is asked for.  (Weights: κ = 0, so that the point at μ weighs nothing.)

    Parameters, as for ``iterated``: belief (..., n), sensor, z (..., m), R (m, m) or (..., m, m).  Raises what the
    sensor raises for a z or a state that does not fit it.

    Source: Julier & Uhlmann (1997), section 3; Thrun, Burgard & Fox (2005), table 3.4.

    >>> from coursekit.models import RangeBearing
    >>> wide, beacon = Gaussian([0.0, 0.0, 0.0], np.diag([1.0, 1.0, 0.5]) ** 2), RangeBearing([2.0, 0.0])
    >>> unscented(wide, beacon, [2.0, 1.0]).belief.mean.round(2)
    array([ 0.2 , -0.98, -0.59])
    """
    mu, P = belief.mean, belief.cov
    made, z, R = _measured(belief, sensor, z, R)
    n = mu.shape[-1]
    columns = np.sqrt(n) * _T(belief.factor)
    d = np.concatenate([columns, -columns], axis=-2)  # (..., 2n, n)
    middle = sensor.h(mu)
    y = sensor.residual(sensor.h(mu[..., None, :] + d), middle[..., None, :])  # angles are averaged as differences
    mean = y.mean(axis=-2)
    y = y - mean[..., None, :]
    S = _T(y) @ y / (2 * n) + R
    K = _T(np.linalg.solve(S, _T(y) @ d / (2 * n)))
    nu = sensor.residual(z, middle) - mean
    return _correction(belief, sensor, made, mu + _times(K, nu), P - K @ S @ _T(K), nu, S)


def _measured(belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None) -> tuple[Array, Array, Array]:
    """Which measurements were made; z, with what is expected where none was; and R."""
    z = np.asarray(z, dtype=float)
    made = np.isfinite(z).all(axis=-1)
    return made, np.where(made[..., None], z, sensor.h(belief.mean)), np.asarray(sensor.R if R is None else R)


def _correction(
    belief: Gaussian, sensor: SensorModel, made: Array, x: Array, P: Array, nu: Array, S: Array
) -> Correction:
    """The correction to x and P; where nothing was measured, the belief as it was, and no innovation."""
    x = np.where(made[..., None], x, belief.mean)
    if hasattr(sensor, "wrap_state"):
        x = sensor.wrap_state(x)
    P = np.where(made[..., None, None], 0.5 * (P + _T(P)), belief.cov)
    nu = np.where(made[..., None], nu, np.nan)
    return Correction(Gaussian.trusted(x, P), nu, S, np.sum(nu * np.linalg.solve(S, nu[..., None])[..., 0], axis=-1))


def _T(matrices: Any) -> Array:
    return np.asarray(np.swapaxes(matrices, -1, -2))


def _times(matrices: Array, vectors: Array) -> Array:
    """Each matrix times its vector."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
