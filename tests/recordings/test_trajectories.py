"""Trajectories come from and go to other tools' files, and their errors are the numbers of evo."""

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import file_interface
from scipy.spatial.transform import Rotation

from coursekit.recordings import (
    Trajectory,
    absolute_error,
    matched,
    read_kitti,
    read_tum,
    relative_error,
    write_kitti,
    write_tum,
)
from coursekit.recordings.trajectory_errors import umeyama


def flight(rng, n=200, rate=20.0):
    """A smooth trajectory through space."""
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, 3] = np.cumsum(rng.normal([0.05, 0.02, 0.01], 0.05, (n, 3)), axis=0)
    T[:, :3, :3] = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.05, (n, 3)), axis=0)).as_matrix()
    return Trajectory(1_700_000_000 + np.arange(n) / rate, T)


def estimated(rng, truth, scale=1.0):
    """The truth in another frame, with noise that grows."""
    n = len(truth)
    T = truth.T_world_robot.copy()
    T[:, :3, 3] = scale * T[:, :3, 3] + np.cumsum(rng.normal(0, 0.01, (n, 3)), axis=0)
    T[:, :3, :3] = T[:, :3, :3] @ Rotation.from_rotvec(rng.normal(0, 0.02, (n, 3))).as_matrix()
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = Rotation.from_rotvec(rng.normal(0, 1, 3)).as_matrix(), rng.normal(0, 5, 3)
    return Trajectory(truth.time, frame @ T)


def drive(rng, n=150):
    """A planar drive and its odometry."""
    heading = np.cumsum(rng.normal(0, 0.1, n))
    poses = np.column_stack([np.cumsum(0.1 * np.cos(heading)), np.cumsum(0.1 * np.sin(heading)), heading])
    truth = Trajectory.planar(0.1 * np.arange(n), poses)
    return truth, Trajectory.planar(truth.time, poses + np.cumsum(rng.normal(0, 0.01, (n, 3)), axis=0))


def evo(trajectory):
    return PoseTrajectory3D(poses_se3=[*trajectory.T_world_robot], timestamps=trajectory.time)


@pytest.fixture(params=range(4), ids=lambda k: f"seed {k}")
def pair(request):
    """An estimate and its truth: in space for even seeds, in the plane for odd ones."""
    rng = np.random.default_rng(request.param)
    if request.param % 2:
        truth, estimate = drive(rng)
        return estimate, truth
    truth = flight(rng)
    return estimated(rng, truth, scale=1.3), truth


@pytest.mark.parametrize("align", ["none", "origin", "rigid", "similarity"])
def test_the_absolute_error_is_evos_to_a_billionth(pair, align):
    estimate, truth = pair
    theirs, reference = evo(estimate), evo(truth)
    if align == "origin":
        theirs.align_origin(reference)
    elif align != "none":
        theirs.align(reference, correct_scale=align == "similarity")
    ours = absolute_error(estimate, truth, align)
    for part, relation in (("translation", metrics.PoseRelation.translation_part),
                           ("rotation", metrics.PoseRelation.rotation_angle_rad)):  # fmt: skip
        ape = metrics.APE(relation)
        ape.process_data((reference, theirs))
        np.testing.assert_allclose(getattr(ours, part), ape.error, rtol=0, atol=1e-9)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data((reference, theirs))
    assert ours.rmse == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), abs=1e-9)


@pytest.mark.parametrize(
    ("delta", "unit", "every"),
    [(1, "frames", False), (7, "frames", False), (7, "frames", True), (1.0, "metres", False), (0.35, "metres", False)],
)
def test_the_relative_error_is_evos_to_a_billionth(pair, delta, unit, every):
    estimate, truth = pair
    ours = relative_error(estimate, truth, delta, unit, every)
    for part, relation in (("translation", metrics.PoseRelation.translation_part),
                           ("rotation", metrics.PoseRelation.rotation_angle_rad)):  # fmt: skip
        kind = metrics.Unit.frames if unit == "frames" else metrics.Unit.meters
        rpe = metrics.RPE(relation, delta, kind, all_pairs=every)
        rpe.process_data((evo(truth), evo(estimate)))
        np.testing.assert_allclose(getattr(ours, part), rpe.error, rtol=0, atol=1e-9)


