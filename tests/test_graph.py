import numpy as np
import pytest
from scipy.optimize import least_squares

from coursekit.gaussian import chi2_band, mahalanobis_squared
from coursekit.geometry import between, compose
from coursekit.graph import between_poses, motion_step, optimize, prior, residuals, sight
from coursekit.icp import Edge, optimize_pose_graph
from coursekit.models import DifferentialDrive, pose_residual, range_bearing

COV = np.diag([0.02, 0.02, 0.01]) ** 2


def ring(n=24, turn=2 * np.pi):
    """Poses along a circle of 3 m, tangent to it, round the full turn and back to the first."""
    a = np.linspace(0, turn, n)
    return np.stack([3 * np.sin(a), 3 - 3 * np.cos(a), np.angle(np.exp(1j * a))], axis=1)


def chain(poses, rng=None, cov=COV):
    edges = []
    for k in range(len(poses) - 1):
        noise = np.zeros(3) if rng is None else np.linalg.cholesky(cov) @ rng.standard_normal(3)
        edges.append(Edge(k, k + 1, between(poses[k], poses[k + 1]) + noise, cov))
    return edges


def follow(start, edges):
    poses = [start]
    for edge in edges:
        poses.append(compose(poses[-1], edge.pose))
    return np.array(poses)


def test_jacobians_are_the_finite_differences_of_the_residual():
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b, z = rng.normal(size=(3, 3))
        _, A, B = residuals(a, b, z)
        for J, at in ((A, 0), (B, 1)):
            for k in range(3):
                step = np.zeros(3)
                step[k] = 1e-6
                low, high = (residuals(a + s * step * (at == 0), b + s * step * (at == 1), z)[0] for s in (-1, 1))
                assert J[:, k] == pytest.approx(pose_residual(high, low) / 2e-6, abs=1e-6)


def test_what_the_edges_agree_on_is_found_from_a_bad_start_and_the_first_pose_stays():
    truth = ring()
    edges = [*chain(truth), Edge(0, 12, between(truth[0], truth[12]), COV)]
    start = truth + np.random.default_rng(1).normal(0, 0.2, truth.shape)
    start[0] = truth[0]
    assert pose_residual(optimize_pose_graph(start, edges), truth) == pytest.approx(np.zeros(truth.shape), abs=1e-7)


def test_a_chain_alone_is_satisfied_exactly():
    edges = chain(ring(), np.random.default_rng(2))
    drifted = follow(ring()[0], edges)
    assert pose_residual(optimize_pose_graph(drifted, edges), drifted) == pytest.approx(
        np.zeros(drifted.shape), abs=1e-9
    )


def test_closing_the_loop_brings_the_whole_track_nearer_to_the_truth():
    truth, errors = ring(), []
    for seed in range(20):
        edges = chain(truth, np.random.default_rng(seed))
        drifted = follow(truth[0], edges)
        closed = optimize_pose_graph(drifted, [*edges, Edge(0, len(truth) - 1, between(truth[0], truth[-1]), COV)])
        errors.append([np.sqrt(np.mean((p - truth)[:, :2] ** 2)) for p in (drifted, closed)])
    drifted, closed = np.mean(errors, axis=0)
    assert closed < 0.6 * drifted


def test_what_closing_costs_is_chi_square_when_the_covariances_are_honest():
    """One loop is three numbers too many.  40 runs; an honest graph leaves the band once in a thousand."""
    truth, costs = ring(), []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        edges = chain(truth, rng)
        noise = np.linalg.cholesky(COV) @ rng.standard_normal(3)
        edges.append(Edge(0, len(truth) - 1, between(truth[0], truth[-1]) + noise, COV))
        poses = optimize_pose_graph(follow(truth[0], edges[:-1]), edges)
        r = [residuals(poses[e.i], poses[e.j], e.pose)[0] for e in edges]
        costs.append(sum(x @ np.linalg.solve(COV, x) for x in r))
    low, high = chi2_band(3, 40, confidence=0.999)
    assert low < np.mean(costs) < high


def test_a_sure_edge_moves_less_than_an_unsure_one():
    poses = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    sure, unsure = np.eye(3) * 1e-4, np.eye(3)
    edges = [Edge(0, 1, [1, 0, 0], sure), Edge(1, 2, [1, 0, 0], unsure), Edge(0, 2, [2.5, 0, 0], sure)]
    relaxed = optimize_pose_graph(poses, edges)
    assert relaxed[1, 0] == pytest.approx(1.0, abs=1e-3) and relaxed[2, 0] == pytest.approx(2.5, abs=1e-3)


def test_bad_graphs_are_refused():
    poses = ring(4)
    with pytest.raises(ValueError, match="two different poses"):
        optimize_pose_graph(poses, [Edge(0, 4, np.zeros(3), COV)])
    with pytest.raises(ValueError, match="one or more"):
        optimize_pose_graph(poses, [])
    with pytest.raises(ValueError, match=r"poses: expected .*\(4, 2\)"):
        optimize_pose_graph(poses[:, :2], chain(poses))
    with pytest.raises(ValueError, match="poses: expected finite"):
        optimize_pose_graph(np.full((4, 3), np.nan), chain(poses))
    with pytest.raises(ValueError, match="from the first pose to every other"):
        optimize_pose_graph(poses, chain(poses)[:-1])
    with pytest.raises(ValueError, match="positive definite"):
        Edge(0, 1, np.zeros(3), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="finite"):
        Edge(0, 1, [0, 0, np.nan], COV)


