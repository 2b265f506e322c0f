"""Lab 2's explorers: a cylinder from above and from the camera, and what a pixel costs."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.patches import Circle

from coursekit.gaussian import ellipse
from coursekit.geometry import Array
from coursekit.labs.lab02.runs import CORRECTIONS, HEIGHT, OFFSET, RADIUS, measure_perfectly, with_focal_length
from coursekit.pinhole import COURSE_CAMERA, project_cylinder, range_bearing, range_bearing_jacobian
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed
from coursekit.world.camera import CAMERA_HEIGHT


class FromAbove:
    """Left: robot, camera, cylinder and the rays to its two edges, from above.  Right: what lands on the sensor."""

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 4.2)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1.15, 1])
        top, picture = axes
        top.set(xlim=(-1.25, 1.25), ylim=(-0.75, 2.85), xlabel="left ←  y [m]  → right", ylabel="x, ahead [m]")
        top.set_aspect("equal")
        top.set_xticks([-1, 0, 1], ["1", "0", "−1"])
        plotting.draw_robot(top, [0, 0, np.pi / 2], colour=plotting.TRUTH, size=0.28)
        top.plot(0, OFFSET, "o", color=plotting.HIGHLIGHT, ms=5, zorder=6)
        top.annotate("camera", (0, OFFSET), xytext=(0.16, 0.02), color="#8a6000", fontsize=9)
        self.cylinder = top.add_patch(Circle((0, 1), RADIUS, facecolor=plotting.LANDMARK_COLOURS["cyan"], alpha=0.7))
        self.rays = [top.plot([], [], color=plotting.MEASUREMENT, lw=1)[0] for _ in range(2)]
        (self.truth,) = top.plot([], [], "+", color=plotting.TRUTH, ms=11, mew=2, zorder=7)
        (self.measured,) = top.plot([], [], "x", color=plotting.MEASUREMENT, ms=9, mew=2.4, zorder=8)
        self.title = top.set_title(" ")
        top.plot([], [], "+", color=plotting.TRUTH, ms=9, mew=2, label="true axis")
        top.plot([], [], "x", color=plotting.MEASUREMENT, ms=8, mew=2, label="measured axis")
        top.legend(loc="lower left", handletextpad=0.2)

        picture.set(xlim=(-0.5, 639.5), ylim=(479.5, -0.5), xlabel="u [px]", ylabel="v [px]")
        picture.set_aspect("equal")
        picture.grid(False)
        picture.axhline(COURSE_CAMERA.cy, color="#dddddd", lw=0.8)
        picture.axvline(COURSE_CAMERA.cx, color="#dddddd", lw=0.8)
        (self.outline,) = picture.fill([0, 1, 1], [0, 0, 1], color=plotting.LANDMARK_COLOURS["cyan"], alpha=0.7)
        (self.axis,) = picture.plot([], [], color=plotting.TRUTH, lw=1.4, ls="--")
        self.words = picture.set_title(" ")
        self.moving: list[Artist] = [
            self.cylinder, *self.rays, self.truth, self.measured, self.title, self.outline, self.axis, self.words
        ]  # fmt: skip

    def update(self, distance: float, bearing: float, correction: str) -> None:
        """Distance [m] and bearing [rad] of the axis from the robot's centre."""
        d, b = measure_perfectly(distance, bearing, **CORRECTIONS[correction])
        self.title.set_text(self.off(distance, bearing, correction))
        x, y = distance * np.cos(bearing), distance * np.sin(bearing)
        self.cylinder.center = (-y, x)
        self.truth.set_data([-y], [x])
        self.measured.set_data([-d * np.sin(b)], [d * np.cos(b)])
        phi, rho = np.arctan2(y, x - OFFSET), np.hypot(x - OFFSET, y)
        half, tangent = np.arcsin(RADIUS / rho), np.sqrt(rho**2 - RADIUS**2)
        for ray, angle in zip(self.rays, (phi + half, phi - half), strict=True):
            ray.set_data([0, -tangent * np.sin(angle)], [OFFSET, OFFSET + tangent * np.cos(angle)])
        self.outline.set_xy(outline(x - OFFSET, y))
        pixels = project_cylinder(distance, bearing, COURSE_CAMERA, HEIGHT, RADIUS, OFFSET)
        self.axis.set_data([pixels.axis_px, pixels.axis_px], [-0.5, 479.5])
        self.words.set_text(f"{pixels.height_px:.0f} px tall, axis at u = {pixels.axis_px:.0f}")

    @classmethod
    def facts(cls, distance: float, bearing: float, correction: str) -> dict[str, str]:
        """What the text reads from a frame."""
        return {"off": cls.off(distance, bearing, correction)}

    @staticmethod
    def off(distance: float, bearing: float, correction: str) -> str:
        """What a correction leaves of the error, in words."""
        d, b = measure_perfectly(distance, bearing, **CORRECTIONS[correction])
        along, aside = round(float(d - distance), 3) + 0.0, round(1e3 * float(b - bearing), 1) + 0.0  # no "-0.0"
        return f"off by {along:+.3f} m, {aside:+.1f} mrad".replace("-", "−")


