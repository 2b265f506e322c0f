"""Every Jacobian of the package, found by its name and compared with finite differences: none goes unchecked."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import coursekit
from coursekit import pinhole
from coursekit.geometry import wrap_angle
from coursekit.labs.lab09.localisation import CalibratingDrive, CalibratingRangeBearing
from coursekit.models import (
    ConstantVelocity,
    DifferentialDrive,
    Position,
    RangeBearing,
    RangeOnly,
    ScaledRange,
    SlippingWheels,
    SteadyNoiseDrive,
    WithConstants,
    checks,
)
from coursekit.noise import calibrated
from coursekit.world import tags

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
NOT_DERIVATIVES = {"M", "Q", "R"}
# A lab's failures are wrong on purpose; its scenes and exercises hold no models.
LABS = re.compile(r"coursekit\.labs\.lab\d\d\.(?!localisation)")


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


def _slipping_wheels(rng):
    return _differential_drive(rng)._replace(instance=SlippingWheels())


def _steady_noise_drive(rng):
    return _differential_drive(rng)._replace(instance=SteadyNoiseDrive())


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


def _calibrated(rng):
    rest = (rng.uniform(1.0, 9.0), rng.uniform(-0.5, 0.5), rng.uniform(-1, 1), rng.uniform(-1, 1), 12.0)
    return FunctionExample(
        lambda x: calibrated._now(x, *map(np.asarray, rest[:4]), rest[4]),
        lambda x: calibrated._now_jacobian(x, *map(np.asarray, rest[:4]), rest[4]),
        rng.normal([0.17, 0.004, 0.0, 0.0, 0.05, 0.04], [0.02, 0.002, 0.02, 0.01, 0.02, 0.02]),
    )


def _calibrating_state(rng):
    low = [0.7, 0.7, -0.2, 0.0, -0.3, -0.2, -0.1]  # κ, λ, b, p, δ, γ, β
    return np.array([*_pose(rng), *rng.uniform(low, [1.3, 1.3, 0.2, 1.0, 0.5, 0.2, 0.1])])


def _calibrating_drive(rng):
    """Twenty commands, some of them to stand or to go straight ahead; the step may begin before the first of them."""
    commands = rng.uniform(-1, 1, (20, 2)) * (rng.random((20, 2)) < 0.8)
    drive = CalibratingDrive(np.column_stack([np.cumsum(rng.uniform(0.01, 0.5, 20)), commands]))
    return Example(drive, (_calibrating_state(rng), rng.uniform(-1, 6), rng.uniform(0.01, 1)))


def _calibrating_camera(rng):
    state = _calibrating_state(rng)
    bearing, r = rng.uniform(-1.2, 1.2), rng.uniform(0.5, 8)
    direction = state[2] + bearing
    landmark = state[:2] + r * np.array([np.cos(direction), np.sin(direction)])
    return Example(CalibratingRangeBearing(landmark), (state,))


def _scaled_range(rng):
    """Scale, offset, both, in any order of the state."""
    state, order = rng.uniform(-5, 5, 5), rng.permutation(5).tolist()
    scale, offset = [(order[2], None), (None, order[3]), (order[2], order[3])][rng.integers(3)]
    landmark = _landmark_in_sight(rng, state[order[:2]])
    return Example(ScaledRange(landmark, position=tuple(order[:2]), scale=scale, offset=offset), (state,))


def _with_constants(rng):
    _, (pose, control, dt) = _differential_drive(rng)
    return Example(WithConstants(DifferentialDrive(), (0.1, 0.0)), (np.append(pose, rng.normal(size=2)), control, dt))


def _tag(rng):
    size = rng.uniform(0.05, 0.5)
    return FunctionExample(
        lambda tag: tags.tag_corners(tag, size),
        lambda tag: tags.tag_corners_jacobian(tag, size).reshape(12, 4),
        rng.uniform([-2, -2, 0, -np.pi], [2, 2, 1, np.pi]),
    )


EXAMPLES: dict[str, Callable[[np.random.Generator], Example | FunctionExample]] = {
    "coursekit.labs.lab09.localisation.instruments.CalibratingDrive.f": _calibrating_drive,
    "coursekit.labs.lab09.localisation.instruments.CalibratingRangeBearing.h": _calibrating_camera,
    "coursekit.models.unknowns.ScaledRange.h": _scaled_range,
    "coursekit.models.unknowns.WithConstants.f": _with_constants,
    "coursekit.pinhole.range_bearing": _pinhole,
    "coursekit.noise.calibrated._now": _calibrated,
    "coursekit.world.tags.tag_corners": _tag,
    "coursekit.pinhole.Camera.project": lambda rng: Example(
        pinhole.COURSE_CAMERA, (rng.uniform([0.5, -2, -2], [8, 2, 2]),)
    ),
    "coursekit.models.motion.DifferentialDrive.f": _differential_drive,
    "coursekit.models.motion.SlippingWheels.f": _slipping_wheels,
    "coursekit.models.steady.SteadyNoiseDrive.f": _steady_noise_drive,
    "coursekit.models.motion.ConstantVelocity.f": lambda rng: Example(
        ConstantVelocity(), (rng.normal(0, 3, 4), None, rng.uniform(0.01, 2))
    ),
    "coursekit.models.sensors.RangeBearing.h": _range_bearing,
    "coursekit.models.sensors.RangeBearing.g": _inverse_range_bearing,
    "coursekit.models.sensors.RangeOnly.h": _range_only,
    "coursekit.models.sensors.Position.h": lambda rng: Example(
        Position(position=tuple(rng.permutation(4)[:2].tolist())), (rng.normal(0, 3, 4),)
    ),
}


def modules():
    yield coursekit
    for found in pkgutil.walk_packages(coursekit.__path__, "coursekit."):
        if not LABS.match(found.name):
            yield importlib.import_module(found.name)


def classes_with_models():
    """Every concrete class of the package with an f, h or g of its own, and every one with a ``*_jacobian``."""
    for module in modules():
        for _, cls in inspect.getmembers(module, inspect.isclass):
            concrete = cls.__module__ == module.__name__ and not getattr(cls, "_is_protocol", False)
            if concrete and any(name in "fgh" or name.endswith("_jacobian") for name in dir(cls)):
                yield cls


def jacobians():
    """(class, name of the Jacobian) for every method that is one, and (module, name) for every ``*_jacobian``."""
    for cls in classes_with_models():
        for name in dir(cls):
            if re.fullmatch(r"[A-Z](_?[a-z]\w*)?|.*_jacobian", name) and callable(getattr(cls, name)):
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
    if name.endswith("_jacobian"):
        function_name, slot = name.removesuffix("_jacobian"), 0
    else:
        assert name in DERIVATIVE_OF, f"{owner.__name__}.{name}: say in DERIVATIVE_OF what it is the derivative of"
        function_name, slot = DERIVATIVE_OF[name]
    where = owner.__name__ if inspect.ismodule(owner) else f"{owner.__module__}.{owner.__name__}"
    path = f"{where}.{function_name}"
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


def test_models_that_filters_trust_answer_what_filters_need():
    """Each class marked as right by construction, at 100 random states: shapes, floats, and no variance below 0."""
    rng = np.random.default_rng(2)
    for cls in sorted(checks._RIGHT, key=lambda cls: cls.__name__):
        make = EXAMPLES.get(f"{cls.__module__}.{cls.__name__}.{'f' if hasattr(cls, 'f') else 'h'}")
        assert make is not None, f"{cls.__name__} is trusted, and no example shows why"
        for _ in range(100):
            model, (x, *rest) = make(rng)
            if hasattr(cls, "f"):
                f, F, Q = model.f(x, *rest), model.F(x, *rest), model.Q(x, *rest)
                answers = {"f": (f, x.shape), "F": (F, x.shape * 2), "Q": (Q, x.shape * 2)}
                np.testing.assert_array_equal(Q, checks._semidefinite(Q))
            else:
                h, H = model.h(x), model.H(x)
                answers = {"h": (h, h.shape), "H": (H, (h.size, x.size)), "residual": (model.residual(h, h), h.shape)}
                assert h.shape == model.R.shape[:1]
            for name, (answer, shape) in answers.items():
                np.testing.assert_array_equal(checks.array_of(answer, name, shape), answer)
                assert type(answer) is np.ndarray and answer.dtype == float
