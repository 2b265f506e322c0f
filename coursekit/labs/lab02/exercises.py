"""The checks of Lab 2: columns and angles, depth and range, two edges and one axis, pixels and metres."""

from __future__ import annotations

from typing import Any

import numpy as np

from coursekit.pinhole import Camera, project_cylinder
from coursekit.teaching.exercises import call, close, exercise, expect


def _camera(rng: np.random.Generator) -> Camera:
    """A camera with different focal lengths across and along, so that a mixed-up one shows."""
    fx, fy = rng.uniform(400, 700), rng.uniform(750, 1000)
    return Camera(fx, fy, rng.uniform(300, 340), rng.uniform(220, 260), 640, 480)


@exercise("lab02.bearing_of_column")
def bearing_of_column(answer: Any, rng: np.random.Generator) -> None:
    camera, u = _camera(rng), rng.uniform(0, 639, 6)
    u[:4] = camera.cx + 100.0, 0.0, 639.0, camera.cx
    t = (camera.cx - u) / camera.fx
    close(
        call(answer, u, camera, stops={"Python scalars": "`u` holds many columns at once."}),
        np.arctan(t),
        misconceptions={
            "Your bearings are mirrored: a column right of the centre is seen to the right, and left is positive.":
                np.arctan(-t),
            "You stopped at the tangent: y/x is a ratio, not yet an angle.": t,
            "Those are degrees; the course measures angles in radians.": np.degrees(np.arctan(t)),
            "Columns run across the picture: which of the two focal lengths belongs to them?":
                np.arctan((camera.cx - u) / camera.fy),
            "The optical axis is not at column 0: measure columns from the principal point.":
                np.arctan(-u / camera.fx),
            "The principal point is where the optical axis meets the sensor, not half of the width.":
                np.arctan((camera.width / 2 - u) / camera.fx),
            "Your ratio is upside down: the tangent is left over ahead, and what lies ahead is the focal length.":
                np.arctan2(camera.fx, camera.cx - u),
            "cy belongs to rows; which number says where the optical axis meets the columns?":
                np.arctan((camera.cy - u) / camera.fx),
        },
        otherwise="Draw the pinhole from above: how far left of the optical axis is the ray, at one focal length?",
    )  # fmt: skip


@exercise("lab02.range_from_height")
def range_from_height(answer: Any, rng: np.random.Generator) -> None:
    camera, height = _camera(rng), rng.uniform(40, 200)
    for theta in (rng.uniform(0.3, 0.6), -rng.uniform(0.3, 0.6), rng.uniform(-0.05, 0.05)):
        _range(answer, height, theta, camera, rng.uniform(0.3, 1.2))


def _range(answer: Any, height: float, theta: float, camera: Camera, h: float) -> None:
    depth, c = h * camera.fy / height, np.cos(theta)
    close(
        call(answer, height, theta, camera, h),
        depth / c,
        misconceptions={
            "That is the depth, along the optical axis. The range runs along the ray.": depth,
            "The cosine stands on the wrong side. Is a slanted side longer or shorter than the one it slants from?":
                depth * c,
            "Heights are measured down the picture: which focal length belongs to rows?": h * camera.fx / height / c,
            "A sine belongs to the side across from the angle; the depth is the side next to it.":
                depth / np.sin(theta),
            "You took θ for degrees before the cosine; it is in radians already.": depth / np.cos(np.radians(theta)),
            "Taller in the picture means nearer: your ratio is upside down.": height / (h * camera.fy) / c,
        },
        otherwise="Two steps: similar triangles give the depth (rows, so fy), then a right triangle the range.",
    )  # fmt: skip


@exercise("lab02.axis_of_edges")
def axis_of_edges(answer: Any, rng: np.random.Generator) -> None:
    camera = _camera(rng)
    for theta in (rng.uniform(0.3, 0.5), -rng.uniform(0.3, 0.5), rng.uniform(-0.1, 0.1)):
        _axis(answer, camera, rng.uniform(0.5, 1.0), theta)


def _axis(answer: Any, camera: Camera, d: float, theta: float) -> None:
    seen = project_cylinder(d, theta, camera, 0.5, 0.12)
    left, right = float(seen.left_px), float(seen.right_px)
    close(
        call(answer, left, right, camera),
        theta,
        misconceptions={
            "That is the mean of the columns: right only straight ahead, because the tangent is not a straight line.":
                camera.bearing((left + right) / 2),
            "That is a column in pixels; the exercise asks for the bearing of the axis.": seen.axis_px,
            "Your bearing has the wrong sign: left of the optical axis is positive.": -theta,
            "You added the two angles and forgot to halve them.": 2 * theta,
            "That is half the angle between the edges: how wide the cylinder looks, not where it stands.":
                (camera.bearing(left) - camera.bearing(right)) / 2,
            "That is the bearing of the left edge alone.": camera.bearing(left),
            "That is the bearing of the right edge alone.": camera.bearing(right),
            "That is the whole angle between the edges, not the middle of it.":
                camera.bearing(left) - camera.bearing(right),
            "You averaged the tangents, which is averaging the columns: take the angles first, then the mean.":
                np.tan(camera.bearing((left + right) / 2)),
        },
        otherwise="The outline spans the angles φ ± asin(r/ρ): what do you do with the two of them to be left with φ?",
    )  # fmt: skip


