import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import least_squares
from scipy.stats import norm

from coursekit import geometry
from coursekit.icp import KERNELS, DegenerateGeometry, move, point_to_plane, point_to_point
from tests.icp.clouds import motion


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), d=st.sampled_from([2, 3]), angle=st.floats(0, np.pi), far=st.floats(0, 1e3))
def test_exact_pairs_give_the_motion_back_whatever_its_size(seed, d, angle, far):
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(20, d)) + far
    T = motion(d, angle, far, np.zeros(d), rng)
    assert point_to_point(p, move(T, p)) == pytest.approx(T, abs=1e-11 * (1 + far))


def cost(T, p, q, w=1.0):
    return np.sum(w * np.sum((q - move(T, p)) ** 2, axis=1))


@pytest.mark.parametrize("d", [2, 3])
def test_no_other_motion_fits_noisy_pairs_better(d):
    rng = np.random.default_rng(1)
    p, w = rng.normal(size=(30, d)), rng.uniform(0.1, 2, 30)
    q = move(motion(d, 0.7, 2.0, np.zeros(d), rng), p) + rng.normal(0, 0.3, p.shape)
    best = point_to_point(p, q, w)
    for _ in range(200):
        nearby = motion(d, rng.normal(0, 1e-3), rng.normal(0, 1e-3), q.mean(axis=0), rng) @ best
        assert cost(nearby, p, q, w) > cost(best, p, q, w)


@pytest.mark.parametrize("d", [2, 3])
def test_where_a_mirror_fits_best_the_answer_is_still_the_best_rotation(d):
    """The reflection case: where a cloud is flatter than its noise, the best orthogonal matrix is a mirror."""
    rng, mirrors = np.random.default_rng(2), 0
    for _ in range(40):
        p = rng.normal(size=(12, d)) * [1.0, 0.7, 0.02][3 - d :]
        q = p * ([1, 1, -1] if d == 3 else [1, -1])
        q = q + rng.normal(0, 0.01, q.shape)
        T = point_to_point(p, q)
        U, _, Vt = np.linalg.svd((q - q.mean(axis=0)).T @ (p - p.mean(axis=0)))
        mirrors += np.linalg.det(U @ Vt) < 0
        assert geometry.is_rotation(T[:d, :d], tolerance=1e-12)
        for _ in range(20):
            turned = motion(d, rng.uniform(0, np.pi), 0.0, q.mean(axis=0), rng) @ T
            assert cost(turned, p, q) >= cost(T, p, q) - 1e-12
    assert mirrors > 20  # the case did arise


def test_flat_clouds_in_space_determine_their_rotation():
    rng = np.random.default_rng(3)
    p = np.column_stack([rng.normal(size=(30, 2)), np.zeros(30)])
    T = motion(3, 2.5, 1.0, np.zeros(3), rng)
    assert point_to_point(p, move(T, p)) == pytest.approx(T, abs=1e-12)


def test_weights_count_pairs_and_a_weight_of_zero_removes_one():
    rng = np.random.default_rng(4)
    p, q = rng.normal(size=(2, 10, 3))
    twice = point_to_point(np.vstack([p, p[:3]]), np.vstack([q, q[:3]]))
    assert point_to_point(p, q, np.r_[[2.0] * 3, [1.0] * 7]) == pytest.approx(twice)
    assert point_to_point(p, q, np.r_[0.0, np.ones(9)]) == pytest.approx(point_to_point(p[1:], q[1:]))


LINE = np.linspace(0, 1, 20)[:, None] * [1.0, 2.0, -1.0]
SQUARE = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])


@pytest.mark.parametrize(
    ("p", "q"),
    [
        pytest.param(LINE, LINE + 5.0, id="a line in space"),
        pytest.param(np.full((9, 3), 0.3), np.random.default_rng(0).normal(size=(9, 3)), id="one point"),
        pytest.param(np.random.default_rng(0).normal(size=(9, 2)), np.full((9, 2), 0.3), id="onto one point"),
        pytest.param(np.zeros((9, 3)), np.zeros((9, 3)), id="zeros"),
        pytest.param(SQUARE, SQUARE * [1, -1], id="a square and its mirror image"),
        pytest.param(SQUARE, SQUARE[[0, 0, 2, 2]] * 0 + [1, 0], id="a square onto one corner"),
    ],
)
def test_pairs_that_leave_the_rotation_open_say_so(p, q):
    with pytest.raises(DegenerateGeometry, match="do not determine the rotation"):
        point_to_point(p, q)