def test_two_chains_that_do_not_meet_are_refused_whatever_their_pivots_round_to():
    rng = np.random.default_rng(5)
    for _ in range(20):
        poses = rng.normal(size=(6, 3))
        apart = [
            Edge(i, j, rng.normal(size=3), np.diag(rng.uniform(0.1, 1, 3))) for i, j in ((0, 1), (1, 2), (3, 4), (4, 5))
        ]
        with pytest.raises(ValueError, match="from the first pose to every other"):
            optimize_pose_graph(poses, apart)


# --- Poses and landmarks at once --------------------------------------------------------------------------------------
DRIVE, R = DifferentialDrive(0.05, 0.05), np.diag([0.05, 0.02]) ** 2


def drawn(rng, steps=12):
    """A drive past six landmarks, drawn from its own models: truth, factors, and first guesses by dead reckoning."""
    landmarks, u, dt = rng.uniform([-1, -3], [5, 3], (6, 2)), np.array([0.5, 0.3]), 0.3
    truth, guess = [np.zeros(3)], [np.zeros(3)]
    factors = [prior(0, np.zeros(3), 1e-6 * np.eye(3))]
    for k in range(steps):
        truth.append(DRIVE.sample(truth[-1][None], u, dt, rng)[0])
        factors.append(motion_step(k, k + 1, DRIVE, u, dt, near=truth[-2]))
        guess.append(DRIVE.f(guess[-1], u, dt))
        for j, landmark in enumerate(landmarks):
            z = range_bearing.h(truth[-1], landmark) + rng.multivariate_normal([0, 0], R)
            factors.append(sight(k + 1, steps + 1 + j, z, R))
    return np.array(truth), landmarks, factors, [*guess, *(landmarks + rng.normal(0, 0.1, landmarks.shape))]


def test_every_factors_jacobians_are_the_finite_differences_of_its_residual():
    rng = np.random.default_rng(7)
    poses, point = rng.normal(size=(2, 3)), rng.normal(size=2) + 3
    cases = [
        (prior(0, poses[1], COV), poses[:1]),
        (between_poses(0, 1, rng.normal(size=3), COV), poses),
        (motion_step(0, 1, DRIVE, [0.5, 0.3], 0.3, near=poses[0]), poses),
        (sight(0, 1, [2.0, 0.3], R), (poses[0], point)),
    ]
    for factor, values in cases:
        for k, J in enumerate(factor.linearize(*values)[1]):
            for column, step in enumerate(1e-6 * np.eye(len(values[k]))):
                ahead, behind = (
                    [v + s * step * (i == k) if i == k else v for i, v in enumerate(values)] for s in (1, -1)
                )
                slope = (factor.linearize(*ahead)[0] - factor.linearize(*behind)[0]) / 2e-6
                assert J[:, column] == pytest.approx(slope, abs=1e-5)


def test_the_smallest_chi_square_is_the_one_that_scipy_finds():
    _, _, factors, guess = drawn(np.random.default_rng(8), steps=6)
    solution = optimize(guess, factors)
    ends = np.cumsum([len(v) for v in guess])[:-1]
    roots = [np.linalg.cholesky(f.cov) for f in factors]

    def white(x):
        values = np.split(x, ends)
        return np.concatenate([np.linalg.solve(L, f.linearize(*(values[i] for i in f.at))[0])
                               for f, L in zip(factors, roots, strict=True)])  # fmt: skip

    peer = least_squares(white, np.concatenate(guess), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert solution.converged and solution.chi2 == pytest.approx(2 * peer.cost, rel=1e-6)
    np.testing.assert_allclose(np.concatenate(solution.values), peer.x, atol=1e-5)
    np.testing.assert_allclose(solution.cov(3), np.linalg.inv(peer.jac.T @ peer.jac)[9:12, 9:12], rtol=1e-4, atol=1e-9)


def test_a_smoothed_drive_is_as_good_as_it_says():
    """NEES of the last pose (3) and of the map (12 numbers), and χ² at the minimum with as many degrees of freedom as
    there are more numbers measured than unknown.  30 drives; an honest smoother leaves each band once in a thousand."""
    found = []
    for seed in range(30):
        truth, landmarks, factors, guess = drawn(np.random.default_rng([9, seed]))
        solution, n = optimize(guess, factors), len(truth)
        error = pose_residual(solution.values[n - 1], truth[-1])
        off = np.concatenate(solution.values[n:]) - landmarks.ravel()
        found.append([mahalanobis_squared(error, solution.cov(n - 1)),
                      mahalanobis_squared(off, solution.cov(*range(n, n + 6))), solution.chi2])  # fmt: skip
    for average, dof in zip(np.mean(found, axis=0), (3, 12, 12 * 12 - 12), strict=True):
        low, high = chi2_band(dof, 30, confidence=0.999)
        assert low < average < high


def test_bad_factors_are_refused():
    with pytest.raises(ValueError, match="leave an unknown free"):
        optimize([np.zeros(3), np.ones(2)], [prior(0, np.zeros(3), COV)])
    with pytest.raises(ValueError, match="over unknowns 0"):
        optimize([np.zeros(3)], [prior(1, np.zeros(3), COV)])
    with pytest.raises(ValueError, match="values: expected finite"):
        optimize([np.full(3, np.nan)], [prior(0, np.zeros(3), COV)])
    with pytest.raises(ValueError, match="mean: expected a finite"):
        prior(0, [0.0, 0.0], COV)
    with pytest.raises(TypeError, match="edges: expected Edge"):
        optimize_pose_graph(np.zeros((2, 3)), [(0, 1)])
