"""Lab 4's drives: simulated ones are honest, photographed ones are what the script makes, filters see their own."""

import importlib.util
import io

import numpy as np
import pytest

from coursekit import ekf
from coursekit.gaussian import chi2_band
from coursekit.labs.lab04 import runs
from coursekit.models import pose_residual
from coursekit.recordings import datasets
from coursekit.world.robot import Robot

FRESH = 7700  # seeds that no lab uses


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("make_camera_drives", datasets.project_file("make_camera_drives.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_script_makes_the_committed_drives(script):
    """The first six steps of the first drive, to the last digit written."""
    out = io.StringIO()
    script.write(out, drives=1, steps=6)
    remade = np.genfromtxt(io.StringIO(out.getvalue()), delimiter=",", skip_header=1)
    lines = datasets.project_file("camera_drives.csv").read_text(encoding="utf-8").splitlines()[: len(remade) + 1]
    assert out.getvalue().splitlines()[0] == lines[0] == ",".join(runs.COLUMNS)
    committed = np.genfromtxt(lines, delimiter=",", skip_header=1)
    np.testing.assert_allclose(remade, committed, atol=2e-6, err_msg="run python data/make_camera_drives.py again")
    assert np.isfinite(committed[1:, 7:]).any()


@pytest.mark.slow
def test_the_script_makes_all_of_the_committed_drives(script):
    out = io.StringIO()
    script.write(out)
    assert datasets.project_file("camera_drives.csv").read_text(encoding="utf-8") == out.getvalue()


def test_the_recorded_drives_move_look_and_never_touch_anything():
    drives = runs.recorded()
    assert drives.truth.shape == (60, 101, 3) and drives.z.shape == (60, 100, 6, 2)
    gaps = np.hypot(*np.moveaxis(drives.truth[:, :, None, :2] - runs.LANDMARKS, -1, 0))
    assert gaps.min() > Robot().radius + runs.ROOM.cylinders[0].radius
    assert 0.6 < np.isfinite(drives.z[..., 0]).sum(axis=-1).mean() < 1.2  # cylinders measured in a picture
    stood = runs.MOTION.f(drives.truth[:, :-1], drives.control, drives.dt)
    assert np.abs(pose_residual(stood, drives.truth[:, 1:])).max() < 0.06  # odometry tells the way


def test_pixels_lab_3s_model_and_the_filter_fit_together_and_each_model_moves_the_nees():
    """Sixty drives, filters started from fresh seeds.  The NEES, averaged over all steps, varies by some 0.1."""
    drives, found = runs.recorded(), {}
    for name, model, rates in (
        ("report", runs.report_noise(), False),
        ("no delay", runs.sensor_noise(), False),
        ("calibrated", runs.sensor_noise(), True),
    ):
        believed, R = runs.believed(drives, model, rates=rates)
        found[name] = runs.localise(believed, drives.start(FRESH), R, runs.WHEELS)
    nees = {name: tracks.nees.mean() for name, tracks in found.items()}
    assert 2.4 < nees["calibrated"] < 4
    assert nees["no delay"] > 2 * nees["calibrated"] and nees["report"] > 6 * nees["calibrated"]
    assert np.nanmean(found["no delay"].nis) < 1.5  # which is why the NIS does not see it
    errors = {name: np.sqrt(np.mean(tracks.error(drives) ** 2)) for name, tracks in found.items()}
    assert errors["calibrated"] < 0.03 < 2 * errors["calibrated"] < errors["report"]


def test_the_simulated_drives_are_as_the_filter_believes():
    """Ten hundreds on fresh seeds: their mean share scatters by 0.015 about 0.94, see the lab."""
    low, high = chi2_band(3, 100)
    shares, scores = [], []
    for seed in range(FRESH, FRESH + 10):
        drives = runs.simulate(np.random.default_rng(seed))
        tracks = runs.localise(drives, drives.start(seed + 50))
        average = tracks.nees.mean(axis=0)
        shares.append(np.mean((low < average) & (average < high)))
        scores.append(np.nanmean(tracks.nis))
    assert np.mean(shares) > 0.89 and 1.95 < np.mean(scores) < 2.05


@pytest.mark.parametrize("gate", [None, 0.9])
def test_drives_side_by_side_are_filtered_as_each_would_be_alone(gate):
    drives = runs.simulate(np.random.default_rng(FRESH), 8, steps=40)
    together = runs.localise(drives, drives.start(1), gate=gate)
    for i in (0, 5):
        belief = drives.start(1)[i]
        for k in range(40):
            belief = ekf.predict(belief, runs.MOTION, drives.control[i, k], drives.dt)
            for j, z in enumerate(drives.z[i, k]):
                if np.isnan(z[0]):
                    assert np.isnan(together.nis[i, k, j]) and not together.used[i, k, j]
                    continue
                seen = ekf.correct(belief, runs.SENSORS[j], z, runs.R)
                used = gate is None or seen.nis < ekf.gate_threshold(gate, 2)
                assert used == together.used[i, k, j]
                belief = seen.belief if used else belief
            np.testing.assert_allclose(pose_residual(belief.mean, together.mean[i, k]), 0, atol=1e-10)
            np.testing.assert_allclose(belief.cov, together.cov[i, k], atol=1e-12)
    assert gate is None or 0 < np.mean(together.used[np.isfinite(together.nis)]) < 1


def test_a_push_moves_the_truth_and_no_wheel_feels_it():
    pushed, left = (runs.simulate(np.random.default_rng(FRESH), 3, push=push) for push in (0.7, 0.0))
    half = runs.STEPS // 2
    np.testing.assert_array_equal(pushed.truth[:, : half + 1], left.truth[:, : half + 1])
    aside = np.hypot(*(pushed.truth[:, half + 1] - left.truth[:, half + 1])[:, :2].T)
    np.testing.assert_allclose(aside, 0.7, atol=1e-9)
    np.testing.assert_array_equal(pushed.control, left.control)