@exercise("lab02.cost_of_a_pixel")
def cost_of_a_pixel(answer: Any, rng: np.random.Generator) -> None:
    d, h, f = rng.uniform(2, 12), rng.uniform(0.3, 1.2), rng.uniform(400, 900)
    got = call(answer, d, h, f)
    close(
        got,
        d**2 / (h * f),
        misconceptions={
            "Linear in the distance? Put your formula for the range through a derivative, not a ratio.": d / (h * f),
            "That is the height of the landmark in pixels, not the cost of one of them.": h * f / d,
            "Your answer falls where it should grow: it is the inverse, pixels per metre.": h * f / d**2,
            "The sign says that a taller picture is nearer; the question is how large the error is.":
                -(d**2) / (h * f),
            "A taller landmark or a longer lens makes a pixel cheaper: both belong under the line.": d**2 * h / f,
            "That is the change when the height is one pixel *less*, exactly; the derivative at d is simpler.":
                d**2 / (h * f - d),
            "That is the change when the height is one pixel *more*, exactly; take the derivative at d instead.":
                d**2 / (h * f + d),
            "Read it as Python does: d**2 / h * f multiplies by f. What must stand under the line?": d**2 / h * f,
        },
        otherwise="d = h f / n with n pixels: differentiate by n, then write n in terms of d again.",
    )  # fmt: skip


@exercise("lab02.robot_range_bearing")
def robot_range_bearing(answer: Any, rng: np.random.Generator) -> None:
    camera, h = _camera(rng), rng.uniform(0.3, 0.8)
    for theta in (rng.uniform(0.2, 0.4), -rng.uniform(0.2, 0.4)):
        _place(answer, camera, h, rng.uniform(0.08, 0.2), rng.uniform(0.1, 0.3), rng.uniform(1.5, 4.0), theta)
    _place(answer, camera, h, rng.uniform(0.08, 0.2), 0.0, rng.uniform(1.5, 4.0), rng.uniform(-0.1, 0.1))


def _place(answer: Any, camera: Camera, h: float, r: float, offset: float, d: float, theta: float) -> None:
    seen = project_cylinder(d, theta, camera, h, r, offset)
    got = call(answer, float(seen.height_px), float(seen.axis_px), camera, h, r, offset)
    expect(np.shape(got) == (2,), "Return two numbers: the range and the bearing.")
    x, t = h * camera.fy / float(seen.height_px), (camera.cx - float(seen.axis_px)) / camera.fx
    phi = float(np.arctan(t))
    ray = float(np.hypot(x, x * t))

    def polar(ahead: float, left: float) -> list[float]:
        return [float(np.hypot(ahead, left)), float(np.arctan2(left, ahead))]

    sign, fx = "Left of the optical axis is positive: your bearing has the wrong sign.", x * camera.fx / camera.fy
    hints = {
        sign: polar(x + r + offset, -(x + r) * t),
        "Right numbers, wrong order: first the range, then the bearing.": polar(x + r + offset, (x + r) * t)[::-1],
        "That is the range to the near rim: where is the axis?": polar(x + offset, x * t),
        "Those are seen from the camera; the robot's centre stands behind it.": polar(x + r, (x + r) * t),
        "The camera stands ahead of the centre: add the offset to the depth, do not take it away.":
            polar(x + r - offset, (x + r) * t),
        "You moved the near rim towards the robot; the axis lies behind it.": polar(x - r + offset, (x - r) * t),
        "The offset moves the robot along its own x only: the step to the left does not grow with it.":
            polar(x + r + offset, (x + r + offset) * t),
        "A full diameter is too much: the axis is one radius behind the rim.":
            polar(x + 2 * r + offset, (x + 2 * r) * t),
        "That is a bare pinhole: neither the radius nor the offset is in it.": polar(x, x * t),
        "You added radius and offset to the range. Both are steps along x: add them before you go to polar.":
            [ray + r + offset, phi],
        "You added the offset to the range. It is a step along x, so it belongs to the depth.":
            [float(np.hypot(x + r, (x + r) * t)) + offset, phi],
        "You added the radius along the ray. The height gives the depth of the rim, so the radius is added to a depth.":
            polar((ray + r) * np.cos(phi) + offset, (ray + r) * np.sin(phi)),
        "The radius goes to the depth before the step to the left is taken from it: that one grows, too.":
            polar(x + r + offset, x * t),
        "The height gives a depth, not a range: the axis is at [D, D tan φ], with no cosine or sine of φ.":
            polar((x + r) * np.cos(phi) + offset, (x + r) * np.sin(phi)),
        "Heights are measured down the picture: which focal length belongs to rows?":
            polar(fx + r + offset, (fx + r) * t),
        "That is the offset and no radius, and you added it to the range: it is a step along x.": [ray + offset, phi],
        "That is the radius and no offset, and you added it along the ray: it is a step in depth.": [ray + r, phi],
        "The radius is taken away, and the offset is not in it.": polar(x - r, (x - r) * t),
        "A full diameter is too much, and the offset is not in it.": polar(x + 2 * r, (x + 2 * r) * t),
        "The offset is taken away, and the radius is not in it.": polar(x - offset, x * t),
        "The bearing is still the camera's: from the centre, the same point is seen at a smaller angle.":
            [polar(x + r + offset, (x + r) * t)[0], phi],
    }  # fmt: skip
    # Each again with the bearing's sign turned round: the sign is the easier one to see.
    hints |= {f"{sign} {hint}": [value[0], -value[1]] for hint, value in hints.items() if hint != sign}
    close(
        got,
        [d, theta],
        misconceptions=hints,
        otherwise="Find the axis as a point [x, y] in the camera's frame, move the origin, then go back to polar.",
    )
