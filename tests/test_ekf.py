"""The extended Kalman filter: against textbooks and other people's code, and against its own claims."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter
from scipy.stats import chi2

from coursekit import ekf
from coursekit.gaussian import MARGIN, Gaussian, chi2_band, nees
from coursekit.geometry import wrap_angle
from coursekit.models import ConstantVelocity, DifferentialDrive, Position, RangeBearing, RangeOnly, pose_residual

LANDMARKS = np.array([[3.0, 0.0], [0.0, 3.0], [-3.0, 0.5], [0.5, -3.0]])


def textbook_kalman_filter(mean, P, F, Q, H, R, measurements):
    """Kalman's equations as Thrun, Burgard & Fox (2005) print them in table 3.1, with an explicit inverse."""
    for z in measurements:
        mean, P = F @ mean, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        mean, P = mean + K @ (z - H @ mean), (np.eye(len(P)) - K @ H) @ P
        yield mean, P


def test_a_linear_problem_gives_the_kalman_filter_of_the_textbook():
    rng = np.random.default_rng(1)
    motion, sensor = ConstantVelocity(0.5), Position(np.diag([0.3, 0.2]) ** 2, position=(0, 2))
    belief = Gaussian([1.0, 0.2, -1.0, 0.1], np.diag([1.0, 0.5, 2.0, 0.3]))
    measurements = rng.normal(0, 2, (60, 2))
    F, Q = motion.F(None, None, 0.3), motion.Q(None, None, 0.3)
    H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
    expected = textbook_kalman_filter(belief.mean, belief.cov, F, Q, H, sensor.R, measurements)
    for z, (mean, P) in zip(measurements, expected, strict=True):
        belief = ekf.correct(ekf.predict(belief, motion, None, 0.3), sensor, z).belief
        np.testing.assert_allclose(belief.mean, mean, atol=1e-12)
        np.testing.assert_allclose(belief.cov, P, atol=1e-12)


def test_a_linear_problem_gives_filterpys_kalman_filter_and_its_likelihoods():
    rng = np.random.default_rng(2)
    motion, sensor = ConstantVelocity(0.5), Position(np.array([[0.2, 0.05], [0.05, 0.1]]), position=(0, 2))
    belief = Gaussian(np.zeros(4), 4 * np.eye(4))
    peer = KalmanFilter(4, 2)
    peer.x, peer.P, peer.R = belief.mean.copy(), belief.cov.copy(), sensor.R.copy()
    peer.F, peer.Q, peer.H = motion.F(None, None, 0.2), motion.Q(None, None, 0.2), sensor.H(np.zeros(4))
    for z in rng.normal(0, 1, (40, 2)):
        seen = ekf.correct(ekf.predict(belief, motion, None, 0.2), sensor, z)
        belief = seen.belief
        peer.predict()
        peer.update(z)
        np.testing.assert_allclose(belief.mean, peer.x, atol=1e-12)
        np.testing.assert_allclose(belief.cov, peer.P, atol=1e-12)
        np.testing.assert_allclose(seen.innovation, peer.y, atol=1e-12)
        np.testing.assert_allclose(seen.innovation_cov, peer.S, atol=1e-12)
        assert seen.nis == pytest.approx(peer.mahalanobis**2, abs=1e-10)


class _Drive(ExtendedKalmanFilter):
    def __init__(self, motion):
        super().__init__(3, 2)
        self.motion = motion

    def predict_x(self, u=0):
        self.x = self.motion.f(self.x, u, 0.1)