def test_stamps_are_matched_as_evo_matches_them():
    rng = np.random.default_rng(5)
    truth = flight(rng)
    time = np.sort(rng.uniform(truth.time[0] - 1, truth.time[-1] + 1, 90))
    estimate = Trajectory(time, flight(rng, n=90).T_world_robot)
    for a, b in ((estimate, truth), (truth, estimate)):
        ours = matched(a, b, 0.02)
        theirs = sync.associate_trajectories(evo(a), evo(b), max_diff=0.02)
        for mine, other in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(mine.time, other.timestamps)
            np.testing.assert_array_equal(mine.positions, other.positions_xyz)


def test_files_that_evo_wrote_are_read_and_evo_reads_ours(tmp_path):
    truth = flight(np.random.default_rng(6))
    file_interface.write_tum_trajectory_file(tmp_path / "evo.tum", evo(truth))
    file_interface.write_kitti_poses_file(tmp_path / "evo.kitti", evo(truth))
    write_tum(truth, tmp_path / "ours.tum")
    write_kitti(truth, tmp_path / "ours.kitti")
    for name in ("evo", "ours"):
        tum, kitti = read_tum(tmp_path / f"{name}.tum"), read_kitti(tmp_path / f"{name}.kitti", truth.time)
        theirs = file_interface.read_tum_trajectory_file(tmp_path / f"{name}.tum")
        for T in (tum.T_world_robot, kitti.T_world_robot, theirs.poses_se3):
            np.testing.assert_allclose(T, truth.T_world_robot, rtol=0, atol=1e-9)
        np.testing.assert_allclose(tum.time, truth.time, rtol=0, atol=1e-6)
        assert len(file_interface.read_kitti_poses_file(tmp_path / f"{name}.kitti").poses_se3) == len(truth)


def test_what_we_write_comes_back_to_the_bit_but_for_rotations_in_quaternions(tmp_path):
    truth = flight(np.random.default_rng(7))
    write_tum(truth, tmp_path / "a.tum")
    write_kitti(truth, tmp_path / "a.kitti")
    tum, kitti = read_tum(tmp_path / "a.tum"), read_kitti(tmp_path / "a.kitti")
    np.testing.assert_array_equal(tum.time, truth.time)
    np.testing.assert_array_equal(tum.positions, truth.positions)
    np.testing.assert_allclose(tum.T_world_robot, truth.T_world_robot, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(kitti.T_world_robot, truth.T_world_robot)
    np.testing.assert_array_equal(kitti.time, np.arange(len(truth)))


def test_lines_of_a_tum_file_that_cannot_be_used_are_dropped_and_named(tmp_path):
    lines = ["# comment", "0 1 2 3 0 0 0 1", "1 1 2 3 0 0 0", "2 1 2 x 0 0 0 1", "3 1 2 nan 0 0 0 1", "4 1 2 3 0 0 0 0",
             "5 1 2 3 0 0 0 2 # twice as long", "0.5 1 2 3 0 0 0 1"]  # fmt: skip
    (tmp_path / "a.tum").write_text("\n".join(lines) + "\n")
    got = read_tum(tmp_path / "a.tum")
    assert len(got) == 2 and np.allclose(got.T_world_robot[1, :3, :3], np.eye(3))
    assert [(row.line, row.reason.split(";")[0]) for row in got.rejected] == [
        (3, "a row without exactly 8 numbers"), (4, "text where a number belongs"), (5, "NaN or infinity"),
        (6, "a quaternion of length 0"), (8, "the stamp runs backwards")]  # fmt: skip


def test_a_kitti_line_that_cannot_be_used_takes_its_time_with_it(tmp_path):
    good = "1 0 0 {} 0 1 0 0 0 0 1 0"
    (tmp_path / "a.txt").write_text(
        "\n".join([good.format(0), good.format("x"), "2" + good.format(2)[1:], good.format(3)])
    )
    (tmp_path / "times.txt").write_text("0.0\n0.1\n0.2\n0.3\n")
    for times in ([0.0, 0.1, 0.2, 0.3], tmp_path / "times.txt", str(tmp_path / "times.txt")):
        got = read_kitti(tmp_path / "a.txt", times)
        np.testing.assert_array_equal(got.time, [0.0, 0.3])
        np.testing.assert_array_equal(got.positions[:, 0], [0.0, 3.0])
    assert [row.line for row in got.rejected] == [2, 3]
    (tmp_path / "times.txt").write_text("0.0\n0.1 0.2\n0.3\n0.4\n")
    with pytest.raises(ValueError, match="expected one number a line"):
        read_kitti(tmp_path / "a.txt", tmp_path / "times.txt")
    with pytest.raises(ValueError, match="expected one for each of the 4 lines"):
        read_kitti(tmp_path / "a.txt", [0.0, 0.1])


@pytest.mark.parametrize("read", [read_tum, read_kitti])
def test_a_file_without_a_usable_line_says_why(read, tmp_path):
    (tmp_path / "a.txt").write_text("a b c\n")
    with pytest.raises(ValueError, match="no usable row; 1 rows dropped: 1 × text"):
        read(tmp_path / "a.txt")
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "nowhere.txt")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t, T: (t[:-1], T), "expected time"),
        (lambda t, T: (t, T[:, :3]), "expected time"),
        (lambda t, T: (t[::-1], T), "do not decrease"),
        (lambda t, T: (t * np.nan, T), "finite"),
        (lambda t, T: (t, 2 * T), "number 0 is none"),
        (lambda t, T: (t, T * np.diag([1, 1, -1, 1])), "number 0 is none"),
    ],
)
def test_a_trajectory_that_is_none_is_refused(change, message):
    truth = flight(np.random.default_rng(0), n=4)
    with pytest.raises(ValueError, match=message):
        Trajectory(*change(truth.time, truth.T_world_robot))


