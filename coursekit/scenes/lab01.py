"""Lab 1's pictures: from the camera's view to mask, outline and axis; who hides whom; how corners lean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from coursekit import plotting
from coursekit.failures.lab01 import trust_what_is_not_skewed
from coursekit.geometry import Array
from coursekit.landmarks import LandmarkPixels, find_corners, measure, segment
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from coursekit.results import Rejected
from coursekit.world.arena import Cylinder
from coursekit.world.backdrop import Image
from coursekit.world.camera import CAMERA_HEIGHT, PAINT, View, render, visibility

HEIGHT, RADIUS = 0.5, 0.1  # of every landmark in the course, metres
HERE = np.zeros(3)
COLOUR = "cyan"


def at(distance: float, bearing: float, colour: str = COLOUR) -> Cylinder:
    """A landmark at a distance and bearing from the camera."""
    return Cylinder((distance * np.cos(bearing), distance * np.sin(bearing)), RADIUS, HEIGHT, colour)


def photograph(*cylinders: Cylinder, seed: int = 1, **settings: Any) -> Image:
    """The course's camera's view of landmarks; the same arguments, the same picture."""
    return render(COURSE_CAMERA, HERE, cylinders, rng=np.random.default_rng(seed), **settings)


def question() -> Figure:
    """A view of the lab, and one landmark's top edge so close that pixels show."""
    crowd = [at(2.4, 0.28), at(3.6, -0.05, "magenta"), at(1.6, -0.47, "yellow"), at(5.0, 0.1, "blue")]
    image = photograph(*crowd, blur=0.8)
    (view, *_) = visibility(COURSE_CAMERA, HERE, crowd)
    assert view is not None
    u, v, size = int(view.right_px), int(view.top_px), 9
    fig = plotting.figure(7.6, 3.5)
    picture, close = plotting.axes(fig, 1, 2, width_ratios=[1.75, 1])
    picture.imshow(image[..., ::-1])
    picture.add_patch(_frame(u, v, size))
    picture.set(title="Eight numbers would do for this picture", xticks=[], yticks=[])
    close.imshow(image[..., ::-1])
    close.set(xlim=(u - size, u + size), ylim=(v + size, v - size), title="Where does it end?")
    close.set(xlabel="u [pixels]", ylabel="v [pixels]", xticks=range(u - 8, u + 9, 4), yticks=range(v - 8, v + 9, 4))
    for ax in (picture, close):
        ax.grid(False)
    return fig


class Pipeline:
    """The camera's picture, the mask of the landmark's hue, the outline and the axis; with the truth beside it."""

    WIDE, TALL = 150, 240  # the close-ups, which always show the landmark at one size

    def __init__(self) -> None:
        self.figure = plotting.figure(7.6, 3.1)
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
        image = photograph(landmark, light=light, noise=noise)
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
        for title, text in zip(self.titles, (f"{distance:g} m away", "hue is cyan", "corners, axis"), strict=True):
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
        got = measure(find_corners(photograph(at(distance, bearing), light=light, noise=noise), COLOUR), COURSE_CAMERA)
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
        picture.set(xlabel="u [pixels]", ylabel="v [pixels]")
        picture.grid(False)
        above.set(xlim=(-0.75, 0.75), ylim=(-0.1, 6.4), xlabel="y [m], left is left", ylabel="x, ahead [m]")
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
        image = photograph(at(self.DISTANCE, 0.0), at(distance, aside, "magenta"))
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

    NAMES = ("mean of corners", "middle of edges", "mean of angles")
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
        self.picture.set(xlim=(-105, 105), ylim=(225, -225), xlabel="columns from the true axis [pixels]", yticks=[])
        self.picture.set_title("outline and corners")
        self.bars = bars.barh(self.NAMES, [0, 0, 0], color=colours, height=0.5)
        self.numbers = [bars.text(0, i, " ", va="center") for i in range(3)]
        bars.axvline(0, color=plotting.TRUTH, lw=1, ls=(0, (2, 2)))
        bars.set(xlim=(-95, 95), xlabel="axis off by [pixels]")
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
        self.title.set_text(f"{left} corners left, {right} right, {distance:g} m")

    @classmethod
    def words(cls, left: int, right: int, distance: float) -> str:
        """The text alternative of a frame."""
        offsets = cls.offsets(*cls.corners(left, right, distance))
        off = ", ".join(f"{name} {offset:+.1f}" for name, offset in zip(cls.NAMES, offsets, strict=True))
        return f"An outline with {left} corners on its left edge, {right} on its right. Pixels off the axis: {off}"

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


@dataclass(frozen=True)
class Seen:
    """One random view: what was true (None where the landmark is not in the picture), and what was measured."""

    distance: float
    truth: View | None
    got: LandmarkPixels | Rejected

    @property
    def kind(self) -> str:
        """Which of four things a view is, known from the world."""
        if self.truth is None:
            return "out of sight"
        if self.truth.cut:
            return "cut off"
        # A hundredth of the width is less than a pixel for all that is measured here.
        return "occluded" if self.truth.hidden > 0.01 else "whole"