def test_a_drive_among_landmarks_gives_filterpys_extended_filter():
    rng = np.random.default_rng(3)
    motion = DifferentialDrive(0.05, 0.1)
    belief, truth = Gaussian([0.0, 0.0, 3.0], np.diag([0.3, 0.3, 0.2]) ** 2), np.array([0.1, 0.2, 3.1])
    peer = _Drive(motion)
    peer.x, peer.P = belief.mean.copy(), belief.cov.copy()
    for k in range(120):
        u = np.array([0.5, np.sin(0.1 * k)])
        truth = motion.sample(truth[None], u, 0.1, rng)[0]
        sensor = RangeBearing(LANDMARKS[k % 4])
        z = sensor.h(truth) + rng.normal(0, [0.1, 0.02])
        belief = ekf.correct(ekf.predict(belief, motion, u, 0.1), sensor, z).belief
        peer.F, peer.Q = motion.F(peer.x, u, 0.1), motion.Q(peer.x, u, 0.1)
        peer.predict(u)
        peer.update(z, sensor.H, sensor.h, R=sensor.R, residual=sensor.residual)
        np.testing.assert_allclose(pose_residual(belief.mean, peer.x), 0, atol=1e-10)
        np.testing.assert_allclose(belief.cov, peer.P, atol=1e-10)
        peer.x[2] = wrap_angle(peer.x[2])


class _Odometry:
    """The motion that Corke's toolbox filters with: ahead by δ along the *old* heading, then turned by dθ."""

    def __init__(self, V):
        self.V = V

    def f(self, x, u, dt):
        return np.array([x[0] + u[0] * np.cos(x[2]), x[1] + u[0] * np.sin(x[2]), wrap_angle(x[2] + u[1])])

    def F(self, x, u, dt):
        return np.array([[1, 0, -u[0] * np.sin(x[2])], [0, 1, u[0] * np.cos(x[2])], [0, 0, 1.0]])

    def Q(self, x, u, dt):
        G = np.array([[np.cos(x[2]), 0], [np.sin(x[2]), 0], [0, 1.0]])
        return G @ self.V @ G.T


def test_localisation_gives_the_answers_of_corkes_toolbox():
    """Its filter drives its own robot; ours is given the same odometry and readings and must agree to 1e-9."""
    toolbox = pytest.importorskip("roboticstoolbox", reason="the toolbox has no wheel for this Python")
    V, W, P0 = (
        np.diag([0.02, np.radians(0.5)]) ** 2,
        np.diag([0.1, np.radians(1)]) ** 2,
        np.diag([0.05, 0.05, 0.02]) ** 2,
    )
    robot = toolbox.Bicycle(covar=V, x0=(0.0, 0.0, 0.1))
    robot.control = lambda robot, t, x: (1.0, 0.3 * np.sin(0.3 * t))
    arena = toolbox.LandmarkMap(20, workspace=10, seed=1)
    sensor = toolbox.RangeBearingSensor(robot, arena, covar=W, angle=[-np.pi / 2, np.pi / 2], range=4, seed=2)
    peer = toolbox.EKF(robot=(robot, V), P0=P0, map=arena, sensor=(sensor, W), x0=np.array([0.0, 0.0, 0.1]))
    peer.run(T=20)
    belief, motion, seen = Gaussian([0.0, 0.0, 0.1], P0), _Odometry(V), 0
    for step in peer.history:
        belief = ekf.predict(belief, motion, step.odo, robot.dt)
        if step.z is not None:
            belief = ekf.correct(belief, RangeBearing(arena[step[7]], W), step.z).belief
            seen += 1
        np.testing.assert_allclose(pose_residual(belief.mean, step.xest), 0, atol=1e-9)
        np.testing.assert_allclose(belief.cov, step.P, atol=1e-9)
    assert seen > 50


# --- The filter's own claims ---------------------------------------------------------------------------------------
def localisation(rng, motion, believed_motion=None, believed_R=None, sensor_type=RangeBearing, steps=80):
    """One drive among four landmarks, each seen in turn → NEES (steps,), NIS (steps,)."""
    start, sigma = np.array([0.1, 0.1, 0.05]), np.array([0.1, 0.03])
    sensors = [sensor_type(landmark, np.diag(sigma**2)) for landmark in LANDMARKS]
    truth, belief = start * rng.standard_normal(3), Gaussian(np.zeros(3), np.diag(start**2))
    squares = np.empty((2, steps))
    for k in range(steps):
        u = np.array([0.4, 0.5 * np.sin(0.05 * k)])
        truth = motion.sample(truth, u, 0.1, rng)
        z = sensors[k % 4].h(truth) + sigma * rng.standard_normal(2)
        belief = ekf.predict(belief, believed_motion or motion, u, 0.1)
        seen = ekf.correct(belief, sensors[k % 4], [z[0], wrap_angle(float(z[1]))], believed_R)
        belief = seen.belief
        error = pose_residual(truth, belief.mean)
        squares[:, k] = error @ np.linalg.solve(belief.cov, error), seen.nis
    return squares


