"""What the benchmarks say of the times that they took: ratios, spreads, turns."""

import json
import os

import pytest

from benchmarks import results


def test_the_ratio_is_the_median_of_the_rounds_and_not_of_the_times():
    rows = results.Rows("EKF", threads=1)
    rows.add("one step", "µs", [1.0, 10.0, 2.0], [2.0, 30.0, 3.0], ("filterpy", "1.4"))
    (row,) = rows.rows
    assert (row["ours"], row["peer"], row["ratio"], row["rounds"]) == (2.0, 3.0, 2.0, 3)
    assert row["spread"] == pytest.approx([1.6, 2.8])


def test_without_a_peer_the_spread_is_that_of_our_own_figures():
    rows = results.Rows("EKF", threads=1)
    rows.add("one step", "µs", [1.0, 2.0, 3.0])
    rows.add("memory", "bytes", 40.0)
    assert rows.rows[0]["spread"] == pytest.approx([1.2, 2.8]) and rows.rows[0]["ratio"] is None
    assert rows.rows[1]["spread"] is None and rows.rows[1]["rounds"] == 1


def test_jobs_take_turns_and_the_first_round_is_not_counted():
    turns = []
    seconds = results.in_turns({"a": lambda: turns.append("a"), "b": lambda: turns.append("b")}, rounds=2, calls=2)
    assert "".join(turns) == "aabb" * 3
    assert all(each.shape == (2,) and (each > 0).all() for each in seconds.values())


def test_rows_are_stored_where_they_are_asked_for_and_name_no_host(tmp_path):
    rows = results.Rows("EKF", threads=2)
    rows.add("one step", "µs", [1.0, 2.0])
    rows.store(None)
    rows.store(tmp_path / "new" / "ekf.json")
    (row,) = json.loads((tmp_path / "new" / "ekf.json").read_text(encoding="utf-8"))
    assert row["threads"] == 2 and row["machine"].endswith(f"{os.cpu_count()} cores")
    assert os.uname().nodename not in row["machine"]
