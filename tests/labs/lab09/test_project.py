"""The capstone: any sound robot gets its marks, and a broken one the mark and the finding that it deserves."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from coursekit import icp
from coursekit.geometry import between, rotation, wrap_angle
from coursekit.labs.lab09.project import PROJECT, Reference, Starter, reached
from coursekit.labs.lab09.project.hall import DOOR, HALL, START, Hall, make
from coursekit.models import DifferentialDrive, pose_residual, range_bearing
from coursekit.slam.association import Known
from coursekit.teaching import projects
from coursekit.teaching.judging import attempt

ARC = DifferentialDrive()


class Plain:
    """As a student writes it: an EKF in whole matrices over the pose, the pose of the last scan, and the tags by id."""

    def __init__(self, mean, cov, waypoints):
        self.x, self.P = np.r_[mean, mean], np.kron(np.ones((2, 2)), cov)
        self.ids, self.count, self.points = [], [], np.empty((0, 2))
        self.way = list(waypoints)

    @property
    def mean(self):
        return self.x[:3]

    @property
    def cov(self):
        return self.P[:3, :3] + 1e-12 * np.eye(3)

    @property
    def landmarks(self):
        return self.x[6:].reshape(-1, 2)[[n >= 3 for n in self.count]]

    def move(self, control, control_cov, dt):
        F, G = np.eye(len(self.x)), ARC.G(self.x[:3], control, dt)
        F[:3, :3] = ARC.F(self.x[:3], control, dt)
        self.P = F @ self.P @ F.T
        self.P[:3, :3] += G @ control_cov @ G.T
        self.x = np.r_[ARC.f(self.x[:3], control, dt), self.x[3:]]

    def scan(self, points):
        if len(self.points):
            step = between(self.x[3:6], self.x[:3])
            T = np.eye(3)
            T[:2, :2], T[:2, 2] = rotation(step[2]), step[:2]
            fit = icp.align(points, self.points, initial=T, metric="point_to_plane", kernel="cauchy", max_distance=0.3)
            H = np.zeros((3, len(self.x)))
            for i, e in enumerate(1e-6 * np.eye(6)):
                ahead, behind = (between(x[3:6], x[:3]) for x in (self.x[:6] + e, self.x[:6] - e))
                H[:, i] = pose_residual(ahead, behind) / 2e-6
            self.correct(pose_residual(fit.pose, step), H, 2 * fit.covariance, 30.7)
        copy = np.eye(len(self.x))
        copy[3:6, :6] = np.c_[np.eye(3), np.zeros((3, 3))]
        self.x, self.P, self.points = copy @ self.x, copy @ self.P @ copy.T, points

    def see(self, ids, z, R):
        for id, one, cov in zip(ids, z, R, strict=True):
            if id in self.ids:
                i = self.ids.index(id)
                at = slice(6 + 2 * i, 8 + 2 * i)
                H = np.zeros((2, len(self.x)))
                H[:, :3] = range_bearing.H(self.x[:3], self.x[at])
                H[:, at] = range_bearing.H_landmark(self.x[:3], self.x[at])
                nu = range_bearing.residual(one, range_bearing.h(self.x[:3], self.x[at]))
                if self.correct(nu, H, cov, 13.8):
                    self.count[i] += 1
                    continue
                if self.count[i] >= 3:
                    continue
                keep = np.delete(np.arange(len(self.x)), [6 + 2 * i, 7 + 2 * i])  # it was misread when it was new
                self.x, self.P = self.x[keep], self.P[np.ix_(keep, keep)]
                del self.ids[i], self.count[i]
            self.add(int(id), one, cov)

    def add(self, id, z, R):
        Gx, Gz = range_bearing.Gx(self.x[:3], z), range_bearing.Gz(self.x[:3], z)
        cross = Gx @ self.P[:3]
        corner = Gx @ self.P[:3, :3] @ Gx.T + Gz @ R @ Gz.T
        self.x, self.P = np.r_[self.x, range_bearing.g(self.x[:3], z)], np.block([[self.P, cross.T], [cross, corner]])
        self.ids.append(id)
        self.count.append(1)

    def correct(self, nu, H, R, gate):
        S = H @ self.P @ H.T + R
        if nu @ np.linalg.solve(S, nu) > gate:
            return False
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ nu
        self.x[2], self.x[5] = wrap_angle(self.x[2]), wrap_angle(self.x[5])
        A = np.eye(len(self.x)) - K @ H
        self.P = A @ self.P @ A.T + K @ R @ K.T
        return True

    def command(self):
        while self.way and np.hypot(*(self.way[0] - self.x[:2])) < 0.08:
            self.way.pop(0)
        if not self.way:
            return None
        off = wrap_angle(np.arctan2(*(self.way[0] - self.x[:2])[::-1]) - self.x[2])
        x, y = self.points.T
        free = not np.any((x > 0) & (x < 0.7) & (np.abs(y) < 0.3))
        return [0.35 * free * (abs(off) < 0.3), np.clip(2 * off, -1, 1)]


class WithoutLidar(Reference):
    def registered(self, points):
        return self.step


class WithoutTags(Reference):
    def see(self, ids, z, R):
        pass


class BelievesEveryId(Reference):
    def __init__(self, mean, cov, waypoints):
        super().__init__(mean, cov, waypoints)
        self.slam.associate = Known()

    def see(self, ids, z, R):
        once = np.unique(ids, return_index=True)[1]
        self.slam.observe(z[once], R[once], ids[once].tolist())
        self._believe()


class LooksNowhere(Reference):
    def blocked(self):
        return False


class EverySightingIsALandmark(Reference):
    def __init__(self, mean, cov, waypoints):
        super().__init__(mean, cov, waypoints)
        self.sighted = []

    def see(self, ids, z, R):
        super().see(ids, z, R)
        self.sighted += [range_bearing.g(self.mean, one) for one in z]

    @property
    def landmarks(self):
        return np.reshape(self.sighted, (-1, 2))


class TakesTheLidarForExact(Reference):
    def registered(self, points):
        step = super().registered(points)
        return replace(step, cov=0.05 * step.cov)


class DrivesByOdometry(Reference):
    """It estimates well, and steers by what the wheels say."""

    def __init__(self, mean, cov, waypoints):
        super().__init__(mean, cov, waypoints)
        self.reckoned = mean

    def move(self, control, control_cov, dt):
        super().move(control, control_cov, dt)
        self.reckoned = ARC.f(self.reckoned, control, dt)

    def command(self):
        estimate, self.mean = self.mean, self.reckoned
        wanted = super().command()
        self.mean = estimate
        return wanted


class StandsStill(Reference):
    def command(self):
        return np.zeros(2)


class ArrivesAtOnce(Reference):
    def command(self):
        pass


class ChangesArguments(Reference):
    def scan(self, points):
        super().scan(points.copy())
        points *= 0


class Lopsided(Reference):
    def _believe(self):
        super()._believe()
        self.cov = np.triu(self.cov)


class Lost(Reference):
    def command(self):
        return super().command() * np.nan


class Stub(Reference):
    def command(self):
        raise NotImplementedError("your lines here")


SEEDS = (2000, 2001)


@cache
def outcomes(design):
    return [projects.outcome(attempt(PROJECT, design, seed)) for seed in SEEDS]


def judged(design):
    return projects.mark(PROJECT, outcomes(design), outcomes(Reference))


@pytest.mark.parametrize("design", [Reference, Plain])
def test_a_sound_robot_gets_full_marks_however_it_is_written(design):
    assert judged(design).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (Starter, 50, "% of the waypoints passed within 0.2 m"),
        (WithoutLidar, 60, "% of the waypoints passed within 0.2 m"),
        (WithoutTags, 90, "0.0 of "),
        (BelievesEveryId, 40, "too sure of itself"),
        (LooksNowhere, 85, "2 of 2 drives touch something"),
        (EverySightingIsALandmark, 90, "landmarks too many"),
        (TakesTheLidarForExact, 88, "too sure of itself"),
        (DrivesByOdometry, 70, "% of the waypoints passed within 0.2 m"),
        (StandsStill, 30, "0% of the waypoints"),
        (ArrivesAtOnce, 0, "command() returned None before the first step"),
        (ChangesArguments, 90, "scan() changes its arguments in place"),
        (Lopsided, 0, "cov is not symmetric"),
        (Lost, 0, "command() holds NaN or infinity"),
        (Stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_robot_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)


def test_the_card_shows_the_drive_on_its_map():
    figure = judged(Reference).figure()
    assert len(figure.axes) == 2 and "100% of the waypoints" in figure.axes[0].get_title(loc="left")


def test_the_door_closes_behind_the_robot_and_the_crate_is_carried_across_its_way():
    hall = Hall(make(np.random.default_rng(1)))
    crate, places = hall.world.crates[0], np.array([o.values["truth"] for o in outcomes(Reference)[:1]])[0]
    for pose in places:
        hall.world._drive.body.position, hall.world._drive.body.angle = pose[:2].tolist(), float(pose[2])
        hall.step(np.zeros(2))
        assert (DOOR in hall.world.arena.walls) == (not hall._open)
    assert DOOR in hall.world.arena.walls and DOOR not in HALL.walls
    assert hall.world.crates[0, 1] > crate[1] + 1.5


def test_waypoints_count_in_their_order_and_home_only_at_the_end():
    way = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 0.0]])
    there = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.1], [1.0, 0.9], [0.4, 0.4], [0.1, 0.0]])
    assert reached(there, way, True).tolist() == [True, True, True]
    assert reached(there, way, False).tolist() == [True, True, False]
    assert reached(there[::-1], way, True).tolist() == [True, False, True]
    assert reached(np.zeros((5, 2)), way, False).tolist() == [False, False, False]


def test_a_drive_is_its_seeds():
    again = projects.outcome(attempt(PROJECT, Reference, SEEDS[0]))
    assert np.array_equal(again.values["truth"], outcomes(Reference)[0].values["truth"])
    assert HALL.start == START
