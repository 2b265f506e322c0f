"""What Lab 7's lost robot says of a cloud."""

import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.labs.lab07.explorers import LostRobot
from coursekit.particles import Particles


@pytest.fixture
def scene():
    """Half a second: 2000 guesses all over the lab, all headings, of which the 100 near the robot have the weight.
    A second: a cloud at the robot whose headings spread by 0.2 rad."""
    rng, robot = np.random.default_rng(8700), np.array([1.0, 0.5, 3.1])
    anywhere = rng.uniform([-4, -3, -np.pi], [4, 3, np.pi], size=(2000, 3))
    anywhere[:100, :2] = robot[:2] + 0.05 * rng.standard_normal((100, 2))
    near = np.where(np.arange(2000) < 100, 0.0, -np.inf)
    sure = robot + [0.05, 0.05, 0.2] * rng.standard_normal((4000, 3))
    sure[:, 2] = wrap_angle(sure[:, 2])
    return LostRobot([(Particles(anywhere, near, angles=(2,)), robot), (Particles(sure, angles=(2,)), robot)])


def titles(scene, time):
    scene.update(time=time)
    return [title.get_text() for title in scene.titles]


def test_before_the_first_range_every_guess_counts_and_they_fill_the_room(scene):
    assert titles(scene, 0.0)[0] == "0 s: 2,000 particles, 2,000 count"
    assert np.ptp(scene.dots.get_xdata()) > 7.5 and np.ptp(scene.dots.get_ydata()) > 5.5


def test_the_first_ranges_leave_the_guesses_at_the_robot_and_no_heading(scene):
    count, heading = titles(scene, 0.5)
    assert count == "0.5 s: 2,000 particles, 100 count" and heading.endswith("heading: any")
    assert np.ptp(scene.dots.get_xdata()) < 0.5


def test_headings_that_agree_across_pi_are_told_as_a_small_spread(scene):
    """0.2 rad is 11.5 degrees; of 4000 headings it is good to 0.13 degrees."""
    assert titles(scene, 1.0)[1].endswith(("±11°", "±12°"))
    assert np.abs(scene.arrows.get_offsets()).max() < 0.3
