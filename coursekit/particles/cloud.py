"""A belief as weighted particles, and the three steps that carry it on: predict, weigh, resample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import check_covariance
from coursekit.geometry import Array
from coursekit.models import MotionModel, SensorModel
from coursekit.particles.resampling import Resampler, systematic

BLOCK = 8192  # particles at a time: a dozen temporaries of 64 kB fit a second-level cache, a cloud of 10⁵ does not


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

    The model is called on blocks of some 8000 particles, whose intermediate results stay in the cache.

    Source: Thrun, Burgard & Fox (2005), table 4.3, line 4.
    """
    control = np.asarray(control, dtype=float)
    each = control.ndim == 2 and len(control) == len(cloud)
    if control.ndim == 2 and not each and len(control) != 1:
        raise ValueError(f"control: expected one for all or one for each of {len(cloud)}, got {len(control)}")
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


def log_likelihood(sensor: SensorModel, z: ArrayLike, R: ArrayLike | None = None) -> Callable[[Array], Array]:
    """log N(z; h(x), R) as a function of states (n, d) → (n,), for ``weigh``.  z (m,), R (m, m)."""
    z = np.atleast_1d(np.asarray(z, dtype=float))
    if not np.isfinite(z).all():
        raise ValueError(f"z: expected finite numbers, got {z}")
    R = np.asarray(sensor.R if R is None else R, dtype=float)
    whiten, constant = _whitening(R.tobytes(), R.shape, z.size)

    def at(states: Array) -> Array:
        out = np.empty(len(states))
        for block in _blocks(len(states)):
            r = sensor.residual(z, sensor.h(states[block])).T
            white = (sum(w * r_i for w, r_i in zip(row, r)) for row in whiten)
            out[block] = constant - sum(e * e for e in white)
        return out

    return at


@lru_cache(maxsize=64)
def _whitening(R: bytes, shape: tuple[int, ...], size: int) -> tuple[Array, float]:
    """L⁻¹/√2 and -log√((2π)ᵐ|R|) for R = L Lᵀ: checked and factored once, not at every measurement."""
    factor = np.linalg.cholesky(check_covariance(np.frombuffer(R).reshape(shape), "R", size=size))
    constant = -np.log(np.diag(factor)).sum() - 0.5 * size * np.log(2 * np.pi)
    return np.linalg.solve(factor, np.eye(size)) / np.sqrt(2), float(constant)


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
    edges = np.linspace(0, n, max(1, round(n / BLOCK)) + 1).astype(int).tolist()
    return [slice(start, end) for start, end in pairwise(edges)]


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
