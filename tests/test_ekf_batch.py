"""The filter of many beliefs: each is filtered as it would be alone, and nothing that is wrong goes through unseen."""

import numpy as np
import pytest

from coursekit import ekf
from coursekit.gaussian import MARGIN, Gaussian, nees
from coursekit.models import (
    ConstantVelocity,
    DifferentialDrive,
    Position,
    RangeBearing,
    RangeOnly,
    SlippingWheels,
    pose_residual,
)
from tests.work import within

RUNS = 100


def beliefs(rng, n=3, runs=RUNS):
    """Means all round, covariances of every shape."""
    A = rng.normal(size=(runs, n, n)) * [0.3, 0.2, 0.1, 0.2][:n]
    return Gaussian(rng.uniform(-3, 3, (runs, n)), A.swapaxes(1, 2) @ A + 1e-3 * np.eye(n))


def alone(many, one):
    """One belief after the other; what each gave, gathered."""
    results = [one(i, belief) for i, belief in enumerate(many)]
    return [np.array(part) for part in zip(*results, strict=True)]


@pytest.mark.parametrize(
    ("motion", "n", "shared", "own"),
    [
        (DifferentialDrive(), 3, [0.5, 0.3], lambda rng: rng.normal(0, 1, (RUNS, 2))),
        (DifferentialDrive(), 3, [0.5, 0.0], lambda rng: rng.normal(0, 1e-3, (RUNS, 2)) * [1, 0]),
        (SlippingWheels(), 3, [-0.5, 2.0], lambda rng: rng.normal(0, 1, (RUNS, 2))),
        (ConstantVelocity(), 4, None, lambda rng: None),
    ],
)
def test_each_of_many_predictions_is_what_it_would_be_alone(motion, n, shared, own):
    rng = np.random.default_rng(1)
    many = beliefs(rng, n)
    for control in (shared, own(rng)):
        got = ekf.predict(many, motion, control, 0.3)

        def one(i, belief, control=control):
            u = control if np.ndim(control) < 2 else control[i]
            after = ekf.predict(belief, motion, u, 0.3)
            return after.mean, after.cov, after.factor

        for mine, theirs in zip((got.mean, got.cov, got.factor), alone(many, one), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(got.cov, got.cov.swapaxes(1, 2))


@pytest.mark.parametrize(
    ("sensor", "n"),
    [
        (RangeBearing([1.0, 2.0], [[0.04, 0.001], [0.001, 0.01]]), 3),
        (RangeOnly([1.0, 2.0], [[0.04]], position=(0, 1)), 3),
        (Position(np.diag([0.1, 0.2]), position=(0, 2)), 4),
    ],
)
@pytest.mark.parametrize("correct", [ekf.correct, ekf.correct_robustly])
def test_each_of_many_corrections_is_what_it_would_be_alone(sensor, n, correct):
    rng = np.random.default_rng(2)
    many, m = beliefs(rng, n), len(sensor.R)
    own = sensor.h(many.mean) + rng.normal(0, 0.3, (RUNS, m))  # some far outside the gate
    Rs = np.array([sensor.R * s for s in rng.uniform(0.5, 2, RUNS)])
    for z, R in ((own, None), (own, Rs), (own[0], 2 * sensor.R)):
        got = correct(many, sensor, z, R)

        def one(i, belief, z=z, R=R):
            seen = correct(belief, sensor, z if z.ndim == 1 else z[i], R if np.ndim(R) < 3 else R[i])
            return seen.belief.mean, seen.belief.cov, seen.innovation, seen.innovation_cov, seen.nis

        expected = alone(many, one)
        for mine, theirs in zip(
            (got.belief.mean, got.belief.cov, got.innovation, got.innovation_cov, got.nis), expected, strict=True
        ):
            np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(got.belief.cov, got.belief.cov.swapaxes(1, 2))
        scores = nees(got.belief, many.mean, pose_residual if n == 3 else None)
        np.testing.assert_allclose(
            scores, [nees(b, x, pose_residual if n == 3 else None) for b, x in zip(got.belief, many.mean, strict=True)]
        )


def test_a_hundred_beliefs_are_a_twentieth_of_the_work_of_a_hundred_filters():
    """In function calls; for the time see benchmarks/ekf.py."""
    many, sensor = beliefs(np.random.default_rng(10)), RangeBearing([7.0, 1.0])
    z = sensor.h(many.mean)

    def step(belief, z):
        return ekf.correct(ekf.predict(belief, DifferentialDrive(), [0.5, 0.3], 0.1), sensor, z)

    step(many, z), step(many[0], z[0])  # whatever is done once
    alone = list(many)
    with pytest.raises(pytest.fail.Exception):
        within(10_000, lambda: [step(belief, one) for belief, one in zip(alone, z, strict=True)])
    within(500, lambda: step(many, z))


def test_leading_axes_may_be_several():
    rng = np.random.default_rng(3)
    many = beliefs(rng, runs=6)
    grid = Gaussian(many.mean.reshape(2, 3, 3), many.cov.reshape(2, 3, 3, 3))
    sensor = RangeBearing([8.0, 1.0])
    for step in (
        lambda b: ekf.predict(b, DifferentialDrive(), [0.4, 0.2], 0.1),
        lambda b: ekf.correct(b, sensor, [8.0, 0.2]).belief,
    ):
        flat, stacked = step(many), step(grid)
        np.testing.assert_array_equal(stacked.mean.reshape(6, 3), flat.mean)
        np.testing.assert_array_equal(stacked.cov.reshape(6, 3, 3), flat.cov)
    assert nees(grid, grid.mean).shape == (2, 3)


@pytest.mark.parametrize("correct", [ekf.correct, ekf.correct_robustly])
def test_where_nothing_was_measured_a_belief_stays_as_it_was_and_the_others_do_not_notice(correct):
    rng = np.random.default_rng(4)
    many, sensor = beliefs(rng), RangeBearing([7.0, 1.0])
    z = sensor.h(many.mean) + rng.normal(0, 0.2, (RUNS, 2))
    blind = rng.random(RUNS) < 0.4
    nothing = rng.choice([np.nan, np.inf, -np.inf], RUNS)
    partly = np.where(blind[:, None] & [True, False], nothing[:, None], z)  # one is enough
    got, full = correct(many, sensor, partly), correct(many, sensor, z)
    np.testing.assert_array_equal(got.belief.mean[blind], many.mean[blind])
    np.testing.assert_array_equal(got.belief.cov[blind], many.cov[blind])
    np.testing.assert_array_equal(got.belief.mean[~blind], full.belief.mean[~blind])
    np.testing.assert_array_equal(np.isnan(got.nis), blind)
    assert np.isnan(got.innovation[blind]).all() and np.isfinite(got.innovation_cov).all()
    assert not np.isnan(correct(many, sensor, np.full(2, np.nan)).belief.mean).any()


@pytest.mark.parametrize("sensor", [RangeBearing([1.0, 2.0]), RangeOnly([1.0, 2.0], position=(0, 1))])
def test_a_belief_on_top_of_the_landmark_stays_as_it_was_and_the_others_do_not_notice(sensor):
    rng = np.random.default_rng(11)
    many = beliefs(rng)
    mean = many.mean.copy()
    mean[::10, :2] = sensor.landmark
    on_top, away = np.arange(RUNS) % 10 == 0, np.arange(RUNS) % 10 != 0
    z = np.full((RUNS, len(sensor.R)), 0.3)
    got = ekf.correct(Gaussian(mean, many.cov), sensor, z)
    alone = ekf.correct(Gaussian(mean[away], many.cov[away]), sensor, z[away])
    np.testing.assert_array_equal(got.belief.mean[on_top], mean[on_top])
    np.testing.assert_array_equal(np.isnan(got.nis), on_top)
    np.testing.assert_array_equal(got.belief.mean[away], alone.belief.mean)
    np.testing.assert_array_equal(got.belief.cov[away], alone.belief.cov)


def test_many_covariances_keep_their_margin_however_exact_the_sensor_and_one_sided_the_noise():
    """Where rounding takes too much the careful forms take over, as they do for one belief."""
    rng = np.random.default_rng(5)
    wide = Gaussian(rng.normal(0, 1, (20, 3)), np.tile(np.diag([1e3, 1e3, 1.0]) ** 2, (20, 1, 1)))
    exact = RangeBearing([5.0, 2.0], 1e-12 * np.eye(2))
    for _ in range(3):
        got = ekf.correct(wide, exact, exact.h(wide.mean) + 1e-6)
        for i, belief in enumerate(wide):
            theirs = ekf.correct(belief, exact, exact.h(belief.mean) + 1e-6).belief
            np.testing.assert_allclose(got.belief.cov[i], theirs.cov, rtol=1e-4, atol=1e-9)
        sigma = np.sqrt(np.diagonal(got.belief.cov, axis1=1, axis2=2))
        assert np.linalg.eigvalsh(got.belief.cov / sigma[:, :, None] / sigma[:, None])[:, 0].min() > 0.9 * MARGIN
        wide = got.belief


class Odd:
    """A model of many states with one thing wrong with it."""

    R = 0.01 * np.eye(2)

    def __init__(self, **odd):
        self.odd = odd

    def f(self, x, u, dt):
        return self.odd.get("f", x)

    def F(self, x, u, dt):
        return self.odd.get("F", np.eye(3))

    def Q(self, x, u, dt):
        return self.odd.get("Q", 0.1 * np.eye(3))

    def h(self, x):
        return self.odd.get("h", x[..., :2])

    def H(self, x):
        return self.odd.get("H", np.eye(3)[:2])

    def residual(self, z, z_hat):
        return self.odd.get("residual", z - z_hat)


FEW = Gaussian(np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)))


