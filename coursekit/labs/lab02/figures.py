"""Lab 2's pictures: the geometry with its symbols, what each correction removes, four wrong readings."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Rectangle

from coursekit.geometry import Array
from coursekit.labs.lab02.failures import readings
from coursekit.labs.lab02.runs import HEIGHT, OFFSET, RADIUS, mean_pixel_bearing, photograph
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from coursekit.teaching import plotting

CYAN = plotting.LANDMARK_COLOURS["cyan"]


def question(distance: float, bearing: float, seed: int) -> Figure:
    """The view that the lab opens with."""
    fig = plotting.figure(6.4, 4.4)
    ax = plotting.axes(fig)
    ax.imshow(photograph(distance, bearing, seed)[..., ::-1])
    ax.grid(False)
    ax.set(title="The cylinder is half a metre tall. How far away is it?", xlabel="u [px]", ylabel="v [px]")
    return fig


def geometry() -> Figure:
    """Every symbol of the derivation: from above, and from the side.  Not to scale."""
    fig = plotting.figure(8.4, 4.4)
    above, side = plotting.axes(fig, 1, 2, width_ratios=[1, 1.25])
    _from_above(above)
    _from_the_side(side)
    for ax in (above, side):
        ax.set_aspect("equal")
        ax.axis("off")
    return fig


def _from_above(ax: Axes) -> None:
    """The plane of the floor, X up the page and Y to the left, as [right, up] = [-Y, X]."""
    o, X, Y, rho = 1.0, 2.6, 1.15, 0.36
    robot, camera, axis, foot = np.array([0, -o]), np.zeros(2), np.array([-Y, X]), np.array([0, X])
    r_c, phi_c, phi = np.hypot(X, Y), np.arctan2(Y, X), np.arctan2(Y, X + o)
    alpha = np.arcsin(rho / r_c)
    plotting.draw_robot(ax, [*robot, np.pi / 2], colour=plotting.TRUTH, size=0.42)
    ax.plot(*np.array([robot, [0, X + 0.5]]).T, color=plotting.ODOMETRY, lw=1, ls=(0, (6, 3)))
    ax.add_patch(Circle(tuple(axis), rho, facecolor=CYAN, alpha=0.55, edgecolor="none"))
    reach = np.sqrt(r_c**2 - rho**2)
    for sign in (1, -1):
        angle = phi_c + sign * alpha
        touch = reach * np.array([-np.sin(angle), np.cos(angle)])
        ax.plot(*(touch * np.array([[0.0], [1.25]])).T, color=plotting.MEASUREMENT, lw=1.2)
        ax.plot(*np.array([touch, axis]).T, color=plotting.TRUTH, lw=0.9, ls=":")
    ax.plot(*np.array([camera, axis]).T, color=plotting.ESTIMATE, lw=1.8)
    ax.plot(*np.array([robot, axis]).T, color=plotting.TRUTH, lw=1.8)
    ax.plot(*np.array([axis, foot]).T, color=plotting.ODOMETRY, lw=1.1)
    ax.plot(*camera, "o", color=plotting.HIGHLIGHT, ms=7, zorder=6)
    ax.plot(*axis, "+", color=plotting.TRUTH, ms=11, mew=2)
    for centre, size, angle in ((camera, 1.5, phi_c), (robot, 1.5, phi)):
        ax.add_patch(
            Arc(tuple(centre), size, size, theta1=90, theta2=90 + np.degrees(angle), color=plotting.TRUTH, lw=1)
        )
    turn = 90 + np.degrees(phi_c)
    ax.add_patch(Arc((0, 0), 3.4, 3.4, theta1=turn, theta2=turn + np.degrees(alpha), color=plotting.MEASUREMENT, lw=1))
    _dimension(ax, (0.85, 0), (0.85, X), "$X$", (0.95, X / 2))
    _dimension(ax, (0.85, -o), (0.85, 0), "$o$", (0.95, -o / 2))
    _write(ax, "$Y$", (-0.45, X + 0.12))
    _write(ax, r"$\rho$", (-0.28 - Y, X + 0.03))
    _write(ax, "$r_c$", (-0.78, 1.86), plotting.ESTIMATE)
    _write(ax, "$r$", (-0.88, 0.98))
    _write(ax, r"$\varphi_c$", (-0.27, 1.0))
    _write(ax, r"$\varphi$", (-0.42, -0.42))
    _write(ax, r"$\alpha$", (-1.12, 1.47), plotting.MEASUREMENT)
    _write(ax, "camera", (0.12, -0.06), "#8a6000", size=9.5)
    _write(ax, "robot's centre", (0.2, -o - 0.35), size=9.5)
    _write(ax, "optical axis", (0.07, X + 0.42), plotting.ODOMETRY, size=9.5)
    ax.set(xlim=(-2.0, 1.3), ylim=(-1.5, 3.45), title="From above")


def _from_the_side(ax: Axes) -> None:
    """The vertical plane through the rim's nearest point: ahead to the right, up."""
    focal, near, rho, eye, L = 1.1, 3.2, 0.45, 0.55, 1.6
    ax.plot([-0.3, 4.6], [0, 0], color=plotting.WALL, lw=1.4)
    ax.add_patch(Rectangle((near, 0), 2 * rho, L, facecolor=CYAN, alpha=0.55, edgecolor="none"))
    ax.plot([near + rho, near + rho], [0, L + 0.12], color=plotting.TRUTH, lw=1.2, ls="--")
    for z in (0.0, L):
        ax.plot([0, near], [eye, z], color=plotting.MEASUREMENT, lw=1.2)
        ax.plot(near, z, "o", color=plotting.MEASUREMENT, ms=4)
    ax.plot([0, near + 2 * rho + 0.3], [eye, eye], color=plotting.ODOMETRY, lw=1, ls=(0, (6, 3)))
    at = eye + (np.array([0.0, L]) - eye) * focal / near
    ax.plot([focal, focal], [0.12, 1.35], color=plotting.ODOMETRY, lw=1)
    ax.plot([focal, focal], at, color=plotting.ESTIMATE, lw=4, solid_capstyle="butt")
    ax.plot(0, eye, "o", color=plotting.HIGHLIGHT, ms=7, zorder=6)
    _write(ax, r"$\eta$", (focal - 0.22, eye + 0.08), plotting.ESTIMATE, size=13)
    _dimension(ax, (0, 1.5), (focal, 1.5), "$f_y$", (focal / 2 - 0.1, 1.6))
    _dimension(ax, (near + 2 * rho + 0.2, 0), (near + 2 * rho + 0.2, L), "$L$", (near + 2 * rho + 0.3, L / 2 + 0.1))
    _dimension(ax, (0, -0.3), (near, -0.3), r"$X - \rho$", (near / 2 - 0.3, -0.6))
    _dimension(ax, (near, -0.3), (near + rho, -0.3), r"$\rho$", (near + 0.14, -0.6))
    _dimension(ax, (0, -0.85), (near + rho, -0.85), "$X$", (near / 2, -1.15))
    _write(ax, "pinhole", (-0.35, eye - 0.32), "#8a6000", size=9.5)
    _write(ax, "image plane", (focal - 0.4, 1.75), plotting.ODOMETRY, size=9.5)
    _write(ax, "axis", (near + rho - 0.15, L + 0.17), size=9.5)
    ax.set(xlim=(-0.5, 4.75), ylim=(-1.35, 2.2), title="From the side")


