"""Tables go to CSV and back to the bit and the type, also through a spreadsheet's hands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coursekit.recordings.tables import as_table, read_csv, write_csv


def back(table, folder):
    write_csv(table, folder / "table.csv")
    return read_csv(folder / "table.csv")


@pytest.mark.parametrize(
    "column",
    [
        np.array([True, False]),
        np.array(["1", "2"]),
        np.array(["inf", "nan"]),
        np.array(["True", "False"]),
        np.array(["", "a"]),
        np.array(["", ""]),
        np.array(["1_000", "-"]),
        np.array(["a\u2028b", "c\vd\fe"]),
        np.array(["c\nd", "e\r\nf\rg"]),
        np.array(['say "θ"', "a, b"]),
        np.array([" 1", "2 "]),
        np.array([2**62 + 1, -1]),
        np.array([2**64 - 1, 0], dtype=np.uint64),
        np.array([0.1 + 0.2, -0.0]),
        np.array([np.inf, np.nan]),
        np.array([1.0, 2.0]),
        np.array([5e-324, 1e300]),
        np.array([7, 8]),
    ],
    ids=repr,
)
def test_a_column_comes_back_to_the_bit_and_the_type(column, tmp_path):
    for table in ({"only": column}, {"before": np.arange(2), "only": column, "after": np.array(["x", "y"])}):
        other = back(table, tmp_path)["only"]
        assert other.dtype.kind == column.dtype.kind
        assert other.tolist() == column.tolist() or np.array_equal(other, column, equal_nan=column.dtype.kind == "f")
        if column.dtype.kind == "f":
            assert np.array_equal(np.signbit(other), np.signbit(column))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0")), min_size=1, max_size=4))
def test_any_text_comes_back_as_it_was(tmp_path_factory, texts):
    folder = tmp_path_factory.mktemp("text")
    assert back({"text": np.array(texts), "x": np.zeros(len(texts))}, folder)["text"].tolist() == texts


def test_a_spreadsheet_that_saves_with_a_mark_and_windows_line_ends_changes_no_name_and_no_number(tmp_path):
    write_csv({"time": [0.1, 0.2], "id": [3, 4], "seen": [True, False]}, tmp_path / "table.csv")
    text = (tmp_path / "table.csv").read_text()
    (tmp_path / "saved.csv").write_bytes(("\ufeff" + text.replace("\n", "\r\n")).encode())
    saved = read_csv(tmp_path / "saved.csv")
    assert [*saved] == ["time", "id", "seen"]
    assert {k: v.tolist() for k, v in saved.items()} == {"time": [0.1, 0.2], "id": [3, 4], "seen": [True, False]}


@pytest.mark.parametrize(
    ("encoding", "named"), [("utf-16", "UTF-16"), ("utf-16-le", "UTF-16"), ("utf-32", "UTF-32"), ("cp1252", "cp1252")]
)
def test_another_encoding_is_named_with_the_remedy(encoding, named, tmp_path):
    (tmp_path / "table.csv").write_bytes("where,x\nMünchen,1\n".encode(encoding))
    with pytest.raises(ValueError, match=f"{named}.*save as UTF-8"):
        read_csv(tmp_path / "table.csv")


def test_what_is_no_text_at_all_is_called_binary(tmp_path):
    (tmp_path / "table.csv").write_bytes(bytes(range(256)))
    with pytest.raises(ValueError, match="binary"):
        read_csv(tmp_path / "table.csv")


def test_a_quote_that_is_not_closed_is_told_by_its_line(tmp_path):
    (tmp_path / "table.csv").write_text('a,b\n1,2\n"3,4\n')
    with pytest.raises(ValueError, match="line 3: expected a quote that is closed"):
        read_csv(tmp_path / "table.csv")


def test_blank_lines_are_no_rows_and_a_torn_row_is_told_by_its_own_line(tmp_path):
    (tmp_path / "table.csv").write_text('a,b\n\n"1\n",2\n\n3\n')
    with pytest.raises(ValueError, match="line 6: expected 2 values, got 1"):
        read_csv(tmp_path / "table.csv")


def test_rows_may_name_their_columns_in_another_order():
    table = as_table([{"a": 1, "b": "x"}, {"b": "y", "a": 2}])
    assert {k: v.tolist() for k, v in table.items()} == {"a": [1, 2], "b": ["x", "y"]}


def test_numbers_among_text_are_refused_and_not_turned_into_text():
    with pytest.raises(ValueError, match="id: expected all text or all numbers, got 1 among text"):
        as_table([{"id": "a"}, {"id": 1}])


def test_a_float_too_wide_for_a_csv_is_refused_and_nothing_is_written(tmp_path):
    if np.dtype(np.longdouble).itemsize == 8:
        pytest.skip("here a long double has 64 bits")
    with pytest.raises(ValueError, match="x: expected numbers of at most 64 bits"):
        write_csv({"x": np.ones(2, np.longdouble)}, tmp_path / "table.csv")
    with pytest.raises(ValueError, match="surrogates"):
        write_csv({"x": np.array(["\ud800"])}, tmp_path / "table.csv")
    assert not (tmp_path / "table.csv").exists()
