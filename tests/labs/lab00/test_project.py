"""Lab 0's project: any sound dead reckoning gets its marks, and a broken one the finding that it deserves."""

import numpy as np
import pytest

from coursekit.labs.lab00.project import PROJECT, Reference
from coursekit.models import DifferentialDrive
from tests.labs.judge import Judge

ARC = DifferentialDrive()


class Plain:
    """As a student writes it: the arc by its chord, Jacobians by differences."""

    def __init__(self, mean, cov):
        self.mean, self.cov = mean, cov

    def move(self, pose, control, dt):
        half = control[1] * dt / 2
        chord, direction = control[0] * dt * np.sinc(half / np.pi), pose[2] + half
        return pose + np.array([chord * np.cos(direction), chord * np.sin(direction), 2 * half])  # never wrapped

    def jacobians(self, control, dt, h=1e-6):
        def slope(function, at):
            return np.stack([(function(at + s) - function(at - s)) / (2 * h) for s in h * np.eye(len(at))], axis=-1)

        return slope(lambda x: self.move(x, control, dt), self.mean), slope(
            lambda u: self.move(self.mean, u, dt), control
        )

    def spread(self, F, G, M):
        return F @ self.cov @ F.T + G @ M @ G.T

    def predict(self, control, control_cov, dt):
        F, G = self.jacobians(control, dt)
        self.mean, self.cov = self.move(self.mean, control, dt), self.spread(F, G, control_cov)


class SigmaPoints(Plain):
    """No Jacobians at all: an unscented transform of pose and control together."""

    def predict(self, control, control_cov, dt):
        L = np.linalg.cholesky(np.block([[self.cov, np.zeros((3, 2))], [np.zeros((2, 3)), control_cov]]))
        rows = np.sqrt(5) * np.concatenate([L.T, -L.T])
        ends = np.array([self.move(self.mean + row[:3], control + row[3:], dt) for row in rows])
        self.mean, self.cov = ends.mean(axis=0), np.cov(ends.T, bias=True)


class OldHeading(Plain):
    def move(self, pose, control, dt):
        return pose + dt * np.array([control[0] * np.cos(pose[2]), control[0] * np.sin(pose[2]), control[1]])


class TurnsTheOtherWay(Plain):
    def move(self, pose, control, dt):
        return super().move(pose, control * [1, -1], dt)


class NoNoise(Plain):
    def spread(self, F, G, M):
        return F @ self.cov @ F.T


class NotMoved(Plain):
    def spread(self, F, G, M):
        return self.cov + G @ M @ G.T


class OnlyThisStep(Plain):
    def spread(self, F, G, M):
        return G @ M @ G.T + 1e-9 * np.eye(3)


class Transposed(Plain):
    def spread(self, F, G, M):
        return F.T @ self.cov @ F + G @ M @ G.T


class NotSquared(Plain):
    """Standard deviations taken for variances: M^(1/2) in place of M."""

    def spread(self, F, G, M):
        return F @ self.cov @ F.T + G @ np.diag(np.sqrt(np.diag(M))) @ G.T


class DividesByTurn(Plain):
    def move(self, pose, control, dt):
        radius, after = np.float64(control[0]) / control[1], pose[2] + control[1] * dt
        x, y = radius * (np.sin(after) - np.sin(pose[2])), radius * (np.cos(pose[2]) - np.cos(after))
        return pose + np.array([x, y, control[1] * dt])

    def jacobians(self, control, dt):
        return ARC.F(self.mean, control, dt), ARC.G(self.mean, control, dt)


class Lopsided(Plain):
    def spread(self, F, G, M):
        return F @ self.cov + G @ M @ G.T


class ChangesArguments(Plain):
    def predict(self, control, control_cov, dt):
        super().predict(control, control_cov, dt)
        control_cov *= 2


class Stub(Plain):
    def predict(self, control, control_cov, dt):
        raise NotImplementedError("your lines here")


judged = Judge(PROJECT, Reference, range(5))


@pytest.mark.parametrize("design", [Reference, Plain, SigmaPoints])
def test_a_sound_reckoning_gets_full_marks_however_it_is_written(design):
    assert judged(design).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (OldHeading, 55, "times the package's"),
        (TurnsTheOtherWay, 20, "too sure of itself"),
        (NoNoise, 60, "too sure of itself"),
        (NotMoved, 75, "too sure of itself"),
        (OnlyThisStep, 60, "too sure of itself"),
        (Transposed, 75, "too"),
        (NotSquared, 60, "too modest"),
        (DividesByTurn, 10, "NaN"),
        (Lopsided, 0, "cov is not symmetric"),
        (ChangesArguments, 90, "predict() changes its arguments in place"),
        (Stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_reckoning_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)


def test_the_card_shows_the_design_beside_the_package():
    figure = judged(OldHeading).figure()
    assert len(figure.axes) == 2 and "3 is right" in figure.axes[1].get_title(loc="left")
