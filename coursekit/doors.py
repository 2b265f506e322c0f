"""What comes in at a door: numbers, one number, a count, a generator, or an error that says what was expected.

Every room asks these, so that the same mistake gets the same answer everywhere.

>>> number("seven", "dt")
Traceback (most recent call last):
TypeError: dt: expected one real number, got 'seven'
"""

from __future__ import annotations

import operator
import reprlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST = 1e60
"""Nothing that a robot measures is larger, in any unit; and the fourth power of this is still a finite number."""


def as_numbers(value: ArrayLike, name: str) -> NDArray[np.float64]:
    """``value`` as floats; TypeError for what is no real number, ValueError for rows of different lengths."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{name}: expected an array, got rows of different lengths: {reprlib.repr(value)}") from None
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name}: expected real numbers, got {reprlib.repr(value)}")
    return array.astype(float, copy=False)


def number(value: Any, name: str) -> float:
    """One real number, finite or not: TypeError for anything else."""
    if type(value) is float:
        return value
    array = np.asarray(None if isinstance(value, (list, tuple)) else value)
    if array.ndim or array.dtype.kind not in "biuf":
        raise TypeError(f"{name}: expected one real number, got {reprlib.repr(value)}")
    return float(array)


def several(value: Any, name: str) -> list[Any]:
    """The entries of a sequence, or of anything that is counted out: TypeError for one thing, for a text and a map."""
    if isinstance(value, (str, bytes, Mapping)):
        raise TypeError(f"{name}: expected several, got {reprlib.repr(value)}")
    try:
        return list(value)
    except (TypeError, KeyError):  # what is asked by names has no order
        raise TypeError(f"{name}: expected several, got {reprlib.repr(value)}") from None


def together(*arrays: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """The arrays in the shape that they share; ValueError where there is none."""
    try:
        return np.broadcast_arrays(*arrays)
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise ValueError(f"expected arrays of one shape, or single numbers, got the shapes {shapes}") from None


def count(value: Any, name: str, least: int = 1) -> int:
    """A whole number: TypeError for anything else, ValueError below ``least`` and where no array can be so long."""
    try:
        whole = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: expected a whole number, got {reprlib.repr(value)}") from None
    if whole < least:
        raise ValueError(f"{name}: expected a whole number ≥ {least}, got {reprlib.repr(value)}")
    if whole > np.iinfo(np.int32).max:
        raise ValueError(f"{name}: expected a whole number below 2³¹, got {reprlib.repr(value)}")
    return whole


def generator(value: Any, name: str = "rng") -> np.random.Generator:
    """TypeError for what is no ``numpy.random.Generator``."""
    if not isinstance(value, np.random.Generator):
        raise TypeError(f"{name}: expected a numpy.random.Generator, got {type(value).__name__}")
    return value
