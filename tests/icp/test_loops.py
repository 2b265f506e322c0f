"""Lidar loops in the world, closed by the pose graph."""

import numpy as np
import pytest

from coursekit import geometry, icp
from coursekit.labs.lab06 import runs

PLANES = {"metric": "point_to_plane", "kernel": "cauchy"}


def closed(seed, **options):
    """(track, closed track, errors at the end [m] of wheels, of the scans' chain, and of the graph)."""
    lap = runs.lap(seed)
    track = icp.scan_to_scan(lap.scans, start=lap.truth[0], **options)
    graph = icp.close(track, lap.scans)
    return track, graph, [runs.off(poses, lap.truth)[1] for poses in (lap.wheels, track.poses, graph.poses)]


@pytest.mark.parametrize("seed", [6, pytest.param(21, marks=pytest.mark.slow)])
def test_a_closed_lap_ends_at_less_than_half_of_the_odometrys_error(seed):
    for options in (PLANES, {}):
        track, graph, (wheels, chain, end) = closed(seed, **options)
        assert graph.closures >= 1 and graph.dof == 3 * graph.closures
        assert len(graph.edges) == len(track.steps) + graph.closures
        assert end < 0.5 * chain and end < 0.5 * wheels
        assert graph.poses[0] == pytest.approx(track.poses[0], abs=1e-12)


@pytest.mark.slow
def test_twenty_laps_of_twenty_end_at_less_than_half_of_the_wheels_error_and_their_chi_square_is_no_surprise():
    """By planes and by points.  Now and then a chain by planes ends well by luck, so of these it is most.  χ² a degree
    of freedom: below one for planes, whose shared scans cancel what independent edges add up, and up to two and a half
    for points, whose biases repeat."""
    for options, low in ((PLANES, 0.05), ({}, 0.4)):
        runs_of = [closed(seed, **options)[1:] for seed in range(100, 120)]
        ends = np.array([ends for _, ends in runs_of])
        assert np.all(ends[:, 2] < 0.5 * ends[:, 0])
        assert np.sum(ends[:, 2] < 0.5 * ends[:, 1]) >= 16
        assert low < np.mean([graph.chi2 / graph.dof for graph, _ in runs_of]) < 2.5


def room_seen_from(poses):
    walls = np.random.default_rng(0).uniform(-3, 3, (300, 2)) * [1.0, 0.7]
    return [geometry.transform(geometry.inverse(pose), walls) for pose in poses]


def test_places_are_tried_that_are_near_and_long_ago():
    there = np.stack([np.linspace(0, 2, 11), np.zeros(11), np.zeros(11)], axis=1)
    poses = np.vstack([there, there[-2::-1]])
    found = icp.closures(poses, room_seen_from(poses), radius=0.3, apart=8, every=4, metric="point_to_point")
    assert [(edge.i, edge.j) for edge in found] == [(4, 16), (0, 20)]
    for edge in found:
        assert edge.pose == pytest.approx(geometry.between(poses[edge.i], poses[edge.j]), abs=1e-6)


def test_two_places_that_look_alike_do_not_bend_the_track():
    """The same walls around a place 0.8 m further on: the chain is sure to millimetres, and the closure is left out."""
    lap = runs.lap(6)
    track = icp.scan_to_scan(lap.scans[:60], start=lap.truth[0], **PLANES)
    scans = [*lap.scans[:59], lap.scans[0]]
    graph = icp.close(track, scans, radius=10.0, apart=59, every=100)
    assert icp.closures(track.poses, scans, radius=10.0, apart=59, every=100, reach=10.0)
    assert icp.close(track, scans, radius=10.0, apart=59, every=100, reach=10.0).closures == 0
    assert np.array_equal(graph.poses, track.poses)


def test_a_track_without_a_loop_stays_as_it_is():
    lap = runs.lap(6)
    track = icp.scan_to_scan(lap.scans[:12], start=lap.truth[0], **PLANES)
    graph = icp.close(track, lap.scans[:12])
    assert graph.closures == 0 and graph.dof == 0 and np.array_equal(graph.poses, track.poses)
    assert graph.chi2 == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ValueError, match=r"poses: expected finite poses of shape \(12, 3\), got \(11, 3\)"):
        icp.closures(track.poses[1:], lap.scans[:12])
