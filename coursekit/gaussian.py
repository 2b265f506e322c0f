r"""Gaussian beliefs, and the tests that tell whether a belief knows how wrong it is.

A filter reports a mean *and* a covariance.  The normalised estimation error squared (NEES) compares its
actual error with the covariance that it claims; the normalised innovation squared (NIS) does the same with
nothing but measurements.  Both follow a chi-square distribution when, and only when, the filter is honest.

Every covariance here is positive definite with a margin, so that no verdict hangs on the last bit of a float: its
*correlation* matrix, the covariance in units of its own standard deviations, has no eigenvalue below ``MARGIN``.
Units do not matter to that: metres beside radians are no narrower than metres beside metres.

>>> belief = Gaussian(np.zeros(2), np.diag([4.0, 1.0]))
>>> float(nees(belief, np.array([2.0, 1.0])))       # one sigma off in each direction
2.0

Source: Bar-Shalom, Li & Kirubarajan (2001), section 5.4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotrf

from coursekit.doors import LARGEST, as_numbers, count, generator, number
from coursekit.geometry import Array

MARGIN = 1e-13  # of a correlation matrix's smallest eigenvalue; rounding moves it by some n · 1e-16
_SURE = 1e-12  # a determinant of a correlation matrix that leaves the margin and more: λ_min > det/e
_LIFT = 20 * MARGIN  # what is added to each variance, as a share of it, where the margin is missing


@dataclass(frozen=True)
class Gaussian:
    """A belief N(mean, cov) over an n-vector, or many such beliefs at once.

    mean (n,), cov (n, n) symmetric positive definite.  Both are copied, checked and made read-only; an
    asymmetry of rounding size is removed, a larger one is an error.  Many beliefs, one for each run of an
    experiment, are mean (..., n) with cov (..., n, n); ``beliefs[3]`` is one of them.

    Raises ValueError naming what was wrong: shapes, NaN, an asymmetric covariance, one that is indefinite or without
    the margin of this module; TypeError for what is no number.

    >>> Gaussian([1.0, 2.0], np.diag([4.0, 1.0])).factor
    array([[2., 0.],
           [0., 1.]])
    >>> hundred = Gaussian(np.zeros((100, 2)), np.tile(np.eye(2), (100, 1, 1)))
    >>> hundred[7].mean.shape
    (2,)
    """

    mean: Array
    cov: Array

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, mean: ArrayLike, cov: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        mean = as_numbers(self.mean, "mean").copy()
        if mean.ndim == 0 or mean.size == 0:
            raise ValueError(f"mean: expected a vector of shape (n,), or (..., n) for many, got {mean.shape}")
        if not np.all(np.abs(mean) < LARGEST):
            raise ValueError(f"mean: expected finite numbers, got {mean} (none beyond {LARGEST:g})")
        if mean.ndim == 1:
            cov = check_covariance(self.cov, "cov", size=mean.size)
        else:
            cov = check_covariances(self.cov, "cov", mean.shape)
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

    def __getitem__(self, which: Any) -> Gaussian:
        """Some of many beliefs.  Raises TypeError for a single one, whose entries are ``marginal``'s business."""
        if self.mean.ndim == 1:
            raise TypeError("a single belief has no others to choose from; for some of its entries, use marginal")
        return Gaussian(self.mean[which], self.cov[which])

    def marginal(self, indices: ArrayLike) -> Gaussian:
        """The belief over some of the entries: what is left when the others are forgotten."""
        indices = np.atleast_1d(np.asarray(indices))
        return Gaussian(self.mean[..., indices], self.cov[..., indices[:, None], indices])

    def sample(self, rng: np.random.Generator, size: int) -> Array:
        """``size`` draws, (size, n); of many beliefs (size, ..., n)."""
        normals = generator(rng).standard_normal((count(size, "size"), *self.mean.shape))
        return self.mean + (normals[..., None, :] @ np.swapaxes(self.factor, -1, -2))[..., 0, :]


