"""coursekit.particles: the three steps, five ways to resample, what a cloud says, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import logsumexp
from scipy.stats import chi2, multivariate_normal

from coursekit import particles
from coursekit.gaussian import Gaussian, nees
from coursekit.labs.lab07 import runs
from coursekit.models import DifferentialDrive, Position, RangeBearing, RangeOnly, pose_residual
from coursekit.particles import Particles

METHODS = list(particles.RESAMPLERS.values())
WEIGHTS = {
    "spread": [0.4, 0.3, 0.2, 0.07, 0.03],
    "the five that a popular residual resampler gets wrong": [0.45, 0.25, 0.15, 0.1, 0.05],
    "one rules": [0.9, 0.02, 0.02, 0.02, 0.02, 0.02],
    "equal": [1.0] * 7,
    "dead ones first": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
    "zeros at both ends": [0.0, 0.0, 0.55, 0.0, 0.45, 0.0],
    "all on one": [0.0, 1.0, 0.0],
    "whole numbers of copies": [0.5, 0.25, 0.25, 0.0],
    "three hundred decades": [1.0, 1e-300, 2.0, 0.0, 1e-12],
    "not normalised, huge": [3e200, 1e200, 2e200],
    "not normalised, tiny": [3e-310, 1e-310, 2e-310],
}


def pose_cloud(rng, n=500):
    return Particles(rng.normal(size=(n, 3)) * [1.0, 2.0, 0.4], rng.normal(size=n), angles=(2,))


# --- resampling -----------------------------------------------------------------------------------------------


def bias_bound(copies, reach, false_alarm):
    """How far the mean of T draws in a range of width ``reach`` may be off with probability ``false_alarm`` at most:
    the empirical Bernstein bound (Audibert, Munos & Szepesvári 2007, theorem 1), which needs no normality."""
    log, draws = np.log(3 / false_alarm), len(copies)
    return np.sqrt(2 * copies.var(axis=0) * log / draws) + 3 * reach * log / draws


@pytest.mark.parametrize("weights", WEIGHTS.values(), ids=WEIGHTS)
@pytest.mark.parametrize("name", particles.RESAMPLERS)
def test_every_resampler_copies_each_particle_n_times_its_weight_on_average(name, weights):
    """Unbiased, for 5 methods and 11 sets of weights, 56 numbers a method.  Each may be wrong by chance with
    probability 1e-6, so that all together raise a false alarm with probability below 3e-4."""
    rng, w = np.random.default_rng(7), np.asarray(weights)
    n, method = w.size, particles.RESAMPLERS[name]
    copies = np.array([np.bincount(method(w, rng), minlength=n) for _ in range(4000)])
    expected = n * (w / w.max()) / (w / w.max()).sum()
    reach = {"systematic": 1, "stratified": 2}.get(name, n)  # evenly spaced positions cannot vary by more
    assert np.all(np.ptp(copies, axis=0) <= reach)
    assert np.all(np.abs(copies.mean(axis=0) - expected) <= bias_bound(copies, reach, 1e-6)), copies.mean(axis=0)
    assert np.all(copies.sum(axis=1) == n)
    assert not copies[:, w == 0].any()


def test_the_same_bound_catches_the_wheel_that_starts_at_the_edge_of_a_slice():
    """The wheel as it is commonly taught: with 30 dead particles before 20 live ones it copies the first of these
    2.8 times and the last 2.2 times, where 2.5 is right, and a bigger cloud does not cure it."""
    rng, w = np.random.default_rng(7), np.repeat([0.0, 0.05], [30, 20])
    cumulative, draws = np.cumsum(w), 8000
    start = (cumulative - w)[rng.integers(50, size=(draws, 1))]
    stops = np.mod(start + np.cumsum(rng.random((draws, 50)) * 2 * w.max(), axis=1), 1.0)
    chosen = np.searchsorted(cumulative / cumulative[-1], stops, side="right")
    copies = np.array([np.bincount(row, minlength=50) for row in chosen])
    assert np.any(np.abs(copies.mean(axis=0) - 50 * w) > bias_bound(copies, 5, 1e-6))  # at most 5 rounds
    fair = np.array([np.bincount(particles.wheel(w, rng), minlength=50) for _ in range(draws)])
    assert np.all(np.abs(fair.mean(axis=0) - 50 * w) <= bias_bound(fair, 50, 1e-6))


@settings(max_examples=60)
@given(
    arrays(float, st.integers(1, 40), elements=st.floats(0, 1e6)).filter(lambda w: w.sum() > 0),
    st.integers(0, 2**32 - 1),
    st.integers(1, 90),
)
def test_resamplers_fill_every_place_and_never_choose_a_weight_of_zero(weights, seed, size):
    for method in METHODS:
        indices = method(weights, np.random.default_rng(seed), size=size)
        assert indices.shape == (size,)
        assert np.all(weights[indices] > 0)


@pytest.mark.parametrize("method", METHODS, ids=particles.RESAMPLERS)
@pytest.mark.parametrize("drawn", [0.0, np.nextafter(1.0, 0.0)])
def test_the_extreme_random_numbers_choose_no_dead_particle_and_lose_no_place(method, drawn):
    """A generator may return exactly 0, and the last number before 1: one draw in 2⁵³, and some day it comes."""

    class Extreme(np.random.Generator):
        def random(self, size=None):
            return drawn if size is None else np.full(size, drawn)

        def standard_exponential(self, size):
            return np.where(np.arange(size) < size - 1, drawn, 1.0 - drawn)  # all arrive at 0, or one at the end itself

    for weights in ([0.0, 0.3, 0.7, 0.0], [0.0] * 3 + [1 / 3] * 3 + [0.0] * 4, [0.0, *[0.1] * 10, 0.0]):
        chosen = method(np.array(weights), Extreme(np.random.PCG64()))
        assert chosen.shape == (len(weights),)
        assert np.all(np.array(weights)[chosen] > 0)


@settings(max_examples=60)
@given(
    arrays(float, st.integers(1, 40), elements=st.floats(0, 1e6)).filter(lambda w: w.sum() > 0),
    st.integers(0, 2**32 - 1),
)
def test_systematic_copies_the_floor_or_the_ceiling_and_residual_at_least_the_floor(weights, seed):
    expected = weights.size * weights / weights.sum()
    copies = np.bincount(particles.systematic(weights, np.random.default_rng(seed)), minlength=weights.size)
    assert np.all(np.abs(copies - expected) < 1 + 1e-9)
    copies = np.bincount(particles.residual(weights, np.random.default_rng(seed)), minlength=weights.size)
    assert np.all(copies > expected - 1 - 1e-9)


def test_systematic_agrees_with_a_search_for_each_position():
    rng = np.random.default_rng(3)
    for _ in range(50):
        w = rng.dirichlet(np.full(30, 0.3))
        seed = int(rng.integers(2**32))
        positions = (np.arange(30) + 1 - np.random.default_rng(seed).random()) / 30
        searched = np.searchsorted(np.cumsum(w) / np.cumsum(w)[-1], positions)
        np.testing.assert_array_equal(particles.systematic(w, np.random.default_rng(seed)), searched)


def test_variances_come_in_the_order_that_theory_gives():
    """Variance of a resampled mean: stratified and residual never above multinomial (Douc, Cappé & Moulines 2005).
    Over 3000 draws each estimate has a relative standard error of 2.6 %; the margins below are over five of them.
    """
    rng = np.random.default_rng(5)
    x = np.sort(rng.normal(size=100))
    w = np.exp(-0.5 * (x - 1) ** 2)
    variance = {
        name: np.var([x[method(w, rng)].mean() for _ in range(3000)]) for name, method in particles.RESAMPLERS.items()
    }
    p = w / w.sum()
    theory = (p @ x**2 - (p @ x) ** 2) / x.size
    assert abs(variance["multinomial"] / theory - 1) < 0.15
    assert variance["residual"] < 0.8 * variance["multinomial"]
    assert variance["stratified"] < 0.1 * variance["multinomial"]
    assert variance["systematic"] < 0.1 * variance["multinomial"]


def test_resampling_keeps_the_mean_and_levels_the_weights():
    rng = np.random.default_rng(2)
    cloud = pose_cloud(rng, 20_000)
    for method in METHODS:
        again = particles.resample(cloud, rng, method=method)
        # The wheel's variance is the largest: about that of independent draws from these weights.
        assert np.all(np.abs(particles.mean(again) - particles.mean(cloud)) < 6 * np.sqrt([1, 4, 0.16]) / np.sqrt(5000))
        np.testing.assert_allclose(again.weights, 1 / 20_000)
        assert particles.effective_sample_size(again.weights) == pytest.approx(20_000)
        assert again.angles == (2,)
    assert len(particles.resample(cloud, rng, size=77)) == 77


@pytest.mark.parametrize("name", particles.RESAMPLERS)
def test_a_resampler_may_be_given_by_its_name(name):
    cloud = pose_cloud(np.random.default_rng(0))
    by_name, by_function = (
        particles.resample(cloud, np.random.default_rng(4), method, size=40)
        for method in (name, particles.RESAMPLERS[name])
    )
    np.testing.assert_array_equal(by_name.states, by_function.states)


def test_effective_sample_size_runs_from_one_to_n():
    assert particles.effective_sample_size(np.full(9, 0.2)) == pytest.approx(9)
    assert particles.effective_sample_size([0, 0, 3.0]) == pytest.approx(1)
    assert particles.effective_sample_size([3e200, 3e200]) == pytest.approx(2)
    assert particles.effective_sample_size([3e-320, 3e-320]) == pytest.approx(2)


# --- the three steps ------------------------------------------------------------------------------------------


def test_weighing_is_bayes_rule_and_the_evidence_its_denominator():
    rng = np.random.default_rng(0)
    cloud = pose_cloud(rng)
    gained = rng.normal(size=500) * 30 - 4000
    posterior = particles.weigh(cloud, gained)
    joint = cloud.log_weights + gained
    np.testing.assert_allclose(posterior.log_weights, joint - logsumexp(joint), atol=1e-9)
    np.testing.assert_allclose(posterior.weights, np.exp(posterior.log_weights), rtol=1e-9)
    assert posterior.weights.sum() == pytest.approx(1)
    assert posterior.log_evidence == pytest.approx(logsumexp(joint))
    assert posterior.rejected == ""


def test_twenty_sharp_measurements_in_logs_do_not_underflow():
    cloud = Particles(np.linspace(0, 1, 11)[:, None])
    for _ in range(20):
        cloud = particles.weigh(cloud, lambda x: -0.5 * ((x[:, 0] - 3.0) / 0.01) ** 2)
    assert np.isfinite(cloud.log_weights[-1]) and cloud.weights.sum() == pytest.approx(1)
    assert cloud.log_weights[-2] < -1e4  # as a plain weight this one would be zero


def test_log_likelihood_is_the_normal_density_with_the_bearing_wrapped():
    sensor = RangeBearing([-3.0, 0.01], R=np.array([[0.04, 0.003], [0.003, 0.01]]))
    states, z = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 0.2]]), np.array([3.1, -3.1])
    expected = [
        multivariate_normal(cov=sensor.R).logpdf(sensor.residual(z, sensor.h(state))) for state in states
    ]  # the first bearing is +π - 0.003: a bare minus would be 6.2 rad off
    np.testing.assert_allclose(particles.log_likelihood(sensor, z)(states), expected)
    wide = np.diag([1.0, 1.0])
    assert particles.log_likelihood(sensor, z, R=wide)(states)[0] == pytest.approx(
        multivariate_normal(cov=wide).logpdf(sensor.residual(z, sensor.h(states[0])))
    )


def test_a_cloud_agrees_with_the_kalman_filter_where_that_is_exact():
    """Linear and Gaussian: a fix on a Gaussian cloud.  100,000 particles; standard error of the mean about
    0.3 / √50,000 = 0.0014, tolerance 5 of them in each of 5 numbers: false alarm about 3e-6."""
    rng = np.random.default_rng(4)
    prior = Gaussian(np.array([1.0, 2.0]), np.array([[0.3, 0.1], [0.1, 0.2]]))
    sensor, z = Position(R=np.diag([0.2, 0.1])), np.array([1.5, 1.6])
    K = np.linalg.solve(prior.cov + sensor.R, prior.cov).T
    cloud = particles.weigh(Particles(prior.sample(rng, 100_000)), particles.log_likelihood(sensor, z))
    np.testing.assert_allclose(particles.mean(cloud), prior.mean + K @ (z - prior.mean), atol=0.007)
    np.testing.assert_allclose(particles.covariance(cloud), prior.cov - K @ prior.cov, atol=0.004)


def test_prediction_moves_every_particle_by_the_model_and_leaves_the_weights():
    rng = np.random.default_rng(0)
    cloud = pose_cloud(rng)
    still = DifferentialDrive(sigma_v=0, sigma_omega=0, sigma_pose=(0, 0, 0))
    moved = particles.predict(cloud, still, [1.0, 0.3], 0.5, rng)
    np.testing.assert_allclose(moved.states, still.f(cloud.states, [1.0, 0.3], 0.5))
    np.testing.assert_array_equal(moved.weights, cloud.weights)


def test_a_cloud_of_many_blocks_moves_as_one_and_each_particle_may_have_its_own_control():
    rng = np.random.default_rng(0)
    cloud, still = pose_cloud(rng, 20_000), DifferentialDrive(sigma_v=0, sigma_omega=0, sigma_pose=(0, 0, 0))
    controls = rng.normal(size=(20_000, 2))
    moved = particles.predict(cloud, still, controls, 0.5, rng)
    np.testing.assert_allclose(moved.states, still.f(cloud.states, controls, 0.5))
    gained = particles.log_likelihood(Position(), [0.5, 0.5])(cloud.states)
    np.testing.assert_allclose(gained, multivariate_normal([0.5, 0.5], Position().R).logpdf(cloud.states[:, :2]))


def test_a_motion_model_that_returns_another_shape_is_named():
    class Broken:
        def sample(self, states, u, dt, rng):
            return states[:, :2]

    with pytest.raises(ValueError, match=r"motion\.sample.*\(10, 3\).*\(10, 2\)"):
        particles.predict(pose_cloud(np.random.default_rng(0), 10), Broken(), [0.0], 1.0, np.random.default_rng(0))


def test_a_motion_model_that_loses_a_particle_is_stopped_at_the_door():
    class Diverging:
        def sample(self, states, u, dt, rng):
            return np.where(np.arange(len(states))[:, None] == 3, np.inf, states)

    with pytest.raises(ValueError, match=r"states: expected finite numbers.*index 3"):
        particles.predict(pose_cloud(np.random.default_rng(0), 10), Diverging(), [0.0], 1.0, np.random.default_rng(0))


def test_the_steps_change_none_of_their_arguments_and_what_they_hand_out_is_read_only():
    rng = np.random.default_rng(0)
    states, log_weights = rng.normal(size=(50, 3)), rng.normal(size=50)
    kept = states.copy(), log_weights.copy()
    cloud = Particles(states, log_weights, angles=(2,))
    seen = cloud.states.copy(), cloud.log_weights.copy()
    gained = rng.normal(size=50)
    given = gained.copy()
    for new in (
        particles.predict(cloud, DifferentialDrive(), [1.0, 0.0], 0.1, rng),
        particles.weigh(cloud, gained),
        particles.resample(cloud, rng),
        particles.roughen(cloud, rng),
    ):
        for array in (new.states, new.log_weights, new.weights):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0
    particles.mean(cloud), particles.covariance(cloud)
    np.testing.assert_array_equal(cloud.states, seen[0])
    np.testing.assert_array_equal(cloud.log_weights, seen[1])
    np.testing.assert_array_equal(states, kept[0])
    np.testing.assert_array_equal(log_weights, kept[1])
    np.testing.assert_array_equal(gained, given)
    states[0] = log_weights[0] = gained[0] = 9.0  # the caller's own arrays stay the caller's
    np.testing.assert_array_equal(cloud.states, seen[0])


# --- what a cloud says ----------------------------------------------------------------------------------------


def test_the_mean_heading_across_pi_is_pi_and_its_spread_is_small():
    cloud = Particles(np.array([[0.0, 0.0, np.pi - 0.1], [0.0, 0.0, -np.pi + 0.1]]), angles=(2,))
    assert abs(abs(particles.mean(cloud)[2]) - np.pi) < 1e-12
    assert particles.covariance(cloud)[2, 2] == pytest.approx(0.01)


def test_covariance_is_symmetric_and_counts_weights():
    rng = np.random.default_rng(1)
    cloud = pose_cloud(rng, 4000)
    P = particles.covariance(cloud)
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_allclose(P, np.cov(cloud.states.T, aweights=cloud.weights, ddof=0), rtol=0.02, atol=0.01)


def test_a_cloud_as_a_gaussian_is_honest_about_the_state_it_was_drawn_around():
    """Mean NEES of 400 truths drawn from the same Gaussian as the cloud, inside its two-sided 99.9 % band;
    the cloud's own sampling error adds 3/n·dof, far below the band's width."""
    rng = np.random.default_rng(8)
    belief = Gaussian(np.array([1.0, 2.0, 3.1]), np.diag([0.2, 0.1, 0.05]))
    cloud = particles.as_gaussian(Particles(belief.sample(rng, 5000), angles=(2,)))
    values = [nees(cloud, truth, pose_residual) for truth in belief.sample(rng, 400)]
    low, high = chi2.ppf([0.0005, 0.9995], 3 * 400) / 400
    assert low < np.mean(values) < high


def test_roughening_shakes_by_the_published_amount_and_keeps_the_mean():
    """σ = 0.2 · extent · n^(-1/d); sample standard deviation of 4000 within 6 %, five standard errors."""
    rng = np.random.default_rng(1)
    cloud = Particles(np.repeat([[0.0, 0.0, np.pi], [10.0, 2.0, -3.0]], 2000, axis=0), angles=(2,))
    shaken = particles.roughen(cloud, rng)
    moved = pose_residual(shaken.states, cloud.states)
    extent = np.array([10.0, 2.0, np.pi - 3.0])
    np.testing.assert_allclose(moved.std(axis=0), 0.2 * extent * 4000 ** (-1 / 3), rtol=0.06)
    assert np.all(np.abs(shaken.states[:, 2]) <= np.pi)
    np.testing.assert_allclose(shaken.weights, cloud.weights)


@pytest.mark.parametrize("bins", [2, 10, 100, 2000])
def test_the_kld_size_is_a_chi_square_quantile(bins):
    """Fox's formula approximates χ²(k-1)/(2ε); within 2 % (6 % at one degree of freedom)."""
    exact = chi2.ppf(0.99, bins - 1) / (2 * 0.05)
    assert particles.kld_size(bins) == pytest.approx(exact, rel=0.06 if bins == 2 else 0.02)


