"""A recording of any robot becomes a run that the estimators take."""

import numpy as np
import pytest

from coursekit import localisation
from coursekit.geometry import between, compose
from coursekit.recordings import Recording, read_bag, read_map, write_map
from coursekit.world.arena import Arena
from coursekit.world.pilot import drive, square
from coursekit.world.recorder import record
from coursekit.world.robot import World
from tests.recordings.ros import Ros

TRACK = {"time": np.array([0.0, 0.1]), "v_odometry": np.full(2, 0.5), "omega_odometry": np.zeros(2)}
SEEN = {"time": np.array([0.1]), "id": np.array([6]), "range": np.array([2.0]), "bearing": np.array([0.0])}


def test_a_robot_of_ones_own_is_localised_from_its_bag_and_a_map(tmp_path):
    """A robot drives a square among tags that its camera, 0.1 m ahead of its centre, sees; its bag holds the wheels'
    odometry and the detections, and nobody tracked it.  On eight other seeds the filter ended 7 to 25 mm off."""
    tags = {3: [4.0, 0.0], 5: [2.0, 4.0], 8: [-2.0, 1.0], 11: [1.0, -2.0]}
    rng, ros = np.random.default_rng(4), Ros(1)
    world, messages = World(Arena("open"), 4), []

    def look(world):
        stamp = round(world.time * 1e9) + 10**9
        camera = compose(world.pose, [0.1, 0.0, 0.0])
        places = {k: between(camera, [*place, 0.0])[:2] * rng.normal(1, 0.01) for k, place in tags.items()}
        seen = {k: (-y, 0.0, x) for k, (x, y) in places.items() if x > 0.3 and abs(y) < x}
        messages.append(("/tag_detections", stamp, ros.tags(stamp, seen)))

    log = record(world, drive(world, square(2.0)), look)
    for time, pose, (v, omega) in zip(log.track["time"], log.odometry_poses, log.odometry, strict=True):
        stamp = round(time * 1e9) + 10**9
        messages.append(("/odom", stamp, ros.odometry(stamp, pose, v, omega)))
    ros.write(tmp_path / "mine.bag", sorted(messages, key=lambda m: m[1]))
    write_map(tags, tmp_path / "tags.csv")

    mine = read_bag(tmp_path / "mine.bag")
    run = mine.run(read_map(tmp_path / "tags.csv"), start=log.odometry_poses[0], T_robot_camera=[0.1, 0.0, 0.0])
    assert len(run.measurements) > 100 and run.groundtruth.shape == (1, 4)
    track = localisation.localise(run, localisation.start_of(run))
    assert np.linalg.norm(track.mean[-1, :2] - log.poses[-1, :2]) < 0.06


def test_truth_comes_from_the_track_or_from_a_stream_of_its_own():
    pose = {"x": np.ones(2), "y": np.zeros(2), "theta": np.zeros(2)}
    np.testing.assert_array_equal(Recording({**TRACK, **pose}, SEEN).run({6: [2, 0]}).groundtruth[:, 1], [1, 1])
    apart = Recording(TRACK, SEEN, {"truth": {"time": np.array([0.05, 0.15]), **pose}}).run({6: [2, 0]})
    np.testing.assert_array_equal(apart.groundtruth[:, 0], [0.05, 0.15])
    assert Recording(TRACK, SEEN).run({6: [2, 0]}).groundtruth.shape == (0, 4)


def test_sightings_are_moved_from_the_camera_to_the_robots_centre():
    run = Recording(TRACK, SEEN).run({6: [2, 0]}, T_robot_camera=[0.0, 1.0, np.pi / 2])
    np.testing.assert_allclose(run.measurements, [[0.1, 6, 3.0, np.pi / 2]])


@pytest.mark.parametrize(
    ("log", "arguments", "message"),
    [
        (Recording(TRACK, {}), ({6: [2, 0]},), "expected id, range and bearing in measurements or tags"),
        (
            Recording({"time": np.zeros(2)}, SEEN),
            ({6: [2, 0]},),
            "lacks v_odometry, omega_odometry; it has time",
        ),
        (Recording({}, SEEN), ({6: [2, 0]},), "the track lacks time, v_odometry"),
        (Recording(TRACK, SEEN), ({6: [2, 0, 1]},), r"landmarks: expected \[x, y\]"),
        (Recording(TRACK, SEEN), ({6: [2, 0]}, [0, 0]), r"expected a finite \[x, y, θ\]"),
    ],
)
def test_what_cannot_become_a_run_says_what_is_missing(log, arguments, message):
    with pytest.raises(ValueError, match=message):
        log.run(*arguments)


def test_a_recording_says_what_it_holds():
    said = repr(Recording(TRACK, SEEN, {"scan": {"time": [0.0], "ranges": [[1.0]]}}, {"odometry: NaN": 2, "x": 0}))
    assert said == ("Recording(0.1 s; track: 2 rows of v_odometry, omega_odometry; measurements: 1 rows of id, range, "
                    "bearing; scan: 1 rows of ranges; dropped: 2 × odometry: NaN)")  # fmt: skip
    assert repr(Recording({})) == "Recording(0 s)"


def test_an_npz_holds_streams_and_what_was_dropped(tmp_path):
    log = Recording(TRACK, SEEN, {"tags": {"time": np.zeros(1), "family": np.array(["36h11"])}}, {"a reason": 3})
    log.save(tmp_path / "log.npz")
    back = Recording.load(tmp_path / "log.npz")
    assert back.dropped == {"a reason": 3} and back.streams["tags"]["family"].tolist() == ["36h11"]
    np.testing.assert_array_equal(back.odometry, log.odometry)
