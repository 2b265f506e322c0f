import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coursekit.icp import NO_MATCH, BruteForce, KdTree, matching
from coursekit.icp.matching import closest
from tests.work import within


def assert_same(a, b):
    assert np.array_equal(a[0], b[0])
    assert np.array_equal(a[1], b[1])  # to the last bit
    assert a[2] == b[2]


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    d=st.sampled_from([2, 3]),
    reach=st.sampled_from([np.inf, 0.3, 0.05]),
    offset=st.sampled_from([0.0, 1e3, 1e6]),
    lattice=st.booleans(),
)
def test_brute_force_and_tree_agree_match_for_match_wherever_the_cloud_moves(seed, d, reach, offset, lattice):
    rng = np.random.default_rng(seed)
    target, points = rng.uniform(-1, 1, (150, d)) + offset, rng.uniform(-1, 1, (90, d)) + offset
    if lattice:  # ties everywhere: rounded to a grid, with points in the middle of its cells, and with doubles
        target, points = np.round(target * 4) / 4, np.round(points * 8) / 8
    tree, brute = KdTree(target), BruteForce(target)
    for step in [0.3, 0.1, 0.0, 0.01, 1e-3, 1e-6, 0.0]:
        if step and not lattice:
            points = points + rng.normal(0, step, d)
        assert_same(tree.nearest(points, reach), brute.nearest(points, reach))


def test_the_nearest_is_the_nearest_and_ties_go_to_the_lower_index():
    target = np.array([[0.0, 0], [2, 0], [0, 2], [2, 2], [2, 2]])
    points = np.array([[1.0, 1], [1.0, -0.1], [0.4, 1.9], [2, 2], [9, 9]])
    for search in (KdTree(target), BruteForce(target)):
        index, distance, tied = search.nearest(points, 3.0)
        assert index.tolist() == [0, 0, 2, 3, NO_MATCH]
        assert distance == pytest.approx([2**0.5, 1.01**0.5, 0.17**0.5, 0, np.inf])
        assert tied == 2  # two points on one place are no tie


def test_the_reach_is_closed():
    target = np.array([[0.0, 0], [10, 0]])
    for search in (KdTree(target), BruteForce(target)):
        assert search.nearest(np.array([[3.0, 0]]), 3.0)[0] == [0]
        assert search.nearest(np.array([[3.0, 0]]), np.nextafter(3.0, 0))[0] == [NO_MATCH]


def test_the_tree_is_asked_only_about_points_that_may_have_changed_their_mind(monkeypatch):
    rng = np.random.default_rng(0)
    target, points = rng.uniform(-1, 1, (2, 2000, 3))
    tree, asked = KdTree(target), []
    ask = tree._ask
    monkeypatch.setattr(tree, "_ask", lambda points, reach: asked.append(len(points)) or ask(points, reach))
    for step in (0.0, 1e-3, 1e-5, 0.0):
        points = points + step
        tree.nearest(points, np.inf)
    assert asked[0] == 2000
    assert 0 < asked[1] < 400 and asked[2] < 20 and asked[3] <= asked[2]


def test_a_large_cloud_that_asks_in_another_order_gets_the_same_answers(monkeypatch):
    rng = np.random.default_rng(0)
    target, points = rng.normal(size=(300, 3)), np.repeat(rng.normal(size=(100, 3)), 2, axis=0)
    before = KdTree(target).nearest(points, 0.5)
    monkeypatch.setattr(matching, "LARGE", len(points))
    after = KdTree(target).nearest(points, 0.5)
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))


def test_another_reach_or_another_cloud_is_asked_afresh():
    rng = np.random.default_rng(1)
    target = rng.uniform(-1, 1, (300, 2))
    tree, brute = KdTree(target), BruteForce(target)
    here, there, more = rng.uniform(-1, 1, (50, 2)), rng.uniform(-1, 1, (50, 2)), rng.uniform(-1, 1, (80, 2))
    for points, reach in ((here, 0.05), (here, np.inf), (here, 0.02), (there, 0.02), (more, 0.02)):
        assert_same(tree.nearest(points, reach), brute.nearest(points, reach))


def test_trimming_keeps_the_share_with_the_shortest_distances():
    distance = np.array([5.0, 1.0, np.inf, 3.0, 2.0])
    assert closest(distance, 1.0).tolist() == [0, 1, 3, 4]
    assert closest(distance, 0.5).tolist() == [1, 4]
    assert closest(distance, 0.51).tolist() == [1, 3, 4]  # at least the share
    assert closest(distance, 0.01).tolist() == [1]
    assert closest(np.full(3, np.inf), 0.5).size == 0


def test_a_driver_that_returns_zero_for_nothing_seen_does_not_slow_the_tree_down():
    """Thousands of copies of one point are one place: asked about once, and not once for each copy."""
    rng = np.random.default_rng(7)
    target, points = rng.normal(size=(3000, 3)), rng.normal(size=(1500, 3))
    target[:1000], points[:1000] = 0.0, 0.01
    tree = KdTree(target)
    found = within(3000, lambda: tree.nearest(points, np.inf))
    assert_same(found, BruteForce(target).nearest(points, np.inf))
    assert found[0][:1000].tolist() == [0] * 1000 and found[2] == 0


@pytest.mark.parametrize("search", [KdTree, BruteForce])
def test_what_is_no_cloud_gets_a_sentence(search):
    with pytest.raises(ValueError, match=r"target: expected points of shape \(n, 2\) or \(n, 3\), got \(4,\)"):
        search(np.zeros(4))
    with pytest.raises(ValueError, match="target: expected at least 1 points, got 0"):
        search(np.zeros((0, 2)))
    with pytest.raises(ValueError, match=r"points: expected points of shape \(n, 2\), got \(5, 3\)"):
        search(np.zeros((4, 2))).nearest(np.zeros((5, 3)), 1.0)
