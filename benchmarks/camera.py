"""How long a picture takes to render and to measure, at 640 × 480.  Run: python benchmarks/camera.py

Wanted: at most 15 ms median for a frame of the lab, walls, crates and six landmarks included.
"""

import time

import numpy as np

from coursekit.landmarks import find_corners, measure
from coursekit.pinhole import COURSE_CAMERA
from coursekit.world.arena import Arena
from coursekit.world.camera import mounted, render

FRAMES = 200


def milliseconds(run, arguments):
    """Median and 95th percentile of the time that ``run`` takes, after one call to warm up."""
    run(*arguments[0])
    times = []
    for some in arguments:
        start = time.perf_counter()
        run(*some)
        times.append(1e3 * (time.perf_counter() - start))
    return f"{np.median(times):6.2f} ms median {np.percentile(times, 95):6.2f} ms at 95 %"


def main():
    rng = np.random.default_rng(0)
    lab, field = Arena.load("lab"), Arena.load("field")
    poses = [(mounted([*rng.uniform(-2.5, 2.5, 2), rng.uniform(-np.pi, np.pi)]),) for _ in range(FRAMES)]
    along = [(mounted([1.5 - d, 0.0, rng.uniform(-0.4, 0.4)]),) for d in rng.uniform(0.8, 15.0, FRAMES)]

    def in_lab(pose):
        return render(COURSE_CAMERA, pose, lab.cylinders, walls=lab.walls, crates=lab.crates, rng=rng)

    def in_field(pose):
        return render(COURSE_CAMERA, pose, field.cylinders, rng=rng)

    print("render, lab: ", milliseconds(in_lab, poses))
    print("render, field:", milliseconds(in_field, along))
    pictures = [(in_field(*pose),) for pose in along]
    print("find + measure:", milliseconds(lambda p: measure(find_corners(p, "cyan"), COURSE_CAMERA), pictures))


if __name__ == "__main__":
    main()
