"""How fast are two clouds aligned, beside Open3D, and what does a tree save over looking at every pair?

    python benchmarks/icp.py [--rounds 11] [--figure searches.png]

1. The report's experiment: 5750 points, brute force and tree.  Its 77-fold gap, as it is here, and the RMSE of both.
2. Open3D's point-to-point ICP against ours, plain and accelerated: the same clouds, from the identity, pairs within
   0.25 m, and the same stopping rule (neither the share of matched points nor the RMSE changes by more than 1e-9 of
   the cloud's size).  One call of each after the other in one process, so that whatever else the machine does hits
   all alike; the ratio printed is the median of the rounds' ratios.  Open3D uses every core; ours, one.
3. One search of n points among n, over n, and the exponents of the power laws through the times.

Open3D is optional (``pip install open3d``; version 0.20 was used): without it part 2 says so and is left out.  The
clouds of 5750 points are fetched on first use; the larger ones are drawn from them, with 4 mm of noise.  Where they
cannot be had, part 1 is left out, and parts 2 and 3 use a drawn surface of as many points, on which nothing is judged.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# This file is called icp.py and its folder is on the path: without this line it would import itself.
sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from coursekit import geometry, icp  # noqa: E402
from coursekit.icp import BruteForce, KdTree  # noqa: E402
from coursekit.recordings import datasets  # noqa: E402

REACH, TOLERANCE, LIMIT = 0.25, 1e-9, 200
LIMITS = {5750: 0.5, 100_000: 0.25}  # what our accelerated time may be of Open3D's


def drawn(n: int = 5750) -> datasets.Clouds:
    """A stand-in for the recorded clouds: a lumpy closed surface a metre wide, twice, 0.3 rad and 0.1 m apart."""
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(n, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    lumps = 1 + 0.3 * np.sin(3 * ways[:, :1] + 1) * np.cos(2 * ways[:, 1:2]) + 0.4 * np.maximum(ways[:, 2:], 0) ** 2
    source = 0.5 * lumps * ways * [1.2, 0.9, 0.6]
    return datasets.Clouds(source, source @ geometry.so3_exp([0.1, -0.2, 0.2]).T + [0.08, -0.05, 0.03])


def timed(function: Callable[..., Any], *arguments: Any, **options: Any) -> tuple[float, Any]:
    start = time.perf_counter()
    result = function(*arguments, **options)
    return time.perf_counter() - start, result


def search_once(search: Callable[[np.ndarray], Any], points: np.ndarray, target: np.ndarray) -> None:
    search(target).nearest(points, REACH)


def larger(clouds: datasets.Clouds, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Two independent clouds of ``n`` points on the shape of the recorded ones, the same motion apart."""
    T = icp.align(clouds.source, clouds.target, max_distance=REACH).T_target_source
    first, second = (clouds.source[rng.integers(0, len(clouds.source), n)] for _ in range(2))
    return first + rng.normal(0, 0.004, (n, 3)), icp.move(T, second + rng.normal(0, 0.004, (n, 3)))


def ours(source: np.ndarray, target: np.ndarray, accelerate: bool) -> icp.Registration:
    return icp.align(
        source, target, max_distance=REACH, max_iterations=LIMIT, tolerance=TOLERANCE, accelerate=accelerate
    )


def open3d_icp(o3d: Any, source: np.ndarray, target: np.ndarray) -> Any:
    """Its clouds are made inside the timing, as our arrays are checked and our tree is built inside ours."""
    registration = o3d.pipelines.registration
    still = TOLERANCE * float(np.sqrt(np.mean(np.sum((source - source.mean(axis=0)) ** 2, axis=1))))
    a, b = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)) for points in (source, target))
    return registration.registration_icp(
        a, b, REACH, np.eye(4), registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(relative_fitness=TOLERANCE, relative_rmse=still, max_iteration=LIMIT),
    )  # fmt: skip


def the_report(clouds: datasets.Clouds) -> None:
    print("1. The report's experiment: 5750 points, 30 iterations and to the end")
    print(f"   {'search':8} {'iterations':>10} {'time [s]':>9} {'RMSE':>10}   t")
    for limit in (30, 50):
        for search in ("brute", "kdtree"):
            options = {"search": search, "max_distance": REACH, "max_iterations": limit}
            seconds, result = timed(icp.align, clouds.source, clouds.target, **options)
            t = result.T_target_source[:3, 3].round(5)
            print(f"   {search:8} {result.iterations:10d} {seconds:9.2f} {result.rmse:10.7f}   {t}")
    print("   the report: brute force 58.8 s, RMSE 0.0202; tree 0.76 s, RMSE 0.0221; t = [0.4836 -0.2483 0.2557]\n")


