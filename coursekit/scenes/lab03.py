"""Lab 3's pictures: errors with the band that a model draws round them, and the hill that likelihood climbs."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from coursekit import datasets, plotting
from coursekit.geometry import Array
from coursekit.noise import Log, NoiseModel, autocorrelation, effective_samples, fit_calibrated, fit_piecewise

SHOWN = 3  # every third sample is drawn, all are counted: hundreds of pictures have to fit into one page
_DOT = "#e89a6b"  # the measurements' colour, as it looks half transparent on white


@cache
def halves() -> tuple[Log, Log]:
    """The world's log, every other sample: what a model is fitted to, and what it is judged on."""
    log = datasets.load("landmark_log")
    return log[::2], log[1::2]


def nats(error: Array, sigma: Array | float) -> Array:
    """Log density of errors (n,) under N(0, sigma²), nats."""
    return np.asarray(-0.5 * (np.log(2 * np.pi) + np.square(error / sigma)) - np.log(sigma))


def _signed(score: float) -> str:
    return f"{score:.2f}".replace("-", "−")


class _Banded(NamedTuple):
    error: Array  # of the judged half, m
    sigma: Array  # what the model says of it, m
    edges: Array  # ranges at which the band steps, m
    band: Array  # sigma between them, m


class Bands:
    """The report's recipe with every choice open: bins, limits, inflation, and what is done about the bias."""

    BINS = (5, 12, 30)
    LIMITS = (5, 10, 25)
    INFLATIONS = (1, 3, 10)
    BIASES = ("left in", "mean removed", "geometry removed")
    HIGH = 1.6

    def __init__(self) -> None:
        self.train, self.test = halves()
        calibrated = fit_calibrated(self.train)
        self.corrected = {
            "left in": (self.train.range, self.test.range),
            "mean removed": tuple(log.range - np.mean(self.train.range_error) for log in halves()),
            "geometry removed": tuple(calibrated.correct(log.range, log.bearing)[0] for log in halves()),
        }
        best = np.sqrt(calibrated.R(self.test.range, self.test.bearing)[:, 0, 0])
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
            xlim=(0, 23), ylim=(-self.HIGH, 2.4), xlabel="measured range [m]", ylabel="measured − true range [m]"
        )
        self.ax.legend(loc="upper left")
        self.title = self.ax.set_title(" ", loc="left")
        self.scale.axhline(self.best, color=plotting.ESTIMATE, ls="--")
        self.scale.annotate("bias and\ngrowing σ", (0.5, self.best), xytext=(0, -3), textcoords="offset points",
                            ha="center", va="top", fontsize=8.5, color=plotting.ESTIMATE)  # fmt: skip
        (self.mark,) = self.scale.plot([0.5], [0], "D", ms=9, color=plotting.BAND)
        self.scale.set(xlim=(0, 1), ylim=(-8, 2.4), xticks=[], ylabel="held-out nats a sample")
        self.moving = [self.dots, self.upper, self.lower, self.means, self.bars, self.title, self.mark]

    def update(self, bins: int, limit: float, inflation: float, bias: str) -> None:
        """``limit``: the farthest measured range, m, that counts as near; ``bias``: one of ``BIASES``."""
        error, sigma, edges, band = self._banded(limit, inflation, bias)
        d = self.test.range
        self.dots.set_data(d[::SHOWN], error[::SHOWN])
        self.upper.set_data(edges, 2 * band)
        self.lower.set_data(edges, -2 * band)
        middles, means, spreads = binned(d, error, np.linspace(0.5, 22.5, bins + 1))
        self.means.set_data(middles, means)
        self.bars.set_segments([[(x, m - s), (x, m + s)] for x, m, s in zip(middles, means, spreads, strict=True)])
        score, inside = self._verdict(error, sigma)
        self.mark.set_ydata([max(score, -7.8)])
        self.mark.set_marker("D" if score > -7.8 else "v")
        self.title.set_text(f"{_signed(score)} nats a sample; {inside:.0%} of the errors lie inside ±2σ")

    def words(self, bins: int, limit: float, inflation: float, bias: str) -> str:
        """The text alternative of a frame."""
        score, inside = self._verdict(*self._banded(limit, inflation, bias)[:2])
        return (
            f"Range errors against measured range in {bins} bins, with a band that steps at {limit} m. {inside:.0%} of "
            f"the held-out errors lie inside it, and the likelihood is {_signed(score)} nats a sample"
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


class Hill:
    """Log-likelihood over offset and shortfall, for a spread that grows with a power of the range."""

    OFFSETS = (0.13, 0.15, 0.17, 0.19, 0.21)
    SHORTFALLS = (0.0, 0.002, 0.0038, 0.0055, 0.0075)
    POWERS = (0.0, 1.0, 1.5)
    DROPS = (1.5, 0.5, 0.1, 0.01)  # nats below the summit at which a contour is drawn

    def __init__(self) -> None:
        self.log = halves()[0]
        offsets, shortfalls = np.linspace(0.12, 0.22, 41), np.linspace(-0.0005, 0.008, 41)
        self.hills = {
            power: np.array([[self.score(o, c, power) for o in offsets] for c in shortfalls]) for power in self.POWERS
        }
        self.figure = plotting.figure(7.2, 4.2)
        self.ax, self.map = plotting.axes(self.figure, 1, 2, width_ratios=[1.25, 1])
        self.d = np.linspace(1.2, 22.5, 150)
        self.ax.plot(self.log.range[::SHOWN], self.log.range_error[::SHOWN], ".", ms=3, color=_DOT)
        (self.curve,) = self.ax.plot([], [], color=plotting.ESTIMATE, label="bias of this model")
        (self.upper,) = self.ax.plot([], [], color=plotting.BAND, lw=1.2, label="±2σ")
        (self.lower,) = self.ax.plot([], [], color=plotting.BAND, lw=1.2)
        self.ax.set(xlim=(0, 23), ylim=(-1.2, 3), xlabel="measured range [m]", ylabel="measured − true range [m]")
        self.ax.legend(loc="upper left")
        # All three hills in one set of axes; one is visible at a time.
        self.contours = {}
        for power, hill in self.hills.items():
            drops = hill.max() - np.array(self.DROPS)
            self.contours[power] = self.map.contour(
                offsets, shortfalls, hill, levels=drops, colors=plotting.ODOMETRY, linewidths=0.9, linestyles="solid"
            )
        (self.here,) = self.map.plot([], [], "o", ms=9, color=plotting.ESTIMATE)
        self.map.set(xlabel="offset [m]", ylabel="shortfall [1/m]")
        self.map.set_title("Lines " + ", ".join(f"{drop:g}" for drop in self.DROPS[::-1]) + " nats down", loc="left")
        self.title = self.ax.set_title(" ", loc="left")
        self.moving = [self.curve, self.upper, self.lower, self.title, *self.contours.values(), self.here]

    def score(self, offset: float, shortfall: float, power: float) -> float:
        """Nats a sample of the true ranges, with the best scale that there is: its square is a mean square."""
        z = (self.error(offset, shortfall)) / self.log.range**power
        scale = np.sqrt(np.mean(z**2))
        return float(np.mean(nats(z, scale) - power * np.log(self.log.range)))

    def error(self, offset: float, shortfall: float) -> Array:
        """Corrected minus true range, m, (n,)."""
        return np.asarray(1 / (1 / self.log.range + shortfall) + offset - self.log.true_range)

    def update(self, offset: float, shortfall: float, power: float) -> None:
        """Metres, 1/m, and the power of the range with which σ grows."""
        bias = self.d - (1 / (1 / self.d + shortfall) + offset)
        scale = np.sqrt(np.mean((self.error(offset, shortfall) / self.log.range**power) ** 2))
        sigma = scale * self.d**power
        self.curve.set_data(self.d, bias)
        self.upper.set_data(self.d, bias + 2 * sigma)
        self.lower.set_data(self.d, bias - 2 * sigma)
        for key, contour in self.contours.items():
            contour.set_visible(key == power)
        self.here.set_data([offset], [shortfall])
        top, score = self.hills[power].max(), self.score(offset, shortfall, power)
        self.title.set_text(f"{_signed(score)} nats a sample, {max(top - score, 0):.2f} below the summit")

    def words(self, offset: float, shortfall: float, power: float) -> str:
        """The text alternative of a frame."""
        score = self.score(offset, shortfall, power)
        return (
            f"Left, range errors with the bias of this model and a band of two sigma, growing as range to the {power}; "
            f"right, where that is on the hill of likelihood: {_signed(score)} nats a sample"
        )


def binned(x: Array, y: Array, edges: Array) -> tuple[Array, Array, Array]:
    """Middle, mean and standard deviation of y in the bins of x that hold at least three samples."""
    bins = [y[(a <= x) & (x < b)] for a, b in pairwise(edges)]
    kept = [i for i, values in enumerate(bins) if len(values) >= 3]
    middles = (0.5 * (edges[:-1] + edges[1:]))[kept]
    return middles, np.array([bins[i].mean() for i in kept]), np.array([bins[i].std(ddof=1) for i in kept])


def question(log: Log) -> Figure:
    """Range and bearing errors of a log, as they are."""
    fig = plotting.figure(7.2, 3.6)
    left, right = plotting.axes(fig, 1, 2)
    left.plot(log.range, log.range_error, ".", ms=3, color=plotting.MEASUREMENT, alpha=0.5)
    left.axvline(8.0, color=plotting.TRUTH, lw=1, ls=":")
    left.annotate("the camera says 8.0 m", (8.0, 2.3), xytext=(6, 0), textcoords="offset points")
    left.set(xlabel="measured range [m]", ylabel="measured − true range [m]")
    left.set_title("Which way is it wrong?", loc="left")
    right.plot(log.bearing, 1e3 * log.bearing_error, ".", ms=3, color=plotting.MEASUREMENT, alpha=0.5)
    right.set(xlabel="measured bearing [rad]", ylabel="measured − true bearing [mrad]")
    right.set_title("And why in two bands?", loc="left")
    return fig


def compared(log: Log, models: dict[str, NoiseModel], name: str) -> Figure:
    """Each model's ±2σ round its own corrected errors, range above and bearing below."""
    fig = plotting.figure(7.2, 5.0)
    panels = plotting.axes(fig, 2, len(models), sharex="row", sharey="row")
    for (label, model), (top, bottom) in zip(models.items(), panels.T, strict=True):
        e, R = model.residuals(log), model.R(log.range, log.bearing)
        for ax, x, i, unit in ((top, log.range, 0, 1.0), (bottom, log.bearing, 1, 1e3)):
            order = np.argsort(x)
            sigma = np.sqrt(R[:, i, i])
            ax.plot(x, unit * e[:, i], ".", ms=2.5, color=plotting.MEASUREMENT, alpha=0.45)
            for sign in (-2, 2):
                ax.plot(x[order], unit * sign * sigma[order], color=plotting.BAND, lw=1.4)
            inside = np.mean(np.abs(e[:, i]) < 2 * sigma)
            ax.set_title(f"{label}: {inside:.0%} inside ±2σ", loc="left")
        top.set_xlabel("measured range [m]")
        bottom.set_xlabel("measured bearing [rad]")
    panels[0, 0].set_ylabel("range error [m]")
    panels[1, 0].set_ylabel("bearing error [mrad]")
    fig.suptitle(name, x=0.01, ha="left", fontsize=11.5)
    return fig


def standardised(model: NoiseModel, log: Log) -> Array:
    """Corrected errors in units of the spread that the model states for each, (n, 2)."""
    return model.residuals(log) / np.sqrt(np.diagonal(model.R(log.range, log.bearing), axis1=-2, axis2=-1))


def honesty(log: Log, models: dict[str, NoiseModel]) -> Figure:
    """Mean square of the range errors over the variance stated for them, by range: 1 for an honest model."""
    fig = plotting.figure(7.2, 3.4)
    ax = plotting.axes(fig)
    edges = np.array([1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20.5])
    worst = []
    for (name, model), colour in zip(models.items(), (plotting.MEASUREMENT, plotting.ESTIMATE), strict=True):
        middles, ratios, _ = binned(log.true_range, standardised(model, log)[:, 0] ** 2, edges)
        (line,) = ax.plot(middles, ratios, "o-", color=colour, label=name)
        plotting.label_lines(ax, [line])
        worst.append(f"{name} reaches {ratios.max():.2g}")
    ax.axhline(1, color=plotting.BAND, ls="--", lw=1.2)
    ax.set(yscale="log", xlabel="true range [m]", ylabel="mean square error / stated variance", xlim=(1, 21.5))
    ax.set_title("An honest model stays at 1; " + ", ".join(worst), loc="left")
    return fig


def memory(log: Log, residuals: Array, name: str, lags: int = 120) -> Figure:
    """How long a residual remembers the ones before it."""
    fig = plotting.figure(7.2, 3.2)
    ax = plotting.axes(fig)
    rho = autocorrelation(residuals, lags)
    ax.fill_between(np.arange(lags + 1), rho, step="mid", color=plotting.ESTIMATE, alpha=0.35)
    ax.axhspan(-2 / np.sqrt(len(log)), 2 / np.sqrt(len(log)), color=plotting.BAND, alpha=0.25, lw=0)
    ax.annotate("what independent samples would show", (lags, 0), xytext=(0, -12), textcoords="offset points",
                ha="right", color=plotting.BAND, fontsize=9.5)  # fmt: skip
    ax.set(xlabel="samples later", ylabel="autocorrelation", xlim=(0, lags))
    ax.set_title(
        f"{name}: {len(log)} samples are worth {effective_samples(residuals):.0f} independent ones", loc="left"
    )
    return fig


def reports_and_ours(log: Log) -> dict[str, NoiseModel]:
    """Both models, fitted to one log."""
    return {"report": fit_piecewise(log), "calibrated": fit_calibrated(log)}
