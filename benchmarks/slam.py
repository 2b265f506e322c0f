"""What does a step of EKF-SLAM cost as the map grows, beside whole matrices and Corke's toolbox?

    python benchmarks/slam.py [--rounds 15] [--json FILE] [--figure growth.png]

A step is a prediction and one measurement of a landmark that is in the map, ids known, for maps of 10 to 1,000
landmarks.  Three programs: ours, which downdates one triangle in place; the textbook's whole matrices and (I - K H) P;
and roboticstoolbox's EKF with its defaults (``pip install roboticstoolbox-python``; version 1.5.0 was used; without it
that column is left out).  All start from the same map.  Each time is the least of the rounds.  At 1,000 landmarks ours
and the toolbox run in turns, too; of 3,000 landmarks, and of joint compatibility with 100 measurements of 1,000
landmarks, ours alone is timed.  BLAS is held to one
thread, which favours none: the machine's other cores would help the whole matrices only.
"""

from __future__ import annotations

import itertools
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# This file is called slam.py and its folder is on the path: without this line it would import itself.
sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit.gaussian import Gaussian  # noqa: E402
from coursekit.models import DifferentialDrive, RangeBearing  # noqa: E402
from coursekit.slam import EkfSlam  # noqa: E402
from coursekit.slam.association import Association, JointCompatibility, Known, Mahalanobis  # noqa: E402
from coursekit.teaching import plotting  # noqa: E402

SIZES = (10, 20, 50, 100, 200, 500, 1000)
CONTROL, DT, R = np.array([0.3, 0.1]), 0.05, np.diag([0.1, 0.02]) ** 2
START = Gaussian(np.zeros(3), 1e-4 * np.eye(3))
Step = Callable[[int], object]


