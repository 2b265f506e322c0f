"""A filter over recordings: synthetic ones whose instruments are known, and fifteen minutes of a real robot."""

from dataclasses import replace

import numpy as np
import pytest

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.geometry import wrap_angle
from coursekit.localisation import (
    LONGEST_STEP,
    CalibratingDrive,
    CalibratingRangeBearing,
    events,
    localise,
    start_of,
    truth_at,
)
from coursekit.models import DifferentialDrive, RangeBearing
from coursekit.recordings import Mrclam
from tests.recordings import recording

LANDMARKS = {6: np.array([2.0, 0.0]), 7: np.array([0.0, 2.5]), 8: np.array([-2.0, -1.0]), 9: np.array([1.0, -2.0])}


def synthetic(seed, kappa=1.0, lam=1.0, b=0.0, p=0.0, seconds=240.0, dt=0.05):
    """A drive in the recordings' format by a robot whose instruments are what the arguments say."""
    rng, wheels = np.random.default_rng(seed), DifferentialDrive(0.02 / np.sqrt(dt), 0.06 / np.sqrt(dt), (0, 0, 0))
    truth, odometry, sightings, groundtruth = np.zeros(3), [], [], []
    for k in range(int(seconds / dt)):
        t = 1000.0 + k * dt
        u = np.array([0.1, 0.3 * np.sign(np.sin(0.07 * k * dt))])
        groundtruth.append([t, *truth])
        odometry.append([t, *u])
        if k % 10 == 5:
            for name, place in LANDMARKS.items():
                r, bearing = RangeBearing(place).h(truth)
                if abs(bearing) < 0.9 and r > 0.3:
                    z = np.array([r * np.cos(bearing) ** p + b, bearing]) + rng.normal(0, [0.08, 0.02])
                    sightings.append([t, name, *z])
        truth = wheels.sample(truth, [lam * u[0], kappa * u[1]], dt, rng)
    return Mrclam(np.array(odometry), np.array(sightings), LANDMARKS, np.array(groundtruth), {})


# --- Synthetic recordings -------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "instruments",
    [(1.0, 1.0, 0.0, 0.0), (0.85, 1.0, 0.09, 1.0), (1.15, 0.93, -0.08, 0.5)],
    ids=["ideal", "a depth", "odd"],
)
def test_the_filter_learns_what_its_instruments_mean(instruments):
    """Each of the four numbers is found within 3.5 of the standard deviations that the filter itself states."""
    run = synthetic(1, *instruments)
    track = localise(run, start_of(run))
    sigma = np.sqrt(np.diag(track.cov[-1]))[3:]
    assert np.all(np.abs(track.mean[-1, 3:] - instruments) < 3.5 * sigma)
    assert np.all(sigma < [0.2, 0.05, 0.05, 0.3])
    assert track.rmse(run) < 0.1


def test_a_wrong_start_is_talked_out_of():
    run = synthetic(2)
    lost = Gaussian(start_of(run).mean + np.array([1.0, -0.8, 0.6]), np.diag([0.1, 0.1, 0.1]) ** 2)
    errors = np.hypot(*localise(run, lost).errors(run)[:, :2].T)
    assert errors[0] > 1 and np.median(errors[len(errors) // 2 :]) < 0.15


def test_time_passes_once_and_controls_hold_until_the_next_is_stamped():
    odometry = np.array([[0.0, 0.1, 0.0], [0.1, 0.1, 0.0], [0.2, 0.2, 0.5], [0.9, 0.0, 0.0]])
    measurements = np.array([[0.05, 6, 2.0, 0.0], [0.05, 7, 2.5, 1.0], [1.2, 6, 1.9, 0.0]])
    groundtruth = np.array([[-1.0, 0, 0, 0], [5.0, 0, 0, 0]])
    happened = list(events(Mrclam(odometry, measurements, LANDMARKS, groundtruth, {})))
    stamps = [t for t, *_ in happened]
    assert np.all(np.diff(stamps) > 0) and stamps[-1] == 1.2
    assert sum(dt for _, _, dt, _ in happened) == pytest.approx(1.2)
    assert max(dt for _, _, dt, _ in happened) <= LONGEST_STEP + 1e-9
    travelled = sum(control[0] * dt for _, control, dt, _ in happened)
    assert travelled == pytest.approx(0.1 * 0.2 + 0.2 * 0.7)
    seen = [(t, landmark) for t, _, _, sightings in happened for landmark, _ in sightings]
    assert seen == [(0.05, 6), (0.05, 7), (1.2, 6)]


def test_nothing_before_the_start_of_the_truth_is_used():
    run = synthetic(3, seconds=20)
    late = replace(run, groundtruth=run.groundtruth[run.groundtruth[:, 0] > 1010])
    assert min(t for t, *_ in events(late)) >= late.groundtruth[0, 0]
    assert start_of(late).mean == pytest.approx(late.groundtruth[0, 1:])


def test_the_control_that_holds_when_the_truth_starts_is_the_last_one_stamped():
    odometry = np.array([[0.0, 0.0, 0.0], [10.0, 0.5, 0.0], [20.0, 0.2, 0.0], [40.0, 0.0, 0.0]])
    groundtruth = np.array([[15.0, 0, 0, 0], [50.0, 0, 0, 0]])
    happened = events(Mrclam(odometry, np.zeros((0, 4)), LANDMARKS, groundtruth, {}))
    assert sum(control[0] * dt for _, control, dt, _ in happened) == pytest.approx(0.5 * 5 + 0.2 * 20)


def test_truth_is_interpolated_on_the_short_way_round():
    run = replace(synthetic(4, seconds=1), groundtruth=np.array([[0.0, 0, 0, 3.1], [1.0, 2.0, 0, -3.1]]))
    x, y, theta = truth_at(run, 0.5)
    assert (x, y) == (1.0, 0.0) and abs(wrap_angle(theta - np.pi)) < 1e-9


def test_samples_of_the_drive_spread_as_Q_says():
    """Standard deviations of 20,000 draws over a quarter of a second, within 3 % (6 standard errors)."""
    motion, x, u = CalibratingDrive(), np.array([1.0, 2.0, 0.3, 0.9, 1.1, 0.05, 0.5]), np.array([0.3, 0.2])
    draws = motion.sample(np.tile(x, (20_000, 1)), u, 0.25, np.random.default_rng(5))
    np.testing.assert_allclose(draws.mean(axis=0), motion.f(x, u, 0.25), atol=2e-3)
    np.testing.assert_allclose(draws.std(axis=0), np.sqrt(np.diag(motion.Q(x, u, 0.25))), rtol=0.03)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda run: localise(run, Gaussian(np.zeros(2), np.eye(2))), "start: expected a belief over"),
        (lambda run: localise(run, start_of(run), R=-np.eye(2)), "R: expected a positive definite"),
        (lambda run: localise(replace(run, measurements=run.measurements * [1, 10, 1, 1]), start_of(run)), r"got \[60"),
        (lambda run: localise(replace(run, odometry=np.zeros((0, 3))), start_of(run)), "run: expected odometry"),
        (lambda run: localise(run, start_of(run), gate=1.5), "gate: expected a probability"),
        (lambda run: CalibratingDrive().f(np.ones(7), [0.1, 0.1], 0.0), "dt: expected"),
        (lambda run: CalibratingRangeBearing([1.0, np.nan]), "landmark"),
    ],
)
def test_bad_input_raises_and_says_what_was_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call(synthetic(6, seconds=5))


