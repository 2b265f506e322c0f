"""Lab 8's failures, drawn."""

from __future__ import annotations

import cv2
import numpy as np
from matplotlib.figure import Figure

from coursekit import particles
from coursekit.gaussian import Gaussian
from coursekit.labs.lab08 import failures
from coursekit.particles import Particles
from coursekit.visual import dominant_cluster
from reference.pictures.paper import GREY, RIGHT, TRUTH, WRONG, one, two


def _errors(step: failures.Callable[..., Particles]) -> tuple[list[float], list[float]]:
    rng, pose = np.random.default_rng(0), np.array([800.0, -400.0, 0.3])
    cloud = Particles(pose + rng.standard_normal((500, 3)) * [2, 2, 0.02], angles=(2,))
    errors, sensor = [], []
    for _ in range(30):
        pose = failures.MOTION.sample(pose[None], failures.CONTROL, failures.DT, rng)[0]
        noise = np.linalg.cholesky(failures.SHARP) @ rng.standard_normal(3)
        cloud = step(cloud, Gaussian(pose + noise, failures.SHARP), rng)
        errors.append(float(np.hypot(*(dominant_cluster(cloud).mean - pose)[:2])))
        sensor.append(float(np.hypot(*noise[:2])))
    return errors, sensor


def _against_the_sensor(step: failures.Callable[..., Particles], name: str) -> Figure:
    fig, ax = one(xlabel="frame", ylabel="position error [px]", yscale="log")
    wrong, sensor = _errors(step)
    ax.plot(sensor, color=GREY, label="the fix itself")
    ax.plot(wrong, color=WRONG, lw=2, label=name)
    ax.plot(_errors(failures.mixed)[0], color=RIGHT, lw=2, label="mixed proposal")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def starved() -> Figure:
    """Error over thirty frames: with the sensor's own covariance the filter is as good as its nearest particle."""
    return _against_the_sensor(failures.starved, "plain filter")


def tuned_by_hand() -> Figure:
    """Error over thirty frames: with a spread of 50 px the filter is hundreds of times worse than its own fixes."""
    return _against_the_sensor(failures.tuned_by_hand, "50 px, 0.314 rad")


def trusting() -> Figure:
    """One wrong match, 700 px away, where one stray particle happens to be: which side has the weight afterwards?"""
    rng = np.random.default_rng(0)
    states = np.vstack([np.array([800.0, -400.0, 0.3]) + rng.standard_normal((999, 3)), [1500.0, -400.0, 0.3]])
    cloud = Particles(states, np.append(np.zeros(999), np.log(1e-9)), angles=(2,))
    wrong = Gaussian(states[-1], np.diag([1.0, 1.0, 1e-4]))
    fig, axes = two("every match is right", "one in fifty is wrong", sharey=True)
    for ax, likelihood, colour in zip(axes, (failures.trusting, failures.doubting), (WRONG, RIGHT), strict=True):
        weights = particles.weigh(cloud, likelihood(wrong)).weights
        ax.bar([800, 1500], [weights[:-1].sum(), weights[-1]], 150, color=colour)
        ax.set(xticks=[800, 1500], xlabel="x on the map [px]", ylim=(0, 1))
    axes[0].set_ylabel("weight")
    return fig


def unwrapped_yaw() -> Figure:
    """Log-likelihood round a fix that looks west: with a bare minus, particles just across ±π lose all their weight."""
    fix = Gaussian(np.array([0.0, 0.0, np.pi]), np.diag([1.0, 1.0, 0.1**2]))
    off = np.linspace(-0.3, 0.3, 121)
    states = np.c_[np.zeros((121, 2)), (np.pi + off + np.pi) % (2 * np.pi) - np.pi]
    fig, ax = one(xlabel="heading minus π [rad]", ylabel="log-likelihood")
    for likelihood, colour, name in ((failures.bare_minus, WRONG, "bare minus"), (failures.trusting, RIGHT, "wrapped")):
        values = likelihood(fix)(states)
        ax.plot(off, values - values.max(), ".", color=colour, ms=4, label=name)
    ax.set_yscale("symlog")
    ax.legend()
    return fig


