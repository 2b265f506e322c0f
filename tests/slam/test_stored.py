import numpy as np
import pytest

from coursekit.gaussian import Gaussian
from coursekit.models import DifferentialDrive, range_bearing
from coursekit.slam import CalibratingSlam, EkfSlam, FirstEstimateSlam, InvariantSlam, Known
from coursekit.slam.association import Mahalanobis

START = Gaussian(np.zeros(3), np.diag([0.01, 0.01, 0.001]))
MOTION = DifferentialDrive()
R = np.diag([0.05, 0.01]) ** 2
TAGS = np.array([[2.0, 1.0], [1.0, -1.5], [3.0, -0.5]])
ALL = [EkfSlam, FirstEstimateSlam, InvariantSlam, CalibratingSlam]


def drive(slam, steps, ids=None, tags=TAGS):
    for k in range(steps):
        slam.predict([0.5, 0.1 * k], 0.1)
        z = np.add(range_bearing.h([0.05 * k, 0.0, 0.0], tags), (0.01, 0.001))
        slam.observe(z, R, ids=ids)


@pytest.mark.parametrize("make", ALL)
@pytest.mark.parametrize(("rule", "ids"), [(Known(), ["a", "b", 7]), (Mahalanobis(0.99), None)], ids=["ids", "gates"])
def test_a_filter_from_its_file_goes_on_as_if_it_had_never_stopped(make, rule, ids, tmp_path):
    slam = make(START, MOTION, rule, max_misses=20)
    drive(slam, 5, ids)
    slam.observe([[4.0, 2.0]], R, ids=None if ids is None else ["once"])  # in the file a tentative one, too
    slam.save(tmp_path / "map.npz")
    again = make.load(tmp_path / "map.npz", MOTION, rule)
    assert again.rows == slam.rows and (again.nis, again.dof) == (slam.nis, slam.dof)
    for each in (slam, again):
        drive(each, 25, ids)  # long enough for the tentative one to be forgotten
    np.testing.assert_allclose(again.mean, slam.mean, atol=1e-12)
    np.testing.assert_allclose(again.cov, slam.cov, atol=1e-12)
    if make is CalibratingSlam:
        np.testing.assert_allclose(again.track.poses.mean, slam.track.poses.mean, atol=1e-12)
        np.testing.assert_allclose(again.instruments.mean, slam.instruments.mean, atol=1e-12)


def test_a_tentative_landmark_keeps_how_often_it_was_seen_and_missed(tmp_path):
    slam = EkfSlam(START, MOTION, Mahalanobis(0.99), n_init=3, max_misses=4)
    for z in ([[4.0, 0.5]], [[4.0, 0.5]], []):
        slam.observe(np.reshape(z, (-1, 2)), R)
    slam.save(tmp_path / "map.npz")
    seen, missed = (EkfSlam.load(tmp_path / "map.npz", MOTION, Mahalanobis(0.99)) for _ in range(2))
    seen.observe([[4.0, 0.5]], R)
    assert len(seen.landmarks) == 1, "the third look confirms it"
    for _ in range(3):
        missed.observe(np.empty((0, 2)), R)
    for _ in range(2):
        missed.observe([[4.0, 0.5]], R)
    assert len(missed.landmarks) == 0, "four misses in a row, and it begins anew"


def test_a_lost_filter_is_still_lost_when_it_comes_back(tmp_path):
    slam = EkfSlam(START, MOTION, Known())
    slam._watch.time = 12.5
    slam._watch.give_up("nothing fits")
    slam.save(tmp_path / "map.npz")
    assert EkfSlam.load(tmp_path / "map.npz", MOTION, Known()).lost == slam.lost


