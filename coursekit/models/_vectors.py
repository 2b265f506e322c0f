"""One state as plain floats, many as arrays: what lets a model be written once for both.

NumPy and ``math`` give the functions a model needs the same names, so that ``functions(angle).cos`` is NumPy's for
arrays and, for the floats of a single state, the ten times faster one of ``math``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array

_FLOAT = np.dtype(float)


def entries(array: ArrayLike, size: int, name: str, one: bool = False) -> Any:
    """The entries along the last axis, after a look at the door: floats of one vector, arrays of many."""
    if type(array) is not np.ndarray or array.dtype is not _FLOAT:
        array = np.asarray(array, dtype=float)
    if array.shape == (size,):
        numbers = array.tolist()
        if math.isfinite(sum(numbers)):
            return numbers
        raise ValueError(f"{name}: expected finite numbers, got {array}")
    if array.ndim == 0 or array.shape[-1] != size or one:
        expected = f"({size},)" if one else f"(..., {size})"
        raise ValueError(f"{name}: expected shape {expected}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: expected finite numbers, got {(~np.isfinite(array)).sum()} that are not")
    return [array[..., i] for i in range(size)]


def vector(*entries: Any) -> Array:
    """The entries put together again along a last axis."""
    if type(entries[0]) is float is type(entries[-1]):
        return np.array(entries)
    together = np.empty((*np.broadcast_shapes(*map(np.shape, entries)), len(entries)))
    for i, entry in enumerate(entries):
        together[..., i] = entry
    return together


def sine_cosine(angle: Any) -> Any:
    """(sin a, cos a), of an array through one tangent: with t = tan(a/2), 2t/(1 + t²) and 2/(1 + t²) - 1.

    NumPy vectorises the tangent where the processor has AVX-512, the sine and cosine of doubles never: the pair costs
    an eighth there, and no more than before elsewhere.  Off by at most 4e-16.
    """
    if type(angle) is float:
        return math.sin(angle), math.cos(angle)
    t = np.tan(0.5 * angle)
    twice = 2 / (1 + t * t)
    return t * twice, twice - 1


def two_normals(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Independent standard normals, (2, *shape): a point of the plane by its radius and its direction.

    A cloud's noise comes in pairs, [v, ω].  With AVX-512 (see above) half the price of ``rng.standard_normal``,
    without it a third dearer.
    Source: Box & Muller (1958).
    """
    radius = np.sqrt(-2 * np.log(1 - rng.random(shape)))  # random() may give 0, never 1
    return radius * np.array(sine_cosine(2 * np.pi * rng.random(shape)))


def functions(angle: Any) -> Any:
    """The module whose sin, cos, hypot and atan2 fit: ``math`` for a float, NumPy for arrays."""
    return math if type(angle) is float else np
