import pickle
import warnings

import numpy as np
import pytest

from coursekit.recordings import Log, read_cloud, read_landmark_log, read_mrclam
from tests.recorded import recording

HEADER = "stamp,measured_d,measured_theta,true_d,true_theta,err_d,err_theta,color"
GOOD = ["8.0,1.33,0.02,1.5,0.01,-0.17,0.01,cyan", "8.1,1.34,0.02,1.5,0.01,-0.16,0.01,cyan",
        "8.2,1.35,0.02,1.5,0.01,-0.15,0.01,cyan", "8.3,1.36,0.02,1.5,0.01,-0.14,0.01,cyan"]  # fmt: skip


def written(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def csv_file(tmp_path):
    return lambda *lines: written(tmp_path / "log.csv", lines)


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("8.05,oops,0.02,1.5,0.01,0,0,cyan", "text"),
        ("8.05,1_3,0.02,1.5,0.01,0,0,cyan", "text"),
        ("8.05,,0.02,1.5,0.01,0,0,cyan", "text"),
        ("8.05,nan,0.02,1.5,0.01,0,0,cyan", "NaN"),
        ("8.05,1.3,inf,1.5,0.01,0,0,cyan", "infinity"),
        ("1762576478.3,0.0,0.0,0.0,0.0,0.0,0.0,cyan", "zeros"),
        ("8.05,0.0,0.0,1.5,0.01,-1.5,0,cyan", "not positive"),
        ("8.05,-1.3,0.0,1.5,0.01,-1.5,0,cyan", "not positive"),
        ("8.05,1.3,12.0,1.5,0.01,0,0,cyan", "degrees"),
        ("8.05,1.3,0.02", "3 fields"),
        ("8.05,1.3,0.02,1.5,0.01,0,0,cyan,surplus", "9 fields"),
        ("7.9,1.3,0.02,1.5,0.01,0,0,cyan", "backwards"),
        ("1762576478.3,1.3,0.02,1.5,0.01,0,0,cyan", "backwards"),
    ],
)
def test_a_broken_row_is_dropped_counted_and_named(csv_file, row, reason):
    log = read_landmark_log(csv_file(HEADER, *GOOD[:1], row, *GOOD[1:]))
    assert len(log) == 4
    assert log.dropped == 1
    assert log.rejected[0].line == 3
    assert reason in log.rejected[0].reason
    np.testing.assert_allclose(log.range, [1.33, 1.34, 1.35, 1.36])


def test_the_columns_may_come_in_any_order_with_spaces_and_without_errors_or_colour(csv_file):
    log = read_landmark_log(
        csv_file(" true_d , stamp,measured_theta,measured_d,true_theta", "1.5,8.0,0.02,1.33,0.01", "")
    )
    assert (log.true_range[0], log.stamp[0], log.bearing[0], log.range[0]) == (1.5, 8.0, 0.02, 1.33)
    assert log.true_bearing[0] == 0.01
    assert log.dropped == 0


