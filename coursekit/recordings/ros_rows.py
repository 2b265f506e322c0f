"""ROS messages of the kinds that a robot localises with, as rows of a table; ROS 1 and ROS 2 alike.

Frames: ROS has x ahead, y left and z up on the robot, as this course has; its cameras look along z with x to the right.
A tag's position is turned from that into the course's camera frame: ahead, left, up.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from coursekit.geometry import Array, between
from coursekit.recordings.tables import Table

Row = dict[str, Any]


class Kind(NamedTuple):
    """What a kind of message is called in ROS, how it becomes rows, and which of several topics is meant."""

    types: tuple[str, ...]
    rows: Callable[[Any], Iterator[Row]]
    preferred: str  # a pattern for the topic's name


def odometry(message: Any) -> Iterator[Row]:
    """nav_msgs/Odometry → the pose that the wheels add up to, and their speeds."""
    x, y, theta = _planar(message.pose.pose)
    twist = message.twist.twist
    yield {"v_odometry": twist.linear.x, "omega_odometry": twist.angular.z,
           "x_odometry": x, "y_odometry": y, "theta_odometry": theta}  # fmt: skip


def truth(message: Any) -> Iterator[Row]:
    """Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped → the true pose, and any speeds."""
    holder = message.transform if hasattr(message, "transform") else message.pose
    x, y, theta = _planar(getattr(holder, "pose", holder))
    speeds = {"v": message.twist.twist.linear.x, "omega": message.twist.twist.angular.z} if _has_twist(message) else {}
    yield {"x": x, "y": y, "theta": theta, **speeds}


def command(message: Any) -> Iterator[Row]:
    """Twist or TwistStamped → what was commanded."""
    twist = getattr(message, "twist", message)
    yield {"v_command": twist.linear.x, "omega_command": twist.angular.z}


def scan(message: Any) -> Iterator[Row]:
    """LaserScan → directions and ranges; outside the sensor's limits, and where NaN, ``inf``: nothing there."""
    ranges = np.asarray(message.ranges, dtype=float).copy()
    with np.errstate(invalid="ignore"):
        furthest = message.range_max if message.range_max > 0 else np.inf  # some drivers leave it at 0
        ranges[~((ranges >= message.range_min) & (ranges <= furthest))] = np.inf
    yield {"angles": message.angle_min + message.angle_increment * np.arange(len(ranges)), "ranges": ranges}


def image(message: Any) -> Iterator[Row]:
    """Image or CompressedImage → pixels: (h, w, 3) BGR for colour, (h, w) for grey and depth.

    Raises ValueError for an encoding that is neither.
    """
    if hasattr(message, "format"):
        import cv2

        pixels = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
        if pixels is None:
            raise ValueError("a compressed image that cannot be decoded")
        yield {"image": pixels}
        return
    if message.encoding not in _ENCODINGS:
        raise ValueError(f"an image encoding that is not read: {message.encoding}")
    dtype, channels, order = _ENCODINGS[message.encoding]
    kind = np.dtype(dtype).newbyteorder(">" if message.is_bigendian else "<")
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    pixels = np.ascontiguousarray(rows[:, : message.width * channels * kind.itemsize]).view(kind).astype(dtype)
    pixels = pixels.reshape(message.height, message.width, channels)
    yield {"image": pixels[..., order] if channels > 1 else pixels[..., 0]}


_ENCODINGS: dict[str, tuple[Any, int, list[int]]] = {
    "bgr8": (np.uint8, 3, [0, 1, 2]), "8UC3": (np.uint8, 3, [0, 1, 2]), "rgb8": (np.uint8, 3, [2, 1, 0]),
    "bgra8": (np.uint8, 4, [0, 1, 2]), "8UC4": (np.uint8, 4, [0, 1, 2]), "rgba8": (np.uint8, 4, [2, 1, 0]),
    "mono8": (np.uint8, 1, []), "8UC1": (np.uint8, 1, []), "mono16": (np.uint16, 1, []), "16UC1": (np.uint16, 1, []),
    "32FC1": (np.float32, 1, []),
}  # fmt: skip


def camera(message: Any) -> Iterator[Row]:
    """CameraInfo → the fields of ``pinhole.Camera``, as ``Camera(**row)`` takes them, and the distortion.

    ``distortion`` holds ROS's coefficients; where they are not zero, rectify the pictures before ``pinhole`` sees them.
    """
    K = np.asarray(getattr(message, "k", getattr(message, "K", None)), dtype=float)
    D = np.asarray(getattr(message, "d", getattr(message, "D", None)), dtype=float)
    yield {"fx": K[0], "fy": K[4], "cx": K[2], "cy": K[5], "width": int(message.width), "height": int(message.height),
           "distortion": D}  # fmt: skip


def tags(message: Any) -> Iterator[Row]:
    """AprilTagDetectionArray → a row a tag: id, and corners (4, 2) px or the position with range and bearing.

    ROS 2's apriltag_msgs has corners (``with_positions`` adds what is on /tf); ROS 1's apriltag_ros has poses.  Range
    and bearing are the tag's centre's in the plane of the camera's x (ahead) and y (left), from the camera.
    """
    for found in message.detections:
        if hasattr(found, "corners"):
            yield {"id": int(found.id), "corners": np.array([[corner.x, corner.y] for corner in found.corners])}
        elif len(ids := np.atleast_1d(found.id)) == 1:  # a bundle of several tags has one pose for all of them
            pose = found.pose
            while not hasattr(pose, "position"):
                pose = pose.pose
            x, y, z = pose.position.z, -pose.position.x, -pose.position.y
            yield {"id": int(ids[0]), "x": x, "y": y, "z": z, "range": math.hypot(x, y), "bearing": math.atan2(y, x)}


