r"""Iterative closest point: two clouds, one motion (Lab 6).

Match each source point with its nearest target point; estimate the motion that brings the pairs together; repeat.
Neither step can raise the error, so the iteration ends.  It ends in *a* minimum; whether it is *the* minimum depends
on the start.

>>> import numpy as np
>>> from coursekit import geometry, icp
>>> target = np.random.default_rng(0).uniform(-2, 2, (200, 2))
>>> pose = np.array([0.05, -0.02, 0.03])                    # of the source's frame, in the target's
>>> source = geometry.transform(geometry.inverse(pose), target)
>>> result = icp.align(source, target)
>>> result.converged, result.pose.round(6)
(True, array([ 0.05, -0.02,  0.03]))

From the top down:

``registration``  ``align``: the iteration, its result, its history
``pairing``       one iteration's two halves: match, then estimate
``fit``           the motion that takes matched points onto their partners: points, planes, robust weights
``matching``      the nearest neighbour, by brute force and by a k-d tree with a memory
``acceleration``  the same answer sooner: subsets, and Anderson's mixing
``surface``       normals from neighbours
``uncertainty``   the covariance of the answer, and the directions that the clouds do not determine
``residuals``     distances of points to surfaces, and what these share
``soundness``     do the clouds lie on each other there?
``global_registration``  ``find_start``, for clouds of which nothing is known
``odometry``      scan to scan, scan to map
``loops``         edges of a pose graph from a track, and from places seen again
``thinning``      voxel thinning
``checks``        what comes in at the door

Closing a loop is ``coursekit.graph``'s; ``Edge`` and ``optimize_pose_graph`` are offered here too.

Source: Besl & McKay (1992); Chen & Medioni (1992).
"""

from coursekit.graph import Edge, optimize_pose_graph
from coursekit.icp.fit import KERNELS, DegenerateGeometry, move, point_to_plane, point_to_point
from coursekit.icp.global_registration import find_start
from coursekit.icp.loops import ClosedTrack, chain, close, closures
from coursekit.icp.matching import NO_MATCH, BruteForce, KdTree
from coursekit.icp.odometry import LidarTrack, scan_to_map, scan_to_scan
from coursekit.icp.pairing import Iteration
from coursekit.icp.registration import Registration, Target, align
from coursekit.icp.surface import normals
from coursekit.icp.thinning import voxel_downsample, voxel_rows
from coursekit.icp.uncertainty import uncertainty

__all__ = [
    "KERNELS",
    "NO_MATCH",
    "BruteForce",
    "ClosedTrack",
    "DegenerateGeometry",
    "Edge",
    "Iteration",
    "KdTree",
    "LidarTrack",
    "Registration",
    "Target",
    "align",
    "chain",
    "close",
    "closures",
    "find_start",
    "move",
    "normals",
    "optimize_pose_graph",
    "point_to_plane",
    "point_to_point",
    "scan_to_map",
    "scan_to_scan",
    "uncertainty",
    "voxel_downsample",
    "voxel_rows",
]
