"""Lab 3's pictures: the log, the geometry, two models compared, whether they are honest, how long an error lasts."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coursekit.geometry import Array
from coursekit.labs.lab03.runs import binned, standardised
from coursekit.noise import Log, NoiseModel, autocorrelation, effective_samples
from coursekit.teaching import plotting

PIXELS = 0.5 * 530.0  # L f_y of the log: the landmark's height times the focal length, px m
MODEL_COLOURS = plotting.MEASUREMENT, plotting.ESTIMATE  # of the report's and of the calibrated model


def question(log: Log) -> Figure:
    """Range and bearing errors of a log, as they are."""
    fig = plotting.figure(7.2, 3.4)
    left, right = plotting.axes(fig, 1, 2)
    left.plot(log.range, log.range_error, ".", ms=3, color=plotting.MEASUREMENT, alpha=0.5)
    left.axvline(8.0, color=plotting.TRUTH, lw=1, ls=":")
    left.annotate("the camera says 8.0 m", (8.0, 2.45), xytext=(5, 0), textcoords="offset points", fontsize=9)
    left.set(xlabel="measured range [m]", ylabel="measured − true range [m]", title="Errors of the range")
    right.plot(log.stamp, 1e3 * log.bearing_error, ".", ms=3, color=plotting.MEASUREMENT, alpha=0.5)
    right.set(xlabel="time [s]", ylabel="measured − true bearing [mrad]", title="Errors of the bearing")
    return fig


def geometry() -> Figure:
    """The lab's symbols: the landmark from the side, and from above a robot that turned since its picture."""
    fig = plotting.figure(8.4, 3.6)
    side, above = plotting.axes(fig, 1, 2, width_ratios=[1.35, 1])
    _from_the_side(side)
    _from_above(above)
    for ax in (side, above):
        ax.set_aspect("equal")
        ax.axis("off")
    return fig


def _from_the_side(ax: Axes) -> None:
    lens, rim, axis, centre, foot, top = 0.5, 3.0, 3.4, 0.0, -0.45, 0.75
    ax.add_patch(
        Rectangle((rim, foot), 2 * (axis - rim), top - foot, color=plotting.LANDMARK_COLOURS["cyan"], alpha=0.5)
    )
    ax.plot([axis, axis], [foot - 0.1, top + 0.1], color=plotting.TRUTH, lw=1, ls="-.")
    for z in (foot, top):
        ax.plot([lens, rim], [0, z], color=plotting.MEASUREMENT, lw=1.2)
        ax.plot([lens, lens - 0.3], [0, -0.3 * z / (rim - lens)], color=plotting.MEASUREMENT, lw=1.2)
    ax.plot([lens], [0], "o", color=plotting.TRUTH, ms=5)
    ax.plot([lens - 0.3] * 2, [-0.25, 0.25], color=plotting.TRUTH, lw=1.5)
    ax.add_patch(Rectangle((centre - 0.35, -0.68), 0.95, 0.3, color=plotting.ESTIMATE, alpha=0.35))
    ax.plot([centre, centre], [-0.95, 0.3], color=plotting.ESTIMATE, lw=1, ls="-.")
    _measure(ax, (rim + 0.95, foot), (rim + 0.95, top), "$L$", (10, 0))
    for a, b, z, label in ((lens, rim, -0.95, "$r$"), (rim, axis, -0.95, r"$\rho$"), (centre, lens, -0.95, "$o$")):
        _measure(ax, (a, z), (b, z), label, (0, 9))
    _measure(ax, (centre, -1.3), (axis, -1.3), r"$r_\mathrm{true}$", (0, -11))
    ax.annotate(r"$\eta$ pixels", (lens - 0.3, 0.36), ha="center", fontsize=10)
    ax.annotate("lens", (lens, 0.08), xytext=(4, 3), textcoords="offset points", fontsize=9)
    ax.annotate("near rim", (rim, top), xytext=(-4, 4), textcoords="offset points", ha="right", fontsize=9)
    ax.annotate("centre of the robot", (centre - 0.4, -1.12), fontsize=9, color=plotting.ESTIMATE, ha="right",
                va="center")  # fmt: skip
    ax.set(xlim=(-1.9, 4.4), ylim=(-1.7, 1.15))
    ax.set_title("From the side: $r$ ends at the near rim")