def test_a_model_of_ones_own_serves_many_beliefs_with_one_matrix_for_all_or_one_each():
    rng = np.random.default_rng(6)
    F, Q, H = rng.normal(size=(4, 3, 3)), np.tile(0.2 * np.eye(3), (4, 1, 1)), rng.normal(size=(4, 2, 3))
    moved = ekf.predict(FEW, Odd(F=F, Q=Q), None, 0.1)
    np.testing.assert_allclose(moved.cov, F @ F.swapaxes(1, 2) + 0.2 * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(ekf.predict(FEW, Odd(), None, 0.1).cov[2], 1.1 * np.eye(3))
    S = ekf.correct(FEW, Odd(H=H), np.zeros((4, 2))).innovation_cov
    np.testing.assert_allclose(S, H @ H.swapaxes(1, 2) + 0.01 * np.eye(2), atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Gaussian(np.zeros((4, 3)), np.eye(3)), r"cov: expected shape \(4, 3, 3\), got \(3, 3\)"),
        (
            lambda: Gaussian(np.zeros((2, 2)), [np.eye(2), -np.eye(2)]),
            r"cov\[1\]: expected a positive definite matrix",
        ),
        (lambda: Gaussian(np.full((2, 2), np.nan), np.ones((2, 2, 2))), "mean: expected finite"),
        (lambda: Gaussian(np.zeros((0, 2)), np.zeros((0, 2, 2))), "mean: expected a vector"),
        (
            lambda: ekf.predict(FEW, DifferentialDrive(), np.zeros((3, 2)), 0.1),
            r"control: expected one for all or one for each of \(4,\) beliefs, got shape \(3, 2\)",
        ),
        (lambda: ekf.predict(FEW, DifferentialDrive(), np.zeros((5, 4, 2)), 0.1), "motion: expected a model of many"),
        (lambda: ekf.predict(FEW, DifferentialDrive(), [np.nan, 0.0], 0.1), "control .* finite"),
        (lambda: ekf.predict(FEW, Odd(Q=np.tile(-np.eye(3), (4, 1, 1))), None, 0.1), "Q: expected a positive semi"),
        (lambda: ekf.predict(FEW, Odd(F=np.zeros((2, 3, 3))), None, 0.1), r"F: expected shape \(4, 3, 3\)"),
        (lambda: ekf.predict(FEW, Odd(f=np.zeros(3)), None, 0.1), r"f: expected shape \(4, 3\)"),
        (lambda: ekf.correct(FEW, Odd(H=np.zeros((3, 2, 3))), [0.0, 0.0]), r"H: expected shape \(4, m, 3\)"),
        (lambda: ekf.correct(FEW, Odd(h=np.zeros(2)), [0.0, 0.0]), r"h: expected shape \(4, 2\)"),
        (lambda: ekf.correct(FEW, Position(), [1.0]), r"z: expected shape \(4, 2\), got \(1,\)"),
        (lambda: ekf.correct(FEW, Position(), np.zeros((3, 2))), r"z: expected shape \(4, 2\), got \(3, 2\)"),
        (lambda: ekf.correct(FEW, Position(), [0.0, 0.0], np.zeros((2, 2))), "R: expected a positive definite"),
        (lambda: ekf.correct(FEW, Position(), [0.0, 0.0], np.zeros((4, 2, 2))), r"R\[0\]: expected a positive"),
        (lambda: ekf.correct(FEW, Position(), [0.0, 0.0], np.ones((3, 2, 2))), r"R: expected shape \(4, 2, 2\)"),
        (lambda: nees(FEW, np.zeros(3)), r"truth: expected shape \(4, 3\)"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_one_of_many_is_an_ordinary_belief_and_one_alone_has_no_others():
    rng = np.random.default_rng(7)
    many = beliefs(rng)
    np.testing.assert_array_equal(many[7].cov, many.cov[7])
    assert many[:5].mean.shape == (5, 3)
    np.testing.assert_array_equal(many.marginal([0, 2]).cov[3], many[3].marginal([0, 2]).cov)
    with pytest.raises(TypeError, match="use marginal"):
        many[7][0]


def test_draws_from_many_beliefs_have_the_means_and_covariances_they_should():
    """20,000 draws of three beliefs: a standard error of 1 % of a variance; bounds at six of them."""
    many = beliefs(np.random.default_rng(8), runs=3)
    draws = many.sample(np.random.default_rng(9), 20_000)
    assert draws.shape == (20_000, 3, 3)
    for i, belief in enumerate(many):
        scale = np.sqrt(np.diag(belief.cov))
        np.testing.assert_allclose((draws[:, i].mean(axis=0) - belief.mean) / scale, 0, atol=6 / np.sqrt(20_000))
        np.testing.assert_allclose((np.cov(draws[:, i].T) - belief.cov) / np.outer(scale, scale), 0, atol=0.06)
