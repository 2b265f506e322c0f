"""What each estimator says when its model is simply wrong: the table of the page when_the_model_is_wrong.

    python book/wrong_models.py              write the table into the page
    python book/wrong_models.py --show       show it

Each row is a function that runs an estimator twice, with the right model and with a wrong one, and returns what it says
both times; ``tests/hostile/test_wrong_models.py`` holds the page to it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from coursekit import ekf, graph, icp, landmarks, models, noise, particles, pinhole, slam, visual
from coursekit.gaussian import Gaussian
from coursekit.geometry import compose, homogeneous
from coursekit.recordings import Log
from coursekit.results import Rejected

PAGE = Path(__file__).parent / "when_the_model_is_wrong.md"
BEGIN, END = "<!-- written by book/wrong_models.py -->", "<!-- so far -->"
MAP = np.array([[3.0, 1.0], [2.0, -2.0], [-2.0, 2.0], [-1.5, -2.5]])
MOVED = MAP + np.array([[1.0, -0.5], [-0.8, 0.6], [0.5, 1.0], [1.2, 0.4]])
R = np.diag([0.1, 0.03]) ** 2
DRIVE = models.DifferentialDrive(0.05, 0.05)
CONTROL, DT = np.array([0.4, 0.3]), 0.25
FINE = "nothing: all is well"


def drive(rng: np.random.Generator, looks: int = 60):
    """A robot on a circle among the landmarks of ``MAP``: its start, and of each moment the four measurements."""
    pose = np.zeros(3)
    for _ in range(looks):
        pose = DRIVE.sample(pose, CONTROL, DT, rng)
        yield np.array([models.RangeBearing(tag).h(pose) + rng.normal(0, [0.1, 0.03]) for tag in MAP])


def filter_on(tags: np.ndarray) -> str:
    belief, watch = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2), ekf.Watch()
    for z in drive(np.random.default_rng(4)):
        belief = ekf.predict(belief, DRIVE, CONTROL, DT)
        seen = ekf.correct_together(belief, [models.RangeBearing(tag) for tag in tags], z, R)
        belief, watch.time = seen.belief, watch.time + DT
        watch.looked(seen.nis, seen.innovation.size)
    return FINE if watch.lost is None else watch.lost.reason


def cloud_in(tags: np.ndarray) -> str:
    rng, watch = np.random.default_rng(5), ekf.Watch()
    cloud = particles.Particles(rng.normal(0, [0.3, 0.3, 0.2], (1000, 3)), angles=(2,))
    for z in drive(np.random.default_rng(4)):
        cloud, nis = particles.predict(cloud, DRIVE, CONTROL, DT, rng), 0.0
        for tag, one in zip(tags, z, strict=True):
            nis += particles.nis(cloud, models.RangeBearing(tag), one, R)
        watch.looked(nis, z.size)
        cloud = particles.weigh_together(cloud, [models.RangeBearing(tag) for tag in tags], z, R).cloud
        cloud = particles.resample(cloud, rng)
    return FINE if watch.lost is None else watch.lost.reason


def map_from(names: Callable[[int], list[int]]) -> str:
    built = slam.EkfSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DRIVE, slam.Known())
    for k, z in enumerate(drive(np.random.default_rng(4))):
        built.predict(CONTROL, DT)
        built.observe(z, R, ids=names(k))
    return FINE if built.lost is None else built.lost.reason


def ground(seed: int) -> np.ndarray:
    """A map of nothing but blobs, 300 by 240 pixels."""
    blobs = cv2.GaussianBlur(np.random.default_rng(seed).integers(0, 256, (240, 300), dtype=np.uint8), (0, 0), 3.0)
    return np.asarray(cv2.normalize(blobs, None, 0, 255, cv2.NORM_MINMAX))


def fix_on(map_image: np.ndarray) -> str:
    fix = visual.MapMatcher(map_image).locate(ground(0)[60:180, 90:230])
    return fix.reason if isinstance(fix, Rejected) else FINE


def log_of(order: str) -> Log:
    """A log of a drive towards a landmark and away again; its truth in order, or not."""
    rng, at = np.random.default_rng(7), 4.5 - 3.5 * np.cos(np.linspace(0, 4 * np.pi, 400))
    bearing = 0.3 * np.sin(np.linspace(0, 9, 400))
    log = Log(at + rng.normal(0, 0.03, 400), bearing + rng.normal(0, 0.01, 400), at, bearing, 0.1 * np.arange(400))
    mixed = rng.permutation(400)
    return log if order == "right" else replace(log, true_range=at[mixed], true_bearing=bearing[mixed])


def noise_from(log: Log) -> str:
    return noise.fit_calibrated(log).doubt(log) or FINE


def wall(n: int = 400) -> np.ndarray:
    """A room with a bay, seen from inside: (n, 2), m."""
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return (2 + 0.5 * np.cos(3 * turn) + 0.3 * np.sin(turn))[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def aligned(target: np.ndarray) -> str:
    rng = np.random.default_rng(8)
    source = icp.move(homogeneous([0.05, -0.03, 0.04]), wall()) + rng.normal(0, 0.01, (400, 2))
    result = icp.align(source, target + rng.normal(0, 0.01, target.shape))
    return FINE if result.converged else result.reason


def closed(at: int) -> str:
    """Twenty poses on a circle, with a loop that closes where it should, or at another pose."""
    rng, sigma = np.random.default_rng(9), np.array([0.02, 0.02, 0.01])
    steps = np.array([0.5, 0.0, 2 * np.pi / 20]) + rng.normal(0, sigma, (20, 3))
    poses = [np.zeros(3)]
    for step in steps[:-1]:
        poses.append(compose(poses[-1], step))
    cov = np.diag(sigma**2)
    factors = [graph.prior(0, np.zeros(3), 1e-6 * np.eye(3))]
    factors += [graph.between_poses(k, k + 1, step, cov) for k, step in enumerate(steps[:-1])]
    factors += [graph.between_poses(19, at, steps[-1], cov)]
    return graph.optimize(poses, factors).reason or FINE


def measured(share: float) -> str:
    """The outline of a cylinder, 0.5 m high and 0.25 m wide, of which so much of the width can be seen."""
    seen = pinhole.project_cylinder(3.0, 0.1, pinhole.COURSE_CAMERA, 0.5, radius=0.125)
    left, top = float(seen.left_px), 200.0
    right, bottom = left + share * float(seen.right_px - seen.left_px), top + float(seen.height_px)
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    pixels = landmarks.measure(corners, pinhole.COURSE_CAMERA, aspect=0.5)
    return pixels.reason if isinstance(pixels, Rejected) else FINE


ROWS: dict[str, tuple[str, str, Callable[[], str], Callable[[], str]]] = {
    "ekf": ("`ekf`, watched by `ekf.Watch`", "all landmarks of the map stand elsewhere",
            lambda: filter_on(MAP), lambda: filter_on(MOVED)),
    "particles": ("`particles`, `particles.nis` watched by `ekf.Watch`", "the room is another one",
                  lambda: cloud_in(MAP), lambda: cloud_in(MOVED)),
    "slam": ("`slam.EkfSlam`, its `lost`", "the ids are dealt out anew at each look",
             lambda: map_from(lambda k: [0, 1, 2, 3]),
             lambda: map_from(lambda k: np.random.default_rng(k).permutation(4).tolist())),
    "visual": ("`visual.MapMatcher.locate`", "the map shows another ground",
               lambda: fix_on(ground(0)), lambda: fix_on(ground(1))),
    "noise": ("`noise.fit_calibrated`, the model's `doubt`", "the truth stands in another order",
              lambda: noise_from(log_of("right")), lambda: noise_from(log_of("mixed"))),
    "icp double": ("`icp.align`, its `reason`", "the target is twice as large",
                   lambda: aligned(wall()), lambda: aligned(2 * wall())),
    "icp mirror": ("`icp.align`, its `reason`", "the target is a mirror image",
                   lambda: aligned(wall()), lambda: aligned(wall() * [-1, 1] @ [[0.6, -0.8], [0.8, 0.6]])),
    "graph": ("`graph.optimize`, the solution's `reason`", "a loop is closed at the pose opposite",
              lambda: closed(0), lambda: closed(10)),
    "landmarks": ("`landmarks.measure`, told the aspect", "half of the landmark is hidden",
                  lambda: measured(1.0), lambda: measured(0.5)),
}  # fmt: skip


def table() -> str:
    lines = [
        "| estimator | what is wrong | with the right model it says | with the wrong one |",
        "| --- | --- | --- | --- |",
    ]
    lines += [f"| {who} | {what} | {right()} | {wrong()} |" for who, what, right, wrong in ROWS.values()]
    return "\n".join(lines)


def main() -> None:
    if "--show" in sys.argv:
        print(table())
        return
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n\n{table()}\n\n{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