def test_a_byte_order_mark_and_windows_line_ends_are_no_obstacle(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(("\ufeff" + "\r\n".join([HEADER, *GOOD]) + "\r\n").encode("utf-8"))
    assert (len(read_landmark_log(path)), read_landmark_log(path).dropped) == (4, 0)


@pytest.mark.parametrize("column", ["stamp", "measured_d", "measured_theta", "true_d", "true_theta"])
def test_a_missing_column_is_an_error_that_names_it(csv_file, column):
    header = HEADER.replace(column, "something").replace("err_", "psi_")
    with pytest.raises(ValueError, match=rf"lacks {column};.*something.*columns=\{{'{column}'"):
        read_landmark_log(csv_file(header, *GOOD))


def test_a_missing_file_an_empty_one_and_one_without_rows_each_say_so(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        read_landmark_log(tmp_path / "nowhere.csv")
    with pytest.raises(ValueError, match="empty"):
        read_landmark_log(written(tmp_path / "empty.csv", ["", "  "]))
    with pytest.raises(ValueError, match="no usable row; it holds no rows"):
        read_landmark_log(written(tmp_path / "header.csv", [HEADER]))
    with pytest.raises(ValueError, match="2 × text"):
        read_landmark_log(written(tmp_path / "bad.csv", [HEADER, "a,b,c,d,e,f,g,h", "a,b,c,d,e,f,g,h"]))


class _Bomb:
    def __reduce__(self):
        return (pytest.fail, ("the reader unpickled a file",))


def test_a_pickle_is_refused_unopened(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(pickle.dumps(_Bomb()))
    with pytest.raises(ValueError, match="binary"):
        read_landmark_log(path)
    with pytest.raises(ValueError, match="binary"):
        read_cloud(path)


def test_out_of_order_stamps_cost_as_few_rows_as_possible(csv_file):
    stamps = [1, 2, 9, 3, 4, 4, 0, 5, 6]
    log = read_landmark_log(csv_file(HEADER, *(f"{s},1.3,0.02,1.5,0.01,0,0,cyan" for s in stamps)))
    np.testing.assert_array_equal(log.stamp, [1, 2, 3, 4, 4, 5, 6])
    assert [row.line for row in log.rejected] == [4, 8]


def test_bearings_are_wrapped_and_their_error_is_small_across_pi(csv_file):
    log = read_landmark_log(csv_file(HEADER, "8,1.3,3.1,1.5,-3.1,0,0,cyan", "8,1.3,0.1,1.5,6.2,0,0,cyan"))
    np.testing.assert_allclose(log.bearing_error, [6.2 - 2 * np.pi, 0.1 - 6.2 + 2 * np.pi])
    assert log.true_bearing[1] < 0


def test_a_log_is_sliced_like_an_array_and_cannot_be_changed(csv_file):
    log = read_landmark_log(csv_file(HEADER, *GOOD, "8.4,x,0,0,0,0,0,red"))
    assert len(log[::2]) == 2
    np.testing.assert_array_equal(log[log.range > 1.345].stamp, [8.2, 8.3])
    np.testing.assert_array_equal(log[[3, 0]].stamp, [8.3, 8.0])
    assert log[::2].dropped == log.dropped == 1
    assert "4 samples" in repr(log) and "1 row dropped" in repr(log)
    assert "0 samples" in repr(log[:0])
    with pytest.raises(ValueError, match="read-only"):
        log.range[0] = 1.0
    with pytest.raises(TypeError, match="slice"):
        log[0]


def test_a_log_made_by_hand_is_checked():
    good = np.ones(3)
    log = Log(good, good, good, good, dropped=2)
    np.testing.assert_array_equal(log.stamp, [0, 1, 2])
    assert log[1:].dropped == 2 and len(log[1:].colour) == 2
    with pytest.raises(ValueError, match="true_range: expected one entry a sample"):
        Log(good, good, np.ones(2), good, good, ["cyan"] * 3)
    with pytest.raises(ValueError, match="bearing: expected finite"):
        Log(good, good * np.nan, good, good, good, ["cyan"] * 3)


def test_a_cloud_drops_its_broken_points_with_one_warning_that_counts_them(tmp_path):
    path = written(tmp_path / "cloud.txt", ["# x y z", "1 2 3", "0 0 0", "4 5 six", "7 8", "1e1 nan 2", "4 5 6"])
    with pytest.warns(UserWarning, match="4 rows dropped.*line 3"):
        points = read_cloud(path)
    np.testing.assert_array_equal(points, [[1, 2, 3], [4, 5, 6]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(read_cloud(written(path, ["1 2 3"])), [[1, 2, 3]])


@pytest.fixture
def run_folder(tmp_path):
    written(tmp_path / "Barcodes.dat", ["# subject barcode", "1 5", "2 14", "6 63", "7 81"])
    written(tmp_path / "Landmark_Groundtruth.dat", ["6 1.0 2.0 0.1 0.1", "7 3.0 4.0 0.1 0.1"])
    written(tmp_path / "Robot2_Odometry.dat", ["0.0 0.1 0.2", "0.1 0.1 0.2", "0.05 0.1 0.2", "0.2 0.1 x"])
    written(tmp_path / "Robot2_Measurement.dat",
            ["0.0 63 1.0 0.1", "0.0 81 2.0 0.2", "0.1 5 1.5 0.3", "0.1 99 1.5 0.4", "0.2 63 1.1 0.1"])  # fmt: skip
    written(tmp_path / "Robot2_Groundtruth.dat", ["0.0 1 2 3", "0.1 1 2 3"])
    return tmp_path


def test_an_mrclam_run_drops_robots_misread_barcodes_and_broken_rows_and_counts_each(run_folder):
    run = read_mrclam(run_folder, robot=2)
    np.testing.assert_array_equal(run.measurements, [[0, 6, 1, 0.1], [0, 7, 2, 0.2], [0.2, 6, 1.1, 0.1]])
    assert run.odometry.shape == (2, 3) and run.groundtruth.shape == (2, 4)
    np.testing.assert_array_equal(run.landmarks[7], [3.0, 4.0])
    assert run.dropped["another robot"] == run.dropped["unknown barcode"] == 1
    assert run.dropped["Robot2_Odometry.dat: the stamp runs backwards"] == 1
    assert run.dropped["Robot2_Odometry.dat: text where a number belongs"] == 1


def test_an_mrclam_run_drops_what_cannot_be_measured_with_its_reason(run_folder):
    written(run_folder / "Robot2_Measurement.dat",
            ["0.0 63 1.0 0.1", "0.1 63 -2.0 0.1", "0.2 63 0 0.1", "0.3 63 1.0 45", "0.4 63.7 1.0 0.1",
             "0.5 81 1.0 4.0"])  # fmt: skip
    run = read_mrclam(run_folder, robot=2)
    np.testing.assert_allclose(run.measurements, [[0, 6, 1, 0.1], [0.5, 7, 1, 4.0 - 2 * np.pi]])
    reasons = {k.split(": ")[1]: n for k, n in run.dropped.items() if k.startswith("Robot2_Measurement")}
    assert reasons == {"a range that is not positive": 2, "a bearing beyond a full turn; is it in degrees?": 1,
                       "a barcode or subject that is no whole number": 1}  # fmt: skip


def test_an_mrclam_run_counts_a_row_of_its_maps_that_is_there_twice_or_has_no_whole_number(run_folder):
    written(run_folder / "Barcodes.dat", ["1 5", "2 14", "6 63", "6 63", "7 81", "8 90.5"])
    written(run_folder / "Landmark_Groundtruth.dat", ["6 1 2 0 0", "7 3 4 0 0", "7 3 4 0 0", "7.5 3 4 0 0"])
    run = read_mrclam(run_folder, robot=2)
    assert len(run.measurements) == 3 and sorted(run.landmarks) == [6, 7]
    assert run.dropped["Barcodes.dat: a row that is there twice"] == 1
    assert run.dropped["Barcodes.dat: a barcode or subject that is no whole number"] == 1
    assert run.dropped["Landmark_Groundtruth.dat: a row that is there twice"] == 1
    assert run.dropped["Landmark_Groundtruth.dat: a barcode or subject that is no whole number"] == 1


@pytest.mark.parametrize(
    ("name", "rows", "message"),
    [
        ("Barcodes.dat", ["6 63", "7 63"], "expected each barcode once, 63 stands in the rows"),
        ("Barcodes.dat", ["6 63", "6 81"], "expected each subject once, 6 stands in the rows"),
        ("Landmark_Groundtruth.dat", ["6 1 2 0 0", "6 1 3 0 0"], "expected each subject once, 6 stands"),
    ],
)
def test_an_mrclam_map_that_contradicts_itself_is_refused(run_folder, name, rows, message):
    written(run_folder / name, rows)
    with pytest.raises(ValueError, match=rf"{name}: {message}"):
        read_mrclam(run_folder, robot=2)


def test_an_mrclam_run_without_a_usable_measurement_says_why(run_folder):
    written(run_folder / "Robot2_Measurement.dat", ["0.0 63 -1.0 0.1"])
    with pytest.raises(ValueError, match=r"Robot2_Measurement\.dat: no usable row.*not positive"):
        read_mrclam(run_folder, robot=2)


def test_an_mrclam_run_without_one_of_its_files_names_it(run_folder):
    with pytest.raises(FileNotFoundError, match="Robot1_Measurement"):
        read_mrclam(run_folder, robot=1)


def test_the_real_recordings_have_the_shapes_their_sources_state():
    log, clouds, run = recording("landmark_log_real"), recording("icp_clouds"), recording("mrclam7_robot1")
    assert (len(log), log.dropped) == (1842, 1)
    assert set(log.colour) == {"cyan"}
    assert clouds.source.shape == clouds.target.shape == (5750, 3)
    assert run.odometry.shape[1] == 3 and len(run.landmarks) == 15
    assert set(run.measurements[:, 1]) <= set(range(6, 21))
    assert run.dropped == {"another robot": 650, "unknown barcode": 0}
    assert run.odometry[-1, 0] - run.odometry[0, 0] == pytest.approx(896, abs=6)


def test_a_stray_quote_or_an_endless_field_spoils_its_own_row_only(csv_file):
    for broken in ('2,"2,0.1,2.2,0.1', "2,2,0.1,2.2," + "1" * 200_000):
        header = "stamp,measured_d,measured_theta,true_d,true_theta"
        log = read_landmark_log(csv_file(header, "1,2,0.1,2.2,0.1", broken, "3,2,0.1,2.2,0.1", "4,2,0.1,2.2,0.1"))
        assert (len(log), log.dropped, log.rejected[0].line) == (3, 1, 3)


def test_a_column_named_twice_is_an_error(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("stamp,measured_d,measured_d,measured_theta,true_d,true_theta\n1,2,99,0.1,2.2,0.1\n")
    with pytest.raises(ValueError, match="names measured_d twice"):
        read_landmark_log(path)


@pytest.mark.parametrize("bad", [0.0, -1.0])
def test_a_log_made_by_hand_holds_no_range_that_cannot_be(bad):
    with pytest.raises(ValueError, match=r"^range: expected metres > 0"):
        Log([bad, 2.0], [0, 0], [1, 2], [0, 0])
    with pytest.raises(ValueError, match=r"true_range: expected metres > 0"):
        Log([1, 2], [0, 0], [bad, 2.0], [0, 0])


def test_speed_and_turn_rate_come_from_where_the_landmark_stood_in_the_robots_view():
    """A robot drives along an arc past a landmark.  A rate belongs to the last 0.08 s, hence the tolerance; a landmark
    abeam says little about the speed, so those moments are left out."""
    t = np.arange(0, 4, 0.02)
    v, omega = 0.6, 0.3
    heading = omega * t
    x, y = v / omega * np.sin(heading), v / omega * (1 - np.cos(heading))
    ahead, left = 4.0 - x, 1.0 - y
    r, phi = np.hypot(ahead, left), np.arctan2(left, ahead) - heading
    log = Log(r, phi, r, phi, t)
    seen = (np.abs(phi) < 1.0) & (t > 0.1)
    assert seen.sum() > 80
    np.testing.assert_allclose(log.speed[seen], v, atol=0.02)
    np.testing.assert_allclose(log.turn_rate[seen], omega, atol=0.02)
    half = log[::2]
    np.testing.assert_array_equal(half.turn_rate, log.turn_rate[::2])  # not computed again from fewer samples


def test_rates_are_zero_where_there_is_no_clock_or_one_moment_and_finite_wherever_the_landmark_stands():
    r, phi = np.full(6, 2.0), np.linspace(-np.pi, np.pi, 6)
    assert not Log(r, phi, r, phi).turn_rate.any()
    assert not Log(r, phi, r, phi, np.zeros(6)).turn_rate.any()
    assert Log(r[:1], phi[:1], r[:1], phi[:1], [0.0]).speed == 0.0
    abeam = Log(r, phi, np.linspace(2, 3, 6), np.full(6, np.pi / 2), np.arange(6.0))
    assert np.all(np.isfinite(abeam.speed)) and np.abs(abeam.speed).max() < 1e-9


def test_a_log_believes_the_rates_that_it_is_given():
    r, phi = np.full(3, 2.0), np.zeros(3)
    log = Log(r, phi, r, phi, np.arange(3.0), speed=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(log.speed, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(log.turn_rate, np.zeros(3))
    with pytest.raises(ValueError, match="turn_rate: expected finite numbers"):
        Log(r, phi, r, phi, np.arange(3.0), turn_rate=[0.0, np.nan, 0.0])