def test_even_the_least_demanding_cloud_needs_a_particle():
    assert particles.kld_size(2, confidence=0.01) == 1 and particles.kld_size(10, error=np.inf) == 1


def test_a_kld_sized_sample_is_as_close_as_promised():
    """Within 0.02 nats with 95 % confidence: of 1000 samples 95 % ± 2.8 % (four standard errors: false alarm
    6e-5) should be.  With few particles a bin the promise is a little optimistic (94.1 % here, n = 1365)."""
    rng = np.random.default_rng(0)
    p = rng.dirichlet(np.full(40, 3.0))
    n = particles.kld_size(40, error=0.02, confidence=0.95)
    close = 0
    for _ in range(1000):
        q = np.bincount(particles.multinomial(p, rng, size=n), minlength=40) / n
        close += np.sum(q[q > 0] * np.log(q[q > 0] / p[q > 0])) <= 0.02
    assert abs(close / 1000 - 0.95) < 0.028


def test_occupied_bins_counts_boxes_not_particles():
    states = np.array([[0.1, 0.1], [0.2, 0.3], [-0.1, 0.1], [5.0, 5.0]])
    assert particles.occupied_bins(states, 1.0) == 3
    assert particles.occupied_bins(states, [10.0, 10.0]) == 2


# --- what it refuses ------------------------------------------------------------------------------------------


