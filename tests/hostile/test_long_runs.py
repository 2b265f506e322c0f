"""Long runs: covariances stay positive definite with their margin, memory stays flat, angles stay wrapped.

Each run has a small sibling in the ordinary run; the long one is ``slow``.
"""

import tracemalloc

import numpy as np
import pytest

from coursekit import Arena, World, ekf, geometry, slam
from coursekit.gaussian import MARGIN, Gaussian
from coursekit.models import DifferentialDrive, RangeBearing, range_bearing

DRIVE, R = DifferentialDrive(0.05, 0.05), np.diag([0.1, 0.02]) ** 2
TAGS = [RangeBearing(at) for at in ([3.0, 1.0], [2.0, -2.0], [-2.0, 2.0], [-1.5, -2.5])]


def size(short, long):
    return pytest.mark.parametrize("steps", [short, pytest.param(long, marks=pytest.mark.slow)])


class Memory:
    """What Python holds now, in bytes, and by how much it grew since the first look."""

    def __enter__(self):
        tracemalloc.start()
        self.first = None
        return self

    def __exit__(self, *_):
        tracemalloc.stop()

    def look(self):
        now = tracemalloc.get_traced_memory()[0]
        self.first = now if self.first is None else self.first
        self.grown = now - self.first


def smallest_correlation(cov):
    sigma = np.sqrt(np.diag(cov))
    return np.linalg.eigvalsh(cov / np.outer(sigma, sigma))[0]


@size(500, 1_000_000)
def test_an_ekf_that_runs_for_long_keeps_its_margin_its_heading_and_its_memory(steps):
    belief, pose, rng = Gaussian(np.zeros(3), 0.01 * np.eye(3)), np.zeros(3), np.random.default_rng(0)
    squared, least = [], np.inf
    with Memory() as memory:
        for k in range(steps):
            pose = DRIVE.sample(pose, [0.4, 0.3], 0.25, rng)
            belief = ekf.predict(belief, DRIVE, [0.4, 0.3], 0.25)
            tag = TAGS[k % len(TAGS)]
            seen = ekf.correct(belief, tag, tag.h(pose) + rng.normal(0, [0.1, 0.02]), R)
            belief = seen.belief
            if k % (steps // 100) == 0:
                squared.append(seen.nis)
                least = min(least, smallest_correlation(belief.cov))
                assert -np.pi < belief.mean[2] <= np.pi
                memory.look()
    assert least > MARGIN and np.array_equal(belief.cov, belief.cov.T)
    assert abs(geometry.wrap_angle(float(belief.mean[2] - pose[2]))) < 0.2
    assert 1.2 < np.mean(squared) < 3.0
    assert memory.grown < 200_000


@size(100, 100_000)
def test_a_map_that_is_driven_through_for_long_keeps_its_margin_and_its_memory(steps):
    built = slam.InvariantSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DRIVE, slam.Known())
    pose, rng, names = np.zeros(3), np.random.default_rng(1), list(range(len(TAGS)))
    with Memory() as memory:
        for k in range(steps):
            pose = DRIVE.sample(pose, [0.4, 0.3], 0.25, rng)
            built.predict([0.4, 0.3], 0.25)
            z = [tag.h(pose) + rng.normal(0, [0.1, 0.02]) for tag in TAGS]
            built.observe(z, R, ids=names)
            if k % (steps // 20) == 0 and k:
                memory.look()
                assert smallest_correlation(built.cov) > MARGIN
                assert -np.pi < built.mean[2] <= np.pi
    assert built.lost is None and len(built.landmarks) == len(TAGS)
    assert memory.grown < 200_000
    at = range_bearing.h(built.mean[:3], built.landmarks)
    assert np.abs(geometry.wrap_angle(at[:, 1] - [tag.h(pose)[1] for tag in TAGS])).max() < 0.2


@size(5000, 1_000_000)
def test_a_million_turns_composed_one_after_the_other_are_still_where_they_should_be(steps):
    turn, pose = np.array([0.0, 0.0, 2.0]), np.zeros(3)
    for _ in range(steps):
        pose = geometry.compose(pose, turn)
    assert -np.pi < pose[2] <= np.pi
    # Each turn rounds once, by half a unit in the last place of π at most.
    assert (
        abs(geometry.wrap_angle(pose[2] - geometry.wrap_angle(float(np.fmod(2.0 * steps, 2 * np.pi))))) < steps * 1e-15
    )
    many = np.linspace(-1e6, 1e6, steps)
    wrapped = geometry.wrap_angle(many)
    assert np.all((-np.pi < wrapped) & (wrapped <= np.pi))
    assert np.abs(np.exp(1j * wrapped) - np.exp(1j * many)).max() < 1e-9


@size(5, 3600)
def test_a_world_that_runs_for_an_hour_of_its_time_stays_sound(steps):
    """``steps`` are seconds.  The robot drives in circles, and into whatever is in the way."""
    arena = Arena.load("lab")
    robot = World(arena, np.random.default_rng(2))
    with Memory() as memory:
        for second in range(steps):
            for _ in range(round(1 / robot.dt)):
                robot.step(0.3, 0.5 * np.sin(second / 7))
            if second > 1:
                memory.look()
            assert np.isfinite(robot.pose).all() and -np.pi < robot.pose[2] <= np.pi
    assert memory.grown < 1_000_000


@size(3, 200)
def test_a_cell_that_is_run_again_and_again_leaves_no_figure_and_no_memory_behind(steps):
    import matplotlib.pyplot as plt

    from coursekit.teaching.explore import Slider, explore

    def scene(x):
        figure, axes = plt.subplots(figsize=(2, 2))
        axes.plot([0, x])
        return figure

    with Memory() as memory:
        for k in range(steps):
            shown = explore(scene, x=Slider([1.0, 2.0, 3.0]))
            shown.html() if hasattr(shown, "html") else shown
            del shown
            if k >= min(3, steps - 2):
                memory.look()
    assert plt.get_fignums() == []
    assert memory.grown < 3_000_000
