r"""Lab 4: the extended Kalman filter, as two functions on a Gaussian.

``predict`` carries a belief through the motion, ``correct`` conditions it on a measurement and tells, beside the new
belief, how surprising the measurement was.  ``correct_robustly`` does the same without letting one wild measurement
drag the belief away, or a wrong but confident belief shut the measurements out.

>>> from coursekit.models import DifferentialDrive, RangeBearing
>>> belief = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2)
>>> belief = predict(belief, DifferentialDrive(), control=[0.5, 0.0], dt=2.0)
>>> seen = correct(belief, RangeBearing([3.0, 1.0]), z=[2.2, 0.5])
>>> print(seen.belief.mean.round(3), round(seen.nis, 2))
[ 1.032 -0.015 -0.023] 0.12

The mathematics stands in the docstrings; the code computes it through Cholesky factors, so that a covariance comes out
symmetric to the last bit.  ``A.dot(B)`` is ``A @ B`` at half its price for matrices this small.

Source: Thrun, Burgard & Fox (2005), table 3.3; Bar-Shalom, Li & Kirubarajan (2001), sections 5.2 and 10.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf
from scipy.stats import chi2

from coursekit.gaussian import Gaussian, check_covariance
from coursekit.geometry import Array
from coursekit.models import MotionModel, SensorModel


@dataclass(frozen=True)
class Correction:
    """What a measurement did.

    belief : the belief after it.
    innovation : measurement minus what was expected (m,), in the measurement's units.
    innovation_cov : S = H P Hᵀ + R (m, m), the spread that the innovation should have.
    nis : νᵀ S⁻¹ ν, its normalised square: chi-square with m degrees of freedom when the filter is honest.
    """

    belief: Gaussian
    innovation: Array
    innovation_cov: Array
    nis: float


def predict(belief: Gaussian, motion: MotionModel, control: ArrayLike, dt: float) -> Gaussian:
    r"""Push a belief through the motion model:  N(f(μ, u), F P Fᵀ + Q).

    F is linearised at the mean, so the result is exact only where f is affine over the spread of the belief; Lab 0's
    banana is what comes of a heading too uncertain for that.

    Parameters
    ----------
    belief : over the state, n entries.
    motion : with f, F and Q, see ``models``.
    control : what the model asks for; for ``DifferentialDrive`` [v m/s, ω rad/s].
    dt : seconds, > 0.

    Raises ValueError for dt ≤ 0, for a control that is not finite, for a model whose F or Q does not fit.

    Source: Thrun, Burgard & Fox (2005), table 3.3, lines 2-3.
    """
    x = belief.mean
    FL = motion.F(x, control, dt).dot(belief.factor)  # F P Fᵀ = (F L)(F L)ᵀ
    mean, P = motion.f(x, control, dt), FL.dot(FL.T) + motion.Q(x, control, dt)
    # NaN and infinity anywhere survive a sum; whatever looks wrong, the constructor will name.
    finite = math.isfinite(sum(mean.tolist()) + sum(P.ravel().tolist()))
    if not finite or len(mean) != len(P) or P.tobytes() != P.T.tobytes():
        return Gaussian(mean, P)
    return Gaussian.trusted(mean, P)


def correct(belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Correction:
    r"""Condition a belief on a measurement:  N(μ + K ν, (I - K H) P),  K = P Hᵀ S⁻¹,  S = H P Hᵀ + R.

    ν = z - h(μ), as the sensor's ``residual`` gives it.  With S = Uᵀ U and W = P Hᵀ U⁻¹ this is μ + W (U⁻ᵀ ν) and
    P - W Wᵀ, which is symmetric as it stands; where rounding leaves it indefinite, because R is some 10¹⁵ times
    smaller than H P Hᵀ, Joseph's form of the same matrix takes its place.

    Parameters
    ----------
    sensor : with h, H, R and residual, see ``models``.
    z : (m,) in the sensor's units.
    R : (m, m), symmetric positive definite; takes the place of ``sensor.R`` for this measurement.

    Raises ValueError for z of the wrong shape or not finite, and for an R that is no covariance or so small beside P
    that no 64-bit covariance is left.

    Source: Thrun, Burgard & Fox (2005), table 3.3, lines 4-6; Bar-Shalom, Li & Kirubarajan (2001), eq. 5.2.3-18.
    """
    x, P = belief.mean, belief.cov
    H, z_hat = sensor.H(x), sensor.h(x)
    R = _noise(R, sensor, len(H))
    innovation = sensor.residual(z, z_hat)
    if innovation.shape != (len(R),):
        raise ValueError(f"z: expected shape {R.shape[:1]}, got {np.shape(z)}")

    HP = H.dot(P)
    S = HP.dot(H.T) + R
    U, _ = dpotrf(S)
    W, w = dtrsm(1.0, U, HP.T, side=1), dtrsv(U, innovation, trans=1)
    nis = float(w.dot(w))
    if not math.isfinite(nis):
        raise ValueError(f"z: expected finite numbers, got {np.asarray(z)} where {z_hat} was expected")
    mean, posterior = x + W.dot(w), P - W.dot(W.T)
    if hasattr(sensor, "wrap_state"):
        mean = sensor.wrap_state(mean)
    factor, indefinite = dpotrf(posterior)
    if indefinite:
        posterior = _joseph(P, H, R, S)
        factor, indefinite = dpotrf(posterior)
        if indefinite:
            raise ValueError(f"R: too small beside the belief's covariance: 64-bit numbers cannot hold what is left.\n"
                             f"R is\n{R}\nand H P Hᵀ is\n{S - R}")  # fmt: skip
    return Correction(Gaussian.trusted(mean, posterior, factor.T), innovation, S, nis)


def correct_robustly(
    belief: Gaussian, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None, *, gate: float = 0.99
) -> Correction:
    """``correct``, with the trust in a measurement falling as its surprise grows; none is ever turned away.

    Inside the gate nothing changes.  Outside, R is scaled up by nis/gate, so that the pull of a measurement falls with
    its distance, though never to nothing: one wild value hardly moves the belief, while a hundred that agree do.
    A gate that *rejects* cannot tell a wild value from a wrong belief, and locks the truth out when it is the belief.

    gate : the share of honest measurements left as they are, a probability.

    Returns the correction that was made; its nis and innovation_cov are those *before* R was scaled, so that they
    still tell how surprising the measurement was.  Raises as ``correct`` does, and for a gate outside (0, 1).

    Source: Huber (1981), section 7.8; scaling R by the innovation follows Chang (2014).
    """
    plain = correct(belief, sensor, z, R)
    excess = plain.nis / gate_threshold(gate, len(plain.innovation))
    if excess <= 1:
        return plain
    softened = correct(belief, sensor, z, excess * np.asarray(sensor.R if R is None else R, dtype=float))
    return Correction(softened.belief, plain.innovation, plain.innovation_cov, plain.nis)


@lru_cache
def gate_threshold(probability: float, dof: int) -> float:
    """The NIS that an honest measurement of ``dof`` numbers stays below with this probability (chi-square quantile).

    >>> round(gate_threshold(0.99, 2), 2)
    9.21
    """
    if not 0 < probability < 1:
        raise ValueError(f"gate: expected a probability in (0, 1), got {probability}")
    return float(chi2.ppf(probability, dof))


def _noise(R: ArrayLike | None, sensor: SensorModel, size: int) -> Array:
    """R, checked; the sensors of ``models`` checked theirs when they were made, and keep it read-only."""
    own = R is None
    R = sensor.R if R is None else R
    if type(R) is np.ndarray and R.shape == (size, size) and R.dtype == float:
        if own and not R.flags.writeable:
            return R
        # Exactly symmetric, finite and with a Cholesky factor: nothing is left to say or to mend.
        if R.tobytes() == R.T.tobytes() and math.isfinite(R.sum()) and not dpotrf(R)[1]:
            return R
    return check_covariance(R, "R", size=size)


def _joseph(P: Array, H: Array, R: Array, S: Array) -> Array:
    """(I - K H) P (I - K H)ᵀ + K R Kᵀ, which no rounding of K can make indefinite (Bucy & Joseph, 1968)."""
    K = np.linalg.solve(S, H @ P).T
    AL = (np.eye(len(P)) - K @ H) @ np.linalg.cholesky(P)
    KL = K @ np.linalg.cholesky(R)
    return np.asarray(AL @ AL.T + KL @ KL.T)
