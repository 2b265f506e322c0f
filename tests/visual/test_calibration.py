"""From commands to pixels: the constants of the world are found from where the robot was seen."""

import numpy as np
import pytest

from coursekit.models import DifferentialDrive
from coursekit.visual import calibrate, odometry_from_image
from coursekit.world import seafloor
from coursekit.world.seafloor import DT, dive


@pytest.fixture(scope="module")
def recorded(sea):
    long = dive(sea, 600, 4)
    return odometry_from_image(long.poses), long.commands


def expect_the_worlds_constants(found, commands, n):
    """Within four standard errors each (seven of them: a false alarm in 1 of 2,200 draws of the seed)."""
    error_v, error_omega = seafloor.SIGMA_V / np.sqrt(n), seafloor.SIGMA_OMEGA / np.sqrt(n)
    # the commands' spread decides how well a gain and a bias are told apart
    assert found.gain[0] == pytest.approx(seafloor.PIXELS_PER_METRE, abs=4 * error_v / np.std(commands[:, 0]))
    assert found.gain[1] == pytest.approx(seafloor.TURN_GAIN, abs=4 * error_omega / np.std(commands[:, 1]))
    assert found.bias[0] == pytest.approx(0, abs=4 * error_v / np.std(commands[:, 0]))
    assert found.bias[1] == pytest.approx(seafloor.TURN_BIAS, abs=4 * error_omega)
    for sigma, truth in [(found.sigma_v, seafloor.SIGMA_V), (found.sigma_omega, seafloor.SIGMA_OMEGA),
                         (found.sigma_pose, seafloor.SIGMA_SLIP)]:  # fmt: skip
        assert sigma == pytest.approx(truth, rel=4 / np.sqrt(2 * n) + 0.03)


def test_gains_biases_and_noise_come_out_as_the_world_has_them(recorded):
    poses, commands = recorded
    found = calibrate(poses, commands, DT)
    expect_the_worlds_constants(found, commands, 600)
    assert found.steps > 580


def test_gaps_and_wrong_fixes_do_not_spoil_it(recorded):
    """Every fifth fix is missing and every twentieth is somewhere else on the map."""
    poses, commands = recorded[0].copy(), recorded[1]
    rng = np.random.default_rng(0)
    poses[::5] = np.nan
    poses[3::20] = rng.uniform([0, -800, -3], [2560, 0, 3], poses[3::20].shape)
    found = calibrate(poses, commands, DT)
    assert 250 < found.steps < 400
    expect_the_worlds_constants(found, commands, 250)


def test_the_calibrated_motion_predicts_where_a_command_leads(recorded):
    poses, commands = recorded
    found = calibrate(poses[:301], commands[:300], DT)
    ahead = np.array([found.motion.f(x, found.control(u), DT) for x, u in zip(poses[300:-1], commands[300:])])
    naive = np.array([DifferentialDrive().f(x, u * [50.0, 1.0], DT) for x, u in zip(poses[300:-1], commands[300:])])
    error, naive_error = (np.linalg.norm((guess - poses[301:])[:, :2], axis=1).mean() for guess in (ahead, naive))
    assert error < 0.75 * naive_error and error < 3


def test_a_robot_that_always_got_the_same_command_still_shows_its_gain():
    motion, x = DifferentialDrive(0.0, 0.0, (0.0, 0.0, 0.0)), np.zeros(3)
    poses = [x]
    for _ in range(20):
        poses.append(x := motion.f(x, np.array([30.0, 0.2]), 1.0))
    found = calibrate(np.array(poses), np.tile([0.5, 0.1], (20, 1)), 1.0)
    assert found.gain == pytest.approx([60.0, 2.0]) and found.bias == pytest.approx([0, 0])
    assert found.control([0.25, 0.05]) == pytest.approx([15.0, 0.1])