def test_a_file_holds_no_pickle(tmp_path):
    slam = CalibratingSlam(START, MOTION, Known())
    drive(slam, 3, "abc")
    slam.save(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz", allow_pickle=False) as file:
        assert {file[name].dtype.kind for name in file.files} <= set("Uif")


@pytest.mark.parametrize("make", ALL)
@pytest.mark.parametrize("rule", [Known(), Mahalanobis(0.99)], ids=["ids", "gates"])
def test_a_map_that_was_there_before_tells_where_the_robot_is(make, rule):
    slam = make(START, MOTION, rule)
    slam.add({name: Gaussian(tag, 1e-6 * np.eye(2)) for name, tag in zip("abc", TAGS, strict=True)})
    np.testing.assert_array_equal(slam.landmarks, TAGS)
    truth = np.array([0.1, -0.05, 0.02])
    for _ in range(20):
        assert slam.observe(range_bearing.h(truth, TAGS), R, ids="abc").tolist() == [0, 1, 2]
    np.testing.assert_allclose(slam.pose.mean, truth, atol=0.02)
    slam.observe([*range_bearing.h(truth, TAGS), [1.0, 1.0]], R, ids="abcd")
    assert slam.rows["c"] == 2 and slam.rows.get("d", 3) == 3  # a new one comes after them


def test_an_old_map_is_as_unsure_as_it_says():
    """Of one landmark and one look: the textbook's correction of pose and landmark together."""
    slam, place = EkfSlam(START, MOTION, Known()), Gaussian([2.0, 1.0], [[0.04, 0.01], [0.01, 0.09]])
    slam.add({"door": place})
    z = np.add(range_bearing.h(START.mean, place.mean), (0.1, -0.02))
    slam.observe([z], R, ids=["door"])
    x, P = np.r_[START.mean, place.mean], np.zeros((5, 5))
    P[:3, :3], P[3:, 3:] = START.cov, place.cov
    H = np.hstack([range_bearing.H(x[:3], x[3:]), range_bearing.H_landmark(x[:3], x[3:])])
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    np.testing.assert_allclose(slam.mean, x + K @ [0.1, -0.02], atol=1e-12)
    np.testing.assert_allclose(slam.cov, P - K @ S @ K.T, atol=1e-12)


@pytest.mark.parametrize(
    ("landmarks", "error", "said"),
    [
        ({"a": [1.0, 2.0]}, TypeError, r"landmarks\['a'\]: expected a Gaussian"),
        ({"a": Gaussian([1.0, 2.0, 0.0], np.eye(3))}, ValueError, r"over \[x, y\]"),
        ({"b": Gaussian([1.0, 2.0], np.eye(2)), "door": Gaussian([1.0, 2.0], np.eye(2))}, ValueError, "'door' is on"),
    ],
)
def test_what_is_no_map_is_refused_and_nothing_is_added(landmarks, error, said):
    slam = EkfSlam(START, MOTION, Known())
    slam.add({"door": Gaussian([2.0, 0.0], np.eye(2))})
    with pytest.raises(error, match=said):
        slam.add(landmarks)
    assert slam.rows == {"door": 0} and slam.landmarks.shape == (1, 2)


def test_what_cannot_be_saved_or_is_no_map_is_refused(tmp_path):
    slam = EkfSlam(START, MOTION, Known())
    with pytest.raises(ValueError, match=r"ends in \.npz"):
        slam.save(tmp_path / "map.txt")
    slam.add({(1, 2): Gaussian([2.0, 0.0], np.eye(2))})
    with pytest.raises(TypeError, match="expected texts or whole numbers"):
        slam.save(tmp_path / "map.npz")
    EkfSlam(START, MOTION, Known()).save(tmp_path / "plain.npz")
    with pytest.raises(ValueError, match=r"got one of EkfSlam: use EkfSlam\.load"):
        InvariantSlam.load(tmp_path / "plain.npz", MOTION, Known())
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    (tmp_path / "text.npz").write_text("no archive")
    for name in ("other.npz", "text.npz"):
        with pytest.raises(ValueError, match=r"expected a map that EkfSlam\.save wrote"):
            EkfSlam.load(tmp_path / name, MOTION, Known())
    with pytest.raises(FileNotFoundError):
        EkfSlam.load(tmp_path / "nothing.npz", MOTION, Known())