def test_a_measurement_impossible_everywhere_is_rejected_with_its_reason_and_changes_no_weight():
    cloud = pose_cloud(np.random.default_rng(0))
    after = particles.weigh(cloud, np.full(500, -np.inf))
    assert "zero at every one of the 500 particles" in after.rejected
    assert after.log_evidence == -np.inf
    np.testing.assert_array_equal(after.weights, cloud.weights)
    # The particles that were still alive may be the very ones that the measurement excludes.
    half = Particles(np.zeros((2, 1)), [0.0, -np.inf])
    assert particles.weigh(half, [-np.inf, 0.0]).rejected
    assert not particles.weigh(half, [-3.0, 0.0]).rejected


@pytest.mark.parametrize("method", METHODS, ids=particles.RESAMPLERS)
@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ([], "n ≥ 1"),
        ([[0.5, 0.5]], r"\(1, 2\)"),
        ([0.5, np.nan], "nan at index 1"),
        ([np.inf, 1.0], "inf at index 0"),
        ([0.5, -0.1, 0.6], "-0.1 at index 1"),
        ([0.0, 0.0, 0.0], "3 weights that are all zero"),
    ],
)
def test_resamplers_refuse_weights_that_are_none(method, weights, said):
    with pytest.raises(ValueError, match=said):
        method(weights, np.random.default_rng(0))
    with pytest.raises(ValueError, match=said):
        particles.effective_sample_size(weights)


