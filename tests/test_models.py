"""Motion and sensor models.  Jacobians are found by name, in the whole package, and none goes unchecked."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import chi2

import coursekit
from coursekit import pinhole
from coursekit.geometry import wrap_angle
from coursekit.models import ConstantVelocity, DifferentialDrive, Position, RangeBearing, RangeOnly, pose_residual

# --- Every Jacobian, found automatically ---------------------------------------------------------------------------
# A method named on the left is the derivative of the one named second, in its argument of that number; the
# landmark of a sensor is not an argument but a field.
DERIVATIVE_OF: dict[str, tuple[str, int | str]] = {
    "F": ("f", 0),
    "G": ("f", 1),
    "H": ("h", 0),
    "H_landmark": ("h", "landmark"),
    "Gx": ("g", 0),
    "Gz": ("g", 1),
}
NOT_DERIVATIVES = {"Q", "R"}
# Exhibits are wrong on purpose; scenes and exercises hold no models.
ELSEWHERE = ("coursekit.failures", "coursekit.scenes", "coursekit.exercises")


class Example(NamedTuple):
    """instance: what owns f, h or g; arguments: what they get."""

    instance: Any
    arguments: tuple


class FunctionExample(NamedTuple):
    """A plain function beside its ``*_jacobian``, both made functions of one vector, and the vector."""

    function: Callable
    jacobian: Callable
    x: np.ndarray


def _pose(rng):
    return rng.uniform([-5, -5, -np.pi], [5, 5, np.pi])


def _landmark_in_sight(rng, pose):
    distance, direction = rng.uniform(0.5, 10), rng.uniform(-np.pi, np.pi)
    return pose[:2] + distance * np.array([np.cos(direction), np.sin(direction)])


def _differential_drive(rng):
    # One control in five goes straight ahead, where v/ω would be 0/0.
    control = np.array([rng.uniform(-1, 1), rng.choice([0.0, rng.uniform(-3, 3), 1e-4, rng.uniform(-3, 3), -2e-3])])
    return Example(DifferentialDrive(*rng.uniform(0.01, 0.2, 2)), (_pose(rng), control, rng.uniform(0.01, 1)))


def _range_bearing(rng):
    pose = _pose(rng)
    return Example(RangeBearing(_landmark_in_sight(rng, pose)), (pose,))


def _inverse_range_bearing(rng):
    return Example(RangeBearing, (_pose(rng), rng.uniform([0.3, -np.pi], [10, np.pi])))


def _range_only(rng):
    state, position = rng.uniform(-5, 5, 4), tuple(rng.permutation(4)[:2].tolist())
    landmark = _landmark_in_sight(rng, state[list(position)])
    return Example(RangeOnly(landmark, position=position), (state,))


def _pinhole(rng):
    rest = (pinhole.COURSE_CAMERA, 0.5, rng.uniform(0, 0.2), rng.uniform(0, 0.2))
    return FunctionExample(
        lambda x: pinhole.range_bearing(*x, *rest),
        lambda x: pinhole.range_bearing_jacobian(*x, *rest),
        rng.uniform([20, 20], [300, 620]),
    )


EXAMPLES: dict[str, Callable[[np.random.Generator], Example | FunctionExample]] = {
    "coursekit.pinhole.range_bearing": _pinhole,
    "coursekit.models.DifferentialDrive.f": _differential_drive,
    "coursekit.models.ConstantVelocity.f": lambda rng: Example(
        ConstantVelocity(), (rng.normal(0, 3, 4), None, rng.uniform(0.01, 2))
    ),
    "coursekit.models.RangeBearing.h": _range_bearing,
    "coursekit.models.RangeBearing.g": _inverse_range_bearing,
    "coursekit.models.RangeOnly.h": _range_only,
    "coursekit.models.Position.h": lambda rng: Example(
        Position(position=tuple(rng.permutation(4)[:2].tolist())), (rng.normal(0, 3, 4),)
    ),
}


def modules():
    yield coursekit
    for found in pkgutil.walk_packages(coursekit.__path__, "coursekit."):
        if not found.name.startswith(ELSEWHERE):
            yield importlib.import_module(found.name)


def classes_with_models():
    """Every concrete class of the package with an f, h or g of its own."""
    for module in modules():
        for _, cls in inspect.getmembers(module, inspect.isclass):
            concrete = cls.__module__ == module.__name__ and not getattr(cls, "_is_protocol", False)
            if concrete and any(callable(getattr(cls, name, None)) for name in "fgh"):
                yield cls


def jacobians():
    """(class, name of the Jacobian) for every method that is one, and (module, name) for every ``*_jacobian``."""
    for cls in classes_with_models():
        for name in dir(cls):
            if re.fullmatch(r"[A-Z](_?[a-z]\w*)?", name) and callable(getattr(cls, name)):
                yield cls, name
    for module in modules():
        for name, function in inspect.getmembers(module, inspect.isfunction):
            if name.endswith("_jacobian") and function.__module__ == module.__name__:
                yield module, name


def central_difference(function, x, step=1e-6):
    x = np.asarray(x, dtype=float)
    columns = []
    for i in range(x.size):
        e = np.zeros(x.size)
        e[i] = step
        # A difference this small never is 2π for any reason but a wrapped angle.
        columns.append(np.ravel(wrap_angle(np.asarray(function(x + e)) - np.asarray(function(x - e)))) / (2 * step))
    return np.stack(columns, axis=-1)


FOUND = [(owner, name) for owner, name in jacobians() if name not in NOT_DERIVATIVES]


@pytest.mark.parametrize(("owner", "name"), FOUND, ids=[f"{owner.__name__}.{name}" for owner, name in FOUND])
def test_every_jacobian_in_the_package_agrees_with_finite_differences(owner, name):
    if inspect.ismodule(owner):
        function_name, slot = name.removesuffix("_jacobian"), 0
        path = f"{owner.__name__}.{function_name}"
    else:
        assert name in DERIVATIVE_OF, f"{owner.__name__}.{name}: say in DERIVATIVE_OF what it is the derivative of"
        function_name, slot = DERIVATIVE_OF[name]
        path = f"{owner.__module__}.{owner.__name__}.{function_name}"
    assert path in EXAMPLES, f"{path} has a Jacobian that nobody checks: give it an entry in EXAMPLES"
    rng = np.random.default_rng(1)
    for _ in range(200):
        example = EXAMPLES[path](rng)
        if isinstance(example, FunctionExample):
            expected, got = central_difference(example.function, example.x), example.jacobian(example.x)
        elif slot == "landmark":
            instance, arguments = example
            expected = central_difference(lambda point: type(instance)(point).h(*arguments), instance.landmark)  # noqa: B023
            got = getattr(instance, name)(*arguments)
        else:
            instance, arguments = example

            def moved(value, instance=instance, arguments=arguments):
                return getattr(instance, function_name)(*arguments[:slot], value, *arguments[slot + 1 :])

            expected, got = central_difference(moved, arguments[slot]), getattr(instance, name)(*arguments)
        assert got.shape == expected.shape
        np.testing.assert_allclose(got, expected, rtol=1e-6, atol=1e-6)


def test_the_finder_knows_the_models_of_the_contract():
    found = {f"{owner.__name__}.{name}" for owner, name in FOUND}
    assert {
        "DifferentialDrive.F",
        "DifferentialDrive.G",
        "ConstantVelocity.F",
        "RangeBearing.H",
        "RangeOnly.H",
    } <= found
    assert {"Position.H", "RangeBearing.Gx", "RangeBearing.Gz", "RangeBearing.H_landmark"} <= found


# --- Motion --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("control", [(0.4, 0.9), (0.4, 0.0), (-0.3, 1e-5), (0.0, 2.0), (0.5, -30.0)])
def test_the_robot_runs_along_the_arc_that_integration_gives(control):
    v, omega = control
    path = solve_ivp(
        lambda t, x: [v * np.cos(x[2]), v * np.sin(x[2]), omega], (0, 0.7), [1.0, 2.0, 0.3], rtol=1e-11, atol=1e-12
    )
    got = DifferentialDrive().f([1.0, 2.0, 0.3], control, 0.7)
    np.testing.assert_allclose(pose_residual(got, path.y[:, -1]), 0, atol=1e-9)


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


@pytest.mark.parametrize(
    ("motion", "x", "u"),
    [
        (DifferentialDrive(0.02, 0.03, (2e-3, 1e-3, 1e-3)), np.array([1.0, -2.0, 3.1]), np.array([0.5, 0.8])),
        (ConstantVelocity(0.3), np.array([1.0, -2.0, 0.5, 0.4]), None),
    ],
)
def test_samples_spread_as_Q_says(motion, x, u):
    """Each entry of the sample covariance of 40,000 draws against Q, at 4.5 standard errors: a false alarm in some
    10,000 seeds.  The noise is small enough for the arc to be straight over it."""
    n, dt = 40_000, 0.5
    draws = motion.sample(np.tile(x, (n, 1)), u, dt, np.random.default_rng(3))
    residual = pose_residual if isinstance(motion, DifferentialDrive) else np.subtract
    errors = residual(draws, motion.f(x, u, dt))
    Q = motion.Q(x, u, dt)
    standard_error = np.sqrt((Q**2 + np.outer(np.diag(Q), np.diag(Q))) / n)
    assert np.all(np.abs(errors.T @ errors / n - Q) < 4.5 * standard_error)
    assert np.all(np.abs(errors.mean(axis=0)) < 4.5 * np.sqrt(np.diag(Q) / n))


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
    motion = DifferentialDrive.from_wheels(radius, track, sigma, sigma_slip=(0.0, 0.0, 0.0))
    right, left = sigma * rng.standard_normal((2, 100_000))
    assert np.std(radius * (right + left) / 2) == pytest.approx(motion.sigma_v, rel=0.02)
    assert np.std(radius * (right - left) / track) == pytest.approx(motion.sigma_omega, rel=0.02)


def test_constant_velocity_grows_the_same_in_one_step_as_in_ten():
    motion, P = ConstantVelocity(0.4), np.zeros((4, 4))
    for _ in range(10):
        F = motion.F(np.zeros(4), None, 0.13)
        P = F @ P @ F.T + motion.Q(np.zeros(4), None, 0.13)
    np.testing.assert_allclose(P, motion.Q(np.zeros(4), None, 1.3), atol=1e-14)


# --- Sensors -------------------------------------------------------------------------------------------------------
def test_bearing_residual_is_small_across_pi():
    sensor = RangeBearing([-3.0, 0.0])
    z, z_hat = sensor.h([0.0, 0.01, 0.0]), sensor.h([0.0, -0.01, 0.0])
    assert abs(z[1] - z_hat[1]) > 6
    assert abs(sensor.residual(z, z_hat)[1]) < 0.01


def test_the_inverse_measurement_undoes_the_measurement():
    rng = np.random.default_rng(6)
    for _ in range(100):
        pose = _pose(rng)
        landmark = _landmark_in_sight(rng, pose)
        np.testing.assert_allclose(RangeBearing.g(pose, RangeBearing(landmark).h(pose)), landmark, atol=1e-12)


def test_many_poses_see_what_each_would_alone():
    rng = np.random.default_rng(7)
    poses = rng.normal(0, 3, (2, 30, 3))
    for sensor in (RangeBearing([1.0, 2.0]), RangeOnly([1.0, 2.0], position=(0, 1)), Position()):
        together = sensor.h(poses)
        np.testing.assert_allclose(together[1, 4], sensor.h(poses[1, 4]), atol=1e-14)
        residuals = sensor.residual(together, sensor.h(poses[0, 0]))
        np.testing.assert_allclose(residuals[1, 4], sensor.residual(together[1, 4], sensor.h(poses[0, 0])), atol=1e-14)
    z = rng.uniform([1, -3], [5, 3], (30, 2))
    np.testing.assert_allclose(RangeBearing.g(poses[0], z)[3], RangeBearing.g(poses[0, 3], z[3]), atol=1e-14)
    np.testing.assert_allclose(RangeBearing.g(poses[0, 0], z)[3], RangeBearing.g(poses[0, 0], z[3]), atol=1e-14)


def test_pose_residuals_follow_a_chi_square_when_the_heading_straddles_pi():
    """NEES of poses drawn around θ = π, mean of 20,000 within 4 standard errors of 3: 1 false alarm in 16,000."""
    rng = np.random.default_rng(8)
    sigma, mean = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, np.pi - 0.05])
    draws = mean + rng.standard_normal((20_000, 3)) * sigma
    draws[:, 2] = wrap_angle(draws[:, 2])
    squares = np.sum((pose_residual(draws, mean) / sigma) ** 2, axis=1)
    assert abs(squares.mean() - chi2(3).mean()) < 4 * np.sqrt(6 / 20_000)


# --- Bad input -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("dt", [0.0, -0.1, np.nan, np.inf])
@pytest.mark.parametrize("motion", [DifferentialDrive(), ConstantVelocity()])
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
        (lambda: DifferentialDrive(sigma_slip=(0.1, np.nan, 0.1)), "standard deviations ≥ 0"),
        (lambda: DifferentialDrive.from_wheels(0.25, 0.0, 0.05), "track > 0"),
        (lambda: ConstantVelocity(-1.0), "sigma_a"),
        (lambda: DifferentialDrive().f(np.zeros(4), np.zeros(2), 0.1), r"state: expected shape \(\.\.\., 3\)"),
        (lambda: DifferentialDrive().F(np.zeros((2, 3)), np.zeros(2), 0.1), r"state: expected shape \(3,\)"),
        (lambda: DifferentialDrive().f(np.zeros(3), np.zeros(3), 0.1), "control"),
        (lambda: DifferentialDrive().f([0.0, 0.0, np.nan], np.zeros(2), 0.1), "state: expected finite"),
        (lambda: DifferentialDrive().Q(np.zeros(3), [np.inf, 0.0], 0.1), "control .* expected finite"),
        (lambda: DifferentialDrive().f(np.full((5, 3), np.nan), np.zeros(2), 0.1), "state: expected finite"),
        (lambda: ConstantVelocity().f(np.zeros(3), None, 0.1), "state: expected shape"),
        (lambda: RangeBearing([1.0, 2.0, 3.0]), "landmark"),
        (lambda: RangeBearing([1.0, np.nan]), "landmark"),
        (lambda: RangeBearing([1.0, 2.0], -np.eye(2)), "R: expected a positive definite"),
        (lambda: RangeBearing([1.0, 2.0], np.eye(3)), "R: expected shape"),
        (lambda: RangeBearing([1.0, 2.0], [[1.0, 0.5], [0.0, 1.0]]), "R: expected a symmetric"),
        (lambda: RangeBearing([1.0, 2.0]).H([1.0, 2.0, 0.3]), "no derivative"),
        (lambda: RangeBearing([1.0, 2.0]).residual([1.0], [1.0, 2.0]), "z .* expected shape"),
        (lambda: RangeBearing.g(np.zeros(3), [1.0, np.nan]), "z .* expected finite"),
        (lambda: RangeOnly([1.0, 2.0]).h(np.zeros(2)), "state: expected shape"),
        (lambda: RangeOnly([1.0, 2.0]).H([1.0, 0.0, 2.0, 0.0]), "no derivative"),
        (lambda: RangeOnly([1.0, 2.0], np.zeros((1, 1))), "R: expected a positive definite"),
        (lambda: Position(np.eye(3)), "R: expected shape"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_a_sensor_keeps_its_landmark_and_noise_to_itself():
    landmark, R = np.array([1.0, 2.0]), np.eye(2)
    sensor = RangeBearing(landmark, R)
    landmark[0], R[0, 0] = 9.0, 9.0
    assert sensor.landmark[0] == 1.0 and sensor.R[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        sensor.R[0, 0] = 2.0
