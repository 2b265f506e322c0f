"""Any CSV of a drive, by a mapping."""

import numpy as np
import pytest

from coursekit.recordings import read_csv_log, write_csv
from coursekit.world.arena import Arena
from coursekit.world.pilot import drive
from coursekit.world.recorder import record
from coursekit.world.robot import World

WANTED = {"time": "t [ms]", "v_odometry": "speed_cm/s", "theta": "yaw_deg", "id": "tag", "range": "dist",
          "bearing": "ang (deg)"}  # fmt: skip
HEADER = "t [ms];speed_cm/s;yaw_deg;tag;dist;ang (deg);note"


def read(tmp_path, *lines, columns=None):
    (tmp_path / "drive.csv").write_text("\n".join(lines) + "\n")
    return read_csv_log(tmp_path / "drive.csv", columns)


def test_a_mapping_with_units_gives_track_and_sightings(tmp_path):
    log = read(tmp_path, HEADER, "0;50;90;;;;a", "100;50;90;3;2.5;180;b", columns=WANTED)
    np.testing.assert_allclose(log.track["time"], [0, 0.1])
    np.testing.assert_allclose(log.track["theta"], [np.pi / 2] * 2)
    np.testing.assert_allclose(log.track["v_odometry"], [0.5, 0.5])
    assert log.measurements["id"].tolist() == [3] and log.measurements["id"].dtype.kind == "i"
    np.testing.assert_allclose([log.measurements[k][0] for k in ("time", "range", "bearing")], [0.1, 2.5, np.pi])


def test_the_worlds_own_track_is_read_without_a_mapping(tmp_path):
    world = World(Arena("open"), 1)
    log = record(world, drive(world, [[0.3, 0.1]]))
    write_csv(log.track, tmp_path / "track.csv")
    back = read_csv_log(tmp_path / "track.csv")
    assert {*back.track} == {*log.track} and back.measurements == {}
    for name, column in log.track.items():
        np.testing.assert_array_equal(back.track[name], column)


def test_lines_that_cannot_be_used_are_dropped_and_counted(tmp_path):
    log = read(tmp_path, "time,v_odometry,id,range", "0,1,,", "1,1,3,2.0", "2,x,,", "3,1,3.7,2.0", "4,1,3,-2.0",
               "0.5,1,,", "5,1,3,", "6,1", "7,1,4,1.0")  # fmt: skip
    assert log.track["time"].tolist() == [0, 1, 7] and log.measurements["id"].tolist() == [3, 4]
    assert log.dropped == {"text where a number belongs": 2, "an id that is no whole number": 1,
                           "a range that is not positive": 1, "2 fields where the header names 4": 1,
                           "the stamp runs backwards": 1}  # fmt: skip


@pytest.mark.parametrize(
    ("header", "columns", "message"),
    [
        ("t,v", None, "expected time and one of x, y, theta"),
        ("time,speed", None, "expected time and one of"),
        ("t,speed", {"time": "t", "v_odometry": "velocity"}, "'velocity' is to be v_odometry, but the header lacks it"),
        ("t,speed", {"time": "t", "speed": "speed"}, "expected keys among time, x"),
    ],
)
def test_a_mapping_that_does_not_fit_says_what_is_wrong(header, columns, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, header, "0,1", columns=columns)


def test_a_file_without_a_usable_line_says_why(tmp_path):
    with pytest.raises(ValueError, match=r"no usable row; .*text where a number belongs"):
        read(tmp_path, "time,v_odometry", "a,b")