@pytest.mark.parametrize("method", METHODS, ids=particles.RESAMPLERS)
def test_resamplers_refuse_to_fill_no_place(method):
    with pytest.raises(ValueError, match="size: expected a whole number ≥ 1"):
        method([1.0, 1.0], np.random.default_rng(0), size=0)


@pytest.mark.parametrize(
    ("states", "log_weights", "said"),
    [
        (np.empty((0, 3)), None, "at least one particle"),
        (np.empty((4, 0)), None, "at least one particle"),
        (np.zeros(3), None, r"\(n, d\).*\(3,\)"),
        ([[0.0, 1.0], [np.nan, 1.0]], None, "index 1"),
        (np.zeros((3, 2)), [0.0, 0.0], r"\(3,\).*\(2,\)"),
        (np.zeros((2, 2)), [0.0, np.nan], "log_weights.*nan at index 1"),
        (np.zeros((2, 2)), [np.inf, 0.0], "log_weights.*inf at index 0"),
        (np.zeros((2, 2)), [-np.inf, -np.inf], "all zero"),
    ],
)
def test_a_cloud_that_is_none_is_refused_at_the_door(states, log_weights, said):
    with pytest.raises(ValueError, match=said):
        Particles(states, log_weights)


def test_three_columns_of_which_nobody_said_what_they_are_have_no_mean():
    """π - 0.01 and -π + 0.01 as numbers have the mean 0, as headings π; of a height either could be meant."""
    states = np.array([[0.0, 0.0, np.pi - 0.01], [0.0, 0.0, -np.pi + 0.01]])
    unsaid = Particles(states)
    for ask in (particles.mean, particles.covariance, particles.as_gaussian):
        with pytest.raises(ValueError, match=r"angles: .* give Particles angles=\(2,\) or angles=\(\)"):
            ask(unsaid)
    moved = particles.resample(particles.weigh(unsaid, np.zeros(2)), np.random.default_rng(0))
    with pytest.raises(ValueError, match="angles"):
        particles.roughen(moved, np.random.default_rng(0))
    assert abs(particles.mean(Particles(states, angles=(2,)))[2]) == pytest.approx(np.pi)
    assert particles.mean(Particles(states, angles=()))[2] == pytest.approx(0)
    assert particles.mean(Particles(states[:, 1:])).shape == (2,)