def outline(x: float, y: float, eye: float = CAMERA_HEIGHT) -> Array:
    """The cylinder's outline in the picture, (n, 2) pixels: the hull of its two rims, as points of its surface."""
    from scipy.spatial import ConvexHull

    turn = np.linspace(0, 2 * np.pi, 90)
    rims = [
        np.stack([x + RADIUS * np.cos(turn), y + RADIUS * np.sin(turn), np.full_like(turn, z - eye)], axis=-1)
        for z in (0.0, HEIGHT)
    ]
    pixels = COURSE_CAMERA.project(np.concatenate(rims))
    return np.asarray(pixels[ConvexHull(pixels).vertices])


class WhatAPixelCosts:
    """Six hundred noisy pictures of one cylinder, as positions: the cloud, its linearised ellipse, r²/(L f)."""

    REACHES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)  # half the width of the left picture, m: it follows the cloud in steps

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 4.2)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1.2, 1])
        cloud, curve = axes
        cloud.set(xlabel="error along the ray [m]  (the scale changes)", ylabel="error across the ray [mm]")
        cloud.yaxis.set_major_formatter("{x:g}")
        cloud.yaxis.set_label_coords(-0.16, 0.5)  # where it has room beside the longest tick labels
        self.noise = np.random.default_rng(lab_seed(2)).standard_normal((600, 2))
        (self.dots,) = cloud.plot([], [], ".", color=plotting.MEASUREMENT, ms=3, alpha=0.35)
        (self.ellipse,) = cloud.plot([], [], color=plotting.ESTIMATE)
        (truth,) = cloud.plot(0, 0, "+", color=plotting.TRUTH, ms=11, mew=2)
        self.cloud = cloud
        self.title = cloud.set_title(" ")
        self.figure.legend([self.dots, self.ellipse], ["600 pictures", "95 % by the Jacobian"],
                           loc="outside lower center", ncols=2, markerscale=3)  # fmt: skip
        self.d = np.linspace(0.7, 12, 100)
        curve.set(
            xlim=(0, 12.5),
            ylim=(0, 1.15),
            xticks=range(0, 13, 2),
            xlabel="distance [m]",
            ylabel="range error of one pixel [m]",
        )
        (self.law,) = curve.plot([], [], color=plotting.ESTIMATE)
        (self.here,) = curve.plot([], [], "o", color=plotting.MEASUREMENT, ms=8)
        self.words = curve.set_title(" ")
        self.moving: list[Artist] = [
            cloud.xaxis, cloud.yaxis, self.dots, self.ellipse, truth, self.title,
            self.law, self.here, self.words
        ]  # fmt: skip

    def update(self, distance: float, pixel_noise: float, focal_length: int) -> None:
        """Distance [m] at a bearing of 0.15 rad; standard deviation of height and axis [px]; focal length [px]."""
        camera = with_focal_length(focal_length)
        pixels = project_cylinder(distance, 0.15, camera, HEIGHT, RADIUS, OFFSET)
        height = np.maximum(pixels.height_px + pixel_noise * self.noise[:, 0], 1.0)
        axis = pixels.axis_px + pixel_noise * self.noise[:, 1]
        correct: dict[str, Any] = {"landmark_height": HEIGHT, "radius": RADIUS, "camera_offset": OFFSET}
        d, b = range_bearing(height, axis, camera, **correct)
        J = range_bearing_jacobian(pixels.height_px, pixels.axis_px, camera, **correct) * pixel_noise
        J[1] *= distance  # an angle, as metres across the ray
        self.dots.set_data(d - distance, 1e3 * distance * (b - 0.15))
        along, across = ellipse(J @ J.T).T
        self.ellipse.set_data(along, 1e3 * across)
        needed = 1.3 * max(along.max(), 20 * across.max())  # across, a picture shows twenty times less than along
        reach = min((reach for reach in self.REACHES if reach >= needed), default=self.REACHES[-1])
        self.cloud.set(xlim=(-reach, reach), ylim=(-50 * reach, 50 * reach))
        spread = float(np.sqrt((J @ J.T)[0, 0]))
        self.title.set_text(f"at {distance:g} m: σ of the range {spread:.3f} m")
        law = self.d**2 / (HEIGHT * focal_length)
        self.law.set_data(self.d, law)
        cost = distance**2 / (HEIGHT * focal_length)
        self.here.set_data([distance], [cost])
        self.words.set_text(f"r²/(L f) = {cost:.3f} m a pixel")

    @staticmethod
    def words_for(distance: float, pixel_noise: float, focal_length: int) -> str:
        """The text alternative of a frame."""
        cost = distance**2 / (HEIGHT * focal_length)
        return (
            f"A cloud of position errors with its ellipse. One pixel of height costs {cost:.3f} m at {distance:g} m, "
            "a quarter of it at half the distance"
        )
