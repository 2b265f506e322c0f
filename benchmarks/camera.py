"""How long a picture takes to render and to measure, at 640 × 480.  Run: python benchmarks/camera.py [--json FILE]

Wanted: at most 15 ms median for a frame of the lab, walls, crates and six landmarks included.
"""

import sys
import time
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit.landmarks import find_corners, measure  # noqa: E402
from coursekit.pinhole import COURSE_CAMERA  # noqa: E402
from coursekit.world.arena import Arena  # noqa: E402
from coursekit.world.camera import mounted, render  # noqa: E402


def milliseconds(run, arguments):
    """How long ``run`` takes, call by call, after one call to warm up."""
    run(*arguments[0])
    times = []
    for some in arguments:
        start = time.perf_counter()
        run(*some)
        times.append(1e3 * (time.perf_counter() - start))
    return np.array(times)


def main():
    options = results.parser(__doc__, rounds=200).parse_args()
    rows = results.Rows("Simulated camera", threads=1)
    rng = np.random.default_rng(0)
    lab, field = Arena.load("lab"), Arena.load("field")
    poses = [(mounted([*rng.uniform(-2.5, 2.5, 2), rng.uniform(-np.pi, np.pi)]),) for _ in range(options.rounds)]
    along = [(mounted([1.5 - d, 0.0, rng.uniform(-0.4, 0.4)]),) for d in rng.uniform(0.8, 15.0, options.rounds)]

    def in_lab(pose):
        return render(COURSE_CAMERA, pose, lab.cylinders, walls=lab.walls, crates=lab.crates, rng=rng)

    def in_field(pose):
        return render(COURSE_CAMERA, pose, field.cylinders, rng=rng)

    def show(job, times):
        print(f"{job}: {np.median(times):6.2f} ms median {np.percentile(times, 95):6.2f} ms at 95 %")
        rows.add(job, "ms", times)

    show("one picture of the lab rendered (wanted: at most 15 ms)", milliseconds(in_lab, poses))
    show("one picture of the field rendered", milliseconds(in_field, along))
    pictures = [(in_field(*pose),) for pose in along]
    measuring = milliseconds(lambda p: measure(find_corners(p, "cyan"), COURSE_CAMERA), pictures)
    show("one landmark found and measured", measuring)
    rows.store(options.json)


if __name__ == "__main__":
    main()
