"""Lab 2's landmark and camera: photographs, and what is measured without noise, with and without each correction."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from coursekit.geometry import Array
from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder, range_bearing
from coursekit.world.arena import Cylinder
from coursekit.world.backdrop import Image
from coursekit.world.camera import render

HEIGHT, RADIUS, OFFSET = 0.5, 0.1, 0.07  # the course's cylinder and how far ahead of the axle the camera stands, m
CORRECTIONS = {
    "none": {"radius": 0.0, "camera_offset": 0.0},
    "radius": {"radius": RADIUS, "camera_offset": 0.0},
    "both": {"radius": RADIUS, "camera_offset": OFFSET},
}


def photograph(distance: float, bearing: float, seed: int) -> Image:
    """The robot's camera's view of the cylinder at a range [m] and bearing [rad] from the robot's centre."""
    position = distance * np.cos(bearing) - OFFSET, distance * np.sin(bearing)
    cylinder = Cylinder(position, RADIUS, HEIGHT, "cyan")
    return render(COURSE_CAMERA, np.zeros(3), [cylinder], rng=np.random.default_rng(seed))


def with_focal_length(f: float) -> Camera:
    """The course's camera behind a lens of another focal length, pixels."""
    return replace(COURSE_CAMERA, fx=f, fy=f)


def mean_pixel_bearing(distance: Any, bearing: Any, camera: Camera = COURSE_CAMERA) -> Array:
    """What the mean of the two edge *pixels* says the bearing is; distance and bearing from the camera."""
    pixels = project_cylinder(distance, bearing, camera, HEIGHT, RADIUS)
    return camera.bearing((pixels.left_px + pixels.right_px) / 2)


def measure_perfectly(distance: Any, bearing: Any, **correction: float) -> tuple[Array, Array]:
    """Range and bearing out of a picture without noise: the truth, plus whatever ``correction`` leaves out."""
    pixels = project_cylinder(distance, bearing, COURSE_CAMERA, HEIGHT, RADIUS, OFFSET)
    return range_bearing(pixels.height_px, pixels.axis_px, COURSE_CAMERA, HEIGHT, **correction)