def _dimension(ax: Axes, start: Any, end: Any, text: str, where: Any) -> None:
    ax.annotate(
        "", end, start, arrowprops={"arrowstyle": "<->", "color": plotting.TRUTH, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    )
    _write(ax, text, where)


def _write(ax: Axes, text: str, where: Any, colour: str = plotting.TRUTH, size: float = 12) -> None:
    ax.text(where[0], where[1], text, color=colour, fontsize=size)


def corrections_compared(r: Array, raw: Array, corrected: Array, predicted: Array, pixel: Array) -> Figure:
    """Range errors of rendered views, with and without corrections, over what geometry and a tenth of a pixel predict.

    All (n,), metres: true ranges, errors without and with the corrections, the predicted error of the former, and
    the error that a tenth of a pixel of height makes.
    """
    fig = plotting.figure(7.2, 3.9)
    ax = plotting.axes(fig)
    ax.fill_between(r, -pixel, pixel, color=plotting.BAND, alpha=0.18, lw=0, label="± a tenth of a pixel of height")
    ax.plot(r, predicted, color=plotting.TRUTH, lw=1, ls="--", label="predicted by the geometry")
    ax.plot(r, raw, ".", ms=5, color=plotting.MEASUREMENT, label="uncorrected")
    ax.plot(r, corrected, ".", ms=5, color=plotting.ESTIMATE, label="corrected")
    ax.set(xlabel="true range $r$ [m]", ylabel="measured − true range [m]")
    inside = np.mean(np.abs(corrected) < pixel)
    title = f"Uncorrected {1e3 * np.mean(raw):+.0f} mm on average; corrected, {100 * inside:.0f} % lie in the band"
    ax.set_title(title.replace("-", "−"))
    ax.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.18))
    return fig


def bearing_of_the_mean_pixel(distances: tuple[float, ...] = (0.7, 1.0, 2.0)) -> Figure:
    """How far the mean of the two edge columns points past the axis, over bearing, for a few distances."""
    fig = plotting.figure(7.2, 3.4)
    ax = plotting.axes(fig)
    bearing = np.linspace(-0.6, 0.6, 121)
    lines = [ax.plot(bearing, 1e3 * (mean_pixel_bearing(d, bearing) - bearing), label=f"{d:g} m")[0] for d in distances]
    plotting.label_lines(ax, lines)
    ax.axhline(0, color=plotting.TRUTH, lw=1.4, ls="--")
    ax.annotate("mean of the angles, at any distance", (-0.59, 0.4), color=plotting.TRUTH, va="bottom", fontsize=9.5)
    ax.set(xlabel=r"true bearing from the camera $\varphi_c$ [rad]", ylabel="bearing error [mrad]", xlim=(-0.6, 0.68))
    ax.set_title("The mean of the columns points too far out, most of all close by")
    return fig


def wrong_readings(r: float = 2.0) -> Figure:
    """Range and bearing errors of the four failures, over bearing, for a cylinder at range ``r`` [m]."""
    bearing = np.linspace(-0.45, 0.45, 91)
    seen = project_cylinder(r, bearing, COURSE_CAMERA, HEIGHT, RADIUS, OFFSET)
    fig = plotting.figure(7.6, 3.7)
    left, right = plotting.axes(fig, 1, 2)
    for name, reading in readings().items():
        r_read, bearing_read = reading(seen.height_px, seen.left_px, seen.right_px, COURSE_CAMERA)
        left.plot(bearing, r_read - r, label=name.replace("_", " "))
        right.plot(bearing, 1e3 * (bearing_read - bearing))
    left.set(xlabel="true bearing [rad]", ylabel="range error [m]", title="Range: two errors vanish straight ahead")
    right.set(xlabel="true bearing [rad]", ylabel="bearing error [mrad]", title="Bearing: all four vanish there")
    fig.legend(loc="outside lower center", ncols=2)
    return fig
