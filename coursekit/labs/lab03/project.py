"""Lab 3's project: a noise model for a sensor that nobody has described, judged on a drive that it has not seen.

The design is a class::

    class MyNoiseModel:
        def __init__(self, r, phi, r_true, phi_true, turn_rate, speed): ...   # a log: six arrays (N,)
        def correct(self, r, phi, turn_rate, speed): ...                      # → range and bearing, (N,) each
        def R(self, r, phi, turn_rate, speed): ...                            # → their covariances (N, 2, 2)
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from coursekit.geometry import Array, wrap_angle
from coursekit.noise import Log, fit_calibrated
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean
from coursekit.teaching.judging import Trouble
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project

HEIGHT, RATE, SECONDS = 0.5, 30, 50  # m; samples a second; length of a drive
PARTS = (0.0, 3.0, 6.0, 25.0), (0.0, 0.05, 2.0)  # honesty is asked for by range, m, and by turn rate, rad/s


@dataclass(frozen=True)
class Sensor:
    """A camera and a landmark: what the design has to find out."""

    radius: float  # m
    lens: float  # m ahead of the robot's centre
    focal: float  # px
    missing: float  # px of height that are not counted
    pixels: float  # px of noise in the height
    turn: float  # rad by which the camera is turned
    floor: float  # rad of noise in the bearing
    delay: float  # s
    jitter: float  # s

    @staticmethod
    def draw(rng: np.random.Generator) -> Sensor:
        """A sensor of its own for each run."""
        low = np.array([0.05, 0.0, 400.0, -1.5, 0.15, -0.01, 0.001, 0.03, 0.005])
        high = np.array([0.2, 0.12, 800.0, 1.5, 0.4, 0.01, 0.003, 0.1, 0.015])
        return Sensor(*rng.uniform(low, high))


@dataclass(frozen=True)
class Scenario:
    """The log to learn from and the one to be judged on, (6, N) each: r, phi, r_true, phi_true, turn_rate, speed."""

    train: Array
    test: Array


def make(rng: np.random.Generator) -> Scenario:
    """Two drives with one sensor."""
    sensor = Sensor.draw(rng)
    return Scenario(_drive(sensor, rng), _drive(sensor, rng))


def _drive(sensor: Sensor, rng: np.random.Generator) -> Array:
    """Away from the landmark and back, then turning left and right before it, as in the lab's log."""
    t = np.arange(SECONDS * RATE) / RATE
    far, swing, period = rng.uniform(10, 16), rng.uniform(0.4, 0.55), rng.uniform(4.0, 6.0)

    def truth(t: Array) -> tuple[Array, Array]:
        away = np.clip(t / 15, 0, 1) - np.clip((t - 15) / 15, 0, 1)
        r = 1.5 + (far - 1.5) * (3 * away**2 - 2 * away**3)
        turning = np.clip((t - 30) / 2, 0, 1)
        return r, turning * swing * np.sin(2 * np.pi * (t - 30) / period) + 0.02 * np.sin(t)

    r, phi = truth(t)
    dr, dphi = ((np.array(truth(t + 1e-4)) - np.array(truth(t - 1e-4))) / 2e-4).tolist()
    speed = -np.array(dr) / np.cos(phi)
    turn_rate = speed * np.sin(phi) / r - np.array(dphi)
    age = np.maximum(sensor.delay + sensor.jitter * rng.standard_normal(t.size), 0.0)
    then_r, then_phi = truth(t - age)
    ahead, left = then_r * np.cos(then_phi) - sensor.lens, then_r * np.sin(then_phi)
    depth = ahead - sensor.radius
    height = HEIGHT * sensor.focal / depth - sensor.missing + sensor.pixels * rng.standard_normal(t.size)
    measured = np.arctan2(left, ahead) - sensor.turn + sensor.floor * rng.standard_normal(t.size)
    measured_r = HEIGHT * sensor.focal / (np.maximum(height, 3.0) * np.cos(np.arctan2(left, ahead)))
    return np.stack([measured_r, measured, r, phi, turn_rate, speed])


def run(design: Any, scenario: Scenario, watch: Any) -> dict[str, Array]:
    """Fit to one drive and be judged on the other: errors, their share of the stated variance, nats per sample."""
    model = watch.call("MyNoiseModel(…)", design, *scenario.train)
    watch.advance()
    r, phi, r_true, phi_true, turn_rate, speed = scenario.test
    corrected = watch.call("correct()", watch.attribute(model, "correct"), r, phi, turn_rate, speed)
    now = watch.numbers("what correct() returns", corrected, (2, r.size))
    watch.advance()
    covs = watch.numbers("R", watch.call("R()", watch.attribute(model, "R"), r, phi, turn_rate, speed), (r.size, 2, 2))
    eigenvalues = np.linalg.eigvalsh(0.5 * (covs + np.swapaxes(covs, -1, -2)))
    if eigenvalues.min() <= 0:
        raise Trouble(f"R of sample {int(np.argmin(eigenvalues[:, 0])) + 1} is not positive definite")
    watch.advance()
    errors = np.stack([now[0] - r_true, wrap_angle(now[1] - phi_true)], axis=-1)
    squared = np.einsum("ni,ni->n", errors, np.linalg.solve(covs, errors[..., None])[..., 0])
    nats = -0.5 * (squared + np.linalg.slogdet(2 * np.pi * covs)[1])
    shares = errors**2 / np.diagonal(covs, axis1=1, axis2=2)
    return {
        "nats": np.array(np.mean(nats)),
        "rms": np.sqrt(np.mean(errors**2, axis=0)),
        "shares": np.array(_by_part(shares, r_true, turn_rate)),
        "range": r_true,
        "errors": errors,
        "sigmas": np.sqrt(np.diagonal(covs, axis1=1, axis2=2)),
    }