def against_open3d(clouds: datasets.Clouds, rounds: int) -> bool:
    print("2. Against Open3D, to convergence")
    try:
        import open3d as o3d
    except ImportError:
        print("   left out: open3d cannot be imported here (pip install open3d)\n")
        return True
    rng, held = np.random.default_rng(0), True
    print(f"   open3d {o3d.__version__}, {rounds} interleaved rounds; medians")
    print(
        f"   {'points':>8} {'Open3D':>9} {'plain':>9} {'fast':>9}   {'fast/Open3D':>11} {'limit':>6}   RMSE differs by"
    )
    for n in LIMITS:
        source, target = (clouds.source, clouds.target) if n == len(clouds.source) else larger(clouds, n, rng)
        times: list[list[float]] = []
        for _ in range(rounds if n < 20_000 else max(3, rounds // 3)):
            peer_time, peer = timed(open3d_icp, o3d, source, target)
            fast_time, fast = timed(ours, source, target, accelerate=True)
            plain_time, _ = timed(ours, source, target, accelerate=False)
            times.append([peer_time, plain_time, fast_time, fast_time / peer_time])
        peer_time, plain_time, fast_time, ratio = np.median(times, axis=0)
        differs = fast.rmse / peer.inlier_rmse - 1
        held &= bool(ratio <= LIMITS[n] and abs(differs) <= 1e-3 and fast.converged)
        times_text = f"{peer_time:8.3f}s {plain_time:8.3f}s {fast_time:8.3f}s"
        print(f"   {n:8d} {times_text}   {ratio:11.2f} {LIMITS[n]:6.2f}   {differs:+.1e}")
    print(f"   {'held' if held else 'NOT HELD'}\n")
    return held


def over_sizes(clouds: datasets.Clouds, rounds: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    print("3. One search of n points among n, clouds laid on each other; best of the rounds")
    rng, curves = np.random.default_rng(1), {}
    T = icp.align(clouds.source, clouds.target, max_distance=REACH).T_target_source
    for name, search, sizes in (
        ("brute force", BruteForce, [500, 1000, 2000, 4000, 8000, 16_000, 32_000]),
        ("k-d tree, with building it", KdTree, [500, 1000, 2000, 4000, 8000, 16_000, 32_000, 64_000, 128_000]),
    ):
        best = []
        for n in sizes:
            source, target = larger(clouds, n, rng)
            moved = icp.move(T, source)
            turns = rounds if n <= 8000 else 3
            best.append(min(timed(search_once, search, moved, target)[0] for _ in range(turns)))
        exponent = np.polyfit(np.log(sizes), np.log(best), 1)[0]
        curves[name] = np.array(sizes), np.array(best)
        print(f"   {name}: time ~ n^{exponent:.2f}")
        print("   " + "  ".join(f"{n}: {1e3 * s:.1f} ms" for n, s in zip(sizes, best, strict=True)))
    return curves


def draw(curves: dict[str, tuple[np.ndarray, np.ndarray]], path: str) -> None:
    from coursekit.teaching import plotting

    fig = plotting.figure()
    ax = plotting.axes(fig)
    for (name, (sizes, seconds)), colour in zip(curves.items(), (plotting.MEASUREMENT, plotting.ESTIMATE), strict=True):
        exponent = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
        ax.loglog(sizes, seconds, "o-", color=colour, label=f"{name}: n^{exponent:.2f}")
    ax.set(
        xlabel="points in each cloud",
        ylabel="one search [s]",
        title="A tree turns a square into little more than a line",
    )
    ax.legend()
    fig.savefig(path, dpi=150)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=11)
    parser.add_argument("--figure", help="where to draw part 3")
    options = parser.parse_args()
    try:
        clouds, recorded = datasets.load("icp_clouds"), True
    except datasets.DatasetUnavailable as error:
        clouds, recorded = drawn(), False
        print(f"1. The report's experiment\n   left out, and a drawn surface used below: {error}\n")
    if recorded:
        the_report(clouds)
    held = against_open3d(clouds, options.rounds) or not recorded
    curves = over_sizes(clouds, options.rounds)
    if options.figure:
        draw(curves, options.figure)
    return 0 if held else 1


if __name__ == "__main__":
    raise SystemExit(main())
