"""Bags of either ROS, written with rosbags from plain numbers."""

import math

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from coursekit.recordings.ros_messages import type_store

T0 = 1_700_000_000 * 10**9
APRILTAG_ROS = {
    "apriltag_ros/msg/AprilTagDetection": "int32[] id\nfloat64[] size\ngeometry_msgs/PoseWithCovarianceStamped pose\n",
    "apriltag_ros/msg/AprilTagDetectionArray": "std_msgs/Header header\napriltag_ros/AprilTagDetection[] detections\n",
}


class Ros:
    """Messages of one of the two, by plain numbers."""

    def __init__(self, version):
        self.version = version
        self.store = get_typestore(Stores.ROS1_NOETIC) if version == 1 else type_store()
        if version == 1:
            for name, text in APRILTAG_ROS.items():
                self.store.register(get_types_from_msg(text, name))
        self.T = self.store.types

    def header(self, stamp, frame=""):
        sec, nanosec = divmod(int(stamp), 10**9)
        time = self.T["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        return self.T["std_msgs/msg/Header"](stamp=time, frame_id=frame, **({"seq": 0} if self.version == 1 else {}))

    def vector(self, x=0.0, y=0.0, z=0.0, name="Vector3"):
        return self.T[f"geometry_msgs/msg/{name}"](x=x, y=y, z=z)

    def pose(self, x, y, theta):
        q = self.T["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=math.sin(theta / 2), w=math.cos(theta / 2))
        return self.T["geometry_msgs/msg/Pose"](position=self.vector(x, y, name="Point"), orientation=q)

    def with_covariance(self, pose):
        return self.T["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36))

    def odometry(self, stamp, pose, v, omega):
        twist = self.T["geometry_msgs/msg/Twist"](linear=self.vector(v), angular=self.vector(z=omega))
        twist = self.T["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=np.zeros(36))
        return self.T["nav_msgs/msg/Odometry"](header=self.header(stamp, "odom"), child_frame_id="base_link",
                                               pose=self.with_covariance(self.pose(*pose)), twist=twist)  # fmt: skip

    def scan(self, stamp, ranges):
        return self.T["sensor_msgs/msg/LaserScan"](
            header=self.header(stamp), angle_min=-0.5, angle_max=0.5, angle_increment=0.5, time_increment=0.0,
            scan_time=0.0, range_min=0.1, range_max=8.0, ranges=np.array(ranges, np.float32),
            intensities=np.zeros(0, np.float32))  # fmt: skip

    def image(self, stamp, pixels, encoding, step=None):
        h, w, *_ = pixels.shape
        rows = pixels.reshape(h, -1)
        padded = np.zeros((h, step or rows.shape[1]), np.uint8)
        padded[:, : rows.shape[1]] = rows
        return self.T["sensor_msgs/msg/Image"](header=self.header(stamp), height=h, width=w, encoding=encoding,
                                               is_bigendian=0, step=padded.shape[1], data=padded.ravel())  # fmt: skip

    def tags(self, stamp, seen):
        """seen : id → [right, down, ahead] in the camera's optical frame."""
        found = []
        for id, (x, y, z) in seen.items():
            at = self.pose(0.0, 0.0, 0.0)
            at.position.x, at.position.y, at.position.z = x, y, z
            stamped = self.T["geometry_msgs/msg/PoseWithCovarianceStamped"](
                header=self.header(stamp), pose=self.with_covariance(at)
            )
            one = self.T["apriltag_ros/msg/AprilTagDetection"]
            found.append(one(id=np.array([id], np.int32), size=np.array([0.2]), pose=stamped))
        return self.T["apriltag_ros/msg/AprilTagDetectionArray"](header=self.header(stamp), detections=found)

    def transform(self, stamp, parent, child, position):
        moved = self.T["geometry_msgs/msg/Transform"](
            translation=self.vector(*position), rotation=self.pose(0, 0, 0).orientation
        )
        stamped = self.T["geometry_msgs/msg/TransformStamped"]
        one = stamped(header=self.header(stamp, parent), child_frame_id=child, transform=moved)
        return self.T["tf2_msgs/msg/TFMessage"](transforms=[one])

    def corners(self, stamp, ids):
        point = self.T["apriltag_msgs/msg/Point"]
        found = [
            self.T["apriltag_msgs/msg/AprilTagDetection"](
                family="36h11", id=id, hamming=0, goodness=0.0, decision_margin=50.0, centre=point(x=1.0, y=1.0),
                corners=[point(x=float(k), y=float(id)) for k in range(4)], homography=np.zeros(9))
            for id in ids
        ]  # fmt: skip
        return self.T["apriltag_msgs/msg/AprilTagDetectionArray"](header=self.header(stamp), detections=found)

    def write(self, path, messages, storage="mcap"):
        """messages : (topic, received in nanoseconds, message), in the order of recording."""
        if self.version == 1:
            writer = rosbag1.Writer(path)
        else:
            plugin = {"mcap": rosbag2.StoragePlugin.MCAP, "sqlite3": rosbag2.StoragePlugin.SQLITE3}[storage]
            writer = rosbag2.Writer(path, version=8, storage_plugin=plugin)
        with writer:
            connections = {}
            for topic, received, message in messages:
                msgtype = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, msgtype, typestore=self.store)
                pack = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
                writer.write(connections[topic], received, pack(message, msgtype))
        return path


def half_second(ros, topic="/odom", n=6, start=T0):
    return [(topic, start + k * 10**8 + 5_000_000, ros.odometry(start + k * 10**8, (0.05 * k, 0.1, 0.3), 0.5, 0.1))
            for k in range(n)]  # fmt: skip