def look_around(rng: np.random.Generator, views: int) -> list[Seen]:
    """Views of a landmark 0.7 to 12 m away, within ±0.6 rad, of any colour, in any light; half have a neighbour."""
    seen = []
    for k in range(views):
        heading, distance, bearing = rng.uniform(-np.pi, np.pi), rng.uniform(0.7, 12.0), rng.uniform(-0.6, 0.6)
        first, second = rng.permutation(list(PAINT))[:2]
        things = [at(distance, heading + bearing, str(first))]
        if k % 2:
            nearer = max(0.6, distance * rng.uniform(0.4, 0.9))
            things.append(at(nearer, heading + bearing + rng.uniform(-0.15, 0.15), str(second)))
        pose = np.array([0.0, 0.0, heading])
        settings: dict[str, Any] = {"light": rng.uniform(0.3, 1.2), "noise": rng.uniform(0, 5)}
        image = render(COURSE_CAMERA, pose, things, rng=rng, blur=rng.uniform(0.3, 1.0), **settings)
        truth = visibility(COURSE_CAMERA, pose, things)[0]
        seen.append(Seen(distance, truth, measure(find_corners(image, str(first)), COURSE_CAMERA)))
    return seen


def errors_over_distance(views: Sequence[Seen]) -> Figure:
    """Errors of height and axis of every whole landmark that was measured, over its distance."""
    rows = [
        (s.distance, s.got.height_px - s.truth.height_px, s.got.axis_px - s.truth.axis_px)
        for s in views
        if s.kind == "whole" and s.truth is not None and isinstance(s.got, LandmarkPixels)
    ]
    distance, height, axis = np.array(rows).T
    fig = plotting.figure(7.2, 3.6)
    axes: Any = plotting.axes(fig, 1, 2, sharey=True)
    for ax, error, limit, name in zip(axes, (height, axis), (1.0, 0.5), ("height", "axis"), strict=True):
        ax.axhspan(-limit, limit, color=plotting.BAND, alpha=0.15, lw=0)
        ax.plot(distance, error, ".", color=plotting.MEASUREMENT, ms=4, alpha=0.6)
        ax.set(xlabel="distance [m]", ylim=(-1.3, 1.3), title=f"{name}: median {np.median(np.abs(error)):.3f} px off")
    axes[0].set_ylabel("measured − true [pixels]")
    return fig


def close_up_of_an_edge(share: Array, edge: float) -> Figure:
    """Covered shares along a line of pixels as bars, and the step that has the same area."""
    fig = plotting.figure(6.4, 2.9)
    ax = plotting.axes(fig)
    ax.bar(np.arange(len(share)), share, width=1.0, color=plotting.LANDMARK_COLOURS[COLOUR], edgecolor="white")
    ax.plot([-0.5, edge, edge, len(share) - 0.5], [1, 1, 0, 0], color=plotting.TRUTH, lw=1.6)
    ax.set(xlabel="pixel along the line", ylabel="covered share", xlim=(-0.5, len(share) - 0.5))
    ax.set_title(f"The step at {edge:.2f} has the area of all the bars")
    return fig


def sliding_out() -> Figure:
    """A landmark slides out of the picture: the axis that a skew check lets through, and where ``measure`` stops."""
    bearings, off, refused = np.linspace(0.44, 0.56, 49), [], []
    for bearing in bearings:
        image, landmark = photograph(at(2.0, bearing)), project_cylinder(2.0, bearing, COURSE_CAMERA, HEIGHT, RADIUS)
        corners = find_corners(image, COLOUR)
        passed = len(corners) > 0 and trust_what_is_not_skewed(corners)
        off.append(float(corners[:, 0].min() + corners[:, 0].max()) / 2 - float(landmark.axis_px) if passed else np.nan)
        refused.append(not measure(corners, COURSE_CAMERA))
    fig = plotting.figure(7.2, 3.4)
    ax = plotting.axes(fig)
    ax.plot(bearings, off, color=plotting.MEASUREMENT, label="middle of what is seen: not skewed, so trusted")
    ax.fill_between(bearings, -3, 26, where=refused, color=plotting.BAND, alpha=0.18, lw=0, label="rejected by measure")
    ax.axhline(0, color=plotting.TRUTH, lw=1, ls="--")
    ax.set(xlabel="true bearing [rad]", ylabel="axis off by [pixels]", ylim=(-3, 26), xlim=(bearings[0], bearings[-1]))
    ax.set_title("Half a cylinder is as upright as a whole one, and its middle is somewhere else")
    ax.legend(loc="upper left")
    return fig


def _short(got: LandmarkPixels | Rejected) -> str:
    return got.reason.split(":")[0] if isinstance(got, Rejected) else ""


def _frame(u: int, v: int, size: int) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((u - size, v - size), 2 * size, 2 * size, fill=False, edgecolor="white", lw=1.4)