def test_headings_that_cancel_out_have_no_mean():
    """0 and π, and a thousand evenly spaced; a cloud can still be shaken apart."""
    for headings in ([0.0, np.pi], np.arange(1000) / 1000 * 2 * np.pi):
        states = np.zeros((len(headings), 3))
        states[:, 2] = headings
        cloud = Particles(states, angles=(2,))
        for ask in (particles.mean, particles.covariance):
            with pytest.raises(ValueError, match="column 2 cancel out"):
                ask(cloud)
        assert len(particles.roughen(cloud, np.random.default_rng(0))) == len(cloud)


class _Scalar:
    """A sensor that answers one number for a whole cloud, or lacks what is asked of it."""

    R = np.eye(1)

    def h(self, states):
        return np.zeros(1)

    def residual(self, z, z_hat):
        return z - z_hat


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (
            lambda c, g: particles.predict(c, _Scalar(), [1.0, 0.0], 0.1, g),
            TypeError,
            "motion: .* _Scalar has no sample",
        ),
        (lambda c, g: particles.predict(c, DifferentialDrive, [1.0, 0.0], 0.1, g), TypeError, "the class Different"),
        (lambda c, g: particles.predict(c, DifferentialDrive(), [1.0, 0.0], 0.1, 3), TypeError, "rng: .* got int"),
        (lambda c, g: particles.predict(c.states, DifferentialDrive(), [1.0, 0.0], 0.1, g), TypeError, "cloud"),
        (lambda c, g: particles.weigh(c.states, np.zeros(10)), TypeError, "cloud: expected Particles"),
        (lambda c, g: particles.weigh(c, ["0"] * 10), TypeError, "log_likelihood: expected real numbers"),
        (lambda c, g: particles.weigh(c, particles.log_likelihood(_Scalar(), [0.0])), ValueError, r"h: .*\(10, 1\)"),
        (lambda c, g: particles.log_likelihood(DifferentialDrive(), [0.0]), TypeError, "has no h, residual, R"),
        (lambda c, g: particles.resample(c, g, "stratifed"), ValueError, "one of systematic, .* got 'stratifed'"),
        (lambda c, g: particles.resample(c, g, 3), TypeError, "method: expected a resampler or its name, got int"),
        (lambda c, g: particles.resample(c, g, size=2.5), TypeError, "size: expected a whole number, got 2.5"),
        (lambda c, g: particles.mean(c.states), TypeError, "cloud: expected Particles, got ndarray"),
        (lambda c, g: particles.as_gaussian(None), TypeError, "cloud: expected Particles, got NoneType"),
        (lambda c, g: particles.roughen("cloud", g), TypeError, "cloud: expected Particles, got str"),
        (lambda c, g: particles.resample(c, g, lambda w, rng: w), TypeError, "method: expected indices"),
        (lambda c, g: particles.resample(c, g, lambda w, rng: np.array([-1, 2])), ValueError, "method: .* from 0 to 9"),
        (lambda c, g: particles.resample(c, g, lambda w, rng: np.array([10])), ValueError, "method: .* from 0 to 9"),
        (lambda c, g: particles.effective_sample_size(["1", "2"]), TypeError, "weights: expected real numbers"),
        (lambda c, g: Particles([["0", "1"]]), TypeError, "states: expected real numbers"),
        (lambda c, g: Particles(np.zeros((2, 3)), angles=2), TypeError, "angles: expected a tuple of columns"),
        (lambda c, g: Particles(np.zeros((2, 3)), angles=(2.0,)), TypeError, "angles: expected a tuple of columns"),
    ],
)
def test_every_part_of_a_filter_that_is_somebody_elses_is_looked_at(call, kind, message):
    rng = np.random.default_rng(0)
    with pytest.raises(kind, match=message):
        call(pose_cloud(rng, 10), rng)


