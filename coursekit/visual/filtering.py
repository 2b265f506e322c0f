r"""A particle filter for a sensor that is better than its particles.

A fix is good to a few hundredths of a pixel; particles that moved are pixels apart.  Weighed by the sensor's own
likelihood, all but one of them come to nothing: the filter starves on good news.  ``VisualFilter`` draws a share of
its particles from the fix instead and asks the *motion* what they weigh (mixture MCL).  It also knows that a match
can be wrong and that a robot can be carried off, so neither is the end.

Poses are in the odometry's frame: x east and y north in pixels of the map, θ counter-clockwise from east.

Source: Thrun, Fox, Burgard & Dellaert (2001); Veach & Guibas (1995) for weighing samples of several proposals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from coursekit import particles
from coursekit.gaussian import Gaussian, symmetrize
from coursekit.geometry import Array, rotation, wrap_angle
from coursekit.models import MotionModel, pose_residual
from coursekit.particles import Particles
from coursekit.results import Rejected
from coursekit.visual.direct import DirectMatcher
from coursekit.visual.matching import Fix

REPORT_SPREAD = (50.0, 50.0, 0.314)  # px, px, rad: tuned by hand in the report


def log_likelihood(fix: Gaussian, outlier: float = 0.0, volume: float = 1.0) -> Callable[[Array], Array]:
    r"""log p(z | x) for ``particles.weigh``:  (1 - ε) N(x ⊖ z; 0, Σ) + ε/V, with the heading's difference wrapped.

    Parameters
    ----------
    fix : z and Σ, as in ``Fix.belief``; with a larger Σ this is the likelihood inflated.
    outlier : ε, the share of matches that are wrong and then say nothing; 0 trusts every one.
    volume : V, of the space of poses, px² rad.
    """
    if fix.mean.shape != (3,):
        raise ValueError(f"fix: expected a belief over [x, y, θ], got one over {fix.mean.size} numbers")
    if not 0 <= outlier < 1 or not volume > 0:
        raise ValueError(f"expected outlier in [0, 1) and volume > 0, got {outlier} and {volume}")

    def at(states: Array) -> Array:
        right = np.log1p(-outlier) + _log_normal(pose_residual(states, fix.mean), fix.cov)
        return right if outlier == 0 else np.logaddexp(right, np.log(outlier / volume))

    return at


def inflated(fix: Gaussian, spread: ArrayLike = REPORT_SPREAD) -> Gaussian:
    """The same fix with standard deviations [px, px, rad] that were chosen instead of measured."""
    return Gaussian(fix.mean, np.diag(np.square(np.asarray(spread, dtype=float))))


@dataclass(frozen=True)
class VisualFilter:
    """Mixture Monte-Carlo localisation on a map of h × w pixels.

    Parameters
    ----------
    map_shape : (h, w, ...) of the map image.
    motion : a motion model over [x, y, θ] in pixels; where it is told to go must not depend on where it is
        (its noise, seen from the robot, is the same everywhere), as with ``DifferentialDrive``.
    share : of the particles drawn from the fix, the rest come from the motion.
    outlier : probability that a fix is wrong.
    kidnap : probability that the robot was put down anywhere since the last fix.  Less than ``outlier``, so that
        one odd fix is doubted and a second that agrees with it is believed.
    direct : compares pictures that show no feature with the map as a whole; see ``step``.

    Raises ValueError for shares and probabilities outside (0, 1) and a map without area.
    """

    map_shape: tuple[int, ...]
    motion: MotionModel
    share: float = 0.3
    outlier: float = 0.02
    kidnap: float = 1e-3
    direct: DirectMatcher | None = None

    def __post_init__(self) -> None:
        for name in ("share", "outlier", "kidnap"):
            if not 0 < getattr(self, name) < 1:
                raise ValueError(f"{name}: expected a number in (0, 1), got {getattr(self, name)}")
        if len(self.map_shape) < 2 or not all(pixels >= 1 for pixels in self.map_shape[:2]):
            raise ValueError(f"map_shape: expected (h, w), got {self.map_shape}")

    @property
    def volume(self) -> float:
        """Of all poses on the map, px² rad."""
        return float(self.map_shape[0] * self.map_shape[1] * 2 * np.pi)

    def uniform(self, n: int, rng: np.random.Generator) -> Particles:
        """n particles anywhere on the map, heading anywhere: the belief of a robot that knows nothing."""
        if n < 1:
            raise ValueError(f"n: expected at least one particle, got {n}")
        h, w = self.map_shape[:2]
        corner, extent = np.array([-0.5, 0.5 - h, -np.pi]), np.array([w, h, 2 * np.pi])
        return Particles(corner + extent * rng.random((n, 3)), angles=(2,))

    def step(
        self,
        cloud: Particles,
        control: ArrayLike,
        dt: float,
        measured: Fix | Gaussian | Rejected,
        rng: np.random.Generator,
        image: NDArray[np.uint8] | None = None,
    ) -> Particles:
        """Move the cloud and, where there is a fix, mix particles from it in and weigh them all.

        Parameters
        ----------
        control : in the motion model's units, for DifferentialDrive [v px/s, ω rad/s].
        measured : what ``MapMatcher.locate`` returned.
        image : the picture it was asked about.  After a rejection a filter with a ``direct`` matcher weighs its
            particles by that; without either, the prediction stands as it is.

        Returns a weighted cloud, ready for ``mode``.  It is resampled at the start of the next step, when its
        effective sample size has fallen below half.
        """
        if particles.effective_sample_size(cloud.weights) < len(cloud) / 2:
            cloud = particles.resample(cloud, rng)
        moved = particles.predict(cloud, self.motion, control, dt, rng)
        if isinstance(measured, Fix):
            measured = measured.belief
        if isinstance(measured, Gaussian):
            return self._mix(cloud, moved, np.asarray(control, dtype=float), dt, measured, rng)
        if not isinstance(measured, Rejected):
            raise ValueError(f"measured: expected a Fix, a Gaussian or Rejected, got {type(measured).__name__}")
        if self.direct is None or image is None:
            return moved
        scale = self.direct.scale(image, mode(moved).mean)
        return particles.weigh(moved, self.direct.log_likelihood(image, scale))

    def _mix(
        self, before: Particles, moved: Particles, control: Array, dt: float, fix: Gaussian, rng: np.random.Generator
    ) -> Particles:
        """Particles from two sources, weighed by  w = prior · likelihood / (mixture of the two proposals)."""
        likelihood = log_likelihood(fix, self.outlier, self.volume)
        n = len(moved)
        m = min(round(self.share * n), n - 1)
        if m == 0:  # too few to share out
            return particles.weigh(moved, likelihood)
        kept = particles.resample(moved, rng, size=n - m).states
        states, share = np.vstack([kept, _draw(fix, m, rng)]), m / n
        log_fix, log_z = log_likelihood(fix)(states), likelihood(states)
        # Away from the fix the prior cancels: such particles came from it.
        log_w = np.log1p(-self.kidnap) + log_z - np.log1p(-share)
        near = log_fix > log_fix.max() - 30
        log_prior = self._log_prior(states[near], before, control, dt, fix)
        lands = np.logaddexp(np.log1p(-self.kidnap) + log_prior, np.log(self.kidnap / self.volume))
        log_w[near] = lands + log_z[near] - np.logaddexp(np.log1p(-share) + log_prior, np.log(share) + log_fix[near])
        return Particles(states, log_w, angles=before.angles)

    def _log_prior(self, states: Array, before: Particles, control: Array, dt: float, fix: Gaussian) -> Array:
        """log Σ wᵢ p(x | xᵢ, u): where the cloud, moved, expected the robot.  states (k, 3) near the fix → (k,)."""
        noise = self.motion.Q(np.zeros(3), control, dt)  # in the frame of a robot at the origin: turn x to it
        ahead = self.motion.f(before.states, control, dt)
        reach = 12 * np.sqrt(np.trace(noise[:2, :2])) + 12 * np.sqrt(np.trace(fix.cov[:2, :2]))
        close = (np.hypot(*(ahead[:, :2] - fix.mean[:2]).T) < reach) & np.isfinite(before.log_weights)
        if not close.any():
            return np.full(len(states), -np.inf)
        # With W = L⁻¹ R(θᵢ)ᵀ the exponent -|W (x - f(xᵢ, u))|²/2 is a quadratic in x: one product for all pairs.
        x, centres = pose_residual(states, fix.mean), pose_residual(ahead[close], fix.mean)
        factor = np.linalg.cholesky(noise)
        to_robot = np.zeros((len(centres), 3, 3))
        to_robot[:, :2, :2], to_robot[:, 2, 2] = rotation(-before.states[close, 2]), 1
        W = np.linalg.solve(factor, np.eye(3)) @ to_robot
        Wc = np.einsum("nij,nj->ni", W, centres)
        constant = before.log_weights[close] - np.log(np.diag(factor)).sum() - 1.5 * np.log(2 * np.pi)
        quadratic = np.einsum("nij,nik->jkn", W, W).reshape(9, -1)
        coefficients = np.vstack([-0.5 * quadratic, np.einsum("nij,ni->jn", W, Wc), constant - 0.5 * np.sum(Wc**2, 1)])
        terms = np.column_stack([np.einsum("ki,kj->kij", x, x).reshape(-1, 9), x, np.ones(len(x))])
        # A few rows at a time: they stay in the cache, and are too few to be worth a second thread.
        logs = (rows @ coefficients for rows in np.array_split(terms, len(terms) // 16 + 1))
        return np.concatenate([_log_sum(part) for part in logs])


def _log_sum(logs: Array) -> Array:
    """log Σ exp along the last axis."""
    peak = logs.max(axis=1, keepdims=True)
    return np.asarray(peak[:, 0] + np.log(np.exp(logs - peak).sum(axis=1)))


def _draw(fix: Gaussian, m: int, rng: np.random.Generator) -> Array:
    """m poses from a Gaussian in pairs that mirror one another, so that their mean is exact: (m, 3)."""
    half = rng.standard_normal(((m + 1) // 2, 3)) @ np.linalg.cholesky(fix.cov).T
    drawn = fix.mean + np.vstack([half, -half])[:m]
    drawn[:, 2] = wrap_angle(drawn[:, 2])
    return drawn


def follow(
    visual_filter: VisualFilter,
    cloud: Particles,
    controls: ArrayLike,
    dt: float,
    measurements: Iterable[Fix | Gaussian | Rejected],
    rng: np.random.Generator,
) -> Iterator[Particles]:
    """The weighted cloud after each step: ``controls[k]`` (n, 2) moves it, then ``measurements[k]`` weighs it."""
    for control, measured in zip(np.asarray(controls, dtype=float), measurements, strict=True):
        cloud = visual_filter.step(cloud, control, dt, measured, rng)
        yield cloud


def mode(cloud: Particles, cell: float = 40.0) -> Gaussian:
    """Mean and covariance of the heaviest clump: particles whose cells of ``cell`` px touch one another.

    A cloud that doubts between two places has its mean where the robot surely is not.
    """
    if not (np.isfinite(cell) and cell > 0):
        raise ValueError(f"cell: expected a size > 0 px, got {cell}")
    heavy = np.flatnonzero(cloud.weights > 1e-6 / len(cloud))
    cells = np.floor(cloud.states[heavy, :2] / cell).astype(int)
    cells -= cells.min(axis=0)
    wide = cells[:, 1].max() + 1
    # Only cells that hold a particle are looked at: a grid over all between two far clumps would fill the memory.
    held, holder = np.unique(cells[:, 0] * wide + cells[:, 1], return_inverse=True)
    i, j = KDTree(np.column_stack(divmod(held, wide))).query_pairs(1, p=np.inf, output_type="ndarray").T
    touching = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(len(held), len(held)))
    clump = connected_components(touching, directed=False)[1][holder]
    inside = heavy[clump == np.bincount(clump, weights=cloud.weights[heavy]).argmax()]
    chosen = Particles(cloud.states[inside], cloud.log_weights[inside], angles=cloud.angles)
    return Gaussian(particles.mean(chosen), _at_least(particles.covariance(chosen)))


def mean(cloud: Particles) -> Gaussian:
    """Mean and covariance of the whole cloud."""
    return Gaussian(particles.mean(cloud), _at_least(particles.covariance(cloud)))


def heaviest(cloud: Particles) -> Array:
    """The particle of greatest weight, (3,): the report's estimate.  After resampling all weigh the same, and it
    is whichever comes first."""
    return np.array(cloud.states[int(np.argmax(cloud.log_weights))])


def _at_least(cov: Array) -> Array:
    """A cloud of copies has no spread; a thousandth of a pixel keeps its covariance positive definite."""
    return symmetrize(cov + np.diag([1e-6, 1e-6, 1e-10]))


def _log_normal(residual: Array, cov: Array) -> Array:
    """log N(residual; 0, cov): (..., d) → (...)."""
    factor = np.linalg.cholesky(cov)
    white = residual @ np.linalg.solve(factor, np.eye(len(cov))).T
    constant = np.log(np.diag(factor)).sum() + 0.5 * len(cov) * np.log(2 * np.pi)
    return np.asarray(-0.5 * np.einsum("...i,...i->...", white, white) - constant)
