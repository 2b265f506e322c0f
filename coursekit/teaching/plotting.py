"""One visual language for every figure: the same thing has the same colour in every lab.

The palette is Okabe and Ito's (2008), which people with any colour vision can tell apart.  Figures are bare
``matplotlib.figure.Figure`` objects: no global state, nothing to close, the same picture in a lab and in a test.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from numpy.typing import ArrayLike

from coursekit.gaussian import chi2_band, ellipse
from coursekit.geometry import transform

TRUTH = "#1a1a1a"
ESTIMATE = "#0072B2"
MEASUREMENT = "#D55E00"
ODOMETRY = "#8a8a8a"
PREDICTION = "#CC79A7"
BAND = "#009E73"
HIGHLIGHT = "#E69F00"
WALL = "#4d4d4d"
LANDMARK_COLOURS = {
    "red": "#d62728",
    "green": "#2e9e3f",
    "blue": "#1f5fbf",
    "cyan": "#17becf",
    "magenta": "#c724b1",
    "yellow": "#d9b310",
}

_STYLE = {
    "figure.dpi": 100,
    "figure.constrained_layout.use": True,
    "font.size": 10.5,
    "axes.titlesize": 11.5,
    "axes.titleweight": "normal",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.8,
    "lines.linewidth": 1.8,
    "legend.frameon": False,
    "legend.fontsize": 9.5,
    "image.cmap": "viridis",
    "axes.prop_cycle": cycler(color=[ESTIMATE, MEASUREMENT, BAND, PREDICTION, HIGHLIGHT, "#56B4E9", TRUTH]),
}


def use_style() -> None:
    """Set the course's style; in a notebook, figures also come out sharp on any screen."""
    mpl.rcParams.update(_STYLE)
    from IPython import get_ipython

    if get_ipython() is not None:
        from matplotlib_inline.backend_inline import set_matplotlib_formats

        set_matplotlib_formats("retina")


def figure(width: float = 7.2, height: float = 4.2) -> Figure:
    """An empty figure in the course's style, ``width`` × ``height`` inches, drawn by Agg."""
    with mpl.rc_context(_STYLE):
        empty = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(empty)
    return empty


def axes(fig: Figure, *args: Any, **kwargs: Any) -> Any:
    """``fig.subplots`` in the course's style: use it when ``use_style`` was not called (scenes, tests)."""
    with mpl.rc_context(_STYLE):
        return fig.subplots(*args, **kwargs)


def mosaic(fig: Figure, layout: Any, **kwargs: Any) -> Any:
    """``fig.subplot_mosaic`` in the course's style: axes by name, for panels of different sizes."""
    with mpl.rc_context(_STYLE):
        return fig.subplot_mosaic(layout, **kwargs)


def robot_outline(pose: ArrayLike, size: float = 0.3) -> np.ndarray:
    """The robot's marker, an arrowhead that points where the robot looks: (3,) → (4, 2) in the world."""
    shape = size * np.array([[0.6, 0.0], [-0.4, 0.38], [-0.2, 0.0], [-0.4, -0.38]])
    return transform(pose, shape)


def draw_robot(ax: Axes, pose: ArrayLike, colour: str = ESTIMATE, size: float = 0.3, **style: Any) -> Polygon:
    """Draw the robot at a pose; ``set_xy(robot_outline(pose))`` on what comes back moves it."""
    patch = Polygon(
        robot_outline(pose, size), closed=True, **{"facecolor": colour, "edgecolor": "white", "zorder": 5} | style
    )
    ax.add_patch(patch)
    return patch


def draw_ellipse(
    ax: Axes, mean: ArrayLike, cov: ArrayLike, colour: str = ESTIMATE, confidence: float = 0.95, **style: Any
) -> Line2D:
    """Draw the ellipse that holds ``confidence`` of a planar Gaussian.

    ``set_data(*(mean + gaussian.ellipse(cov)).T)`` on what comes back moves it.
    """
    contour = np.asarray(mean, dtype=float)[:2] + ellipse(np.asarray(cov, dtype=float)[:2, :2], confidence)
    options: dict[str, Any] = {"color": colour, "lw": 1.6, **style}
    (line,) = ax.plot(*contour.T, **options)
    return line


