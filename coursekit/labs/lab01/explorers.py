"""Lab 1's explorers: from the camera's view to mask, outline and axis; who hides whom; how corners lean."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from matplotlib.artist import Artist

from coursekit.geometry import Array
from coursekit.labs.lab01.runs import COLOUR, HEIGHT, HERE, RADIUS, at, photograph
from coursekit.landmarks import LandmarkPixels, find_corners, measure, segment
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from coursekit.results import Rejected
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed
from coursekit.world.backdrop import Image
from coursekit.world.camera import CAMERA_HEIGHT, visibility


class Pipeline:
    """The camera's picture, the mask of the landmark's hue, the outline and the axis; with the truth beside it."""

    WIDE, TALL = 150, 240  # the close-ups, which always show the landmark at one size

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 3.1)
        layout: Any = self.figure.get_layout_engine()
        layout.set(h_pad=0.08)  # the axes fill the height: room for the titles' ascenders
        axes: Any = plotting.axes(self.figure, 1, 3, width_ratios=[2.05, 1, 1])
        picture, mask, close = axes
        blank = np.zeros((self.TALL, self.WIDE, 3), np.uint8)
        self.picture = picture.imshow(np.zeros((240, 320, 3), np.uint8), extent=(-0.5, 639.5, 479.5, -0.5))
        self.mask = mask.imshow(blank[..., 0], cmap="gray", vmin=0, vmax=255)
        self.close = close.imshow(blank)
        (self.axis_far,) = picture.plot([], [], color=plotting.ESTIMATE, lw=1.2)
        (self.axis,) = close.plot([], [], color=plotting.ESTIMATE, lw=1.6)
        (self.corners,) = close.plot([], [], "o", color=plotting.MEASUREMENT, ms=4.5, mec="white", mew=0.6)
        self.titles = [ax.set_title(" ") for ax in axes]
        paper = {"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 3}
        self.words = picture.text(0.02, 0.03, " ", transform=picture.transAxes, va="bottom", bbox=paper)
        self.words.set_in_layout(False)  # a long sentence would push the axes out of the figure
        picture.set(xlim=(-0.5, 639.5), ylim=(479.5, -0.5))
        for ax in axes:
            ax.set(xticks=[], yticks=[])
            ax.grid(False)
        for ax in axes[1:]:
            ax.set(xlim=(-0.5, self.WIDE - 0.5), ylim=(self.TALL - 0.5, -0.5))
        self.moving: list[Artist] = [
            self.picture, self.mask, self.close, self.axis_far, self.axis, self.corners, self.words, *self.titles
        ]  # fmt: skip

    def update(self, distance: float, bearing: float, light: float, noise: float) -> None:
        """Distance [m] and bearing [rad] from the camera; brightness; the noise's σ in grey levels."""
        landmark = at(distance, bearing)
        image = photograph(landmark, seed=lab_seed(1), light=light, noise=noise)
        corners = find_corners(image, COLOUR)
        got = measure(corners, COURSE_CAMERA)
        to_close_up, scale = self._window(distance, bearing)
        size = (self.WIDE, self.TALL)
        hsv = cv2.cvtColor(cv2.GaussianBlur(image, (3, 3), 0), cv2.COLOR_BGR2HSV)
        self.picture.set_data(cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)[..., ::-1])
        nearest: dict[str, Any] = {"flags": cv2.INTER_NEAREST, "borderValue": (225, 225, 225)}
        self.close.set_data(cv2.warpAffine(image, to_close_up, size, **nearest)[..., ::-1])
        self.mask.set_data(cv2.warpAffine(segment(hsv, COLOUR), to_close_up, size, **nearest))
        self.corners.set_data(*(corners @ to_close_up[:, :2].T + to_close_up[:, 2]).T)
        (truth,) = visibility(COURSE_CAMERA, HERE, [landmark])
        self.axis.set_data([], [])
        self.axis_far.set_data([], [])
        if isinstance(got, LandmarkPixels):
            # A gap where the landmark is: far away, the line would cover it.
            ends = [-0.5, np.nanmin(corners[:, 1]) - 15, np.nan, np.nanmax(corners[:, 1]) + 15, 479.5]
            self.axis_far.set_data([got.axis_px] * 5, np.clip(ends, -0.5, 479.5))
            self.axis.set_data([got.axis_px * scale + to_close_up[0, 2]] * 2, [-0.5, self.TALL - 0.5])
            assert truth is not None
            words = (f"height {got.height_px:.2f} px, true {truth.height_px:.2f}\n"
                     f"axis {got.axis_px:.2f} px, true {truth.axis_px:.2f}")  # fmt: skip
        else:
            words = "rejected: " + got.reason.split(":")[0]
        self.words.set_text(words)
        for title, text in zip(
            self.titles, (f"{distance:g} m away", "hue is cyan", "outline points, axis"), strict=True
        ):
            title.set_text(text)

    def _window(self, distance: float, bearing: float) -> tuple[Array, float]:
        """The affine map from the picture to a close-up that holds the landmark, and its scale."""
        pixels = project_cylinder(distance, bearing, COURSE_CAMERA, HEIGHT, RADIUS)
        scale = self.TALL / (1.3 * float(pixels.height_px))
        x = distance * np.cos(bearing) - RADIUS
        middle = COURSE_CAMERA.cy + COURSE_CAMERA.fy * (CAMERA_HEIGHT - HEIGHT / 2) / x
        shift = [self.WIDE / 2 - scale * float(pixels.axis_px), self.TALL / 2 - scale * middle]
        return np.array([[scale, 0, shift[0]], [0, scale, shift[1]]]), scale

    @staticmethod
    def alt(distance: float, bearing: float, light: float, noise: float) -> str:
        """What a frame shows."""
        got = measure(
            find_corners(photograph(at(distance, bearing), seed=lab_seed(1), light=light, noise=noise), COLOUR),
            COURSE_CAMERA,
        )
        verdict = f"measured as {got.height_px:.1f} pixels tall" if isinstance(got, LandmarkPixels) else got.reason
        return f"A cyan cylinder {distance:g} m away in the camera's picture, its mask, its outline; {verdict}"


