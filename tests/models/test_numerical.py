"""Jacobians by differences agree with the formulas, also across ±π and for many states at once."""

import pickle

import numpy as np
import pytest

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.models import DifferentialDrive, Numerical, RangeBearing, RangeOnly, jacobian, pose_residual
from coursekit.models.range_bearing import residual

RNG = np.random.default_rng(5)
POSES = np.column_stack([RNG.uniform(-5, 5, (100, 2)), RNG.uniform(-np.pi, np.pi, 100)])
POSES[0, 2], POSES[1, 2] = np.pi, -np.pi + 1e-9  # where a bare minus would see a jump of 2π


class Bare:
    """A model's f or h and what else it has, without its Jacobian."""

    def __init__(self, model):
        self.parts = {name: getattr(model, name) for name in ("f", "Q", "h", "R", "residual") if hasattr(model, name)}

    def __getattr__(self, name):
        if name == "parts" or name not in self.parts:
            raise AttributeError(name)
        return self.parts[name]


def test_differences_agree_with_the_formulas_of_the_models():
    """To 1e-8 of what is there: 100 poses, some at the seam of the heading."""
    drive, u = DifferentialDrive(), np.array([0.7, -1.1])
    numerical = Numerical(Bare(drive), pose_residual)
    for pose in POSES:
        np.testing.assert_allclose(numerical.F(pose, u, 0.3), drive.F(pose, u, 0.3), atol=1e-8)
        for sensor in (RangeBearing([7.0, 1.0]), RangeOnly([7.0, 1.0], position=(0, 1))):
            np.testing.assert_allclose(Numerical(Bare(sensor)).H(pose), sensor.H(pose), atol=1e-8)


def test_of_many_states_each_gets_its_own():
    sensor = RangeBearing([7.0, 1.0])
    np.testing.assert_allclose(jacobian(sensor.h, POSES, residual), sensor.H(POSES), atol=1e-8)
    np.testing.assert_allclose(Numerical(Bare(sensor)).H(POSES), sensor.H(POSES), atol=1e-8)


def test_a_bare_minus_across_the_seam_is_off_by_a_million():
    sensor, behind = RangeBearing([-1.0, 0.0]), np.array([0.0, 0.0, 0.0])  # a bearing of π
    assert np.abs(jacobian(sensor.h, behind)).max() > 1e4
    np.testing.assert_allclose(jacobian(sensor.h, behind, residual), sensor.H(behind), atol=1e-8)


def test_a_large_state_gets_a_large_step():
    """∂(x²)/∂x at 10⁶ to nine digits; a step of 6e-6 for all would leave four."""
    assert jacobian(lambda x: x**2, [1e6])[0, 0] == pytest.approx(2e6, rel=1e-9)


def test_a_filter_with_differences_is_the_filter_with_formulas():
    drive, sensor = DifferentialDrive(), RangeBearing([4.0, 2.0])
    a = b = Gaussian([0.0, 0.0, 3.0], np.diag([0.1, 0.1, 0.05]) ** 2)
    for k in range(20):
        a, b = (
            ekf.predict(belief, motion, [0.5, 0.4], 0.2)
            for belief, motion in ((a, drive), (b, Numerical(Bare(drive), pose_residual)))
        )
        z = [4.0 + 0.01 * k, -2.8]
        a, b = ekf.correct(a, sensor, z).belief, ekf.correct(b, Numerical(Bare(sensor)), z).belief
    np.testing.assert_allclose(pose_residual(b.mean, a.mean), 0.0, atol=1e-7)
    np.testing.assert_allclose(b.cov, a.cov, atol=1e-8)


def test_a_numerical_model_can_be_pickled():
    sensor = pickle.loads(pickle.dumps(Numerical(RangeBearing([4.0, 2.0]))))
    np.testing.assert_allclose(sensor.H(POSES[5]), RangeBearing([4.0, 2.0]).H(POSES[5]), atol=1e-8)


def test_what_is_wrong_is_said():
    with pytest.raises(ValueError, match="x: expected finite"):
        jacobian(np.sin, [np.nan])
    with np.errstate(invalid="ignore"), pytest.raises(ValueError, match="function: expected finite"):
        jacobian(np.sqrt, [0.0])
    with pytest.raises(TypeError, match="model: expected a model with f, h"):
        Numerical(object())
    with pytest.raises(TypeError, match=r"sensor: .* has no h"):
        ekf.correct(Gaussian(np.zeros(3), np.eye(3)), Numerical(Bare(DifferentialDrive())), [1.0])