def shares_inside_the_bands(runs=100, **wrong):
    """The shares of steps at which the averages over the runs lie in their two-sided 95 % bands: NEES, NIS."""
    motion = DifferentialDrive(0.1, 0.1, (0.005, 0.005, 0.005))
    averages = np.mean([localisation(np.random.default_rng(seed), motion, **wrong) for seed in range(runs)], axis=0)
    bands = chi2_band(3, runs), chi2_band(2, runs)
    return [float(np.mean((low <= a) & (a <= high))) for a, (low, high) in zip(averages, bands, strict=True)]


def test_nees_and_nis_stay_in_their_bands_at_nine_steps_in_ten():
    """100 runs.  Each step lies outside its band with probability 5 %; that more than 10 % of 80 steps do, when they
    follow each other with a memory of some five steps, happens in about 1 of 50 seeds' sets for an honest filter."""
    inside_nees, inside_nis = shares_inside_the_bands()
    assert inside_nees >= 0.9 and inside_nis >= 0.9


class _Overtrusted(RangeBearing):
    """Popular code's correction: the bearing difference is left as it comes."""

    @staticmethod
    def residual(z, z_hat):
        return np.asarray(z, dtype=float) - np.asarray(z_hat, dtype=float)


class _RepeatedColumn(RangeBearing):
    """The homework's Eq. (10), in a pose's columns: the y column repeats the x column."""

    def H(self, x):
        H = super().H(x)
        H[0, 1] = H[0, 0]
        return H


@pytest.mark.parametrize(
    ("wrong", "index"),
    [
        ({"believed_R": np.diag([0.1, 0.03]) ** 2 / 4}, 1),
        ({"believed_R": np.diag([0.1, 0.03]) ** 2 * 4}, 1),
        ({"believed_motion": DifferentialDrive(0.02, 0.02, (0.001,) * 3)}, 0),
        ({"believed_motion": DifferentialDrive(0.4, 0.4, (0.02,) * 3)}, 0),
        ({"sensor_type": _RepeatedColumn}, 0),
        ({"sensor_type": _Overtrusted}, 0),
    ],
    ids=["R too small", "R too large", "Q too small", "Q too large", "Eq. (10)'s column", "unwrapped bearing"],
)
def test_the_same_bands_catch_a_filter_that_is_wrong(wrong, index):
    """Each mistake leaves the band that it is caught by at one step in four and more; an honest filter at one in 20."""
    assert shares_inside_the_bands(runs=40, **wrong)[index] < 0.75


def test_dead_reckoning_grows_and_a_measurement_shrinks():
    motion = DifferentialDrive()
    belief = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2)
    areas = [np.linalg.det(belief.cov)]
    for _ in range(10):
        belief = ekf.predict(belief, motion, [0.5, 0.2], 0.1)
        areas.append(np.linalg.det(belief.cov))
    assert np.all(np.diff(areas) > 0)
    assert np.linalg.det(ekf.correct(belief, RangeBearing([2.0, 1.0]), [1.8, 0.3]).belief.cov) < areas[-1]


def test_one_landmark_and_ranges_only_leave_the_circle_unknown_and_the_covariance_says_so():
    """A robot that stands still and hears its distance from one beacon learns that distance and nothing else."""
    prior = Gaussian([2.0, 0.0, 0.0], np.diag([0.5, 0.5, 0.3]) ** 2)
    sensor, belief = RangeOnly([0.0, 0.0], np.diag([0.05**2]), position=(0, 1)), prior
    for _ in range(200):
        belief = ekf.correct(belief, sensor, [2.0]).belief
    assert np.sqrt(belief.cov[0, 0]) < 0.01
    np.testing.assert_allclose(belief.cov[1:, 1:], prior.cov[1:, 1:], atol=1e-12)


