"""Lab 1's failures, drawn."""

from __future__ import annotations

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coursekit.labs.lab01 import failures
from coursekit.pinhole import COURSE_CAMERA, project_cylinder
from coursekit.world.arena import Cylinder
from coursekit.world.camera import render
from reference.pictures.paper import RIGHT, TRUTH, WRONG, one, two


def mean_of_corners() -> Figure:
    """Twelve corners on the right edge and two on the left: their mean leans to the right, the edges' middle stays."""
    u, v = np.r_[np.full(2, 300.0), np.full(12, 340.0)], np.r_[110.0, 290.0, np.linspace(100, 300, 12)]
    corners = np.c_[u, v]
    fig, ax = one(xlabel="u [px]", ylabel="v [px]", ylim=(320, 80), xlim=(270, 370))
    ax.add_patch(Rectangle((300, 100), 40, 200, color="#bfe6ea"))
    ax.plot(u, v, "ko", ms=4)
    ax.axvline(failures.axis_by_the_mean_of_corners(corners), color=WRONG, lw=2, label="mean of the corners")
    ax.axvline((300 + 340) / 2, color=RIGHT, lw=2, label="middle of the edges")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def skew_check_alone() -> Figure:
    """Three outlines that slide out of the picture: the skew check trusts the cut ones too, since a cut is upright."""
    fig, axes = two("skew check", "margin at the edge", sharey=True)
    for ax, trust in zip(axes, (failures.trust_what_is_not_skewed, failures.trust_what_is_whole), strict=True):
        for k, left in enumerate((60.0, -10.0, -25.0)):
            seen = np.clip([[left, 100], [left + 40, 100], [left + 40, 300], [left, 300]], 0, 639)
            u, v = seen[[0, 1, 2, 3, 0]].T
            ax.plot(u, v / 2 + 130 * k, color=TRUTH)
            ax.text(110, 100 + 130 * k, "trusted" if trust(seen) else "refused", va="center")
        ax.axvline(0, color="0.4", lw=4)
        ax.set(xlim=(-10, 180), xlabel="u [px]", yticks=[])
        ax.invert_yaxis()
    return fig


def pixel_centres() -> Figure:
    """Error of the measured height at twelve distances: from pixel to pixel the heights are about one pixel short
    on average.
    """
    fig, ax = one(xlabel="distance [m]", ylabel="height error [px]")
    distances = np.linspace(1.5, 9.0, 12)
    views = [render(COURSE_CAMERA, np.zeros(3), [Cylinder((d, 0.0))]) for d in distances]
    true = [project_cylinder(d, 0.0, COURSE_CAMERA, 0.5, 0.1).height_px for d in distances]
    measures = (
        (failures.height_between_pixel_centres, WRONG, "last row minus first"),
        (failures.height_between_edges, RIGHT, "edge to edge"),
    )
    for height, colour, name in measures:
        ax.plot(distances, [height(v) - t for v, t in zip(views, true, strict=True)], "o-", color=colour, label=name)
    ax.axhline(0, color=TRUTH, lw=1)
    ax.legend()
    return fig


def brightness_threshold() -> Figure:
    """The same cylinder at noon and at dusk: thresholds on the three channels lose it, the hue does not."""
    fig, axes = two("light 1.2", "light 0.3")
    for ax, light in zip(axes, (1.2, 0.3), strict=True):
        view = render(COURSE_CAMERA, np.zeros(3), [Cylinder((2.0, 0.0))], light=light)
        found = [
            name for sees, name in ((failures.sees_brightness, "thresholds"), (failures.sees_hue, "hue")) if sees(view)
        ]
        ax.imshow(cv2.cvtColor(view, cv2.COLOR_BGR2RGB))
        ax.set_title(f"light {light}: found by {' and '.join(found)}", color=TRUTH)
        ax.set(xticks=[], yticks=[])
    return fig
