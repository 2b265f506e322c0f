"""Quantiles of the chi-square and of the normal distribution."""

import math
from statistics import NormalDist

import numpy as np

from scipy.special import gammainc, gammaincinv, ndtri


class _ChiSquare:
    def cdf(self, x, dof):
        return np.vectorize(_chi2_cdf, otypes=[float])(x, dof)[()]

    def ppf(self, q, dof):
        return 2 * gammaincinv(np.asarray(dof) / 2, q)


class _Normal:
    def __init__(self, loc=0.0, scale=1.0):
        self.loc, self.scale = np.asarray(loc, dtype=float), np.asarray(scale, dtype=float)

    def __call__(self, loc=0.0, scale=1.0):
        return _Normal(loc, scale)

    def _frozen(self, shape):
        return _Normal(*shape) if shape else self

    def logpdf(self, x, *shape):
        d = self._frozen(shape)
        return -0.5 * ((x - d.loc) / d.scale) ** 2 - np.log(d.scale * math.sqrt(2 * math.pi))

    def pdf(self, x, *shape):
        return np.exp(self.logpdf(x, *shape))

    def cdf(self, x, *shape):
        d = self._frozen(shape)
        return np.vectorize(NormalDist().cdf, otypes=[float])((x - d.loc) / d.scale)[()]

    def ppf(self, q, *shape):
        d = self._frozen(shape)
        return d.loc + d.scale * ndtri(q)


def _chi2_cdf(x, dof):
    return gammainc(dof / 2, x / 2)


chi2 = _ChiSquare()
norm = _Normal()
