"""Lab 1's pictures: the question, the geometry, an edge close up, errors over distance, a landmark that slides out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coursekit.geometry import Array
from coursekit.labs.lab01.failures import trust_what_is_not_skewed
from coursekit.labs.lab01.runs import COLOUR, HEIGHT, HERE, RADIUS, Seen, at, errors_of, photograph
from coursekit.landmarks import find_corners, measure
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed
from coursekit.world.camera import visibility


def question() -> Figure:
    """A view of the lab, and one landmark's top edge so close that pixels show."""
    crowd = [at(2.4, 0.28), at(3.6, -0.05, "magenta"), at(1.6, -0.47, "yellow"), at(5.0, 0.1, "blue")]
    image = photograph(*crowd, seed=lab_seed(1), blur=0.8)
    (view, *_) = visibility(COURSE_CAMERA, HERE, crowd)
    assert view is not None
    u, v, size = int(view.right_px), int(view.top_px), 9
    fig = plotting.figure(7.6, 3.5)
    picture, close = plotting.axes(fig, 1, 2, width_ratios=[1.75, 1])
    picture.imshow(image[..., ::-1])
    picture.add_patch(_frame(u, v, size))
    picture.set(title="What the robot's camera sees", xticks=[], yticks=[])
    close.imshow(image[..., ::-1])
    close.set(xlim=(u - size, u + size), ylim=(v + size, v - size), title="Where does the cylinder end?")
    close.set(xlabel="u [px]", ylabel="v [px]", xticks=range(u - 8, u + 9, 4), yticks=range(v - 8, v + 9, 4))
    for ax in (picture, close):
        ax.grid(False)
    return fig


def geometry() -> Figure:
    """The pinhole from the side, and the image of a cylinder with every symbol of the derivation.  Not to scale."""
    fig = plotting.figure(8.4, 4.0)
    side, image = plotting.axes(fig, 1, 2, width_ratios=[1.25, 1])
    _pinhole(side)
    _cylinder(image)
    for ax in (side, image):
        ax.axis("off")
    return fig


def _pinhole(ax: Axes) -> None:
    """The plane of the optical axis: X ahead to the right, Z up, the image plane drawn in front of the pinhole."""
    focal, X, Z = 1.2, 3.6, 1.35
    ax.plot([-0.2, 4.3], [0, 0], color=plotting.ODOMETRY, lw=1, ls=(0, (6, 3)))
    ax.plot([focal, focal], [-0.5, 1.2], color=plotting.ODOMETRY, lw=1)
    ax.plot([0, X], [0, Z], color=plotting.MEASUREMENT, lw=1.5)
    ax.plot([X, X], [0, Z], color=plotting.TRUTH, lw=1.2)
    ax.plot([focal, focal], [0, Z * focal / X], color=plotting.ESTIMATE, lw=4, solid_capstyle="butt")
    ax.plot(X, Z, "o", color=plotting.TRUTH, ms=7)
    ax.plot(0, 0, "o", color=plotting.HIGHLIGHT, ms=8, zorder=6)
    _arrow(ax, (0, -0.35), (focal, -0.35), "$f_y$", (focal / 2 - 0.1, -0.65))
    _arrow(ax, (0, -0.9), (X, -0.9), "$X$", (X / 2, -1.2))
    _write(ax, "$Z$", (X + 0.12, Z / 2))
    _write(ax, "$c_y - v$", (focal - 0.78, 0.5), plotting.ESTIMATE)
    _write(ax, "pinhole", (-0.35, 0.2), "#8a6000", 9.5)
    _write(ax, "image plane", (focal - 0.45, 1.3), plotting.ODOMETRY, 9.5)
    _write(ax, "optical axis", (X - 0.1, -0.28), plotting.ODOMETRY, 9.5)
    _write(ax, "point", (X - 0.25, Z + 0.16), plotting.TRUTH, 9.5)
    ax.set_aspect("equal")
    ax.set(xlim=(-0.5, 4.7), ylim=(-1.35, 1.75), title="The pinhole, from the side")


def _cylinder(ax: Axes) -> None:
    """An outline with strongly curved rims; rows and columns in units of the half width."""
    left, right, a_top, a_bottom, b, c = -1.0, 1.0, 0.0, 2.6, 0.12, 0.42
    s = np.linspace(-1, 1, 201)
    root = np.sqrt(1 - s**2)
    top, bottom = a_top + b * s - c * root, a_bottom - b * s + c * root
    ax.fill(np.r_[s, s[::-1]], np.r_[top, bottom[::-1]], color=plotting.LANDMARK_COLOURS[COLOUR], alpha=0.45, lw=0)
    for rim in (top, bottom):
        ax.plot(s, rim, color=plotting.MEASUREMENT, lw=1.8)
    ax.plot(s, a_top + b * s, color=plotting.TRUTH, lw=1, ls=":")
    for side in (left, right):
        ax.plot([side, side], [a_top + b * side, a_bottom - b * side], color=plotting.MEASUREMENT, lw=1.8)
    high, low = a_top - np.hypot(b, c), a_bottom + np.hypot(b, c)
    for row in (high, low):
        ax.plot([-0.3, 1.5], [row, row], color=plotting.ODOMETRY, lw=0.9, ls="--")
    ax.plot([0.06, 0.06], [-0.8, low + 0.3], color=plotting.ESTIMATE, lw=1.5)
    _arrow(ax, (1.4, high), (1.4, low), r"$\eta$", (1.48, (high + low) / 2))
    _arrow(ax, (-0.07, 0.0), (-0.07, -c), "$a_2$", (-0.33, -0.13))
    _write(ax, r"$a_0 + a_1\zeta$", (0.2, 0.3))
    _write(ax, "$u_a$", (0.02, -0.88), plotting.ESTIMATE)
    _write(ax, r"$\zeta=-1$", (left - 0.3, a_bottom + 0.5), size=10)
    _write(ax, r"$\zeta=1$", (right - 0.1, a_bottom + 0.4), size=10)
    _write(ax, r"$u_\mathrm{left}$", (left - 0.55, 1.3), plotting.MEASUREMENT)
    _write(ax, r"$u_\mathrm{right}$", (right - 0.48, 1.3), plotting.MEASUREMENT)
    _write(ax, r"$v_\mathrm{top}$", (1.52, high + 0.05), plotting.ODOMETRY)
    _write(ax, r"$v_\mathrm{bottom}$", (1.52, low + 0.05), plotting.ODOMETRY)
    ax.set(xlim=(-1.7, 2.3), ylim=(low + 0.45, -1.25), title="A close cylinder in the image")


