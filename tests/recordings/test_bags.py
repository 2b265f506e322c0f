"""Bags of ROS 1 and ROS 2, written here with rosbags, become the recording that the world records; and the way back."""

import math
import subprocess
import sys
from dataclasses import asdict

import cv2
import numpy as np
import pytest
from rosbags import rosbag2

from coursekit.pinhole import COURSE_CAMERA
from coursekit.recordings import Recording, read_bag, read_images, write_bag
from coursekit.recordings.ros_messages import row_time
from coursekit.world.arena import Arena
from coursekit.world.lidar import Lidar
from coursekit.world.pilot import drive
from coursekit.world.recorder import record
from coursekit.world.robot import World
from tests.recordings.ros import T0, Ros, half_second
from tests.test_extras import without

FORMATS = [(1, "bag"), (2, "mcap"), (2, "sqlite3")]


@pytest.fixture(params=FORMATS, ids=[f"ROS {version}, {storage}" for version, storage in FORMATS])
def bag(request, tmp_path):
    """ros, and write(messages) → the bag's path."""
    version, storage = request.param
    ros = Ros(version)
    name = "drive.bag" if version == 1 else "drive"
    return ros, lambda messages: ros.write(tmp_path / name, messages, storage)


def test_odometry_becomes_the_track_with_the_sensors_own_stamps(bag):
    ros, write = bag
    log = read_bag(write(half_second(ros)))
    np.testing.assert_array_equal(log.track["time"], [(T0 + k * 10**8) / 1e9 for k in range(6)])
    np.testing.assert_array_equal(log.odometry, np.tile([0.5, 0.1], (6, 1)))
    np.testing.assert_allclose(log.odometry_poses, [[0.05 * k, 0.1, 0.3] for k in range(6)], rtol=0, atol=1e-14)
    assert log.dropped == {} and log.streams == {}


def test_a_message_without_a_stamp_gets_the_recorders(bag):
    ros, write = bag
    messages = [("/odom", T0 + k, ros.odometry(0, (0, 0, 0), 0.5, 0.0)) for k in (0, 10**9)]
    np.testing.assert_array_equal(read_bag(write(messages)).track["time"], [T0 / 1e9, T0 / 1e9 + 1])


def test_truth_joins_the_track_where_it_has_the_same_stamps_and_stands_alone_where_it_has_not(bag):
    ros, write = bag
    path = write(half_second(ros) + half_second(ros, "/ground_truth") + half_second(ros, "/mocap/robot", 4, T0 + 999))
    log = read_bag(path, topics={"odometry": "/odom", "truth": "ground_truth"})
    np.testing.assert_array_equal(log.poses, log.odometry_poses)
    log = read_bag(path, topics=["/odom", "/mocap/robot"])
    assert "x" not in log.track and log.streams["truth"]["x"].shape == (4,)


def test_a_scan_keeps_its_beams_and_reads_inf_where_nothing_can_be_there(bag):
    ros, write = bag
    scans = [("/scan", T0 + k, ros.scan(T0 + k, [0.05, np.nan, 3.25])) for k in range(2)]
    scans.append(("/scan", T0 + 2, ros.scan(T0 + 2, [1.0, 9.0])))
    log = read_bag(write(scans))
    np.testing.assert_array_equal(log.streams["scan"]["ranges"], [[np.inf, np.inf, 3.25]] * 2)
    np.testing.assert_allclose(log.streams["scan"]["angles"][0], [-0.5, 0.0, 0.5])
    assert log.dropped == {"scan: another size than the first": 1}


def test_pictures_come_in_bgr_whatever_their_encoding_and_padding(bag):
    ros, write = bag
    bgr = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    messages = [("/image", T0, ros.image(T0, bgr, "bgr8")),
                ("/image", T0 + 1, ros.image(T0 + 1, bgr[..., ::-1], "rgb8", step=12)),
                ("/image", T0 + 2, ros.image(T0 + 2, bgr, "yuv422"))]  # fmt: skip
    path = write(messages)
    log = read_bag(path)
    np.testing.assert_array_equal(log.streams["image"]["image"], [bgr, bgr])
    assert log.dropped == {"image: an image encoding that is not read: yuv422": 1}
    stamps, pictures = zip(*read_images(path), strict=True)
    np.testing.assert_array_equal(pictures, [bgr, bgr])
    assert stamps == (T0 / 1e9, (T0 + 1) / 1e9)


