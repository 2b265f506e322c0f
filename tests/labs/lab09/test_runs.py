"""Lab 9's runs: what is there when the recordings are not, what its filters find, and what the recordings say."""

import numpy as np
import pytest

from coursekit.labs.lab09 import runs
from coursekit.labs.lab09.localisation import IDEAL, localise, start_of, truth_at
from coursekit.labs.lab09.runs import sources, standins
from coursekit.models import pose_residual
from coursekit.recordings import datasets
from tests.recorded import recording

FRESH = 7900  # seeds that no lab uses
TRUE = np.array(list(standins.CONSTANTS.values()))


@pytest.fixture
def no_recordings(monkeypatch):
    load = datasets.load

    def only_the_projects(name):
        if name != "landmark_log":
            raise datasets.DatasetUnavailable(f"{name} is not here: set COURSEKIT_DATA")
        return load(name)

    monkeypatch.setattr(sources.datasets, "load", only_the_projects)
    sources.recordings.cache_clear()
    yield
    sources.recordings.cache_clear()


def test_without_the_recordings_the_lab_has_stand_ins_and_says_how_to_get_the_real_ones(no_recordings):
    found = sources.recordings()
    assert not found.real and "COURSEKIT_DATA" in found.missing
    assert found.clouds.source.shape == found.clouds.target.shape == (5750, 3)
    assert len(found.run.landmarks) == 15 and len(found.run.measurements) > 200 and len(found.log) > 1000


def test_the_instruments_of_a_stand_in_are_found():
    """Each constant within 4.5 of the stated standard deviations, on three seeds; the delay is 4 ticks of the clock."""
    for seed in range(FRESH, FRESH + 3):
        run = standins.drive(np.random.default_rng(seed), seconds=200.0)
        track = localise(run, start_of(run))
        sigma = np.sqrt(np.diag(track.cov[-1]))[3:]
        assert np.all(np.abs(track.mean[-1, 3:] - TRUE) < 4.5 * sigma), seed
        assert track.rmse(run) < 0.12


def test_a_stand_in_misreads_one_barcode_in_a_hundred_and_stays_in_its_room():
    run = standins.drive(np.random.default_rng(FRESH), seconds=200.0)
    pose = truth_at(run, run.measurements[:, 0])
    places_named = np.array([run.landmarks[int(k)] for k in run.measurements[:, 1]])
    bearing = np.arctan2(*(places_named - pose[:, :2]).T[::-1]) - pose[:, 2]
    wrong = np.abs(np.angle(np.exp(1j * (bearing - run.measurements[:, 3])))) > 0.1
    assert 0 < np.mean(wrong) < 0.03
    assert np.all(np.abs(run.groundtruth[:, 1:3]) < standins.ROOM + 0.5)


def test_a_drive_is_what_ideal_instruments_would_have_recorded_once_it_is_corrected():
    run = standins.drive(np.random.default_rng(FRESH + 5), seconds=60.0)
    again = runs.corrected(run, TRUE)
    pose = truth_at(again, again.measurements[:, 0])
    offset = np.array([again.landmarks[int(k)] for k in again.measurements[:, 1]]) - pose[:, :2]
    error = again.measurements[:, 2] - np.hypot(*offset.T)
    assert abs(np.median(error)) < 0.02 and np.median(np.abs(error)) < 0.06
    np.testing.assert_array_equal(runs.corrected(run, IDEAL).odometry, run.odometry)


def test_a_command_holds_until_the_next_and_its_integral_is_made_of_straight_lines():
    odometry = np.array([[0.0, 0.2, 0.0], [1.0, 0.4, 0.5], [4.0, 0.0, 0.0]])
    told = runs.commanded(odometry, [0.5, 1.0, 2.0, 9.0])
    np.testing.assert_allclose(told, [[0.1, 0.0], [0.2, 0.0], [0.6, 0.5], [1.4, 1.5]])


def test_filters_side_by_side_are_what_each_is_alone():
    """Against the public filter, with no gate to speak of and constants that do not wander."""
    run = standins.drive(np.random.default_rng(FRESH + 7), seconds=40.0, misread=0.0)
    none, everything = runs.follow(run, [("", 1.0), (runs.SYMBOLS, 1.0)])
    alone = localise(run, start_of(run), gate=1 - 1e-12)
    apart = pose_residual(alone.mean[-1, :3], truth_at(run, alone.time[-1]))
    assert np.hypot(*(everything.error[-1] - apart)[:2]) < 0.05  # sightings of a moment one by one, or at once
    assert none.nees.shape == everything.nees.shape and none.nats < everything.nats


def test_a_cloud_that_begins_anywhere_comes_home():
    """8000 particles on the stand-in, two seeds: within half a metre after 40 s."""
    run = standins.drive(np.random.default_rng(FRESH + 9), seconds=45.0)
    for seed in (FRESH, FRESH + 1):
        history = runs.locate(run, TRUE, 8000, np.random.default_rng(seed), seconds=40.0)
        assert history[0].sightings == 0 and np.ptp(history[0].states[:, 0]) > 5
        assert history[-1].error < 0.5


# --- what the recordings say -----------------------------------------------------------------------------------------
def test_the_depth_broke_first_and_the_delay_matters_where_a_turn_gain_does_not():
    run = recording("mrclam7_robot1")
    settings = ["", "p", "δ", runs.SYMBOLS, runs.SYMBOLS.replace("κ", ""), runs.SYMBOLS.replace("p", "")]
    none, depth, delay, everything, no_gain, no_depth = runs.follow(run, [(s, 1.0) for s in settings])
    assert none.nees.mean() > 2 * depth.nees.mean() and delay.nees.mean() > 2 * depth.nees.mean()
    assert everything.rmse < 0.11 and 1.5 < everything.nees.mean() < 5 and everything.inside > 0.85
    assert abs(no_gain.rmse - everything.rmse) < 0.01 and no_depth.rmse > 0.15
    assert none.nats < depth.nats < everything.nats


def test_commands_alone_are_metres_off():
    run = recording("mrclam7_robot1")
    times, poses = runs.dead_reckoning(run)
    there = times <= run.groundtruth[-1, 0]
    off = np.hypot(*(poses - truth_at(run, times))[there, :2].T)
    assert np.sqrt(np.average(off**2, weights=np.gradient(times)[there])) == pytest.approx(4.04, abs=0.05)
