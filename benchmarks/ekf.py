"""How fast is a step of localisation, beside filterpy, and how far off on fifteen minutes of a real robot?

    python benchmarks/ekf.py [--rounds 200] [--json FILE] [--folder DIR --robot 1]

1. One prediction and one correction by range and bearing, with the same numbers in and out, by four programs: ours;
   filterpy's ExtendedKalmanFilter with our models; with functions written for it in NumPy, as its documentation does;
   and with functions of plain floats.  filterpy gives the Mahalanobis distance too, as ours gives the NIS.  The
   programs take turns in one process, so that whatever else the machine does hits all alike; each time is the median
   of the rounds, and the ratios are to ours.  Without filterpy (optional) only ours runs.
2. The same step for a hundred and for a thousand beliefs, one by one and at once.
3. MRCLAM 7, robot 1, or any other of the data set's recordings (--folder with its four files): position RMSE over all
   of it with known landmarks, odometry alone for comparison, and what NEES and NIS say.  Left out, with the reason,
   where the recording is not here and cannot be fetched.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# This file is called ekf.py and its folder is on the path: without this line it would import itself.
sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit import ekf  # noqa: E402
from coursekit.gaussian import Gaussian  # noqa: E402
from coursekit.labs.lab09.localisation import localise, start_of  # noqa: E402
from coursekit.models import DifferentialDrive, RangeBearing  # noqa: E402
from coursekit.recordings import Mrclam, datasets, read_mrclam  # noqa: E402

try:
    from filterpy.kalman import ExtendedKalmanFilter as Peer
except ImportError:  # then ``race`` says so, and builds none
    Peer = object

DT, CONTROL, LANDMARK = 0.1, np.array([0.3, 0.1]), np.array([3.0, 2.0])
WRITTEN = {
    "filterpy, our models": "ours",
    "filterpy, NumPy": "in NumPy, as its documentation writes them",
    "filterpy, floats": "in plain floats",
}
SIGMA, R, P0 = np.array([0.05, 0.05]), np.diag([0.01, 0.0004]), 0.1 * np.eye(3)


def ours() -> Callable[[], tuple[np.ndarray, float]]:
    motion, sensor = DifferentialDrive(*SIGMA, (0.0, 0.0, 0.0)), RangeBearing(LANDMARK, R)
    state = {"belief": Gaussian(np.zeros(3), P0)}
    z = np.array([3.5, 0.5])

    def step() -> tuple[np.ndarray, float]:
        seen = ekf.correct(ekf.predict(state["belief"], motion, CONTROL, DT), sensor, z)
        state["belief"] = seen.belief
        return seen.belief.mean, seen.nis

    return step


class Program(Peer):
    """filterpy's filter, given functions: f, F, G of (x, u) and h, H of (x, landmark)."""

    def __init__(self, f: Any, F: Any, Q: Any, h: Any, H: Any, residual: Any) -> None:
        super().__init__(3, 2)
        self.x, self.P, self.R = np.zeros(3), P0.copy(), R.copy()
        self.f_, self.F_, self.Q_, self.h_, self.H_, self.residual_ = f, F, Q, h, H, residual

    def predict_x(self, u: Any = 0) -> None:
        self.x = self.f_(self.x, u)

    def step(self, z: np.ndarray) -> tuple[np.ndarray, float]:
        self.F, self.Q = self.F_(self.x, CONTROL), self.Q_(self.x, CONTROL)
        self.predict(CONTROL)
        self.update(z, self.H_, self.h_, residual=self.residual_)
        return self.x, self.mahalanobis**2


def with_our_models() -> Program:
    motion, sensor = DifferentialDrive(*SIGMA, (0.0, 0.0, 0.0)), RangeBearing(LANDMARK, R)
    return Program(
        lambda x, u: motion.f(x, u, DT), lambda x, u: motion.F(x, u, DT), lambda x, u: motion.Q(x, u, DT),
        sensor.h, sensor.H, sensor.residual,
    )  # fmt: skip


