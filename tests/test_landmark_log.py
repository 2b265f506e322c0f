"""The world's own log: what it holds, and that the script beside it makes it."""

import importlib.util
from itertools import islice

import numpy as np
import pytest

from coursekit import datasets
from coursekit.noise import fit_calibrated, fit_piecewise
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


def test_the_true_parameters_lie_within_three_standard_errors(log):
    """They are known: the arena's landmark, the camera's place, and one pixel of 265 px·m (h f) that is not counted."""
    model = fit_calibrated(log)
    true = {"offset": 0.1 + CAMERA_OFFSET, "shortfall": 1 / (0.5 * 530), "lever": CAMERA_OFFSET, "turn": 0.0,
            "sideways": 1.1 * 0.1 - CAMERA_OFFSET}  # fmt: skip
    for name, value in true.items():
        assert abs(getattr(model, name) - value) < 3 * model.standard_errors[name], name
    assert model.standard_errors["offset"] < 0.01 and model.standard_errors["shortfall"] < 0.001


def test_the_calibrated_model_is_far_better_on_samples_it_has_not_seen(log):
    for train, test in ((log[::2], log[1::2]), (log[1::2], log[::2])):
        assert fit_calibrated(train).log_likelihood(test) > fit_piecewise(train).log_likelihood(test) + 4.5
