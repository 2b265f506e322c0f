import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, multivariate_normal

from coursekit import gaussian
from coursekit.gaussian import Gaussian, chi2_band, ellipse, nees
from coursekit.models import pose_residual


def random_covariance(rng, n):
    A = rng.normal(size=(n, n))
    return A @ A.T + 0.1 * np.eye(n)


def test_a_belief_is_a_copy_that_nobody_can_change():
    mean, cov = np.zeros(2), np.eye(2)
    belief = Gaussian(mean, cov)
    mean[0] = cov[0, 0] = 9.0
    assert belief.mean[0] == 0.0 and belief.cov[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        belief.cov[0, 0] = 2.0


@pytest.mark.parametrize(
    ("mean", "cov", "complaint"),
    [
        (0.0, [[1.0]], r"mean: expected a vector"),
        ([[0.0]], [[1.0]], r"cov: expected shape \(1, 1, 1\), got \(1, 1\)"),
        ([0.0, np.nan], np.eye(2), "mean: expected finite"),
        ([0.0, 0.0], np.eye(3), r"cov: expected shape \(2, 2\), got \(3, 3\)"),
        ([0.0, 0.0], [[1.0, np.inf], [np.inf, 1.0]], "cov: expected finite"),
        ([0.0, 0.0], [[1.0, 0.5], [0.1, 1.0]], "symmetric"),
        ([0.0, 0.0], [[1.0, 2.0], [2.0, 1.0]], "positive definite"),
        ([0.0, 0.0], np.diag([1.0, 0.0]), "positive definite"),
    ],
)
def test_what_is_no_belief_is_refused_with_its_reason(mean, cov, complaint):
    with pytest.raises(ValueError, match=complaint):
        Gaussian(mean, cov)


def test_rounding_asymmetry_is_removed():
    cov = np.array([[2.0, 0.3], [0.3 * (1 + 1e-12), 1.0]])
    belief = Gaussian(np.zeros(2), cov)
    np.testing.assert_array_equal(belief.cov, belief.cov.T)


def test_a_marginal_keeps_the_entries_asked_for():
    cov = random_covariance(np.random.default_rng(0), 4)
    marginal = Gaussian(np.arange(4.0), cov).marginal([2, 0])
    np.testing.assert_array_equal(marginal.mean, [2, 0])
    np.testing.assert_allclose(marginal.cov, cov[np.ix_([2, 0], [2, 0])])


@pytest.mark.parametrize("n", [1, 3, 5])
def test_nees_is_what_scipys_density_says(n):
    rng = np.random.default_rng(n)
    belief, truth = Gaussian(rng.normal(size=n), random_covariance(rng, n)), rng.normal(size=n)
    density = multivariate_normal(belief.mean, belief.cov)
    assert nees(belief, truth) == pytest.approx(-2 * (density.logpdf(truth) - density.logpdf(belief.mean)))


def test_nees_across_pi_is_small_with_the_states_own_residual_and_huge_without():
    belief = Gaussian([0, 0, np.pi - 0.01], np.diag([1, 1, 0.02**2]))
    truth = np.array([0, 0, -np.pi + 0.01])
    assert nees(belief, truth, pose_residual) == pytest.approx(1.0)
    assert nees(belief, truth) > 1e4


def test_nees_refuses_a_truth_of_another_shape_or_nan():
    belief = Gaussian(np.zeros(2), np.eye(2))
    with pytest.raises(ValueError, match="truth: expected shape"):
        nees(belief, np.zeros(3))
    with pytest.raises(ValueError, match="truth: expected finite"):
        nees(belief, [0.0, np.nan])


@given(st.integers(1, 10), st.integers(1, 200), st.floats(0.5, 0.999))
def test_the_band_holds_its_confidence_and_leaves_equal_tails(dof, runs, confidence):
    low, high = chi2_band(dof, runs, confidence)
    total = chi2(dof * runs)
    assert total.cdf(low * runs) == pytest.approx((1 - confidence) / 2, abs=1e-9)
    assert total.sf(high * runs) == pytest.approx((1 - confidence) / 2, abs=1e-9)


def test_average_nees_of_honest_draws_stays_in_the_band_as_often_as_promised():
    """2,000 averages of 20 runs; the share inside a 95 % band is binomial: outside 0.95 ± 0.02 once in 24,000."""
    rng = np.random.default_rng(1)
    belief = Gaussian(np.zeros(3), random_covariance(rng, 3))
    draws = belief.sample(rng, 2_000 * 20)
    values = np.array([gaussian.mahalanobis_squared(d, belief.cov) for d in draws]).reshape(2_000, 20).mean(axis=1)
    low, high = chi2_band(3, 20)
    assert np.mean((low < values) & (values < high)) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("arguments", [(0,), (2, 0), (2, 1, 1.0), (2, 1, 0.0)])
def test_a_band_refuses_what_is_no_band(arguments):
    with pytest.raises(ValueError, match="expected"):
        chi2_band(*arguments)


@given(st.integers(0, 10_000), st.floats(0.1, 0.99))
def test_every_point_of_an_ellipse_has_the_same_mahalanobis_distance(seed, confidence):
    cov = random_covariance(np.random.default_rng(seed), 2)
    distances = [gaussian.mahalanobis_squared(p, cov) for p in ellipse(cov, confidence)]
    np.testing.assert_allclose(distances, chi2.ppf(confidence, 2), rtol=1e-9)


def test_samples_have_the_mean_and_covariance_they_should():
    """100,000 draws: each entry of the sample covariance is within five standard errors; false alarm below 1e-5."""
    rng = np.random.default_rng(5)
    belief = Gaussian([1.0, -2.0], [[2.0, 0.6], [0.6, 0.5]])
    draws = belief.sample(rng, 100_000)
    np.testing.assert_allclose(draws.mean(axis=0), belief.mean, atol=5 * np.sqrt(2 / 1e5))
    np.testing.assert_allclose(np.cov(draws.T), belief.cov, atol=5 * 2 * np.sqrt(2 / 1e5))


def test_the_lower_triangle_does_not_fool_the_covariance_check():
    """numpy's Cholesky reads one triangle only; the check must see the other."""
    with pytest.raises(ValueError, match="symmetric"):
        gaussian.check_covariance([[1.0, 5.0], [0.0, 1.0]])


def test_a_covariance_without_a_margin_is_refused_whatever_rounding_says():
    """Rank 2 of 3 at 300 random scales: Cholesky's factor exists by luck for some of them."""
    rng = np.random.default_rng(8)
    for _ in range(300):
        A = rng.normal(size=(3, 2)) * 10.0 ** rng.uniform(-4, 4, (3, 1))
        with pytest.raises(ValueError, match="positive definite"):
            gaussian.check_covariance(A @ A.T)


def test_units_do_not_count_against_the_margin():
    gaussian.check_covariance(np.diag([1e-30, 1.0, 1e30]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: gaussian.nis([1.0, 2.0], np.zeros((2, 2))), "innovation_cov: expected a positive definite"),
        (lambda: gaussian.nis([1.0, 2.0], np.ones((2, 2))), "innovation_cov: expected a positive definite"),
        (lambda: gaussian.nis([1.0, np.nan], np.eye(2)), "innovation: expected finite"),
        (lambda: gaussian.nis([1.0], np.eye(2)), r"innovation_cov: expected shape \(1, 1\)"),
        (lambda: gaussian.nees(Gaussian([0.0, 1.0], np.eye(2)), [0.0, 1.0], lambda a, b: 0.0), "residual: expected sh"),
    ],
)
def test_a_normalised_square_names_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0])
def test_a_band_asks_for_numbers_of_freedoms_and_runs_that_can_be(bad):
    for arguments in ((bad, 1), (3, bad)):
        with pytest.raises(ValueError, match="expected dof ≥ 1 and runs ≥ 1"):
            chi2_band(*arguments)