def test_the_corrected_heading_stays_between_minus_pi_and_pi():
    belief = Gaussian([0.0, 0.0, np.pi - 0.01], np.diag([0.1, 0.1, 0.3]) ** 2)
    seen = ekf.correct(belief, RangeBearing([-3.0, 0.0]), [3.0, -0.2])
    assert -np.pi < seen.belief.mean[2] < -2.8


# --- Numbers --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("sigma", [1e-3, 1e-5, 1e-6])
def test_a_covariance_stays_positive_definite_however_exact_the_sensor(sigma):
    belief = Gaussian([1.0, 2.0, 0.3], np.diag([1e3, 1e3, 1.0]) ** 2)
    for k in range(50):
        belief = ekf.correct(belief, RangeBearing(LANDMARKS[k % 4], sigma**2 * np.eye(2)), [3.0, 0.1 * k]).belief
        assert narrowest(belief.cov) > 0.9 * MARGIN
        np.testing.assert_allclose(belief.cov, belief.cov.T, rtol=1e-12)


def test_an_exact_sensor_leaves_its_own_variance():
    belief = Gaussian(np.zeros(2), 1e8 * np.eye(2))
    for n in range(1, 6):
        belief = ekf.correct(belief, Position(1e-10 * np.eye(2)), [1.0, 2.0]).belief
        np.testing.assert_allclose(np.diag(belief.cov), 1e-10 / n, rtol=1e-6)


def test_ten_thousand_steps_leave_the_covariance_symmetric_to_the_last_bit():
    rng, motion = np.random.default_rng(4), DifferentialDrive()
    belief = Gaussian(np.zeros(3), np.eye(3))
    for k in range(10_000):
        belief = ekf.predict(belief, motion, [0.3, 0.2], 0.05)
        belief = ekf.correct(belief, RangeBearing(LANDMARKS[k % 4]), rng.uniform([0.5, -3], [6, 3])).belief
    assert np.array_equal(belief.cov, belief.cov.T) and narrowest(belief.cov) > 1e-6


def test_R_can_be_given_for_one_measurement():
    belief, sensor = Gaussian(np.zeros(3), np.eye(3)), RangeBearing([3.0, 1.0])
    R = np.array([[0.5, 0.01], [0.01, 0.1]])
    once, other = (
        ekf.correct(belief, sensor, [3.0, 0.3], R),
        ekf.correct(belief, RangeBearing([3.0, 1.0], R), [3.0, 0.3]),
    )
    np.testing.assert_array_equal(once.belief.cov, other.belief.cov)
    np.testing.assert_allclose(
        once.innovation_cov - ekf.correct(belief, sensor, [3.0, 0.3]).innovation_cov, R - sensor.R
    )


# --- Gates ----------------------------------------------------------------------------------------------------------
def test_inside_the_gate_the_robust_correction_is_the_plain_one():
    belief, sensor = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2), RangeBearing([3.0, 1.0])
    plain, robust = ekf.correct(belief, sensor, [3.1, 0.3]), ekf.correct_robustly(belief, sensor, [3.1, 0.3])
    assert plain.nis < ekf.gate_threshold(0.99, 2)
    np.testing.assert_array_equal(plain.belief.mean, robust.belief.mean)


def test_a_wild_measurement_pulls_no_farther_when_it_is_wilder():
    belief, sensor = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2), RangeBearing([3.0, 1.0])
    pulls = [np.linalg.norm(ekf.correct_robustly(belief, sensor, [r, 0.32]).belief.mean) for r in (5, 10, 100, 1000)]
    plain = [np.linalg.norm(ekf.correct(belief, sensor, [r, 0.32]).belief.mean) for r in (5, 10, 100, 1000)]
    assert max(pulls) < 0.35 and plain[-1] > 100


