"""What Lab 9 says of its explorers, on the recordings."""

import numpy as np
import pytest

from coursekit.labs.lab09.explorers import Anywhere, Knowing, Late, most_alike
from tests.recorded import recording

CONSTANTS = [0.927, 0.936, 0.075, 0.937, 0.223, -0.058, 0.002]  # what the filter learns on the whole drive


@pytest.fixture(autouse=True)
def recorded():
    for name in ("landmark_log_real", "icp_clouds", "mrclam7_robot1"):
        recording(name)


def test_the_robot_is_a_fifth_of_a_second_late_and_looks_weak_without_it():
    delay, slope, without = most_alike()
    assert delay == pytest.approx(0.2, abs=0.03)
    assert without < 0.85 < slope < 1
    assert Late.alike(0.2) > Late.alike(0.0) + 0.05


def test_what_the_filter_knows_shows_in_its_nees_and_a_smaller_R_makes_it_too_sure():
    scores = [Knowing.follow(known, 1.0).nees.mean() for known in ("none", "p", "p, δ, b", "all seven")]
    assert scores == sorted(scores, reverse=True) and scores[0] > 10 and 1.5 < scores[-1] < 3.5
    small = Knowing.follow("all seven", 1 / 4)
    assert small.nees.mean() > 4 and small.nis < 1


@pytest.mark.slow
def test_a_large_cloud_comes_home_and_a_small_one_is_sure_of_a_wrong_place(monkeypatch):
    """Twelve seeds: 8000 particles end within 0.3 m every time, 500 at least three times not."""
    off = {500: [], 8000: []}
    for seed in range(12):
        monkeypatch.setenv("COURSEKIT_SEED_OFFSET", str(8900 + seed))
        scene = Anywhere(CONSTANTS)
        for n, errors in off.items():
            errors.append(scene.at(60, n).error)
    assert max(off[8000]) < 0.3 and np.sum(np.array(off[500]) > 0.3) >= 3
