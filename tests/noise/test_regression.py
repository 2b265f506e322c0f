import numpy as np
import pytest

from coursekit.noise import regression
from coursekit.noise.regression import Spread

FLAT = np.array([[0.0, 100.0], [0.0, 100.0], [0.0, 100.0], [0.0, 100.0], [-1.1, 100.0]])  # hardly a prior at all
STILL = [[-9.0, 0.01]]  # the jitter's: nothing here moves


def fit(y, mean, x, least, prior, rate=None, jitter=STILL):
    """One output."""
    return regression.fit(
        y[None],
        lambda beta: tuple(part[None] for part in mean(beta)),
        x[None],
        np.zeros((1, len(x))) if rate is None else rate[None],
        np.array([least]),
        np.concatenate([prior, jitter]),
    )


def fit_spread(y, x, least, prior):
    rate = np.zeros((1, len(x)))
    return regression.fit_spread(y[None], x[None], rate, np.array([least]), np.concatenate([prior, STILL])).spreads[0]


def errors_of(found):
    """Standard errors of the coefficients, floor, scale and power, for independent samples."""
    k = len(found.beta)
    of_beta = np.sqrt(np.diag(np.linalg.solve(found.information.sum(axis=0), np.eye(k))))
    return np.concatenate([of_beta, found.spread_errors[:3]])


def line(x):
    J = np.stack([np.ones_like(x), x], axis=-1)
    return lambda beta: (J @ beta, J)


def drawn(rng, n=600):
    x = rng.uniform(0.5, 10.0, n)
    return x, 0.3 + 0.7 * x + Spread(0.05, 0.02, 1.5)(x) * rng.standard_normal(n)


def test_the_fit_is_a_maximum_of_the_likelihood_written_out_by_hand():
    x, y = drawn(np.random.default_rng(0))
    found = fit(y, line(x), x, 1e-9, FLAT)

    def log_likelihood(offset, slope, floor, scale, power):
        sigma = np.hypot(floor, scale * x**power)
        return np.sum(-np.log(sigma) - 0.5 * ((y - offset - slope * x) / sigma) ** 2)

    best = [*found.beta, *found.spreads[0]]
    for i, error in enumerate(errors_of(found)):
        for step in (-0.1 * error, 0.1 * error):
            moved = np.array(best)
            moved[i] += step
            assert log_likelihood(*moved) < log_likelihood(*best)


def test_the_errors_of_a_spread_are_read_off_the_likelihoods_curvature():
    """The curvature that was observed and the one expected differ by a few per cent at 20,000 samples."""
    rng = np.random.default_rng(9)
    x = rng.uniform(0.5, 10.0, 20_000)
    y = Spread(0.05, 0.1, 0.5)(x) * rng.standard_normal(20_000)
    found = fit(y, lambda beta: (np.zeros(20_000), np.zeros((20_000, 0))), x, 1e-9, FLAT[2:])

    def lost(p):
        sigma = np.hypot(p[0], p[1] * x ** p[2])
        return np.sum(np.log(sigma) + 0.5 * (y / sigma) ** 2)

    best, step = np.array(found.spreads[0]), 0.02 * errors_of(found)
    E = np.diag(step)
    curvature = [
        [lost(best + a + b) - lost(best + a - b) - lost(best - a + b) + lost(best - a - b) for a in E] for b in E
    ]
    observed = np.array(curvature) / (4 * np.outer(step, step))
    np.testing.assert_allclose(errors_of(found) / np.sqrt(np.diag(np.linalg.inv(observed))), 1.0, atol=0.1)


def test_the_jitter_is_told_from_the_floor_by_the_samples_that_move():
    """2000 samples, half of them moving: both standard deviations are known to 3 %, so 15 % hardly ever fails."""
    rng = np.random.default_rng(10)
    x, rate = np.ones(2000), np.repeat([0.0, 1.0], 1000) * rng.choice([-0.6, 0.6], 2000)
    y = np.hypot(0.002, 0.012 * rate) * rng.standard_normal(2000)
    nothing = np.zeros(2000), np.zeros((2000, 0))
    prior = [[np.log(0.002), 2.0], [-12.0, 0.1], [-1.1, 1.0]]
    found = fit(y, lambda beta: nothing, x, 1e-9, np.array(prior), rate=rate, jitter=[[np.log(0.01), 1.5]])
    assert found.jitter == pytest.approx(0.012, rel=0.15)
    assert found.spreads[0].floor == pytest.approx(0.002, rel=0.15)