def _by_part(shares: Array, r_true: Array, turn_rate: Array) -> list[float]:
    """Mean square error over variance: of the range by range, of the bearing by turn rate."""
    found = [shares[(a <= r_true) & (r_true < b), 0].mean() for a, b in pairwise(PARTS[0])]
    turned = np.abs(turn_rate)
    return found + [shares[(a <= turned) & (turned < b), 1].mean() for a, b in pairwise(PARTS[1])]


class Reference:
    """The package's own: ``fit_calibrated``."""

    def __init__(self, r: Array, phi: Array, r_true: Array, phi_true: Array, turn_rate: Array, speed: Array) -> None:
        self._model = fit_calibrated(Log(r, phi, r_true, phi_true, np.arange(r.size) / RATE, speed=speed,
                                         turn_rate=turn_rate))  # fmt: skip

    def correct(self, r: Array, phi: Array, turn_rate: Array, speed: Array) -> tuple[Array, Array]:
        """Bias and delay taken out."""
        return self._model.correct(r, phi, turn_rate, speed)

    def R(self, r: Array, phi: Array, turn_rate: Array, speed: Array) -> Array:
        """(N, 2, 2)."""
        return self._model.R(r, phi, turn_rate, speed)


def likely(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """All points within 0.25 nats per sample of the package, none at 3."""
    got, package = (np.mean([o.values["nats"] for o in runs]) for runs in (mine, theirs))
    share = float(np.clip((3.0 - (package - got)) / 2.75, 0.0, 1.0))
    return share, f"{got:.2f} nats per sample (the package: {package:.2f}; full points up to 0.25 below)"


def accurate(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """Errors over the package's, the worse of the two coordinates: all points up to 1.1, none at 2."""
    got, package = (np.mean([o.values["rms"] for o in runs], axis=0) for runs in (mine, theirs))
    worse = float(np.max(got / package))
    share = float(np.clip((2.0 - worse) / 0.9, 0.0, 1.0))
    return share, (f"range {got[0]:.3f} m (the package: {package[0]:.3f}), "
                   f"bearing {1e3 * got[1]:.1f} mrad ({1e3 * package[1]:.1f})")  # fmt: skip


def honest(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
    """The share of parts in which mean square error over variance, averaged over the runs, lies in 0.6 to 1.6."""
    ratios = np.mean([o.values["shares"] for o in mine], axis=0)
    inside = (ratios > 0.6) & (ratios < 1.6)
    said = ", ".join(f"{value:.2g}" for value in ratios)
    share = float(inside.mean())
    where = ("near", "at 3 to 6 m", "far", "at rest", "in turns")
    wrong = [f"{name} it is {'too sure' if value > 1 else 'too modest'}"
             for name, value, good in zip(where, ratios, inside, strict=True) if not good]  # fmt: skip
    return share, "; ".join([f"mean square error over variance {said} (1 is right)", *wrong])


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """Corrected range errors of one run with the stated ±2σ, and the ratios by part, beside the package's."""
    fig = plotting.figure(8.6, 3.4)
    left, right = plotting.axes(fig, 1, 2, width_ratios=[1.3, 1])
    order = np.argsort(mine["range"])
    left.plot(mine["range"], mine["errors"][:, 0], ".", ms=2.5, color=plotting.MEASUREMENT, alpha=0.5, label="error")
    for sign in (-2, 2):
        left.plot(mine["range"][order], sign * mine["sigmas"][order, 0], color=plotting.BAND, lw=1,
                  label="your ±2σ" if sign > 0 else None)  # fmt: skip
    left.set(xlabel="true range [m]", ylabel="corrected − true range [m]",
             title=f"Range error {mine['rms'][0]:.3f} m (RMS)")  # fmt: skip
    left.legend(loc="upper left", bbox_to_anchor=(0, -0.18), ncols=2)
    names = ["near", "3–6 m", "far", "at rest", "in turns"]
    right.plot(mine["shares"], range(5), "o", color=plotting.ESTIMATE, label="your model")
    right.plot(theirs["shares"], range(5), "d", color=plotting.ODOMETRY, label="the package")
    right.axvspan(0.6, 1.6, color=plotting.BAND, alpha=0.2, lw=0)
    right.set(xscale="log", yticks=range(5), yticklabels=names, xlabel="mean square error / variance",
              title="Honest is 1", ylim=(4.5, -0.5))  # fmt: skip
    right.xaxis.set(major_locator=FixedLocator([0.01, 0.1, 0.3, 0.6, 1, 1.6, 3, 10, 100]), major_formatter="{x:g}",
                    minor_locator=NullLocator())  # fmt: skip
    right.legend(loc="upper left", bbox_to_anchor=(-0.1, -0.18), ncols=2)
    return fig


PROJECT = Project(
    name="lab03",
    title="A noise model",
    make=make,
    run=run,
    reference=Reference,
    criteria=(
        Criterion("likelihood on a new drive", 40, likely),
        Criterion("error after correction, RMS", 20, accurate),
        Criterion("honesty, part by part", 30, honest),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
    runs=8,
)