def check_covariance(cov: ArrayLike, name: str = "cov", size: int | None = None) -> Array:
    """A symmetric copy of ``cov``, positive definite with the margin, or an error that says what is wrong with it."""
    cov = as_numbers(cov, name)
    if cov.ndim != 2 or cov.shape[0] != cov.shape[1] or (size is not None and cov.shape[0] != size):
        expected = "(n, n)" if size is None else f"({size}, {size})"
        raise ValueError(f"{name}: expected shape {expected}, got {cov.shape}")
    if not np.all(np.abs(cov) < LARGEST):
        raise ValueError(f"{name}: expected finite numbers, none beyond {LARGEST}, got\n{cov}")
    if np.abs(cov - cov.T).max() > 1e-8 * np.abs(cov).max():
        raise ValueError(f"{name}: expected a symmetric matrix, got one with |cov - covᵀ| up to "
                         f"{np.abs(cov - cov.T).max():.3g}:\n{cov}")  # fmt: skip
    cov = symmetrize(cov)
    if not cov.size or not cov.diagonal().min() > LARGEST**-2 or not _has_margin(cov):
        raise ValueError(f"{name}: expected a positive definite matrix, got eigenvalues {np.linalg.eigvalsh(cov)}")
    return cov


def check_covariances(cov: ArrayLike, name: str, shape: tuple[int, ...]) -> Array:
    """``check_covariance`` of many, (..., n, n) for the shape (..., n); the error names the first that is wrong."""
    cov = as_numbers(cov, name)
    if cov.shape != (*shape, shape[-1]):
        raise ValueError(f"{name}: expected shape {(*shape, shape[-1])}, got {cov.shape}")
    where = np.ndindex(shape[:-1])
    return np.reshape([check_covariance(cov[i], f"{name}[{', '.join(map(str, i))}]") for i in where], cov.shape)


def check_belief(belief: Any, name: str = "belief") -> None:
    """TypeError for what is no ``Gaussian``."""
    if not isinstance(belief, Gaussian):
        got = f"the class {belief.__name__} itself" if isinstance(belief, type) else type(belief).__name__
        raise TypeError(f"{name}: expected a Gaussian(mean, cov), got {got}")


def share_left(factor: Array, cov: Array) -> float:
    """det(L Lᵀ) / Π cov_ii: a bound on how narrow L Lᵀ is in units of cov's standard deviations.

    Where no variance of L Lᵀ is above cov's, its smallest eigenvalue in those units is at least this share divided by
    e, by the inequality of the means of the other eigenvalues.
    """
    return math.prod(factor.diagonal().tolist()) ** 2 / math.prod(cov.diagonal().tolist())


def factored(cov: Array) -> tuple[Array, Array]:
    """A sum of squares and its lower Cholesky factor; where rounding took the margin, with variances 2e-12 larger.

    Raises ValueError for a matrix that is not finite, or more indefinite than rounding makes it.
    """
    factor, indefinite = dpotrf(cov, 1)
    try:
        if not indefinite and share_left(factor, cov) > _SURE:
            return cov, factor
    except (ZeroDivisionError, OverflowError):
        pass  # products of many variances leave the range of floats: look closer
    if not np.isfinite(cov).all():
        raise ValueError(f"cov: expected finite numbers, got\n{cov}")
    if not _has_margin(cov):
        cov = cov + _LIFT * np.diag(cov.diagonal())
        if not _has_margin(cov):
            raise ValueError(f"cov: expected a positive definite matrix, got eigenvalues {np.linalg.eigvalsh(cov)}")
    return cov, dpotrf(cov, 1)[0]


def _has_margin(cov: Array) -> bool:
    """Is D⁻¹ cov D⁻¹ - MARGIN · I positive definite, D the standard deviations?"""
    return not dpotrf(cov - MARGIN * np.diag(cov.diagonal()))[1]


def symmetrize(matrix: Array) -> Array:
    """(M + Mᵀ)/2, which removes what rounding adds."""
    return 0.5 * (matrix + np.swapaxes(matrix, -1, -2))


def mahalanobis_squared(residual: ArrayLike, cov: ArrayLike, names: tuple[str, str] = ("residual", "cov")) -> float:
    """rᵀ C⁻¹ r for residual (n,) and covariance (n, n), through a Cholesky factor.

    Raises ValueError, with ``names`` for the two, for shapes, for what is not finite, for a C that is no covariance.
    """
    residual = as_numbers(residual, names[0])
    if residual.ndim != 1 or not np.all(np.abs(residual) < LARGEST):
        raise ValueError(f"{names[0]}: expected finite numbers of shape (n,), got {residual}")
    cov = check_covariance(cov, names[1], size=residual.size)
    return float(residual @ cho_solve(cho_factor(cov, lower=True), residual))


