"""Rows of a recording as the ROS 2 messages that rviz and its like show."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

_APRILTAG = {
    "apriltag_msgs/msg/Point": "float64 x\nfloat64 y\n",
    "apriltag_msgs/msg/AprilTagDetection": "string family\nint32 id\nint32 hamming\nfloat32 goodness\n"
    "float32 decision_margin\napriltag_msgs/Point centre\napriltag_msgs/Point[4] corners\nfloat64[9] homography\n",
    "apriltag_msgs/msg/AprilTagDetectionArray": "std_msgs/Header header\n"
    "apriltag_msgs/AprilTagDetection[] detections\n",
}


def type_store() -> Any:
    """rosbags' types of ROS 2, with those of apriltag_msgs."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in _APRILTAG.items():
        store.register(get_types_from_msg(text, name))
    return store


def row_time(row: Mapping[str, Any]) -> int:
    """The nanosecond nearest to a row's stamp; a whole second is taken apart first, or rounding would lose digits."""
    stamp = row["time"] if "time" in row else row["stamp"]
    seconds = int(stamp)
    return seconds * 10**9 + round((stamp - seconds) * 10**9)


class Messages:
    """Makes ROS messages of rows, with the types of a rosbags type store."""

    def __init__(self, store: Any) -> None:
        self._types = store.types

    def _new(self, name: str, **fields: Any) -> Any:
        return self._types[name](**fields)

    def text(self, data: str) -> Any:
        """std_msgs/String."""
        return self._new("std_msgs/msg/String", data=data)

    def _header(self, row: Mapping[str, Any], frame: str) -> Any:
        sec, nanosec = divmod(row_time(row), 10**9)
        stamp = self._new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return self._new("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _vector(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, name: str = "Vector3") -> Any:
        return self._new(f"geometry_msgs/msg/{name}", x=x, y=y, z=z)

    def _turn(self, theta: float) -> Any:
        return self._new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(theta / 2), w=np.cos(theta / 2))

    def _twist(self, v: float, omega: float) -> Any:
        return self._new("geometry_msgs/msg/Twist", linear=self._vector(v), angular=self._vector(z=omega))

    def _odometry(self, row: Mapping[str, Any], frame: str, child: str, pose: list[float], speeds: list[float]) -> Any:
        unknown = np.zeros(36)
        at = self._new("geometry_msgs/msg/Pose", position=self._vector(pose[0], pose[1], name="Point"),
                       orientation=self._turn(pose[2]))  # fmt: skip
        return self._new(
            "nav_msgs/msg/Odometry", header=self._header(row, frame), child_frame_id=child,
            pose=self._new("geometry_msgs/msg/PoseWithCovariance", pose=at, covariance=unknown),
            twist=self._new("geometry_msgs/msg/TwistWithCovariance", twist=self._twist(*speeds), covariance=unknown),
        )  # fmt: skip

    def track(self, rows: list[dict[str, Any]]) -> Iterator[tuple[str, Any]]:
        """A row of the track as odometry, truth, command and transforms, where it has them."""
        (row,) = rows
        names = {"/odom": ("_odometry", "odom", "base_link"), "/ground_truth": ("", "map", "base_link_true")}
        transforms = [self._transform(row, "map", "odom", [0.0, 0.0, 0.0])]
        for topic, (suffix, frame, child) in names.items():
            pose = [row.get(f"{name}{suffix}", 0.0) for name in ("x", "y", "theta")]
            if f"v{suffix}" in row:
                yield topic, self._odometry(row, frame, child, pose, [row[f"v{suffix}"], row[f"omega{suffix}"]])
            if f"x{suffix}" in row:
                transforms.append(self._transform(row, frame, child, pose))
        if "v_command" in row:
            twist = self._twist(row["v_command"], row["omega_command"])
            yield (
                "/cmd_vel",
                self._new("geometry_msgs/msg/TwistStamped", header=self._header(row, "base_link"), twist=twist),
            )
        yield "/tf", self._new("tf2_msgs/msg/TFMessage", transforms=transforms)

    def _transform(self, row: Mapping[str, Any], parent: str, child: str, pose: list[float]) -> Any:
        x, y, theta = pose
        moved = self._new("geometry_msgs/msg/Transform", translation=self._vector(x, y), rotation=self._turn(theta))
        return self._new("geometry_msgs/msg/TransformStamped", header=self._header(row, parent), child_frame_id=child,
                         transform=moved)  # fmt: skip

    def scan(self, rows: list[dict[str, Any]]) -> Iterator[tuple[str, Any]]:
        """A turn of the lidar; its beams must be evenly spread.  Raises ValueError where they are not."""
        (row,) = rows
        angles, ranges = (np.asarray(row[name], dtype=float) for name in ("angles", "ranges"))
        step = np.ptp(angles) / max(len(angles) - 1, 1)
        if angles.shape != ranges.shape or not np.allclose(np.diff(angles), step, rtol=0, atol=1e-9):
            raise ValueError("scan: expected angles that rise evenly, one for each range")
        hit = ranges[np.isfinite(ranges)]
        reach = np.nextafter(np.float32(np.max(hit, initial=0.0)), np.float32(np.inf))
        yield "/scan", self._new(
            "sensor_msgs/msg/LaserScan", header=self._header(row, "base_link"), angle_min=angles[0],
            angle_max=angles[-1], angle_increment=step, time_increment=0.0, scan_time=0.0, range_min=0.0,
            range_max=float(reach), ranges=ranges.astype(np.float32), intensities=np.zeros(0, np.float32),
        )  # fmt: skip

    def image(self, rows: list[dict[str, Any]]) -> Iterator[tuple[str, Any]]:
        """A picture, (h, w, 3) BGR or (h, w) grey, of 8 bits.  Raises ValueError for another."""
        (row,) = rows
        pixels = np.ascontiguousarray(row["image"])
        encoding = {(2, 1): "mono8", (3, 3): "bgr8"}.get((pixels.ndim, pixels.shape[2] if pixels.ndim == 3 else 1))
        if encoding is None or pixels.dtype != np.uint8:
            raise ValueError(f"image: expected (h, w, 3) or (h, w) uint8, got {pixels.shape} {pixels.dtype}")
        h, w, *deep = pixels.shape
        yield "/camera/image_raw", self._new(
            "sensor_msgs/msg/Image", header=self._header(row, "camera"), height=h, width=w, encoding=encoding,
            is_bigendian=0, step=w * (deep or [1])[0], data=pixels.reshape(-1),
        )  # fmt: skip

    def camera(self, rows: list[dict[str, Any]]) -> Iterator[tuple[str, Any]]:
        """A camera's intrinsics, without distortion."""
        (row,) = rows
        fx, fy, cx, cy = (float(row[name]) for name in ("fx", "fy", "cx", "cy"))
        K = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0])
        P = np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1.0, 0])
        whole = self._new(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        yield "/camera/camera_info", self._new(
            "sensor_msgs/msg/CameraInfo", header=self._header(row, "camera"), height=int(row["height"]),
            width=int(row["width"]), distortion_model="plumb_bob", d=np.zeros(5), k=K, r=np.eye(3).reshape(-1), p=P,
            binning_x=0, binning_y=0, roi=whole,
        )  # fmt: skip

    def tags(self, rows: list[dict[str, Any]]) -> Iterator[tuple[str, Any]]:
        """The tags of one picture, where their corners are known."""
        point: Callable[..., Any] = self._types["apriltag_msgs/msg/Point"]
        detections = [
            self._new(
                "apriltag_msgs/msg/AprilTagDetection", family="tag36h11", id=int(row["id"]), hamming=0, goodness=0.0,
                decision_margin=0.0, centre=point(*np.mean(row["corners"], axis=0).tolist()),
                corners=[point(*corner) for corner in np.asarray(row["corners"], dtype=float).tolist()],
                homography=np.zeros(9),
            )
            for row in rows if "corners" in row
        ]  # fmt: skip
        if detections:
            yield (
                "/tag_detections",
                self._new(
                    "apriltag_msgs/msg/AprilTagDetectionArray",
                    header=self._header(rows[0], "camera"),
                    detections=detections,
                ),
            )