def test_the_other_doors_say_what_was_wrong():
    rng = np.random.default_rng(0)
    cloud = pose_cloud(rng, 10)
    sensor = RangeOnly([1.0, 1.0], position=(0, 1))
    with pytest.raises(ValueError, match="angles"):
        Particles(np.zeros((3, 2)), angles=(2,))
    with pytest.raises(ValueError, match=r"log_likelihood.*\(10,\).*\(9,\)"):
        particles.weigh(cloud, np.zeros(9))
    with pytest.raises(ValueError, match=r"log_likelihood.*nan at index 4"):
        particles.weigh(cloud, np.where(np.arange(10) == 4, np.nan, 0.0))
    with pytest.raises(ValueError, match=r"log_likelihood.*inf at index 2"):
        particles.weigh(cloud, np.where(np.arange(10) == 2, np.inf, 0.0))
    with pytest.raises(ValueError, match="positive definite"):
        particles.log_likelihood(sensor, [1.0], R=[[-1.0]])
    with pytest.raises(ValueError, match="finite"):
        particles.log_likelihood(sensor, [np.nan])
    with pytest.raises(ValueError, match="dt"):
        particles.predict(cloud, DifferentialDrive(), [1.0, 0.0], 0.0, rng)
    with pytest.raises(ValueError, match="finite"):
        particles.predict(cloud, DifferentialDrive(), [np.nan, 0.0], 1.0, rng)
    with pytest.raises(ValueError, match="one for each of 10, got 9"):
        particles.predict(cloud, DifferentialDrive(), np.ones((9, 2)), 1.0, rng)
    with pytest.raises(ValueError, match="positive definite"):
        particles.as_gaussian(Particles(np.zeros((3, 2))))
    with pytest.raises(ValueError, match="bins"):
        particles.kld_size(0)
    with pytest.raises(ValueError, match="bin_size"):
        particles.occupied_bins(cloud.states, 0.0)
    with pytest.raises(ValueError, match=r"states.*nan"):
        particles.occupied_bins([[0.0, np.nan]], 1.0)
    with pytest.raises(ValueError, match=r"states.*\(2,\)"):
        particles.occupied_bins([0.0, 1.0], 1.0)
    with pytest.raises(ValueError, match="scale"):
        particles.roughen(cloud, rng, scale=-1)


