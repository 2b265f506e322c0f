"""SLAM on the recorded drive: nobody says where the landmarks are, and, with ids hidden, not even which is which."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coursekit import icp
from coursekit.ekf.lost import Lost
from coursekit.gaussian import Gaussian
from coursekit.geometry import Array
from coursekit.labs.lab09.localisation import events, start_of, truth_at
from coursekit.labs.lab09.runs.believing import R
from coursekit.models import SteadyNoiseDrive, pose_residual
from coursekit.recordings import Mrclam
from coursekit.slam import CalibratingSlam
from coursekit.slam.association import Association, Known


@dataclass(frozen=True, eq=False)
class Map:
    """What SLAM made of a drive: its landmarks (n, 2), and at each time (k,) its pose (k, 3) with the covariance
    (k, 3, 3); then the way (m, 3) as it is believed at the end, with its times (m,); lost: None, or why it is not to be
    believed."""

    run: Mrclam
    landmarks: Array
    time: Array
    poses: Array
    covs: Array
    way_time: Array
    way: Array
    lost: Lost | None

    @property
    def motion(self) -> Array:
        """The rigid motion (3, 3) that takes the map onto the truth, by the way."""
        return icp.point_to_point(self.way[:, :2], truth_at(self.run, self.way_time)[:, :2])

    @property
    def track_error(self) -> float:
        """RMS distance of the way from the truth after ``motion``, m."""
        apart = icp.move(self.motion, self.way[:, :2]) - truth_at(self.run, self.way_time)[:, :2]
        return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))

    @property
    def nees(self) -> Array:
        """Of the pose, (k,): the map's frame is the room's, since SLAM starts at the true pose."""
        e = pose_residual(self.poses, truth_at(self.run, self.time))
        return np.asarray(np.sum(e * np.linalg.solve(self.covs, e[..., None])[..., 0], axis=-1))

    @property
    def map_error(self) -> float:
        """RMS distance of each landmark from the nearest true one, after the best motion of the map, m."""
        true, mine = np.array(list(self.run.landmarks.values())), icp.move(self.motion, self.landmarks)
        for _ in range(5):
            pairs = true[np.argmin(np.linalg.norm(mine[:, None] - true, axis=2), axis=1)]
            mine = icp.move(icp.point_to_point(mine, pairs), mine)
        return float(np.sqrt(np.mean(np.sum((mine - pairs) ** 2, axis=1))))


def mapped(run: Mrclam, rule: Association, seconds: float = np.inf) -> Map:
    """CalibratingSlam through a recording; ``Known()`` is told the ids, any other rule is not."""
    start = start_of(run)
    slam = CalibratingSlam(Gaussian(start.mean, 1e-8 * np.eye(3)), SteadyNoiseDrive(), rule)
    begin, times, poses, covs = max(run.odometry[0, 0], run.groundtruth[0, 0]), [], [], []
    for t, control, dt, sightings in events(run):
        if t > min(begin + seconds, run.groundtruth[-1, 0]) or slam.lost is not None:
            break
        if dt > 0:
            slam.predict(control, dt)
        if sightings:
            once = dict(sightings)  # a repeated row says nothing new
            slam.observe(np.array(list(once.values())), R, list(once) if isinstance(rule, Known) else None)
        times.append(t)
        poses.append(slam.pose.mean)
        covs.append(slam.pose.cov)
    way = slam.track
    return Map(
        run,
        slam.landmarks,
        np.array(times),
        np.array(poses),
        np.array(covs),
        begin + way.time,
        way.poses.mean,
        slam.lost,
    )
