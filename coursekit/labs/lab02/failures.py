"""Lab 2's failures: four ways to read a wrong range or bearing out of a right picture."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coursekit.geometry import Array
from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder, range_bearing
from coursekit.teaching.experiments import lab_seed
from coursekit.teaching.failures import Failure

HEIGHT, RADIUS, OFFSET = 0.5, 0.1, 0.07
Reading = Callable[[Array, Array, Array, Camera], tuple[Array, Array]]
"""What a picture says: (height_px, left_px, right_px, camera) → range and bearing from the robot's centre."""


def exact_reading(height: Array, left: Array, right: Array, camera: Camera) -> tuple[Array, Array]:
    """The mean of the edges' angles, the near rim, the camera's offset: the package's way."""
    axis = camera.column((camera.bearing(left) + camera.bearing(right)) / 2)
    return range_bearing(height, axis, camera, HEIGHT, RADIUS, OFFSET)


def cosine_upside_down(height: Array, left: Array, right: Array, camera: Camera) -> tuple[Array, Array]:
    """The report's first formula, height ≈ (h f / d) cos θ, solved for d: a cosine on the wrong side."""
    d, theta = exact_reading(height, left, right, camera)
    return d * np.cos(theta) ** 2, theta


def mean_of_the_pixels(height: Array, left: Array, right: Array, camera: Camera) -> tuple[Array, Array]:
    """The axis at the mean of the two edge columns, as if a tangent were a straight line."""
    return range_bearing(height, (left + right) / 2, camera, HEIGHT, RADIUS, OFFSET)


def distance_to_the_front(height: Array, left: Array, right: Array, camera: Camera) -> tuple[Array, Array]:
    """A range that ends at the cylinder's near rim, where the tallest pixels are."""
    axis = camera.column((camera.bearing(left) + camera.bearing(right)) / 2)
    return range_bearing(height, axis, camera, HEIGHT, 0.0, OFFSET)


def seen_from_the_camera(height: Array, left: Array, right: Array, camera: Camera) -> tuple[Array, Array]:
    """Range and bearing from the camera, handed on as if the robot's centre had measured them."""
    axis = camera.column((camera.bearing(left) + camera.bearing(right)) / 2)
    return range_bearing(height, axis, camera, HEIGHT, RADIUS, 0.0)


def inverts_the_projection(reading: Reading) -> bool:
    """Project cylinders that stand all over the picture, read them back, and expect the truth to 1e-9."""
    rng = np.random.default_rng(lab_seed(2))
    d, theta = rng.uniform(0.8, 12, 200), rng.uniform(-0.45, 0.45, 200)
    seen = project_cylinder(d, theta, COURSE_CAMERA, HEIGHT, RADIUS, OFFSET)
    read_d, read_theta = reading(seen.height_px, seen.left_px, seen.right_px, COURSE_CAMERA)
    return bool(np.allclose(read_d, d, atol=1e-9) and np.allclose(read_theta, theta, atol=1e-9))


def readings() -> dict[str, Reading]:
    """The four wrong ones by their names."""
    wrong = (cosine_upside_down, mean_of_the_pixels, distance_to_the_front, seen_from_the_camera)
    return {reading.__name__: reading for reading in wrong}


_REPORT = "The cylinder report, assignment 2"
_AXIS = "The cylinder report, assignments 1 and 2"
Failure(
    "lab02.cosine_upside_down",
    f"{_REPORT}: height_px ≈ (h f / d) cos θ, beside a range formula that contradicts it.",
    cosine_upside_down, exact_reading, inverts_the_projection,
    "Straight ahead nobody notices; at the picture's edge a quarter of the range is gone.",
)  # fmt: skip
Failure(
    "lab02.mean_of_the_pixels",
    f"{_AXIS}: the axis as a mean of columns, below eight corners the midpoint of the outermost.",
    mean_of_the_pixels, exact_reading, inverts_the_projection,
    "The error grows towards the picture's edge and close by, always outwards.",
)  # fmt: skip
Failure(
    "lab02.distance_to_the_front",
    f"{_REPORT}: no radius in the range; its log is about 0.17 m short nearby.",
    distance_to_the_front, exact_reading, inverts_the_projection,
    "Every range is short by the radius and a little more off the optical axis, wherever the cylinder stands.",
)  # fmt: skip
Failure(
    "lab02.seen_from_the_camera",
    f"{_REPORT}: the camera's place on the robot is not in its formulas.",
    seen_from_the_camera, exact_reading, inverts_the_projection,
    "Ranges are short by the offset straight ahead, and bearings too wide on both sides.",
)  # fmt: skip
