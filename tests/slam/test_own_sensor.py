import numpy as np
import pytest

from coursekit.gaussian import Gaussian, chi2_band, nees
from coursekit.geometry import wrap_angle
from coursekit.models import DifferentialDrive, pose_residual, range_bearing
from coursekit.slam import CalibratingSlam, EkfSlam, FirstEstimateSlam, InvariantSlam, Known
from coursekit.slam.association import Mahalanobis
from coursekit.slam.instruments import Instruments

START = Gaussian(np.zeros(3), 1e-6 * np.eye(3))
MOTION = DifferentialDrive()
R = np.diag([0.05, 0.01]) ** 2
LAMPS = {"a": [2.0, 1.0], "b": [1.0, -1.5], "c": [3.0, -0.5]}


class Camera:
    """Range and bearing, told as if it were a sensor of one's own, with the filter's Jacobians or without."""

    R = R
    h = staticmethod(range_bearing.h)
    residual = staticmethod(range_bearing.residual)

    def start(self, name, z, pose):
        return Gaussian(z, R)


class CameraWithJacobians(Camera):
    H = staticmethod(range_bearing.H)
    H_landmark = staticmethod(range_bearing.H_landmark)


class Bearing:
    R = np.array([[0.01**2]])

    def h(self, pose, lamp):
        return range_bearing.h(pose, lamp)[1:]

    def residual(self, z, z_hat):
        return wrap_angle(np.subtract(z, z_hat))

    def start(self, name, z, pose):
        return Gaussian([2.5, z[0]], np.diag([1.0, 0.01]) ** 2)


class Range:
    """Ranges alone; ``start`` waits for two from places 0.4 m apart, and is told on which side its beacons stand."""

    R = np.array([[0.02**2]])

    def __init__(self):
        self.heard = {}

    def h(self, pose, beacon):
        return range_bearing.h(pose, beacon)[:1]

    def residual(self, z, z_hat):
        return np.subtract(z, z_hat)

    def start(self, name, z, pose):
        r0, x0 = self.heard.setdefault(name, (z[0], pose.mean[0]))
        moved = pose.mean[0] - x0
        if moved < 0.4:
            return None
        cosine = np.clip((r0**2 - z[0] ** 2 - moved**2) / (2 * moved * z[0]), -0.95, 0.95)
        side = 1.0 if name == "a" else -1.0
        return Gaussian([z[0], side * np.arccos(cosine)], np.diag([0.02, 0.15]) ** 2)


def drive(slam, sensor, steps, rng=None, lamps=LAMPS):
    """Straight ahead past the lamps; the true pose at the end."""
    pose = START.mean if rng is None else START.sample(rng, 1)[0]
    for _ in range(steps):
        slam.predict([0.5, 0.0], 0.1)
        pose = MOTION.f(pose, [0.5, 0.0], 0.1) if rng is None else MOTION.sample(pose[None], [0.5, 0.0], 0.1, rng)[0]
        z = np.array([sensor.h(pose, lamp) for lamp in lamps.values()])
        if rng is not None:
            z = z + rng.standard_normal(z.shape) @ np.linalg.cholesky(sensor.R).T
        slam.sense(sensor, z, list(lamps))
    return pose


@pytest.mark.parametrize("make", [EkfSlam, FirstEstimateSlam])
@pytest.mark.parametrize("sensor", [Camera(), CameraWithJacobians()], ids=["by differences", "by formula"])
def test_a_camera_as_a_sensor_of_one_s_own_is_what_observe_does(make, sensor):
    rng = np.random.default_rng(1)
    ours, theirs = make(START, MOTION, Known()), make(START, MOTION, Known())
    for k in range(12):
        z = range_bearing.h([0.05 * k, 0.0, 0.0], np.array(list(LAMPS.values()))) + rng.normal(0, 0.01, (3, 2))
        assert ours.sense(sensor, z, "abc").tolist() == theirs.observe(z, R, ids="abc").tolist() == [0, 1, 2]
        assert ours.nis == pytest.approx(theirs.nis, rel=1e-6) and ours.dof == theirs.dof
        for slam in (ours, theirs):
            slam.predict([0.5, 0.1], 0.1)
    assert ours.rows == theirs.rows
    np.testing.assert_allclose(ours.mean, theirs.mean, atol=1e-8)
    np.testing.assert_allclose(ours.cov, theirs.cov, atol=1e-9)


