"""Right and wrong answers to the exercises of Lab 2."""

import math

import numpy as np

from tests.labs.answers import Answers


def stub(*arguments):
    raise NotImplementedError


def scaled_in_place(u, camera):
    u -= camera.cx
    return -np.arctan(u / camera.fx)


def depth(height, camera, h):
    return h * camera.fy / height


def axis_point(height, axis, camera, h, r, offset):
    """The axis in the robot's frame, right; the wrong answers spoil it."""
    x = depth(height, camera, h) + r
    return x + offset, x * (camera.cx - axis) / camera.fx


def polar(x, y):
    return math.hypot(x, y), math.atan2(y, x)


def reference_position(height, axis, camera, h, r, offset):
    return polar(*axis_point(height, axis, camera, h, r, offset))


def complex_position(height, axis, camera, h, r, offset):
    p = (h * camera.fy / height + r) * (1 + 1j * (camera.cx - axis) / camera.fx) + offset
    return np.array([abs(p), np.angle(p)])


def camera_bearing(height, axis, camera, h, r, offset):
    return reference_position(height, axis, camera, h, r, offset)[0], math.atan((camera.cx - axis) / camera.fx)


def wrong_lever(height, axis, camera, h, r, offset):
    x = depth(height, camera, h) + r + offset
    return polar(x, x * (camera.cx - axis) / camera.fx)


def left_of_the_rim(height, axis, camera, h, r, offset):
    x = depth(height, camera, h)
    return polar(x + r + offset, x * (camera.cx - axis) / camera.fx)


def radius_along_the_ray(height, axis, camera, h, r, offset):
    t = (camera.cx - axis) / camera.fx
    ray, phi = depth(height, camera, h) * math.hypot(1, t) + r, math.atan(t)
    return polar(ray * math.cos(phi) + offset, ray * math.sin(phi))


def offset_to_the_range(height, axis, camera, h, r, offset):
    range_, bearing = reference_position(height, axis, camera, h, r, 0.0)
    return range_ + offset, bearing


def depth_as_range(height, axis, camera, h, r, offset):
    d, phi = depth(height, camera, h) + r, math.atan((camera.cx - axis) / camera.fx)
    return polar(d * math.cos(phi) + offset, d * math.sin(phi))