def test_compressed_pictures_are_unpacked_and_a_broken_one_costs_itself_only(bag):
    ros, write = bag
    grey = np.arange(64, dtype=np.uint8).reshape(8, 8)
    packed = [cv2.imencode(".png", grey)[1].ravel(), np.zeros(9, np.uint8)]
    compressed = ros.T["sensor_msgs/msg/CompressedImage"]
    messages = [("/image/compressed", T0 + k, compressed(header=ros.header(T0 + k), format="png", data=data))
                for k, data in enumerate(packed)]  # fmt: skip
    log = read_bag(write(messages))
    np.testing.assert_array_equal(log.streams["image"]["image"], [grey])
    assert log.dropped == {"image: a compressed image that cannot be decoded": 1}


def test_commands_and_truth_come_from_the_other_messages_that_hold_them(bag):
    ros, write = bag
    twist = ros.T["geometry_msgs/msg/Twist"](linear=ros.vector(0.3), angular=ros.vector(z=-0.2))
    pose = ros.T["geometry_msgs/msg/PoseStamped"](header=ros.header(T0 + 7), pose=ros.pose(1.0, 2.0, 0.5))
    log = read_bag(write([*half_second(ros), ("/cmd_vel", T0 + 5, twist), ("/vrpn/robot/pose", T0 + 9, pose)]))
    assert {k: v.tolist() for k, v in log.streams["command"].items()} == {
        "time": [(T0 + 5) / 1e9], "v_command": [0.3], "omega_command": [-0.2]}  # fmt: skip
    np.testing.assert_allclose([log.streams["truth"][k][0] for k in ("x", "y", "theta")], [1.0, 2.0, 0.5])


def test_more_pictures_than_memory_holds_are_refused_with_the_way_out(bag, monkeypatch):
    ros, write = bag
    monkeypatch.setattr("coursekit.recordings.bags.MOST_PIXELS", 10)
    path = write([("/image", T0, ros.image(T0, np.zeros((2, 3, 3), np.uint8), "bgr8"))])
    with pytest.raises(ValueError, match="read them one by one with read_images"):
        read_bag(path)
    assert len([*read_images(path)]) == 1


def test_a_tags_position_becomes_range_and_bearing_to_the_left(tmp_path):
    ros = Ros(1)
    tags = ros.tags(T0, {3: (-1.0, 0.2, 2.0), 9: (0.5, 0.0, 1.0), 4: (0.0, 0.0, 1.0)})
    tags.detections[2].id = np.array([4, 5], np.int32)  # a bundle has one pose for both: whose would it be?
    path = ros.write(tmp_path / "drive.bag", [*half_second(ros), ("/tag_detections", T0 + 10**9, tags)])
    log = read_bag(path)
    seen = log.streams["tags"]
    np.testing.assert_array_equal(seen["id"], [3, 9])
    np.testing.assert_allclose(seen["range"], [math.hypot(1, 2), math.hypot(0.5, 1)])
    np.testing.assert_allclose(seen["bearing"], [math.atan2(1, 2), -math.atan2(0.5, 1)])
    np.testing.assert_allclose([seen["x"][0], seen["y"][0], seen["z"][0]], [2.0, 1.0, -0.2])
    run = log.run({3: [2.0, 1.0]})
    np.testing.assert_allclose(run.measurements, [[T0 / 1e9, 3, math.hypot(1, 2), math.atan2(1, 2)]])
    assert run.odometry.shape == (6, 3) and run.dropped == {"not on the map": 1}


