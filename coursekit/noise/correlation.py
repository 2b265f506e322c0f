"""How long residuals remember each other, and how many independent samples a sequence is worth."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, count
from coursekit.geometry import Array


def autocorrelation(x: ArrayLike, lags: int) -> Array:
    """Correlation of a sequence (n,) with itself, 0 … ``lags`` samples later, (lags + 1,); the first is 1.

    Raises ValueError for something that is no sequence of finite numbers, and for lags outside 0 … n - 1.

    >>> autocorrelation([1.0, -1.0, 1.0, -1.0], 1)
    array([ 1.  , -0.75])
    """
    values, lags = as_numbers(x, "x"), count(lags, "lags", least=0)
    if values.ndim != 1 or not lags < values.size:
        raise ValueError(f"expected a sequence and 0 ≤ lags < its length, got shape {values.shape} and {lags}")
    if not np.all(np.abs(values) < LARGEST):
        raise ValueError(f"x: expected finite numbers, got {values[~(np.abs(values) < LARGEST)][0]}")
    rounding = 8 * np.finfo(float).eps * np.abs(values).max()
    values = values - values.mean()
    if np.abs(values).max() <= rounding:  # always the same
        return np.eye(1, lags + 1)[0]
    values /= np.abs(values).max()  # so that no square is too small, or too large, for a float
    size = 1 << (2 * values.size).bit_length()  # long enough that the end does not wrap round to the beginning
    products = np.fft.irfft(np.abs(np.fft.rfft(values, size)) ** 2, size)[: lags + 1]
    return np.asarray(products / products[0])


def effective_samples(x: ArrayLike) -> float:
    """How many independent samples would fix a mean as well as these n do: n / (1 + 2 Σ ρ_k), between 1 and n.

    The sum ends where two neighbouring correlations no longer add up to something positive.
    Raises ValueError for something that is no sequence of finite numbers.

    Source: Geyer (1992), Statistical Science 7(4), section 3.3.

    >>> effective_samples([3.0, 1.0, 3.0, 1.0, 3.0, 1.0])
    6.0
    """
    n = as_numbers(x, "x").size
    if n == 0:
        raise ValueError("x: expected at least one number, got none")
    rho = autocorrelation(x, n - 1)
    pairs = rho[: n // 2 * 2].reshape(-1, 2).sum(axis=1)
    over = pairs <= 1e-12  # positive by more than rounding
    end = int(np.argmax(over)) if np.any(over) else len(pairs)
    return float(np.clip(n / max(2 * float(np.sum(pairs[:end])) - 1, 1.0), 1.0, n))