# --- the homework, from its own parameters --------------------------------------------------------------------


def near(got, reference, standard_error):
    """Within five standard errors, and half a unit of the reference's last printed place."""
    return np.all(np.abs(got - np.array(reference)) < 5 * np.array(standard_error) + 0.00055)


def test_the_homeworks_dead_reckoning_is_that_of_a_million_particles():
    """100,000 particles, tolerance 5 standard errors (measured over 25 seeds) in 5 numbers: false alarm 3e-6."""
    rng = np.random.default_rng(0)
    cloud = particles.predict(runs.at_the_start(100_000), runs.drive(), runs.CONTROL, 10.0, rng)
    assert near(particles.mean(cloud)[:2], [1.0728, 3.0764], [0.0018, 0.0004])
    P = particles.covariance(cloud)[:2, :2]
    assert near(P, [[0.392, 0.0393], [0.0393, 0.0193]], [[0.0016, 0.0005], [0.0005, 0.00014]])


def test_the_homeworks_four_posterior_means_are_those_of_a_million_particles():
    """100,000 particles, 5 standard errors in 8 numbers: false alarm 5e-6."""
    history = runs.homework(100_000, np.random.default_rng(0))
    means = np.array([particles.mean(weighed)[:2] for _, weighed in history])
    reference = [(1.630, 1.233), (1.031, 3.142), (-0.998, 3.206), (-1.642, 1.228)]
    assert near(means, reference, np.array([[0.0002, 0.0003, 0.0004, 0.0005]]).T)


