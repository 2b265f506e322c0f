"""Lab 7's failures: six mistakes that leave a particle filter running."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit import particles
from coursekit.gaussian import check_covariance
from coursekit.geometry import Array
from coursekit.models import DifferentialDrive
from coursekit.particles import Particles
from coursekit.teaching.failures import Failure

# --- a draw that is biased -------------------------------------------------------------------------------------


def residual_without_n(weights: ArrayLike, rng: np.random.Generator) -> Array:
    """Residual resampling whose leftover is w - copies, where n·w - copies is meant."""
    weights = np.asarray(weights, dtype=float)
    n = weights.size
    copies = np.floor(n * weights).astype(int)
    left = weights - copies
    left /= left.sum()
    cumulative = np.cumsum(left)
    cumulative[-1] = 1.0
    certain = np.repeat(np.arange(n), copies)
    return np.concatenate([certain, np.searchsorted(cumulative, rng.random(n - certain.size))])


def slice_wheel(weights: ArrayLike, rng: np.random.Generator) -> Array:
    """The resampling wheel as it is taught: it starts at the edge of a random interval, not anywhere on the circle."""
    weights = np.asarray(weights, dtype=float)
    index, ahead, chosen = int(rng.integers(weights.size)), 0.0, []
    for _ in range(weights.size):
        ahead += rng.random() * 2 * weights.max()
        while ahead > weights[index]:
            ahead -= weights[index]
            index = (index + 1) % weights.size
        chosen.append(index)
    return np.array(chosen)


def copies_match_the_weights(method: Callable[..., Any], draws: int = 1500) -> bool:
    """Mean copies against n·w, on uneven weights and on weights that begin with zeros.

    Six standard errors for each of 55 numbers: a sound method fails with probability 1e-7.
    """
    rng = np.random.default_rng(1)
    for weights in (np.array([0.45, 0.25, 0.15, 0.1, 0.05]), np.repeat([0.0, 0.05], [30, 20])):
        n = weights.size
        copies = np.array([np.bincount(method(weights, rng), minlength=n) for _ in range(draws)])
        allowed = 6 * copies.std(axis=0) / np.sqrt(draws) + 1e-9
        if np.any(np.abs(copies.mean(axis=0) - n * weights) > allowed):
            return False
    return True


Failure(
    "lab07.residual_without_n",
    source="filterpy 2.0.0, filterpy.monte_carlo.residual_resample",
    wrong=residual_without_n,
    right=particles.residual,
    check=copies_match_the_weights,
    lesson="The mean copies miss n times the weight: the heaviest particle gets too many, the light ones none.",
)
Failure(
    "lab07.slice_wheel",
    source="the resampling wheel of Udacity CS373 (2012), as copied into many filters, the seabed report's among them",
    wrong=slice_wheel,
    right=particles.wheel,
    check=copies_match_the_weights,
    lesson="After a row of particles without weight, the next ones get too many copies, in a cloud of any size.",
)


# --- a belief that is not one ----------------------------------------------------------------------------------


def multiplied(log_likelihoods: Array) -> Array:
    """Posterior weights of k measurements, (k, n) → (n,), by multiplying likelihoods."""
    weights = np.full(log_likelihoods.shape[1], 1 / log_likelihoods.shape[1])
    for row in log_likelihoods:
        weights = weights * np.exp(row)
    with np.errstate(invalid="ignore"):
        return np.asarray(weights / weights.sum())


def summed(log_likelihoods: Array) -> Array:
    """The same, by adding logs."""
    cloud = Particles(np.zeros((log_likelihoods.shape[1], 1)))
    for row in log_likelihoods:
        cloud = particles.weigh(cloud, row)
    return cloud.weights


def weights_survive_twenty_measurements(posterior: Callable[[Array], Array]) -> bool:
    """Twenty fixes, each 10 σ from the nearest particle, still rank the particles."""
    distance = np.linspace(10, 20, 11)
    weights = posterior(np.tile(-0.5 * distance**2, (20, 1)))
    return bool(np.isfinite(weights).all() and abs(weights.sum() - 1) < 1e-9 and weights[0] == weights.max())


Failure(
    "lab07.plain_weights",
    source="any filter that multiplies likelihoods: exp(-50), twenty times over, is zero in double precision",
    wrong=multiplied,
    right=summed,
    check=weights_survive_twenty_measurements,
    lesson="All weights fall to zero together, the sum is zero, and 0/0 makes a cloud of NaN.",
)


def rows_from_two_times(clouds: Sequence[Particles]) -> list[Array]:
    """Covariances of x and y at each time, the second row taken from the time after."""
    later = [*clouds[1:], clouds[-1]]
    rows = [(particles.covariance(a)[0, :2], particles.covariance(b)[1, :2]) for a, b in zip(clouds, later)]
    return [np.array(pair) for pair in rows]


def rows_from_one_time(clouds: Sequence[Particles]) -> list[Array]:
    """Covariances of x and y at each time."""
    return [particles.covariance(cloud)[:2, :2] for cloud in clouds]


def covariances_could_be_covariances(report: Callable[[Sequence[Particles]], list[Array]]) -> bool:
    """Each matrix is symmetric and positive definite: two properties that need no truth to test."""
    rng = np.random.default_rng(0)
    clouds = [Particles(rng.normal(size=(200, 2)) @ rng.normal(size=(2, 2))) for _ in range(4)]
    try:
        for matrix in report(clouds):
            check_covariance(matrix)
    except ValueError:
        return False
    return True


Failure(
    "lab07.rows_from_two_times",
    source="homework report, exercise 3: the covariance printed for t = 5 s has the second row of the one for t = 10 s",
    wrong=rows_from_two_times,
    right=rows_from_one_time,
    check=covariances_could_be_covariances,
    lesson="A matrix with two different off-diagonal entries is not a covariance: no cloud has this ellipse.",
)


# --- a filter that wastes or invents ----------------------------------------------------------------------------


def resampled_every_step(cloud: Particles, rng: np.random.Generator, steps: int) -> Particles:
    """``steps`` updates that say nothing, each followed by a draw with replacement."""
    for _ in range(steps):
        cloud = particles.resample(particles.weigh(cloud, np.zeros(len(cloud))), rng, particles.multinomial)
    return cloud


def resampled_when_needed(cloud: Particles, rng: np.random.Generator, steps: int) -> Particles:
    """The same updates; a draw only when fewer than half of the particles count."""
    for _ in range(steps):
        cloud = particles.weigh(cloud, np.zeros(len(cloud)))
        if particles.effective_sample_size(cloud.weights) < len(cloud) / 2:
            cloud = particles.resample(cloud, rng, particles.multinomial)
    return cloud


def variety_outlives_silence(carry: Callable[..., Particles]) -> bool:
    """After fifty measurements without information, most of the guesses are still there."""
    cloud = carry(Particles(np.arange(500.0)[:, None]), np.random.default_rng(0), 50)
    return len(np.unique(cloud.states)) > 250


Failure(
    "lab07.resampling_every_step",
    source="the resampling wheel after every update, as in most first filters, the seabed report's among them",
    wrong=resampled_every_step,
    right=resampled_when_needed,
    check=variety_outlives_silence,
    lesson="Fifty draws without information leave the copies of a few particles: chance alone removes the others.",
)


def same_sigma_in_every_step(sigma: float, seconds: float, steps: int, rng: np.random.Generator) -> Array:
    """Headings after ``seconds``, cut into ``steps``, each with fresh noise of the same σ."""
    model = DifferentialDrive(0.0, sigma, sigma_pose=(0.0, 0.0, 0.0))
    cloud = Particles(np.zeros((4000, 3)))
    for _ in range(steps):
        cloud = particles.predict(cloud, model, [0.5, 0.0], seconds / steps, rng)
    return cloud.states[:, 2]


def sigma_for_the_step(sigma: float, seconds: float, steps: int, rng: np.random.Generator) -> Array:
    """The same, with σ·√steps: the variance over ``seconds`` stays what it was."""
    return same_sigma_in_every_step(sigma * np.sqrt(steps), seconds, steps, rng)


def spread_does_not_depend_on_the_steps(headings: Callable[..., Array]) -> bool:
    """The variance after 10 s is the same in one step and in twenty: 4000 robots, 15 %, six standard errors."""
    one, many = (headings(0.05, 10.0, steps, np.random.default_rng(steps)).var() for steps in (1, 20))
    return bool(abs(many / one - 1) < 0.15)


Failure(
    "lab07.noise_that_shrinks_with_the_step",
    source="the homework's filter run in steps of 0.1 s: var x falls from 0.39 to 0.0055 m²",
    wrong=same_sigma_in_every_step,
    right=sigma_for_the_step,
    check=spread_does_not_depend_on_the_steps,
    lesson="With a hundred steps instead of one the cloud shrinks to a dot: independent errors cancel.",
)
