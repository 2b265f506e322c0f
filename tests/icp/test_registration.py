import re
import time
import warnings
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.icp.pairing import Iteration, Pairing
from coursekit.icp.registration import iterate
from tests.icp.clouds import back, bumps, corridor, motion, problem, room

RNG = np.random.default_rng(0)
FLAT, SOLID = RNG.uniform(-1, 1, (300, 2)), RNG.uniform(-1, 1, (300, 3))


@pytest.mark.parametrize("metric", ["point_to_point", "point_to_plane"])
@pytest.mark.parametrize("target", [FLAT, SOLID], ids=["2-D", "3-D"])
def test_a_small_motion_of_a_cloud_is_found_exactly(target, metric):
    T = motion(target.shape[1], 0.05, 0.03, np.zeros(target.shape[1]), np.random.default_rng(1))
    result = icp.align(icp.move(back(T), target), target, metric=metric)
    assert result.converged and result.reason.startswith("settled")
    assert result.T_target_source == pytest.approx(T, abs=1e-8)
    assert result.rmse < 1e-8
    assert np.array_equal(result.matches, np.stack([np.arange(300)] * 2, axis=1))


@pytest.mark.parametrize("factor", [1e-9, 1e3])
def test_the_unit_of_length_does_not_matter(factor):
    p = problem(room, 300, np.random.default_rng(2))
    a = icp.align(p.source, p.target)
    b = icp.align(p.source * factor, p.target * factor)
    assert b.iterations == a.iterations and b.rmse == pytest.approx(a.rmse * factor)
    assert np.array_equal(a.matches, b.matches)


def test_clouds_in_national_grid_coordinates_are_aligned_as_well():
    T = motion(3, 0.05, 0.03, np.zeros(3), np.random.default_rng(3))
    result = icp.align(icp.move(back(T), SOLID) + 1e6, SOLID + 1e6)
    assert result.converged and result.rmse < 1e-8


@pytest.mark.parametrize("accelerate", [False, True])
def test_brute_force_and_tree_walk_the_same_way_match_for_match(accelerate):
    for shape, reach in ((room, np.inf), (bumps, 0.5)):
        p = problem(shape, 400, np.random.default_rng(4), angle=0.5, outliers=0.1)
        walks = [
            icp.align(p.source, p.target, search=search, max_distance=reach, trim=0.9, accelerate=accelerate)
            for search in ("kdtree", "brute")
        ]
        assert len(walks[0].history) == len(walks[1].history) > 5
        for a, b in zip(walks[0].history, walks[1].history, strict=True):
            assert np.array_equal(a.matches, b.matches)
            assert a.rmse == b.rmse and np.array_equal(a.T_target_source, b.T_target_source)


def test_history_holds_the_start_every_iteration_and_the_end():
    p = problem(room, 300, np.random.default_rng(5), angle=0.4)
    start = motion(2, 0.1, 0.1, np.zeros(2), np.random.default_rng(6))
    result = icp.align(p.source, p.target, initial=start)
    assert len(result.history) == result.iterations + 1
    assert result.history[0].T_target_source == pytest.approx(start)
    end = result.history[-1]
    assert np.array_equal(end.T_target_source, result.T_target_source)
    assert np.array_equal(end.matches, result.matches) and end.rmse == result.rmse
    assert all(a.rmse >= b.rmse for a, b in zip(result.history, result.history[1:], strict=False))
    moved = icp.move(end.T_target_source, p.source[end.matches[:, 0]])
    apart = np.linalg.norm(moved - p.target[end.matches[:, 1]], axis=1)
    assert result.rmse == pytest.approx(np.sqrt(np.mean(apart**2)))


def test_the_first_iterations_are_the_same_however_many_follow():
    p = problem(room, 300, np.random.default_rng(7), angle=0.4)
    few, many = (icp.align(p.source, p.target, max_iterations=k) for k in (3, 50))
    assert few.iterations == 3 and not few.converged and few.reason.startswith("stopped after 3 iterations")
    for a, b in zip(few.history, many.history, strict=False):
        assert np.array_equal(a.T_target_source, b.T_target_source)


