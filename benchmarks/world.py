"""How fast is the world?  Physics against the clock, and the lidar against pymunk's own ray query.

The two ways to scan are measured in turns in one process, so that whatever slows the machine slows both.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable
from time import perf_counter

import numpy as np
import pymunk

from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar
from coursekit.world.robot import OBSTACLE, World

ROUNDS = 15


def interleaved(*runs: Callable[[], object]) -> list[float]:
    """Median seconds of each, taken in turns."""
    times: list[list[float]] = [[] for _ in runs]
    for _ in range(ROUNDS):
        for run, taken in zip(runs, times, strict=True):
            started = perf_counter()
            run()
            taken.append(perf_counter() - started)
    return [statistics.median(taken) for taken in times]


def real_time_factor(name: str, seconds: float = 20.0) -> float:
    """Simulated seconds per second, median of the rounds; the robot curls through whatever stands there."""

    def run() -> None:
        world = World(Arena.load(name), seed=0)
        for k in range(round(seconds / world.dt)):
            world.step(0.5, np.sin(k / 30))

    return seconds / interleaved(run)[0]


def scans(name: str) -> tuple[float, float, float]:
    """Milliseconds of a scan by one array operation and by 360 queries, and their greatest disagreement."""
    world, lidar = World(Arena.load(name), seed=0), Lidar(max_range=80.0)
    for _ in range(60):
        world.step(0.5, 0.4)
    obstacles = pymunk.ShapeFilter(mask=OBSTACLE)

    def by_queries() -> np.ndarray:
        x, y, heading = world.pose.tolist()
        angles = heading + lidar.angles
        ends = zip((x + 80 * np.cos(angles)).tolist(), (y + 80 * np.sin(angles)).tolist(), strict=True)
        hits = [world.space.segment_query_first((x, y), end, 0.0, obstacles) for end in ends]
        return np.array([80 * hit.alpha if hit else np.inf for hit in hits])

    ours, theirs = interleaved(lambda: lidar.scan(world), by_queries)
    return 1e3 * ours, 1e3 * theirs, float(np.abs(lidar.scan(world).ranges - by_queries()).max())


def main() -> int:
    good = True
    print(f"median of {ROUNDS}\n\narena      physics, × real time (wanted ≥ 20)")
    for name in ("lab", "field", "tags", "corridor"):
        factor = real_time_factor(name)
        good &= factor >= 20
        print(f"{name:<10} {factor:6.0f}")
    print("\narena      scan of 360 beams   360 pymunk queries   faster by (wanted ≥ 4)   largest difference")
    for name in ("lab", "hallway", "tags", "corridor"):
        ours, theirs, difference = scans(name)
        good &= theirs >= 4 * ours and difference < 1e-9
        print(f"{name:<10} {ours:14.3f} ms {theirs:17.3f} ms {theirs / ours:18.1f} × {difference:22.1e} m")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
