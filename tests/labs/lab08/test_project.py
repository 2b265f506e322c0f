"""Lab 8's project: any sound localiser gets its marks, and a broken one gets the finding that it deserves."""

import re
from functools import cache
from pathlib import Path

import nbformat
import numpy as np
import pytest
from scipy.special import logsumexp

from coursekit.geometry import wrap_angle
from coursekit.labs.lab08 import project
from coursekit.labs.lab08.project import PROJECT, Reference
from coursekit.models import pose_residual
from coursekit.visual import MapMatcher, odometry_from_image
from tests.labs.judge import Judge

SEEDS = (41, 42)
NOTEBOOK = Path(__file__).parents[3] / "notebooks" / "08_visual_particle_filter.ipynb"


@cache
def matcher(data, shape):
    return MapMatcher(np.frombuffer(data, np.uint8).reshape(shape))


@cache
def located(map_data, map_shape, data, shape):
    return matcher(map_data, map_shape).locate(np.frombuffer(data, np.uint8).reshape(shape))


class Matched:
    """The package's matcher, which looks at each frame once for all designs."""

    def __init__(self, map_image):
        self.map = map_image.tobytes(), map_image.shape

    def locate(self, image):
        return located(*self.map, image.tobytes(), image.shape)


class Plain:
    """No particles: a Gaussian with a gate, which believes a second odd fix that agrees with the first."""

    def __init__(self, map_image, motion, dt, rng):
        self.matcher, self.motion, self.dt = Matched(map_image), motion, dt
        self.mean, self.cov = np.zeros(3), np.diag([1e6, 1e6, 10.0])
        self.odd = None

    def fix(self, frame):
        found = self.matcher.locate(frame)
        return (found.belief.mean, found.belief.cov) if found else None

    def moved(self, mean, cov, control):
        F = self.motion.F(mean, control, self.dt)
        return self.motion.f(mean, control, self.dt), F @ cov @ F.T + self.motion.Q(mean, control, self.dt)

    def believes(self, e, S):
        return e @ np.linalg.solve(S, e) < 30

    def step(self, control, frame):
        self.mean, self.cov = self.moved(self.mean, self.cov, control)
        odd = self.moved(*self.odd, control) if self.odd else None
        self.odd, fix = None, self.fix(frame)
        if fix is None:
            return
        z, R = fix
        e, S = pose_residual(z, self.mean), self.cov + R
        if self.believes(e, S):
            K = np.linalg.solve(S, self.cov).T
            self.mean = self.mean + K @ e
            self.cov = (np.eye(3) - K) @ self.cov @ (np.eye(3) - K).T + K @ R @ K.T
        elif odd and self.believes(pose_residual(z, odd[0]), odd[1] + R):
            self.mean, self.cov = z, R
        else:
            self.odd = fix


class YawNotConverted(Plain):
    def fix(self, frame):
        found = self.matcher.locate(frame)
        return (np.array([found.x, -found.y, found.yaw]), found.belief.cov) if found else None


class HalfAPixel(Plain):
    def fix(self, frame):
        found = super().fix(frame)
        return found and (found[0] + [0.5, -0.5, 0], found[1])


class FiftyPixels(Plain):
    def fix(self, frame):
        found = super().fix(frame)
        return found and (found[0], np.diag([50.0, 50.0, 0.314]) ** 2)


class Trusting(Plain):
    def believes(self, e, S):
        return True


class NeverCarriedOff(Plain):
    def step(self, control, frame):
        self.odd, first = None, self.cov[0, 0] > 1e5
        super().step(control, frame)
        if not first:
            self.odd = None


class NoNoise(Plain):
    def moved(self, mean, cov, control):
        F = self.motion.F(mean, control, self.dt)
        return self.motion.f(mean, control, self.dt), F @ cov @ F.T


class StandsStill(Plain):
    def moved(self, mean, cov, control):
        return mean, cov + np.diag([100.0, 100.0, 0.1])


class Modest(Plain):
    @property
    def cov(self):
        return 25 * self._cov

    @cov.setter
    def cov(self, value):
        self._cov = value / 25 if hasattr(self, "_cov") else value

    def fix(self, frame):
        found = super().fix(frame)
        return found and (found[0], 25 * found[1])


class PaintsItsFrames(Plain):
    def step(self, control, frame):
        super().step(control, frame)
        frame[:] = 0


class Nan(Plain):
    def step(self, control, frame):
        self.mean = self.mean * np.nan


class Stub:
    def __init__(self, map_image, motion, dt, rng):
        raise NotImplementedError


judged = Judge(PROJECT, Reference, SEEDS)


@pytest.fixture(autouse=True)
def _each_frame_is_matched_once(monkeypatch):
    """The package's own design looks at the frames of a drive once for all tests."""
    monkeypatch.setattr(project, "MapMatcher", Matched)


@pytest.mark.parametrize("design", [Plain, Reference])
def test_a_sound_localiser_gets_full_marks_with_particles_or_without(design):
    assert judged(design).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (YawNotConverted, 65, "too sure of itself"),
        (HalfAPixel, 75, "too sure of itself"),
        (FiftyPixels, 75, "px (the package"),
        (Trusting, 92, "error at the one wrong picture"),
        (NeverCarriedOff, 80, "share missed: 0.5"),
        (NoNoise, 82, "too sure of itself"),
        (StandsStill, 95, "error at the end of the fog"),
        (Modest, 75, "too modest"),
        (PaintsItsFrames, 90, "step() changes its arguments in place"),
        (Nan, 0, "mean holds NaN"),
        (Stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_localiser_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)


def test_the_labs_own_solution_finds_the_robot():
    (source,) = [c.source for c in nbformat.read(NOTEBOOK, as_version=4).cells if "class MyLocaliser" in c.source]
    names = {"np": np, "logsumexp": logsumexp, "cv2": __import__("cv2")}
    exec(re.sub(r"^ *### (BEGIN|END) SOLUTION$", "", source, flags=re.M), names)
    score = judged(names["MyLocaliser"], runs=1)
    assert score.mark >= 85 and not score.findings  # one run's NEES leaves its band more often than an average does


def test_the_truth_is_where_the_frames_were_taken():
    """A fix of each frame that can be matched, but for the wrong one, lies within a pixel of the truth."""
    drawn = judged.scenario(SEEDS[0])
    for k, (frame, pose) in enumerate(zip(drawn.frames, drawn.truth, strict=True), 1):
        found = Matched(drawn.map_image).locate(frame)
        if k in project.FOG:
            assert not found
        elif k != project.WRONG:
            assert found and np.hypot(*(odometry_from_image(found.pose) - pose)[:2]) < 1
            assert abs(wrap_angle(found.belief.mean[2] - pose[2])) < 0.01
        else:
            assert found and np.hypot(*(odometry_from_image(found.pose) - pose)[:2]) > 100
