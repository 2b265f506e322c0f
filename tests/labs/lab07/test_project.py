"""Lab 7's project: any sound particle filter gets its marks, a broken one the finding that it deserves."""

import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.labs.lab07.project import PROJECT, Reference
from tests.labs.judge import Judge


class Plain:
    """A filter as a student writes it: plain arrays, logs, a search for each position."""

    n, later, scale = 60_000, 10_000, 1.0

    def __init__(self, low, high, rng):
        self.rng = rng
        self.x = rng.uniform(low, high, size=(self.n, 3))
        self.log_w = np.full(self.n, -np.log(self.n))

    def errors(self, control_cov):
        return self.rng.standard_normal((len(self.x), 2)) @ np.linalg.cholesky(control_cov).T

    def predict(self, control, control_cov, dt):
        v, omega = (control + self.errors(control_cov)).T
        middle = self.x[:, 2] + 0.5 * omega * dt
        self.x[:, 0] += v * dt * np.cos(middle)
        self.x[:, 1] += v * dt * np.sin(middle)
        self.x[:, 2] += omega * dt

    def log_likelihood(self, beacons, ranges, sigma):
        distance = np.linalg.norm(self.x[:, None, :2] - beacons, axis=2)
        return -0.5 * np.sum(((ranges - distance) / sigma) ** 2, axis=1)

    def positions(self, n):
        return (np.arange(n) + self.rng.random()) / n

    def resample(self):
        w = np.exp(self.log_w)
        if 1 / np.sum(w**2) < len(w) / 2:
            cumulative = np.cumsum(w) / np.sum(w)
            self.x = self.x[np.searchsorted(cumulative, self.positions(self.later), side="right")]
            self.log_w = np.full(self.later, -np.log(self.later))

    def correct(self, beacons, ranges, sigma):
        self.resample()
        self.log_w = self.log_w + self.log_likelihood(beacons, ranges, sigma)
        top = self.log_w.max()
        self.log_w -= top + np.log(np.sum(np.exp(self.log_w - top)))
        self.summarise(np.exp(self.log_w))

    def summarise(self, w):
        theta = np.arctan2(w @ np.sin(self.x[:, 2]), w @ np.cos(self.x[:, 2]))
        self.mean = np.array([*(w @ self.x[:, :2]), theta])
        e = self.x - self.mean
        e[:, 2] = wrap_angle(e[:, 2])
        self.cov = self.scale * (w * e.T) @ e


class TooFew(Plain):
    n, later = 300, 300


class NoNoise(Plain):
    def errors(self, control_cov):
        return np.zeros((len(self.x), 2))


class OneErrorForAll(Plain):
    def errors(self, control_cov):
        return np.linalg.cholesky(control_cov) @ self.rng.standard_normal(2) + np.zeros((len(self.x), 2))


class FewAtTheStart(Plain):
    n, later = 1000, 1000


class PlainMean(Plain):
    """Headings averaged as numbers; the differences wrapped."""

    def summarise(self, w):
        self.mean = w @ self.x
        e = self.x - self.mean
        e[:, 2] = wrap_angle(e[:, 2])
        self.cov = (w * e.T) @ e


class PlainMeanAndCov(Plain):
    """Neither is wrapped."""

    def summarise(self, w):
        self.mean = w @ self.x
        e = self.x - self.mean
        self.cov = (w * e.T) @ e


class PlainCov(Plain):
    """The mean as a direction; the differences of headings as numbers."""

    def summarise(self, w):
        super().summarise(w)
        e = self.x - self.mean
        self.cov = (w * e.T) @ e


class Wrapped:
    """Headings kept in (-π, π], as many do."""

    def predict(self, control, control_cov, dt):
        super().predict(control, control_cov, dt)
        self.x[:, 2] = wrap_angle(self.x[:, 2])


class PlainMeanOfWrapped(Wrapped, PlainMean):
    pass


class PlainMeanAndCovOfWrapped(Wrapped, PlainMeanAndCov):
    pass


class PlainCovOfWrapped(Wrapped, PlainCov):
    pass


class NeverResamples(Plain):
    n = 4000

    def resample(self):
        pass


class ForgetsTheHalf(Plain):
    def log_likelihood(self, *measured):
        return 2 * super().log_likelihood(*measured)


class ForgetsTheWeights(Plain):
    n = 2000

    def correct(self, beacons, ranges, sigma):
        self.log_w = np.full(len(self.x), -np.log(len(self.x)))
        self.summarise(np.exp(self.log_w))


class Collapses(Plain):
    """Underflow without a shift by the largest logarithm: zero over zero."""

    def correct(self, beacons, ranges, sigma):
        w = np.exp(self.log_w - 2000)
        self.summarise(w / w.sum())


class Point(Plain):
    """The heaviest guess as the mean, without a spread."""

    def summarise(self, w):
        self.mean, self.cov = self.x[np.argmax(w)].copy(), np.zeros((3, 3))


class TakesTheBest(Plain):
    def resample(self):
        best = np.argsort(self.log_w)[-30:]
        self.x = np.repeat(self.x[best], 100, axis=0)
        self.log_w = np.full(3000, -np.log(3000))


class Modest(Plain):
    scale = 9.0


class ChangesArguments(Plain):
    def correct(self, beacons, ranges, sigma):
        super().correct(beacons, ranges, sigma)
        ranges *= 0


class NoBelief(Plain):
    def summarise(self, w):
        pass


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
        (TooFew, 60, "too sure of itself"),
        (NoNoise, 60, "too sure of itself"),
        (OneErrorForAll, 60, "too sure of itself"),
        (PlainMean, 85, "you claim"),
        (PlainMeanAndCov, 85, "you claim"),
        (PlainCov, 92, "you claim"),
        (PlainMeanOfWrapped, 85, "you claim"),
        (PlainMeanAndCovOfWrapped, 85, "you claim"),
        (PlainCovOfWrapped, 92, "you claim"),
        (NeverResamples, 60, "too sure of itself"),
        (ForgetsTheHalf, 75, "too sure of itself"),
        (ForgetsTheWeights, 60, "found in 0 % of the runs"),
        (Collapses, 0, "mean holds NaN"),
        (Point, 0, "cov is not positive definite"),
        (TakesTheBest, 60, "too sure of itself"),
        (Modest, 60, "too modest"),
        (ChangesArguments, 90, "correct() changes its arguments in place"),
        (NoBelief, 0, "your NoBelief has no attribute mean"),
        (Stub, 0, "Nothing here yet"),
    ],
)
def test_a_broken_filter_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)
