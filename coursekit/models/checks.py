"""What a filter asks of a model, and the look it takes at the answer before it counts on it.

A model is any object, and so may answer anything: a Q of one number, which would broadcast to a matrix of ones, an F
that is a vector, a negative Q.  Each answer is checked against the state and the others, and an error names the one
that is wrong.  The package's own models are ``right_by_construction``: they check what they are given, tests cover
what they answer, and a filter's step does not pay for a second look.  A subclass is a model of its own.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dpotrf

from coursekit.doors import LARGEST, as_numbers, several
from coursekit.gaussian import symmetrize
from coursekit.geometry import Array

_ROUNDING = 1e-12  # how far below zero a variance of Q may lie, as a share of its own variances
_FLOAT = np.dtype(float)
_RIGHT: set[type] = set()
_Model = TypeVar("_Model", bound=type)


class Undefined(ValueError):
    """A state in which a model has no value or no derivative: a landmark right under the robot has no bearing."""


def right_by_construction(model: _Model) -> _Model:
    """Marks a class of the package whose answers need no second look; ``tests/test_models.py`` runs through them."""
    _RIGHT.add(model)
    return model


def moved(motion: Any, x: Array, control: Any, dt: float) -> tuple[Array, Array, Array]:
    """f (..., n), F and Q (..., n, n) of a motion at x (..., n): finite, Q symmetric and positive semidefinite.

    Of many states, F and Q may be one matrix (n, n) for all.
    """
    if type(motion) in _RIGHT and hasattr(motion, "f"):
        if x.ndim > 1 and hasattr(motion, "linearized"):
            return motion.linearized(x, control, dt)
        f: Array = motion.f(x, control, dt)
        if f.shape != x.shape:
            raise ValueError(f"control: expected one for the state, got shape {np.shape(control)}")
        return f, motion.F(x, control, dt), motion.Q(x, control, dt)
    has_parts(motion, "motion", ("f", "F", "Q"))
    f = array_of(motion.f(x, control, dt), "f", x.shape)
    return f, _matrix(motion.F(x, control, dt), "F", x), _semidefinite(_matrix(motion.Q(x, control, dt), "Q", x))


def expected(sensor: Any, x: Array) -> tuple[Array, Array]:
    """h (..., m) and H (..., m, n) of a sensor at x (..., n), finite; of many states, H may be one matrix for all."""
    if type(sensor) in _RIGHT and hasattr(sensor, "h"):
        if x.ndim > 1 and hasattr(sensor, "linearized"):
            return sensor.linearized(x)
        return sensor.h(x), sensor.H(x)
    has_parts(sensor, "sensor", ("h", "H", "residual"))
    H = sensor.H(x)
    H = H if type(H) is np.ndarray else as_numbers(H, "H")
    batch, n = x.shape[:-1], x.shape[-1]
    if H.ndim < 2 or H.shape[-2] == 0 or H.shape[-1] != n or H.shape[:-2] not in ((), batch):
        raise ValueError(f"H: expected shape ({''.join(f'{b}, ' for b in batch)}m, {n}), got {H.shape}")
    return array_of(sensor.h(x), "h", (*batch, H.shape[-2])), array_of(H, "H", H.shape)


def difference(sensor: Any, z: ArrayLike, z_hat: Array) -> Array:
    """The sensor's residual of z (..., m) and what was expected (..., m)."""
    if type(sensor) in _RIGHT:
        residual: Array = sensor.residual(z, z_hat)
        if residual.shape != z_hat.shape:
            raise ValueError(f"z: expected shape {z_hat.shape}, got {np.shape(z)}")
        return residual
    return array_of(sensor.residual(array_of(z, "z", z_hat.shape), z_hat), "residual", z_hat.shape)


def unusable(sensor: Any, z: ArrayLike) -> str:
    """Why a measurement cannot be used whatever the state is; empty when it can."""
    z = as_numbers(z, "z")
    if not np.all(np.abs(z) < LARGEST):
        return f"not finite: {z}"
    return sensor.unusable(z) if hasattr(sensor, "unusable") else ""


def one_each(R: Any, z: Any, k: int) -> list[Any]:
    """An R (m, m), or None, for each of k measurements, of a shared one or of k; ValueError for other numbers."""
    z = several(z, "z")
    each = None if R is None else several(R, "R")
    shared = each is None or np.ndim(each[0] if each else R) < 2
    Rs = [R] * k if shared else list(R)
    if len(z) != k or len(Rs) != k:
        raise ValueError(f"expected one z and one R for each of {k} sensors, got {len(z)} and {len(Rs)}")
    return Rs


def has_parts(model: Any, name: str, parts: tuple[str, ...]) -> None:
    """TypeError for a class in place of an object, and for a model with a part missing, which it names."""
    if isinstance(model, type):
        raise TypeError(f"{name}: expected an object, got the class {model.__name__} itself: write {model.__name__}(…)")
    missing = [part for part in parts if not hasattr(model, part)]
    if missing:
        raise TypeError(f"{name}: expected a model with {', '.join(parts)}; "
                        f"{type(model).__name__} has no {', '.join(missing)}")  # fmt: skip


def array_of(value: Any, name: str, shape: tuple[int, ...]) -> Array:
    """A copy of ``value`` as finite floats of this shape; the model may keep its own."""
    array = value if type(value) is np.ndarray and value.dtype is _FLOAT else as_numbers(value, name)
    if array.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {array.shape}")
    if not sum(map(abs, array.ravel().tolist())) < LARGEST:  # NaN and infinity stay in the sum
        raise ValueError(f"{name}: expected finite numbers, got {array} (none beyond {LARGEST:g})")
    return array.copy()


def _matrix(value: Any, name: str, x: Array) -> Array:
    """(n, n), or one for each of many states x (..., n)."""
    matrix = value if type(value) is np.ndarray else as_numbers(value, name)
    return array_of(matrix, name, x.shape[-1:] * 2 if matrix.ndim <= 2 else x.shape + x.shape[-1:])


def _semidefinite(Q: Array) -> Array:
    """Q made symmetric to the last bit.  G M Gᵀ may have directions without noise; none may have less than none."""
    if Q.ndim > 2:
        return np.reshape([_semidefinite(one) for one in Q.reshape(-1, *Q.shape[-2:])], Q.shape)
    if Q.tobytes() != Q.T.tobytes():
        if (Q - Q.T).max() > 1e-8 * Q.max():  # the largest entry of a covariance is a variance
            raise ValueError(f"Q: expected a symmetric matrix, got\n{Q}")
        Q = symmetrize(Q)
    if dpotrf(Q)[1]:
        # Each variance a little larger, in its own units, and just above zero where there is no noise at all.
        lifted = Q.copy()
        lifted.flat[:: len(Q) + 1] += _ROUNDING * Q.diagonal() + 1e-300
        if dpotrf(lifted)[1]:
            raise ValueError(f"Q: expected a positive semidefinite matrix, got eigenvalues {np.linalg.eigvalsh(Q)}")
    return Q
