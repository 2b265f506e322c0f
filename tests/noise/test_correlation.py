import numpy as np
import pytest

from coursekit.noise.correlation import autocorrelation, effective_samples


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


@pytest.mark.parametrize("value", [0.1, 1 / 3, 1e6 + 0.1])
def test_a_sequence_that_never_changes_has_no_correlation_however_its_mean_is_rounded(value):
    for n in (10, 11, 100, 1000):
        assert effective_samples(np.full(n, value)) == n
        np.testing.assert_array_equal(autocorrelation(np.full(n, value), 3), [1, 0, 0, 0])