def draw_arena(ax: Axes, arena: Any) -> None:
    """Draw an arena from above, to scale, with its walls, cylinders, crates and tags; axes in metres."""
    ax.add_collection(LineCollection([[w.start, w.end] for w in arena.walls], colors=WALL, linewidths=2.2))
    for c in arena.cylinders:
        face = LANDMARK_COLOURS.get(c.colour, "#999999")
        ax.add_patch(Circle(tuple(c.position), c.radius, facecolor=face, edgecolor=WALL, lw=0.8, zorder=3))
    for crate in arena.crates:
        x, y = np.broadcast_to(np.asarray(crate.size, dtype=float) / 2, 2)
        corners = transform(crate.pose, np.array([[x, y], [-x, y], [-x, -y], [x, -y]]))
        ax.add_patch(Polygon(corners, closed=True, facecolor="#d8c3a5", edgecolor=WALL, lw=0.8))
    for tag in arena.tags:
        half = np.array([-np.sin(tag.yaw), np.cos(tag.yaw)]) * tag.size / 2
        ax.plot(*np.stack([tag.position - half, tag.position + half]).T, color=TRUTH, lw=4, solid_capstyle="butt")
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    ax.autoscale_view()


class _PlainTicks(LogLocator):
    """Decades where two of them are in sight, else 1-2-5, else round numbers: an axis never stays without two."""

    def tick_values(self, vmin: float, vmax: float) -> Any:
        vmin, vmax = max(min(vmin, vmax), 1e-30), max(vmin, vmax)
        decades: np.ndarray = 10.0 ** np.arange(np.floor(np.log10(vmin)), np.ceil(np.log10(vmax)) + 1)
        for candidates in (decades, np.outer(decades, [1, 2, 5]).ravel(), MaxNLocator(4).tick_values(vmin, vmax)):
            ticks = np.asarray(candidates)
            inside = ticks[(ticks >= vmin) & (ticks <= vmax)]
            if len(inside) >= 2:
                break
        return inside[:: 1 + len(inside) // 6]


def consistency_strip(
    ax: Axes,
    t: ArrayLike,
    values: ArrayLike,
    dof: int,
    runs: ArrayLike = 1,
    name: str = "NEES",
    confidence: float = 0.95,
) -> float:
    """NEES or NIS against time with its two-sided chi-square band; returns the share of steps inside it.

    Parameters
    ----------
    t : (n,) seconds.
    values : (n,), the average over ``runs`` independent runs at each step; NaN where there was nothing to average.
    dof : degrees of freedom of one value.
    runs : one number, or (n,) of them where it changes from step to step, as the number of measurements does.

    The ordinate is logarithmic: a filter can be wrong by factors, in either direction.
    """
    t, values = np.asarray(t, dtype=float), np.asarray(values, dtype=float)
    known = np.isfinite(values)
    counts = np.broadcast_to(np.asarray(runs), t.shape)
    bands = {int(n): chi2_band(dof, int(n), confidence) for n in np.unique(counts[known])}
    low, high = np.array([bands[int(n)] if k else (np.nan, np.nan) for n, k in zip(counts, known, strict=True)]).T
    inside = float(np.mean((values >= low)[known] & (values <= high)[known]))
    if len(bands) == 1 and known.all():
        ax.axhspan(low[0], high[0], color=BAND, alpha=0.18, lw=0)
    else:
        ax.fill_between(t, low, high, step="mid", color=BAND, alpha=0.18, lw=0)
    ax.axhline(dof, color=BAND, lw=1, ls="--")
    ax.plot(t, np.maximum(values, low / 100), color=ESTIMATE, lw=1.2, marker=None if known.all() else ".", ms=3)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(_PlainTicks())
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylabel(name)
    ax.set_xlabel("time [s]")
    ax.set_title(f"{name}: {100 * inside:.0f} % of steps inside the {100 * confidence:.0f} % band")
    return inside


def label_lines(ax: Axes, lines: Sequence[Line2D]) -> None:
    """Name each line at its right end, in its own colour: a legend in place."""
    for line in lines:
        x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
        ax.annotate(str(line.get_label()), (x[-1], y[-1]), xytext=(5, 0), textcoords="offset points",
                    color=line.get_color(), va="center", fontsize=9.5)  # fmt: skip
