"""Degrees where radians are expected: the log's own geometry speaks, and only then is there a warning."""

import contextlib
import re
import warnings

import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.recordings import UnitWarning, datasets, read_csv_log, read_landmark_log, write_csv
from tests.recorded import recording

LANDMARKS = np.array([[3.0, 1.0], [-2.0, 2.5]])


def doubted(reader, path, table):
    """The columns that a reader doubts in this table: name → why.  A log of nothing but degrees may be refused, too."""
    write_csv(table, path)
    with warnings.catch_warnings(record=True) as caught, contextlib.suppress(ValueError):
        warnings.simplefilter("always")
        reader(path)
    said = [str(warning.message) for warning in caught if issubclass(warning.category, UnitWarning)]
    assert all(warning.filename == __file__ for warning in caught)
    return dict(re.search(r": (\w+): expected radians, .* and (.*): are they degrees", text).groups() for text in said)


def landmark_table(log, measured=1.0, true=1.0):
    return {"stamp": log.stamp, "d_meas": log.range, "theta_meas": log.bearing * measured, "d_true": log.true_range,
            "theta_true": log.true_bearing * true}  # fmt: skip


def drive(turn_rate, seconds=60.0, period=0.1, backwards=False, noise=0.01, unwrapped=True):
    """Poses, and ranges and bearings of two landmarks in turn, in radians."""
    rng, n = np.random.default_rng(0), int(seconds / period)
    time = period * np.arange(n)
    v = 0.4 * (np.where(np.sin(0.5 * time) > 0, 1, -1) if backwards else 1)
    theta = turn_rate * (time + 2 * np.sin(0.3 * time))
    x, y = np.cumsum(v * np.cos(theta)) * period, np.cumsum(v * np.sin(theta)) * period
    ids = np.arange(n) % 2
    dx, dy = (LANDMARKS[ids] - np.stack([x, y], axis=-1)).T
    distance = np.hypot(dx, dy) + noise * rng.normal(size=n)
    bearing = np.arctan2(dy, dx) - theta + noise * rng.normal(size=n)
    for i in (0, 1):
        bearing[ids == i] = np.unwrap(bearing[ids == i]) if unwrapped else bearing[ids == i] % (2 * np.pi)
    theta = theta if unwrapped else theta % (2 * np.pi)
    return {"time": time, "x": x, "y": y, "theta": theta, "id": ids, "range": distance, "bearing": bearing}


def in_degrees(table, *names):
    return table | {name: np.degrees(table[name]) for name in names}


def without(table, *names):
    return {name: column for name, column in table.items() if name not in names}


@pytest.fixture(params=["landmark_log", "landmark_log_real"])
def log(request):
    return datasets.load(request.param) if request.param == "landmark_log" else recording(request.param)


def test_the_courses_own_logs_are_not_doubted_and_their_copies_in_degrees_are(log, tmp_path):
    path = tmp_path / "log.csv"
    assert not doubted(read_landmark_log, path, landmark_table(log))
    for measured, true, expected in ((180, 180, {"theta_meas", "theta_true"}), (180, np.pi, {"theta_meas"}),
                                     (np.pi, 180, {"theta_true"})):  # fmt: skip
        found = doubted(read_landmark_log, path, landmark_table(log, measured / np.pi, true / np.pi))
        assert set(found) == expected


def test_broken_rows_among_radians_are_no_reason_to_doubt_them(tmp_path):
    table = landmark_table(datasets.load("landmark_log"))
    spoilt = table["theta_meas"].copy()
    spoilt[[5, 200, 201, 900]] = [12.0, -170.0, 190.0, 5.0]
    assert not doubted(read_landmark_log, tmp_path / "log.csv", table | {"theta_meas": spoilt})


def test_a_unit_in_the_header_is_taken_at_its_word_and_not_doubted(log, tmp_path):
    table = landmark_table(log, 180 / np.pi, 180 / np.pi)
    named = {f"{name}_deg" if "theta" in name else name: column for name, column in table.items()}
    assert not doubted(read_landmark_log, tmp_path / "log.csv", named)
    assert np.allclose(read_landmark_log(tmp_path / "log.csv").bearing, log.bearing)


def test_bearings_of_the_course_that_are_counted_from_0_to_2_pi_are_not_doubted(log, tmp_path):
    around = landmark_table(log) | {
        "theta_meas": log.bearing % (2 * np.pi),
        "theta_true": log.true_bearing % (2 * np.pi),
    }
    assert around["theta_true"].max() > np.pi
    assert not doubted(read_landmark_log, tmp_path / "log.csv", around)


@pytest.mark.parametrize("turn_rate", [0.02, 0.2, 1.0, -3.0])
@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("noise", [0.0, 0.02, 0.2])
def test_radians_that_were_never_wrapped_or_run_from_0_to_2_pi_are_not_doubted(turn_rate, backwards, noise, tmp_path):
    for unwrapped in (False, True):
        table = drive(turn_rate, backwards=backwards, noise=noise, unwrapped=unwrapped)
        for left_out in ((), ("x", "y", "theta"), ("id",), ("x", "y"), ("id", "x", "y", "theta")):
            if "id" in left_out:  # without ids there has to be one landmark
                table = {name: column[::2] for name, column in table.items()}
            assert not doubted(read_csv_log, tmp_path / "drive.csv", without(table, *left_out)), left_out


@pytest.mark.parametrize("turn_rate", [0.2, 0.5])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("unwrapped", [False, True])
def test_degrees_of_a_drive_are_doubted_column_by_column(turn_rate, noise, unwrapped, tmp_path):
    path, table = tmp_path / "drive.csv", drive(turn_rate, noise=noise, unwrapped=unwrapped)
    for names in (("theta",), ("bearing",), ("theta", "bearing")):
        assert set(doubted(read_csv_log, path, in_degrees(table, *names))) == set(names)
    no_pose = without(table, "x", "y", "theta")
    assert set(doubted(read_csv_log, path, in_degrees(no_pose, "bearing"))) == {"bearing"}


def test_each_reason_is_named(tmp_path):
    path, table = tmp_path / "drive.csv", drive(0.2, noise=0.0)
    wrapped = table | {"theta": wrap_angle(table["theta"])}
    assert "jump by 360" in doubted(read_csv_log, path, in_degrees(wrapped, "theta"))["theta"]
    assert "drives along them" in doubted(read_csv_log, path, in_degrees(drive(0.1), "theta"))["theta"]
    assert "stay in their places" in doubted(read_csv_log, path, in_degrees(table, "bearing"))["bearing"]
    alone = {name: column[::2] for name, column in table.items() if name in ("time", "range", "bearing")}
    assert "times a second" in doubted(read_csv_log, path, in_degrees(alone, "bearing"))["bearing"]
    slow = drive(0.02, noise=0.0)
    alone = {name: column[::2] for name, column in slow.items() if name in ("time", "range", "bearing")}
    assert "the range changes" in doubted(read_csv_log, path, in_degrees(alone, "bearing"))["bearing"]


def test_the_warning_can_be_made_an_error_or_left_out(tmp_path):
    path = tmp_path / "drive.csv"
    write_csv(in_degrees(drive(0.2), "bearing"), path)
    with pytest.warns(UnitWarning, match="name the unit in the header, as in bearing_deg"):
        read_csv_log(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UnitWarning)
        read_csv_log(path)