def world(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n landmarks, and how they look from the start."""
    points = np.random.default_rng(n).uniform(-30, 30, (n, 2))
    return points, np.stack([np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])], axis=-1)


def ours(n: int, rule: Association | None = None) -> tuple[EkfSlam, Step]:
    _, z = world(n)
    slam = EkfSlam(START, DifferentialDrive(), Known())
    slam.observe(z, R, list(range(n)))
    slam.associate = rule or slam.associate

    def step(i: int) -> None:
        slam.predict(CONTROL, DT)
        slam.observe(z[i : i + 1], R, [i])

    return slam, step


class Whole:
    """The textbook's EKF-SLAM (Thrun, Burgard & Fox 2005, table 10.1), whole matrices throughout."""

    def __init__(self, start: EkfSlam, z: np.ndarray) -> None:
        self.x, self.P, self.z, self.motion = start.mean.copy(), start.cov.copy(), z, DifferentialDrive()

    def step(self, i: int) -> None:
        n, x = len(self.x), self.x[:3]
        F, Q = np.eye(n), np.zeros((n, n))
        F[:3, :3], Q[:3, :3] = self.motion.F(x, CONTROL, DT), self.motion.Q(x, CONTROL, DT)
        self.x[:3], self.P = self.motion.f(x, CONTROL, DT), F @ self.P @ F.T + Q
        a, H = 3 + 2 * i, np.zeros((2, n))
        sensor = RangeBearing(self.x[a : a + 2], R)
        H[:, :3], H[:, a : a + 2] = sensor.H(self.x[:3]), sensor.H_landmark(self.x[:3])
        innovation = sensor.residual(self.z[i], sensor.h(self.x[:3]))
        S = H @ self.P @ H.T + R
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ innovation
        self.P = (np.eye(n) - K @ H) @ self.P


def update_alone(n: int) -> tuple[Step, Step]:
    """Only the covariance's update, as (I - K H) P and in place."""
    from scipy.linalg.blas import dsyrk

    rng, size = np.random.default_rng(0), 3 + 2 * n
    P = np.asfortranarray(np.eye(size))
    H, K, W = (
        np.zeros((2, size)),
        1e-3 * rng.normal(size=(size, 2)),
        np.asfortranarray(1e-6 * rng.normal(size=(size, 2))),
    )
    H[:, :5] = 1.0
    identity = np.eye(size)
    return lambda i: (identity - K @ H) @ P, lambda i: dsyrk(-1.0, W, beta=1.0, c=P, overwrite_c=1, lower=1)


def toolbox(n: int, start: EkfSlam, z: np.ndarray) -> Step | None:
    """Corke's EKF, its robot and sensor replaced by ones that say what the others are told."""
    try:
        import roboticstoolbox as rtb
    except ImportError:
        return None
    points, _ = world(n)
    V = np.diag([0.02, 0.01]) ** 2
    robot = rtb.Bicycle(covar=V, x0=(0, 0, 0))
    arena = rtb.LandmarkMap(points.T)
    sensor = rtb.RangeBearingSensor(robot, arena, covar=R)
    filter_: Any = rtb.EKF(robot=(robot, V), P0=START.cov, sensor=(sensor, R))
    filter_.init()
    filter_._landmarks = {i: [i, 1] for i in range(n)}
    filter_._x_est, filter_._P_est = start.mean.copy(), start.cov.copy()
    robot.step = lambda pause=False: CONTROL * DT
    reading: dict[str, Any] = {}
    sensor.reading = lambda: (reading["z"], reading["i"])

    def step(i: int) -> None:
        reading.update(z=z[i].copy(), i=i)
        filter_.step()

    return step


def least(step: Step | None, n: int, rounds: int) -> float:
    if step is None:
        return np.nan
    times = []
    for k in range(rounds + 1):
        start = time.perf_counter()
        step(k % n)
        times.append(time.perf_counter() - start)
    return min(times[1:])


def in_turns(step: Step, n: int) -> Callable[[], object]:
    """The step with another landmark each time."""
    landmarks = itertools.cycle(range(n))
    return lambda: step(next(landmarks))


def stored(rounds: int, path: Path | None) -> None:
    """The rows for the book."""
    rows = results.Rows("EKF-SLAM", threads=1)
    slam, step = ours(1000)
    jobs = {"ours": in_turns(step, 1000)}
    if corke := toolbox(1000, slam, world(1000)[1]):
        jobs["toolbox"] = in_turns(corke, 1000)
    ms = {name: 1e3 * seconds for name, seconds in results.in_turns(jobs, max(11, rounds)).items()}
    by = ("roboticstoolbox-python", results.version("roboticstoolbox-python")) if corke else None
    rows.add("one step, 1,000 landmarks", "ms", ms["ours"], ms.get("toolbox"), by)
    many = 1e3 * results.in_turns({3000: in_turns(ours(3000)[1], 3000)}, 3 * rounds)[3000]
    rows.add("one step, 3,000 landmarks (wanted: at most 10 ms)", "ms", many)
    whom = joint_compatibility(1000, 100)
    seconds = results.in_turns({"joint": whom}, rounds)["joint"]
    rows.add("joint compatibility, the nearest 100 of 1,000 landmarks measured (wanted: at most 0.2 s)", "s", seconds)
    print(f"a step with 3,000 landmarks {np.median(many):.1f} ms; "
          f"joint compatibility, 100 of 1,000 {np.median(seconds):.3f} s, {whom()} found right")  # fmt: skip
    rows.store(path)


def joint_compatibility(n: int, m: int) -> Callable[[], int]:
    """A map of n landmarks, and noisy measurements of the m nearest: how many does the rule give to the right ones?"""
    slam, _ = ours(n)
    slam.predict(CONTROL, DT)
    x, y, theta = slam.pose.mean
    dx, dy = (slam.landmarks - [x, y]).T
    nearest = np.argsort(np.hypot(dx, dy))[:m]
    exact = np.stack([np.hypot(dx, dy), np.arctan2(dy, dx) - theta], axis=-1)[nearest]
    z = exact + np.random.default_rng(0).normal(size=(m, 2)) * np.sqrt(np.diag(R))
    rule = JointCompatibility(0.99)
    return lambda: int(np.sum(rule(slam._observations(z, np.tile(R, (m, 1, 1)), None)) == nearest))


def main() -> int:
    parser = results.parser(__doc__, rounds=15)
    parser.add_argument("--figure", type=Path, help="where to draw the growth")
    options = parser.parse_args()
    names = ("ours, ids known", "ours, gate", "whole matrices", "toolbox")
    table = np.empty((len(SIZES), len(names)))
    print("milliseconds a step\n" + f"{'landmarks':>10}" + "".join(f"{name:>18}" for name in names))
    for row, n in zip(table, SIZES, strict=True):
        slam, known = ours(n)
        _, gated = ours(n, Mahalanobis(0.99))
        z = world(n)[1]
        slow = max(3, options.rounds // 5) if n > 300 else options.rounds
        many = options.rounds * (20 if n < 300 else 4)
        row[0], row[1] = least(known, n, many), least(gated, n, many)
        row[2] = least(Whole(slam, z).step, n, slow if n > 300 else many)
        row[3] = least(toolbox(n, slam, z), n, slow)
        print(f"{n:>10}" + "".join(f"{1e3 * t:18.3f}" for t in row), flush=True)
    if np.isnan(table[:, 3]).all():
        print("toolbox left out: roboticstoolbox cannot be imported here (pip install roboticstoolbox-python)")
    ratio = table[:, 2:] / table[:, :1]
    first, last = SIZES.index(200), SIZES.index(1000)
    exponents = np.log(table[last] / table[first]) / np.log(SIZES[last] / SIZES[first])
    dense, in_place = (least(step, 1000, options.rounds) for step in update_alone(1000))
    dense_10, in_place_10 = (least(step, 10, 2000) for step in update_alone(10))
    print(f"exponent from 200 to 1,000 landmarks: ours {exponents[0]:.2f} (gate {exponents[1]:.2f}), "
          f"whole matrices {exponents[2]:.2f}, toolbox {exponents[3]:.2f}")  # fmt: skip
    print(f"at 10 landmarks: {ratio[0, 0]:.1f} × faster than whole matrices, {ratio[0, 1]:.0f} × than the toolbox")
    print(f"at 1,000 landmarks: {ratio[-1, 0]:.0f} × faster than whole matrices, {ratio[-1, 1]:.0f} × than the toolbox")
    print(f"the covariance's update alone: {dense / in_place:.0f} × at 1,000, {dense_10 / in_place_10:.1f} × at 10")
    stored(options.rounds, options.json)
    if options.figure:
        draw(table, names, options.figure)
    held = exponents[0] <= 2 and ratio[0, 0] >= 1 and ratio[-1, 0] >= 300 and dense / in_place >= 300
    return 0 if held and (np.isnan(ratio[-1, 1]) or ratio[-1, 1] >= 150) else 1


def draw(table: np.ndarray, names: tuple[str, ...], path: Path) -> None:
    fig = plotting.figure(6.4, 4.2)
    ax = plotting.axes(fig)
    lines = [ax.plot(SIZES, 1e3 * column, "o-", label=name)[0] for column, name in zip(table.T, names, strict=True)]
    ax.set(xscale="log", yscale="log", xlabel="landmarks in the map", ylabel="ms a step", xlim=(9, 4000))
    ax.set_title("A step of EKF-SLAM")
    plotting.label_lines(ax, lines)
    fig.savefig(path)


if __name__ == "__main__":
    raise SystemExit(main())