def in_numpy() -> Program:
    def f(x, u):
        half = u[1] * DT / 2
        chord = u[0] * DT * np.sinc(half / np.pi)
        return np.array([x[0] + chord * np.cos(x[2] + half), x[1] + chord * np.sin(x[2] + half), x[2] + u[1] * DT])

    def F(x, u):
        half = u[1] * DT / 2
        chord, a = u[0] * DT * np.sinc(half / np.pi), x[2] + half
        return np.array([[1, 0, -chord * np.sin(a)], [0, 1, chord * np.cos(a)], [0, 0, 1]])

    def Q(x, u):
        half, a = u[1] * DT / 2, x[2] + u[1] * DT / 2
        chord = u[0] * DT * np.sinc(half / np.pi)
        slope = u[0] * DT * (half * np.cos(half) - np.sin(half)) / half**2
        along = DT * np.sinc(half / np.pi)
        G = np.array([[along * np.cos(a), (slope * np.cos(a) - chord * np.sin(a)) * DT / 2],
                      [along * np.sin(a), (slope * np.sin(a) + chord * np.cos(a)) * DT / 2],
                      [0, DT]])  # fmt: skip
        return G @ np.diag(SIGMA**2) @ G.T

    def h(x):
        d = LANDMARK - x[:2]
        return np.array([np.hypot(*d), np.arctan2(d[1], d[0]) - x[2]])

    def H(x):
        dx, dy = LANDMARK - x[:2]
        q = dx**2 + dy**2
        r = np.sqrt(q)
        return np.array([[-dx / r, -dy / r, 0], [dy / q, -dx / q, -1]])

    def residual(z, z_hat):
        y = z - z_hat
        y[1] = (y[1] + np.pi) % (2 * np.pi) - np.pi
        return y

    return Program(f, F, Q, h, H, residual)


def in_floats() -> Program:
    s_v, s_w = SIGMA.tolist()
    lx, ly = LANDMARK.tolist()

    def arc(x, u):
        v, w = u.tolist()
        half = w * DT / 2
        return x.tolist(), v, w, half, v * DT * math.sin(half) / half

    def f(x, u):
        (px, py, theta), _, w, half, chord = arc(x, u)
        return np.array([px + chord * math.cos(theta + half), py + chord * math.sin(theta + half), theta + w * DT])

    def F(x, u):
        (_, _, theta), _, _, half, chord = arc(x, u)
        return np.array([[1, 0, -chord * math.sin(theta + half)], [0, 1, chord * math.cos(theta + half)], [0, 0, 1]])

    def Q(x, u):
        (_, _, theta), v, _, half, chord = arc(x, u)
        c, s = math.cos(theta + half), math.sin(theta + half)
        slope = v * DT * (half * math.cos(half) - math.sin(half)) / half**2
        along = DT * math.sin(half) / half
        G = np.array([[s_v * along * c, s_w * (slope * c - chord * s) * DT / 2],
                      [s_v * along * s, s_w * (slope * s + chord * c) * DT / 2],
                      [0, s_w * DT]])  # fmt: skip
        return G.dot(G.T)

    def h(x):
        px, py, theta = x.tolist()
        return np.array([math.hypot(lx - px, ly - py), math.atan2(ly - py, lx - px) - theta])

    def H(x):
        px, py, _ = x.tolist()
        dx, dy, r = lx - px, ly - py, math.hypot(lx - px, ly - py)
        return np.array([[-dx / r, -dy / r, 0], [dy / r**2, -dx / r**2, -1]])

    def residual(z, z_hat):
        (r, b), (r_hat, b_hat) = z.tolist(), z_hat.tolist()
        return np.array([r - r_hat, (b - b_hat + math.pi) % (2 * math.pi) - math.pi])

    return Program(f, F, Q, h, H, residual)


def race(rounds: int) -> dict[str, np.ndarray]:
    """Seconds a step of each program, round by round; all must give the same answers."""
    z = np.array([3.5, 0.5])
    programs = {}
    if Peer is object:
        print("filterpy left out: it cannot be imported here (pip install filterpy)")
    else:
        programs = {
            "filterpy, our models": with_our_models(),
            "filterpy, NumPy": in_numpy(),
            "filterpy, floats": in_floats(),
        }
    steps: dict[str, Callable[[], tuple[np.ndarray, float]]] = {"ours": ours()}
    steps |= {name: (lambda p: lambda: p.step(z))(program) for name, program in programs.items()}
    answers = {name: step() for name, step in steps.items()}
    for name, (mean, nis) in answers.items():
        assert np.allclose(mean, answers["ours"][0], atol=1e-9), name
        assert abs(nis - answers["ours"][1]) < 1e-6, name
    return results.in_turns(steps, rounds, calls=50)


