"""Lab 3's explorers: the band that a model draws round errors, a picture that is late, the hill of likelihood."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coursekit.geometry import Array
from coursekit.labs.lab03.runs import binned, halves, nats
from coursekit.noise import fit_calibrated
from coursekit.teaching import plotting

SHOWN = 3  # every third sample is drawn, all are counted: hundreds of pictures have to fit into one page
_DOT = "#e89a6b"  # the measurements' colour, as it looks half transparent on white


def _signed(score: float) -> str:
    return f"{score:.2f}".replace("-", "−")


class _Banded(NamedTuple):
    error: Array  # of the judged half, m
    sigma: Array  # what the model says of it, m
    edges: Array  # ranges at which the band steps, m
    band: Array  # sigma between them, m


class Bands:
    """The report's recipe with every choice open: limits, inflation, and what is done about the bias."""

    BINS = 12
    LIMITS = (5, 10, 25)
    INFLATIONS = (1, 3, 10)
    BIASES = ("left in", "mean removed", "geometry and age removed")
    HIGH = 1.6

    def __init__(self) -> None:
        self.train, self.test = halves()
        calibrated = fit_calibrated(self.train)
        self.corrected = {
            "left in": (self.train.range, self.test.range),
            "mean removed": tuple(log.range - np.mean(self.train.range_error) for log in halves()),
            "geometry and age removed": tuple(
                calibrated.correct(log.range, log.bearing, log.turn_rate, log.speed)[0] for log in halves()
            ),
        }
        best = np.sqrt(calibrated.R(self.test.range, self.test.bearing, self.test.turn_rate, self.test.speed)[:, 0, 0])
        self.best = float(np.mean(nats(calibrated.residuals(self.test)[:, 0], best)))
        self.figure = plotting.figure(7.2, 4.2)
        self.ax, self.scale = plotting.axes(self.figure, 1, 2, width_ratios=[7, 1])
        (self.dots,) = self.ax.plot([], [], ".", ms=3, color=_DOT, label="error, held out")
        (self.upper,) = self.ax.step([], [], where="post", color=plotting.BAND, label="±2σ of the model")
        (self.lower,) = self.ax.step([], [], where="post", color=plotting.BAND)
        (self.means,) = self.ax.plot([], [], "o-", ms=5, color=plotting.TRUTH, lw=1, label="mean of a bin ± its spread")
        self.bars = self.ax.vlines([], [], [], color=plotting.TRUTH, lw=1.4)
        self.ax.axhline(0, color=plotting.ODOMETRY, lw=0.8)
        self.ax.set(
            xlim=(0, 23), ylim=(-self.HIGH, 2.95), xlabel="measured range [m]", ylabel="measured − true range [m]"
        )
        self.ax.legend(loc="upper left")
        self.title = self.ax.set_title(" ", loc="left")
        self.scale.axhline(self.best, color=plotting.ESTIMATE, ls="--")
        self.scale.annotate("bias and\ngrowing σ", (0.5, self.best), xytext=(0, -3), textcoords="offset points",
                            ha="center", va="top", fontsize=8.5, color=plotting.ESTIMATE)  # fmt: skip
        (self.mark,) = self.scale.plot([0.5], [0], "D", ms=9, color=plotting.BAND)
        self.scale.set(xlim=(0, 1), ylim=(-8, 2.4), xticks=[], ylabel="held-out nats per sample")
        self.moving = [self.dots, self.upper, self.lower, self.means, self.bars, self.title, self.mark]

    def update(self, limit: float, inflation: float, bias: str) -> None:
        """``limit``: the farthest measured range, m, that counts as near; ``bias``: one of ``BIASES``."""
        error, sigma, edges, band = self._banded(limit, inflation, bias)
        d = self.test.range
        self.dots.set_data(d[::SHOWN], error[::SHOWN])
        self.upper.set_data(edges, 2 * band)
        self.lower.set_data(edges, -2 * band)
        middles, means, spreads = binned(d, error, np.linspace(0.5, 22.5, self.BINS + 1))
        self.means.set_data(middles, means)
        self.bars.set_segments([[(x, m - s), (x, m + s)] for x, m, s in zip(middles, means, spreads, strict=True)])
        score, inside = self._verdict(error, sigma)
        self.mark.set_ydata([max(score, -7.8)])
        self.mark.set_marker("D" if score > -7.8 else "v")
        self.title.set_text(f"{_signed(score)} nats per sample; {100 * inside:.0f} % of the errors lie inside ±2σ")

    def words(self, limit: float, inflation: float, bias: str) -> str:
        """The text alternative of a frame."""
        score, inside = self._verdict(*self._banded(limit, inflation, bias)[:2])
        return (
            f"Range errors against measured range, with a band that steps at {limit} m. {100 * inside:.0f} % of "
            f"the held-out errors lie inside it, and the likelihood is {_signed(score)} nats per sample"
        )

    def _banded(self, limit: float, inflation: float, bias: str) -> _Banded:
        train, test = self.corrected[bias]
        chosen = (self.train.range >= 1) & (self.train.range <= limit)
        base = float(np.std((train - self.train.true_range)[chosen], ddof=1))
        wide = base * np.sqrt(inflation)
        sigma = np.where((self.test.range >= 1) & (self.test.range <= limit), base, wide)
        return _Banded(
            test - self.test.true_range, sigma, np.array([0, 1, limit, 25]), np.array([wide, base, wide, wide])
        )

    @staticmethod
    def _verdict(error: Array, sigma: Array) -> tuple[float, float]:
        return float(np.mean(nats(error, sigma))), float(np.mean(np.abs(error) < 2 * sigma))