def run_with(correct, start, seed=0):
    """A drive whose belief starts wrong and sure of itself → position error at the end, share accepted."""
    rng, motion = np.random.default_rng(seed), DifferentialDrive(0.02, 0.02, (1e-3, 1e-3, 1e-3))
    truth, belief, accepted = np.zeros(3), Gaussian(start, np.diag([0.05, 0.05, 0.02]) ** 2), 0
    for k in range(300):
        u = np.array([0.3, 0.3])
        truth = motion.sample(truth[None], u, 0.1, rng)[0]
        z = RangeBearing(LANDMARKS[k % 4]).h(truth) + rng.normal(0, [0.1, 0.02])
        belief = ekf.predict(belief, motion, u, 0.1)
        seen = correct(belief, RangeBearing(LANDMARKS[k % 4]), z)
        if seen is not None:
            belief, accepted = seen.belief, accepted + 1
    return float(np.hypot(*(truth - belief.mean)[:2])), accepted / 300


def hard_gate(belief, sensor, z):
    seen = ekf.correct(belief, sensor, z)
    return seen if seen.nis < chi2.ppf(0.99, 2) else None


def test_a_hard_gate_locks_the_truth_out_and_the_robust_correction_lets_it_in():
    kidnapped = [1.5, -1.0, 0.5]
    error, accepted = run_with(hard_gate, kidnapped)
    assert error > 1.0 and accepted < 0.2
    error, _ = run_with(ekf.correct_robustly, kidnapped)
    assert error < 0.15


def test_where_wrong_measurements_agree_a_gate_is_right_and_the_robust_correction_is_not():
    """Three of eight tags were moved by 1 m to the right: the docstring's figures, on 12 drives that it did not see."""
    tags = np.array([[4, 0], [4, 1.5], [0, 4], [1.5, 4], [-4, 0], [-4, -1.5], [0, -4], [-1.5, -4]])
    moved = tags + np.where(np.arange(8) < 3, 1.0, 0.0)[:, None] * [1, 0]
    motion, P = DifferentialDrive(0.03, 0.03, (1e-3, 1e-3, 1e-3)), np.diag([0.1, 0.1, 0.05]) ** 2
    off, scores = {}, {}
    for correct in (hard_gate, ekf.correct_robustly):
        squares, values = [], []
        for seed in range(500, 512):
            rng, truth = np.random.default_rng(seed), np.zeros(3)
            belief = Gaussian(rng.multivariate_normal(truth, P), P)
            for k in range(300):
                truth = motion.sample(truth[None], [0.3, 0.3], 0.1, rng)[0]
                i = rng.integers(8)
                z = RangeBearing(moved[i]).h(truth) + rng.normal(0, [0.1, 0.02])
                belief = ekf.predict(belief, motion, [0.3, 0.3], 0.1)
                seen = correct(belief, RangeBearing(tags[i]), z)
                belief = belief if seen is None else seen.belief
                if k >= 50:
                    squares.append(np.sum((truth - belief.mean)[:2] ** 2))
                    values.append(nees(belief, truth, pose_residual))
        off[correct], scores[correct] = np.sqrt(np.mean(squares)), np.mean(values)
    assert off[hard_gate] < 0.04 and 2 < scores[hard_gate] < 5
    assert off[ekf.correct_robustly] > 2 * off[hard_gate] and scores[ekf.correct_robustly] > 15


def test_gate_thresholds_are_the_chi_square_quantiles():
    assert ekf.gate_threshold(0.99, 2) == pytest.approx(9.2103, abs=1e-4)
    assert ekf.gate_threshold(0.95, 1) == pytest.approx(3.8415, abs=1e-4)


# --- Bad input ------------------------------------------------------------------------------------------------------
BELIEF = Gaussian(np.zeros(3), np.eye(3))
UNSURE = Gaussian(np.zeros(3), 1e9 * np.eye(3))
SENSOR = RangeBearing([3.0, 1.0])