def test_standard_errors_match_the_scatter_over_repeated_draws():
    """200 draws: each ratio scatters by 5 %, so ±20 % fails a right answer less than once in 10 000 for the five."""
    fits = [fit(y, line(x), x, 1e-9, FLAT) for x, y in map(drawn, map(np.random.default_rng, range(200)))]
    estimates = np.array([[*found.beta, *found.spreads[0]] for found in fits])
    claimed = np.sqrt(np.median([errors_of(found) ** 2 for found in fits], axis=0))
    scatter = 1.4826 * np.median(np.abs(estimates - np.median(estimates, axis=0)), axis=0)
    np.testing.assert_allclose(claimed[[0, 1, 3, 4]] / scatter[[0, 1, 3, 4]], 1.0, atol=0.2)
    errors = (estimates - [0.3, 0.7, 0.05, 0.02, 1.5]) / np.sqrt([errors_of(found) ** 2 for found in fits])
    assert np.all(np.abs(errors[:, [0, 1, 3, 4]].mean(axis=0)) < 0.35)


def test_weights_are_learned_so_the_precise_samples_decide():
    rng = np.random.default_rng(3)
    x = np.r_[np.full(500, 1.0), np.full(500, 9.0)]
    y = 2.0 + np.where(x < 5, 0.01, 5.0) * rng.standard_normal(1000)
    found = fit(y, lambda beta: (np.full(1000, beta[0]), np.ones((1000, 1))), x, 1e-9, FLAT[1:])
    assert abs(found.beta[0] - 2.0) < 0.002  # the plain mean is off by 0.11


def test_a_prior_decides_only_what_the_data_leave_open():
    x = np.full(50, 2.0)
    y = 1.0 + 0.1 * np.random.default_rng(0).standard_normal(50)
    prior = FLAT.copy()
    prior[:2] = [[0.0, 3.0], [0.0, 0.001]]
    found = fit(y, line(x), x, 1e-9, prior)
    assert abs(found.beta[1]) < 1e-3
    assert found.beta @ [1.0, 2.0] == pytest.approx(y.mean(), abs=1e-3)


def test_a_spread_is_fitted_to_residuals_alone():
    rng = np.random.default_rng(5)
    x = rng.uniform(0, 0.5, 4000)
    true = Spread(0.002, 0.08, 1.0)
    found = fit_spread(true(x) * rng.standard_normal(4000), x, 1e-9, FLAT[2:])
    at = np.array([0.0, 0.1, 0.4])
    np.testing.assert_allclose(found(at), true(at), rtol=0.12)  # about four standard errors


def test_perfect_data_reach_the_least_spread_and_stay_finite():
    x = np.linspace(1, 9, 100)
    found = fit(0.3 + 0.7 * x, line(x), x, 1e-5, FLAT / np.where(FLAT > 1, 30, 1))
    np.testing.assert_allclose(found.beta, [0.3, 0.7], atol=1e-5)
    assert np.all(np.isfinite(errors_of(found))) and found.spreads[0](9.0) < 1e-3


def test_a_climb_that_gets_nowhere_is_an_error_not_a_silent_number():
    x = np.linspace(1, 2, 20)
    seen = []

    def trap(beta):  # only its starting point exists, and it is no maximum
        seen.append(beta)
        return np.full(20, np.nan if np.any(beta) else 0.0), np.ones((20, 2))

    with pytest.raises(RuntimeError, match="did not converge from any start, on 20 samples"):
        fit(np.full(20, 5.0) + x, trap, x, 1e-9, FLAT)
    assert len(seen) > 2