@pytest.mark.parametrize(
    ("poses", "commands", "dt", "message"),
    [
        (np.zeros((20, 3)), np.ones((20, 2)), 1.0, "expected poses"),
        (np.zeros((21, 3)), np.ones((20, 3)), 1.0, "expected poses"),
        (np.zeros((21, 3)), np.ones((20, 2)), 0.0, "dt"),
        (np.zeros((21, 3)), np.ones((20, 2)), np.nan, "dt"),
        (np.full((21, 3), np.nan), np.ones((20, 2)), 1.0, "at least 10 steps with a fix at both ends, got 0"),
        (np.zeros((6, 3)), np.ones((5, 2)), 1.0, "got 5"),
        (np.zeros((21, 3)), np.zeros((20, 2)), 1.0, "v is always 0"),
    ],
)
def test_a_recording_that_cannot_tell_is_refused(poses, commands, dt, message):
    with pytest.raises(ValueError, match=message):
        calibrate(poses, commands, dt)


def drive(errors, rng):
    """Poses of 200 steps that go 50 px and turn 1 rad for each m and rad of the command, and ``errors`` [px] more."""
    commands = rng.uniform([0.2, -0.3], [1.0, 0.3], (200, 2))
    x, poses = np.zeros(3), [np.zeros(3)]
    for (v, omega), error in zip(commands, errors, strict=True):
        way, aside = (50 * v + error[0]) * np.sinc(omega / 2 / np.pi), error[1]
        c, s = np.cos(x[2] + omega / 2), np.sin(x[2] + omega / 2)
        x = x + np.array([c * way - s * aside, s * way + c * aside, omega])
        poses.append(x)
    return np.array(poses), commands


def test_a_step_is_wild_beyond_four_robust_deviations_and_moves_nothing():
    """Errors uniform in ±1 px have the robust deviation 1.4826 · 0.5 px: the cut lies at 2.97 px, far from all."""
    errors = np.random.default_rng(7).uniform(-1, 1, (200, 2))
    without = calibrate(*(part[:n] for part, n in zip(drive(errors, np.random.default_rng(8)), (200, 199))), 1.0)
    assert without.steps == 199
    for size, kept in ((2.4, True), (3.6, False), (12.0, False), (-12.0, False)):
        wild = errors.copy()
        wild[-1, 0] = size
        found = calibrate(*drive(wild, np.random.default_rng(8)), 1.0)
        assert found.steps == 199 + kept
        if not kept:
            assert found.gain == pytest.approx(without.gain, abs=1e-9)
            assert found.bias == pytest.approx(without.bias, abs=1e-9)
            assert found.sigma_v == pytest.approx(without.sigma_v, abs=1e-9)


def test_a_recording_without_noise_keeps_every_step_and_a_noise_that_is_positive_definite():
    """What is left of its errors is rounding, 1e-13 px, and decides nothing."""
    poses, commands = drive(np.zeros((200, 2)), np.random.default_rng(9))
    for far in (0.0, 2000.0):
        found = calibrate(poses + np.array([far, -far, 0]), commands, 1.0)
        assert found.steps == 200 and found.gain == pytest.approx([50, 1])
        assert min(found.sigma_v, found.sigma_omega, found.sigma_pose) == pytest.approx(1e-6)
        np.linalg.cholesky(found.motion.Q(np.zeros(3), found.control([0.5, 0.1]), 1.0))


def test_noise_along_a_step_is_what_is_left_when_slip_which_points_every_way_is_taken_off():
    """Errors of ±3 px along and ±2 px across: slip 2 px each way, and √(9 - 4) px a step from the speed."""
    errors = np.stack([np.tile([3.0, -3.0, 3.0, -3.0], 50), np.tile([2.0, 2.0, -2.0, -2.0], 50)], axis=1)
    found = calibrate(*drive(errors, np.random.default_rng(10)), 0.5)
    assert found.sigma_pose == pytest.approx(2.0, rel=0.02)
    assert found.sigma_v == pytest.approx(np.sqrt(5.0) / 0.5, rel=0.03)
