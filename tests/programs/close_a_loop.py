"""A pose graph: four sides of a square, and the measurement that closes it."""

from coursekit.graph import Edge, optimize_pose_graph, prior

noise = [[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.001]]
poses = [(0.0, 0.0, 0.0), (1.1, 0.0, 1.5), (1.0, 1.2, 3.1), (0.0, 1.0, -1.5)]
edges = [Edge(i, (i + 1) % 4, [1.0, 0.0, 1.5707963], noise) for i in range(4)]
solution = optimize_pose_graph(poses, edges)
assert abs(solution[1][0] - 1.0) < 0.01
assert prior(0, [0.0, 0.0, 0.0], noise).at == (0,)
