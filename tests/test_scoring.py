import numpy as np
import pytest

from coursekit import scoring
from coursekit.scoring import Spread, autocorrelation, effective_samples

FLAT = np.array([[0.0, 100.0], [0.0, 100.0], [0.0, 100.0], [0.0, 100.0], [-1.1, 100.0]])  # hardly a prior at all


def line(x):
    J = np.stack([np.ones_like(x), x], axis=-1)
    return lambda beta: (J @ beta, J)


def drawn(rng, n=600):
    x = rng.uniform(0.5, 10.0, n)
    return x, 0.3 + 0.7 * x + Spread(0.05, 0.02, 1.5)(x) * rng.standard_normal(n)


def test_the_fit_is_a_maximum_of_the_likelihood_written_out_by_hand():
    x, y = drawn(np.random.default_rng(0))
    found = scoring.fit(y, line(x), x, 1e-9, FLAT)

    def log_likelihood(offset, slope, floor, scale, power):
        sigma = np.hypot(floor, scale * x**power)
        return np.sum(-np.log(sigma) - 0.5 * ((y - offset - slope * x) / sigma) ** 2)

    best = [*found.beta, *found.spread]
    for i, error in enumerate(np.sqrt(np.diag(found.cov))):
        for step in (-0.1 * error, 0.1 * error):
            moved = np.array(best)
            moved[i] += step
            assert log_likelihood(*moved) < log_likelihood(*best)


def test_the_covariance_is_the_inverse_of_the_likelihoods_curvature():
    rng = np.random.default_rng(9)
    x = rng.uniform(0.5, 10.0, 2000)
    y = Spread(0.05, 0.1, 0.5)(x) * rng.standard_normal(2000)
    found = scoring.fit_spread(y, x, 1e-9, FLAT[2:])

    def lost(p):
        sigma = np.hypot(p[0], p[1] * x ** p[2])
        return np.sum(np.log(sigma) + 0.5 * (y / sigma) ** 2)

    best, step = np.array(found.spread), 0.02 * np.sqrt(np.diag(found.cov))
    E = np.diag(step)
    curvature = [
        [lost(best + a + b) - lost(best + a - b) - lost(best - a + b) + lost(best - a - b) for a in E] for b in E
    ]
    np.testing.assert_allclose(np.array(curvature) / (4 * np.outer(step, step)) @ found.cov, np.eye(3), atol=0.05)


def test_standard_errors_match_the_scatter_over_repeated_draws():
    """200 draws: each ratio scatters by 5 %, so ±20 % fails a right answer less than once in 10 000 for the five."""
    fits = [scoring.fit(y, line(x), x, 1e-9, FLAT) for x, y in map(drawn, map(np.random.default_rng, range(200)))]
    estimates = np.array([[*found.beta, *found.spread] for found in fits])
    claimed = np.sqrt(np.median([np.diag(found.cov) for found in fits], axis=0))
    scatter = 1.4826 * np.median(np.abs(estimates - np.median(estimates, axis=0)), axis=0)
    np.testing.assert_allclose(claimed[[0, 1, 3, 4]] / scatter[[0, 1, 3, 4]], 1.0, atol=0.2)
    errors = (estimates - [0.3, 0.7, 0.05, 0.02, 1.5]) / np.sqrt([np.diag(found.cov) for found in fits])
    assert np.all(np.abs(errors[:, [0, 1, 3, 4]].mean(axis=0)) < 0.35)


def test_weights_are_learned_so_the_precise_samples_decide():
    rng = np.random.default_rng(3)
    x = np.r_[np.full(500, 1.0), np.full(500, 9.0)]
    y = 2.0 + np.where(x < 5, 0.01, 5.0) * rng.standard_normal(1000)
    found = scoring.fit(y, lambda beta: (np.full(1000, beta[0]), np.ones((1000, 1))), x, 1e-9, FLAT[1:])
    assert abs(found.beta[0] - 2.0) < 0.002  # the plain mean is off by 0.11