class Late:
    """A robot that turns left and right, and a picture that is ``delay`` seconds old: which bearing it shows."""

    TIMES = tuple(round(0.16 * i, 2) for i in range(24))  # s: one turn to the left and back, and a little more
    DELAYS = (0.0, 0.04, 0.1, 0.2)
    TURN_RATE, QUARTER, LANDMARK = 0.65, 0.9, np.array([2.0, 0.0])

    def __init__(self) -> None:
        self.figure = plotting.figure(8.0, 3.6)
        self.view, self.ax = plotting.axes(self.figure, 1, 2, width_ratios=[1, 1.15])
        self.view.plot(*self.LANDMARK, "o", ms=13, color=plotting.LANDMARK_COLOURS["cyan"])
        (self.now,) = self.view.plot([], [], color=plotting.TRUTH, lw=1.4, label="truth")
        (self.shown,) = self.view.plot([], [], color=plotting.MEASUREMENT, lw=1.6, label="what the picture shows")
        (self.heading,) = self.view.plot([], [], color=plotting.ESTIMATE, lw=1, ls="--", label="heading")
        self.robot = plotting.draw_robot(self.view, (0, 0, 0), size=0.3)
        self.view.set(xlim=(-0.4, 2.4), ylim=(-1.0, 1.0), xlabel="x [m]", ylabel="y [m]")
        self.view.set_aspect("equal")
        self.t = np.linspace(0, self.TIMES[-1], 300)
        self.ax.plot(self.t, self.bearing(self.t), color=plotting.TRUTH, lw=1.4, label="_")
        (self.late,) = self.ax.plot([], [], color=plotting.MEASUREMENT, lw=1.4, label="_")
        (self.gap,) = self.ax.plot([], [], color=plotting.HIGHLIGHT, lw=3, label="error at this moment")
        self.view.set_title("From above")
        self.ax.set(xlabel="time t [s]", ylabel="bearing [rad]", ylim=(-0.75, 0.75))
        lines = [self.now, self.shown, self.heading, self.gap]
        self.figure.legend(handles=lines, loc="outside lower center", ncols=4, fontsize=8.5)
        self.title = self.ax.set_title(" ")
        self.moving = [self.now, self.shown, self.heading, self.robot, self.late, self.gap, self.title]

    def heading_at(self, t: Array | float) -> Array:
        """A robot that turns at a steady rate, to the left and back and so on, rad."""
        phase = (np.asarray(t) + self.QUARTER) % (4 * self.QUARTER)
        return self.TURN_RATE * (np.minimum(phase, 4 * self.QUARTER - phase) - self.QUARTER)

    def bearing(self, t: Array | float) -> Array:
        """Of the landmark, which lies along the x axis, rad."""
        return -self.heading_at(t)

    def update(self, time: float, delay: float) -> None:
        """``time`` in s from the start, ``delay`` in s."""
        heading, shown = float(self.heading_at(time)), float(self.bearing(time - delay))
        reach = float(np.hypot(*self.LANDMARK))
        self.now.set_data([0, self.LANDMARK[0]], [0, self.LANDMARK[1]])
        self.shown.set_data([0, reach * np.cos(heading + shown)], [0, reach * np.sin(heading + shown)])
        self.heading.set_data([0, 1.3 * np.cos(heading)], [0, 1.3 * np.sin(heading)])
        self.robot.set_xy(plotting.robot_outline((0, 0, heading), 0.3))
        self.late.set_data(self.t, self.bearing(self.t - delay))
        self.gap.set_data([time, time], [float(self.bearing(time)), shown])
        self.title.set_text(f"{1e3 * delay:.0f} ms late: error {self._error(time, delay)} mrad")

    def words(self, time: float, delay: float) -> str:
        """The text alternative of a frame."""
        return (
            f"A robot that turns before a landmark, {time} s after the start. Its picture is {1e3 * delay:.0f} ms old, "
            f"so the bearing that it shows is wrong by {self._error(time, delay)} mrad"
        )

    def _error(self, time: float, delay: float) -> str:
        error = 1e3 * float(self.bearing(time - delay) - self.bearing(time))
        return f"{error + 0.0:+.0f}".replace("-", "−")


