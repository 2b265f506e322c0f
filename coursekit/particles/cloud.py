"""A belief as weighted particles, and the three steps that carry it on: predict, weigh, resample."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers, generator
from coursekit.geometry import Array
from coursekit.models import MotionSampler
from coursekit.models.checks import has_parts
from coursekit.particles._blocks import blocks
from coursekit.particles.resampling import RESAMPLERS, Resampler, systematic


@dataclass(frozen=True, eq=False)
class Particles:
    """A weighted cloud: the belief Σ exp(log_weights[i]) δ(x - states[i]).

    Parameters
    ----------
    states : (n, d), finite.
    log_weights : (n,), up to a common constant: they are normalised here, so that their exponentials sum to one.
        Without them all particles weigh the same.
    angles : the columns of ``states`` that are angles in rad, (2,) for poses, () for none; means and spreads wrap
        them.  A cloud of three columns may hold poses or points in space, whose means differ: without ``angles`` it
        can be moved and weighed, but ``mean`` and its like raise ValueError.  Other clouds have none by default.
    log_evidence : log p(z | past) in nats of the weighing that made this cloud, 0 where there was none.
    rejected : why that weighing left the weights alone; empty when it did not.

    Arrays are copied and made read-only.

    Raises ValueError for an empty cloud, NaN, shapes that disagree, and weights that are all zero; TypeError for
    what is not a number, and for ``angles`` that are not columns.

    >>> cloud = Particles([[0.0, 1.0], [2.0, 3.0]], np.log([1.0, 3.0]))
    >>> len(cloud), cloud.weights.round(2).tolist()
    (2, [0.25, 0.75])

    Source: Thrun, Burgard & Fox (2005), section 4.3.
    """

    states: Array
    log_weights: Array = None  # type: ignore[assignment]  # None: all equal; an array from __post_init__ on
    _: KW_ONLY
    angles: tuple[int, ...] | None = None
    log_evidence: float = 0.0
    rejected: str = ""

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self,
            states: ArrayLike,
            log_weights: ArrayLike | None = None,
            *,
            angles: tuple[int, ...] | None = None,
            log_evidence: float = 0.0,
            rejected: str = "",
        ) -> None: ...

    def __post_init__(self) -> None:
        states = _check_states(as_numbers(self.states, "states").copy())
        n, d = states.shape
        log_weights = np.zeros(n) if self.log_weights is None else as_numbers(self.log_weights, "log_weights").copy()
        if log_weights.shape != (n,):
            raise ValueError(f"log_weights: expected shape ({n},), one for each state, got {log_weights.shape}")
        if self.angles is not None:
            object.__setattr__(self, "angles", _check_columns(self.angles, d))
        elif d != 3:
            object.__setattr__(self, "angles", ())
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
    cloud: Particles, motion: MotionSampler, control: ArrayLike, dt: float, rng: np.random.Generator
) -> Particles:
    """Draw each particle's next state from p(x' | x, u); weights stay.

    Parameters
    ----------
    motion : a model with ``sample(states (n, d), u, dt, rng)`` → (n, d).
    control : in the model's units; for DifferentialDrive [v m/s, ω rad/s], one for all (2,) or one each (n, 2).
    dt : seconds, > 0.  The model's noise is drawn once for the whole step: see Lab 7 before cutting steps.

    Large clouds are moved in blocks that fit a cache.

    Raises TypeError for what is not a cloud, a model or a Generator; ValueError for a control that is neither one
    nor n, for dt ≤ 0, and for a model that answers another shape or infinity.

    >>> from coursekit.models import DifferentialDrive
    >>> cloud = Particles(np.zeros((500, 3)), angles=(2,))
    >>> moved = predict(cloud, DifferentialDrive(), [1.0, 0.0], 2.0, np.random.default_rng(1))
    >>> print(f"{moved.states[:, 0].mean():.1f} m ahead, ± {moved.states[:, 0].std():.1f}")
    2.0 m ahead, ± 0.1

    Source: Thrun, Burgard & Fox (2005), table 4.3, line 4.
    """
    _check_call(cloud, rng)
    has_parts(motion, "motion", ("sample",))
    control = as_numbers(control, "control")
    each = control.ndim == 2 and len(control) == len(cloud)
    if control.ndim == 2 and not each and len(control) != 1:
        raise ValueError(f"control: expected one for all or one for each of {len(cloud)}, got {len(control)}")
    states = np.empty_like(cloud.states)
    for block in blocks(len(cloud)):
        drawn = motion.sample(cloud.states[block], control[block] if each else control, dt, rng)
        moved = as_numbers(drawn, "motion.sample")
        if moved.shape != states[block].shape:
            raise ValueError(f"motion.sample: expected shape {states[block].shape}, got {moved.shape}")
        states[block] = moved
    return _remember(_like(cloud, _check_states(states), cloud.log_weights), cloud.weights)


def weigh(cloud: Particles, log_likelihood: ArrayLike | Callable[[Array], ArrayLike]) -> Particles:
    """Bayes' rule on a cloud:  w⁽ⁱ⁾ ∝ w⁽ⁱ⁾ p(z | x⁽ⁱ⁾).

    Parameters
    ----------
    log_likelihood : log p(z | x⁽ⁱ⁾) in nats, (n,), or a function that makes it from the states (n, d).
        -inf means "impossible here", and is allowed.

    A measurement that is impossible at *every* particle cannot be used: the weights stay as they were and
    ``rejected`` says why (``log_evidence`` is then -inf).  The cloud has lost the robot, or the sensor failed.

    Raises TypeError for what is not a cloud or not numbers; ValueError for a wrong shape, NaN or +inf, which are
    errors of the model, not of the measurement.

    >>> cloud = weigh(Particles([[0.0], [1.0]]), np.log([0.1, 0.3]))
    >>> cloud.weights.round(2).tolist()
    [0.25, 0.75]

    Source: Thrun, Burgard & Fox (2005), table 4.3, line 5.
    """
    if not isinstance(cloud, Particles):
        raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
    given = log_likelihood(cloud.states) if callable(log_likelihood) else log_likelihood
    gained = as_numbers(given, "log_likelihood")
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
    cloud: Particles, rng: np.random.Generator, method: str | Resampler = systematic, size: int | None = None
) -> Particles:
    """Draw particles in proportion to their weights, so that all weigh the same again.

    Expectations are kept on average, variety is lost: resample when the effective sample size has fallen, not
    after every step.

    Parameters
    ----------
    method : a function such as ``particles.systematic``, or its name, see ``particles.RESAMPLERS``.
    size : how many to draw; as many as before by default (see ``kld_size``).

    Raises TypeError for what is not a cloud, a Generator or a resampler; ValueError for an unknown name, a size
    below one, and indices that name no particle.

    >>> cloud = Particles([[0.0], [1.0]], [0.0, -np.inf])
    >>> resample(cloud, np.random.default_rng(1), "stratified", size=3).states.ravel().tolist()
    [0.0, 0.0, 0.0]

    Source: Gordon, Salmond & Smith (1993); Thrun, Burgard & Fox (2005), table 4.3, lines 8-11.
    """
    _check_call(cloud, rng)
    draw = _resampler(method)
    indices = np.asarray(draw(cloud.weights, rng) if size is None else draw(cloud.weights, rng, size=size))
    if indices.dtype.kind not in "iu":
        raise TypeError(f"method: expected indices of particles, got numbers of type {indices.dtype}")
    if indices.ndim != 1 or not indices.size or indices.min() < 0 or indices.max() >= len(cloud):
        raise ValueError(f"method: expected indices from 0 to {len(cloud) - 1} of shape (n,), got {indices}")
    n = len(indices)
    return _remember(_like(cloud, cloud.states.take(indices, axis=0), np.full(n, -np.log(n))), np.full(n, 1 / n))


def _check_call(cloud: Any, rng: Any) -> None:
    if not isinstance(cloud, Particles):
        raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
    generator(rng)


def _resampler(method: Any) -> Resampler:
    if isinstance(method, str):
        if method not in RESAMPLERS:
            raise ValueError(f"method: expected one of {', '.join(RESAMPLERS)}, got {method!r}")
        return RESAMPLERS[method]
    if not callable(method):
        raise TypeError(f"method: expected a resampler or its name, got {type(method).__name__}")
    return method


def _check_columns(angles: Any, d: int) -> tuple[int, ...]:
    try:
        columns = tuple(operator.index(column) for column in angles)
    except (TypeError, KeyError):
        raise TypeError(f"angles: expected a tuple of columns such as (2,), got {angles!r}") from None
    if not all(-d <= column < d for column in columns):
        raise ValueError(f"angles: expected columns of states with {d} columns, got {angles}")
    return columns


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