ANSWERS = {
    "lab02.bearing_of_column": Answers(
        stub=stub,
        reference=lambda u, camera: np.arctan((camera.cx - u) / camera.fx),
        second=lambda u, camera: np.arctan2(camera.cx - np.asarray(u), camera.fx),
        wrong={
            "mirrored": (lambda u, camera: np.arctan((u - camera.cx) / camera.fx), "are mirrored"),
            "tangent only": (lambda u, camera: (camera.cx - u) / camera.fx, "stopped at the tangent"),
            "degrees": (lambda u, camera: np.degrees(np.arctan((camera.cx - u) / camera.fx)), "Those are degrees"),
            "wrong focal length": (lambda u, camera: np.arctan((camera.cx - u) / camera.fy), "which of the two focal"),
            "no principal point": (lambda u, camera: np.arctan(-u / camera.fx), "not at column 0"),
            "half the width": (
                lambda u, camera: np.arctan((camera.width / 2 - u) / camera.fx),
                "not half of the width",
            ),
            "upside down": (lambda u, camera: np.arctan2(camera.fx, camera.cx - u), "ratio is upside down"),
            "the row's centre": (lambda u, camera: np.arctan((camera.cy - u) / camera.fx), "cy belongs to rows"),
            "a sine": (lambda u, camera: np.arcsin((camera.cx - u) / camera.fx), "Draw the pinhole"),
            "changed in place": (scaled_in_place, "changes its argument"),
            "one at a time": (lambda u, camera: math.atan((camera.cx - u) / camera.fx), "there are np.arctan"),
        },
        both={
            "mirrored, in degrees": (
                lambda u, camera: np.degrees(np.arctan((u - camera.cx) / camera.fx)),
                ("are mirrored", "Those are degrees"),
            ),
            "tangent by the wrong focal length": (
                lambda u, camera: (camera.cx - u) / camera.fy,
                ("stopped at the tangent", "which of the two focal"),
            ),
            "half the width, mirrored": (
                lambda u, camera: np.arctan((u - camera.width / 2) / camera.fx),
                ("are mirrored", "not half of the width"),
            ),
        },
    ),
    "lab02.range_from_height": Answers(
        stub=stub,
        reference=lambda height, theta, camera, h: h * camera.fy / (height * np.cos(theta)),
        second=lambda height, theta, camera, h: depth(height, camera, h) * math.sqrt(1 + math.tan(theta) ** 2),
        wrong={
            "depth": (lambda n, theta, camera, h: depth(n, camera, h), "That is the depth"),
            "the report's formula": (lambda n, theta, camera, h: depth(n, camera, h) * np.cos(theta), "wrong side"),
            "wrong focal length": (lambda n, theta, camera, h: h * camera.fx / n / np.cos(theta), "belongs to rows"),
            "sine": (lambda n, theta, camera, h: depth(n, camera, h) / np.sin(theta), "A sine belongs"),
            "degrees": (lambda n, theta, camera, h: depth(n, camera, h) / np.cos(np.radians(theta)), "for degrees"),
            "upside down": (lambda n, theta, camera, h: n / (h * camera.fy) / np.cos(theta), "upside down"),
        },
        both={
            "depth by the other focal length": (
                lambda n, theta, camera, h: h * camera.fx / n,
                ("That is the depth", "belongs to rows"),
            ),
            "the report's formula by the other focal length": (
                lambda n, theta, camera, h: h * camera.fx / n * np.cos(theta),
                ("wrong side", "belongs to rows"),
            ),
        },
    ),
    "lab02.axis_of_edges": Answers(
        stub=stub,
        reference=lambda left, right, camera: (camera.bearing(left) + camera.bearing(right)) / 2,
        second=lambda left, right, camera: float(
            np.mean(np.arctan2(camera.cx - np.array([left, right]), np.full(2, camera.fx)))
        ),
        wrong={
            "mean pixel": (lambda a, b, camera: camera.bearing((a + b) / 2), "mean of the columns"),
            "a column": (
                lambda a, b, camera: camera.column((camera.bearing(a) + camera.bearing(b)) / 2),
                "a column in pixels",
            ),
            "mirrored": (lambda a, b, camera: -(camera.bearing(a) + camera.bearing(b)) / 2, "wrong sign"),
            "not halved": (lambda a, b, camera: camera.bearing(a) + camera.bearing(b), "forgot to halve"),
            "half width": (lambda a, b, camera: (camera.bearing(a) - camera.bearing(b)) / 2, "how wide"),
            "left edge": (lambda a, b, camera: camera.bearing(a), "left edge alone"),
            "right edge": (lambda a, b, camera: camera.bearing(b), "right edge alone"),
            "whole width": (lambda a, b, camera: camera.bearing(a) - camera.bearing(b), "the whole angle"),
            "mean tangent": (
                lambda a, b, camera: (math.tan(camera.bearing(a)) + math.tan(camera.bearing(b))) / 2,
                "averaged the tangents",
            ),
        },
        both={
            "half width, negative": (
                lambda a, b, camera: (camera.bearing(b) - camera.bearing(a)) / 2,
                ("how wide", "wrong sign"),
            ),
            "mirrored, not halved": (
                lambda a, b, camera: -(camera.bearing(a) + camera.bearing(b)),
                ("wrong sign", "forgot to halve"),
            ),
            "mean pixel, mirrored": (lambda a, b, camera: -camera.bearing((a + b) / 2), ("mean of the columns",)),
        },
    ),
    "lab02.cost_of_a_pixel": Answers(
        stub=stub,
        reference=lambda d, h, f: d**2 / (h * f),
        second=lambda d, h, f: h * f / (h * f / d) ** 2,
        wrong={
            "linear": (lambda d, h, f: d / (h * f), "Linear in the distance"),
            "height in pixels": (lambda d, h, f: h * f / d, "height of the landmark in pixels"),
            "inverse": (lambda d, h, f: h * f / d**2, "pixels per metre"),
            "signed": (lambda d, h, f: -(d**2) / (h * f), "The sign says"),
            "height on top": (lambda d, h, f: d**2 * h / f, "both belong under"),
            "finite step": (lambda d, h, f: h * f / (h * f / d - 1) - d, "one pixel *less*"),
            "finite step down": (lambda d, h, f: d - h * f / (h * f / d + 1), "one pixel *more*"),
            "no brackets": (lambda d, h, f: d**2 / h * f, "as Python does"),
        },
        both={
            "linear, signed": (lambda d, h, f: -d / (h * f), ("Linear in the distance", "The sign says")),
            "linear, no brackets": (lambda d, h, f: d / h * f, ("Linear in the distance", "as Python does")),
        },
    ),
    "lab02.robot_range_bearing": Answers(
        stub=stub,
        reference=reference_position,
        second=complex_position,
        wrong={
            "near rim": (lambda n, u, c, h, r, o: reference_position(n, u, c, h, 0.0, o), "range to the near rim"),
            "from the camera": (
                lambda n, u, c, h, r, o: reference_position(n, u, c, h, r, 0.0),
                "seen from the camera",
            ),
            "offset taken away": (
                lambda n, u, c, h, r, o: reference_position(n, u, c, h, r, -o),
                "do not take it away",
            ),
            "radius taken away": (
                lambda n, u, c, h, r, o: reference_position(n, u, c, h, -r, o),
                "the axis lies behind",
            ),
            "the camera's bearing": (camera_bearing, "still the camera's"),
            "offset on the left, too": (wrong_lever, "along its own x only"),
            "diameter": (lambda n, u, c, h, r, o: reference_position(n, u, c, h, 2 * r, o), "A full diameter"),
            "bare pinhole": (lambda n, u, c, h, r, o: reference_position(n, u, c, h, 0.0, 0.0), "bare pinhole"),
            "added to the range": (
                lambda n, u, c, h, r, o: (
                    depth(n, c, h) * math.hypot(1, (c.cx - u) / c.fx) + r + o,
                    math.atan((c.cx - u) / c.fx),
                ),
                "before you go to polar",
            ),
            "mirrored": (lambda n, u, c, h, r, o: reference_position(n, 2 * c.cx - u, c, h, r, o), "wrong sign"),
            "left without the radius": (left_of_the_rim, "that one grows"),
            "depth as range": (depth_as_range, "with no cosine or sine"),
            "swapped": (lambda n, u, c, h, r, o: reference_position(n, u, c, h, r, o)[::-1], "wrong order"),
            "range only": (lambda n, u, c, h, r, o: reference_position(n, u, c, h, r, o)[0], "Return two numbers"),
            "radius along the ray": (radius_along_the_ray, "added the radius along the ray"),
            "offset to the range": (offset_to_the_range, "added the offset to the range"),
            "wrong focal length": (
                lambda n, u, c, h, r, o: reference_position(n * c.fy / c.fx, u, c, h, r, o),
                "belongs to rows",
            ),
        },
        both={
            "near rim, mirrored": (
                lambda n, u, c, h, r, o: reference_position(n, 2 * c.cx - u, c, h, 0.0, o),
                ("wrong sign", "range to the near rim"),
            ),
            "near rim, offset to the range": (
                lambda n, u, c, h, r, o: (
                    depth(n, c, h) * math.hypot(1, (c.cx - u) / c.fx) + o,
                    math.atan((c.cx - u) / c.fx),
                ),
                ("no radius",),
            ),
            "diameter, from the camera": (
                lambda n, u, c, h, r, o: reference_position(n, u, c, h, 2 * r, 0.0),
                ("A full diameter",),
            ),
            "swapped, offset taken away": (
                lambda n, u, c, h, r, o: reference_position(n, u, c, h, r, -o)[::-1],
                ("wrong order", "do not take it away"),
            ),
            "radius along the ray, mirrored": (
                lambda n, u, c, h, r, o: radius_along_the_ray(n, 2 * c.cx - u, c, h, r, o),
                ("wrong sign", "along the ray"),
            ),
        },
    ),
}