def tf(message: Any) -> Iterator[Row]:
    """TFMessage → a row a transform, T_parent_child, each with its own stamp."""
    for found in message.transforms:
        t, q = found.transform.translation, found.transform.rotation
        yield {"header": found.header, "parent": found.header.frame_id, "child": found.child_frame_id,
               "x": t.x, "y": t.y, "z": t.z, "qx": q.x, "qy": q.y, "qz": q.z, "qw": q.w}  # fmt: skip


def stamp_of(header: Any, received: int) -> float:
    """Seconds by the sensor's clock; by the recorder's where the header was left at zero, or is not there.

    received : nanoseconds.  Divided as whole numbers, so a stamp is the float nearest to its nanoseconds.
    """
    nanoseconds = header.stamp.sec * 10**9 + header.stamp.nanosec if header is not None else 0
    return (nanoseconds or received) / 10**9


def yaw(q: Any) -> float:
    """The heading in a quaternion, radians in (-π, π].  Raises ValueError for one of length 0, which turns nothing."""
    length = math.sqrt(q.x**2 + q.y**2 + q.z**2 + q.w**2)
    if not 0 < length < math.inf:
        raise ValueError("a quaternion that is no rotation")
    x, y, z, w = q.x / length, q.y / length, q.z / length, q.w / length
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _planar(pose: Any) -> tuple[float, float, float]:
    place = pose.position if hasattr(pose, "position") else pose.translation
    return place.x, place.y, yaw(pose.orientation if hasattr(pose, "orientation") else pose.rotation)


def _has_twist(message: Any) -> bool:
    return hasattr(message, "twist")


KINDS: Mapping[str, Kind] = {
    "odometry": Kind(("nav_msgs/msg/Odometry",), odometry, r"(^|/)odom(etry)?$"),
    "truth": Kind(
        ("nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped",
         "geometry_msgs/msg/TransformStamped"), truth, r"ground.?truth"),
    "command": Kind(("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"), command, r"(^|/)cmd_vel$"),
    "scan": Kind(("sensor_msgs/msg/LaserScan",), scan, r"(^|/)scan$"),
    "image": Kind(("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"), image, r"image(_raw|_rect)?$"),
    "camera": Kind(("sensor_msgs/msg/CameraInfo",), camera, r"camera_info$"),
    "tags": Kind(("apriltag_msgs/msg/AprilTagDetectionArray", "apriltag_ros/msg/AprilTagDetectionArray",
                  "apriltags_ros/msg/AprilTagDetectionArray", "apriltags2_ros/msg/AprilTagDetectionArray"),
                 tags, r"detections$"),
    "tf": Kind(("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"), tf, r"(^|/)tf(_static)?$"),
}  # fmt: skip
"""Kind → its messages.  Each kind is a table of a ``Recording``."""


def wheels_from_poses(track: dict[str, Array]) -> dict[str, Array]:
    """Odometry whose twist was left empty gets its speeds from its poses: [v, ω] over the period that ends there.

    A track whose twist says anything, or whose poses stand still, is returned as it is.
    """
    poses = np.stack([track[name] for name in ("x_odometry", "y_odometry", "theta_odometry")], axis=-1)
    if track["v_odometry"].any() or track["omega_odometry"].any() or len(poses) < 2 or not np.ptp(poses, axis=0).any():
        return track
    step, dt = between(poses[:-1], poses[1:]), np.diff(track["time"])
    with np.errstate(divide="ignore", invalid="ignore"):
        # The chord of an arc that turns by δ lies at δ/2 and has the length v dt sinc(δ/2).
        half = step[:, 2] / 2
        chord = step[:, 0] * np.cos(half) + step[:, 1] * np.sin(half)
        v = np.where(dt > 0, chord / np.sinc(half / np.pi) / dt, 0.0)
        omega = np.where(dt > 0, step[:, 2] / dt, 0.0)
    return {**track, "v_odometry": np.r_[0.0, v], "omega_odometry": np.r_[0.0, omega]}


def with_positions(tags: Table, tf: Table) -> Table:
    """Tags of ROS 2, which have corners only, with the positions that their detector publishes on /tf.

    A transform belongs to a tag when its child's name ends with the id (tag36h11:3) and it has the tag's stamp.  A tag
    without one gets NaN.  Tags that have positions, and those without any such transform, are returned as they are.
    """
    if not tags or "range" in tags or not tf:
        return tags
    places = zip(tf["time"], tf["child"], tf["x"], tf["y"], tf["z"], strict=True)
    found = {
        (time, int(name[1])): (z, -x, -y)
        for time, child, x, y, z in places
        if (name := re.search(r"(?<=[^0-9])(\d+)$", child)) and re.search(r"tag|:", child, re.IGNORECASE)
    }
    keys = list(zip(tags["time"].tolist(), tags["id"].tolist(), strict=True))
    if not any(key in found for key in keys):
        return tags
    p = np.array([found.get(key, (np.nan,) * 3) for key in keys])
    position = {"x": p[:, 0], "y": p[:, 1], "z": p[:, 2]}
    return {**tags, **position, "range": np.hypot(p[:, 0], p[:, 1]), "bearing": np.arctan2(p[:, 1], p[:, 0])}
