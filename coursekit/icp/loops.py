r"""From a lidar track to a pose graph: its steps as edges, and edges between places that were seen again.

``close`` does all of it: chain, closures, least squares.  Neighbouring steps share a scan, whose noise enters them with
opposite signs; a graph of independent edges does not know that, and takes the chain for less sure than it is.

Source: Lu & Milios (1997); Olson (2009) for closing what the track's own uncertainty allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.gaussian import chi2_quantile, mahalanobis_squared
from coursekit.geometry import Array, between, homogeneous
from coursekit.graph import Edge, optimize_pose_graph, residuals
from coursekit.icp.odometry import LidarTrack
from coursekit.icp.registration import Target, align

DOUBT = 2.0  # so many times further off than it says may a chain be: the biases of point-to-point repeat along a wall
PLANES: dict[str, Any] = {"metric": "point_to_plane", "kernel": "cauchy"}


@dataclass(frozen=True)
class ClosedTrack:
    """poses : (n, 3), in the world.  edges : the chain, then the closures.  chi2, dof : of all edges at these poses.

    closures : how many of the edges close a loop; each brings three degrees of freedom.
    """

    poses: Array
    edges: tuple[Edge, ...]
    closures: int
    chi2: float

    @property
    def dof(self) -> int:
        return 3 * self.closures


def chain(track: LidarTrack) -> list[Edge]:
    """The steps of ``scan_to_scan`` as edges k → k + 1; a step without a pair is as unsure as a metre and a radian.

    >>> from coursekit.icp.odometry import scan_to_scan
    >>> room = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> [(edge.i, edge.j) for edge in chain(scan_to_scan([room, room, room]))]
    [(0, 1), (1, 2)]
    """
    return [
        Edge(k, k + 1, step.pose, np.eye(3) if step.covariance is None else step.covariance)
        for k, step in enumerate(track.steps)
    ]


def closures(
    poses: ArrayLike,
    scans: Sequence[Array],
    *,
    radius: float = 1.0,
    apart: int = 30,
    every: int = 10,
    reach: float = 1.0,
    **options: Any,
) -> list[Edge]:
    """Edges between scans that were taken at one place at different times, as far as their clouds lie on each other.

    Of every so many scans the nearest earlier one is tried: first with pairs up to ``reach``, for the drift since then,
    and from there with pairs up to 0.3 m.  What did not converge is no edge.

    Parameters
    ----------
    poses : (n, 3), the track [m, m, rad].     scans : n clouds (m_k, 2) in the robot's frame, metres.
    radius : how near two places must be, m, on the track.     apart : how many scans must lie between, at least.
    every : one scan in so many is tried, and the last.     options : of ``align``; planes with Cauchy's kernel unless
        given.

    Raises ValueError for poses that are not one for each scan, and what ``align`` refuses.

    Source: Lu & Milios (1997).

    >>> room = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> [(edge.i, edge.j) for edge in closures(np.zeros((4, 3)), [room] * 4, apart=2, metric="point_to_point")]
    [(0, 3)]
    """
    poses = np.asarray(poses, dtype=float)
    if poses.shape != (len(scans), 3) or not np.all(np.isfinite(poses)):
        raise ValueError(f"poses: expected finite poses of shape {(len(scans), 3)}, got {poses.shape}")
    options, found = PLANES | options, list[Edge]()
    last = len(scans) - 1
    for j in range(last, apart - 1, -every)[::-1]:
        distance = np.hypot(*(poses[: j - apart + 1, :2] - poses[j, :2]).T)
        i = int(np.argmin(distance)) if distance.size else 0
        if not distance.size or distance[i] > radius:
            continue
        target = Target.of(scans[i], metric=options["metric"])
        guess = homogeneous(between(poses[i], poses[j]))
        near = align(scans[j], target, initial=guess, max_distance=reach, max_iterations=100, **options)
        step = align(scans[j], target, initial=near.T_target_source, max_distance=0.3, max_iterations=100, **options)
        if step.converged and step.covariance is not None:
            found.append(Edge(i, j, step.pose, step.covariance))
    return found


def close(track: LidarTrack, scans: Sequence[Array], **options: Any) -> ClosedTrack:
    """The track of ``scan_to_scan`` after its loops were closed, by least squares over chain and ``closures``.

    options : of ``closures``.  A closure that contradicts the chain (by more than twice what 0.999 of χ² with three
    degrees of freedom allows the track's own covariances) is left out: two places may look alike.

    Raises ValueError as ``closures`` does.

    Source: Lu & Milios (1997); Olson (2009).

    >>> from coursekit.icp.odometry import scan_to_scan
    >>> room = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    >>> closed = close(scan_to_scan([room] * 4), [room] * 4, apart=2, metric="point_to_point")
    >>> closed.closures, closed.dof
    (1, 3)
    """
    steps = chain(track)
    added = [edge for edge in closures(track.poses, scans, **options) if _agrees(track, edge)]
    edges = (*steps, *added)
    poses = optimize_pose_graph(track.poses, edges) if added else track.poses
    left = [(residuals(poses[e.i], poses[e.j], e.pose)[0], e.cov) for e in edges]
    return ClosedTrack(poses, edges, len(added), float(sum(mahalanobis_squared(r, cov) for r, cov in left)))


def _agrees(track: LidarTrack, edge: Edge) -> bool:
    """Between the two poses the chain is at most as unsure as at the later one, seen from the start."""
    r, A, B = residuals(track.poses[edge.i], track.poses[edge.j], edge.pose)
    spread = edge.cov + A @ track.covariances[edge.i] @ A.T + B @ track.covariances[edge.j] @ B.T
    return mahalanobis_squared(r, spread) <= DOUBT**2 * chi2_quantile(0.999, 3)