def _from_above(ax: Axes) -> None:
    before, now, landmark = -0.2, 0.3, 0.75  # rad: the heading then, the heading now, where the landmark lies
    plotting.draw_robot(ax, (0, 0, before), colour=plotting.ODOMETRY, size=0.35)
    plotting.draw_robot(ax, (0, 0, now), colour=plotting.ESTIMATE, size=0.35)
    ax.plot([0, 2.4 * np.cos(landmark)], [0, 2.4 * np.sin(landmark)], color=plotting.TRUTH, lw=1)
    ax.plot(2.4 * np.cos(landmark), 2.4 * np.sin(landmark), "o", ms=14, color=plotting.LANDMARK_COLOURS["cyan"])
    for heading, colour, label in (
        (before, plotting.ODOMETRY, "heading when the\npicture was taken"),
        (now, plotting.ESTIMATE, "heading now"),
    ):
        end = 2.3 * np.array([np.cos(heading), np.sin(heading)])
        ax.plot([0, end[0]], [0, end[1]], color=colour, lw=1, ls="--")
        ax.annotate(
            label, (end[0], end[1]), xytext=(4, 0), textcoords="offset points", color=colour, fontsize=9, va="center"
        )
    for start, stop, radius, label, colour in (
        (before, landmark, 0.82, r"$\varphi(t-\tau)$", plotting.ODOMETRY),
        (now, landmark, 1.6, r"$\varphi(t)$", plotting.ESTIMATE),
        (before, now, 1.75, r"$\omega\tau$", plotting.TRUTH),
    ):
        at = np.linspace(start, stop, 30)
        ax.plot(radius * np.cos(at), radius * np.sin(at), color=colour, lw=1.5)
        middle = (radius + 0.08) * np.array([np.cos(at[9]), np.sin(at[9])])
        ax.annotate(label, (middle[0], middle[1]), color=colour, fontsize=11, va="center")
    ax.set(xlim=(-0.4, 3.6), ylim=(-0.9, 2.0))
    ax.set_title(r"From above: turned by $\omega\tau$ since then")


def _measure(ax: Axes, a: tuple[float, float], b: tuple[float, float], label: str, off: tuple[float, float]) -> None:
    """A dimension line from a to b."""
    ax.annotate(
        "", a, b, arrowprops={"arrowstyle": "<->", "color": plotting.TRUTH, "lw": 0.9, "shrinkA": 0, "shrinkB": 0}
    )
    middle = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
    ax.annotate(label, middle, xytext=off, textcoords="offset points", ha="center", va="center", fontsize=11)


def latency(log: Log) -> Figure:
    """Bearing error against turn rate; near by, range error less a missing pixel's against speed: the same slope."""
    fig = plotting.figure(7.2, 3.3)
    left, right = plotting.axes(fig, 1, 2)
    near = (log.true_range > 1.6) & (log.true_range < 4)
    speed = log.speed * np.cos(log.true_bearing)  # towards the landmark
    for ax, name, x, error, unit, of in (
        (left, "Bearing", log.turn_rate, 1e3 * log.bearing_error, 1e3, "turn rate ω [rad/s]"),
        (right, "Range", speed[near], (log.range_error - log.range**2 / PIXELS)[near], 1.0, "speed v [m/s]"),
    ):
        slope, cut = np.polyfit(x, error, 1)
        ax.plot(x, error, ".", ms=3, color=plotting.MEASUREMENT, alpha=0.4)
        ends = np.array([x.min(), x.max()])
        ax.plot(ends, cut + slope * ends, color=plotting.ESTIMATE)
        ax.set(xlabel=of, title=f"{name}: the slope is {1e3 * slope / unit:.0f} ms")
    left.set(xticks=[-0.5, 0, 0.5], ylabel="measured − true bearing [mrad]")
    right.set_ylabel(r"range error − $r^2/(L f_y)$ [m]")
    return fig


