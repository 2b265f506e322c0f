"""Lab 4's project: any sound filter gets its marks, and a broken one the finding that it deserves."""

import nbformat
import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.labs.lab04.project import PROJECT, SLIP, Reference, _leaps
from coursekit.models import DifferentialDrive, RangeBearing
from tests import notebooks
from tests.labs.judge import Judge

ARC = DifferentialDrive()


class Plain:
    """A filter as a student writes it: plain arrays, one matrix after the other."""

    wrap = staticmethod(wrap_angle)

    def __init__(self, mean, cov):
        self.mean, self.cov = mean, cov

    def spread(self, F, G, M):
        return F @ self.cov @ F.T + G @ M @ G.T + SLIP

    def predict(self, control, control_cov, dt):
        F, G = ARC.F(self.mean, control, dt), ARC.G(self.mean, control, dt)
        self.mean, self.cov = ARC.f(self.mean, control, dt), self.spread(F, G, control_cov)

    def gain(self, H, R):
        return np.linalg.solve(H @ self.cov @ H.T + R, H @ self.cov).T

    def correct(self, landmark, z, R):
        H = RangeBearing(landmark).H(self.mean)
        dx, dy = landmark - self.mean[:2]
        K = self.gain(H, R)
        self.mean = self.mean + K @ [z[0] - np.hypot(dx, dy), self.wrap(z[1] - (np.arctan2(dy, dx) - self.mean[2]))]
        self.cov = (np.eye(3) - K @ H) @ self.cov


class Unwrapped(Plain):
    wrap = staticmethod(lambda angle: angle)


class NoProcessNoise(Plain):
    def spread(self, F, G, M):
        return F @ self.cov @ F.T


class Transposed(Plain):
    def spread(self, F, G, M):
        return F.T @ self.cov @ F + G @ M @ G.T + SLIP


class NeverCorrects(Plain):
    def correct(self, landmark, z, R):
        pass


class Modest(Plain):
    def spread(self, F, G, M):
        return F @ self.cov @ F.T + 50 * (G @ M @ G.T + SLIP)


class KeepsItsCovariance(Plain):
    def correct(self, landmark, z, R):
        kept = self.cov
        super().correct(landmark, z, R)
        self.cov = kept


class ChangesArguments(Plain):
    def correct(self, landmark, z, R):
        super().correct(landmark, z, R)
        z *= 0


class Raises(Plain):
    def correct(self, landmark, z, R):
        raise KeyError("landmark 7")


class Nan(Plain):
    def correct(self, landmark, z, R):
        self.mean = self.mean * np.nan


class Lopsided(Plain):
    def correct(self, landmark, z, R):
        super().correct(landmark, z, R)
        self.cov = self.cov + np.triu(0.1 * self.cov, 1)


class Stub(Plain):
    def predict(self, control, control_cov, dt):
        raise NotImplementedError("your lines here")


judged = Judge(PROJECT, Reference, range(6))


@pytest.mark.parametrize("design", [Plain, Reference])
def test_a_sound_filter_gets_full_marks_however_it_is_written(design):
    assert judged(design).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (Unwrapped, 60, "lay on either side of ±π: is their difference wrapped?"),
        (NoProcessNoise, 60, "too sure of itself"),
        (Transposed, 75, "too sure of itself"),
        (NeverCorrects, 65, "m (the package"),
        (Modest, 60, "too modest"),
        (KeepsItsCovariance, 60, "too modest"),
        (ChangesArguments, 90, "correct() changes its arguments in place"),
        (Raises, 0, "correct() raised KeyError: 'landmark 7' (first in run 1, step 0)"),
        (Nan, 0, "mean holds NaN"),
        (Lopsided, 0, "cov is not symmetric"),
        (Stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_filter_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)


@pytest.mark.parametrize("design", [NoProcessNoise, Transposed, KeepsItsCovariance])
def test_only_a_belief_that_leaps_is_told_about_wrapping(design):
    score = judged(design)
    assert score.mark < 100 and "±π" not in repr(score)


def test_a_tenth_of_a_turn_across_the_seam_is_no_leap():
    """Both bearings stand on either side of ±π, and the belief stays where it should; then it does not."""
    seen = [[], [(np.array([-3.0, 0.1]), np.array([3.0, -3.1]), np.eye(2))]]
    assert _leaps(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]]), seen).size == 0
    assert _leaps(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.9]]), seen).tolist() == [2.0]
    seen[1][0][1][1] = 3.1
    assert _leaps(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.9]]), seen).size == 0


def the_labs_own():
    """``MyFilter``, as the notebook writes it."""
    (path,) = [p for p in notebooks.NOTEBOOKS if p.stem.startswith("04")]
    cells = nbformat.read(path, as_version=4).cells
    (source,) = [c.source for c in cells if "project" in c.metadata.get("tags", [])]
    names = {"np": np, "wrap_angle": wrap_angle}
    exec(source, names)
    return names["MyFilter"]


def test_the_labs_own_filter_gets_full_marks_on_drives_that_nobody_looked_at():
    assert Judge(PROJECT, Reference, range(640, 643))(the_labs_own()).mark >= 95