def test_a_tag_with_corners_gets_the_position_that_its_detector_put_on_tf(tmp_path):
    ros = Ros(2)
    path = ros.write(tmp_path / "drive", [*half_second(ros), ("/detections", T0 + 5, ros.corners(T0, [3, 13])),
                     ("/tf", T0 + 5, ros.transform(T0, "camera", "tag36h11:3", (-1.0, 0.2, 2.0))),
                     ("/tf", T0 + 6, ros.transform(T0, "odom", "wheel_13", (9.0, 9.0, 9.0)))])  # fmt: skip
    log = read_bag(path)
    seen = log.streams["tags"]
    assert seen["id"].tolist() == [3, 13] and seen["corners"].shape == (2, 4, 2)
    np.testing.assert_allclose(seen["range"], [math.hypot(1, 2), np.nan])
    np.testing.assert_allclose(seen["bearing"], [math.atan2(1, 2), np.nan])
    run = log.run({3: [2.0, 1.0], 13: [0.0, 0.0]})
    assert len(run.measurements) == 1 and run.dropped["a sighting without a position"] == 1


def test_a_clock_that_jumps_costs_as_few_messages_as_possible_and_they_are_counted(bag):
    ros, write = bag
    stamps = [0, 1, 2, 3, 4, 2.5, 3.5, 5, 6]  # set back by two seconds, for two messages
    messages = [("/odom", T0 + k * 10**9, ros.odometry(T0 + int(t * 1e9), (t, 0, 0), 1.0, 0.0))
                for k, t in enumerate(stamps)]  # fmt: skip
    log = read_bag(write(messages))
    np.testing.assert_array_equal(log.track["x_odometry"], [0, 1, 2, 3, 4, 5, 6])
    assert log.dropped == {"odometry: the stamp runs backwards": 2}


def test_a_clock_that_starts_anew_keeps_the_longer_part(bag):
    ros, write = bag
    stamps = [100, 101, 102, 1, 2, 3, 4, 5]
    messages = [("/odom", T0 + k * 10**9, ros.odometry(t * 10**9, (t, 0, 0), 1.0, 0.0)) for k, t in enumerate(stamps)]
    log = read_bag(write(messages))
    np.testing.assert_array_equal(log.track["time"], [1, 2, 3, 4, 5])
    assert log.dropped == {"odometry: the stamp runs backwards": 3}


def test_each_transform_is_in_order_by_its_own_clock(tmp_path):
    ros = Ros(2)
    stamps = {"base_link": [1, 2, 3, 2.5, 4], "laser": [0.5, 1.5, 2.5]}
    moves = [("/tf", T0 + k, ros.transform(t * 10**9, "odom", child, (t, 0, 0)))
             for child, times in stamps.items() for k, t in enumerate(times)]  # fmt: skip
    log = read_bag(ros.write(tmp_path / "drive", sorted(moves, key=lambda m: m[1])))
    tf = log.streams["tf"]
    assert tf["x"][tf["child"] == "base_link"].tolist() == [1, 2, 3, 4]
    assert tf["x"][tf["child"] == "laser"].tolist() == [0.5, 1.5, 2.5]
    assert log.dropped == {"tf: the stamp runs backwards": 1}


def test_odometry_that_cannot_be_is_dropped_with_its_reason(bag):
    ros, write = bag
    bad = ros.odometry(T0 + 3, (np.nan, 0, 0), 0.5, 0.1)
    unset = ros.odometry(T0 + 4, (0, 0, 0), 0.5, 0.1)
    unset.pose.pose.orientation.w = 0.0
    log = read_bag(write([*half_second(ros, n=2, start=T0 - 10**9), ("/odom", T0 + 3, bad), ("/odom", T0 + 4, unset)]))
    assert len(log.track["time"]) == 2
    assert log.dropped == {"odometry: NaN or infinity": 1, "odometry: a quaternion that is no rotation": 1}


