r"""Iterative closest point: two clouds, one motion (Lab 6).

Pair each source point with its nearest target point; move the source as these pairs ask; pair again.  Two steps,
each of which can only lower the error, so the iteration always ends, and ends wherever it was started near: ICP
finds *a* minimum, and whether it is *the* minimum is decided by the start.

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
``pairing``       one iteration's two halves: who belongs to whom, and then where to
``fit``           the motion that takes matched points onto their partners: points, planes, robust weights
``matching``      the nearest neighbour, by brute force and by a tree that remembers
``acceleration``  the same answer sooner: subsets, and Anderson's mixing
``surface``       normals from neighbours
``uncertainty``   the covariance of the answer, and what the clouds cannot tell
``start``         a start for clouds of which nothing is known
``odometry``      lidar scans laid on each other: a track, a map
``graph``         closing a loop

Source: Besl & McKay (1992); Chen & Medioni (1992).
"""

from coursekit.icp.fit import KERNELS, Undetermined, move, point_to_plane, point_to_point
from coursekit.icp.graph import Edge, relax
from coursekit.icp.matching import NOBODY, BruteForce, KdTree
from coursekit.icp.odometry import Track, scan_to_map, scan_to_scan
from coursekit.icp.pairing import Step
from coursekit.icp.registration import Registration, align
from coursekit.icp.start import find_start
from coursekit.icp.surface import normals
from coursekit.icp.uncertainty import uncertainty

__all__ = [
    "KERNELS",
    "NOBODY",
    "BruteForce",
    "Edge",
    "KdTree",
    "Registration",
    "Step",
    "Track",
    "Undetermined",
    "align",
    "find_start",
    "move",
    "normals",
    "point_to_plane",
    "point_to_point",
    "relax",
    "scan_to_map",
    "scan_to_scan",
    "uncertainty",
]