class _Odd:
    """A model with one thing wrong with it."""

    def __init__(self, **odd):
        self.odd = odd

    def f(self, x, u, dt):
        return self.odd.get("f", x)

    def F(self, x, u, dt):
        return self.odd.get("F", np.eye(3))

    def Q(self, x, u, dt):
        return self.odd.get("Q", np.eye(3))


NO_NOISE_YET_CORRELATED = np.array([[0.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])


class _Odder:
    """A sensor of x and y with one thing wrong with it."""

    def __init__(self, **odd):
        self.odd, self.R = odd, odd.get("R", np.eye(2))

    def h(self, x):
        return self.odd.get("h", x[:2])

    def H(self, x):
        return self.odd.get("H", np.eye(3)[:2])

    def residual(self, z, z_hat):
        return self.odd.get("residual", z - z_hat)


class _Half:
    """A model with neither F nor H."""

    def f(self, x, u, dt):
        return x

    Q, h, residual = f, f, f


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ekf.predict((np.zeros(3), np.eye(3)), DifferentialDrive(), [1.0, 0.0], 0.1), "belief: .* got tuple"),
        (lambda: ekf.correct((np.zeros(3), np.eye(3)), SENSOR, [1.0, 0.0]), "belief: expected a Gaussian.* got tuple"),
        (lambda: ekf.predict(BELIEF, _Half(), None, 0.1), "motion: expected a model with f, F, Q; _Half has no F"),
        (lambda: ekf.predict(BELIEF, DifferentialDrive, None, 0.1), "motion: .* the class DifferentialDrive itself"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=np.eye(3).astype(str)), None, 0.1), "Q: expected real numbers"),
        (lambda: ekf.predict(BELIEF, _Odd(f=[None] * 3), None, 0.1), "f: expected real numbers"),
        (lambda: ekf.predict(BELIEF, _Odd(F=np.eye(3, dtype=object)), None, 0.1), "F: expected real numbers"),
        (lambda: ekf.predict(BELIEF, DifferentialDrive(), ["1", "0"], 0.1), "control .* expected real numbers"),
        (lambda: ekf.correct(BELIEF, _Half(), [1.0]), "sensor: expected a model with h, H, residual; _Half has no H"),
        (lambda: ekf.correct(BELIEF, SENSOR, ["1", "2"]), "z .* expected real numbers"),
        (lambda: ekf.correct(BELIEF, Position(), ["1", "2"]), "z: expected real numbers"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 2.0], "big"), "R: expected real numbers"),
        (lambda: Gaussian(["0", "1"], np.eye(2)), "mean: expected real numbers"),
    ],
)
def test_a_wrong_type_is_a_type_error_that_names_it(call, message):
    with pytest.raises(TypeError, match=message):
        call()


def test_noise_in_some_directions_only_is_welcome_and_so_are_lists():
    """G M Gᵀ of rank 1 and 2 at 200 random headings, never symmetric to the last bit, and a Q of zeros."""
    rng = np.random.default_rng(7)
    for _ in range(200):
        G = rng.normal(size=(3, rng.integers(1, 3))) * [[1e3], [1.0], [1e-4]]
        predicted = ekf.predict(BELIEF, _Odd(Q=G @ np.eye(G.shape[1]) @ G.T), None, 0.1)
        np.testing.assert_allclose(predicted.cov, np.eye(3) + G @ G.T, rtol=1e-9)
    still = ekf.predict(BELIEF, _Odd(Q=np.zeros((3, 3)).tolist(), F=np.eye(3).tolist(), f=[1, 2, 3]), None, 0.1)
    np.testing.assert_array_equal(still.mean, [1.0, 2.0, 3.0])


def test_what_a_model_keeps_stays_its_own():
    kept, model = np.array([1.0, 2.0, 3.0]), None
    model = _Odd(f=kept)
    ekf.predict(BELIEF, model, None, 0.1)
    kept[0] = 5.0  # a filter that handed it out would have made it read-only


