"""Columns are found by what their names mean."""

import numpy as np
import pytest

from coursekit.recordings import read_landmark_log

ROWS = "2.0,0.1,2.2,0.12,5.0"
WANTED = {"range": 2.0, "bearing": 0.1, "true_range": 2.2, "true_bearing": 0.12, "stamp": 5.0}


def read(tmp_path, header, *rows, **options):
    (tmp_path / "log.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return read_landmark_log(tmp_path / "log.csv", **options)


def holds(log, tolerance=1e-12):
    for name, value in WANTED.items():
        np.testing.assert_allclose(getattr(log, name), [value], rtol=0, atol=tolerance, err_msg=name)


@pytest.mark.parametrize(
    "header",
    [
        "d_meas,theta_meas,d_true,theta_true,timestamp",
        "meas_d,meas_theta,true_d,true_theta,unix_time",
        "measured_distance,measured_bearing,ground_truth_distance,ground_truth_bearing,time_sec",
        "range,bearing,gt_range,gt_bearing,t",
        "Measured Range (m),Measured Bearing [rad],True Range (m),True Bearing [rad],ROS time (s)",
        "measuredRange,measuredBearing,trueRange,trueBearing,stamp",
        "d_m,θ,d_t,theta_t,sim_time",
    ],
)
def test_a_header_is_read_by_what_its_names_mean(header, tmp_path):
    holds(read(tmp_path, header, ROWS))


def test_units_in_the_names_are_honoured(tmp_path):
    holds(read(tmp_path, "range_cm,bearing_deg,true_range_mm,true_bearing (rad),stamp_ns",
               f"200,{float(np.rad2deg(0.1))},2200,0.12,5000000000"))  # fmt: skip


def test_an_error_stands_in_for_a_truth_or_a_measurement_that_is_missing(tmp_path):
    holds(read(tmp_path, "measured_d,theta_meas,d_err,err_theta,time", "2.0,0.1,-0.2,-0.02,5.0"))
    holds(read(tmp_path, "true_d,true_theta,d_error,theta_error,time", "2.2,0.12,-0.2,-0.02,5.0"))


def test_the_error_of_a_measured_range_is_an_error_and_no_measured_range(tmp_path):
    header = "measured_range,measured_bearing,measured_range_error,measured_bearing_error,t"
    holds(read(tmp_path, header, "2.0,0.1,-0.2,-0.02,5.0"))


def test_semicolons_and_tabs_separate_too(tmp_path):
    for mark in ";\t":
        holds(read(tmp_path, "d_meas,theta_meas,d_true,theta_true,t".replace(",", mark), ROWS.replace(",", mark)))


def test_a_mapping_names_what_means_nothing_to_us_and_goes_before_what_does(tmp_path):
    header = "d,theta,psi,chi,t,true_range"
    holds(read(tmp_path, header, ROWS + ",99", columns={"true_d": "psi", "true_theta": "chi"}))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"truth": "psi"}, "expected keys among stamp, measured_d.*got 'truth'"),
        ({"true_d": "omega"}, "'omega' is to be true_d, but the header lacks it: d,theta,psi,chi,t"),
        ({"true_d": "psi"}, "lacks true_theta; it reads d,theta,psi,chi,t"),
    ],
)
def test_a_mapping_that_does_not_fit_says_what_is_wrong(columns, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, "d,theta,psi,chi,t", ROWS, columns=columns)


def test_two_columns_for_one_meaning_are_not_chosen_between_unless_one_has_the_very_name(tmp_path):
    with pytest.raises(ValueError, match="stamp: expected one column for it, the header names time, unix_time"):
        read(tmp_path, "d,theta,d_true,theta_true,time,unix_time", ROWS + ",1")
    holds(read(tmp_path, "d,theta,d_true,theta_true,time,unix_time", ROWS + ",1", columns={"stamp": "time"}))
    holds(read(tmp_path, "d,theta,d_true,theta_true,stamp,unix_time", ROWS + ",1"))


def test_the_colour_is_found_by_its_meaning_too(tmp_path):
    assert read(tmp_path, "d,theta,d_true,theta_true,t,Landmark Colour", ROWS + ", cyan").colour[0] == "cyan"


def test_a_spread_is_not_taken_for_a_range(tmp_path):
    with pytest.raises(ValueError, match="lacks measured_d, measured_theta"):
        read(tmp_path, "range_sigma,bearing_var,d_true,theta_true,t", ROWS)


def test_a_decimal_comma_is_told_as_such(tmp_path):
    with pytest.raises(ValueError, match="decimal comma"):
        read(tmp_path, "d;theta;d_true;theta_true;t", ROWS.replace(",", ";").replace(".", ","))


def test_a_line_separator_inside_a_field_does_not_split_its_row(tmp_path):
    for mark in "\u2028\v\f\x85":
        log = read(tmp_path, "d,theta,d_true,theta_true,t,color", f"{ROWS},light{mark}blue")
        assert len(log) == 1 and log.colour[0] == f"light{mark}blue"


@pytest.mark.parametrize(("encoding", "named"), [("utf-16", "UTF-16"), ("cp1252", "cp1252")])
def test_a_log_in_another_encoding_names_it_and_says_what_to_do(encoding, named, tmp_path):
    (tmp_path / "log.csv").write_bytes("stamp,measured_d,couleur\n1,2,bleu pâle\n".encode(encoding))
    with pytest.raises(ValueError, match=f"{named}.*save as UTF-8"):
        read_landmark_log(tmp_path / "log.csv")