def test_odometry_without_speeds_gets_them_from_its_poses(bag):
    """An arc at 0.5 m/s and 0.4 rad/s; the driver left the twist empty."""
    ros, write = bag
    theta = 0.4 * np.arange(5) * 0.1
    poses = np.stack([1.25 * np.sin(theta), 1.25 * (1 - np.cos(theta)), theta], axis=-1)
    messages = [("/odom", T0 + k * 10**8, ros.odometry(T0 + k * 10**8, p, 0.0, 0.0)) for k, p in enumerate(poses)]
    log = read_bag(write(messages))
    np.testing.assert_allclose(log.odometry[1:], np.tile([0.5, 0.4], (4, 1)), rtol=1e-5)  # stamps of 0.24 µs
    np.testing.assert_array_equal(log.odometry[0], [0, 0])


def test_a_topic_that_is_missing_or_of_another_type_lists_what_there_is(bag):
    ros, write = bag
    path = write(half_second(ros))
    with pytest.raises(ValueError, match=r"no topic '/wheels'; the bag has /odom \(nav_msgs/msg/Odometry\)"):
        read_bag(path, topics={"odometry": "/wheels"})
    with pytest.raises(ValueError, match="/odom has the type nav_msgs/msg/Odometry, expected sensor_msgs"):
        read_bag(path, topics={"scan": "/odom"})
    with pytest.raises(ValueError, match=r"expected kinds among odometry, truth.*got 'wheels'"):
        read_bag(path, topics={"wheels": "/odom"})
    with pytest.raises(ValueError, match="expected kinds"):
        read_bag(path, topics="/odom")
    with pytest.raises(ValueError, match="expected one topic a kind, got odometry: /odom, /odom"):
        read_bag(path, topics=["/odom", "odom"])
    with pytest.raises(ValueError, match="expected one topic with pictures, it has none"):
        next(read_images(path))


def test_a_bag_without_anything_of_use_says_what_it_has(bag):
    ros, write = bag
    text = ros.T["std_msgs/msg/String"](data="hello")
    with pytest.raises(ValueError, match=r"the bag has /chatter \(std_msgs/msg/String\)"):
        read_bag(write([("/chatter", T0, text)]))


def test_of_two_odometries_the_one_of_the_usual_name_is_taken_and_else_nobody_guesses(bag):
    ros, write = bag
    path = write(half_second(ros) + half_second(ros, "/visual", 3))
    assert len(read_bag(path).track["time"]) == 6
    assert len(read_bag(path, topics=["/visual"]).track["time"]) == 3


def test_where_no_odometry_has_the_usual_name_the_reader_asks(bag):
    ros, write = bag
    path = write(half_second(ros, "/left") + half_second(ros, "/right") + [
        (f"/laser{k}", T0, ros.scan(T0, [1.0, 1.0])) for k in (1, 2)])  # fmt: skip
    with pytest.raises(ValueError, match="which is the odometry, /left or /right"):
        read_bag(path)
    assert len(read_bag(path, topics=["/left"]).track["time"]) == 6


def test_a_kind_with_several_topics_of_no_usual_name_is_left_out_and_counted(bag):
    ros, write = bag
    scans = [(f"/laser{k}", T0, ros.scan(T0, [1.0, 1.0])) for k in (1, 2)]
    log = read_bag(write(half_second(ros) + scans))
    assert log.streams == {}
    assert log.dropped == {"scan: could be any of /laser1, /laser2; name one in topics": 2}


def test_a_bag_that_was_cut_off_says_so_and_how_it_can_be_mended(bag):
    ros, write = bag
    path = write(half_second(ros, n=200))
    file = path if path.is_file() else next(p for p in path.iterdir() if p.suffix != ".yaml")
    content = file.read_bytes()
    for share in (0.0, 0.01, 0.5, 0.95):
        file.write_bytes(content[: int(share * len(content))])
        with pytest.raises(ValueError, match=r"(?s)cut off.*reindex.*mcap recover|no topic"):
            read_bag(path)


@pytest.mark.parametrize("fill", [b"\0", b"\xff"])
def test_a_bag_that_is_damaged_in_the_middle_is_read_as_far_as_it_goes_and_says_what_it_lost(fill, tmp_path):
    ros = Ros(2)
    path = ros.write(tmp_path / "drive", half_second(ros, n=4000))
    content = bytearray((path / "drive.mcap").read_bytes())
    middle = len(content) // 2
    content[middle : middle + 2000] = fill * 2000
    (path / "drive.mcap").write_bytes(content)
    log = read_bag(path)
    assert 100 < len(log.track["time"]) < 4000
    assert len(log.track["time"]) + sum(log.dropped.values()) == 4000
    assert any("damaged" in reason for reason in log.dropped)