def compared(log: Log, models: dict[str, NoiseModel], name: str) -> Figure:
    """Each model's ±2σ round its own corrected errors: range above, bearing over time below."""
    fig = plotting.figure(7.2, 4.4)
    panels = plotting.axes(fig, 2, len(models), sharex="row", sharey="row")
    for (label, model), (top, bottom) in zip(models.items(), panels.T, strict=True):
        e, R = model.residuals(log), model.R(log.range, log.bearing, log.turn_rate, log.speed)
        for ax, x, i, unit in ((top, log.range, 0, 1.0), (bottom, log.stamp - log.stamp[0], 1, 1e3)):
            order = np.argsort(x)
            sigma = np.sqrt(R[:, i, i])
            ax.plot(x, unit * e[:, i], ".", ms=2.5, color=plotting.MEASUREMENT, alpha=0.45)
            for sign in (-2, 2):
                ax.plot(x[order], unit * sign * sigma[order], color=plotting.BAND, lw=1.0)
            inside = np.mean(np.abs(e[:, i]) < 2 * sigma)
            ax.set_title(f"{label}: {100 * inside:.0f} % inside ±2σ")
        top.set_xlabel("measured range [m]")
        bottom.set_xlabel("time [s]")
    panels[0, 0].set_ylabel("range error [m]")
    panels[1, 0].set_ylabel("bearing error [mrad]")
    fig.suptitle(name, x=0.01, ha="left", fontsize=11.5)
    return fig


def honesty(log: Log, models: dict[str, NoiseModel]) -> Figure:
    """Mean square of the corrected errors over the variance stated for them: 1 for an honest model."""
    fig = plotting.figure(8.4, 3.2)
    panels = plotting.axes(fig, 1, 3, sharey=True)
    sorted_by = (
        ("true range [m]", 0, log.true_range, np.array([1, 2, 4, 6, 8, 10, 13, 16, 20.5])),
        ("|bearing| [rad]", 1, np.abs(log.bearing), np.array([0, 0.1, 0.2, 0.3, 0.4, 0.6])),
        ("|turn rate| [rad/s]", 1, np.abs(log.turn_rate), np.array([0, 0.02, 0.3, 0.6, 1.4])),
    )
    worst = dict.fromkeys(models, 0.0)
    for ax, (label, i, x, edges) in zip(panels, sorted_by, strict=True):
        for (name, model), colour in zip(models.items(), MODEL_COLOURS, strict=True):
            _, ratios, _ = binned(x, standardised(model, log)[:, i] ** 2, edges)
            _, means, _ = binned(x, x, edges)
            worst[name] = max(worst[name], float(ratios.max()))
            ax.plot(means, ratios, "o-", ms=4, color=colour, label=name)
        ax.axhline(1, color=plotting.BAND, ls="--", lw=1.2)
        ax.set(yscale="log", xlabel=label, title=("range", "bearing")[i])
    panels[0].yaxis.set_major_formatter("{x:g}")
    panels[0].set_ylabel("mean square error / variance")
    fig.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    said = " and ".join(f"{ratio:.2g} ({name})" for name, ratio in worst.items())
    fig.suptitle(f"Honest is 1; the largest ratios are {said}", x=0.01, ha="left", fontsize=11.5)
    return fig


def memory(log: Log, residuals: Array, name: str, lags: int = 60) -> Figure:
    """How long a residual remembers the ones before it."""
    fig = plotting.figure(7.2, 3.0)
    ax = plotting.axes(fig)
    rho = autocorrelation(residuals, lags)
    ax.fill_between(np.arange(lags + 1), rho, step="mid", color=plotting.ESTIMATE, alpha=0.35)
    ax.axhspan(-2 / np.sqrt(len(log)), 2 / np.sqrt(len(log)), color=plotting.BAND, alpha=0.25, lw=0)
    ax.annotate("what independent samples would show", (lags, 0.1), xytext=(0, 0), textcoords="offset points",
                ha="right", color=plotting.BAND, fontsize=9.5)  # fmt: skip
    ax.set(xlabel="samples later", ylabel="autocorrelation", xlim=(0, lags), ylim=(min(-0.2, rho.min() - 0.05), 1.02))
    ax.set_title(f"{name}: {len(log)} samples are worth {effective_samples(residuals):.0f} independent ones")
    return fig
