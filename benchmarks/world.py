"""How fast is the world?  Physics against the clock, and the lidar against pymunk's own ray query.

    python benchmarks/world.py [--rounds 15] [--json FILE]

The two ways to scan are measured in turns in one process, so that whatever slows the machine slows both.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402
import pymunk  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit.world.arena import Arena  # noqa: E402
from coursekit.world.lidar import Lidar  # noqa: E402
from coursekit.world.robot import OBSTACLE, World  # noqa: E402


def real_time_factor(name: str, rounds: int, seconds: float = 20.0) -> np.ndarray:
    """Simulated seconds per second, round by round; the robot curls through whatever stands there."""

    def run() -> None:
        world = World(Arena.load(name), seed=0)
        for k in range(round(seconds / world.dt)):
            world.step(0.5, np.sin(k / 30))

    return seconds / results.in_turns({"ours": run}, rounds)["ours"]


def scans(name: str, rounds: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Milliseconds of a scan by one array operation and by 360 queries, round by round, and how far they disagree."""
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

    seconds = results.in_turns({"ours": lambda: lidar.scan(world), "theirs": by_queries}, rounds)
    return 1e3 * seconds["ours"], 1e3 * seconds["theirs"], float(np.abs(lidar.scan(world).ranges - by_queries()).max())


def main() -> int:
    options = results.parser(__doc__, rounds=15).parse_args()
    rows, good = results.Rows("World", threads=1), True
    print(f"median of {options.rounds}\n\narena      physics, × real time (wanted ≥ 20)")
    for name in ("lab", "field", "tags", "corridor"):
        factors = real_time_factor(name, options.rounds)
        good &= bool(np.median(factors) >= 20)
        print(f"{name:<10} {np.median(factors):6.0f}")
        rows.add(f"physics, arena {name} (wanted: at least 20)", "× real time", factors)
    print("\narena      scan of 360 beams   360 pymunk queries   faster by (wanted ≥ 4)   largest difference")
    for name in ("lab", "hallway", "tags", "corridor"):
        ours, theirs, difference = scans(name, options.rounds)
        ratio = np.median(theirs / ours)
        good &= bool(ratio >= 4) and difference < 1e-9
        print(
            f"{name:<10} {np.median(ours):14.3f} ms {np.median(theirs):17.3f} ms {ratio:18.1f} × {difference:22.1e} m"
        )
        by = ("pymunk, 360 queries", results.version("pymunk"))
        rows.add(f"a lidar's scan of 360 beams, arena {name}", "ms", ours, theirs, by)
    rows.store(options.json)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