def test_a_bag_of_which_nothing_is_left_is_an_error_that_says_what_was_lost(bag):
    ros, write = bag
    bad = ros.odometry(T0, (np.nan, 0, 0), 0.5, 0.1)
    with pytest.raises(ValueError, match="no message is left; dropped: 1 × odometry: NaN or infinity"):
        read_bag(write([("/odom", T0, bad)]))


def test_a_message_that_cannot_be_decoded_costs_itself_only(tmp_path):
    ros = Ros(2)
    good = ros.store.serialize_cdr(half_second(ros)[0][2], "nav_msgs/msg/Odometry")
    with rosbag2.Writer(tmp_path / "drive", version=8) as writer:
        connection = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=ros.store)
        for k, raw in enumerate([good, bytes(good)[:40], good]):
            writer.write(connection, T0 + k, raw)
    log = read_bag(tmp_path / "drive")
    assert len(log.track["time"]) == 2
    assert log.dropped == {"odometry: a message that cannot be decoded": 1}


def test_a_single_file_and_a_folder_whose_recorder_was_killed_are_read_too(tmp_path):
    ros = Ros(2)
    for storage in ("mcap", "sqlite3"):
        path = ros.write(tmp_path / storage, half_second(ros), storage)
        file = next(p for p in path.iterdir() if p.suffix != ".yaml")
        assert len(read_bag(file).track["time"]) == 6
        (path / "metadata.yaml").unlink()
        assert len(read_bag(path).track["time"]) == 6


