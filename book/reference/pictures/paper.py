"""What the pictures of failures share: colours, and one or two panels."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from coursekit.geometry import Array
from coursekit.teaching import plotting

WRONG, RIGHT, TRUTH, GREY = plotting.MEASUREMENT, plotting.ESTIMATE, plotting.TRUTH, plotting.ODOMETRY


def one(**labels: str) -> tuple[Figure, Any]:
    """A figure with one panel; ``labels`` are the axes' settings."""
    fig = plotting.figure(5.6, 3.2)
    ax = plotting.axes(fig)
    ax.set(**labels)
    return fig, ax


def two(left: str, right: str, **options: Any) -> tuple[Figure, Any]:
    """A figure with two panels under their titles, the mistake's on the left."""
    fig = plotting.figure(7.2, 3.2)
    axes = plotting.axes(fig, 1, 2, **options)
    for ax, title, colour in zip(axes, (left, right), (WRONG, RIGHT), strict=True):
        ax.set_title(title, color=colour)
    return fig, axes


def matrix(ax: Any, values: Array, form: str = "{:.3g}") -> None:
    """A matrix as numbers in coloured squares."""
    ax.imshow(abs(values) ** 0.5, cmap="Blues", alpha=0.6)
    for (i, j), value in zip(((i, j) for i in range(len(values)) for j in range(values.shape[1])), values.flat):
        ax.text(j, i, form.format(value), ha="center", va="center")
    ax.set(xticks=[], yticks=[])
    ax.grid(False)


def bars(ax: Any, names: list[str], values: list[float], colours: list[str], form: str = "{:.3g}") -> None:
    """Bars from the left with their values written at their ends."""
    at = range(len(names))[::-1]
    ax.barh(at, values, color=colours, height=0.6)
    for y, value in zip(at, values, strict=True):
        ax.text(value, y, " " + form.format(value), va="center")
    ax.set_yticks(at, names)
    ax.margins(x=0.2)
