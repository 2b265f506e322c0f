"""How well each particle agrees with a measurement whose noise is Gaussian."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.gaussian import check_covariance, mahalanobis_squared, symmetrize
from coursekit.geometry import Array
from coursekit.models import SensorModel
from coursekit.models.checks import array_of, has_parts
from coursekit.particles._blocks import blocks
from coursekit.particles.cloud import Particles


def log_likelihood(sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Callable[[Array], Array]:
    """log N(z; h(x), R) as a function of states (n, d) → (n,), for ``weigh``.

    Parameters
    ----------
    sensor : a model with ``h(states)`` → (n, m) and ``residual(z, z_hat)``, which wraps angles.
    z : (m,), in the sensor's units.
    R : (m, m), the measurement's covariance; the sensor's own by default.

    Raises ValueError for what is not finite and for shapes that do not fit: an R that is not (m, m), an h that does
    not answer (n, m), a residual that does not; TypeError for a sensor without h, residual or R.

    >>> from coursekit.models import Position
    >>> fix = Position(R=np.diag([0.01, 0.01]))
    >>> at = log_likelihood(fix, [1.0, 2.0])(np.array([[1.0, 2.0, 0.0], [1.1, 2.0, 0.0]]))
    >>> print(f"{at[0] - at[1]:.2f}")  # one standard deviation away costs half a nat
    0.50

    Source: Thrun, Burgard & Fox (2005), section 6.6, for a landmark sensor's likelihood.
    """
    has_parts(sensor, "sensor", ("h", "residual", "R") if R is None else ("h", "residual"))
    z = np.atleast_1d(as_numbers(z, "z"))
    z = array_of(z, "z", (z.size,))
    R = as_numbers(sensor.R if R is None else R, "R")
    whiten, constant = _whitening(R.tobytes(), R.shape, z.size)

    def at(states: Array) -> Array:
        out = np.empty(len(states))
        for block in blocks(len(states)):
            h = sensor.h(states[block])
            if np.shape(h) != (len(states[block]), z.size):
                raise ValueError(f"h: expected shape {(len(states[block]), z.size)}, got {np.shape(h)}")
            residual = sensor.residual(z, h)
            if np.shape(residual) != np.shape(h):
                raise ValueError(f"residual: expected shape {np.shape(h)}, got {np.shape(residual)}")
            r = as_numbers(residual, "residual").T
            white = (sum(w * r_i for w, r_i in zip(row, r)) for row in whiten)
            out[block] = constant - sum(e * e for e in white)
        return out

    return at


def nis(cloud: Particles, sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> float:
    """The normalised innovation squared of a cloud that is to be weighed: ν̄ᵀ S⁻¹ ν̄, with S = Cov[ν] + R.

    ν⁽ⁱ⁾ is the residual of z at particle i, ν̄ their weighted mean.  It is what ``ekf.Watch`` asks for: while cloud and
    sensor are honest its mean is at most the number of entries of z, and a cloud in the wrong room has tens and more.
    Weights alone cannot tell, for they sum to one in any room.

    Parameters as for ``log_likelihood``, which raises the same errors; TypeError for what is no cloud.

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 5.4, with the moments of the cloud.

    >>> from coursekit.models import Position
    >>> cloud = Particles(np.random.default_rng(0).normal(0, 0.1, (500, 3)), angles=(2,))
    >>> fix = Position(R=0.01 * np.eye(2))
    >>> nis(cloud, fix, [0.1, 0.0]) < 2, nis(cloud, fix, [3.0, 0.0]) > 100
    (True, True)
    """
    if not isinstance(cloud, Particles):
        raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
    has_parts(sensor, "sensor", ("h", "residual", "R") if R is None else ("h", "residual"))
    z = np.atleast_1d(as_numbers(z, "z"))
    R = check_covariance(sensor.R if R is None else R, "R", size=z.size)
    nu = array_of(
        sensor.residual(array_of(z, "z", (z.size,)), sensor.h(cloud.states)), "residual", (len(cloud), z.size)
    )
    mean = cloud.weights @ nu
    return mahalanobis_squared(mean, symmetrize(((nu - mean).T * cloud.weights) @ (nu - mean)) + R)


@lru_cache(maxsize=64)
def _whitening(R: bytes, shape: tuple[int, ...], size: int) -> tuple[Array, float]:
    """L⁻¹/√2 and -log√((2π)ᵐ|R|) for R = L Lᵀ: checked and factored once, not at every measurement."""
    factor = np.linalg.cholesky(check_covariance(np.frombuffer(R).reshape(shape), "R", size=size))
    constant = -np.log(np.diag(factor)).sum() - 0.5 * size * np.log(2 * np.pi)
    return np.linalg.solve(factor, np.eye(size)) / np.sqrt(2), float(constant)
