"""What Lab 4 says of its explorers, on seeds that it does not use."""

import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.labs.lab04 import runs
from coursekit.labs.lab04.explorers import Cycle, LockedOut, RangesOnly, Tuning


@pytest.fixture(autouse=True)
def fresh_seeds(monkeypatch):
    caches = Cycle.follow, Tuning.follow, Tuning.drives, LockedOut.follow
    monkeypatch.setenv("COURSEKIT_SEED_OFFSET", "8800")
    for cached in caches:
        cached.cache_clear()
    yield
    for cached in caches:
        cached.cache_clear()


def test_a_hard_gate_locks_out_from_the_true_q_and_the_robust_correction_does_not():
    """Forty drives.  Pushed by a metre the gate loses all, by half a metre a fifth (8 of 40, σ 2.5), and four fifths
    when Q is ten times too small; without a gate, and robustly, none is lost from the true Q."""
    none, gate, robust = LockedOut.CORRECTIONS
    assert LockedOut.lost(1.0, 1.0, gate) > 0.8
    assert LockedOut.lost(0.5, 1.0, gate) < 0.5 < LockedOut.lost(0.5, 0.1, gate) + 0.1
    assert max(LockedOut.lost(push, 1.0, c) for push in (0.5, 1.0) for c in (none, robust)) < 0.1
    assert LockedOut.lost(1.0, 0.1, robust) > 0.8 and LockedOut.lost(1.0, 0.1, none) < 0.1
    assert LockedOut.lost(0.0, 1.0, gate) < 0.1


def test_the_strips_tell_a_filter_that_is_too_sure_from_one_that_is_too_modest():
    def scores(**scales):
        facts = Tuning.facts(**{"q_scale": 1.0, "r_scale": 1.0, "landmarks": 2} | scales)
        return float(facts["nees"]), float(facts["nis"])

    honest, bob = scores(), scores(q_scale=1 / 16, r_scale=1 / 16)
    assert 2.5 < honest[0] < 3.8 and 1.9 < honest[1] < 2.3
    assert bob[0] > 15 and bob[1] > 15
    assert max(scores(q_scale=16.0, r_scale=16.0)) < 0.8
    hidden = scores(q_scale=4.0, r_scale=1 / 4)  # one error hides the other from the NEES, not from the NIS
    assert 2.7 < hidden[0] < 4.6 and hidden[1] > 3.5


def test_where_one_error_hides_the_other_the_share_tells_what_the_average_does_not():
    """What the answer to the last exercise says, on three hundreds of drives: 3.2 to 3.4, from 0.8 to 9, 2 to 4 %."""
    low, high = chi2_band(3, Tuning.RUNS)
    average = Tuning.follow(4.0, 1 / 4, 2)[1].nees.mean(axis=0)
    assert 3 < average.mean() < 3.7 and average.min() < 1 and average.max() > 8
    assert np.mean((average > low) & (average < high)) < 0.08
    drives = Tuning.drives(6)
    tracks = runs.localise(drives, drives.start(1), 0.7 * runs.R, runs.scaled(3))
    average = tracks.nees.mean(axis=0)
    assert 2.9 < average.mean() < 3.3 and np.mean((average > low) & (average < high)) > 0.75
    assert 2.1 < np.nanmean(tracks.nis) < 2.35


def test_the_strips_title_and_the_words_name_the_same_nis():
    scene = Tuning()
    for r_scale in (1.0, 1 / 4):  # one landmark: in some steps only three drives see it
        scene.update(q_scale=1.0, r_scale=r_scale, landmarks=1)
        nis = Tuning.facts(q_scale=1.0, r_scale=r_scale, landmarks=1)["nis"]
        assert scene.scores.titles[1].get_text() == f"NIS {nis}"
    walk = RangesOnly()
    walk.update(time=0, landmarks=1, jacobian="derived")
    assert walk.scores.titles[1].get_text() == "NIS: none yet"
    walk.update(time=15, landmarks=1, jacobian="derived")
    assert float(walk.scores.titles[1].get_text().split()[1]) == pytest.approx(1.0, abs=0.3)


def test_an_ellipse_grows_in_each_prediction_and_shrinks_in_each_correction():
    scene = Cycle()
    areas = []
    for moment in Cycle.MOMENTS:
        scene.update(moment=moment, sees="range and bearing")
        areas.append(float(scene.title.get_text().split("covers ")[1].split(" ")[0]))
    assert all(areas[k] < areas[k + 1] and areas[k + 2] < areas[k + 1] for k in range(0, 16, 2))
