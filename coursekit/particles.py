r"""The particle filter: a belief as a cloud of weighted guesses, moved, weighed and drawn again.

Three small functions make a filter.  A cloud of n states x⁽ⁱ⁾ with weights w⁽ⁱ⁾ stands for the belief
Σ w⁽ⁱ⁾ δ(x - x⁽ⁱ⁾); weights live in logs, because a product of twenty likelihoods underflows and a sum does not.

>>> from coursekit.models import DifferentialDrive, RangeOnly
>>> rng = np.random.default_rng(1)
>>> cloud = Particles(rng.normal(size=(1000, 3)), angles=(2,))
>>> cloud = predict(cloud, DifferentialDrive(), [1.0, 0.1], 0.5, rng)
>>> cloud = weigh(cloud, log_likelihood(RangeOnly([4.0, 0.0], position=(0, 1)), [3.0]))
>>> if effective_sample_size(cloud.weights) < 500:
...     cloud = resample(cloud, rng)
>>> mean(cloud).shape, covariance(cloud).shape
((3,), (3, 3))

Source: Gordon, Salmond & Smith (1993); Thrun, Burgard & Fox (2005), chapter 4; Doucet & Johansen (2011).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm

from coursekit.gaussian import Gaussian, check_covariance, symmetrize
from coursekit.geometry import Array, wrap_angle
from coursekit.models import MotionModel, SensorModel

Indices = NDArray[np.intp]
BLOCK = 8192  # particles at a time: a dozen temporaries of 64 kB fit a second-level cache, a cloud of 10⁵ does not


class Resampler(Protocol):
    def __call__(self, weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices: ...


@dataclass(frozen=True, eq=False)
class Particles:
    """A weighted cloud: the belief Σ exp(log_weights[i]) δ(x - states[i]).

    states (n, d), finite; log_weights (n,), up to a common constant: they are normalised here, so that their
    exponentials sum to one.  Without them all weigh the same.  Arrays are copied and made read-only.

    angles : the columns of ``states`` that live on a circle, (2,) for poses; means and spreads heed it.
    log_evidence : log p(z | past) in nats of the weighing that made this cloud, 0 where there was none.
    rejected : why that weighing left the weights alone; empty when it did not.

    Raises ValueError for an empty cloud, NaN, shapes that disagree, and weights that are all zero.
    """

    states: Array
    log_weights: Array = None  # type: ignore[assignment]  # None: all equal; an array from __post_init__ on
    _: KW_ONLY
    angles: tuple[int, ...] = ()
    log_evidence: float = 0.0
    rejected: str = ""

    def __post_init__(self) -> None:
        states = _check_states(np.array(self.states, dtype=float))
        n, d = states.shape
        log_weights = np.zeros(n) if self.log_weights is None else np.array(self.log_weights, dtype=float)
        if log_weights.shape != (n,):
            raise ValueError(f"log_weights: expected shape ({n},), one for each state, got {log_weights.shape}")
        if not all(-d <= column < d for column in self.angles):
            raise ValueError(f"angles: expected columns of states with {d} columns, got {self.angles}")
        _check_logs(log_weights, "log_weights")
        if log_weights.max() == -np.inf:
            raise ValueError("log_weights: expected at least one that is not -inf, got weights that are all zero")
        _own(self, states, _normalise(log_weights)[0])

    def __len__(self) -> int:
        return len(self.states)

    @cached_property
    def weights(self) -> Array:
        """exp(log_weights), (n,), summing to one."""
        return _frozen(np.exp(self.log_weights))


def predict(
    cloud: Particles, motion: MotionModel, control: ArrayLike, dt: float, rng: np.random.Generator
) -> Particles:
    """Draw each particle's next state from p(x' | x, u); weights stay.

    Parameters
    ----------
    control : in the model's units; for DifferentialDrive [v m/s, ω rad/s], one for all (2,) or one each (n, 2).
    dt : seconds, > 0.  The model's noise is drawn once for the whole step: see Lab 7 before cutting steps.

    The model is called on blocks of at most 8192 particles, whose intermediate results stay in the cache.

    Source: Thrun, Burgard & Fox (2005), table 4.3, line 4.
    """
    control = np.asarray(control, dtype=float)
    each = control.ndim == 2 and len(control) == len(cloud)
    states = np.empty_like(cloud.states)
    for block in _blocks(len(cloud)):
        moved = motion.sample(cloud.states[block], control[block] if each else control, dt, rng)
        if np.shape(moved) != states[block].shape:
            raise ValueError(f"motion.sample: expected shape {states[block].shape}, got {np.shape(moved)}")
        states[block] = moved
    return _remember(_like(cloud, _check_states(states), cloud.log_weights), cloud.weights)


def weigh(cloud: Particles, log_likelihood: ArrayLike | Callable[[Array], ArrayLike]) -> Particles:
    """Bayes' rule on a cloud:  w⁽ⁱ⁾ ∝ w⁽ⁱ⁾ p(z | x⁽ⁱ⁾).

    Parameters
    ----------
    log_likelihood : log p(z | x⁽ⁱ⁾) in nats, (n,), or a function that makes it from the states (n, d).
        -inf says "impossible here" and is welcome.

    A measurement that is impossible at *every* particle cannot be used: the weights stay as they were and
    ``rejected`` says why (``log_evidence`` is then -inf).  The cloud has lost the robot, or the sensor erred.

    Raises ValueError for a wrong shape, NaN or +inf: those are errors of the model, not of the measurement.

    Source: Thrun, Burgard & Fox (2005), table 4.3, line 5.
    """
    given = log_likelihood(cloud.states) if callable(log_likelihood) else log_likelihood
    gained = np.asarray(given, dtype=float)
    if gained.shape != cloud.log_weights.shape:
        raise ValueError(f"log_likelihood: expected shape {cloud.log_weights.shape}, got {gained.shape}")
    _check_logs(gained, "log_likelihood")
    log_weights = cloud.log_weights + gained
    if log_weights.max() == -np.inf:
        reason = f"impossible measurement: its likelihood is zero at every one of the {len(cloud)} particles"
        kept = _like(cloud, cloud.states, cloud.log_weights, log_evidence=-np.inf, rejected=reason)
        return _remember(kept, cloud.weights)
    log_weights, weights, log_evidence = _normalise(log_weights)
    return _remember(_like(cloud, cloud.states, log_weights, log_evidence=log_evidence), weights)


def log_likelihood(sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Callable[[Array], Array]:
    """log N(z; h(x), R) as a function of states (n, d) → (n,), for ``weigh``.  z (m,), R (m, m)."""
    z = np.atleast_1d(np.asarray(z, dtype=float))
    R = check_covariance(sensor.R if R is None else R, "R", size=z.size)
    if not np.all(np.isfinite(z)):
        raise ValueError(f"z: expected finite numbers, got {z}")
    factor = np.linalg.cholesky(R)
    whiten = np.linalg.solve(factor, np.eye(z.size)) / np.sqrt(2)
    constant = -np.log(np.diag(factor)).sum() - 0.5 * z.size * np.log(2 * np.pi)

    def at(states: Array) -> Array:
        out = np.empty(len(states))
        for block in _blocks(len(states)):
            r = sensor.residual(z, sensor.h(states[block])).T
            white = (sum(w * r_i for w, r_i in zip(row, r)) for row in whiten)
            out[block] = constant - sum(e * e for e in white)
        return out

    return at


def effective_sample_size(weights: ArrayLike) -> float:
    """(Σw)²/Σw²: how many equally weighted particles would be as good.  From 1 to n.

    Source: Kong, Liu & Wong (1994).

    >>> round(effective_sample_size([0.5, 0.5, 0.0, 0.0]), 12)
    2.0
    """
    weights = _check_weights(weights)
    return float(weights.sum() ** 2 / np.square(weights).sum())


def systematic(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Lay one comb of evenly spaced teeth over the weights: particle i is copied ⌊nwᵢ⌋ or ⌊nwᵢ⌋+1 times.

    One random number for the whole draw, O(n).  Returns ``size`` ascending indices (default: as many as weights).

    Source: Carpenter, Clifford & Fearnhead (1999); Kitagawa (1996).
    """
    rim = _rim(weights)
    n = _places(rim, size)
    return _under(np.minimum((rim * n + rng.random()).astype(np.intp), n), n)