def test_arguments_that_cannot_be_compared_are_refused():
    truth, estimate = drive(np.random.default_rng(0))
    for call, message in (
        (lambda: absolute_error(estimate, truth, "best"), "align: expected one of none, origin"),
        (lambda: absolute_error(estimate, truth.poses), "one of each"),
        (lambda: absolute_error(estimate.poses[:5], truth.poses), "row by row"),
        (lambda: absolute_error(Trajectory(truth.time + 1e4, truth.T_world_robot), truth), "no two stamps are within"),
        (lambda: matched(estimate, truth, -1), "max_difference"),
        (lambda: relative_error(estimate, truth, 1.5), "positive number of frames"),
        (lambda: relative_error(estimate, truth, 0, "metres"), "positive number of metres"),
        (lambda: relative_error(estimate, truth, 1, "miles"), "expected frames or metres"),
        (lambda: relative_error(estimate, truth, 1e4), "at least 10000 frames"),
        (lambda: umeyama(np.zeros((3, 2)), np.zeros((3, 2))), "two sets of points"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    with pytest.raises(TypeError, match="expected a Trajectory, got ndarray"):
        write_tum(truth.poses, "nowhere.tum")


def test_positions_on_a_line_have_no_best_alignment_and_say_so():
    line = Trajectory.planar(np.arange(5.0), np.column_stack([3 * np.arange(5.0), 4 * np.arange(5.0), np.zeros(5)]))
    with pytest.raises(ValueError, match=r"line or a point.*'origin' or 'none'"):
        absolute_error(line, line)
    assert absolute_error(line, line, "origin").rmse == 0


def test_a_mirror_image_is_not_laid_on_its_original_by_a_reflection():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(30, 3))
    T, _ = umeyama(points * [1, 1, -1], points)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_poses_in_the_plane_are_the_same_seen_from_above():
    truth, _ = drive(np.random.default_rng(3))
    poses = np.random.default_rng(4).uniform(-3, 3, (20, 3))
    np.testing.assert_allclose(Trajectory.planar(np.arange(20.0), poses).poses, poses, rtol=0, atol=1e-14)
    ours = absolute_error(truth.poses + np.array([1.0, 2.0, 0.0]), truth.poses)
    assert ours.rmse < 1e-12 and len(ours.time) == len(truth)
