"""Lab 5's project: any sound EKF-SLAM gets its marks, and a broken one gets the finding that it deserves."""

import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.labs.lab05.project import ARC, PROJECT, Reference
from coursekit.models import range_bearing as rb
from tests.labs.judge import Judge

SAME, NEW = 9.2, 27.6  # χ² of two degrees of freedom: 0.99, and one in a million


class Plain:
    """EKF-SLAM as a student writes it: whole matrices, one measurement after the other, counts beside the state."""

    looks = 4

    def __init__(self, mean, cov):
        self.x, self.P, self.seen, self.idle = mean, cov, [], []

    def _rows(self):
        keep = [j for j, n in enumerate(self.seen) if n >= self.looks]
        return np.r_[0:3, *[[3 + 2 * j, 4 + 2 * j] for j in keep]].astype(int)

    @property
    def mean(self):
        return self.x[self._rows()]

    @property
    def cov(self):
        return self.P[np.ix_(self._rows(), self._rows())]

    def predict(self, control, control_cov, dt):
        pose, F = self.x[:3], np.eye(len(self.x))
        F[:3, :3], G = ARC.F(pose, control, dt), ARC.G(pose, control, dt)
        self.P = F @ self.P @ F.T
        self.P[:3, :3] += G @ control_cov @ G.T
        self.x = np.r_[ARC.f(pose, control, dt), self.x[3:]]

    def jacobian(self, j):
        H, pose, landmark = np.zeros((2, len(self.x))), self.x[:3], self.x[3 + 2 * j : 5 + 2 * j]
        H[:, :3], H[:, 3 + 2 * j : 5 + 2 * j] = rb.H(pose, landmark), rb.H_landmark(pose, landmark)
        return H

    def innovation(self, z, j):
        return rb.residual(z, rb.h(self.x[:3], self.x[3 + 2 * j : 5 + 2 * j]))

    def distances(self, z, R):
        pairs = [(self.innovation(z, j), self.jacobian(j)) for j in range(len(self.seen))]
        return np.array([nu @ np.linalg.solve(H @ self.P @ H.T + R, nu) for nu, H in pairs])

    def observe(self, z, R):
        hit = set()
        for one in z:
            d2 = self.distances(one, R)
            if not d2.size or d2.min() > NEW:
                self.augment(one, R)
                hit.add(len(self.seen) - 1)
            elif d2.min() < SAME:
                j = int(np.argmin(d2))
                self.update(one, R, j)
                self.seen[j] += 1
                hit.add(j)
        self.idle = [0 if j in hit else n + 1 for j, n in enumerate(self.idle)]
        self.forget()

    def forget(self):
        keep = [j for j, (n, idle) in enumerate(zip(self.seen, self.idle, strict=True)) if n >= self.looks or idle < 20]
        rows = np.r_[0:3, *[[3 + 2 * j, 4 + 2 * j] for j in keep]].astype(int)
        self.x, self.P = self.x[rows], self.P[np.ix_(rows, rows)]
        self.seen, self.idle = [self.seen[j] for j in keep], [self.idle[j] for j in keep]

    def augment(self, z, R):
        Gx, Gz = rb.Gx(self.x[:3], z), rb.Gz(self.x[:3], z)
        cross = Gx @ self.P[:3]
        corner = Gx @ self.P[:3, :3] @ Gx.T + Gz @ R @ Gz.T
        self.x, self.P = np.r_[self.x, rb.g(self.x[:3], z)], np.block([[self.P, cross.T], [cross, corner]])
        self.seen.append(1)
        self.idle.append(0)

    def update(self, z, R, j):
        H = self.jacobian(j)
        S = H @ self.P @ H.T + R
        K = np.linalg.solve(S, H @ self.P).T
        self.x = self.x + K @ self.innovation(z, j)
        self.x[2] = wrap_angle(self.x[2])
        P = self.P - K @ S @ K.T
        self.P = 0.5 * (P + P.T)


class EveryLookIsALandmark(Plain):
    looks = 1


class NoCrossCovariance(Plain):
    def augment(self, z, R):
        n = len(self.P)
        super().augment(z, R)
        self.P[n:, :n] = self.P[:n, n:] = 0.0


class HeadingForgotten(Plain):
    def jacobian(self, j):
        H = super().jacobian(j)
        H[:, 2] = 0.0
        return H


class NearestInMetres(Plain):
    def distances(self, z, R):
        points = self.x[3:].reshape(-1, 2)
        return np.linalg.norm(points - rb.g(self.x[:3], z), axis=1) * SAME / 1.0  # a metre is the gate


class NoProcessNoise(Plain):
    def predict(self, control, control_cov, dt):
        super().predict(control, 0.01 * control_cov, dt)


class NeverCorrects(Plain):
    def update(self, z, R, j):
        pass


class PoseOnly(Plain):
    @property
    def mean(self):
        return self.x[:3]

    @property
    def cov(self):
        return self.P[:3, :3]


class ChangesArguments(Plain):
    def observe(self, z, R):
        super().observe(z, R)
        z *= 0


class Lopsided(Plain):
    @property
    def cov(self):
        return np.triu(super().cov)


class Stub(Plain):
    def predict(self, control, control_cov, dt):
        raise NotImplementedError("your lines here")


judged = Judge(PROJECT, Reference, range(3))


@pytest.mark.parametrize("design", [Plain, Reference])
def test_a_sound_slam_gets_full_marks_however_it_is_written(design):
    assert judged(design).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (EveryLookIsALandmark, 75, "landmarks that are no tag"),
        (NoCrossCovariance, 65, "too sure of itself"),
        (HeadingForgotten, 65, "too sure of itself"),
        (NearestInMetres, 75, "tags found"),
        (NoProcessNoise, 60, "too sure of itself"),
        (NeverCorrects, 85, "landmarks that are no tag"),
        (PoseOnly, 65, "0.0 of 8 tags found"),
        (ChangesArguments, 90, "observe() changes its arguments in place"),
        (Lopsided, 0, "cov is not symmetric"),
        (Stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_slam_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)
