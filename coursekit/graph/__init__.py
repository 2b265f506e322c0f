r"""Least squares over everything at once: poses and landmarks, tied together by what was measured.

``least_squares``  factors, ``optimize``, and ``optimize_pose_graph`` for poses alone
``g2o``            graphs of poses and landmarks from and to the files of other programs

>>> import numpy as np
>>> edges = [Edge(0, 1, [1.0, 0.0, 0.0], np.eye(3)), Edge(0, 1, [1.2, 0.0, 0.0], np.eye(3))]
>>> optimize_pose_graph(np.zeros((2, 3)), edges)[1].round(6) + 0.0
array([1.1, 0. , 0. ])

Source: Lu & Milios (1997); Dellaert & Kaess (2006); Grisetti, Kümmerle, Stachniss & Burgard (2010).
"""

from coursekit.graph.g2o import Graph, read_g2o, write_g2o
from coursekit.graph.least_squares import (
    Edge,
    Factor,
    PointEdge,
    Solution,
    between_poses,
    motion_step,
    optimize,
    optimize_pose_graph,
    point_from,
    prior,
    residuals,
    sight,
)

__all__ = [
    "Edge",
    "Factor",
    "Graph",
    "PointEdge",
    "Solution",
    "between_poses",
    "motion_step",
    "optimize",
    "optimize_pose_graph",
    "point_from",
    "prior",
    "read_g2o",
    "residuals",
    "sight",
    "write_g2o",
]