# --- The margin -------------------------------------------------------------------------------------------------------
def narrowest(cov):
    """The smallest eigenvalue of the correlation matrix; eigvalsh is off by some 1e-15."""
    sigma = np.sqrt(np.diag(cov))
    return np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0]


@pytest.mark.parametrize("noise", [1e-2, 1e2, 1e6, 1e12])
def test_a_prediction_keeps_its_margin_however_one_sided_the_noise(noise):
    """Noise along one direction drowns the rest: 1e12 squared beside 1 is beyond what floats hold."""
    G = noise * np.array([[0.6], [0.7], [0.3]])
    for model in (_Odd(Q=G @ G.T), _Odd(Q=G @ G.T, F=np.zeros((3, 3)))):
        belief = ekf.predict(BELIEF, model, None, 0.1)
        assert narrowest(belief.cov) > 0.9 * MARGIN
        np.testing.assert_allclose(belief.factor @ belief.factor.T, belief.cov, rtol=1e-9)
        np.testing.assert_allclose(np.diag(belief.cov), np.diag(model.F(0, 0, 0)) + G.ravel() ** 2, rtol=1e-11)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ekf.predict(BELIEF, DifferentialDrive(), [1.0, 0.0], 0.0), "dt: expected a time step > 0 s, got 0.0"),
        (lambda: ekf.predict(BELIEF, DifferentialDrive(), [1.0, 0.0], -1.0), "dt"),
        (lambda: ekf.predict(BELIEF, DifferentialDrive(), [1.0, np.nan], 0.1), "control .* finite"),
        (lambda: ekf.predict(BELIEF, DifferentialDrive(), [1.0], 0.1), "control"),
        (lambda: ekf.predict(Gaussian([0.0], [[1.0]]), DifferentialDrive(), [1.0, 0.0], 0.1), "state"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=np.triu(np.ones((3, 3)))), None, 0.1), "Q: expected a symmetric"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=np.full((3, 3), np.nan)), None, 0.1), "Q: expected finite"),
        (lambda: ekf.predict(BELIEF, _Odd(f=np.full(3, np.nan)), None, 0.1), "f: expected finite"),
        (lambda: ekf.predict(BELIEF, _Odd(F=np.eye(2)), None, 0.1), r"F: expected shape \(3, 3\), got \(2, 2\)"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, np.nan]), "z .* finite"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0]), r"z .* expected shape \(\.\.\., 2\)"),
        (lambda: ekf.correct(BELIEF, SENSOR, [[1.0, 0.2], [1.0, 0.3]]), "z: expected shape"),
        (
            lambda: ekf.correct(BELIEF, RangeOnly([3.0, 1.0], position=(0, 1)), [1.0, 2.0]),
            r"z: expected shape \(\.\.\., 1\)",
        ),
        (lambda: ekf.predict(BELIEF, _Odd(Q=1.0), None, 0.1), r"Q: expected shape \(3, 3\), got \(\)"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=np.ones(3)), None, 0.1), r"Q: expected shape \(3, 3\), got \(3,\)"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=-0.5 * np.eye(3)), None, 0.1), "Q: expected a positive semidefinite"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=np.diag([1.0, 1.0, -1e-9])), None, 0.1), "Q: expected a positive semi"),
        (lambda: ekf.predict(BELIEF, _Odd(Q=NO_NOISE_YET_CORRELATED), None, 0.1), "Q: expected a positive semi"),
        (lambda: ekf.predict(BELIEF, _Odd(F=np.ones(3)), None, 0.1), r"F: expected shape \(3, 3\), got \(3,\)"),
        (lambda: ekf.predict(BELIEF, _Odd(F=np.full((3, 3), np.inf)), None, 0.1), "F: expected finite"),
        (lambda: ekf.predict(BELIEF, _Odd(f=np.zeros(2)), None, 0.1), r"f: expected shape \(3,\), got \(2,\)"),
        (lambda: ekf.predict(BELIEF, _Odd(f=0.0), None, 0.1), r"f: expected shape \(3,\), got \(\)"),
        (lambda: ekf.predict(BELIEF, _Odd(F=[[1.0], [1.0, 0.0]]), None, 0.1), "F: .* rows of different lengths"),
        (lambda: ekf.correct(BELIEF, Position(), [1.0]), r"z: expected shape \(\.\.\., 2\), got \(1,\)"),
        (lambda: ekf.correct(BELIEF, _Odder(), [1.0]), r"z: expected shape \(2,\), got \(1,\)"),
        (lambda: ekf.correct(BELIEF, _Odder(), [1.0, np.nan]), "z: expected finite"),
        (lambda: ekf.correct(BELIEF, _Odder(h=np.ones(1)), [1.0, 2.0]), r"h: expected shape \(2,\), got \(1,\)"),
        (lambda: ekf.correct(BELIEF, _Odder(h=1.0), [1.0, 2.0]), r"h: expected shape \(2,\), got \(\)"),
        (lambda: ekf.correct(BELIEF, _Odder(H=np.ones(3)), [1.0, 2.0]), r"H: expected shape \(m, 3\), got \(3,\)"),
        (lambda: ekf.correct(BELIEF, _Odder(H=np.eye(2)), [1.0, 2.0]), r"H: expected shape \(m, 3\), got \(2, 2\)"),
        (lambda: ekf.correct(BELIEF, _Odder(H=np.full((2, 3), np.nan)), [1.0, 2.0]), "H: expected finite"),
        (lambda: ekf.correct(BELIEF, _Odder(R=0.1), [1.0, 2.0]), r"R: expected shape \(2, 2\), got \(\)"),
        (lambda: ekf.correct(BELIEF, _Odder(residual=1.0), [1.0, 2.0]), r"residual: expected shape \(2,\), got \(\)"),
        (lambda: ekf.correct(BELIEF, _Odder(residual=[0.0, np.inf]), [1.0, 2.0]), "residual: expected finite"),
        (lambda: ekf.correct(BELIEF, Position(), [np.inf, 0.0]), "z: expected finite numbers, got .*inf"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 0.1], -np.eye(2)), "R: expected a positive definite"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 0.1], np.broadcast_to(-1.0, (2, 2))), "R: expected a positive"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 0.1], np.zeros((2, 2))), "R: expected a positive definite"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 0.1], [[1.0, 0.9], [0.1, 1.0]]), "R: expected a symmetric"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 0.1], np.full((2, 2), np.nan)), "R: expected finite"),
        (lambda: ekf.correct(BELIEF, SENSOR, [1.0, 0.1], np.eye(3)), "R: expected shape"),
        (lambda: ekf.correct(UNSURE, SENSOR, [1.0, 0.1], 1e-30 * np.eye(2)), "R: too small"),
        (lambda: ekf.correct(Gaussian([3.0, 1.0, 0.0], np.eye(3)), SENSOR, [1.0, 0.1]), "no derivative"),
        (
            lambda: ekf.correct_robustly(BELIEF, SENSOR, [1.0, 0.1], gate=1.0),
            r"gate: expected a probability in \(0, 1\)",
        ),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    before = BELIEF.mean.copy(), BELIEF.cov.copy()
    with pytest.raises(ValueError, match=message):
        call()
    np.testing.assert_array_equal(before[0], BELIEF.mean)
    np.testing.assert_array_equal(before[1], BELIEF.cov)


def test_arguments_are_never_changed_and_results_are_read_only():
    u, z, R = np.array([0.5, 0.2]), np.array([3.0, 0.2]), np.diag([0.1, 0.2])
    kept = u.copy(), z.copy(), R.copy()
    predicted = ekf.predict(BELIEF, DifferentialDrive(), u, 0.1)
    seen = ekf.correct(predicted, SENSOR, z, R)
    for array, copy in zip((u, z, R), kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    for belief in (predicted, seen.belief):
        with pytest.raises(ValueError, match="read-only"):
            belief.mean[0] = 1.0
        with pytest.raises(ValueError, match="read-only"):
            belief.cov[0, 0] = 1.0