def nees(belief: Gaussian, truth: ArrayLike, residual: Callable[[Array, Array], Array] | None = None) -> Any:
    """Normalised estimation error squared: eᵀ P⁻¹ e with e = truth - mean.

    For an honest n-dimensional belief it is chi-square with n degrees of freedom, mean n.

    Parameters
    ----------
    truth : (n,), or (..., n) for many beliefs.
    residual : the state's own difference, ``residual(truth, mean) → (..., n)``; give it whenever the state holds
        an angle (for a pose: ``models.pose_residual``).  The default is a bare minus.

    Returns a float; of many beliefs an array (...).
    Raises ValueError when shapes differ or the truth is not finite, TypeError for a belief that is none.

    Source: Bar-Shalom, Li & Kirubarajan (2001), eq. 5.4.2-2.

    >>> nees(Gaussian([0.0, 0.0], np.diag([4.0, 1.0])), [2.0, 3.0])      # one sigma and three
    10.0
    """
    check_belief(belief)
    truth = as_numbers(truth, "truth")
    if truth.shape != belief.mean.shape:
        raise ValueError(f"truth: expected shape {belief.mean.shape}, got {truth.shape}")
    if not np.all(np.abs(truth) < LARGEST):
        raise ValueError(f"truth: expected finite numbers, got {truth} (none beyond {LARGEST:g})")
    if residual is not None and not callable(residual):
        raise TypeError(f"residual: expected a function of truth and mean, got {residual!r}")
    error = truth - belief.mean if residual is None else as_numbers(residual(truth, belief.mean), "residual")
    if error.shape != truth.shape:
        raise ValueError(f"residual: expected shape {truth.shape}, got {error.shape}")
    if error.ndim > 1:  # L⁻¹ e row after row: of many small systems NumPy's solve takes six times as long
        L, whitened = belief.factor, np.empty_like(error)
        for i in range(error.shape[-1]):
            known = np.sum(L[..., i, :i] * whitened[..., :i], axis=-1)
            whitened[..., i] = (error[..., i] - known) / L[..., i, i]
        return np.sum(whitened * whitened, axis=-1)
    return mahalanobis_squared(error, belief.cov)


def nis(innovation: ArrayLike, innovation_cov: ArrayLike) -> float:
    """Normalised innovation squared: νᵀ S⁻¹ ν, the NEES that needs no truth.  ν (m,), S (m, m).

    Raises ValueError for shapes, for what is not finite, for an S that is no covariance.

    >>> nis([0.3, 0.02], np.diag([0.1, 0.02]) ** 2)
    10.0

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 5.4.
    """
    return mahalanobis_squared(innovation, innovation_cov, ("innovation", "innovation_cov"))


def chi2_band(dof: int, runs: int = 1, confidence: float = 0.95) -> tuple[float, float]:
    """Two-sided band in which the average of ``runs`` independent chi-square values falls.

    Two-sided because a filter that is too modest is as wrong as one that is too sure: a covariance that is
    too large pushes the average *below* the band.

    Raises ValueError for dof < 1, runs < 1 or a confidence outside (0, 1), TypeError for what are no numbers.

    >>> low, high = chi2_band(3, runs=100)
    >>> print(f"{low:.2f} {high:.2f}")
    2.54 3.50

    Source: Bar-Shalom, Li & Kirubarajan (2001), eq. 5.4.2-14.
    """
    dof_, runs_ = number(dof, "dof"), number(runs, "runs")
    if not (1 <= dof_ < LARGEST and 1 <= runs_ < LARGEST):
        raise ValueError(f"expected dof ≥ 1 and runs ≥ 1, got dof={dof}, runs={runs}")
    confidence = probability(confidence, "confidence")
    tail = 0.5 * (1 - confidence)
    low, high = chi2_quantile([tail, 1 - tail], dof_ * runs_) / runs_
    return float(low), float(high)