@pytest.mark.parametrize(
    "make",  # not FirstEstimateSlam, for which a guess of the depth stays the linearization point
    [EkfSlam, InvariantSlam, lambda *rest: CalibratingSlam(*rest, instruments=Instruments.ideal())],
)
def test_bearings_alone_place_the_lamps(make):
    slam = make(START, MOTION, Known())
    drive(slam, Bearing(), 40)
    found = [slam.landmarks[slam.rows[name]] for name in LAMPS]
    np.testing.assert_allclose(found, list(LAMPS.values()), atol=0.1)
    assert slam.lost is None


def test_bearings_alone_leave_an_honest_belief():
    scores = []
    for seed in range(40):
        slam = InvariantSlam(START, MOTION, Known())
        truth = drive(slam, Bearing(), 30, np.random.default_rng(seed))
        scores.append(nees(slam.pose, truth, pose_residual))
    low, high = chi2_band(3, runs=40, confidence=0.999)  # so do five sets of forty other seeds: 2.8 to 4.2
    assert low < np.mean(scores) < high


def test_ranges_alone_wait_until_they_know_where_a_beacon_is():
    soon, late, sensor = InvariantSlam(START, MOTION, Known()), InvariantSlam(START, MOTION, Known()), Range()
    drive(soon, sensor, 3)
    assert soon.rows == {} and set(sensor.heard) == set(LAMPS)
    drive(late, Range(), 40)
    found = [late.landmarks[late.rows[name]] for name in LAMPS]
    np.testing.assert_allclose(found, list(LAMPS.values()), atol=0.15)


def test_what_cannot_be_used_is_rejected_and_the_others_are_not():
    slam = EkfSlam(START, MOTION, Known())
    assert slam.sense(Bearing(), [[0.1], [np.nan]], ["a", "b"]).tolist() == [0, -1]
    assert list(slam.rejected) == [1] and slam.rows == {"a": 0}
    assert slam.sense(Bearing(), [], []).shape == (0,)


def test_labels_survive_when_tentative_landmarks_are_forgotten():
    slam = EkfSlam(START, MOTION, Mahalanobis(0.99), max_misses=1)
    slam.observe([[2.0, 3.0]], R)  # tentative, behind the robot, and never seen again
    slam.sense(Bearing(), [[0.1]], ["a"])
    slam.observe([[1.0, -1.0]], R)
    assert slam.rows == {"a": 0}
    slam.sense(Bearing(), [[0.1]], ["a"])
    assert abs(np.arctan2(*slam.landmarks[0][::-1]) - 0.1) < 1e-6


class Answers(Bearing):
    def __init__(self, **parts):
        vars(self).update(parts)


@pytest.mark.parametrize(
    ("sensor", "z", "ids", "error", "said"),
    [
        (Bearing(), [0.1], ["a"], ValueError, r"z of shape \(k, m\)"),
        (Bearing(), [[0.1], [0.2]], ["a", "a"], ValueError, "different ids"),
        (object(), [[0.1]], ["a"], TypeError, "h, residual, start"),
        (Answers(R=-np.eye(1)), [[0.1]], ["a"], ValueError, "R: expected a positive definite"),
        (Answers(start=lambda *_: [1.0, 0.0]), [[0.1]], ["new"], TypeError, "start: expected a Gaussian"),
        (Answers(start=lambda *_: Gaussian([-1.0, 0.0], np.eye(2))), [[0.1]], ["new"], ValueError, "range > 0"),
        (Answers(h=lambda *_: [0.0, 0.0]), [[0.1]], ["a"], ValueError, "residual: expected shape"),
        (Answers(H=lambda *_: np.ones(3)), [[0.1]], ["a"], ValueError, "H: expected shape"),
        (Answers(R=np.array([[1e-30]])), [[0.1]], ["a"], ValueError, "R: too small"),
    ],
)
def test_what_a_sensor_says_wrong_is_named_and_changes_nothing(sensor, z, ids, error, said):
    slam = EkfSlam(START, MOTION, Known())
    slam.sense(Bearing(), [[0.1]], ["a"])
    before = slam.mean, slam.cov
    with pytest.raises(error, match=said):
        slam.sense(sensor, z, ids)
    np.testing.assert_array_equal(slam.mean, before[0])
    np.testing.assert_array_equal(slam.cov, before[1])
