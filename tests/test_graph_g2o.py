"""Graphs to and from g2o: the same numbers, the same χ², and the order of the information matrix."""

import numpy as np
import pytest

from coursekit.gaussian import mahalanobis_squared
from coursekit.geometry import between, compose, inverse, transform
from coursekit.graph import Edge, PointEdge, optimize, prior, read_g2o, residuals, write_g2o


def drawn(seed=0, n=12, m=4):
    rng = np.random.default_rng(seed)
    poses, landmarks = rng.uniform([-5, -5, -3], [5, 5, 3], (n, 3)), rng.uniform(-5, 5, (m, 2))

    def cov(d):
        root = rng.normal(size=(d, d)) * 0.1
        return root @ root.T + 1e-3 * np.eye(d)

    edges = [Edge(k, k + 1, between(poses[k], poses[k + 1]) + rng.normal(0, 0.1, 3), cov(3)) for k in range(n - 1)]
    edges.append(Edge(n - 1, 0, between(poses[-1], poses[0]), cov(3)))
    seen = [PointEdge(i, j, transform(inverse(poses[i]), landmarks[j]), cov(2)) for i in range(n) for j in range(m)]
    return poses, edges, landmarks, seen


def test_a_graph_comes_back_to_twelve_digits(tmp_path):
    poses, edges, landmarks, seen = drawn()
    write_g2o(tmp_path / "a.g2o", poses, edges, landmarks, seen)
    graph = read_g2o(tmp_path / "a.g2o")
    np.testing.assert_array_equal(graph.poses, poses)
    np.testing.assert_array_equal(graph.landmarks, landmarks)
    for found, edge in zip(graph.edges, edges, strict=True):
        assert (found.i, found.j) == (edge.i, edge.j)
        np.testing.assert_array_equal(found.pose, edge.pose)
        np.testing.assert_allclose(found.cov, edge.cov, rtol=1e-10, atol=1e-12)
    for found, sighting in zip(graph.sightings, seen, strict=True):
        assert (found.i, found.j) == (sighting.i, sighting.j)
        np.testing.assert_array_equal(found.point, sighting.point)
        np.testing.assert_allclose(found.cov, sighting.cov, rtol=1e-10, atol=1e-12)
    write_g2o(tmp_path / "b.g2o", graph.poses, graph.edges, graph.landmarks, graph.sightings)
    again = read_g2o(tmp_path / "b.g2o")
    np.testing.assert_allclose([e.cov for e in again.edges], [e.cov for e in graph.edges], rtol=1e-10, atol=1e-12)


def test_the_information_stands_by_rows_and_speaks_of_the_measured_frame(tmp_path):
    """χ² as g2o computes it, written out: e = z⁻¹ ⊕ (x_i⁻¹ ⊕ x_j), Ω from the upper triangle of the line."""
    poses, edges, landmarks, seen = drawn(1)
    write_g2o(tmp_path / "a.g2o", poses, edges, landmarks, seen)
    total = 0.0
    for line in (tmp_path / "a.g2o").read_text().splitlines():
        tag, *entries = line.split()
        if tag == "EDGE_SE2":
            i, j = map(int, entries[:2])
            z, (a, b, c, d, e, f) = np.array(entries[2:5], float), map(float, entries[5:])
            error = compose(inverse(z), between(poses[i], poses[j]))
            total += error @ np.array([[a, b, c], [b, d, e], [c, e, f]]) @ error
    ours = sum(mahalanobis_squared(residuals(poses[e.i], poses[e.j], e.pose)[0], e.cov) for e in edges)
    assert total == pytest.approx(ours, rel=1e-9)


def test_a_quarter_turn_swaps_the_variances_along_and_across(tmp_path):
    """Sure to 1 cm along pose 0's x and to 10 cm along its y: after a left turn x is the measured pose's -y."""
    edge = Edge(0, 1, [1.0, 0.0, np.pi / 2], np.diag([0.01, 0.1, 0.02]) ** 2)
    write_g2o(tmp_path / "a.g2o", np.zeros((2, 3)), [edge])
    line = (tmp_path / "a.g2o").read_text().splitlines()[-1].split()
    assert [float(line[k]) for k in (6, 9, 11)] == pytest.approx([100.0, 10_000.0, 2500.0])


