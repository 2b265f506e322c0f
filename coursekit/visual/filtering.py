r"""A particle filter for a sensor that is sharper than its cloud: mixture Monte-Carlo localisation.

A fix is good to a few hundredths of a pixel; particles that moved are pixels apart.  Weighed by the fix's own
likelihood, all but one of them get a weight of nearly zero: the filter is starved of particles.  ``VisualFilter``
draws a share φ of its particles from the fix N, and weighs all by

    w(x) = p(x) L(x) / ((1 - φ) p(x) + φ N(x)),      p(x) = Σᵢ wᵢ p(x | xᵢ, u),

with p the prediction (``log_prediction``) and L the likelihood, which knows that a match can be wrong.

Poses are in the odometry's frame: x east and y north in pixels of the map, θ counter-clockwise from east.

Source: Thrun, Fox, Burgard & Dellaert (2001); Veach & Guibas (1995) for weighing samples of several proposals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coursekit import particles
from coursekit.doors import as_numbers
from coursekit.gaussian import Gaussian, check_belief
from coursekit.geometry import Array, wrap_angle
from coursekit.models import SampledMotion, pose_residual
from coursekit.models.checks import has_parts
from coursekit.particles import Particles
from coursekit.results import Rejected
from coursekit.visual._fast_prediction import log_prediction_near
from coursekit.visual.direct import DirectMatcher
from coursekit.visual.estimates import dominant_cluster
from coursekit.visual.matching import Fix
from coursekit.visual.prediction import log_normal

REPORT_SPREAD = (50.0, 50.0, 0.314)  # px, px, rad: tuned by hand in the report
NEGLIGIBLE = 30.0  # nats below its peak a density counts as zero: e⁻³⁰ = 1e-13


@dataclass(frozen=True)
class VisualFilter:
    """Mixture Monte-Carlo localisation on a map of h × w pixels.

    Parameters
    ----------
    map_shape : (h, w, ...) of the map image.
    motion : a motion model over [x, y, θ] in pixels whose noise, seen from the robot, is the same everywhere, as
        with ``DifferentialDrive``.
    share : φ, the share of the particles that is drawn from the fix; the rest comes from the motion.
    outlier : ε, the probability that a fix is wrong.
    kidnap : κ, the probability that the robot was put down anywhere since the last fix.  Less than ``outlier``, so
        that one odd fix is doubted and a second that agrees with it is believed.
    direct : compares pictures that show no feature with the map as a whole; see ``step``.

    Raises ValueError for shares and probabilities outside (0, 1) and a map without area, TypeError for a motion
    without f, Q and sample.

    >>> from coursekit.models import DifferentialDrive
    >>> rng = np.random.default_rng(1)
    >>> robot = VisualFilter((800, 2560), DifferentialDrive(4.0, 0.05, (0.4, 0.4, 1e-3)))
    >>> cloud = robot.uniform(1000, rng)
    >>> fix = Gaussian([700.0, -300.0, 0.5], np.diag([0.02, 0.02, 1e-4]) ** 2)
    >>> for _ in range(2):
    ...     cloud = robot.step(cloud, [0.0, 0.0], 0.5, fix, rng)
    >>> dominant_cluster(cloud).mean.round(1).tolist()
    [700.0, -300.0, 0.5]

    Source: Thrun et al. (2001).
    """

    map_shape: tuple[int, ...]
    motion: SampledMotion
    share: float = 0.3
    outlier: float = 0.02
    kidnap: float = 1e-3
    direct: DirectMatcher | None = None

    def __post_init__(self) -> None:
        for name in ("share", "outlier", "kidnap"):
            value = as_numbers(getattr(self, name), name)
            if value.shape != () or not 0 < value < 1:
                raise ValueError(f"{name}: expected a number in (0, 1), got {getattr(self, name)}")
        shape = as_numbers(self.map_shape, "map_shape")
        if shape.ndim != 1 or len(shape) < 2 or not np.all(shape[:2] >= 1):
            raise ValueError(f"map_shape: expected (h, w), got {self.map_shape}")
        has_parts(self.motion, "motion", ("f", "Q", "sample"))
        if not (self.direct is None or isinstance(self.direct, DirectMatcher)):
            raise TypeError(f"direct: expected a DirectMatcher or None, got {type(self.direct).__name__}")

    @property
    def volume(self) -> float:
        """V, of all poses on the map, px² rad."""
        return float(self.map_shape[0] * self.map_shape[1] * 2 * np.pi)

    def uniform(self, n: int, rng: np.random.Generator) -> Particles:
        """n particles anywhere on the map, heading anywhere: the belief of a robot that knows nothing.

        Raises ValueError for n < 1.
        """
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
        """Move the cloud; where there is a fix, draw a share of the particles from it, and weigh them all.

        Parameters
        ----------
        control : in the motion model's units, for DifferentialDrive [v px/s, ω rad/s].
        dt : seconds, > 0.
        measured : what ``MapMatcher.locate`` returned, or a belief over [x, y, θ].
        image : the picture it was asked about.  After a rejection a filter with a ``direct`` matcher weighs its
            particles by that; without either, the prediction stands as it is.

        Returns a weighted cloud, ready for ``dominant_cluster``.  It is resampled at the start of the next step, when
        its effective sample size has fallen below half.

        Raises TypeError for what is no cloud and no measurement, ValueError for numbers that are not finite.
        """
        if not isinstance(cloud, Particles):
            raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
        measured = measured.belief if isinstance(measured, Fix) else measured
        if not isinstance(measured, (Gaussian, Rejected)):
            raise TypeError(f"measured: expected a Fix, a Gaussian or Rejected, got {type(measured).__name__}")
        if particles.effective_sample_size(cloud.weights) < len(cloud) / 2:
            cloud = particles.resample(cloud, rng)
        moved = particles.predict(cloud, self.motion, control, dt, rng)
        if isinstance(measured, Gaussian):
            return self._mix(cloud, moved, np.asarray(control, dtype=float), dt, measured, rng)
        if self.direct is None or image is None:
            return moved
        scale = self.direct.scale(image, dominant_cluster(moved).mean)
        return particles.weigh(moved, self.direct.log_likelihood(image, scale))

    def _mix(
        self, before: Particles, moved: Particles, control: Array, dt: float, fix: Gaussian, rng: np.random.Generator
    ) -> Particles:
        """n - m particles that moved and m from the fix, weighed by  p(x) L(x) / ((1 - φ) p(x) + φ N(x))."""
        likelihood = log_likelihood(fix, self.outlier, self.volume)
        n = len(moved)
        m = min(round(self.share * n), n - 1)
        if m == 0:  # too few to share out
            return particles.weigh(moved, likelihood)
        kept = particles.resample(moved, rng, size=n - m).states
        states, phi = np.vstack([kept, draw(fix, m, rng)]), m / n
        log_N, log_L = log_likelihood(fix)(states), likelihood(states)
        # Far from the fix N vanishes, p cancels and leaves w = (1 - κ) L/(1 - φ): p is needed near the fix only.
        log_w = np.log1p(-self.kidnap) + log_L - np.log1p(-phi)
        near = log_N > log_N.max() - NEGLIGIBLE
        log_p = log_prediction_near(fix, states[near], before, self.motion, control, dt)
        log_landed = np.logaddexp(np.log1p(-self.kidnap) + log_p, np.log(self.kidnap / self.volume))
        log_proposal = np.logaddexp(np.log1p(-phi) + log_p, np.log(phi) + log_N[near])
        log_w[near] = log_landed + log_L[near] - log_proposal
        return Particles(states, log_w, angles=before.angles)


def log_likelihood(fix: Gaussian, outlier: float = 0.0, volume: float = 1.0) -> Callable[[Array], Array]:
    r"""log L(x) for ``particles.weigh``:  L = (1 - ε) N(x ⊖ z; 0, Σ) + ε/V, with the heading's difference wrapped.

    Parameters
    ----------
    fix : z and Σ, as in ``Fix.belief``; with a larger Σ this is the inflated likelihood.
    outlier : ε, the share of matches that are wrong and then say nothing; 0 trusts every one.
    volume : V, of the space of poses, px² rad.

    Returns a function of states, (n, 3) in the odometry's frame → (n,).

    Raises TypeError for what is no Gaussian, ValueError for one that is not over [x, y, θ], ε outside [0, 1), V ≤ 0.

    >>> fix = Gaussian([0.0, 0.0, 3.1], np.eye(3))
    >>> log_likelihood(fix)(np.array([[0.0, 0.0, 3.1], [1.0, 0.0, 3.1]])).round(3)
    array([-2.757, -3.257])

    Source: Thrun, Burgard & Fox (2005), section 6.3, for the uniform share of wrong measurements.
    """
    check_belief(fix, "fix")
    if fix.mean.shape != (3,):
        raise ValueError(f"fix: expected a belief over [x, y, θ], got one over {fix.mean.size} numbers")
    if not 0 <= outlier < 1 or not volume > 0:
        raise ValueError(f"expected outlier in [0, 1) and volume > 0, got {outlier} and {volume}")

    def at(states: Array) -> Array:
        right = np.log1p(-outlier) + log_normal(pose_residual(states, fix.mean), fix.cov)
        return right if outlier == 0 else np.logaddexp(right, np.log(outlier / volume))

    return at


def inflated(fix: Gaussian, spread: ArrayLike = REPORT_SPREAD) -> Gaussian:
    """The same fix with standard deviations (3,) [px, px, rad] that were chosen instead of measured.

    Raises TypeError for what is no Gaussian, ValueError for spreads that are not positive.

    >>> inflated(Gaussian([5.0, 5.0, 0.0], 1e-4 * np.eye(3)), [2.0, 2.0, 0.1]).cov.diagonal()
    array([4.  , 4.  , 0.01])
    """
    check_belief(fix, "fix")
    return Gaussian(fix.mean, np.diag(np.square(as_numbers(spread, "spread"))))


def draw(fix: Gaussian, m: int, rng: np.random.Generator) -> Array:
    """m poses from a fix, (m, 3), as pairs that mirror one another (antithetic): an even number has the exact mean."""
    half = rng.standard_normal(((m + 1) // 2, 3)) @ fix.factor.T
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
    """The weighted cloud after each step: ``controls[k]`` (n, 2) moves it, then ``measurements[k]`` weighs it.

    Raises what ``VisualFilter.step`` raises, and ValueError when there are more of the one than of the other.

    >>> from coursekit.models import DifferentialDrive
    >>> rng, robot = np.random.default_rng(1), VisualFilter((800, 2560), DifferentialDrive(4.0, 0.05, (0.4, 0.4, 1e-3)))
    >>> fixes = [Gaussian([700.0 + 10 * k, -300.0, 0.0], 1e-3 * np.eye(3)) for k in range(4)]
    >>> clouds = list(follow(robot, robot.uniform(500, rng), [[20.0, 0.0]] * 4, 0.5, fixes, rng))
    >>> len(clouds), float(dominant_cluster(clouds[-1]).mean[0].round())
    (4, 730.0)
    """
    for control, measured in zip(as_numbers(controls, "controls"), measurements, strict=True):
        cloud = visual_filter.step(cloud, control, dt, measured, rng)
        yield cloud
