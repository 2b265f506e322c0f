"""The world's own log: what it holds, and that the script beside it makes it."""

import importlib.util
from itertools import islice, pairwise

import numpy as np
import pytest

from coursekit.noise import fit_calibrated, fit_piecewise
from coursekit.recordings import datasets
from coursekit.world.camera import CAMERA_OFFSET
from coursekit.world.recorder import LANDMARK_COLUMNS, as_table, write_csv


@pytest.fixture(scope="module")
def log():
    return datasets.load("landmark_log")


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("make_landmark_log", datasets.project_file("make_landmark_log.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_script_makes_the_committed_bytes(script, tmp_path):
    write_csv(as_table(islice(script.rows(), 40)), tmp_path / "log.csv")
    remade = (tmp_path / "log.csv").read_bytes()
    assert datasets.project_file("landmark_log.csv").read_bytes().startswith(remade), (
        "record it again: python data/make_landmark_log.py"
    )
    assert remade.splitlines()[0].decode().split(",") == list(LANDMARK_COLUMNS)


@pytest.mark.slow
def test_the_script_makes_all_of_the_committed_bytes(script, tmp_path):
    write_csv(as_table(islice(script.rows(), script.ROWS)), tmp_path / "log.csv")
    assert datasets.project_file("landmark_log.csv").read_bytes() == (tmp_path / "log.csv").read_bytes()


def test_it_is_a_drive_like_the_reports(log):
    assert (len(log), log.dropped) == (1842, 0)
    assert log.true_range.min() < 1.5 and 19.5 < log.true_range.max() < 20.5
    assert 0.45 < np.abs(log.bearing).max() < 0.6
    repeats = (np.diff(log.range) == 0) & (np.diff(log.bearing) == 0)
    assert 300 < repeats.sum() < 800


def test_the_true_parameters_lie_within_three_standard_errors(log, script):
    """They are known: the arena's landmark, the camera's place, one pixel of 265 px·m (h f) that is not counted, and
    how old a picture is when its row is written: 3 to 7 periods, each as often."""
    model = fit_calibrated(log)
    ages = script.DT * np.arange(script.DELAY, script.DELAY + script.PICTURE_EVERY)
    true = {"offset": 0.1 + CAMERA_OFFSET, "inverse_range_bias": 1 / (0.5 * 530), "lever_arm": CAMERA_OFFSET,
            "lateral_bias": 1.1 * 0.1 - CAMERA_OFFSET, "delay": ages.mean(), "jitter": ages.std()}  # fmt: skip
    for name, value in true.items():
        assert abs(getattr(model, name) - value) < 3 * model.standard_errors[name], name
    assert model.standard_errors["offset"] < 0.01 and model.standard_errors["inverse_range_bias"] < 0.001
    assert model.standard_errors["delay"] < 0.001 and model.standard_errors["jitter"] < 0.001
    assert (
        abs(model.yaw_misalignment) < 0.1 / 530
    )  # a tenth of a pixel: by so much the finder of lab 1 leans to one side


def test_the_model_is_honest_by_range_by_bearing_and_by_turn_rate(log):
    """Mean square error over stated variance, 1 for an honest model.  Bins of 90 samples and more, worth a third of
    that, scatter by a quarter."""
    model = fit_calibrated(log)
    R = model.R(log.range, log.bearing, log.turn_rate, log.speed)
    squares = model.residuals(log) ** 2 / np.diagonal(R, axis1=1, axis2=2)
    by_range = 0, log.true_range, [1, 2, 4, 6, 10, 16, 21]
    by_bearing = 1, np.abs(log.bearing), [0, 0.1, 0.2, 0.35, 0.6]
    by_turn_rate = 1, np.abs(log.turn_rate), [0, 0.02, 0.3, 0.7]
    for i, x, edges in (by_range, by_bearing, by_turn_rate):
        for low, high in pairwise(edges):
            inside = (low <= x) & (x < high)
            assert inside.sum() > 90 and 0.5 < squares[inside, i].mean() < 2.0, (i, low, high)


def test_the_calibrated_model_is_far_better_on_samples_it_has_not_seen(log):
    for train, test in ((log[::2], log[1::2]), (log[1::2], log[::2])):
        assert fit_calibrated(train).log_likelihood(test) > fit_piecewise(train).log_likelihood(test) + 4.5
