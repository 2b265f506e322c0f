import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.geometry import between, compose
from coursekit.icp import Edge, relax
from coursekit.icp.graph import residuals
from coursekit.models import pose_residual

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
    assert pose_residual(relax(start, edges), truth) == pytest.approx(np.zeros(truth.shape), abs=1e-7)


def test_a_chain_alone_is_satisfied_exactly():
    edges = chain(ring(), np.random.default_rng(2))
    drifted = follow(ring()[0], edges)
    assert pose_residual(relax(drifted, edges), drifted) == pytest.approx(np.zeros(drifted.shape), abs=1e-9)


def test_closing_the_loop_brings_the_whole_track_nearer_to_the_truth():
    truth, errors = ring(), []
    for seed in range(20):
        edges = chain(truth, np.random.default_rng(seed))
        drifted = follow(truth[0], edges)
        closed = relax(drifted, [*edges, Edge(0, len(truth) - 1, between(truth[0], truth[-1]), COV)])
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
        poses = relax(follow(truth[0], edges[:-1]), edges)
        r = [residuals(poses[e.i], poses[e.j], e.pose)[0] for e in edges]
        costs.append(sum(x @ np.linalg.solve(COV, x) for x in r))
    low, high = chi2_band(3, 40, confidence=0.999)
    assert low < np.mean(costs) < high


def test_a_sure_edge_moves_less_than_an_unsure_one():
    poses = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    sure, unsure = np.eye(3) * 1e-4, np.eye(3)
    edges = [Edge(0, 1, [1, 0, 0], sure), Edge(1, 2, [1, 0, 0], unsure), Edge(0, 2, [2.5, 0, 0], sure)]
    relaxed = relax(poses, edges)
    assert relaxed[1, 0] == pytest.approx(1.0, abs=1e-3) and relaxed[2, 0] == pytest.approx(2.5, abs=1e-3)


def test_bad_graphs_are_refused():
    poses = ring(4)
    with pytest.raises(ValueError, match="two different poses"):
        relax(poses, [Edge(0, 4, np.zeros(3), COV)])
    with pytest.raises(ValueError, match="one or more"):
        relax(poses, [])
    with pytest.raises(ValueError, match=r"poses: expected .*\(4, 2\)"):
        relax(poses[:, :2], chain(poses))
    with pytest.raises(ValueError, match="poses: expected finite"):
        relax(np.full((4, 3), np.nan), chain(poses))
    with pytest.raises(ValueError, match="from the first pose to every other"):
        relax(poses, chain(poses)[:-1])
    with pytest.raises(ValueError, match="positive definite"):
        Edge(0, 1, np.zeros(3), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="finite"):
        Edge(0, 1, [0, 0, np.nan], COV)