def test_a_graph_of_poses_and_landmarks_is_optimized_as_it_comes(tmp_path):
    poses, _, landmarks, seen = drawn(2)
    steps = [Edge(k, k + 1, between(poses[k], poses[k + 1]), 0.01 * np.eye(3)) for k in range(len(poses) - 1)]
    rng = np.random.default_rng(3)
    started = poses + rng.normal(0, 0.1, poses.shape) * (np.arange(len(poses)) > 0)[:, None]
    write_g2o(tmp_path / "a.g2o", started, steps, landmarks + rng.normal(0, 0.3, landmarks.shape), seen)
    graph = read_g2o(tmp_path / "a.g2o")
    held = prior(0, graph.poses[0], 1e-6 * np.eye(3))
    solution = optimize([*graph.poses, *graph.landmarks], [held, *graph.factors])
    assert solution.chi2 < 1e-12
    np.testing.assert_allclose(np.array(solution.values[len(poses) :]), landmarks, atol=1e-6)


GOOD = "VERTEX_SE2 7 0 0 0\nVERTEX_SE2 3 1 0 0\nVERTEX_XY 9 1 1\nPARAMS_SE2OFFSET 0 0 0 0\nFIX 7\n"


def test_ids_are_names_and_what_is_no_vertex_and_no_edge_is_left_out(tmp_path):
    path = tmp_path / "a.g2o"
    path.write_text(GOOD + "EDGE_SE2 3 7 -1 0 0 4 0 0 4 0 1\nEDGE_SE2_XY 7 9 1 1 1 0 1\n")
    graph = read_g2o(path)
    assert [(e.i, e.j) for e in graph.edges] == [(1, 0)] and [(s.i, s.j) for s in graph.sightings] == [(0, 0)]
    assert np.diag(graph.edges[0].cov) == pytest.approx([0.25, 0.25, 1])


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("VERTEX_SE2 7 0 0 0", "line 6: vertex 7 is told twice"),
        ("VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1", "line 6: expected one of VERTEX_SE2, .* got VERTEX_SE3:QUAT"),
        ("EDGE_SE2 7 3 1 0 0 1 0 0 1 0", "line 6: expected 11 finite numbers after EDGE_SE2"),
        ("EDGE_SE2 7 3 1 0 0 1 0 0 1 0 nan", "line 6: expected 11 finite numbers"),
        (
            "EDGE_SE2 7 5 1 0 0 1 0 0 1 0 1",
            "line 6: EDGE_SE2 between vertices 7 and 5, of which one is not in the file",
        ),
        ("EDGE_SE2 7 9 1 0 0 1 0 0 1 0 1", "line 6: EDGE_SE2 between vertices 7 and 9"),
        ("EDGE_SE2 7 3 1 0 0 1 0 0 -1 0 1", "line 6: the information matrix is not positive definite"),
        ("EDGE_SE2_XY 7 9 1 0 0 0 0", "line 6: the information matrix is not positive definite"),
    ],
)
def test_a_line_that_cannot_be_read_is_named(tmp_path, line, said):
    path = tmp_path / "a.g2o"
    path.write_text(GOOD + line + "\n")
    with pytest.raises(ValueError, match=said):
        read_g2o(path)


def test_what_cannot_be_written_is_refused(tmp_path):
    edge = Edge(0, 1, np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match=r"poses: expected finite numbers of shape \(n, 3\)"):
        write_g2o(tmp_path / "a.g2o", np.zeros((2, 2)), [edge])
    with pytest.raises(ValueError, match="expected them between poses 0 … 0"):
        write_g2o(tmp_path / "a.g2o", np.zeros((1, 3)), [edge])
    with pytest.raises(ValueError, match="point: expected a finite"):
        PointEdge(0, 0, [np.nan, 0], np.eye(2))
    with pytest.raises(FileNotFoundError):
        read_g2o(tmp_path / "none.g2o")
