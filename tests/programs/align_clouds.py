"""ICP in two and three dimensions, from lists of points."""

import numpy as np

from coursekit import align, find_start, geometry, icp

rng = np.random.default_rng(0)
room = rng.uniform(-2, 2, (200, 2))
moved = geometry.transform(geometry.inverse([0.05, -0.02, 0.03]), room)
found = align(moved.tolist(), room.tolist(), initial=[[1, 0, 0], [0, 1, 0], [0, 0, 1]])
assert found.converged and abs(found.pose[0] - 0.05) < 1e-6
assert find_start(moved, room).shape == (3, 3)
solid = rng.uniform(-1, 1, (300, 3))
assert align(np.add(solid, (0.01, 0.0, 0.0)), solid, metric="point_to_plane").T_target_source.shape == (4, 4)
assert icp.point_to_point([[0, 0], [1, 0], [0, 1]], [(1, 0), (2, 0), (1, 1)]).shape == (3, 3)
