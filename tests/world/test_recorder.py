import io
import pickle

import numpy as np
import pytest

from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar
from coursekit.world.pilot import drive
from coursekit.world.recorder import LANDMARK_COLUMNS, Recording, as_table, read_csv, record, write_csv
from coursekit.world.robot import World


def landmark_row(world):
    """A row like those of the report's log, for every second period."""
    if round(world.time / world.dt) % 2:
        return None
    x, y, heading = world.pose
    true = np.hypot(1.5 - x, y), np.arctan2(-y, 1.5 - x) - heading
    measured = true[0] - 1 / 6, true[1] + 1e-3
    return dict(zip(LANDMARK_COLUMNS, (world.time, *measured, *true, -1 / 6, 1e-3, "cyan"), strict=True))


@pytest.fixture
def recording():
    world = World(Arena("open"), 1)
    return record(world, drive(world, [[0.5, 0.0], [0.5, 0.5]]), landmark_row)


def test_every_period_is_kept_with_truth_odometry_and_command(recording):
    world, steps = World(Arena("open"), 1), []
    for step in drive(world, [[0.5, 0.0], [0.5, 0.5]]):
        steps.append((world.time, world.pose, world.odometry, step.control))
    times, poses, odometry, controls = (np.array(column) for column in zip(*steps, strict=True))
    assert np.array_equal(recording.track["time"], times)
    assert np.array_equal(recording.poses, poses)
    assert np.array_equal(recording.odometry, odometry)
    assert np.array_equal(recording.controls, controls)


def test_steps_without_a_measurement_leave_no_row(recording):
    assert len(recording.measurements["stamp"]) == len(recording.track["time"]) // 2


def test_several_rows_in_one_step_share_its_time():
    world = World(Arena("open"), 1)
    log = record(world, drive(world, [[0.2, 0.0]]), lambda world: [{"id": 1}, {"id": 2}])
    assert np.array_equal(log.measurements["time"], np.repeat(log.track["time"], 2))
    assert log.measurements["id"][:4].tolist() == [1, 2, 1, 2]


def test_a_landmark_log_goes_to_csv_and_back_with_every_bit_and_its_columns_in_order(recording, tmp_path):
    path = tmp_path / "log.csv"
    write_csv(recording.measurements, path)
    assert path.read_text().splitlines()[0] == "stamp,measured_d,measured_theta,true_d,true_theta,err_d,err_theta,color"
    back = read_csv(path)
    assert list(back) == list(LANDMARK_COLUMNS) and set(back["color"]) == {"cyan"}
    for key in LANDMARK_COLUMNS:
        assert np.array_equal(back[key], recording.measurements[key])


def test_an_npz_goes_there_and_back_with_scans_and_the_same_bytes_each_time(tmp_path):
    world = World(Arena.load("lab"), 1)
    lidar, rng = Lidar(), np.random.default_rng(1)
    log = record(world, drive(world, [[0.3, 0.0]]), lambda world: {"ranges": lidar.scan(world, rng).ranges})
    log.save(tmp_path / "a.npz")
    log.save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = Recording.load(tmp_path / "a.npz")
    assert back.measurements["ranges"].shape == (len(log.track["time"]), 360)
    for table, other in ((back.track, log.track), (back.measurements, log.measurements)):
        assert list(table) == list(other)
        assert all(np.array_equal(table[key], other[key]) for key in table)


class Bomb:
    """What a pickle can do: run code when it is read."""

    def __reduce__(self):
        return (pytest.fail, ("the pickle was opened",))


def test_pickles_are_refused_on_reading_and_never_opened(tmp_path):
    inside = io.BytesIO()
    np.savez(inside, **{"track/time": np.array([Bomb()], dtype=object)})
    for name, content in {"inside.npz": inside.getvalue(), "whole.npz": pickle.dumps(Bomb())}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match=rf"{name}.*without pickles"):
            Recording.load(tmp_path / name)


@pytest.mark.parametrize("content", [b"", b"no recording", b"\x93NUMPY"])
def test_a_file_that_is_no_recording_is_told_so(content, tmp_path):
    (tmp_path / "odd.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"odd\.npz"):
        Recording.load(tmp_path / "odd.npz")


def test_an_array_of_another_project_is_no_recording(tmp_path):
    np.savez(tmp_path / "other.npz", weights=np.zeros(3))
    with pytest.raises(ValueError, match=r"other\.npz"):
        Recording.load(tmp_path / "other.npz")


def test_what_only_a_pickle_could_hold_is_refused_on_writing(tmp_path):
    with pytest.raises(ValueError, match="a: expected numbers or text"):
        as_table([{"a": object()}])
    with pytest.raises(ValueError, match="a: expected rows of one shape"):
        as_table([{"a": [1]}, {"a": [1, 2]}])
    with pytest.raises(ValueError, match="b"):
        Recording({"b": np.array([None])}, {}).save(tmp_path / "x.npz")
    with pytest.raises(ValueError, match="one value a row"):
        write_csv({"image": np.zeros((3, 2, 2))}, tmp_path / "x.csv")
    with pytest.raises(ValueError, match="one length"):
        write_csv({"a": [1, 2], "b": [1]}, tmp_path / "x.csv")


def test_rows_that_change_their_columns_are_refused():
    with pytest.raises(ValueError, match=r"row 1.*'a'.*'b'"):
        as_table([{"a": 1}, {"b": 1}])


def test_a_torn_csv_is_told_by_its_line(tmp_path):
    (tmp_path / "torn.csv").write_text("a,b\n1,2\n3\n")
    with pytest.raises(ValueError, match=r"torn\.csv, line 3: expected 2 values, got 1"):
        read_csv(tmp_path / "torn.csv")
    for content in ("", "a,a\n1,2\n"):
        (tmp_path / "torn.csv").write_text(content)
        with pytest.raises(ValueError, match="header"):
            read_csv(tmp_path / "torn.csv")


def test_text_in_a_csv_may_hold_commas_quotes_and_greek(tmp_path):
    table = {"what": np.array(["a, b", 'say "θ"', "c\nd"]), "n": np.array([1.0, np.inf, 0.1 + 0.2])}
    write_csv(table, tmp_path / "text.csv")
    back = read_csv(tmp_path / "text.csv")
    assert back["what"].tolist() == table["what"].tolist()
    assert np.array_equal(back["n"], table["n"])


def test_recording_nothing_is_an_error():
    with pytest.raises(ValueError, match="at least one"):
        record(World(Arena("open"), 1), [])


def test_a_single_array_is_no_recording(tmp_path):
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(ValueError, match="expected a recording"):
        Recording.load(tmp_path / "array.npy")
