"""What each estimator says when its model is simply wrong, and that the book's page says the same."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import wrong_models

SAID = {
    "ekf": "surprise too much",
    "particles": "surprise too much",
    "slam": "surprise too much",
    "visual": "features look like one place of the map",
    "noise": "the measurements say little about the truth: the range .* and the bearing",
    "icp double": "do not fit each other",
    "icp mirror": "do not fit each other",
    "graph": "the factors contradict each other",
    "landmarks": "occluded",
}


def words(text):
    """A text without its numbers: their last digits are another machine's."""
    return re.sub(r"[\d.,e+-]+", "#", text)


@pytest.mark.parametrize("name", wrong_models.ROWS)
def test_the_right_model_is_not_doubted_and_the_wrong_one_is_with_its_reason(name):
    who, what, right, wrong = wrong_models.ROWS[name]
    assert right() == wrong_models.FINE
    said = wrong()
    assert re.search(SAID[name], said)
    assert words(f"| {who} | {what} | {wrong_models.FINE} | {said} |") in words(wrong_models.PAGE.read_text("utf-8"))


def test_each_estimator_of_the_package_has_its_row():
    assert set(SAID) == set(wrong_models.ROWS)


@pytest.mark.slow
def test_on_other_seeds_no_right_model_is_doubted_and_no_wrong_one_passes(monkeypatch):
    generator = np.random.default_rng
    for seed in range(1, 41):
        monkeypatch.setattr(np.random, "default_rng", lambda own, seed=seed: generator((own, seed)))
        for name, (_, _, right, wrong) in wrong_models.ROWS.items():
            assert (right(), wrong() == wrong_models.FINE) == (wrong_models.FINE, False), (name, seed)