def _arrow(ax: Axes, start: Any, end: Any, text: str, where: Any) -> None:
    style = {"arrowstyle": "<->", "color": plotting.TRUTH, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=style)
    _write(ax, text, where)


def _write(ax: Axes, text: str, where: Any, colour: str = plotting.TRUTH, size: float = 12) -> None:
    ax.text(where[0], where[1], text, color=colour, fontsize=size)


def errors_over_distance(views: Sequence[Seen]) -> Figure:
    """Errors of height and axis of every whole landmark that was measured, over its distance, with their means."""
    distance, *errors = errors_of(views).T
    fig = plotting.figure(7.6, 3.8)
    axes: Any = plotting.axes(fig, 1, 2)
    for ax, error, name in zip(axes, errors, ("height", "axis"), strict=True):
        ax.plot(distance, error, ".", color=plotting.MEASUREMENT, ms=4, alpha=0.45, label="one view")
        ax.axhline(0, color=plotting.TRUTH, lw=1)
        for low in range(0, 12, 2):
            here = error[(distance >= low) & (distance < low + 2)]
            if len(here) > 4:
                spread = 2 * here.std(ddof=1) / np.sqrt(len(here))
                ax.errorbar(low + 1, here.mean(), spread, fmt="o", color=plotting.ESTIMATE, capsize=3, ms=5,
                            label="mean over 2 m of distance, ± 2 standard errors" if low == 10 else None)  # fmt: skip
        reach = 1.15 * np.quantile(np.abs(error), 0.995)
        ax.set(xlabel="distance [m]", ylabel=f"{name}: measured − true [px]", ylim=(-reach, reach))
        ax.set_title(f"{name}: median |error| {np.median(np.abs(error)):.3f} px")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def close_up_of_an_edge(share: Array, edge: float) -> Figure:
    """Covered shares along a line of pixels as bars, and the step that has the same area."""
    fig = plotting.figure(6.4, 2.9)
    ax = plotting.axes(fig)
    ax.bar(np.arange(len(share)), share, width=1.0, color=plotting.LANDMARK_COLOURS[COLOUR], edgecolor="white")
    ax.plot([-0.5, edge, edge, len(share) - 0.5], [1, 1, 0, 0], color=plotting.TRUTH, lw=1.6)
    ax.set(xlabel="pixel along the line", ylabel="covered share", xlim=(-0.5, len(share) - 0.5))
    ax.set_title(f"The black step ends at {edge:.2f}: its area is that of all the bars")
    return fig


def sliding_out() -> Figure:
    """A landmark slides out of the picture: the axis that a skew check lets through, and where ``measure`` stops."""
    bearings, off, refused = np.linspace(0.44, 0.56, 31), [], []
    for bearing in bearings:
        image, landmark = (
            photograph(at(2.0, bearing), seed=lab_seed(1)),
            project_cylinder(2.0, bearing, COURSE_CAMERA, HEIGHT, RADIUS),
        )
        corners = find_corners(image, COLOUR)
        passed = len(corners) > 0 and trust_what_is_not_skewed(corners)
        off.append(float(corners[:, 0].min() + corners[:, 0].max()) / 2 - float(landmark.axis_px) if passed else np.nan)
        refused.append(not measure(corners, COURSE_CAMERA))
    fig = plotting.figure(7.2, 3.4)
    ax = plotting.axes(fig)
    ax.plot(bearings, off, color=plotting.MEASUREMENT, label="middle of what is seen: not skewed, so trusted")
    ax.fill_between(bearings, -3, 26, where=refused, color=plotting.BAND, alpha=0.18, lw=0, label="rejected by measure")
    ax.axhline(0, color=plotting.TRUTH, lw=1, ls="--")
    ax.set(xlabel="true bearing [rad]", ylabel="axis off by [px]", ylim=(-3, 26), xlim=(bearings[0], bearings[-1]))
    ax.set_title("The skew check lets a cut cylinder through, with its axis many pixels off")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    return fig


def _frame(u: int, v: int, size: int) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((u - size, v - size), 2 * size, 2 * size, fill=False, edgecolor="white", lw=1.4)
