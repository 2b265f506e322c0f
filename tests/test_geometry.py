import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from coursekit import geometry as g

metres = st.floats(-1e3, 1e3)
angles = st.floats(-50, 50)
poses = st.tuples(metres, metres, angles).map(np.array)
points = st.tuples(metres, metres).map(np.array)


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_lies_in_the_half_open_interval_and_points_the_same_way(angle):
    wrapped = g.wrap_angle(angle)
    assert -np.pi < wrapped <= np.pi
    np.testing.assert_allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-9)


@pytest.mark.parametrize("angle", [np.pi, -np.pi, 3 * np.pi, -5 * np.pi])
def test_odd_multiples_of_pi_wrap_to_plus_pi(angle):
    assert g.wrap_angle(angle) == pytest.approx(np.pi)
    assert g.wrap_angle(angle) > 0


@given(st.floats(-np.pi, np.pi, exclude_min=True))
def test_an_angle_already_inside_keeps_every_bit(angle):
    assert g.wrap_angle(angle) == angle


def test_wrapping_works_on_any_shape_and_passes_nan_on():
    wrapped = g.wrap_angle([[4.0, np.nan], [np.inf, -4.0]])
    assert wrapped.shape == (2, 2)
    np.testing.assert_array_equal(np.isnan(wrapped), [[False, True], [True, False]])


@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    left, right = g.compose(g.compose(a, b), c), g.compose(a, g.compose(b, c))
    np.testing.assert_allclose(left[:2], right[:2], atol=1e-8)
    np.testing.assert_allclose(g.wrap_angle(left[2] - right[2]), 0, atol=1e-9)


@given(poses)
def test_a_pose_composed_with_its_inverse_is_the_origin(a):
    for product in (g.compose(a, g.inverse(a)), g.compose(g.inverse(a), a)):
        np.testing.assert_allclose(product[:2], 0, atol=1e-8)
        np.testing.assert_allclose(np.sin(product[2] / 2), 0, atol=1e-9)


@given(poses, poses)
def test_between_undoes_compose(a, b):
    relative = g.between(a, g.compose(a, b))
    np.testing.assert_allclose(relative[:2], b[:2], atol=1e-8)
    np.testing.assert_allclose(g.wrap_angle(relative[2] - b[2]), 0, atol=1e-9)


@given(poses, points)
def test_transform_agrees_with_the_homogeneous_matrix(pose, point):
    np.testing.assert_allclose(g.transform(pose, point), (g.homogeneous(pose) @ [*point, 1.0])[:2], atol=1e-9)


@given(poses, poses, points)
def test_transforming_by_a_composition_is_transforming_twice(a, b, point):
    np.testing.assert_allclose(g.transform(g.compose(a, b), point), g.transform(a, g.transform(b, point)), atol=1e-8)


def test_one_quarter_turn_to_the_left_takes_ahead_to_left():
    np.testing.assert_allclose(g.transform([1, 2, np.pi / 2], [[3, 0], [0, 1]]), [[1, 5], [0, 2]], atol=1e-12)


def test_poses_and_clouds_broadcast():
    many = np.zeros((5, 1, 3))
    assert g.transform(many, np.ones((7, 2))).shape == (5, 7, 2)
    assert g.compose(np.zeros((4, 3)), np.zeros(3)).shape == (4, 3)


@given(st.tuples(angles, angles, angles).map(np.array))
def test_so3_exp_agrees_with_scipy(w):
    np.testing.assert_allclose(g.so3_exp(w), Rotation.from_rotvec(w).as_matrix(), atol=1e-9)


@given(st.tuples(*[st.floats(-1.7, 1.7)] * 3).map(np.array))
def test_so3_log_undoes_exp(w):
    np.testing.assert_allclose(g.so3_log(g.so3_exp(w)), w, atol=1e-7)


def test_a_reflection_is_no_rotation():
    assert g.is_rotation(np.eye(3))
    assert not g.is_rotation(np.diag([1.0, 1.0, -1.0]))
    assert not g.is_rotation(np.full((2, 2), np.nan))


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        (g.compose, ([1, 2], [0, 0, 0])),
        (g.inverse, (3.0,)),
        (g.transform, ([0, 0, 0], [1, 2, 3])),
        (g.so3_exp, ([1, 2],)),
        (g.so3_log, (2 * np.eye(3),)),
    ],
)
def test_wrong_shapes_are_refused_with_what_was_expected(function, arguments):
    with pytest.raises(ValueError, match="expected"):
        function(*arguments)


@pytest.mark.parametrize("shape", [(2, 3), (3, 3), (1, 3)])
def test_a_homogeneous_matrix_is_of_one_pose(shape):
    with pytest.raises(ValueError, match="pose: expected one pose"):
        g.homogeneous(np.zeros(shape))
