"""Hostile files: each reader, with files cut at every byte, other encodings, line ends and delimiters."""

import warnings

import numpy as np
import pytest

from coursekit import recordings
from coursekit.recordings import Trajectory

TEXTS = {
    "read_landmark_log": "unix_time,d_meas,theta_meas,d_true,theta_true\n" + "".join(
        f"{0.1 * k:.1f},{2 - 0.01 * k:.2f},0.01,{2 - 0.01 * k:.2f},0.012\n" for k in range(8)),
    "read_csv_log": "time,v,omega\n" + "".join(f"{0.1 * k:.1f},0.5,0.1\n" for k in range(8)),
    "read_csv": "a,b,c\n1,2.5,text\n3,4.5,more\n",
    "read_cloud": "x y z\n" + "".join(f"{k} {k + 1} {2 * k}.5\n" for k in range(8)),
    "read_tum": "# time x y z qx qy qz qw\n" + "".join(f"{k} {k}.5 0 0 0 0 0 1\n" for k in range(4)),
    "read_kitti": "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 2 0 1 0 0 0 0 1 0\n",
    "read_map": "id,x,y\n1,2.0,3.0\n2,-1.0,0.5\n",
    "read_carmen": "ODOM 1.0 2.0 0.1 0.5 0.0 0.0 10.5 host 0.5\nODOM 1.1 2.0 0.1 0.5 0.0 0.0 10.6 host 0.6\n",
}  # fmt: skip
READERS = pytest.mark.parametrize("reader", TEXTS)


def read(reader, path):
    """What a reader makes of a file: its result, or None for a ValueError that names the file; nothing else."""
    refusal = None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "[^:]*: [0-9]+ rows dropped")  # what ``read_cloud`` says by its docstring
        try:
            return getattr(recordings, reader)(path)
        except ValueError as error:
            refusal = error
    assert type(refusal) is ValueError and path.name in str(refusal), repr(refusal)
    return None


@READERS
def test_a_file_that_is_whole_is_read_with_any_line_end_and_with_a_byte_order_mark(reader, tmp_path):
    path, text = tmp_path / "whole.txt", TEXTS[reader]
    for end in ("\n", "\r\n", "\r"):
        for mark in (b"", b"\xef\xbb\xbf"):
            path.write_bytes(mark + text.replace("\n", end).encode())
            assert read(reader, path) is not None


@READERS
def test_a_file_cut_at_any_byte_is_read_in_part_or_refused_by_its_name(reader, tmp_path):
    path, content = tmp_path / "cut.txt", TEXTS[reader].encode()
    for length in range(min(len(content), 160)):
        path.write_bytes(content[:length])
        read(reader, path)


@READERS
@pytest.mark.parametrize(
    "what", ["utf-16", "utf-32", "cp1252", "zeros", "noise", "semicolons", "quotes", "one long line"]
)
def test_a_file_of_another_kind_is_refused_by_its_name_or_read_without_its_broken_rows(reader, what, tmp_path):
    path, text = tmp_path / "strange.txt", TEXTS[reader]
    content = {
        "utf-16": text.encode("utf-16"),
        "utf-32": text.encode("utf-32"),
        "cp1252": ("# é ü\n" + text).encode("cp1252"),
        "zeros": bytes(300),
        "noise": np.random.default_rng(0).integers(0, 256, 500, dtype=np.uint8).tobytes(),
        "semicolons": text.replace(",", ";").replace(" ", ";").encode(),
        "quotes": text.replace("1", '"').encode(),
        "one long line": b"1," * 100_000,
    }[what]
    path.write_bytes(content)
    result = read(reader, path)
    if what in ("utf-16", "utf-32", "zeros", "noise", "cp1252"):
        assert result is None


@READERS
def test_the_same_rows_in_other_dress_are_read_alike(reader, tmp_path):
    """Of those that a reader takes at all: no line end at the last row, other delimiters, a header that comes again."""
    path, text = tmp_path / "whole.txt", TEXTS[reader]
    path.write_text(text)
    expected = repr(read(reader, path)).partition(";")[0]
    dresses = {"no end": text.rstrip(), "blank lines": text.replace("\n", "\n\n")}
    if reader in ("read_landmark_log", "read_csv_log"):
        head, *rows = text.splitlines()
        dresses |= {"semicolons": text.replace(",", ";"), "tabs": text.replace(",", "\t"),
                    "a comma at each end": text.replace("\n", ",\n"), "spaces": text.replace(",", " ,  "),
                    "quotes": '"' + text.strip().replace(",", '","').replace("\n", '"\n"') + '"'}  # fmt: skip
        again = "\n".join([head, *rows[:3], head, *rows[3:]])
        path.write_text(again)
        assert (
            len(read(reader, path).__dict__[{"read_landmark_log": "rejected", "read_csv_log": "dropped"}[reader]]) == 1
        )
    for dress, written in dresses.items():
        path.write_text(written)
        assert repr(read(reader, path)).partition(";")[0] == expected, dress


@READERS
@pytest.mark.parametrize("number", ["1e400", "1e308", "-1e200", "5e-324", "9" * 400, "9" * 5000, "0x1", "1_1", "nan"])
def test_a_number_that_no_robot_measures_spoils_its_row_or_its_file_and_nothing_else(reader, number, tmp_path):
    """An id of 5,000 digits, a quaternion whose square overflows: refused by the file's name, or kept as text."""
    path = tmp_path / "large.txt"
    for place in ("1", "0", "2"):
        path.write_text(TEXTS[reader].replace(place, number))
        read(reader, path)


@pytest.mark.parametrize("suffix", ["ply", "pcd", "npy"])
def test_a_binary_cloud_cut_at_any_byte_of_its_header_is_refused_by_its_name(suffix, tmp_path):
    whole, cut = tmp_path / f"whole.{suffix}", tmp_path / f"cut.{suffix}"
    recordings.write_cloud(whole, np.arange(30.0).reshape(10, 3))
    content = whole.read_bytes()
    assert read("read_cloud", whole) is not None
    for length in range(min(len(content), 260)):
        cut.write_bytes(content[:length])
        read("read_cloud", cut)


def test_bearings_in_degrees_are_dropped_and_the_reason_asks_for_the_unit(tmp_path):
    """A column named theta whose numbers go beyond a full turn; the log's own geometry says otherwise."""
    path, k = tmp_path / "degrees.csv", np.arange(40)
    rows = [f"{0.1 * i:.1f},2.0,{20 * np.sin(i / 5):.2f},2.0,{20 * np.sin(i / 5):.2f}" for i in k]
    path.write_text("unix_time,d_meas,theta_meas,d_true,theta_true\n" + "\n".join(rows) + "\n")
    with pytest.warns(recordings.UnitWarning, match="theta_"):
        log = recordings.read_landmark_log(path)
    assert log.dropped > 20 and all("is it in degrees?" in row.reason for row in log.rejected)


def test_what_was_written_comes_back(tmp_path):
    way = Trajectory.planar([0.0, 1.0], [[0.0, 0.0, 0.1], [1.0, 2.0, -3.0]])
    recordings.write_tum(way, tmp_path / "way.tum")
    assert np.allclose(recordings.read_tum(tmp_path / "way.tum").poses, way.poses, atol=1e-12)
