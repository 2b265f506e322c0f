"""Motion models: the arc, the noise, and what they refuse.  Their Jacobians are checked in test_models.py."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import chi2

from coursekit.geometry import wrap_angle
from coursekit.models import ConstantVelocity, DifferentialDrive, SlippingWheels, SteadyNoiseDrive, pose_residual
from coursekit.models._vectors import sine_cosine
from coursekit.world.arena import Arena
from coursekit.world.robot import Robot, World


@pytest.mark.parametrize("control", [(0.4, 0.9), (0.4, 0.0), (-0.3, 1e-5), (0.0, 2.0), (0.5, -30.0)])
def test_the_robot_runs_along_the_arc_that_integration_gives(control):
    v, omega = control
    path = solve_ivp(
        lambda t, x: [v * np.cos(x[2]), v * np.sin(x[2]), omega], (0, 0.7), [1.0, 2.0, 0.3], rtol=1e-11, atol=1e-12
    )
    got = DifferentialDrive().f([1.0, 2.0, 0.3], control, 0.7)
    np.testing.assert_allclose(pose_residual(got, path.y[:, -1]), 0, atol=1e-9)


def test_one_tangent_gives_sine_and_cosine_to_the_last_digits_all_round_and_far_out():
    angle = np.concatenate([np.linspace(-10, 10, 4001), np.arange(-8, 9) * np.pi / 2, [0.0, 1e-300, 1e3]])
    np.testing.assert_allclose(sine_cosine(angle), [np.sin(angle), np.cos(angle)], rtol=0, atol=6e-16)


def test_many_states_move_as_each_would_alone():
    rng = np.random.default_rng(2)
    states, controls = rng.normal(0, 3, (50, 3)), rng.normal(0, 1, (50, 2))
    motion = DifferentialDrive()
    together = motion.f(states, controls, 0.2)
    alone = [motion.f(x, u, 0.2) for x, u in zip(states, controls, strict=True)]
    np.testing.assert_allclose(together, alone, atol=1e-14)
    np.testing.assert_allclose(motion.f(states[0], controls, 0.2)[7], motion.f(states[0], controls[7], 0.2), atol=1e-14)
    moving = rng.normal(0, 3, (4, 5, 4))
    np.testing.assert_allclose(
        ConstantVelocity().f(moving, None, 0.2)[1, 2], ConstantVelocity().f(moving[1, 2], None, 0.2)
    )


@pytest.mark.parametrize("motion", [DifferentialDrive(0.02, 0.03), SlippingWheels(slip=0.05)])
def test_many_states_have_the_jacobians_and_the_noise_that_each_has_alone(motion):
    rng = np.random.default_rng(12)
    states, controls = rng.normal(0, 3, (50, 3)), rng.normal(0, 1, (50, 2))
    controls[::5, 1] = 0.0  # straight ahead
    controls[1::5, 1] *= 1e-4  # and nearly so
    for us in (controls, controls[0], controls[2]):
        each = us if us.ndim > 1 else [us] * 50
        for name in ("f", "F", "G", "Q"):
            alone = [getattr(motion, name)(x, u, 0.2) for x, u in zip(states, each, strict=True)]
            np.testing.assert_allclose(getattr(motion, name)(states, us, 0.2), alone, rtol=1e-9, atol=1e-13)
        for got, name in zip(motion.linearized(states, us, 0.2), ("f", "F", "Q"), strict=True):
            np.testing.assert_allclose(got, getattr(motion, name)(states, us, 0.2), atol=1e-13)


@pytest.mark.parametrize(
    ("motion", "x", "u"),
    [
        (DifferentialDrive(0.02, 0.03, (2e-3, 1e-3, 1e-3)), np.array([1.0, -2.0, 3.1]), np.array([0.5, 0.8])),
        (SlippingWheels(slip=0.05, track=0.4), np.array([1.0, -2.0, 3.1]), np.array([0.5, 0.8])),
        (ConstantVelocity(0.3), np.array([1.0, -2.0, 0.5, 0.4]), None),
    ],
)
def test_samples_spread_as_Q_says(motion, x, u):
    """Each entry of the sample covariance of 40,000 draws against Q, at 4.5 standard errors: a false alarm in some
    10,000 seeds.  The noise is small enough for the arc to be straight over it."""
    n, dt = 40_000, 0.5
    draws = motion.sample(np.tile(x, (n, 1)), u, dt, np.random.default_rng(3))
    residual = np.subtract if u is None else pose_residual
    errors = residual(draws, motion.f(x, u, dt))
    Q = motion.Q(x, u, dt)
    standard_error = np.sqrt((Q**2 + np.outer(np.diag(Q), np.diag(Q))) / n)
    assert np.all(np.abs(errors.T @ errors / n - Q) < 4.5 * standard_error)
    assert np.all(np.abs(errors.mean(axis=0)) < 4.5 * np.sqrt(np.diag(Q) / n))


@pytest.mark.parametrize("drive", [DifferentialDrive(), SteadyNoiseDrive(), SlippingWheels(track=0.2, slip=0.1)])
def test_a_control_for_each_state_is_sampled_with_its_own_spread(drive):
    """The noise of SteadyNoiseDrive and SlippingWheels depends on the control; 4 % is six standard deviations."""
    controls, n = np.array([[0.5, 0.2], [0.1, -2.0]]), 50_000
    moved = drive.sample(np.zeros((2 * n, 3)), np.tile(controls, (n, 1)), 0.1, np.random.default_rng(0))
    for k, control in enumerate(controls):
        error = moved[k::2] - drive.f(np.zeros(3), control, 0.1)
        variances = np.diag(drive.Q(np.zeros(3), control, 0.1))
        assert np.allclose(error[:, [0, 2]].var(axis=0) / variances[[0, 2]], 1, atol=0.04)


def test_samples_of_the_drive_are_wrapped_and_leave_their_argument_alone():
    states = np.tile([0.0, 0.0, np.pi], (100, 1))
    before = states.copy()
    moved = DifferentialDrive(0.1, 2.0).sample(states, [0.0, 1.0], 1.0, np.random.default_rng(4))
    assert np.all((moved[:, 2] > -np.pi) & (moved[:, 2] <= np.pi)) and np.array_equal(states, before)


def test_a_drive_without_slip_has_noise_in_its_two_wheels_only():
    Q = DifferentialDrive(0.1, 0.2, (0.0, 0.0, 0.0)).Q([0.0, 0.0, 0.4], [0.7, 0.3], 0.5)
    assert np.linalg.matrix_rank(Q, tol=1e-12) == 2


def test_wheels_that_err_alike_give_the_noise_of_the_drive():
    rng = np.random.default_rng(5)
    radius, track, sigma = 0.25, 0.5, 0.05
    motion = DifferentialDrive.from_wheels(radius, track, sigma, sigma_pose=(0.0, 0.0, 0.0))
    right, left = sigma * rng.standard_normal((2, 100_000))
    assert np.std(radius * (right + left) / 2) == pytest.approx(motion.sigma_v, rel=0.02)
    assert np.std(radius * (right - left) / track) == pytest.approx(motion.sigma_omega, rel=0.02)


def test_constant_velocity_grows_the_same_in_one_step_as_in_ten():
    motion, P = ConstantVelocity(0.4), np.zeros((4, 4))
    for _ in range(10):
        F = motion.F(np.zeros(4), None, 0.13)
        P = F @ P @ F.T + motion.Q(np.zeros(4), None, 0.13)
    np.testing.assert_allclose(P, motion.Q(np.zeros(4), None, 1.3), atol=1e-14)


def test_pose_residuals_follow_a_chi_square_when_the_heading_straddles_pi():
    """NEES of poses drawn around θ = π, mean of 20,000 within 4 standard errors of 3: 1 false alarm in 16,000."""
    rng = np.random.default_rng(8)
    sigma, mean = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, np.pi - 0.05])
    draws = mean + rng.standard_normal((20_000, 3)) * sigma
    draws[:, 2] = wrap_angle(draws[:, 2])
    squares = np.sum((pose_residual(draws, mean) / sigma) ** 2, axis=1)
    assert abs(squares.mean() - chi2(3).mean()) < 4 * np.sqrt(6 / 20_000)


def test_slipping_wheels_are_the_robot_of_the_world():
    """The covariance of [v, ω] equals the one that the robot itself states, at rest, ahead, and turning."""
    robot = Robot()
    motion = SlippingWheels(track=robot.track, slip=robot.slip, tick=2 * np.pi * robot.wheel_radius / robot.ticks)
    for u in ([0.0, 0.0], [0.4, 0.0], [0.2, -1.3], [0.0, 0.7]):
        root = motion.root_M(u, 0.05)
        np.testing.assert_allclose(root @ root.T, robot.odometry_cov(*u, 0.05), rtol=1e-12, atol=1e-18)


def test_slipping_wheels_predict_where_the_worlds_robot_ends():
    """NEES of dead reckoning after 4 s of an S-curve in the physics, 60 runs: the mean of 60 χ²₃ values lies in
    (2.0, 4.2) but for 1 seed in 1,000.  Constant σ of the same size would not know that a turn slips more."""
    motion, squares = SlippingWheels(sigma_pose=(1e-4, 1e-4, 1e-4)), []
    for seed in range(60):
        world = World(Arena("nowhere"), seed)
        mean, P = world.pose, np.diag([1e-4, 1e-4, 1e-4]) ** 2
        for k in range(80):
            world.step(0.4, 0.9 if k < 40 else -0.9)
            F = motion.F(mean, world.odometry, world.dt)
            P = F @ P @ F.T + motion.Q(mean, world.odometry, world.dt)
            mean = motion.f(mean, world.odometry, world.dt)
        e = pose_residual(world.pose, mean)
        squares.append(e @ np.linalg.solve(P, e))
    assert 2.0 < np.mean(squares) < 4.2


@pytest.mark.parametrize("dt", [0.0, -0.1, np.nan, np.inf])
@pytest.mark.parametrize("motion", [DifferentialDrive(), SlippingWheels(), ConstantVelocity()])
@pytest.mark.parametrize("method", ["f", "F", "Q", "sample"])
def test_a_step_that_is_no_time_is_refused(motion, method, dt):
    x, u = (np.zeros(3), np.zeros(2)) if isinstance(motion, DifferentialDrive) else (np.zeros(4), None)
    arguments = (x[None], u, dt, np.random.default_rng(0)) if method == "sample" else (x, u, dt)
    with pytest.raises(ValueError, match="dt: expected a time step > 0 s"):
        getattr(motion, method)(*arguments)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: DifferentialDrive(-0.1), "standard deviations ≥ 0"),
        (lambda: DifferentialDrive(sigma_pose=(0.1, np.nan, 0.1)), "standard deviations ≥ 0"),
        (lambda: DifferentialDrive.from_wheels(0.25, 0.0, 0.05), "track > 0"),
        (lambda: ConstantVelocity(-1.0), "sigma_a"),
        (lambda: SlippingWheels(track=0.0), "track > 0"),
        (lambda: SlippingWheels(slip=-0.1), "slip ≥ 0"),
        (lambda: DifferentialDrive().f(np.zeros(4), np.zeros(2), 0.1), r"state: expected shape \(\.\.\., 3\)"),
        (lambda: DifferentialDrive().F(np.zeros((3, 2)), np.zeros(2), 0.1), r"state: expected shape \(\.\.\., 3\)"),
        (lambda: DifferentialDrive().f(np.zeros(3), np.zeros(3), 0.1), "control"),
        (lambda: DifferentialDrive().f([0.0, 0.0, np.nan], np.zeros(2), 0.1), "state: expected finite"),
        (lambda: DifferentialDrive().Q(np.zeros(3), [np.inf, 0.0], 0.1), "control .* expected finite"),
        (lambda: DifferentialDrive().f(np.full((5, 3), np.nan), np.zeros(2), 0.1), "state: expected finite"),
        (lambda: DifferentialDrive().sample(np.zeros((5, 3)), [0.1], 0.1, np.random.default_rng(0)), "control"),
        (lambda: DifferentialDrive().sample(np.zeros((5, 3)), 0.1, 0.1, np.random.default_rng(0)), "control"),
        (lambda: ConstantVelocity().f(np.zeros(3), None, 0.1), "state: expected shape"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: DifferentialDrive("small"), "sigma_v, sigma_omega: expected real numbers"),
        (lambda: ConstantVelocity("small"), "sigma_a: expected one real number"),
        (lambda: DifferentialDrive().f(np.zeros(3), np.zeros(2), "0.1"), "dt: expected a time step in seconds"),
        (lambda: DifferentialDrive().f(np.zeros(3), np.zeros(2), None), "dt: expected a time step in seconds"),
        (lambda: ConstantVelocity().F(np.zeros(4), None, np.array([0.1, 0.2])), "dt: expected a time step in seconds"),
        (lambda: DifferentialDrive().f("here", np.zeros(2), 0.1), "state: expected real numbers"),
    ],
)
def test_what_is_no_number_gets_a_sentence(call, message):
    with pytest.raises(TypeError, match=message):
        call()


@pytest.mark.parametrize("motion", [DifferentialDrive(), SlippingWheels(), ConstantVelocity()])
def test_a_step_in_single_precision_leaves_the_state_in_double(motion):
    x = np.array([1000.25, -2000.5, 3000.75, 1.0])[: 4 if isinstance(motion, ConstantVelocity) else 3]
    dt, u = np.float32(0.1), np.array([0.5, 0.3])
    for method in (motion.f, motion.F, motion.Q):
        np.testing.assert_array_equal(method(x, u, dt), method(x, u, float(dt)))