def test_a_prior_decides_only_what_the_data_leave_open():
    x = np.full(50, 2.0)
    y = 1.0 + 0.1 * np.random.default_rng(0).standard_normal(50)
    prior = FLAT.copy()
    prior[:2] = [[0.0, 3.0], [0.0, 0.001]]
    found = scoring.fit(y, line(x), x, 1e-9, prior)
    assert abs(found.beta[1]) < 1e-3
    assert found.beta @ [1.0, 2.0] == pytest.approx(y.mean(), abs=1e-3)


def test_a_spread_is_fitted_to_residuals_alone():
    rng = np.random.default_rng(5)
    x = rng.uniform(0, 0.5, 4000)
    true = Spread(0.002, 0.08, 1.0)
    found = scoring.fit_spread(true(x) * rng.standard_normal(4000), x, 1e-9, FLAT[2:])
    at = np.array([0.0, 0.1, 0.4])
    np.testing.assert_allclose(found.spread(at), true(at), rtol=0.12)  # about four standard errors
    assert found.beta.size == 0 and found.cov.shape == (3, 3)


def test_perfect_data_reach_the_least_spread_and_stay_finite():
    x = np.linspace(1, 9, 100)
    found = scoring.fit(0.3 + 0.7 * x, line(x), x, 1e-5, FLAT / np.where(FLAT > 1, 30, 1))
    np.testing.assert_allclose(found.beta, [0.3, 0.7], atol=1e-5)
    assert np.all(np.isfinite(found.cov)) and found.spread(9.0) < 1e-3


def test_a_climb_that_gets_nowhere_is_an_error_not_a_silent_number():
    x = np.linspace(1, 2, 20)
    seen = []

    def trap(beta):  # only its starting point exists, and it is no maximum
        seen.append(beta)
        return (np.zeros(20), np.ones((20, 2))) if not np.any(beta) else None

    with pytest.raises(RuntimeError, match="did not converge from any start, on 20 samples"):
        scoring.fit(np.full(20, 5.0) + x, trap, x, 1e-9, FLAT)
    assert len(seen) > 6


def test_autocorrelation_is_the_textbook_sum():
    x = np.random.default_rng(1).standard_normal(300).cumsum()
    centred = x - x.mean()
    by_hand = [np.sum(centred[k:] * centred[: 300 - k]) / np.sum(centred**2) for k in range(20)]
    np.testing.assert_allclose(autocorrelation(x, 19), by_hand, atol=1e-12)
    np.testing.assert_array_equal(autocorrelation(np.ones(5), 2), [1, 0, 0])
    with pytest.raises(ValueError, match="lags"):
        autocorrelation(x, 300)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_effective_samples_of_an_autoregressive_sequence_follow_its_formula(rho):
    """20 000 samples fix the sum to about 10 %; 30 % fails a right answer less than once in 100."""
    rng = np.random.default_rng(2)
    n, x = 20_000, [0.0]
    for shock in rng.standard_normal(n - 1):
        x.append(rho * x[-1] + shock)
    assert effective_samples(x) == pytest.approx(n * (1 - rho) / (1 + rho), rel=0.3)


def test_samples_that_repeat_each_other_count_once():
    """400 values, five times each; the sum of their correlations is fixed to about 10 %, so 30 % hardly ever fails."""
    x = np.repeat(np.random.default_rng(4).standard_normal(400), 5)
    assert effective_samples(x) == pytest.approx(400, rel=0.3)
    assert 1.0 <= effective_samples(np.arange(50.0)) < 10
    assert effective_samples(np.tile([1.0, -1.0], 50)) == 100


def test_a_sequence_with_a_gap_is_refused_and_does_not_count_as_independent():
    for ask in (effective_samples, lambda x: autocorrelation(x, 1)):
        with pytest.raises(ValueError, match="expected finite numbers, got nan"):
            ask([1.0, np.nan, 3.0])
