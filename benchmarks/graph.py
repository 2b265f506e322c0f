"""Least squares over poses and landmarks: how fast, beside GTSAM on the same graph?

    python benchmarks/graph.py [--rounds 3] [--json FILE] [--poses 7000 --edges 60000]

A robot drives round and round through a park of 150 trees; what it measures is drawn: the motion between poses, and
range and bearing of trees near by, not nearer than 2 m, as many as edges are asked.  Both do Gauss-Newton from the same
first guess until nothing moves, and must reach the same χ² to 1e-6 of it.  (GTSAM measures the error between poses
along a geodesic, ours by components; the difference is smaller.)  The factors are made outside the timing.  GTSAM is
optional (``pip install gtsam``).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

# This file's folder is on the path: without this line its neighbours would hide other people's packages.
sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit import geometry, graph  # noqa: E402

TREES = 150
STEP, SIGHT = np.diag([0.02, 0.02, 0.005]) ** 2, np.diag([0.1, 0.01]) ** 2


class Park:
    """Truth, what was measured, and a first guess: poses (n, 3), trees (m, 2)."""

    def __init__(self, poses: int, edges: int) -> None:
        rng = np.random.default_rng(0)
        t = np.linspace(0, 24 * np.pi, poses)  # a rose of petals, round and round
        x, y = 60 * np.cos(t / 6) + 30 * np.cos(t), 60 * np.sin(t / 6) + 30 * np.sin(t)
        truth = np.stack([x, y, np.arctan2(np.gradient(y), np.gradient(x))], axis=-1)
        trees = rng.uniform(-100, 100, (TREES, 2))
        self.steps = geometry.between(truth[:-1], truth[1:]) + rng.normal(size=(poses - 1, 3)) * np.sqrt(np.diag(STEP))
        apart = trees - truth[:, None, :2]
        distance = np.hypot(*np.moveaxis(apart, -1, 0))
        distance[distance < 2.0] = np.inf
        wanted = edges - (poses - 1)
        nearest = np.sort(np.argsort(distance, axis=None)[:wanted])
        self.seen = np.stack(np.unravel_index(nearest, distance.shape), axis=-1)  # (wanted, 2): pose, tree
        i, j = self.seen.T.copy()
        met, self.seen[:, 1] = np.unique(j, return_inverse=True)  # a tree that nobody saw is no unknown
        bearing = np.arctan2(apart[i, j, 1], apart[i, j, 0]) - truth[i, 2]
        noise = rng.normal(size=(wanted, 2)) * np.sqrt(np.diag(SIGHT))
        self.z = np.stack([distance[i, j], geometry.wrap_angle(bearing)], axis=-1) + noise
        self.poses = truth + rng.normal(size=truth.shape) * [0.1, 0.1, 0.02]
        self.poses[0] = truth[0]
        self.trees = trees[met] + 0.3 * rng.normal(size=(len(met), 2))

    def factors(self) -> list[graph.Factor]:
        n = len(self.poses)
        steps = [graph.between_poses(k, k + 1, step, STEP) for k, step in enumerate(self.steps)]
        sights = [graph.sight(i, n + j, z, SIGHT) for (i, j), z in zip(self.seen.tolist(), self.z, strict=True)]
        return [graph.prior(0, self.poses[0], 1e-6 * np.eye(3)), *steps, *sights]


def gtsam_job(park: Park) -> Callable[[], float]:
    """Gauss-Newton by GTSAM → χ²; its ``error`` is half of it."""
    import gtsam

    n, factors, start = len(park.poses), gtsam.NonlinearFactorGraph(), gtsam.Values()
    step, sight = (gtsam.noiseModel.Gaussian.Covariance(cov) for cov in (STEP, SIGHT[::-1, ::-1]))
    known = gtsam.noiseModel.Gaussian.Covariance(1e-6 * np.eye(3))
    factors.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*park.poses[0]), known))
    for k, pose in enumerate(park.steps):
        factors.add(gtsam.BetweenFactorPose2(k, k + 1, gtsam.Pose2(*pose), step))
    for (i, j), (distance, bearing) in zip(park.seen.tolist(), park.z, strict=True):
        factors.add(gtsam.BearingRangeFactor2D(i, n + j, gtsam.Rot2(bearing), distance, sight))
    for k, pose in enumerate(park.poses):
        start.insert(k, gtsam.Pose2(*pose))
    for j, tree in enumerate(park.trees):
        start.insert(n + j, gtsam.Point2(*tree))
    rule = gtsam.GaussNewtonParams()
    rule.setRelativeErrorTol(1e-12)
    rule.setAbsoluteErrorTol(0.0)
    rule.setMaxIterations(30)
    return lambda: 2 * factors.error(gtsam.GaussNewtonOptimizer(factors, start, rule).optimize())


def main() -> int:
    parser = results.parser(__doc__, rounds=3)
    parser.add_argument("--poses", type=int, default=7000)
    parser.add_argument("--edges", type=int, default=60_000)
    options = parser.parse_args()
    park = Park(options.poses, options.edges)
    factors, start = park.factors(), [*park.poses, *park.trees]
    chi2: dict[str, float] = {}
    jobs = {"ours": lambda: chi2.update(ours=graph.optimize(start, factors, tolerance=1e-6).chi2)}
    try:
        peer = gtsam_job(park)
    except ImportError as error:
        print(f"GTSAM left out: it cannot be imported here (pip install gtsam): {error}")
    else:
        jobs["gtsam"] = lambda: chi2.update(gtsam=peer())
    seconds = results.in_turns(jobs, options.rounds)
    print(f"{options.poses:,} poses, {options.edges:,} edges: median of {options.rounds}")
    for name, each in seconds.items():
        ratio = np.median(seconds["ours"] / each)
        print(f"  {name:6} {np.median(each):8.2f} s   χ² {chi2[name]:.6f}   ours takes {ratio:.1f} of it")
    rows = results.Rows("Least squares over a graph", threads=1)
    by = ("GTSAM", results.version("gtsam")) if "gtsam" in jobs else None
    job = f"{options.poses:,} poses, {options.edges:,} edges (wanted: within 3 × of GTSAM)"
    rows.add(job, "s", seconds["ours"], seconds.get("gtsam"), by)
    rows.store(options.json)
    return 0 if abs(chi2["ours"] / chi2.get("gtsam", chi2["ours"]) - 1) <= 1e-6 else 1


if __name__ == "__main__":
    raise SystemExit(main())
