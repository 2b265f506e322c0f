"""What stands behind each row of "How fast, against whom": why it is not faster.  One sentence for each job.

A job is named by the beginning of its row, so that one sentence may serve several sizes; the longest name wins.
"""

from __future__ import annotations

LIMITS: dict[str, dict[str, str]] = {
    "Extended Kalman filter": {
        "one prediction": "Python's calls: the arithmetic on 3 × 3 matrices is a small part of the time, and what is "
        "left are some dozens of calls into NumPy.",
        "one step of": "Memory traffic: one pass of NumPy over all beliefs replaces the calls for each of them, and "
        "beyond some hundred beliefs its temporary arrays leave the cache.",
    },
    "Iterative closest point": {
        "5,750 points, plain": "Queries of the k-d tree, and between them NumPy's passes over the arrays, which the "
        "peers do in one compiled loop; ours also asks for the second nearest point, which later saves most queries.",
        "5,750 points, accelerated": "Python's calls: most iterations run on 89 or 718 of the points, where the query "
        "costs less than the calls around it.",
        "100,000 points": "Queries of the k-d tree, in the few iterations that see all points.",
        "1,000,000 points": "Queries of the k-d tree, whose nodes no longer fit the cache.",
    },
    "EKF-SLAM": {
        "one step": "Memory traffic: each measurement reads and writes one triangle of the covariance, 2 n² numbers "
        "for n landmarks, for four operations each.",
        "joint compatibility": "The number of nodes that branch and bound visits; each costs some dozens of calls and "
        "a triangular solve with all pairs so far.",
    },
    "Least squares over a graph": {
        "": "Python's calls: in every iteration each factor is linearised by a function of its own, in Python here and "
        "compiled in GTSAM; the sparse factorisation comes second.",
    },
    "Particle filter": {
        "one step of": "Arithmetic: normal numbers for the motion and four distances for each particle; from a million "
        "particles on, memory traffic too.",
        "systematic resampling": "Memory traffic: one pass over the weights, one over the indices.",
    },
    "Visual filter": {
        "one frame": "OpenCV: finding SIFT features in the picture takes more than half of it, looking them up on "
        "the map most of the rest.",
        "memory": "The descriptors, 128 floats for each feature, and the search trees over them.",
    },
    "Simulated camera": {
        "one picture": "Arithmetic for each pixel, in OpenCV and NumPy.",
        "one landmark": "Passes over the whole picture, in OpenCV: to smooth it and to find the largest spot "
        "of the colour.",
    },
    "World": {
        "physics": "Python's calls: in each substep pymunk's compiled loop asks a function of ours for the "
        "wheels' grip.",
        "a lidar's scan": "Memory traffic: one array operation over all beams and all walls, which grows with the "
        "walls; pymunk's queries cost 360 calls, whatever stands there.",
    },
    "Imports": {
        "`import coursekit`": "The files that Python reads; the package imports a room when it is first named.",
        "`from coursekit": "The libraries below: Python reads their files, and the room adds its own.",
    },
    "Sliders in JupyterLab": {"": "Matplotlib draws the figure and encodes it as PNG."},
}


def limit(benchmark: str, row: str) -> str:
    """The sentence of a job; "" for one that has none."""
    known = LIMITS.get(benchmark, {})
    names = [name for name in known if row.startswith(name)]
    return known[max(names, key=len)] if names else ""