def at_once(rounds: int, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds of a step for ``runs`` beliefs, one by one and at once, round by round."""
    motion, sensor, rng = DifferentialDrive(*SIGMA), RangeBearing(LANDMARK, R), np.random.default_rng(0)
    many = Gaussian(0.1 * rng.standard_normal((runs, 3)), np.tile(P0, (runs, 1, 1)))
    alone, z = list(many), sensor.h(many.mean) + 0.02 * rng.standard_normal((runs, 2))

    def step(belief: Gaussian, z: np.ndarray) -> ekf.Correction:
        return ekf.correct(ekf.predict(belief, motion, CONTROL, DT), sensor, z)

    def one_by_one() -> None:
        for belief, one in zip(alone, z, strict=True):
            step(belief, one)

    seconds = results.in_turns({"alone": one_by_one, "at once": lambda: step(many, z)}, rounds)
    return seconds["alone"], seconds["at once"]


def real(run: Mrclam) -> None:
    start = time.perf_counter()
    track = localise(run, start_of(run))
    seconds = time.perf_counter() - start
    blind = localise(replace_measurements(run), start_of(run), prior=(1e-6,) * 7)
    errors = np.hypot(*track.errors(run)[:, :2].T)
    print(f"  {track.time[-1] - track.time[0]:.0f} s, {len(track.nis)} measurements, filtered in {seconds:.1f} s")
    print(f"  position RMSE {track.rmse(run):.3f} m (odometry alone {blind.rmse(run):.2f} m), "
          f"median {np.median(errors):.3f} m, worst {errors.max():.2f} m")  # fmt: skip
    print(f"  NEES {np.mean(track.nees(run)):.1f} where 3 is honest; NIS {np.mean(track.nis):.2f} where 2 is")
    learnt = "  learnt: κ {:.2f}, λ {:.2f}, b {:+.3f} m, p {:.2f}, δ {:.2f} s, γ {:+.3f} rad/m, β {:+.3f} rad"
    print(learnt.format(*track.mean[-1, 3:]))


def replace_measurements(run: Mrclam) -> Mrclam:
    return Mrclam(run.odometry, run.measurements[:0], run.landmarks, run.groundtruth, run.dropped)


def main() -> int:
    parser = results.parser(__doc__, rounds=200)
    parser.add_argument("--folder", type=Path, help="of another MRCLAM recording")
    parser.add_argument("--robot", type=int, default=1)
    options = parser.parse_args()
    rows = results.Rows("Extended Kalman filter", threads=1)
    times = race(options.rounds)
    median = {name: float(np.median(seconds)) for name, seconds in times.items()}
    print("one prediction and one correction")
    for name, seconds in times.items():
        print(f"  {name:<22}{1e6 * median[name]:6.1f} µs   {np.median(seconds / times['ours']):5.2f} of ours")
        if name != "ours":
            job = f"one prediction and one correction; the peer's models: {WRITTEN[name]}"
            by = ("filterpy", results.version("filterpy"))
            rows.add(job, "µs", 1e6 * times["ours"], 1e6 * seconds, by)
    if len(times) == 1:
        rows.add("one prediction and one correction", "µs", 1e6 * times["ours"])
    for runs in (100, 1000):
        one_by_one, together = at_once(max(11, options.rounds // 4), runs)
        alone, all_of_them = 1e6 * np.median(one_by_one), 1e6 * np.median(together)
        print(f"{runs} beliefs: one by one {alone:.0f} µs, at once {all_of_them:.0f} µs, "
              f"{np.median(one_by_one / together):.1f} times faster")  # fmt: skip
        by = ("ours, one by one", "")
        rows.add(f"one step of {runs:,} beliefs at once", "µs", 1e6 * together, 1e6 * one_by_one, by)
    rows.store(options.json)
    name = str(options.folder) if options.folder else "MRCLAM 7, robot 1"
    try:
        run = read_mrclam(options.folder, options.robot) if options.folder else datasets.load("mrclam7_robot1")
    except datasets.DatasetUnavailable as error:
        print(f"{name} left out: {error}")
    else:
        print(name)
        real(run)
    return 0 if min(median, key=median.__getitem__) == "ours" else 1


if __name__ == "__main__":
    raise SystemExit(main())