class WhoIsInFront:
    """A cyan landmark 3 m away and a magenta one that may stand before it, beside it, or behind it."""

    DISTANCE = 3.0
    _LEFT, _TOP, _SIDE = 210, 130, 220  # what is shown of the picture, pixels

    def __init__(self) -> None:
        self.figure = plotting.figure(7.2, 4.0)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1.15, 1])
        picture, above = axes
        left, top, side = self._LEFT, self._TOP, self._SIDE
        self.picture = picture.imshow(
            np.zeros((side, side, 3), np.uint8), extent=(left - 0.5, left + side - 0.5, top + side - 0.5, top - 0.5)
        )
        (self.corners,) = picture.plot([], [], "o", color=plotting.MEASUREMENT, ms=5, mec="white", mew=0.7)
        self.floor_lines = [
            picture.plot([], [], color=plotting.LANDMARK_COLOURS[name], lw=1.4, ls="--")[0]
            for name in (COLOUR, "magenta")
        ]
        picture.set(xlim=(left - 0.5, left + side - 0.5), ylim=(top + side - 0.5, top - 0.5))
        picture.set(xlabel="u [px]", ylabel="v [px]")
        picture.grid(False)
        above.set(xlim=(-0.75, 0.75), ylim=(-0.1, 6.4), xlabel="y, to the left [m]", ylabel="x, ahead [m]")
        above.set_xticks([-0.5, 0, 0.5], ["0.5", "0", "−0.5"])
        plotting.draw_robot(above, [0, 0, np.pi / 2], colour=plotting.TRUTH, size=0.3)
        above.plot(0, self.DISTANCE, "o", color=plotting.LANDMARK_COLOURS[COLOUR], ms=12)
        (self.neighbour,) = above.plot([], [], "o", color=plotting.LANDMARK_COLOURS["magenta"], ms=12)
        self.rays = above.plot([], [], color="#bbbbbb", lw=0.9)[0]
        self.titles = [ax.set_title(" ") for ax in axes]
        self.moving: list[Artist] = [
            self.picture, self.corners, *self.floor_lines, self.rays, self.neighbour, *self.titles
        ]  # fmt: skip

    def look(self, aside: float, distance: float) -> tuple[Image, Array, LandmarkPixels | Rejected]:
        """Picture, corners and measurement with the neighbour ``aside`` rad to the left, ``distance`` m away."""
        image = photograph(at(self.DISTANCE, 0.0), at(distance, aside, "magenta"), seed=lab_seed(1))
        corners = find_corners(image, COLOUR)
        return image, corners, measure(corners, COURSE_CAMERA)

    def update(self, aside: float, distance: float) -> None:
        """The neighbour's bearing [rad] and distance [m]."""
        image, corners, got = self.look(aside, distance)
        left, top, side = self._LEFT, self._TOP, self._SIDE
        self.picture.set_data(image[top : top + side, left : left + side, ::-1])
        self.corners.set_data(*corners.T)
        for line, x in zip(self.floor_lines, (self.DISTANCE, distance * np.cos(aside)), strict=True):
            row = COURSE_CAMERA.cy + COURSE_CAMERA.fy * CAMERA_HEIGHT / (x - RADIUS)
            line.set_data([left, left + side], [row, row])
        self.neighbour.set_data([-distance * np.sin(aside)], [distance * np.cos(aside)])
        half = np.arcsin(RADIUS / self.DISTANCE)
        self.rays.set_data([-6.4 * np.tan(half), 0, 6.4 * np.tan(half)], [6.4, 0, 6.4])
        self.titles[0].set_text("measured" if got else "rejected: " + _short(got))
        self.titles[1].set_text(f"cyan: {self.DISTANCE:g} m, magenta: {distance:g} m")

    def alt(self, aside: float, distance: float) -> str:
        """What a frame shows."""
        *_, got = self.look(aside, distance)
        verdict = "the cyan one is measured" if got else f"the cyan one is rejected, {_short(got)}"
        side = f"{abs(aside):g} rad to its {'left' if aside > 0 else 'right'}" if aside else "in the same direction"
        return f"A cyan cylinder at {self.DISTANCE:g} m and, {side}, a magenta one at {distance:g} m; {verdict}"


