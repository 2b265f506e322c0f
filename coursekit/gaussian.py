r"""Gaussian beliefs, and the tests that tell whether a belief knows how wrong it is.

A filter reports a mean *and* a covariance.  The normalised estimation error squared (NEES) compares its
actual error with the covariance that it claims; the normalised innovation squared (NIS) does the same with
nothing but measurements.  Both follow a chi-square distribution when, and only when, the filter is honest.

>>> belief = Gaussian(np.zeros(2), np.diag([4.0, 1.0]))
>>> float(nees(belief, np.array([2.0, 1.0])))       # one sigma off in each direction
2.0

Source: Bar-Shalom, Li & Kirubarajan (2001), section 5.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import chi2

from coursekit.geometry import Array


@dataclass(frozen=True)
class Gaussian:
    """A belief N(mean, cov) over an n-vector.

    mean (n,), cov (n, n) symmetric positive definite.  Both are copied, checked and made read-only; an
    asymmetry of rounding size is removed, a larger one is an error.

    Raises ValueError naming what was wrong: shapes, NaN, an asymmetric or indefinite covariance.
    """

    mean: Array
    cov: Array

    def __post_init__(self) -> None:
        mean = np.array(self.mean, dtype=float)
        if mean.ndim != 1 or mean.size == 0:
            raise ValueError(f"mean: expected a vector of shape (n,), got {mean.shape}")
        if not np.all(np.isfinite(mean)):
            raise ValueError(f"mean: expected finite numbers, got {mean}")
        cov = check_covariance(self.cov, "cov", size=mean.size)
        mean.flags.writeable = cov.flags.writeable = False
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "cov", cov)

    @classmethod
    def trusted(cls, mean: Array, cov: Array, factor: Array | None = None) -> Gaussian:
        """The same without copies and questions, for a filter, whose algebra keeps cov what it must be.

        factor : L with cov = L Lᵀ, where it is at hand.
        """
        # Read-only.  ``flags.writeable = False`` would cost four times as much, and naming the argument twice.
        mean.setflags(False)  # type: ignore[call-arg]
        cov.setflags(False)  # type: ignore[call-arg]
        belief = object.__new__(cls)
        fields = belief.__dict__
        fields["mean"], fields["cov"] = mean, cov
        if factor is not None:
            fields["factor"] = factor
        return belief

    @cached_property
    def factor(self) -> Array:
        """The lower triangular L with cov = L Lᵀ (Cholesky)."""
        return np.asarray(np.linalg.cholesky(self.cov))

    def marginal(self, indices: ArrayLike) -> Gaussian:
        """The belief over some of the entries: what is left when the others are forgotten."""
        indices = np.atleast_1d(np.asarray(indices))
        return Gaussian(self.mean[indices], self.cov[np.ix_(indices, indices)])

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """``size`` draws, (size, n)."""
        return self.mean + rng.standard_normal((size, self.mean.size)) @ self.factor.T


def check_covariance(cov: ArrayLike, name: str = "cov", size: int | None = None) -> Array:
    """A symmetric positive definite copy of ``cov``, or a ValueError that says what is wrong with it."""
    cov = np.array(cov, dtype=float)
    if cov.ndim != 2 or cov.shape[0] != cov.shape[1] or (size is not None and cov.shape[0] != size):
        expected = "(n, n)" if size is None else f"({size}, {size})"
        raise ValueError(f"{name}: expected shape {expected}, got {cov.shape}")
    if not np.all(np.isfinite(cov)):
        raise ValueError(f"{name}: expected finite numbers, got\n{cov}")
    if np.abs(cov - cov.T).max() > 1e-8 * np.abs(cov).max():
        raise ValueError(f"{name}: expected a symmetric matrix, got one with |cov - covᵀ| up to "
                         f"{np.abs(cov - cov.T).max():.3g}:\n{cov}")  # fmt: skip
    cov = symmetrize(cov)
    try:
        np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:
        raise ValueError(
            f"{name}: expected a positive definite matrix, got eigenvalues {np.linalg.eigvalsh(cov)}"
        ) from None
    return cov


def symmetrize(matrix: Array) -> Array:
    """(M + Mᵀ)/2, which removes what rounding adds."""
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def mahalanobis_squared(residual: ArrayLike, cov: ArrayLike) -> float:
    """rᵀ C⁻¹ r for residual (n,) and covariance (n, n), through a Cholesky factor."""
    residual = np.asarray(residual, dtype=float)
    return float(residual @ cho_solve(cho_factor(np.asarray(cov, dtype=float), lower=True), residual))


def nees(belief: Gaussian, truth: ArrayLike, residual: Callable[[Array, Array], Array] | None = None) -> float:
    """Normalised estimation error squared: eᵀ P⁻¹ e with e = truth - mean.

    For an honest n-dimensional belief it is chi-square with n degrees of freedom, mean n.

    Parameters
    ----------
    truth : (n,)
    residual : the state's own difference, ``residual(truth, mean) → (n,)``; give it whenever the state holds
        an angle (for a pose: ``models.pose_residual``).  The default is a bare minus.

    Raises ValueError when shapes differ or the truth is not finite.
    """
    truth = np.asarray(truth, dtype=float)
    if truth.shape != belief.mean.shape:
        raise ValueError(f"truth: expected shape {belief.mean.shape}, got {truth.shape}")
    if not np.all(np.isfinite(truth)):
        raise ValueError(f"truth: expected finite numbers, got {truth}")
    error = truth - belief.mean if residual is None else residual(truth, belief.mean)
    return mahalanobis_squared(error, belief.cov)


def nis(innovation: ArrayLike, innovation_cov: ArrayLike) -> float:
    """Normalised innovation squared: νᵀ S⁻¹ ν, the NEES that needs no truth.  ν (m,), S (m, m)."""
    return mahalanobis_squared(innovation, innovation_cov)


def chi2_band(dof: int, runs: int = 1, confidence: float = 0.95) -> tuple[float, float]:
    """Two-sided band in which the average of ``runs`` independent chi-square values falls.

    Two-sided because a filter that is too modest is as wrong as one that is too sure: a covariance that is
    too large pushes the average *below* the band.

    Raises ValueError for dof < 1, runs < 1 or a confidence outside (0, 1).

    >>> low, high = chi2_band(3, runs=100)
    >>> print(f"{low:.2f} {high:.2f}")
    2.54 3.50

    Source: Bar-Shalom, Li & Kirubarajan (2001), eq. 5.4.2-14.
    """
    if not (1 <= dof < np.inf and 1 <= runs < np.inf):
        raise ValueError(f"expected dof ≥ 1 and runs ≥ 1, got dof={dof}, runs={runs}")
    if not 0 < confidence < 1:
        raise ValueError(f"confidence: expected a probability in (0, 1), got {confidence}")
    tail = 0.5 * (1 - confidence)
    low, high = chi2.ppf([tail, 1 - tail], dof * runs) / runs
    return float(low), float(high)


def ellipse(cov: ArrayLike, confidence: float = 0.95, points: int = 73) -> Array:
    """The closed contour that holds ``confidence`` of a planar Gaussian's mass, around 0: (2, 2) → (points, 2).

    Every point on it has the same Mahalanobis distance; its square is the chi-square quantile.
    """
    cov = check_covariance(cov, size=2)
    if not 0 < confidence < 1:
        raise ValueError(f"confidence: expected a probability in (0, 1), got {confidence}")
    turn = np.linspace(0, 2 * np.pi, points)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return np.sqrt(chi2.ppf(confidence, 2)) * circle @ np.linalg.cholesky(cov).T