def test_a_result_cannot_be_changed_and_arguments_are_not():
    source, target = FLAT - 0.02, FLAT.copy()
    before = source.copy(), target.copy()
    result = icp.align(source, target, initial=np.eye(3))
    assert np.array_equal(source, before[0]) and np.array_equal(target, before[1])
    with pytest.raises(FrozenInstanceError):
        result.rmse = 0.0


def test_a_planar_motion_is_a_pose():
    pose = np.array([0.03, -0.02, 0.04])
    result = icp.align(geometry.transform(geometry.inverse(pose), FLAT), FLAT)
    assert result.pose == pytest.approx(pose, abs=1e-9)
    assert result.T_target_source == pytest.approx(geometry.homogeneous(pose), abs=1e-9)
    with pytest.raises(ValueError, match="no planar pose"):
        _ = icp.align(SOLID, SOLID).pose


# Robust rather than tuned: the same few options on every shape, sampled anew for each cloud.


@pytest.mark.parametrize("accelerate", [False, True], ids=["plain", "fast"])
@pytest.mark.parametrize("shape", [bumps, room])
@pytest.mark.parametrize(
    ("case", "options"),
    [
        pytest.param({"angle": 0.6, "shift": 0.3}, {}, id="far"),
        pytest.param({"angle": 0.3, "shift": 0.2, "overlap": 0.7}, {"trim": 0.6}, id="partial overlap"),
        pytest.param({"angle": 0.3, "shift": 0.2, "outliers": 0.25}, {"trim": 0.75}, id="outliers, trimmed"),
        pytest.param({"angle": 0.2, "shift": 0.1, "outliers": 0.25}, {"kernel": "tukey"}, id="outliers, kernel"),
        pytest.param({"angle": 0.3, "shift": 0.2, "density": 0.25}, {}, id="sparse target"),
        pytest.param({"angle": 0.3, "shift": 0.2, "density": 4.0}, {}, id="dense target"),
        pytest.param({"angle": 0.3, "shift": 0.2, "noise": 0.03}, {}, id="noise"),
    ],
)
def test_clouds_of_one_shape_are_aligned_whatever_happened_to_them(shape, case, options, accelerate):
    for seed in range(3):
        p = problem(shape, 1000 if shape is bumps else 500, np.random.default_rng(seed), **case)
        result = icp.align(p.source, p.target, max_iterations=200, accelerate=accelerate, **options)
        assert result.converged
        assert p.error(result.T_target_source) < (0.09 if shape is bumps else 0.04)  # about the samples' spacing


@pytest.mark.parametrize(("shape", "n", "seed"), [(bumps, 300, 0), (bumps, 1000, 10), (room, 200, 24)])
def test_planes_that_go_round_in_a_circle_settle_at_the_best_place_of_it(shape, n, seed):
    p = problem(shape, n, np.random.default_rng(seed), noise=0.01)
    result = icp.align(p.source, p.target, metric="point_to_plane", max_iterations=100)
    assert result.converged and "in a circle" in result.reason
    assert result.history[-1].cost == min(step.cost for step in result.history)
    assert p.error(result.T_target_source) < 0.02


def test_an_error_that_stands_still_is_not_enough_while_the_cloud_moves():
    """A cloud that slides along its target by a metre in each iteration, with the same pairs and the same error."""

    class Sliding(Pairing):
        def match(self, T, subset):
            return Iteration(T, np.stack([np.arange(3)] * 2, axis=1), rmse=0.1, cost=float(-T[0, 2]))

        def estimate(self, step):
            T = step.T_target_source.copy()
            T[0, 2] += 1.0
            return T

    history = []
    pairing = Sliding(FLAT[:3], FLAT[:3], icp.KdTree(FLAT[:3]))
    settled, reason = iterate(pairing, np.eye(3), np.arange(3), history, 20, 1e-9, accelerate=False)
    assert not settled and reason.startswith("stopped after 20 iterations")