class Lean:
    """One outline, more corners on one side than on the other, and three rules for its axis."""

    NAMES = ("mean of points", "middle of edges", "mean of angles")
    _BEARING = -0.4

    def __init__(self) -> None:
        self.figure = plotting.figure(7.2, 4.0)
        axes: Any = plotting.axes(self.figure, 1, 2, width_ratios=[1, 1.1])
        self.picture, bars = axes
        colours = [plotting.MEASUREMENT, plotting.HIGHLIGHT, plotting.ESTIMATE]
        (self.shape,) = self.picture.fill([0, 1, 1], [0, 0, 1], color=plotting.LANDMARK_COLOURS[COLOUR], alpha=0.45)
        (self.dots,) = self.picture.plot([], [], "o", color=plotting.TRUTH, ms=4)
        self.lines = [self.picture.plot([], [], color=colour, lw=1.6)[0] for colour in colours]
        (self.true,) = self.picture.plot([], [], color=plotting.TRUTH, lw=1.2, ls=(0, (2, 2)))
        self.picture.set(xlim=(-105, 105), ylim=(225, -225), xlabel="columns from the true axis [px]", yticks=[])
        self.picture.set_title("outline and its points")
        self.bars = bars.barh(self.NAMES, [0, 0, 0], color=colours, height=0.5)
        self.numbers = [bars.text(0, i, " ", va="center") for i in range(3)]
        bars.axvline(0, color=plotting.TRUTH, lw=1, ls=(0, (2, 2)))
        bars.set(xlim=(-125, 125), xlabel="axis off by [px]")
        bars.invert_yaxis()
        self.title = bars.set_title(" ")
        self.moving: list[Artist] = [
            self.shape,
            self.dots,
            *self.lines,
            self.true,
            *self.bars,
            *self.numbers,
            self.title,
        ]

    def update(self, left: int, right: int, distance: float) -> None:
        """How many corners lie on either edge, two of them at its ends; distance of the landmark [m]."""
        corners, axis = self.corners(left, right, distance)
        offsets = self.offsets(corners, axis)
        outline = self.corners(2, 2, distance)[0]
        self.shape.set_xy(outline[[0, 1, 3, 2]] - [axis, 0])
        self.dots.set_data(*(corners - [axis, 0]).T)
        for line, bar, number, offset in zip(self.lines, self.bars, self.numbers, offsets, strict=True):
            line.set_data([offset, offset], [-225, 225])
            bar.set_width(offset)
            number.set_text(f"{offset:+.1f}")
            number.set_x(offset + (3 if offset >= 0 else -3))
            number.set_horizontalalignment("left" if offset >= 0 else "right")
        self.true.set_data([0, 0], [-225, 225])
        self.title.set_text(f"{left} points left, {right} right, {distance:g} m")

    @classmethod
    def words(cls, left: int, right: int, distance: float) -> str:
        """The text alternative of a frame."""
        offsets = cls.offsets(*cls.corners(left, right, distance))
        off = ", ".join(f"{name} {offset:+.1f}" for name, offset in zip(cls.NAMES, offsets, strict=True))
        return f"An outline with {left} points on its left edge, {right} on its right. Pixels off the axis: {off}"

    @classmethod
    def corners(cls, left: int, right: int, distance: float) -> tuple[Array, float]:
        """Corners (left + right, 2), with v counted from the middle, and the true axis."""
        pixels = project_cylinder(distance, cls._BEARING, COURSE_CAMERA, HEIGHT, RADIUS)
        half = float(pixels.height_px) / 2
        edges = [
            np.c_[np.full(count, edge), np.linspace(-half, half, count)]
            for count, edge in ((left, pixels.left_px), (right, pixels.right_px))
        ]
        return np.vstack(edges), float(pixels.axis_px)

    @staticmethod
    def offsets(corners: Array, axis: float) -> list[float]:
        """How far each of the three rules is off, pixels."""
        ends = corners[:, 0].min(), corners[:, 0].max()
        angles = COURSE_CAMERA.bearing(ends)
        return [float(c - axis) for c in (corners[:, 0].mean(), np.mean(ends), COURSE_CAMERA.column(angles.mean()))]


def _short(got: LandmarkPixels | Rejected) -> str:
    return got.reason.split(":")[0] if isinstance(got, Rejected) else ""
