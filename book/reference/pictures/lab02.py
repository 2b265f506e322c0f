"""Lab 2's failures, drawn: each wrong reading's error over the bearing, for a cylinder at 2 m."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from coursekit.labs.lab02 import failures
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from reference.pictures.paper import RIGHT, WRONG, two


def _errors(reading: failures.Reading) -> Figure:
    fig, axes = two("range", "bearing")
    theta = np.linspace(-0.45, 0.45, 91)
    seen = project_cylinder(2.0, theta, COURSE_CAMERA, failures.HEIGHT, failures.RADIUS, failures.OFFSET)
    for read, colour, name in ((reading, WRONG, "the mistake"), (failures.exact_reading, RIGHT, "sound")):
        r, phi = read(seen.height_px, seen.left_px, seen.right_px, COURSE_CAMERA)
        axes[0].plot(theta, 100 * (r - 2.0), color=colour, lw=2, label=name)
        axes[1].plot(theta, 1e3 * (phi - theta), color=colour, lw=2, label=name)
    for ax, what in zip(axes, ("range error [cm]", "bearing error [mrad]"), strict=True):
        ax.set_title("")
        ax.set(xlabel="true bearing [rad]", ylabel=what)
    axes[0].legend()
    low, high = axes[1].get_ylim()
    axes[1].set_ylim(min(low, -1.0), max(high, 1.0))
    return fig


def cosine_upside_down() -> Figure:
    """Straight ahead the range is right; at the sides the cosine takes up to two fifths of a metre from it."""
    return _errors(failures.cosine_upside_down)


def mean_of_the_pixels() -> Figure:
    """The middle of the two edges in pixels is not the middle in angle: the bearing errs outwards, more at the side."""
    return _errors(failures.mean_of_the_pixels)


def distance_to_the_front() -> Figure:
    """The range ends at the near rim: it is one radius short, wherever the cylinder stands."""
    return _errors(failures.distance_to_the_front)


def seen_from_the_camera() -> Figure:
    """Measured from the camera instead of the robot's centre: the range is short, the bearing too wide."""
    return _errors(failures.seen_from_the_camera)
