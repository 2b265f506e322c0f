"""One state as plain floats, many as arrays: what lets a model be written once for both.

NumPy and ``math`` give the functions a model needs the same names, so that ``functions(angle).cos`` is NumPy's for
arrays and, for the floats of a single state, the ten times faster one of ``math``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.geometry import Array

_FLOAT = np.dtype(float)


def entries(array: ArrayLike, size: int, name: str, one: bool = False) -> Any:
    """The entries along the last axis, checked: floats of one vector, arrays of many."""
    if type(array) is not np.ndarray or array.dtype is not _FLOAT:
        array = as_numbers(array, name)
    if array.shape == (size,):
        numbers = array.tolist()
        if sum(map(abs, numbers)) < LARGEST:  # NaN and infinity stay in the sum
            return numbers
        raise ValueError(f"{name}: expected finite numbers, got {array} (none beyond {LARGEST:g})")
    if array.ndim == 0 or array.shape[-1] != size or one:
        expected = f"({size},)" if one else f"(..., {size})"
        raise ValueError(f"{name}: expected shape {expected}, got {array.shape}")
    if array.size and not (array.min() > -LARGEST and array.max() < LARGEST):
        wrong = int((~(np.abs(array) < LARGEST)).sum())
        raise ValueError(f"{name}: expected finite numbers, got {wrong} that are not (none beyond {LARGEST:g})")
    return [array[..., i] for i in range(size)]


def vector(*entries: Any) -> Array:
    """The entries put together again along a last axis."""
    if type(entries[0]) is float is type(entries[-1]):
        return np.array(entries)
    together = np.empty((*np.broadcast(*entries).shape, len(entries)))
    for i, entry in enumerate(entries):
        together[..., i] = entry
    return together


def copies(matrix: Array, entry: Any) -> Array:
    """A copy of a matrix, to be filled: one for a float, one for each entry of an array."""
    if type(entry) is float:
        return matrix.copy()
    many = np.empty((*entry.shape, *matrix.shape))
    many[...] = matrix
    return many


def product(A: Array, B: Array) -> Array:
    """A @ B, by ``dot`` for two matrices, which costs half as much when they are small."""
    return A.dot(B) if A.ndim == B.ndim == 2 else A @ B


def square(A: Array) -> Array:
    """A Aᵀ, symmetric to the last bit.  (Of many small matrices, NumPy squares a copy twice as fast as a view.)"""
    return A.dot(A.T) if A.ndim == 2 else A @ A.swapaxes(-1, -2).copy()


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


def functions(angle: Any) -> Any:
    """The module whose sin, cos, hypot and atan2 fit: ``math`` for a float, NumPy for arrays."""
    return math if type(angle) is float else np