def test_fresh_noise_in_a_hundred_small_steps_is_another_and_smaller_noise():
    """var x falls from 0.392 to 0.0055; 20,000 particles, relative standard error of a variance 1 %."""
    rng, cloud = np.random.default_rng(0), runs.at_the_start(20_000)
    for _ in range(100):
        cloud = particles.predict(cloud, runs.drive(), runs.CONTROL, 0.1, rng)
    assert particles.covariance(cloud)[0, 0] == pytest.approx(0.0055, rel=0.05)


def test_the_homeworks_filter_knows_how_wrong_it_is():
    """NEES of the pose at each fix over 300 simulated drives.  The mean square of e against the posterior's own
    covariance is 3 whatever the posterior's shape; tolerance 4 standard errors at each of 4 fixes: 3e-4."""
    rng, sensor = np.random.default_rng(3), runs.FIX
    values = np.zeros((300, 4))
    for run in values:
        truth, cloud = np.zeros((1, 3)), runs.at_the_start(1500)
        for k in range(4):
            truth = runs.drive().sample(truth, runs.CONTROL, runs.PERIOD, rng)
            z = truth[0, :2] + 0.1 * rng.standard_normal(2)
            cloud = particles.predict(cloud, runs.drive(), runs.CONTROL, runs.PERIOD, rng)
            cloud = particles.weigh(cloud, particles.log_likelihood(sensor, z))
            run[k] = nees(particles.as_gaussian(cloud), truth[0], pose_residual)
            cloud = particles.resample(cloud, rng)
    assert np.all(np.abs(values.mean(axis=0) - 3) < 4 * values.std(axis=0) / np.sqrt(300)), values.mean(axis=0)
