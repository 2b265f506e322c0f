"""Single numbers at the world's doors."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from coursekit.doors import as_numbers

LARGEST = sys.float_info.max


def number(
    value: Any, name: str, *, above: float = -math.inf, least: float = -math.inf, most: float = LARGEST
) -> float:
    """``value`` as a float, > ``above``, ≥ ``least``, ≤ ``most``: finite unless ``most`` is infinite.

    Raises TypeError for what is no real number, ValueError for more than one, for NaN and what is too small or large.
    """
    array = as_numbers(value, name)
    if array.ndim or not (above < array <= most and array >= least):
        bound = f" > {above:g}" if above > -math.inf else f" ≥ {least:g}" if least > -math.inf else ""
        raise ValueError(f"{name}: expected one {'finite ' if most == LARGEST else ''}number{bound}, got {value!r}")
    return float(array)


def count(value: Any, name: str, *, least: int = 1) -> int:
    """``value`` as an int ≥ ``least``.

    Raises TypeError for what is no real number, ValueError for what is not whole or too small.
    """
    array = as_numbers(value, name)
    if isinstance(value, (bool, np.bool_)) or array.ndim or not math.isfinite(array) or array % 1 or array < least:
        raise ValueError(f"{name}: expected a whole number ≥ {least}, got {value!r}")
    return int(array)
