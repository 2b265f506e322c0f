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


def functions(angle: Any) -> Any:
    """The module whose sin, cos, hypot and atan2 fit: ``math`` for a float, NumPy for arrays."""
    return math if type(angle) is float else np
