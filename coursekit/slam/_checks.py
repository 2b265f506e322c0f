"""What EKF-SLAM refuses at its door."""

from __future__ import annotations

import reprlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.gaussian import check_covariance
from coursekit.geometry import Array

_SMALLEST_R = 1e-12  # of what the map leaves open of a measurement: below, P - W Wᵀ is made of rounding errors


def check_count(count: Any, name: str) -> int:
    """A whole number of at least 1."""
    if isinstance(count, (bool, np.timedelta64)) or not isinstance(count, (int, np.integer)):
        raise TypeError(f"{name}: expected a whole number, got {count!r}")
    if count < 1:
        raise ValueError(f"{name}: expected at least 1, got {count}")
    return int(count)


def check_measurements(z: ArrayLike, R: ArrayLike) -> tuple[Array, Array]:
    """z (m, 2) and R (m, 2, 2) as copies, or an error that says what is wrong."""
    z = as_numbers(z, "z").copy()
    z = z.reshape(0, 2) if z.size == 0 else z
    if z.ndim != 2 or z.shape[1] != 2:
        raise ValueError(f"z: expected ranges and bearings of shape (m, 2), got {z.shape}")
    R = as_numbers(R, "R")
    R = R.reshape(0, 2, 2) if R.size == len(z) == 0 else R
    if R.shape not in ((2, 2), (len(z), 2, 2)):
        raise ValueError(f"R: expected shape (2, 2) or ({len(z)}, 2, 2), got {R.shape}")
    each = R.reshape(-1, 2, 2)
    # Symmetric, a > 0, determinant > 0 and finite: else check_covariance names or mends it.
    if not all(
        b == c and a > 0 and b * b < a * d and LARGEST > a > LARGEST**-2 < d < LARGEST
        for (a, b), (c, d) in each.tolist()
    ):
        each = np.array([check_covariance(one, "R", size=2) for one in each])
    return z, each if len(each) == len(z) else np.repeat(each, len(z), axis=0)


def check_ids(ids: Any, measurements: int) -> list[Any] | None:
    """One id for each measurement, such as can be looked up, or None."""
    if ids is None:
        return None
    try:
        listed = list(ids)
        dict.fromkeys(listed)
    except (TypeError, KeyError):
        raise TypeError(f"ids: expected names or numbers, one for each measurement, got {reprlib.repr(ids)}") from None
    if len(listed) != measurements:
        raise ValueError(f"ids: expected one for each of {measurements} measurements, got {len(listed)}")
    return listed


def check_share(part: Array, whole: Array, size: int, R: Array) -> None:
    """Is R's part of a covariance (2, 2), one of those that make up ``size`` rows, more than rounding?

    In units of the whole's standard deviations the part's smaller eigenvalue is at least determinant by trace.
    """
    (a, b), (_, d) = part.tolist()
    u, v = whole.diagonal().tolist()
    share = (a * d - b * b) / (a * v + d * u)
    if not share > size * _SMALLEST_R:
        raise ValueError(f"R: too small beside what the map leaves open: 64-bit numbers cannot hold what is left.\n"
                         f"R is\n{R}\nthe variances in all are {u:.3g} and {v:.3g}, where R has {a:.3g} and {d:.3g}"
                         )  # fmt: skip