# --- A real robot ---------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def mrclam():
    run = recording("mrclam7_robot1")
    return run, localise(run, start_of(run))


def test_a_real_robot_is_followed_for_fifteen_minutes(mrclam):
    run, track = mrclam
    assert track.rmse(run) < 0.13  # 0.105; odometry alone 4.09
    errors = np.hypot(*track.errors(run)[:, :2].T)
    assert np.median(errors) < 0.08 and errors.max() < 0.7  # the worst is after 39 s without a landmark
    assert len(errors) > 10_000 and track.time[-1] - track.time[0] > 870


def test_the_real_filter_is_neither_lost_nor_vain(mrclam):
    """Not a χ² test: real errors are neither Gaussian nor independent.  But the order of magnitude must be right."""
    run, track = mrclam
    assert 1.5 < np.mean(track.nees(run)) < 6
    assert np.mean(track.nis) < 2 and np.mean(track.nis > ekf.gate_threshold(0.99, 2)) < 0.05


def test_the_recorded_range_turns_out_to_be_a_depth(mrclam):
    """cos(bearing)^p with p = 1, as in the report of labs 1 to 3; and the turn rate is more than the robot turned."""
    _, track = mrclam
    kappa, _, _, p = track.mean[-1, 3:]
    assert abs(p - 1) < 0.1 and 0.7 < kappa < 0.95


def without_cosine(run):
    sightings = run.measurements.copy()
    sightings[:, 2] /= np.cos(sightings[:, 3])
    return replace(run, measurements=sightings)


def wild_and_half(run):
    rng, sightings = np.random.default_rng(7), run.measurements.copy()
    hit = rng.random(len(sightings)) < 0.1
    sightings[hit, 2] *= rng.uniform(0.3, 3, hit.sum())
    sightings[hit, 3] += rng.normal(0, 0.3, hit.sum())
    return replace(run, measurements=sightings[rng.random(len(sightings)) < 0.5])


def turning_and_running(run):
    return replace(run, odometry=run.odometry * [1, 1.1, 1.2])


def part(run):
    begin = run.odometry[0, 0]
    return replace(run, **{name: (rows := getattr(run, name))[(rows[:, 0] > begin + 300) & (rows[:, 0] < begin + 700)]
                           for name in ("odometry", "measurements", "groundtruth")})  # fmt: skip


@pytest.mark.parametrize("change", [without_cosine, wild_and_half, turning_and_running, part])
def test_a_robot_with_other_instruments_is_followed_by_the_same_filter(change):
    run = change(recording("mrclam7_robot1"))
    assert localise(run, start_of(run)).rmse(run) < 0.17


def test_a_sure_filter_with_a_gate_is_locked_out_on_the_same_recording():
    """The trap: small Q, a gate at 9.2.  Nearly everything is rejected, and the error is that of odometry alone."""
    run = recording("mrclam7_robot1")
    motion, R = DifferentialDrive(0.005, 0.01, (1e-6,) * 3), np.diag([0.07, 0.02]) ** 2
    belief, rejected, path = Gaussian(start_of(run).mean, np.diag([0.02, 0.02, 0.02]) ** 2), [], []
    for t, control, dt, sightings in events(run):
        belief = ekf.predict(belief, motion, control, dt) if dt > 0 else belief
        for landmark, z in sightings:
            seen = ekf.correct(belief, RangeBearing(run.landmarks[landmark], R), z)
            rejected.append(seen.nis > 9.2)
            belief = belief if rejected[-1] else seen.belief
        path.append([t, *belief.mean[:2]])
    path = np.array([row for row in path if row[0] <= run.groundtruth[-1, 0]])
    errors = np.hypot(*(path[:, 1:] - truth_at(run, path[:, 0])[:, :2]).T)
    assert np.mean(rejected) > 0.8 and np.sqrt(np.mean(errors**2)) > 2