def mixed_frames() -> Figure:
    """A robot that drives on the map, and where the motion model goes from its converted pose: unconverted yaw sends it
    another way.
    """
    fig, axes = two("yaw taken as it is", "θ = π/2 − yaw", sharey=True)
    for ax, convert, colour in zip(
        axes, (failures.unconverted, failures.odometry_from_image), (WRONG, RIGHT), strict=True
    ):
        for yaw in np.linspace(-3, 3, 7):
            start = np.array([0.0, 0.0, yaw])
            ahead = start + np.array([10 * np.sin(yaw), -10 * np.cos(yaw), 0])
            ax.plot(*np.array([convert(start), convert(ahead)])[:, :2].T, color=TRUTH, lw=4, alpha=0.3)
            ax.plot(*np.array([convert(start), failures._ahead(convert(start))])[:, :2].T, color=colour, lw=1.5)
        ax.set(xlabel="x [px]", aspect="equal")
    axes[0].set_ylabel("y [px]")
    return fig


def greatest_of_equals() -> Figure:
    """Estimates from forty resampled clouds 5 px wide: the greatest of equal weights jitters, the mean does not."""
    rng, clouds = np.random.default_rng(0), []
    for _ in range(40):
        clouds.append(particles.resample(Particles(rng.standard_normal((400, 3)) * [5, 5, 0.1], angles=(2,)), rng))
    fig, ax = one(xlabel="x [px]", ylabel="y [px]", aspect="equal")
    for estimate, colour, name in ((failures.heaviest, WRONG, "greatest weight"), (failures.average, RIGHT, "mean")):
        ax.plot(*np.array([estimate(cloud)[:2] for cloud in clouds]).T, "o", color=colour, ms=4, label=name)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def default_upscale() -> Figure:
    """Where features lie after the picture was turned by half a turn and back: they should not have moved at all."""
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.integers(0, 256, (240, 240), dtype=np.uint8), (0, 0), 2.5)
    grey = cv2.normalize(grey, None, 0, 255, cv2.NORM_MINMAX)
    fig, ax = one(xlabel="shift in u [px]", ylabel="shift in v [px]", aspect="equal", xlim=(-1, 1), ylim=(-1, 1))
    kinds = ((failures.default_features, WRONG, "default"), (failures.precise_features, RIGHT, "precise upscale"))
    for features, colour, name in kinds:
        (upright, a), (turned, b) = features(grey), features(np.ascontiguousarray(grey[::-1, ::-1]))
        pairs = cv2.BFMatcher(crossCheck=True).match(a, b)
        shift = np.array([upright[m.queryIdx] - (239 - turned[m.trainIdx]) for m in pairs])
        ax.plot(*shift.T, ".", color=colour, ms=4, label=name)
    ax.plot(0, 0, "+", color=TRUTH, ms=12)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig


def eight_parameters() -> Figure:
    """The picture's centre from features along one side, sixty draws: a homography bends to the noise, a similarity
    cannot.
    """
    rng, kept = np.random.default_rng(0), {failures.eight_parameters: [], failures.four_parameters: []}
    for _ in range(60):
        source = rng.uniform([-190, -190], [-60, 190], (40, 2))
        target = source + [500.0, 400.0] + 0.2 * rng.standard_normal((40, 2))
        for centre, found in kept.items():
            found.append(centre(source, target) - [500.0, 400.0])
    fig, ax = one(xlabel="error in u [px]", ylabel="error in v [px]", aspect="equal")
    for (_, found), colour, name in zip(kept.items(), (WRONG, RIGHT), ("eight parameters", "four"), strict=True):
        ax.plot(*np.array(found).T, "o", color=colour, ms=4, label=name)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return fig