def test_what_is_not_there_and_what_is_no_bag_say_so(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such bag"):
        read_bag(tmp_path / "nowhere.mcap")
    for name in ("text.bag", "text.mcap", "text.csv"):
        (tmp_path / name).write_text("time,x\n0,1\n")
        with pytest.raises(ValueError, match="this is no bag"):
            read_bag(tmp_path / name)


# The way back.


@pytest.fixture(scope="module")
def drive_of_the_world():
    world, rng, lidar = World(Arena.load("lab"), 1), np.random.default_rng(1), Lidar(beams=36)

    def scan(world):
        turn = lidar.scan(world, rng)
        return {"angles": turn.angles, "ranges": turn.ranges}

    sensors = {
        "scan": scan,
        "camera": lambda world: asdict(COURSE_CAMERA),
        "tags": lambda world: [{"id": i, "corners": rng.normal(300, 50, (4, 2))} for i in (3, 7)],
        "image": lambda world: {"image": rng.integers(0, 255, (4, 6, 3), dtype=np.uint8)},
    }
    row = {"id": "1", "seen": True, "ticks": 2**62 + 1, "to_go": np.inf}
    return record(world, drive(world, [[0.3, 0.1]]), lambda world: row, sensors)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_drive_of_the_world_comes_back_from_its_bag_to_the_bit_and_the_type(drive_of_the_world, storage, tmp_path):
    back = read_bag(write_bag(drive_of_the_world, tmp_path / "drive", storage))
    assert [*back.tables] == [*drive_of_the_world.tables] and back.dropped == {}
    for name, table in drive_of_the_world.tables.items():
        assert set(back.tables[name]) == set(table)
        for key, column in table.items():
            assert back.tables[name][key].dtype == column.dtype
            np.testing.assert_array_equal(back.tables[name][key], column)


def test_what_was_dropped_and_a_table_without_rows_come_back_too(tmp_path):
    track = {"time": np.array([5.0]), "v_odometry": np.zeros(1), "omega_odometry": np.zeros(1)}
    log = Recording(track, {}, {"tags": {}}, {"odometry: NaN or infinity": 2})
    back = read_bag(write_bag(log, tmp_path / "drive"))
    assert (back.measurements, back.streams, back.dropped) == (log.measurements, log.streams, log.dropped)


def test_the_topics_for_ros_tools_alone_hold_the_same_drive_as_far_as_ros_can(drive_of_the_world, tmp_path):
    log = drive_of_the_world
    topics = {"odometry": "/odom", "truth": "/ground_truth", "command": "/cmd_vel", "scan": "/scan", "tf": "/tf",
              "image": "/camera/image_raw", "camera": "/camera/camera_info", "tags": "/tag_detections"}  # fmt: skip
    back = read_bag(write_bag(log, tmp_path / "drive"), topics=topics)
    assert set(back.track) == set(log.track)
    for key, column in log.track.items():
        np.testing.assert_allclose(back.track[key], column, rtol=0, atol=1e-9 if key == "time" else 1e-14, err_msg=key)
    np.testing.assert_array_equal(back.streams["image"]["image"], log.streams["image"]["image"])
    np.testing.assert_array_equal(back.streams["tags"]["corners"], log.streams["tags"]["corners"])
    np.testing.assert_array_equal(back.streams["scan"]["ranges"], log.streams["scan"]["ranges"].astype(np.float32))
    for key, value in asdict(COURSE_CAMERA).items():
        assert set(back.streams["camera"][key]) == {value}
    tf = back.streams["tf"]
    assert {*zip(tf["parent"], tf["child"], strict=True)} == {("map", "odom"), ("odom", "base_link"),
                                                              ("map", "base_link_true")}  # fmt: skip
    np.testing.assert_array_equal(tf["x"][tf["child"] == "base_link"], log.track["x_odometry"])


def test_a_bag_is_never_written_over_and_a_failure_leaves_nothing_behind(drive_of_the_world, tmp_path):
    (tmp_path / "here").mkdir()
    with pytest.raises(FileExistsError, match="something already"):
        write_bag(drive_of_the_world, tmp_path / "here")
    uneven = {"scan": {"time": [0.1], "angles": [[0.0, 0.1, 0.3]], "ranges": [[1.0, 1.0, 1.0]]}}
    for streams, message in ((uneven, "rise evenly"), ({"scan": {"time": [-1.0]}}, "stamps of 0 to 2³¹ s"),
                             ({"scan": {"ranges": [1.0]}}, "in time or stamp"),
                             ({"image": {"time": [1.0], "image": np.zeros((1, 2, 2))}}, "uint8")):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            write_bag(Recording(drive_of_the_world.track, {}, streams), tmp_path / "new")
        assert not (tmp_path / "new").exists()
    with pytest.raises(ValueError, match="expected mcap or sqlite3, got 'bag'"):
        write_bag(drive_of_the_world, tmp_path / "new", "bag")


def test_a_stamp_becomes_the_nearest_nanosecond_at_any_size():
    cases = {0.15: 150_000_000, 0.1 + 0.2: 300_000_000, 1.001: 1_001_000_000, 1e9 + 0.25: 10**18 + 25 * 10**7}
    for stamp, nanoseconds in cases.items():
        assert row_time({"time": stamp}) == nanoseconds


def test_the_bag_names_types_that_ros_tools_know(drive_of_the_world, tmp_path):
    from rosbags.highlevel import AnyReader

    with AnyReader([write_bag(drive_of_the_world, tmp_path / "drive")]) as reader:
        types = {c.topic: c.msgtype for c in reader.connections}
        assert types["/odom"] == "nav_msgs/msg/Odometry" and types["/scan"] == "sensor_msgs/msg/LaserScan"
        received = [t for c, t, _ in reader.messages() if c.topic == "/odom"]
        assert received == [round(t * 1e9) for t in drive_of_the_world.track["time"]]


def test_without_rosbags_the_package_imports_and_says_what_to_install(tmp_path):
    program = (
        without("rosbags") + "from coursekit import recordings\n"
        "for door in (lambda: recordings.read_bag('x'), lambda: recordings.write_bag(recordings.Recording({}), 'x')):\n"
        "    try: door()\n"
        "    except ImportError as error: print(error)\n"
    )
    said = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout
    assert said.count("pip install 'coursekit[ros]'") == 2