def chi2_quantile(probability: ArrayLike, dof: ArrayLike) -> Any:
    """What a chi-square value with ``dof`` degrees of freedom stays below with this probability; both broadcast.

    A float of two numbers, else an array (...).  NaN outside [0, 1]; it raises what NumPy raises for what are no
    numbers.  ``scipy.stats.chi2.ppf`` says the same and takes half a second to import.

    >>> round(chi2_quantile(0.95, 2), 3)          # of two, -2 ln(1 - p)
    5.991

    Source: Abramowitz & Stegun (1964), section 26.4.19: χ² by the incomplete gamma function.
    """
    from scipy.special import gammaincinv  # here, where it is needed: importing a filter costs SciPy's linear algebra

    quantile = 2.0 * gammaincinv(0.5 * np.asarray(dof, dtype=float), probability)
    return float(quantile) if quantile.ndim == 0 else quantile


def ellipse(cov: ArrayLike, confidence: float = 0.95, points: int = 73) -> Array:
    """The closed contour that holds ``confidence`` of a planar Gaussian's mass, around 0: (2, 2) → (points, 2).

    Every point on it has the same Mahalanobis distance; its square is the chi-square quantile.

    Raises ValueError for a cov that is no covariance, or a confidence outside (0, 1).

    >>> ellipse([[4.0, 0.0], [0.0, 1.0]]).max(axis=0).round(2)        # 2.45 standard deviations to each side
    array([4.9 , 2.45])
    """
    cov = check_covariance(cov, size=2)
    confidence = probability(confidence, "confidence")
    turn = np.linspace(0, 2 * np.pi, count(points, "points"))
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return np.sqrt(chi2_quantile(confidence, 2)) * circle @ np.linalg.cholesky(cov).T


def probability(value: Any, name: str) -> float:
    """A number in (0, 1), or an error."""
    share = number(value, name)
    if not 1 / LARGEST < share < 1:
        raise ValueError(f"{name}: expected a probability in (0, 1), got {value}")
    return share


def with_margin(cov: ArrayLike, share: float = 1e-12) -> Array:
    """The covariance (n, n), positive definite with a margin: for what algebra made, before it is handed out.

    Rounding can take the smallest eigenvalue of a covariance below zero, and how far depends on the processor.  Here
    no eigenvalue of the *correlation* matrix stays below ``share`` of its largest.  Correlations have no unit, so
    metres beside radians do not matter; and on them it depends whether a Cholesky factorisation succeeds, which
    needs a few n ε ≈ 1e-15.  With the default, no combination of the quantities, each in units of
    its own σ, is known to better than a millionth.  A covariance that has the margin comes back as it was, its
    asymmetry removed.

    Raises ValueError for a matrix that is no covariance by more than rounding: not square, not finite, a variance
    that is not positive, an eigenvalue far below zero.

    >>> with_margin([[4.0, 2.0], [2.0, 1.0]], share=0.1).round(2)      # σ 2 and 1, correlation 1
    array([[4.4, 1.8],
           [1.8, 1.1]])

    Source: Higham (2002), Accuracy and Stability of Numerical Algorithms, theorem 10.7 (Demmel).
    """
    cov, share = as_numbers(cov, "cov").copy(), number(share, "share")
    if cov.ndim != 2 or cov.shape[0] != cov.shape[1] or cov.size == 0:
        raise ValueError(f"cov: expected shape (n, n), got {cov.shape}")
    if not 0 <= share < 1:
        raise ValueError(f"share: expected a number in [0, 1), got {share}")
    if not np.all(np.abs(cov) < LARGEST) or not np.all(cov.diagonal() > 0):
        raise ValueError(f"cov: expected finite numbers, the variances positive, got\n{cov}")
    cov = symmetrize(cov)
    scale = np.sqrt(cov.diagonal())
    found, axes = np.linalg.eigh(cov / scale[:, None] / scale)
    if found[0] < -1e-8 * found[-1]:
        raise ValueError(f"cov: expected a covariance up to rounding, got correlations with eigenvalues {found}")
    missing = np.maximum(share * found[-1] - found, 0.0)
    if not missing.any():
        return cov
    return cov + symmetrize(axes * missing @ axes.T) * scale[:, None] * scale
