"""CARMEN logs, line by line."""

import numpy as np
import pytest

from coursekit.recordings import read_carmen

ODOM = ["ODOM 0.0 0.0 0.0 0.5 0.1 0.0 10.0 robot 0.0", "ODOM 0.1 0.0 0.02 0.5 0.1 0.0 10.2 robot 0.2"]


def log(tmp_path, *lines, **options):
    (tmp_path / "drive.log").write_text("\n".join(["# message_name …", "PARAM robot_length 0.5", *lines]) + "\n")
    return read_carmen(tmp_path / "drive.log", **options)


def flaser(n, time, value=2.0):
    return f"FLASER {n} {' '.join([str(value)] * n)} 9 9 9 1.0 2.0 0.5 {time} robot 0.1"


def robotlaser(time, ranges=(1.0, 2.0, 3.0), remissions=(7, 8)):
    values = " ".join(map(str, ranges)), " ".join(map(str, remissions))
    return (f"ROBOTLASER1 4 -0.5 1.0 0.5 25.0 0.01 0 {len(ranges)} {values[0]} {len(remissions)} {values[1]} "
            f"1.3 2.0 0.5 1.0 2.0 0.5 0.4 0.2 0.1 0.1 0.0 {time} robot 0.1")  # fmt: skip


def test_odometry_becomes_the_track(tmp_path):
    track = log(tmp_path, *ODOM).track
    assert {k: v.tolist() for k, v in track.items()} == {
        "time": [10.0, 10.2], "v_odometry": [0.5, 0.5], "omega_odometry": [0.1, 0.1],
        "x_odometry": [0.0, 0.1], "y_odometry": [0.0, 0.0], "theta_odometry": [0.0, 0.02]}  # fmt: skip


@pytest.mark.parametrize(
    ("n", "first", "last"), [(180, -90, 89), (181, -90, 90), (360, -90, 89.5), (361, -90, 90), (5, -90, 90)]
)
def test_the_usual_front_lasers_have_the_usual_directions(n, first, last, tmp_path):
    scan = log(tmp_path, flaser(n, 10.1)).streams["scan"]
    np.testing.assert_allclose(np.rad2deg(scan["angles"][0, [0, -1]]), [first, last])
    assert [scan[k][0] for k in ("x_odometry", "y_odometry", "theta_odometry")] == [1.0, 2.0, 0.5]


def test_a_range_at_the_limit_is_nothing_there(tmp_path):
    lines = [flaser(3, 1.0, 81.83), flaser(3, 2.0, 0.0), flaser(3, 3.0, 79.0)]
    np.testing.assert_array_equal(log(tmp_path, *lines).streams["scan"]["ranges"][:, 0], [np.inf, np.inf, 79.0])
    assert np.isinf(log(tmp_path, *lines, max_range=20).streams["scan"]["ranges"]).all()
    np.testing.assert_array_equal(
        log(tmp_path, robotlaser(1.0, (1.0, 25.0, 3.0))).streams["scan"]["ranges"], [[1, np.inf, 3]]
    )
    with pytest.raises(ValueError, match="max_range: expected metres > 0"):
        log(tmp_path, *lines, max_range=0)


def test_the_newer_laser_line_tells_its_directions_the_robots_pose_and_speeds(tmp_path):
    got = log(tmp_path, robotlaser(5.0), robotlaser(5.1))
    np.testing.assert_allclose(got.streams["scan"]["angles"], [[-0.5, 0.0, 0.5]] * 2)
    np.testing.assert_array_equal(got.odometry, [[0.4, 0.2]] * 2)
    np.testing.assert_array_equal(got.odometry_poses, [[1.0, 2.0, 0.5]] * 2)
    assert "v_odometry" not in got.streams["scan"]


def test_where_both_laser_lines_are_there_the_newer_is_taken_and_the_other_counted(tmp_path):
    got = log(tmp_path, *ODOM, flaser(3, 1.0), robotlaser(5.0))
    assert len(got.streams["scan"]["time"]) == 1 and got.dropped == {"FLASER: the log has ROBOTLASER1, too": 1}
    assert len(got.track["time"]) == 2


def test_lines_that_cannot_be_used_are_dropped_and_counted(tmp_path):
    got = log(tmp_path, *ODOM, "ODOM 1 2", "ODOM 0 0 0 x 0 0 10.3 robot 0", "ODOM 0 0 0 nan 0 0 10.3 robot 0",
              "ODOM 0 0 0 0 0 0 9.0 robot 0", flaser(3, 1.0), flaser(4, 2.0), flaser(3, 3.0)[:-40],
              robotlaser(4.0)[:-30].replace("ROBOTLASER1", "FLASER"))  # fmt: skip
    assert got.dropped == {
        "ODOM: a line that is cut short": 1, "ODOM: text where a number belongs": 1, "ODOM: NaN or infinity": 1,
        "ODOM: the stamp runs backwards": 1, "FLASER: another number of beams than the first": 1,
        "FLASER: a line that is cut short": 2}  # fmt: skip


def test_a_log_without_a_usable_line_says_so(tmp_path):
    with pytest.raises(ValueError, match="expected ODOM, FLASER or ROBOTLASER1 lines, got none"):
        log(tmp_path, "ODOM 1")
    with pytest.raises(FileNotFoundError):
        read_carmen(tmp_path / "nowhere.log")