def stratified(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """The comb with each tooth placed at random within its own 1/n.  Source: Kitagawa (1996)."""
    rim = _rim(weights)
    n = _places(rim, size)
    whole = (rim * n).astype(np.intp)
    teeth = np.append(rng.random(n), 1.0)  # each within its own stratum; nothing lies beyond the last
    return _under(whole + (teeth[whole] < rim * n - whole), n)


def multinomial(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Independent draws, with replacement: the baseline that every other method improves on.

    Sorted uniforms come from the spacings of a Poisson process, which saves the sort.  Ascending indices.
    Source: Gordon, Salmond & Smith (1993); Devroye (1986), section V.3.
    """
    rim = _rim(weights)
    arrivals = np.cumsum(rng.standard_exponential(_places(rim, size) + 1))
    return _spin(rim, arrivals[:-1] / arrivals[-1])


def residual(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """⌊nwᵢ⌋ copies for certain; the places left over by independent draws from what was cut off.

    Source: Liu & Chen (1998), section 3.2.
    """
    weights = _check_weights(weights)
    expected = weights * (_places(weights, size) / weights.sum())
    certain = np.floor(expected)
    left = _places(weights, size) - int(certain.sum())
    copies = np.repeat(np.arange(weights.size), certain.astype(np.intp))
    return np.concatenate([copies, multinomial(expected - certain, rng, left)]) if left > 0 else copies


def wheel(weights: ArrayLike, rng: np.random.Generator, size: int | None = None) -> Indices:
    """Roll along the rim of a wheel whose slices are the weights, by up to twice the largest at a time.

    Started anywhere on the rim, each stop is uniform on it, so the draw is unbiased.  (As commonly taught it
    starts at the edge of a random *slice*, and is not: Lab 7's exhibit.)  Its stops hang together, so its
    variance is not small: it is here because so many use it.  Source: Thrun (2012), Udacity CS373, unit 3.
    """
    weights = _check_weights(weights)
    step = 2 * weights.max() / weights.sum()
    travelled = np.cumsum(rng.random(_places(weights, size)) * step)
    return _spin(_rim(weights), np.mod(rng.random() + travelled, 1.0))


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
    "wheel": wheel,
}


def resample(
    cloud: Particles, rng: np.random.Generator, method: Resampler = systematic, size: int | None = None
) -> Particles:
    """Copy each particle in proportion to its weight, so that all weigh the same again.

    The belief's expectation is kept, its variety is not: do it when the effective sample size has fallen, not
    every step.  ``size`` changes the number of particles (see ``kld_size``).
    """
    indices = method(cloud.weights, rng) if size is None else method(cloud.weights, rng, size=size)
    n = len(indices)
    return _remember(_like(cloud, cloud.states.take(indices, axis=0), np.full(n, -np.log(n))), np.full(n, 1 / n))


def mean(cloud: Particles) -> Array:
    """The weighted mean, (d,); along ``cloud.angles`` the direction of the mean unit vector, in (-π, π]."""
    w, centre = cloud.weights, np.einsum("n,nd->d", cloud.weights, cloud.states)
    for column in cloud.angles:
        angle = cloud.states[:, column]
        centre[column] = np.arctan2((w * np.sin(angle)).sum(), (w * np.cos(angle)).sum())
    return centre


def covariance(cloud: Particles) -> Array:
    """Σ w⁽ⁱ⁾ e⁽ⁱ⁾ e⁽ⁱ⁾ᵀ with e = x - mean, angles wrapped: (d, d), symmetric, positive *semi*definite."""
    e = _deviations(cloud)
    return symmetrize((cloud.weights * e.T) @ e)


def as_gaussian(cloud: Particles) -> Gaussian:
    """The Gaussian with the cloud's mean and covariance, to ask for its NEES.

    Raises ValueError when the cloud is too thin to have one: fewer than d + 1 distinct states.
    """
    return Gaussian(mean(cloud), covariance(cloud))


def roughen(cloud: Particles, rng: np.random.Generator, scale: float = 0.2) -> Particles:
    """Shake the copies apart: N(0, σⱼ²) on column j, σⱼ = scale · (its extent) · n^(-1/d).

    It invents noise that no model asked for, in exchange for variety.  Source: Gordon et al. (1993), section 4.
    """
    if not (np.isfinite(scale) and scale >= 0):
        raise ValueError(f"scale: expected a number ≥ 0, got {scale}")
    n, d = cloud.states.shape
    sigma = scale * np.ptp(_deviations(cloud), axis=0) * n ** (-1 / d)
    states = cloud.states + rng.standard_normal((n, d)) * sigma
    for column in cloud.angles:
        states[:, column] = wrap_angle(states[:, column])
    return _remember(_like(cloud, states, cloud.log_weights), cloud.weights)


def kld_size(bins: int, error: float = 0.05, confidence: float = 0.99) -> int:
    """Particles needed so that, with probability ``confidence``, the cloud's histogram over ``bins`` occupied
    bins is within ``error`` nats (Kullback-Leibler) of the belief it was drawn from.

    Source: Fox (2003), eq. 7, the Wilson-Hilferty approximation of a chi-square quantile.
    """
    if bins < 1 or not error > 0 or not 0 < confidence < 1:
        raise ValueError(
            "expected bins ≥ 1, error > 0 and confidence in (0, 1), "
            f"got bins={bins}, error={error}, confidence={confidence}"
        )
    if bins == 1:
        return 1
    spread = 2 / (9 * (bins - 1))
    return int(np.ceil((bins - 1) / (2 * error) * (1 - spread + np.sqrt(spread) * norm.ppf(confidence)) ** 3))


def occupied_bins(states: ArrayLike, bin_size: ArrayLike) -> int:
    """How many boxes of a grid hold a state: states (n, d), bin_size (d,) or one for all, in the states' units."""
    states, bin_size = np.asarray(states, dtype=float), np.asarray(bin_size, dtype=float)
    if not np.all(bin_size > 0):
        raise ValueError(f"bin_size: expected numbers > 0, got {bin_size}")
    return len(np.unique(np.floor(states / bin_size).astype(np.int64), axis=0))


def _under(below: Indices, n: int) -> Indices:
    """The slice under each of n teeth, from how many teeth lie below each slice's upper edge.

    Tooth k lies in slice i when i edges lie at or below it: counting edges costs a quarter of ``np.repeat``.
    """
    return np.cumsum(np.bincount(below, minlength=n + 1)[:n])


def _spin(rim: Array, stops: Array) -> Indices:
    """The slice that holds each stop in [0, 1); a slice of width zero holds none."""
    return np.searchsorted(rim, np.minimum(stops, np.nextafter(1.0, 0.0)), side="right")


def _rim(weights: ArrayLike) -> Array:
    """Cumulative weights, (n,), ending at exactly one *from the last positive weight on*."""
    rim = np.cumsum(_check_weights(weights))
    rim /= rim[-1]
    return rim


def _places(weights: Array, size: int | None) -> int:
    if size is not None and size < 1:
        raise ValueError(f"size: expected at least one place to fill, got {size}")
    return weights.size if size is None else size


def _check_weights(weights: ArrayLike) -> Array:
    weights = np.asarray(weights, dtype=float)
    if weights.ndim != 1 or weights.size == 0:
        raise ValueError(f"weights: expected shape (n,) with n ≥ 1, got {weights.shape}")
    low, high = weights.min(), weights.max()
    if not (low >= 0 and np.isfinite(high)):
        wrong = int(np.argmin((weights >= 0) & np.isfinite(weights)))
        raise ValueError(f"weights: expected finite numbers ≥ 0, got {weights[wrong]} at index {wrong}")
    if high == 0:
        raise ValueError(f"weights: expected a sum > 0, got {weights.size} weights that are all zero")
    # Far from one, sums and squares would over- or underflow.
    return weights if 1e-50 < high < 1e50 else weights / high


def _check_logs(logs: Array, name: str) -> None:
    if not logs.max() < np.inf:  # NaN comes out of max, and fails the comparison
        wrong = int(np.argmin(logs < np.inf))
        raise ValueError(f"{name}: expected numbers or -inf, got {logs[wrong]} at index {wrong}")


def _normalise(log_weights: Array) -> tuple[Array, Array, float]:
    """log w, w and log Σw with w summing to one; shifts by the largest first, so that nothing underflows."""
    peak = log_weights.max()
    weights = np.exp(log_weights - peak)
    total = weights.sum()
    log_total = float(peak + np.log(total))
    return log_weights - log_total, weights / total, log_total


def _blocks(n: int) -> list[slice]:
    return [slice(start, start + BLOCK) for start in range(0, n, BLOCK)]


def _deviations(cloud: Particles) -> Array:
    e = cloud.states - mean(cloud)
    for column in cloud.angles:
        e[:, column] = wrap_angle(e[:, column])
    return e


def _check_states(states: Array) -> Array:
    if states.ndim != 2 or states.shape[0] == 0 or states.shape[1] == 0:
        raise ValueError(f"states: expected shape (n, d) with at least one particle, got {states.shape}")
    if not np.isfinite(states).all():
        row = int(np.argmin(np.isfinite(states).all(axis=1)))
        raise ValueError(f"states: expected finite numbers, got {states[row]} at index {row}")
    return states


def _like(cloud: Particles, states: Array, log_weights: Array, **fields: Any) -> Particles:
    """A cloud from arrays that this module made and checked: no second copy, no second look."""
    new = object.__new__(Particles)
    for name, value in {"angles": cloud.angles, "log_evidence": 0.0, "rejected": "", **fields}.items():
        object.__setattr__(new, name, value)
    _own(new, states, log_weights)
    return new


def _own(cloud: Particles, states: Array, log_weights: Array) -> None:
    object.__setattr__(cloud, "states", _frozen(states))
    object.__setattr__(cloud, "log_weights", _frozen(log_weights))


def _remember(cloud: Particles, weights: Array) -> Particles:
    cloud.__dict__["weights"] = _frozen(weights)
    return cloud


def _frozen(array: Array) -> Array:
    array.flags.writeable = False
    return array
