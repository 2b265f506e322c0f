"""Lab 0's explorers: a recorded drive, clouds of endings, and a robot to drive yourself."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib.resources import files
from typing import Any

import anywidget
import numpy as np
import traitlets
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from coursekit.gaussian import ellipse
from coursekit.geometry import Array, transform
from coursekit.labs.lab00.runs import ARC, PERIOD, RADIUS_SQUARED, SPEED, START, endings, reckon, recording
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed
from coursekit.teaching.explore import Explorer, png
from coursekit.world.arena import Arena
from coursekit.world.robot import Robot, World


class Stage:
    """The lab's arena from above with a robot that moves, its two tracks and its ellipse."""

    def __init__(self, arena: Arena) -> None:
        self.figure = plotting.figure(7.2, 4.4)
        self.ax: Axes = plotting.axes(self.figure)
        plotting.draw_arena(self.ax, replace(arena, crates=()))
        self.shapes = [crate.corners for crate in arena.crates]
        self.crates = [Polygon(shape, facecolor="#d8c3a5", edgecolor=plotting.WALL, lw=0.8) for shape in self.shapes]
        for crate in self.crates:
            self.ax.add_patch(crate)
        (self.true_track,) = self.ax.plot([], [], color=plotting.TRUTH, label="truth")
        (self.told_track,) = self.ax.plot([], [], color=plotting.ODOMETRY, ls="--", label="dead reckoning")
        self.ellipse = plotting.draw_ellipse(
            self.ax, [0, 0], np.eye(2), plotting.ESTIMATE, label="95 % ellipse", zorder=6
        )
        self.ghost = plotting.draw_robot(self.ax, np.zeros(3), plotting.ODOMETRY, alpha=0.7)
        self.robot = plotting.draw_robot(self.ax, np.zeros(3), plotting.TRUTH)
        self.title = self.ax.set_title("the robot", loc="left")
        box = {"boxstyle": "rarrow,pad=0.25", "fc": "white", "ec": plotting.ODOMETRY}
        self.far = self.ax.text(0, 0, "", ha="center", va="center", bbox=box, zorder=7)
        self.ax.set(xlim=(-4.2, 4.2), ylim=(-3.2, 3.2))
        self.ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)
        self.moving = [*self.crates, self.true_track, self.told_track, self.ellipse, self.ghost, self.robot,
                       self.title, self.far]  # fmt: skip

    def show(self, truth: Array, told: Array, cov: Array, crates: Array, title: str) -> None:
        """Tracks (n, 3), the covariance of the last pose told, crates (k, 3), and what the title says."""
        for patch, shape, pose in zip(self.crates, self.shapes, crates, strict=True):
            patch.set_xy(transform(pose, shape))
        self.true_track.set_data(*truth[:, :2].T)
        self.told_track.set_data(*told[:, :2].T)
        self.ellipse.set_data(*(told[-1, :2] + ellipse(cov[:2, :2])).T)
        self.ghost.set_xy(plotting.robot_outline(told[-1]))
        self.robot.set_xy(plotting.robot_outline(truth[-1]))
        self.title.set_text(title)
        self._point_at(told[-1, :2], truth[-1, :2])

    def _point_at(self, told: Array, truth: Array) -> None:
        """Where the told track has left the picture, an arrow at the edge says which way and how far off it is."""
        edge = np.clip(told, [-3.4, -2.8], [3.4, 2.8])
        way, off = told - edge, np.hypot(*(told - truth))
        self.far.set_visible(bool(np.any(np.abs(told) > [4.2, 3.2])))
        self.far.set_position(tuple(edge))
        left = way[0] < 0
        self.far.set_rotation(np.degrees(np.arctan2(-way[1] if left else way[1], abs(way[0]))))
        self.far.get_bbox_patch().set_boxstyle("larrow" if left else "rarrow", pad=0.25)
        self.far.set_text(f"{off:.1f} m off")


class RecordedDrive(Stage):
    """One drive through the lab, replayed: ``time`` in seconds, ``slip`` of the wheels in per cent."""

    def __init__(self) -> None:
        super().__init__(Arena.load("lab"))
        self.seed = lab_seed(0) + 8

    def update(self, time: float, slip: float) -> None:
        """Show the drive up to a moment."""
        truth, told, covs, crates = recording(slip, self.seed)
        k = self._step(time, truth)
        title = f"After {time} s dead reckoning is {self._off(time, slip):.2f} m off"
        self.show(truth[: k + 1], told[: k + 1], covs[k], crates[k], title)

    def words(self, time: float, slip: float) -> str:
        """The text alternative of a frame."""
        truth = recording(slip, self.seed)[0]
        x, y = truth[self._step(time, truth), :2]
        off = self._off(time, slip)
        return f"The lab from above. The robot is at x {x:.1f} m, y {y:.1f} m; dead reckoning is {off:.2f} m off"

    def _off(self, time: float, slip: float) -> float:
        truth, told, _, _ = recording(slip, self.seed)
        k = self._step(time, truth)
        return float(np.hypot(*(truth[k] - told[k])[:2]))

    @staticmethod
    def _step(time: float, truth: Array) -> int:
        return min(round(time / PERIOD), len(truth) - 1)