class Hill:
    """Log-likelihood over offset and inverse-range bias, for a spread that grows with a power of the range."""

    OFFSETS = (0.13, 0.15, 0.17, 0.19, 0.21)
    INVERSE_RANGE_BIASES = (0.0, 0.002, 0.0038, 0.0055, 0.0075)
    POWERS = (0.0, 1.0, 1.5)
    DROPS = (1.5, 0.5, 0.1, 0.01)  # nats below the summit at which a contour is drawn

    def __init__(self) -> None:
        self.log = halves()[0]
        offsets, biases = np.linspace(0.12, 0.22, 41), np.linspace(-0.0005, 0.008, 41)
        self.hills = {
            power: np.array([[self.score(o, c, power) for o in offsets] for c in biases]) for power in self.POWERS
        }
        self.figure = plotting.figure(7.2, 4.2)
        self.ax, self.map = plotting.axes(self.figure, 1, 2, width_ratios=[1.25, 1])
        self.d = np.linspace(1.2, 22.5, 150)
        self.ax.plot(self.log.range[::SHOWN], self.log.range_error[::SHOWN], ".", ms=3, color=_DOT)
        (self.curve,) = self.ax.plot([], [], color=plotting.ESTIMATE, label="bias of this model")
        (self.upper,) = self.ax.plot([], [], color=plotting.BAND, lw=1.2, label="±2σ")
        (self.lower,) = self.ax.plot([], [], color=plotting.BAND, lw=1.2)
        self.ax.set(xlim=(0, 23), ylim=(-1.8, 3), xlabel="measured range [m]", ylabel="measured − true range [m]")
        self.ax.legend(loc="upper left")
        # All three hills in one set of axes; one is visible at a time.
        self.contours = {}
        for power, hill in self.hills.items():
            drops = hill.max() - np.array(self.DROPS)
            self.contours[power] = self.map.contour(
                offsets, biases, hill, levels=drops, colors=plotting.ODOMETRY, linewidths=0.9, linestyles="solid"
            )
        (self.here,) = self.map.plot([], [], "o", ms=9, color=plotting.ESTIMATE)
        self.map.set(xlabel="offset [m]", ylabel="inverse-range bias [1/m]")
        self.map.set_title(", ".join(f"{drop:g}" for drop in self.DROPS[::-1]) + " nats down", loc="left")
        self.title = self.ax.set_title("\n", loc="left")
        self.moving = [self.curve, self.upper, self.lower, self.title, *self.contours.values(), self.here]

    def score(self, offset: float, inverse_range_bias: float, power: float) -> float:
        """Nats a sample of the true ranges, with the best scale that there is: its square is a mean square."""
        z = (self.error(offset, inverse_range_bias)) / self.log.range**power
        scale = np.sqrt(np.mean(z**2))
        return float(np.mean(nats(z, scale) - power * np.log(self.log.range)))

    def error(self, offset: float, inverse_range_bias: float) -> Array:
        """Corrected minus true range, m, (n,)."""
        return np.asarray(1 / (1 / self.log.range + inverse_range_bias) + offset - self.log.true_range)

    def update(self, offset: float, inverse_range_bias: float, power: float) -> None:
        """Metres, 1/m, and the power of the range with which σ grows."""
        bias = self.d - (1 / (1 / self.d + inverse_range_bias) + offset)
        scale = np.sqrt(np.mean((self.error(offset, inverse_range_bias) / self.log.range**power) ** 2))
        sigma = scale * self.d**power
        self.curve.set_data(self.d, bias)
        self.upper.set_data(self.d, bias + 2 * sigma)
        self.lower.set_data(self.d, bias - 2 * sigma)
        for key, contour in self.contours.items():
            contour.set_visible(key == power)
        self.here.set_data([offset], [inverse_range_bias])
        top, score = self.hills[power].max(), self.score(offset, inverse_range_bias, power)
        self.title.set_text(f"{_signed(score)} nats per sample,\n{max(top - score, 0):.2f} below the summit")

    def words(self, offset: float, inverse_range_bias: float, power: float) -> str:
        """The text alternative of a frame."""
        score = self.score(offset, inverse_range_bias, power)
        return (
            f"Left, range errors with the bias of this model and a band of two sigma, growing as range to the {power}; "
            f"right, where that is on the hill of likelihood: {_signed(score)} nats per sample"
        )
