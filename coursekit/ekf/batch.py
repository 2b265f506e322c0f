"""The two steps for many beliefs at once: means (..., n), covariances (..., n, n), one for each run of an experiment.

The algebra is that of ``filter``, and a test holds the two equal.  A measurement that holds NaN or infinity was not
made, and one of a landmark right under the robot says nothing: each leaves its belief as it was, and its NIS is NaN.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.ekf.joseph import joseph
from coursekit.gaussian import Gaussian, check_covariance, check_covariances, factored
from coursekit.geometry import Array
from coursekit.models import MotionModel, SensorModel
from coursekit.models._vectors import square
from coursekit.models.checks import difference, expected, has_parts, moved

_ENOUGH = 1e-12  # of a determinant, see ``gaussian.share_left``: below, a matrix is looked at one by one


def predict(belief: Gaussian, motion: MotionModel, control: Any, dt: float) -> Gaussian:
    """N(f(μ, u), F P Fᵀ + Q), belief by belief; the control is (d,) for all or (..., d)."""
    try:
        mean, F, Q = moved(motion, belief.mean, control, dt)
    except ValueError as error:
        if "broadcast" not in str(error):
            raise
        raise ValueError(f"control: expected one for all or one for each of {belief.mean.shape[:-1]} beliefs, "
                         f"got shape {np.shape(control)}") from None  # fmt: skip
    n = mean.shape[-1]
    if mean.shape != belief.mean.shape or F.shape[-2:] != (n, n) or F.ndim not in (2, mean.ndim + 1):
        raise ValueError(f"motion: expected a model of many states at once, got f {mean.shape} and F {F.shape} "
                         f"for states {belief.mean.shape}")  # fmt: skip
    P = square(F @ belief.factor) + Q
    return _sound(mean, P, P) or _lifted(mean, P)


def correct(belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None) -> tuple[Any, ...]:
    """N(μ + K ν, (I - K H) P), belief by belief: the fields of a ``Correction``.

    z is (m,) for all or (..., m), R (m, m) for all or (..., m, m).
    """
    x, P = belief.mean, belief.cov
    z_hat, H = expected(sensor, x)
    R = _noise(R, sensor, z_hat)
    z, made = _measured(z, z_hat)
    if not math.isfinite(float(H.sum())):  # NaN where the model is undefined: those beliefs look elsewhere
        defined = np.isfinite(H).all(axis=(-2, -1))
        z_hat, H = _where(defined, z_hat, 0.0), _where(defined, H, 0.0)
        z, made = _where(defined, z, 0.0), defined if made is None else made & defined
    nu = difference(sensor, z, z_hat)

    HP = H @ P
    S = HP @ _T(H).copy() + R
    mean, after, nis = _update(x, P, HP, S, nu)
    if hasattr(sensor, "wrap_state"):
        mean = sensor.wrap_state(mean)
    if made is not None:
        mean, nu, after = (_where(made, *both) for both in ((mean, x), (nu, np.nan), (after, P)))
        nis = np.where(made, nis, np.nan)
    posterior = _sound(mean, after, P)
    if posterior is None:
        after = _joseph(P, H, R, S)
        posterior = _lifted(mean, after if made is None else _where(made, after, P))
    return posterior, nu, S, nis


def _sound(mean: Array, P: Array, prior: Array) -> Gaussian | None:
    """The beliefs, or None where rounding has left too little of a covariance: see ``gaussian.share_left``."""
    try:
        factor: Array = np.asarray(np.linalg.cholesky(P), dtype=float)
    except np.linalg.LinAlgError:
        return None
    left = factor.diagonal(0, -2, -1)
    least = (left * left / prior.diagonal(0, -2, -1)).min()
    return Gaussian.trusted(mean, P, factor) if least ** mean.shape[-1] > _ENOUGH else None


def _lifted(mean: Array, P: Array) -> Gaussian:
    """The beliefs, each covariance with its margin."""
    if not (np.isfinite(mean).all() and np.isfinite(P).all()):
        raise ValueError("expected finite beliefs, got some that are not: a control or a covariance is out of range")
    pairs = [factored(one) for one in P.reshape(-1, *P.shape[-2:])]
    return Gaussian.trusted(mean, *(np.reshape(part, P.shape) for part in zip(*pairs, strict=True)))


def _joseph(P: Array, H: Array, R: Array, S: Array) -> Array:
    """The careful form, one belief after the other."""
    H, R = (np.broadcast_to(part, P.shape[:-2] + part.shape[-2:]) for part in (H, R))
    return np.reshape([joseph(P[i], H[i], R[i], S[i])[0] for i in np.ndindex(P.shape[:-2])], P.shape)


def _measured(z: ArrayLike, z_hat: Array) -> tuple[Array, Any]:
    """z, one for each belief, and which were made (None: all); one that was not made holds what was expected."""
    z = as_numbers(z, "z")
    if z.shape not in (z_hat.shape, z_hat.shape[-1:]):
        raise ValueError(f"z: expected shape {z_hat.shape}, got {z.shape}")
    z = z if z.shape == z_hat.shape else np.broadcast_to(z, z_hat.shape)
    if np.isfinite(z).all():
        return z, None
    made = np.asarray(np.isfinite(z).all(axis=-1))
    return _where(made, z, z_hat), made


def _noise(R: ArrayLike | None, sensor: SensorModel, z_hat: Array) -> Array:
    """R, checked: (m, m) for all, or (..., m, m)."""
    if R is None:
        has_parts(sensor, "sensor", ("h", "H", "R", "residual"))
        R = sensor.R
        if type(R) is np.ndarray and R.shape == z_hat.shape[-1:] * 2 and not R.flags.writeable:
            return R  # the package's sensors checked theirs when they were made
    R = as_numbers(R, "R")
    if R.ndim <= 2:
        return check_covariance(R, "R", size=z_hat.shape[-1])
    try:
        if R.shape == (*z_hat.shape, z_hat.shape[-1]) and np.array_equal(R, _T(R)):
            np.linalg.cholesky(R)
            return R
    except np.linalg.LinAlgError:
        pass
    return check_covariances(R, "R", z_hat.shape)  # which names the first that is wrong


def _update(x: Array, P: Array, HP: Array, S: Array, nu: Array) -> tuple[Array, Array, Array]:
    """x + K ν, P - K S Kᵀ and νᵀ S⁻¹ ν, one row of the measurement after the other.

    With S = L Lᵀ, the rows of L⁻¹ H P and L⁻¹ ν belong to independent numbers of variance 1, and each is worth a row's
    outer product.  This is Cholesky's algorithm with its forward substitution: a measurement has few rows, and for two
    of them it takes half as long as NumPy's factorisation and its solution of many systems.
    """
    rows: list[Array] = []  # of L⁻¹ H P
    values: list[Array] = []  # of L⁻¹ ν
    L: list[list[Array]] = []
    nis = np.zeros(nu.shape[:-1])
    for i in range(S.shape[-1]):
        row, value, variance = HP[..., i, :], nu[..., i], S[..., i, i]
        known: list[Array] = []
        for j in range(i):
            a = (S[..., i, j] - sum(b * c for b, c in zip(known, L[j], strict=False))) / L[j][j]
            row, value, variance = row - a[..., None] * rows[j], value - a * values[j], variance - a * a
            known.append(a)
        sigma = np.sqrt(variance)
        row, value = row / sigma[..., None], value / sigma
        x, P, nis = x + value[..., None] * row, P - row[..., :, None] * row[..., None, :], nis + value * value
        rows, values, L = [*rows, row], [*values, value], [*L, [*known, sigma]]
    return x, P, nis


def _T(matrices: Array) -> Array:
    """The transpose of each."""
    return np.swapaxes(matrices, -1, -2)


def _where(made: Any, this: Array, that: Any) -> Array:
    """``this`` for the beliefs that were measured, ``that`` for the others."""
    return np.where(made.reshape(made.shape + (1,) * (this.ndim - made.ndim)), this, that)