def test_given_normals_are_used_and_their_sign_and_length_do_not_matter():
    p = problem(room, 400, np.random.default_rng(8))
    n = icp.normals(p.target)
    a = icp.align(p.source, p.target, metric="point_to_plane")
    b = icp.align(p.source, p.target, metric="point_to_plane", normals=-3 * n)
    assert b.T_target_source == pytest.approx(a.T_target_source, abs=1e-9)
    c = icp.align(p.source, p.target, metric="point_to_plane", normals=np.ones_like(n))
    assert not np.allclose(c.T_target_source, a.T_target_source, atol=1e-3)


# What cannot be aligned raises at the door.


@pytest.mark.parametrize(
    ("source", "target", "options", "message"),
    [
        (np.empty((0, 2)), FLAT, {}, "source: expected at least 2 points, got 0"),
        (FLAT, np.empty((0, 2)), {}, "target: expected at least 2 points, got 0"),
        (FLAT[:1], FLAT, {}, "source: expected at least 2 points, got 1"),
        (SOLID, SOLID[:2], {}, "target: expected at least 3 points, got 2"),
        (np.r_[FLAT, [[np.nan, 0]]], FLAT, {}, "source: expected finite coordinates, got .*row 300"),
        (FLAT, np.r_[[[0, np.inf]], FLAT], {}, "target: expected finite coordinates, got .*row 0"),
        (FLAT, SOLID, {}, r"one dimension, got source \(300, 2\) and target \(300, 3\)"),
        (np.ones((9, 4)), np.ones((9, 4)), {}, r"expected points of shape \(n, 2\) or \(n, 3\), got \(9, 4\)"),
        (FLAT[0], FLAT, {}, r"got \(2,\)"),
        (FLAT, FLAT, {"initial": np.eye(4)}, r"initial: .*shape \(3, 3\), got \(4, 4\)"),
        (FLAT, FLAT, {"initial": np.diag([1, -1, 1])}, "initial: expected a rotation"),
        (FLAT, FLAT, {"initial": np.diag([2, 2, 1])}, "initial: expected a rotation"),
        (FLAT, FLAT, {"initial": np.full((3, 3), np.nan)}, "initial: expected a rotation"),
        (FLAT, FLAT, {"initial": np.array([[1, 0, 0], [0, 1, 0], [0.1, 0, 1]])}, "initial: expected a rotation"),
        (FLAT, FLAT, {"metric": "planes"}, "metric: expected one of point_to_point, point_to_plane, got 'planes'"),
        (FLAT, FLAT, {"search": "octree"}, "search: expected one of kdtree, brute, got 'octree'"),
        (FLAT, FLAT, {"kernel": "welsch"}, "kernel: expected None or one of huber, cauchy, tukey, got 'welsch'"),
        (FLAT, FLAT, {"kernel": "tukey", "kernel_scale": 0.0}, "kernel_scale: expected a distance > 0 m, got 0.0"),
        (FLAT, FLAT, {"max_distance": 0.0}, "max_distance: expected a distance > 0 m, got 0.0"),
        (FLAT, FLAT, {"max_distance": np.nan}, "max_distance"),
        (FLAT, FLAT, {"trim": 0.0}, r"trim: expected a share in \(0, 1\], got 0.0"),
        (FLAT, FLAT, {"trim": 1.2}, "trim"),
        (FLAT, FLAT, {"max_iterations": 0}, "max_iterations: expected a whole number ≥ 1, got 0"),
        (FLAT, FLAT, {"tolerance": -1e-9}, "tolerance: expected a number ≥ 0, got -1e-09"),
        (
            FLAT,
            FLAT,
            {"metric": "point_to_plane", "normals": FLAT[:5]},
            r"normals: expected .*\(300, 2\).*got \(5, 2\)",
        ),
        (FLAT, FLAT, {"metric": "point_to_plane", "normals": FLAT * 0}, "normals: expected .*none of them zero"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(source, target, options, message):
    with pytest.raises(ValueError, match=message):
        icp.align(source, target, **options)


# What goes wrong on good input is a result that says so: never a mirror, never a NaN, never a warning.

TURN, TURN3 = motion(2, 0.1, 0.05, np.zeros(2), RNG), motion(3, 0.1, 0.05, np.zeros(3), RNG)
CIRCLE = np.stack([np.cos(np.arange(200) * np.pi / 100), np.sin(np.arange(200) * np.pi / 100)], axis=1)
SPHERE = RNG.normal(size=(1000, 3))
SPHERE /= np.linalg.norm(SPHERE, axis=1)[:, None]
LINE = np.linspace(0, 1, 100)[:, None] * [[1.0, 0.5, -0.3]]
SHEET = np.column_stack([RNG.uniform(-1, 1, (400, 2)), np.zeros(400)]) @ geometry.so3_exp([1, 0.4, 0.2]).T + [9, 2, 3]
SQUARE = np.array([[1.0, 1], [-1, 1], [-1, -1], [1, -1]])
CUBE = np.array([[x, y, z] for x in (-1.0, 1) for y in (-1, 1) for z in (-1, 1)])
GRID = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
CORRIDOR = corridor(400, RNG)
FEW, ANEW = (np.column_stack([RNG.uniform(-3, 3, 12), RNG.normal(0, 0.005, 12)]) for _ in range(2))
LEAF, LEAF_ANEW = (np.column_stack([RNG.uniform(-2, 2, (20, 2)), np.zeros(20)]) for _ in range(2))


def margin(cov):
    """The smallest eigenvalue of the correlation matrix, as a share of the largest: what rounding has to beat."""
    scale = np.sqrt(np.diag(cov))
    found = np.linalg.eigvalsh(cov / np.outer(scale, scale))
    return found[0] / found[-1]


@pytest.mark.parametrize("accelerate", [False, True], ids=["plain", "fast"])
@pytest.mark.parametrize("metric", ["point_to_point", "point_to_plane"])
@pytest.mark.parametrize(
    ("source", "target", "options", "reason"),
    [
        pytest.param(FLAT + 100, FLAT, {"max_distance": 0.5}, "no target point within max_distance", id="out of reach"),
        pytest.param(icp.move(back(TURN), LINE[:, :2]), LINE[:, :2], {}, "slides along", id="collinear 2-D"),
        pytest.param(icp.move(back(TURN3), LINE), LINE, {}, "lie on a line|turns about", id="collinear 3-D"),
        pytest.param(FEW, ANEW + np.array([0.3, 0.0]), {}, "slides along|stopped", id="few on a line, sampled anew"),
        pytest.param(LEAF, LEAF_ANEW + np.array([0.1, 0, 0]), {}, "slides|stopped", id="few on a plane, sampled anew"),
        pytest.param(icp.move(back(TURN3), SHEET), SHEET, {}, "slides along.*turns about|turns.*slides", id="coplanar"),
        pytest.param(icp.move(back(TURN), CIRCLE), CIRCLE, {}, "turns", id="circle"),
        pytest.param(icp.move(back(TURN3), SPHERE), SPHERE, {}, "turns about|stopped after", id="sphere"),
        pytest.param(CORRIDOR + np.array([0.1, 0.02]), CORRIDOR, {}, r"slides along \(-?1.00", id="corridor"),
        pytest.param(SQUARE @ geometry.rotation(np.pi / 4).T, SQUARE, {}, "too symmetric", id="square at 45°"),
        pytest.param(CUBE @ geometry.so3_exp([0, 0, np.pi / 4]).T, CUBE, {}, "too symmetric", id="cube at 45°"),
        pytest.param(GRID + 0.5, GRID, {}, "too symmetric", id="grid half a cell off"),
        pytest.param(np.full((50, 3), 0.3), SOLID, {}, "do not determine the rotation", id="source is one point"),
        pytest.param(SOLID, np.full((50, 3), 0.3), {}, "rotation|turns|stopped", id="target is one point"),
        pytest.param(FLAT + 9, FLAT, {"kernel": "tukey", "kernel_scale": 1e-3}, "no pair has any weight", id="kernel"),
        pytest.param(np.zeros((9, 2)), np.zeros((9, 2)), {}, "do not determine the rotation", id="zeros"),
    ],
)
def test_clouds_that_cannot_hold_an_answer_give_one_that_says_so(source, target, options, reason, metric, accelerate):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = icp.align(source, target, metric=metric, accelerate=accelerate, **options)
    assert not result.converged
    assert re.search(reason, result.reason), result.reason
    d = source.shape[1]
    for step in result.history:
        assert geometry.is_rotation(step.T_target_source[:d, :d], tolerance=1e-9)
        assert np.all(np.isfinite(step.T_target_source)) and not np.isnan(step.rmse)
    if result.covariance is not None:
        assert margin(result.covariance) > 0.9e-12


def test_a_few_landmarks_on_a_line_hold_the_answer_by_points_and_not_by_planes():
    """Twelve landmarks seen twice: their pairs are beyond doubt; along the line no normal says anything."""
    source = icp.move(back(TURN), LINE[::9, :2])
    assert icp.align(source, LINE[::9, :2]).converged
    assert not icp.align(source, LINE[::9, :2], metric="point_to_plane").converged


def test_a_mirrored_cloud_is_never_met_by_a_mirror():
    for target in (FLAT, SOLID):
        d = target.shape[1]
        result = icp.align(target * [*[1] * (d - 1), -1], target)
        assert geometry.is_rotation(result.T_target_source[:d, :d], tolerance=1e-9)
        assert result.rmse > 0.05


@pytest.mark.parametrize("metric", ["point_to_point", "point_to_plane"])
def test_a_sheet_is_said_to_slide_both_ways_and_to_turn_whatever_basis_the_solver_returns(metric):
    sheet = np.column_stack([np.random.default_rng(1).uniform(-1, 1, (400, 2)), np.zeros(400)])
    result = icp.align(sheet, sheet, metric=metric)
    assert sorted(re.findall(r"[a-z]+ [a-z]+ \([^)]*\)", result.reason)) == [
        "slides along (0.00, 1.00, 0.00)",
        "slides along (1.00, 0.00, 0.00)",
        "turns about (0.00, 0.00, 1.00)",
    ]


def test_a_gain_that_is_rounding_does_not_keep_a_circle_going():
    """Pairs that go round for ever, each time a rounding lower in cost."""

    class Circling(Pairing):
        def match(self, T, subset):
            way = round(T[0, 2])
            pairs = np.stack([np.arange(3)] * 2, axis=1)[: 2 + way % 2]
            return Iteration(T, pairs, rmse=0.1, cost=1.0 - way * 1e-16)

        def estimate(self, step):
            T = step.T_target_source.copy()
            T[0, 2] += 1.0
            return T

    history = []
    pairing = Circling(FLAT[:3], FLAT[:3], icp.KdTree(FLAT[:3]))
    settled, reason = iterate(pairing, np.eye(3), np.arange(3), history, 50, 1e-9, accelerate=False)
    assert settled and "in a circle" in reason and len(history) == 12
    assert history[-1].cost == min(step.cost for step in history)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"metric": "point_to_plane"},
        {"kernel": "cauchy"},
        {"trim": 0.8},
        {"accelerate": True},
        {"max_distance": 0.3},
    ],
    ids=str,
)
def test_repeated_points_cost_at_most_twice(options):
    """A driver's zeros, 2,500 of 10,000 points: processor time, the best of three."""
    X = np.random.default_rng(0).normal(size=(10_000, 3))
    zeros, nearly = X.copy(), X.copy()
    zeros[:2500], nearly[:2500] = 0.0, 0.01

    def cost(source, target):
        times = []
        for _ in range(3):
            start = time.process_time()
            icp.align(source, target, **options)
            times.append(time.process_time() - start)
        return min(times)

    assert cost(nearly, zeros) < 2 * cost(X, X)


def test_a_target_that_is_made_ready_gives_the_same_answers():
    p = problem(room, 300, np.random.default_rng(9), angle=0.2)
    for options in ({}, {"metric": "point_to_plane"}, {"search": "brute"}):
        ready = icp.Target.of(p.target, **options)
        for source in (p.source, p.source[::2], p.source):
            alone, again = (icp.align(source, target, **options) for target in (p.target, ready))
            assert np.array_equal(alone.T_target_source, again.T_target_source)
            assert np.array_equal(alone.matches, again.matches)
    with pytest.raises(ValueError, match="target: expected finite"):
        icp.Target.of([[0.0, np.nan], [1, 1]])