@pytest.mark.parametrize("d", [2, 3])
def test_steps_onto_planes_end_where_a_general_solver_ends(d):
    rng = np.random.default_rng(5)
    p, normals = rng.normal(size=(60, d)), rng.normal(size=(60, d))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    q = move(motion(d, 0.3, 0.2, np.zeros(d), rng), p) + rng.normal(0, 0.01, p.shape)

    def residual(x):
        R = geometry.rotation(x[2]) if d == 2 else geometry.so3_exp(x[3:])
        return np.sum((q - p @ R.T - x[:d]) * normals, axis=1)

    oracle = least_squares(residual, np.zeros(3 if d == 2 else 6), xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    T = np.eye(d + 1)
    for _ in range(30):
        T = point_to_plane(move(T, p), q, normals) @ T
    assert T[:d, d] == pytest.approx(oracle[:d], abs=1e-9)
    R = geometry.rotation(oracle[2]) if d == 2 else geometry.so3_exp(oracle[3:])
    assert T[:d, :d] == pytest.approx(R, abs=1e-9)
    assert geometry.is_rotation(T[:d, :d], tolerance=1e-12)


def test_a_step_onto_parallel_planes_does_not_slide_along_them():
    rng = np.random.default_rng(6)
    p = rng.uniform(-1, 1, (50, 2))
    q = p + np.array([0.5, 0.1]) + rng.normal(0, 0.01, p.shape)
    T = point_to_plane(p, q, np.tile([0.0, 1.0], (50, 1)))
    assert T[1, 2] == pytest.approx(0.1, abs=0.01)
    assert abs(T[0, 2]) < 1e-2


def test_damping_holds_a_step_back_by_a_thousandth_where_normals_point_every_way():
    shift = np.array([0.02, -0.01])
    T = point_to_plane(SQUARE, SQUARE + shift, SQUARE / np.sqrt(2))
    assert T[:2, 2] == pytest.approx(shift / 1.001, rel=1e-9)


def test_a_step_onto_planes_from_one_point_says_that_the_rotation_is_open():
    with pytest.raises(DegenerateGeometry):
        point_to_plane(np.ones((5, 3)), np.zeros((5, 3)), np.tile([0, 0, 1.0], (5, 1)))


@pytest.mark.parametrize("name", sorted(KERNELS))
def test_kernels_trust_near_pairs_and_keep_95_per_cent_of_the_information_in_gaussian_noise(name):
    weight = KERNELS[name]
    u = np.linspace(0, 20, 400)
    assert weight(u[:1]) == 1 and np.all(np.diff(weight(u)) <= 0) and np.all(weight(u) >= 0)

    def psi(x):
        return x * float(weight(np.array(abs(x))))

    # Efficiency of an M-estimator of location: E[ψ']² / E[ψ²] with unit normals; E[ψ'] = E[x ψ] by Stein's lemma.
    slope = quad(lambda x: x * psi(x) * norm.pdf(x), -9, 9, points=[-5, 0, 5], limit=200)[0]
    spread = quad(lambda x: psi(x) ** 2 * norm.pdf(x), -9, 9, points=[-5, 0, 5], limit=200)[0]
    assert slope**2 / spread == pytest.approx(0.95, abs=2e-3)


def test_moving_ten_thousand_points_is_moving_each():
    rng = np.random.default_rng(7)
    points, T = rng.normal(size=(20_000, 3)), motion(3, 1.0, 2.0, np.ones(3), rng)
    assert move(T, points) == pytest.approx(points @ T[:3, :3].T + T[:3, 3])


@pytest.mark.parametrize(
    ("call", "error", "said"),
    [
        (lambda: point_to_point("p", "q"), TypeError, "p: expected real numbers, got 'p'"),
        (lambda: point_to_point([[0, 0]], [[0, 0], [1, 1]]), ValueError, "expected one partner for each point"),
        (lambda: point_to_point([[0, 0], [1, 0]], [[0, 0, 0], [1, 1, 1]]), ValueError, r"q: .*\(n, 2\), got \(2, 3\)"),
        (lambda: point_to_point([[0, 0], [1, 0]], [[0, 0], [1, 1]], [1, -1]), ValueError, "weights: expected 2 finite"),
        (lambda: point_to_plane([[0, 0]], [[1, 0]], [[0, 0]]), ValueError, "normals: .* none of them zero"),
        (lambda: move([1, 2, 0.3], [[0, 0]]), ValueError, "geometry.homogeneous makes one of a pose"),
        (lambda: move(np.eye(3), None), TypeError, "points: expected real numbers, got None"),
    ],
)
def test_what_is_no_pair_and_no_motion_gets_a_sentence(call, error, said):
    with pytest.raises(error, match=said):
        call()


def test_lists_are_points_too():
    quarter = point_to_point([[0, 0], [2, 0], [0, 1]], [[5, 1], [5, 3], [4, 1]])
    assert move(quarter, [[2, 0]]).round(9).tolist() == [[5, 3]]
