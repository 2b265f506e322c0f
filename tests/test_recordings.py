import pickle
import warnings

import numpy as np
import pytest

from coursekit.recordings import Log, read_cloud, read_landmark_log, read_mrclam
from tests.recordings import recording

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
    header = HEADER.replace(column, "something")
    with pytest.raises(ValueError, match=rf"lacks {column}\b"):
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
