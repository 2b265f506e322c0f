"""Which part makes a filter too sure?  Swap true parts into its drives, one at a time."""

from __future__ import annotations

import numpy as np

from coursekit import graph
from coursekit.gaussian import Gaussian, mahalanobis_squared
from coursekit.geometry import Array
from coursekit.graph import Factor
from coursekit.labs.lab05.runs.drives import ARENA, DT, MOTION, Drive, Look, glimpse
from coursekit.models import RangeBearing, SlippingWheels, pose_residual, range_bearing
from coursekit.slam import EkfSlam
from coursekit.slam.association import Association

TAG_AT = {tag.id: np.array(tag.position) for tag in ARENA.tags}
_SENSORS = {i: RangeBearing(position) for i, position in TAG_AT.items()}


def motion(scale: float = 1.0) -> SlippingWheels:
    """The lab's wheels, with ``scale`` times their noise."""
    slip = tuple(scale * s for s in MOTION.sigma_pose)
    return SlippingWheels(sigma_pose=slip, slip=scale * MOTION.slip, tick=scale * MOTION.tick)  # type: ignore[arg-type]


def fresh(kind: type[EkfSlam], rule: Association, run: Drive, scale: float = 1.0) -> EkfSlam:
    """A filter that has not seen anything of the drive yet, and knows that all noise is scaled."""
    return kind(Gaussian(run.start.mean, scale**2 * run.start.cov), motion(scale), rule)


def redrawn(run: Drive, rng: np.random.Generator, scale: float = 1.0) -> Drive:
    """The same odometry, but a truth that was drawn from Q and looks that were drawn from R, both scaled.

    Nothing is left here that the filter's model does not say: what goes wrong, the filter does by itself.
    """
    wheels, truth, looks = motion(scale), [run.truth[0]], []
    for u, look in zip(run.odometry, run.looks, strict=True):
        pose = wheels.sample(truth[-1][None], u, DT, rng)[0]
        truth.append(pose)
        looks.append(_scaled(glimpse(pose, rng), pose, scale) if look else None)
    return Drive(np.array(truth), run.odometry, looks, run.lap_ends)


def verdict(run: Drive, slam: EkfSlam, told: bool = True) -> tuple[float, float]:
    """(NEES of the pose, averaged over the looks; NEES of the map at the end, for each of its numbers).

    told : does the filter hear the ids?  If not, a landmark is scored by the tag that it was mostly taken for.
    """
    scores: list[float] = []
    names: dict[int, list[int]] = {}
    for u, look, pose in zip(run.odometry, run.looks, run.truth[1:], strict=True):
        slam.predict(u, DT)
        if look is None:
            continue
        chosen = slam.observe(look.z, look.R, ids=look.ids.tolist() if told else None)
        for i, j in zip(look.ids.tolist(), chosen.tolist(), strict=True):
            names.setdefault(j, []).append(i)
        belief = slam.pose
        scores.append(mahalanobis_squared(pose_residual(belief.mean, pose), belief.cov))
    tags = [max(set(names[j]), key=names[j].count) for j in range(len(slam.landmarks))]
    error = slam.landmarks - [TAG_AT[i] for i in tags]
    return float(np.mean(scores)), mahalanobis_squared(error.ravel(), slam.cov[3:, 3:]) / error.size


def heading(run: Drive, slam: EkfSlam) -> tuple[Array, Array, Array]:
    """After each look, with ids: time, error of the heading, its σ, in s and rad."""
    rows = []
    for k, (u, look) in enumerate(zip(run.odometry, run.looks, strict=True), 1):
        slam.predict(u, DT)
        if look:
            slam.observe(look.z, look.R, ids=look.ids.tolist())
            belief = slam.pose
            error = pose_residual(belief.mean, run.truth[k])[2]
            rows.append((DT * k, error, np.sqrt(belief.cov[2, 2])))
    time, error, sigma = np.array(rows).T
    return time, error, sigma


def as_factors(run: Drive, slam: EkfSlam) -> tuple[list[Array], list[Factor], list[int]]:
    """A drive as a problem of least squares: first guesses, factors, and the tag of each landmark.

    The unknowns are the poses, one after each control step, then the landmarks in the order in which they were seen.
    ``slam`` gives the first guesses; it gets the ids.
    """
    n = len(run.odometry)
    poses, points = [run.start.mean], dict[int, Array]()
    factors, sights = [graph.prior(0, run.start.mean, run.start.cov)], list[tuple[int, int, Array, Array]]()
    for k, (u, look) in enumerate(zip(run.odometry, run.looks, strict=True)):
        factors.append(graph.motion_step(k, k + 1, MOTION, u, DT, near=poses[-1]))
        slam.predict(u, DT)
        for i, z, R in zip(look.ids.tolist(), look.z, look.R, strict=True) if look else ():
            points.setdefault(i, range_bearing.g(slam.pose.mean, z))
            sights.append((k + 1, i, z, R))
        if look:
            slam.observe(look.z, look.R, ids=look.ids.tolist())
        poses.append(slam.pose.mean)
    at = {name: n + 1 + j for j, name in enumerate(points)}
    factors += [graph.sight(k, at[i], z, R) for k, i, z, R in sights]
    return [*poses, *points.values()], factors, list(points)


def smoothed_verdict(run: Drive, slam: EkfSlam) -> tuple[float, float]:
    """``verdict`` on the most likely drive and map, given *all* odometry and all looks: least squares, ids known.

    The same f, h, Q and R as the filter's, but everything is linearized again at the newest estimate of everything.
    """
    values, factors, names = as_factors(run, slam)
    solution, n = graph.optimize(values, factors, tolerance=1e-5), len(run.odometry)
    scores = []
    for k in range(10, n + 1, 20):
        scores.append(mahalanobis_squared(pose_residual(solution.values[k], run.truth[k]), solution.cov(k)))
    error = np.concatenate(solution.values[n + 1 :]) - np.concatenate([TAG_AT[i] for i in names])
    cov = solution.cov(*range(n + 1, n + 1 + len(names)))
    return float(np.mean(scores)), mahalanobis_squared(error, cov) / error.size


def longest_blind(run: Drive) -> tuple[float, float, float]:
    """When the longest stretch without a tag begins, when it ends, and when a tag from before it comes back, s."""
    looks = [(DT * k, set(look.ids.tolist())) for k, look in enumerate(run.looks, 1) if look and len(look.ids)]
    gap = max(range(1, len(looks)), key=lambda i: looks[i][0] - looks[i - 1][0])
    before = set.union(*(ids for _, ids in looks[:gap]))
    back = next((time for time, ids in looks[gap:] if ids & before), looks[-1][0])
    return looks[gap - 1][0], looks[gap][0], back


def _scaled(look: Look, pose: Array, scale: float) -> Look:
    expected = np.array([_SENSORS[i].h(pose) for i in look.ids.tolist()]).reshape(-1, 2)
    return Look(look.ids, expected + scale * (look.z - expected), scale**2 * look.R)
