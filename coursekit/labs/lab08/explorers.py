"""Lab 8's explorers: a frame and its place on the map, a cloud that starves or does not, the width of a peak."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np
from matplotlib.artist import Artist

from coursekit import particles
from coursekit.gaussian import Gaussian, ellipse
from coursekit.geometry import Array
from coursekit.labs.lab08.figures import alive, bare, draw_map, outline, rgb, weight_colours
from coursekit.labs.lab08.runs import PLACES, WATER, poses_of
from coursekit.particles import Particles
from coursekit.results import Rejected
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed
from coursekit.visual import (
    DirectMatcher,
    Fix,
    MapMatcher,
    MotionCalibration,
    VisualFilter,
    dominant_cluster,
    inflated,
    log_likelihood,
    odometry_from_image,
)
from coursekit.visual.direct import shrink
from coursekit.visual.pictures import as_grey
from coursekit.world import seafloor
from coursekit.world.seafloor import DT, FRAME, Dive, look


class Matching:
    """A place and a kind of water → the frame with its inliers, what the map shows there, and the fix on the map."""

    def __init__(self, matcher: MapMatcher) -> None:
        self.matcher = matcher
        self.figure = plotting.figure(7.2, 4.4)
        panels: Any = self.figure.subfigures(2, 1, height_ratios=[1, 1.05])
        left, right = (bare(ax) for ax in plotting.axes(panels[0], 1, 2))
        below = plotting.axes(panels[1])
        blank = np.zeros((FRAME // 2, FRAME // 2, 3), np.uint8)
        where = {"extent": (-0.5, FRAME - 0.5, FRAME - 0.5, -0.5), "interpolation": "bilinear"}
        self.frame, self.window = left.imshow(blank, **where), right.imshow(blank, **where)
        (self.dots,) = left.plot([], [], ".", color="#00e5a8", ms=3.5)
        self.names = [left.set_title("the camera's frame", loc="center"), right.set_title(" ", loc="center")]
        self.title = draw_map(below, faint=True)
        (self.outline,) = below.plot([], [], color=plotting.ESTIMATE, lw=2.4)
        (self.on_map,) = below.plot([], [], ".", color="#00e5a8", ms=1.5)
        self.moving: list[Artist] = [
            self.frame, self.window, self.dots, *self.names, self.title, self.outline, self.on_map,
        ]  # fmt: skip
        self.seen = lru_cache(maxsize=64)(self._seen)

    def _seen(self, place: int, water: str) -> tuple[Any, Fix | Rejected, Any]:
        rng = np.random.default_rng([lab_seed(8), place])
        pose = np.array(PLACES[place - 1])
        frame = look(seafloor.load(), pose, time=3.0 * place, rng=rng, **WATER[water])  # type: ignore[arg-type]
        fix = self.matcher.locate(frame)
        window = np.full((FRAME // 2, FRAME // 2, 3), 235, np.uint8)
        if isinstance(fix, Fix):
            window = rgb(look(seafloor.load(), fix.pose, scale=fix.scale), 2)
        return rgb(frame, 2), fix, window

    def update(self, *, place: int, water: str) -> None:
        frame, fix, window = self.seen(place, water)
        self.frame.set_data(frame)
        self.window.set_data(window)
        found = isinstance(fix, Fix)
        pairs = fix.pairs if isinstance(fix, Fix) else np.empty((0, 4))
        self.dots.set_data(*pairs[:, :2].T)
        self.on_map.set_data(*pairs[:, 2:].T)
        self.outline.set_data(*(outline(fix.pose, fix.scale).T if isinstance(fix, Fix) else ([], [])))
        self.names[1].set_text("the map, seen from the fix" if found else "no fix")
        self.title.set_text(self._words(fix, PLACES[place - 1]))

    @staticmethod
    def _words(fix: Fix | Rejected, truth: Sequence[float]) -> str:
        if isinstance(fix, Rejected):
            return f"rejected: {fix.reason}"
        off, sigma = np.hypot(*(fix.pose[:2] - truth[:2])), np.sqrt(np.trace(fix.cov[:2, :2]) / 2)
        return f"{fix.inliers} inliers: {off:.3f} px off, expected about {sigma:.3f} px along each axis"

    def alt(self, place: int, water: str) -> str:
        fix = self.seen(place, water)[1]
        return f"A frame of the sea floor in {water} water, and the map below: {self._words(fix, PLACES[place - 1])}"


class Following:
    """A frame of the dive, a way to weigh, a number of particles → the cloud on the map and close up, and the error."""

    WAYS: ClassVar = ["its own", "50 px", "mixed"]

    def __init__(self, dived: Dive, fixes: Sequence[Fix | Rejected], calibration: MotionCalibration) -> None:
        self.dive, self.fixes, self.calibration = dived, fixes, calibration
        self.truth = odometry_from_image(dived.poses)
        self.figure = plotting.figure(7.6, 4.4)
        panels: Any = self.figure.subfigures(2, 1, height_ratios=[1, 1.1])
        above = plotting.axes(panels[0])
        camera, near, error = plotting.axes(panels[1], 1, 3, width_ratios=[1, 1, 1.35])
        self.title = draw_map(above, faint=True)
        self.cloud = above.scatter([np.nan], [np.nan], s=[9], lw=0)
        (self.outline,) = above.plot([], [], color=plotting.TRUTH, lw=1.6)
        self.frame = bare(camera).imshow(np.zeros((FRAME // 4, FRAME // 4, 3), np.uint8))
        self.says = camera.set_title(" ", loc="left", fontsize=9.5)
        near.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal", xticks=[], yticks=[], xlabel="east of the truth")
        near.axhline(0, color=plotting.TRUTH, lw=0.6)
        near.axvline(0, color=plotting.TRUTH, lw=0.6)
        self.near_title = near.set_title(" ", loc="left", fontsize=9.5)
        self.close = near.scatter([np.nan], [np.nan], s=[9], lw=0)
        (self.seen,) = near.plot([], [], "+", color=plotting.MEASUREMENT, ms=11, mew=1.8)
        (self.ellipse,) = near.plot([], [], color=plotting.BAND, lw=2)
        error.set(xlim=(0, len(dived)), ylim=(2e-3, 3e3), yscale="log", xlabel="frame")
        error.set_title("distance from the truth [px]", loc="left")
        off = np.hypot(*(poses_of(fixes) - self.truth)[:, :2].T)
        error.plot(off, "+", color=plotting.MEASUREMENT, ms=4, label="fix")
        (self.line,) = error.plot([], [], color=plotting.ESTIMATE, lw=1.4, label="filter")
        (self.now,) = error.plot([], [], "o", color=plotting.ESTIMATE, ms=6)
        error.legend(loc="upper left", fontsize=8.5, ncols=2)
        self.moving: list[Artist] = [
            self.title, self.cloud, self.outline, self.frame, self.says, self.close, self.near_title, self.seen,
            self.ellipse, self.line, self.now,
        ]  # fmt: skip
        self.run = lru_cache(maxsize=16)(self._run)
        self.picture = lru_cache(maxsize=128)(self._picture)

    def _run(self, n: int, way: str) -> tuple[list[Particles], list[Gaussian], Array]:
        rng = np.random.default_rng(lab_seed(8))
        robot = VisualFilter(self.dive.map_image.shape, self.calibration.motion)
        controls = self.calibration.control(self.dive.commands)
        cloud = robot.uniform(n, rng)
        clouds = []
        for k, fix in enumerate(self.fixes):
            control = controls[max(k - 1, 0)] * (k > 0)
            if way == "mixed":
                cloud = robot.step(cloud, control, DT, fix, rng)
            else:
                cloud = particles.predict(particles.resample(cloud, rng), robot.motion, control, DT, rng)
                if isinstance(fix, Fix):
                    believed = fix.belief if way == "its own" else inflated(fix.belief)
                    cloud = particles.weigh(cloud, log_likelihood(believed))
            clouds.append(cloud)
        beliefs = [dominant_cluster(c) for c in clouds]
        return clouds, beliefs, np.hypot(*(np.array([b.mean for b in beliefs]) - self.truth)[:, :2].T)

    def update(self, *, frame: int, particles: int, likelihood: str) -> None:
        clouds, beliefs, error = self.run(particles, likelihood)
        cloud, belief, truth, fix = clouds[frame], beliefs[frame], self.truth[frame], self.fixes[frame]
        relative = cloud.weights / cloud.weights.max()
        shown = {"sizes": 4 + 26 * np.sqrt(relative), "facecolors": weight_colours(relative)}
        self.cloud.set(offsets=cloud.states[:, :2] * [1, -1], **shown)
        self.outline.set_data(*outline(self.dive.poses[frame], self.dive.light[frame, 0]).T)
        self.frame.set_data(rgb(self.picture(frame), 1))
        self.says.set_text(f"frame {frame}: {fix.inliers if isinstance(fix, Fix) else 'no'} inliers")
        reach = next(r for r in (0.3, 3.0, 30.0, 300.0, 3000.0) if r > 1.5 * min(error[frame], 1900))
        offsets = cloud.states[:, :2] - truth[:2]
        self.close.set(offsets=offsets / reach, **shown)
        self.near_title.set_text(f"close up, ± {reach:g} px")
        self.seen.set_data(*((fix.belief.mean - truth)[:2, None] / reach if isinstance(fix, Fix) else ([], [])))
        self.ellipse.set_data(*(((belief.mean - truth)[:2] + ellipse(belief.cov[:2, :2])) / reach).T)
        self.line.set_data(np.arange(frame + 1), error[: frame + 1])
        self.now.set_data([frame], [error[frame]])
        self.title.set_text(f"{_distance(error[frame])} off; {alive(cloud):.0f} of {len(cloud)} particles count")

    def _picture(self, frame: int) -> Any:
        """The frame at a quarter of its size."""
        return cv2.resize(self.dive.frame(frame), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)

    def alt(self, frame: int, particles: int, likelihood: str) -> str:
        clouds, _, error = self.run(particles, likelihood)
        seen = "matched" if isinstance(self.fixes[frame], Fix) else "not matched"
        return (
            f"Frame {frame}, {seen}: the estimate is {_distance(error[frame])} from the truth, "
            f"{alive(clouds[frame]):.0f} of {particles} particles count, likelihood {likelihood}"
        )


def _distance(px: float) -> str:
    return f"{px:.2f} px" if px < 10 else f"{px:.0f} px"


class Peak:
    """A level of the pyramid, a heading's error and the water → how the fit falls off around the truth."""

    POSE: ClassVar = np.array([700.0, 400.0, 0.7])

    def __init__(self) -> None:
        self.figure = plotting.figure(7.2, 3.9)
        camera, fit = plotting.axes(self.figure, 1, 2, width_ratios=[1, 1.25])
        self.frame = bare(camera).imshow(np.zeros((4, 4)), cmap="gray", vmin=0, vmax=255, extent=(0, 1, 1, 0))
        self.size = camera.set_title(" ", loc="center")
        self.reach = np.linspace(-96, 96, 33)
        half = 96 + 3
        self.fit = fit.imshow(np.zeros((33, 33)), extent=(-half, half, -half, half), origin="lower", vmin=0, vmax=1,
                              cmap="viridis", interpolation="bilinear")  # fmt: skip
        (self.best,) = fit.plot([], [], "+", color=plotting.MEASUREMENT, ms=12, mew=2)
        fit.set(xlabel="east of the truth [px]", ylabel="north of the truth [px]")
        fit.grid(visible=False)
        self.figure.colorbar(self.fit, ax=fit, label="correlation ρ")
        self.title = fit.set_title(" ", loc="left")
        self.moving: list[Artist] = [self.frame, self.size, self.fit, self.best, self.title]
        self.landscape = lru_cache(maxsize=128)(self._landscape)

    @staticmethod
    @lru_cache(maxsize=8)
    def picture(water: str) -> Any:
        """The frame in grey."""
        frame = look(seafloor.load(), Peak.POSE, rng=np.random.default_rng(lab_seed(8)), **WATER[water])  # type: ignore[arg-type]
        return as_grey(frame, "frame")

    def _landscape(self, level: int, turned: int, water: str) -> tuple[Any, Array]:
        picture = self.picture(water)
        shift = np.stack([*np.meshgrid(self.reach, self.reach), np.full((33, 33), np.radians(turned))], axis=-1)
        states = odometry_from_image(self.POSE) + shift.reshape(-1, 3)
        rho = DirectMatcher(seafloor.load(), level).correlation(picture)(states).reshape(33, 33)
        return shrink(picture, level) + picture.mean(), rho

    def update(self, *, level: int, turned: int, water: str) -> None:
        small, rho = self.landscape(level, turned, water)
        self.frame.set_data(small)
        self.size.set_text(f"{small.shape[0]} × {small.shape[1]} pixels compared")
        self.fit.set_data(rho)
        i, j = np.unravel_index(rho.argmax(), rho.shape)
        self.best.set_data([self.reach[j]], [self.reach[i]])
        self.title.set_text(self._words(rho))

    def _words(self, rho: Array) -> str:
        wide = 6.0 * np.sqrt(np.sum(rho > 0.5 * max(rho.max(), 1e-9)) / np.pi)
        return f"best ρ {rho.max():.2f}, half of that {wide:.0f} px away"

    def alt(self, level: int, turned: int, water: str) -> str:
        return (
            f"Map of how well the {water} picture fits around the truth with the heading {turned}° off, level {level}: "
            f"{self._words(self.landscape(level, turned, water)[1])}"
        )