def margin(cov):
    """The smallest eigenvalue of the correlation matrix, as a share of the largest."""
    scale = np.sqrt(np.diag(cov))
    found = np.linalg.eigvalsh(cov / np.outer(scale, scale))
    return found[0] / found[-1]


@pytest.mark.parametrize("share", [1e-12, 1e-6])
def test_what_rounding_left_without_a_margin_gets_one_in_any_unit(share):
    """Covariances of six numbers that have one to five degrees of freedom, in units from nm to Mm."""
    rng = np.random.default_rng(2)
    for freedoms in (1, 2, 3, 4, 5):
        A = rng.normal(size=(6, freedoms)) * 10.0 ** rng.uniform(-9, 6, (6, 1))
        mended = gaussian.with_margin(A @ A.T, share)
        assert margin(mended) == pytest.approx(share, rel=0.02)
        np.testing.assert_array_equal(mended, mended.T)
        # Far above rounding, whoever computes: rounded to single precision it would hardly keep its sign.
        assert gaussian.check_covariance(mended) == pytest.approx(mended, rel=0)
        np.testing.assert_allclose(np.diag(mended), np.diag(A @ A.T), rtol=7 * share)


def test_the_margin_belongs_to_the_correlations_and_not_to_the_unit():
    A = np.random.default_rng(3).normal(size=(4, 2))
    unit = np.array([1e-3, 1.0, 57.3, 1e6])
    mended = gaussian.with_margin(A @ A.T, 1e-3)
    np.testing.assert_allclose(
        gaussian.with_margin(A @ A.T * np.outer(unit, unit), 1e-3), mended * np.outer(unit, unit), rtol=1e-9
    )


def test_a_covariance_with_a_margin_is_left_as_it_is():
    for cov in (random_covariance(np.random.default_rng(4), 5), np.diag([1e-20, 1.0, 1e20])):
        np.testing.assert_array_equal(gaussian.with_margin(cov), gaussian.symmetrize(cov))


@pytest.mark.parametrize(
    ("cov", "complaint"),
    [
        (np.ones((2, 3)), r"expected shape \(n, n\), got \(2, 3\)"),
        (np.full((2, 2), np.nan), "expected finite numbers"),
        (np.diag([1.0, 0.0]), "the variances positive"),
        ([[1.0, 1.001], [1.001, 1.0]], "expected a covariance up to rounding"),
    ],
)
def test_what_is_no_covariance_by_more_than_rounding_gets_no_margin(cov, complaint):
    with pytest.raises(ValueError, match=complaint):
        gaussian.with_margin(cov)
