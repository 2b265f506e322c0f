"""The sea floor: the camera looks where it says, the dive keeps its promises."""

import cv2
import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.world import seafloor
from coursekit.world.seafloor import DT, FRAME, dive, frame_to_map, load, look


def test_a_look_straight_down_without_water_is_a_cut_from_the_map():
    frame = look(load(), [700 + 199.5, 100 + 199.5, 0.0])
    assert np.array_equal(frame, load()[100:500, 700:1100])


def test_a_robot_that_heads_east_sees_the_east_of_the_map_on_top():
    frame = look(load(), [700 + 199.5, 100 + 199.5, np.pi / 2])
    cut = load()[100:500, 700:1100]
    assert np.array_equal(frame[0], cut[:, -1])  # the top row is the cut's easternmost column, north to the left
    assert np.array_equal(frame, np.rot90(cut))


def test_the_true_matrix_leads_from_a_pixel_of_the_frame_to_the_pixel_of_the_map_it_shows():
    pose, scale = [900.3, 380.8, 0.7], 1.2
    smooth = cv2.GaussianBlur(load(), (0, 0), 4)
    frame = look(smooth, pose, scale=scale)
    for u, v in [(40, 60), (350, 20), (200, 390)]:
        on_map = frame_to_map(pose, scale) @ [u, v, 1]
        patch = cv2.getRectSubPix(smooth, (1, 1), on_map.tolist())[0, 0]
        assert np.abs(patch.astype(int) - frame[v, u]).max() <= 2


def test_each_effect_of_the_water_does_what_its_name_says():
    pose, rng = [1280, 400, 0.3], np.random.default_rng(0)  # over bare sand: what varies is the effect
    plain = look(load(), pose).astype(float)
    assert np.mean(look(load(), pose, gain=0.8, offset=5)) == pytest.approx(0.8 * plain.mean() + 5, abs=0.2)
    assert np.std(look(load(), pose, noise=5, rng=rng) - plain) == pytest.approx(5, rel=0.02)
    net = look(load(), pose, caustics=0.2).astype(float) / plain - 1
    assert net.max() > 0.2 and abs(net.mean()) < 0.06
    textured = [500, 400, 0.3]
    sharp, blurred = (look(load(), textured, blur=b).astype(float) for b in (0.0, 2.0))
    assert np.abs(np.diff(blurred, axis=0)).mean() < 0.6 * np.abs(np.diff(sharp, axis=0)).mean()


def test_the_net_of_light_moves_with_time():
    pose = [1280, 400, 0.3]
    now, same, later = (look(load(), pose, caustics=0.2, time=t).astype(int) for t in (1.0, 1.0, 1.5))
    assert np.array_equal(now, same) and np.abs(now - later).mean() > 2


def test_a_grey_map_gives_grey_frames():
    grey = cv2.cvtColor(load(), cv2.COLOR_BGR2GRAY)
    frame = look(grey, [600, 400, 0], noise=2, caustics=0.1, rng=np.random.default_rng(0))
    assert frame.shape == (FRAME, FRAME) and frame.dtype == np.uint8


@pytest.mark.parametrize("pose", [[0, 0], [np.nan, 0, 0], [[0, 0, 0]]])
def test_a_pose_that_is_none_is_refused(pose):
    with pytest.raises(ValueError, match=r"pose: expected a finite \[u, v, yaw\]"):
        look(load(), pose)


def test_noise_without_a_generator_is_refused():
    with pytest.raises(ValueError, match="rng"):
        look(load(), [600, 400, 0], noise=2)


def test_a_dive_is_a_function_of_its_seed_and_its_frames_of_their_number():
    one, two, other = dive(load(), 30, 5), dive(load(), 30, 5), dive(load(), 30, 6)
    assert np.array_equal(one.poses, two.poses) and not np.array_equal(one.poses, other.poses)
    ninth = one.frame(9)
    one.frame(3)
    assert np.array_equal(one.frame(9), ninth)
    assert len(one) == 31 and one.commands.shape == (30, 2) and one.light.shape == (31, 3)


def test_the_view_stays_on_the_map_for_long_dives():
    for seed in range(5):
        recorded = dive(load(), 400, seed)
        corners = np.array([[0, 0, 1], [0, 399, 1], [399, 0, 1], [399, 399, 1]]).T
        for pose, (scale, _, _) in zip(recorded.poses, recorded.light, strict=True):
            u, v = frame_to_map(pose, scale) @ corners
            assert u.min() >= 0 and v.min() >= 0 and u.max() <= 2559 and v.max() <= 799


def test_a_command_moves_the_robot_as_the_constants_say():
    """Means over 2,000 steps within four standard errors: a false alarm in 1 of 4,000 runs over all four."""
    recorded = dive(load(), 2000, 1)
    steps, yaw = np.diff(recorded.poses[:, :2], axis=0), recorded.poses[:-1, 2]
    turned = wrap_angle(np.diff(recorded.poses[:, 2]))
    heading = yaw + turned / 2
    ahead = steps[:, 0] * np.sin(heading) - steps[:, 1] * np.cos(heading)
    error_v = ahead / DT - seafloor.PIXELS_PER_METRE * recorded.commands[:, 0]
    error_omega = -turned / DT - (seafloor.TURN_GAIN * recorded.commands[:, 1] + seafloor.TURN_BIAS)
    for error, sigma in [(error_v, np.hypot(seafloor.SIGMA_V, 0.8)), (error_omega, seafloor.SIGMA_OMEGA)]:
        assert abs(error.mean()) < 4 * sigma / np.sqrt(2000)
        assert abs(error.std() / sigma - 1) < 4 / np.sqrt(4000)


def test_a_swell_carries_the_robot_off_at_the_step_that_was_asked_for():
    recorded = dive(load(), 40, 3, kidnap_at=20)
    jumps = np.linalg.norm(np.diff(recorded.poses[:, :2], axis=0), axis=1)
    assert int(np.argmax(jumps)) == 19 and jumps[19] > 100
    assert np.delete(jumps, 19).max() < 30


def test_targets_are_swum_to_in_their_order():
    recorded = dive(load(), 80, 2, start=[500, 400, 0], targets=[[700, 380], [900, 420]])
    reached = [np.linalg.norm(recorded.poses[:, :2] - target, axis=1).argmin() for target in ([700, 380], [900, 420])]
    assert reached[0] < reached[1]
    assert np.linalg.norm(recorded.poses[:, :2] - [900, 420], axis=1).min() < 50


def test_a_map_that_is_smaller_than_the_view_is_refused():
    with pytest.raises(ValueError, match="map_image"):
        dive(np.zeros((400, 400), np.uint8), 3, 0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: look(load(), [900, 400, 0], scale=0.0), "scale: expected one finite number > 0"),
        (lambda: look(load(), [900, 400, 0], gain=np.nan), "gain: expected one finite number ≥ 0"),
        (lambda: look(load(), [900, 400, 0], size=40.5), "size: expected a whole number ≥ 1"),
        (lambda: dive(load(), 2.5, seed=1), "steps: expected a whole number ≥ 0"),
        (lambda: dive(load(), 2, seed=1, start=[900, 400]), "start: expected 3 finite numbers"),
        (lambda: dive(load(), 2, seed=1, targets=[[900, np.nan]]), "targets: expected 2 finite numbers"),
    ],
)
def test_what_no_camera_could_do_is_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()
