"""The incomplete gamma function and its inverse, the normal quantile, and a sum of exponentials."""

import math
from statistics import NormalDist

import numpy as np


def logsumexp(a, axis=None, b=1.0, keepdims=False):
    """log Σ b exp a."""
    a, b = np.broadcast_arrays(np.asarray(a, dtype=float), b)
    top = np.max(a, axis=axis, keepdims=True)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        out = np.log(np.sum(b * np.exp(a - top), axis=axis, keepdims=True)) + top
    return out if keepdims else np.squeeze(out, axis)[()]


def gammainc(a, x):
    """The regularised lower incomplete gamma function P(a, x) of two numbers.

    By its series below a + 1 and by its continued fraction above.  Source: Press et al. (2007), section 6.2.
    """
    if x <= 0:
        return 0.0
    scale = math.exp(a * math.log(x) - x - math.lgamma(a))
    if x < a + 1:
        term = total = 1 / a
        k = a
        while term > 1e-17 * total:
            k += 1
            term *= x / k
            total += term
        return scale * total
    b = x + 1 - a
    c, d = math.inf, 1 / b
    h = d
    for i in range(1, 10_000):
        step = -i * (i - a)
        b += 2
        d = 1 / (step * d + b)
        c = b + step / c
        h *= d * c
        if abs(d * c - 1) < 1e-16:
            break
    return 1 - scale * h


def ndtri(p):
    """The normal distribution's quantile of each share p."""
    return np.vectorize(_ndtri, otypes=[float])(p)[()]


def gammaincinv(a, p):
    """The x at which P(a, x) is p; both broadcast."""
    return np.vectorize(_gammaincinv, otypes=[float])(a, p)[()]


def _ndtri(p):
    return NormalDist().inv_cdf(p) if 0 < p < 1 else -math.inf if p == 0 else math.inf if p == 1 else math.nan


def _gammaincinv(a, p):
    """Wilson and Hilferty's approximation, then Newton's steps on the logarithm of x."""
    if not 0 < p < 1:
        return 0.0 if p == 0 else math.inf if p == 1 else math.nan
    share = 1 / (9 * a)
    root = 1 - share + _ndtri(p) * math.sqrt(share)
    x = a * root**3 if root > 0.1 else math.exp((math.log(p * a) + math.lgamma(a)) / a)
    for _ in range(50):
        density = math.exp(a * math.log(x) - x - math.lgamma(a))  # of log x
        step = (p - gammainc(a, x)) / density
        x *= math.exp(max(-1.0, min(1.0, step)))
        if abs(step) < 1e-15:
            break
    return x
