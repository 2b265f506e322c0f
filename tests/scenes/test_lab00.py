import numpy as np
import pytest

from coursekit.gaussian import Gaussian, nees
from coursekit.models import pose_residual
from coursekit.scenes import lab00
from coursekit.world.robot import Robot


@pytest.fixture
def drive():
    return lab00.DriveYourself()


def test_play_drives_the_robot_by_the_sliders_a_tenth_of_a_second_a_tick(drive):
    box = drive.widget()
    first = box.image.value
    box.speed.value, box.turn.value = 0.5, 0.0
    for tick in range(1, 21):
        box.play.value = tick
    assert drive.world.time == pytest.approx(2.0)
    assert 0.7 < drive.world.pose[0] < 1.0 and abs(drive.world.pose[1]) < 0.1
    assert box.image.value != first


def test_reset_brings_back_the_first_picture_and_the_same_noise(drive):
    box = drive.widget()
    first = box.image.value
    box.play.value = 1
    once = drive.world.pose
    box.again.click()
    assert box.image.value == first and drive.world.time == 0
    box.play.value = 2
    assert np.array_equal(drive.world.pose, once)


def test_a_bump_is_told_in_the_title(drive):
    for tick in range(80):
        drive.advance(0.8, 0.0)
        drive.update(tick)
    assert "touches" in drive.stage.title.get_text()


def test_the_published_page_gets_words_in_place_of_the_widget(drive, monkeypatch):
    monkeypatch.setenv("COURSEKIT_STATIC", "1")
    bundle = drive._repr_mimebundle_()
    assert "JupyterLab" in bundle["text/plain"] and "text/markdown" in bundle


@pytest.mark.parametrize("creep", lab00.CREEPS)
def test_the_recorded_drive_is_long_enough_for_its_slider_and_keeps_clear_of_walls(creep):
    truth, told, covs, crates = lab00._recording(creep)
    assert len(truth) == len(told) == len(covs) == len(crates)
    assert 32.0 <= (len(truth) - 1) * lab00.PERIOD < 34.0
    assert np.abs(truth[:, 0]).max() < 3.5 and np.abs(truth[:, 1]).max() < 2.5
    moved = np.hypot(*(crates[-1] - crates[0])[:, :2].T)
    assert np.sort(moved)[-1] > 0.4 and np.sort(moved)[-2] < 1e-6


def test_reckoning_is_honest_over_short_drives():
    """200 endings of the linear model, 5 m on a circle: mean NEES within 4 standard errors of 3, false alarm 6e-5."""
    cloud, mean, P = lab00.endings(3, 0.6, [10.0], runs=200)[10.0]
    values = [nees(Gaussian(mean, P), pose, pose_residual) for pose in cloud]
    assert abs(np.mean(values) - 3) < 4 * np.sqrt(6 / 200)


def test_one_step_of_reckoning_from_certainty_leaves_the_wheels_own_covariance():
    robot = Robot()
    pose, P = lab00.reckon(np.zeros(3), np.zeros((3, 3)), np.array([0.5, 0.0]), robot, 0.05)
    assert pose == pytest.approx([0.025, 0, 0])
    M = robot.odometry_cov(0.5, 0.0, 0.05)
    assert P[0, 0] == pytest.approx(M[0, 0] * 0.05**2) and P[2, 2] == pytest.approx(M[1, 1] * 0.05**2)