class Endings:
    """Ten thousand endings beside their ellipse: the whole drive, and the cloud from near, both in metres."""

    TIMES = (2, 4, 6, 8, 10, 12, 14, 16, 18, 20)
    SLIPS = (1, 3, 5, 8)
    TURNS = (0.0, 0.3, 0.6)
    SHOWN = 1500

    def __init__(self) -> None:
        self.frames: dict[tuple[float, float, float], Any] = {}
        for slip in self.SLIPS:
            for turn in self.TURNS:
                for time, (cloud, mean, P) in endings(slip, turn, self.TIMES, lab_seed(0) + 2).items():
                    error = (cloud - mean)[:, :2]
                    squared = np.sum(error * np.linalg.solve(P[:2, :2], error.T).T, axis=1)
                    share = float(np.mean(squared <= RADIUS_SQUARED))
                    bend = float(np.sqrt(P[2, 2]) * SPEED * time / Robot().track)
                    shown = cloud[: self.SHOWN, :2].T, (mean[:2] + ellipse(P[:2, :2])).T, _arc(turn, time).T
                    self.frames[time, slip, turn] = *shown, share, bend
        self.figure = plotting.figure(6.6, 3.7)  # beside its text it is 454 px wide, and 9.5 pt are 9 px there
        # Room for the right panel's tick labels, which move, and for its title's subscript.
        self.figure.get_layout_engine().set(rect=(0, 0, 0.965, 0.97))  # type: ignore[union-attr, call-arg]
        self.left, self.right = plotting.axes(self.figure, 1, 2, width_ratios=[1.25, 1])
        dots = {"ls": "none", "marker": ".", "mew": 0, "color": plotting.PREDICTION}
        (path,) = self.left.plot([], [], color=plotting.ODOMETRY, lw=1, ls="--", label="as commanded")
        (far,) = self.left.plot([], [], **dots, ms=2.5, alpha=0.6, label="endings")
        (near,) = self.right.plot([], [], **dots, ms=3.5, alpha=0.6)
        contours = [plotting.draw_ellipse(ax, [0, 0], np.eye(2)) for ax in (self.left, self.right)]
        contours[0].set_label("95 % ellipse")
        plotting.draw_robot(self.left, np.zeros(3), plotting.TRUTH, size=0.7)
        self.left.set(xlim=(-2.6, 11.2), ylim=(-5.6, 5.6), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        self.right.set(xlim=(-0.01, 0.01), ylim=(-0.01, 0.01), xlabel="x [m], stretched", ylabel="y [m]")
        self.figure.legend(loc="outside lower center", ncols=3, markerscale=4, frameon=False)
        self.lines, self.contours = [path, far, near], contours
        self.titles = [self.left.set_title("endings", loc="left"), self.right.set_title("from near", loc="left")]
        for axis in (self.right.xaxis, self.right.yaxis):
            axis.set_major_locator(MaxNLocator(4))
        # The right panel follows the cloud, so its axes move as well.
        self.moving = [self.right.xaxis, self.right.yaxis, *self.lines, *contours, *self.titles]

    def update(self, time: float, slip: float, turn: float) -> None:
        """Show the endings after ``time`` s, with ``slip`` in per cent and the turn rate ``turn`` in rad/s."""
        cloud, contour, path, share, bend = self.frames[time, slip, turn]
        for line, points in zip(self.lines, (path, cloud, cloud), strict=True):
            line.set_data(*points)
        for line in self.contours:
            line.set_data(*contour)
        seen = np.concatenate([cloud, contour], axis=1)
        low, high = seen.min(axis=1), seen.max(axis=1)
        (x0, y0), (x1, y1) = low - 0.06 * (high - low), high + 0.06 * (high - low)
        self.right.set(xlim=(x0, x1), ylim=(y0, y1))
        self.titles[0].set_text(f"{100 * share:.0f} % of 10,000 runs end inside")
        self.titles[1].set_text(rf"From near: $D\sigma_\theta/b$ = {bend:.2g}")

    def facts(self, time: float, slip: float, turn: float) -> dict[str, str]:
        """What the text may quote: the share inside, turn noise × distance in track widths, and the cloud's shape."""
        *_, share, bend = self.frames[time, slip, turn]
        return {"share": f"{100 * share:.0f} %", "bend": f"{bend:.2g}", "shape": _shape(share)}

    def words(self, time: float, slip: float, turn: float) -> str:
        """The text alternative of a frame."""
        *_, share, bend = self.frames[time, slip, turn]
        return (
            f"{100 * share:.1f} % of the endings lie inside the predicted 95 % ellipse; "
            f"the cloud has the shape of {_shape(share)}. "
            f"Turn noise times distance is {bend:.2g} track widths"
        )


def _shape(share: float) -> str:
    """A cloud's shape in words, by the share of it that its 95 % ellipse holds."""
    return "an ellipse" if share > 0.94 else "a slightly bent ellipse" if share > 0.9 else "a banana"


def _arc(turn: float, time: float) -> Array:
    moments = np.linspace(1e-3, time, 60)
    return np.array([ARC.f(np.zeros(3), [SPEED, turn], t)[:2] for t in moments])


class DriveYourself:
    """A robot to drive by keys and buttons.  Needs a live kernel; elsewhere it says so."""

    STEPS = 2  # control periods for each picture: 0.1 s of the world

    def __init__(self, arena: str = "lab") -> None:
        self.arena, self.seed = Arena.load(arena), lab_seed(0) + 9
        self.stage = Stage(self.arena)
        self.reset()
        self._picture = Explorer(self, {"tick": (0, 1)}, "").picture

    # What an explorer asks of a scene.

    @property
    def figure(self) -> Figure:
        """The stage's figure."""
        return self.stage.figure

    @property
    def moving(self) -> list[Any]:
        """The stage's moving artists."""
        return self.stage.moving

    def update(self, tick: int) -> None:
        """Show the world as it is now."""
        self.stage.show(np.array(self.truth), np.array(self.told), self.cov, self.world.crates, self.words())

    def words(self) -> str:
        """The picture's title, and its text alternative."""
        off = np.hypot(*(self.truth[-1] - self.told[-1])[:2])
        bump = ", and the robot touches something" if self.world.contact else ""
        return f"After {self.world.time:.1f} s dead reckoning is {off:.2f} m off{bump}"

    # What keys and buttons do.

    def reset(self) -> None:
        """Back to the start, with the same noise to come."""
        self.world = World(self.arena, self.seed)
        self.cov = START
        self.truth, self.told = [self.world.pose], [self.world.pose]

    def advance(self, v: float, omega: float) -> None:
        """Drive for a tenth of a second."""
        for _ in range(self.STEPS):
            self.world.step(v, omega)
            told, self.cov = reckon(self.told[-1], self.cov, self.world.odometry, self.world.robot, self.world.dt)
            self.truth.append(self.world.pose)
            self.told.append(told)

    def answer(self, question: dict[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
        """One question of the pad, ``{"drive": [v, ω]}``, ``{"reset": true}`` or ``{}``: words, and a picture."""
        if "reset" in question:
            self.reset()
        elif "drive" in question:
            self.advance(*question["drive"])
        said = {"alt": self.words(), "moves": bool(np.any(np.abs(self.world.wheels) > 1e-9))}
        return said, [png(self._picture({"tick": 0}))]

    def widget(self) -> Pad:
        """The pad, with this robot behind it."""
        return Pad(self)

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if os.environ.get("COURSEKIT_STATIC"):
            words = "Recorded drive: press play", "In JupyterLab a robot waits here for you to drive it."
            return {"text/markdown": f"**{words[0]}.** {words[1]}", "text/plain": ". ".join(words)}
        return self.widget()._repr_mimebundle_(**kwargs)


class Pad(anywidget.AnyWidget):
    """The page's half: buttons and keys; each tick asks the kernel once, and waits for the picture."""

    _esm = files("coursekit.labs.lab00").joinpath("pad.js").read_text(encoding="utf-8")
    _css = files("coursekit.labs.lab00").joinpath("pad.css").read_text(encoding="utf-8")
    speeds = traitlets.List([0.1, 0.9, 0.2, 2.0]).tag(sync=True)  # a press and the most: v [m/s], ω [rad/s]

    def __init__(self, robot: DriveYourself) -> None:
        super().__init__()
        self.on_msg(lambda _, question, __: self.send(*robot.answer(question)))
