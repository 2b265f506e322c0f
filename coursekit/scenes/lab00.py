"""Lab 0's pictures: a recorded drive, clouds of endings, and a robot to drive yourself."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from coursekit import plotting
from coursekit.explore import Explorer, png
from coursekit.gaussian import ellipse, symmetrize
from coursekit.geometry import Array, transform
from coursekit.models import DifferentialDrive
from coursekit.world.arena import Arena
from coursekit.world.pilot import drive
from coursekit.world.robot import Robot, World

WAYPOINTS = [(2.2, -0.7), (2.4, 0.8), (0.6, 1.4), (-2.1, 1.3), (-2.0, -0.4), (-1.9, -2.0)]
CREEPS = (1, 3, 8)  # wheel noise in per cent of a wheel's speed
SPEED, PERIOD = 0.5, 0.05
RADIUS_SQUARED = -2 * np.log(0.05)  # of the 95 % ellipse of a planar Gaussian; the lab derives it
ARC = DifferentialDrive()
START = np.diag(np.square([1e-3, 1e-3, 1e-3]))  # nobody sets a robot down more exactly than to a millimetre


def reckon(pose: Array, P: Array, u: Array, robot: Robot, dt: float) -> tuple[Array, Array]:
    """One step of dead reckoning: the pose (3,) and its covariance after odometry u = [v, ω], to first order."""
    F, G, M = ARC.F(pose, u, dt), ARC.G(pose, u, dt), robot.odometry_cov(float(u[0]), float(u[1]), dt)
    return ARC.f(pose, u, dt), symmetrize(F @ P @ F.T + G @ M @ G.T)


class Stage:
    """The lab's arena from above with a robot that moves, its two tracks and its ellipse."""

    def __init__(self, arena: Arena) -> None:
        self.figure = plotting.figure(6.6, 5.6)
        self.ax: Axes = plotting.axes(self.figure)
        plotting.draw_arena(self.ax, replace(arena, crates=()))
        self.shapes = [crate.corners for crate in arena.crates]
        self.crates = [Polygon(shape, facecolor="#d8c3a5", edgecolor=plotting.WALL, lw=0.8) for shape in self.shapes]
        for crate in self.crates:
            self.ax.add_patch(crate)
        (self.true_track,) = self.ax.plot([], [], color=plotting.TRUTH, label="where it went")
        (self.told_track,) = self.ax.plot([], [], color=plotting.ODOMETRY, ls="--", label="what its wheels told")
        self.ellipse = plotting.draw_ellipse(
            self.ax, [0, 0], np.eye(2), plotting.ESTIMATE, label="95 % ellipse", zorder=6
        )
        self.ghost = plotting.draw_robot(self.ax, np.zeros(3), plotting.ODOMETRY, alpha=0.7)
        self.robot = plotting.draw_robot(self.ax, np.zeros(3), plotting.TRUTH)
        self.title = self.ax.set_title("the robot", loc="left")
        self.ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3)
        self.moving = [*self.crates, self.true_track, self.told_track, self.ellipse, self.ghost, self.robot, self.title]

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


@cache
def _recording(creep: float) -> tuple[Array, Array, Array, Array]:
    """Truth (n + 1, 3), dead reckoning, its covariances, and the crates (n + 1, k, 3) of one drive."""
    world = World(Arena.load("lab"), seed=8, robot=Robot(slip=creep / 100), dt=PERIOD)
    truth, crates, odometry = [world.pose], [world.crates], []
    for _ in drive(world, WAYPOINTS):
        truth.append(world.pose)
        crates.append(world.crates)
        odometry.append(world.odometry)
    told, covs = [truth[0]], [START]
    for u in odometry:
        pose, P = reckon(told[-1], covs[-1], u, world.robot, world.dt)
        told.append(pose)
        covs.append(P)
    return np.array(truth), np.array(told), np.array(covs), np.array(crates)


class RecordedDrive(Stage):
    """One drive through the lab, replayed: ``time`` in seconds, ``creep`` the wheels' noise in per cent."""

    def __init__(self) -> None:
        super().__init__(Arena.load("lab"))
        self.update(time=0, creep=CREEPS[0])

    def update(self, time: float, creep: float) -> None:
        """Show the drive up to a moment."""
        truth, told, covs, crates = _recording(creep)
        k = min(round(time / PERIOD), len(truth) - 1)
        off = np.hypot(*(truth[k] - told[k])[:2])
        title = f"After {time} s the wheels' story is {off:.2f} m off"
        self.show(truth[: k + 1], told[: k + 1], covs[k], crates[k], title)

    @staticmethod
    def words(time: float, creep: float) -> str:
        """The text alternative of a frame."""
        truth, told, _, _ = _recording(creep)
        k = min(round(time / PERIOD), len(truth) - 1)
        x, y = truth[k, :2]
        off = np.hypot(*(truth[k] - told[k])[:2])
        return (
            f"The lab from above. The robot stands at x {x:.1f} m, y {y:.1f} m; dead reckoning puts it {off:.2f} m away"
        )


def endings(creep: float, omega: float, times: Iterable[float], runs: int = 10_000, seed: int = 0) -> dict[float, Any]:
    """Where ``runs`` robots are at each of the times, and what linear algebra says about it.

    Each starts at [0, 0, 0] with the command [0.5 m/s, omega]; its wheels creep by ``creep`` per cent of their speed,
    anew in each control period.  Returns time → (endings (runs, 3), mean (3,), covariance (3, 3)).
    """
    # Five periods at a time: the mean of five creeps is one creep, smaller by √5.
    robot, dt, rng = Robot(slip=creep / 100 / np.sqrt(5)), 5 * PERIOD, np.random.default_rng(seed)
    u, M = np.array([SPEED, omega]), robot.odometry_cov(SPEED, omega, 5 * PERIOD)
    steps, found = round(max(times) / dt), {}
    noise = rng.standard_normal((steps, runs, 2)) @ np.linalg.cholesky(M).T
    cloud, mean, P = np.zeros((runs, 3)), np.zeros(3), np.zeros((3, 3))
    for k in range(steps):
        F, G = ARC.F(mean, u, dt), ARC.G(mean, u, dt)
        P, mean = F @ P @ F.T + G @ M @ G.T, ARC.f(mean, u, dt)
        cloud = ARC.f(cloud, u + noise[k], dt)
        for time in times:
            if round(time / dt) == k + 1:
                found[time] = cloud, mean, P
    return found


class Endings:
    """Clouds of endings beside their ellipse: in metres, and in units of the ellipse, where a Gaussian is round."""

    TIMES = (2, 4, 6, 8, 10, 12, 15, 20)
    CREEPS = (1, 2, 3, 5, 8)
    TURNS = (0.0, 0.3, 0.6)
    SHOWN = 1000

    def __init__(self) -> None:
        self.frames: dict[tuple[float, float, float], Any] = {}
        for creep in self.CREEPS:
            for turn in self.TURNS:
                for time, (cloud, mean, P) in endings(creep, turn, self.TIMES).items():
                    round_cloud = _whitened(cloud, mean, P)
                    share = float(np.mean(np.sum(round_cloud**2, axis=1) <= RADIUS_SQUARED))
                    bend = float(np.sqrt(P[2, 2]) * SPEED * time / Robot().track)
                    contour = mean[:2] + ellipse(P[:2, :2])
                    shown = cloud[: self.SHOWN, :2].T, contour.T, _arc(turn, time).T, round_cloud[: self.SHOWN].T
                    self.frames[time, creep, turn] = *shown, share, bend
        self.figure = plotting.figure(7.6, 3.6)
        self.left, self.right = plotting.axes(self.figure, 1, 2, width_ratios=[1.5, 1])
        dots = {"ls": "none", "marker": ".", "ms": 3, "mew": 0, "color": plotting.PREDICTION, "alpha": 0.7}
        (self.cloud,) = self.left.plot([], [], **dots, label="where they are")
        self.contour = plotting.draw_ellipse(self.left, [0, 0], np.eye(2), label="95 % ellipse")
        (self.path,) = self.left.plot([], [], color=plotting.ODOMETRY, lw=1, ls="--", label="as commanded")
        plotting.draw_robot(self.left, np.zeros(3), plotting.TRUTH, size=0.5)
        self.left.set(xlim=(-2.2, 10.6), ylim=(-4.2, 4.8), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        self.left.legend(loc="upper left", bbox_to_anchor=(0.3, 1.0), markerscale=3)
        (self.round,) = self.right.plot([], [], **dots)
        self.right.plot(*ellipse(np.eye(2)).T, color=plotting.ESTIMATE)
        self.right.set(xlim=(-6, 4), ylim=(-5, 5), aspect="equal")
        self.right.set(xlabel="along [standard deviations]", ylabel="across [standard deviations]")
        self.title = self.left.set_title("endings", loc="left")
        self.bend = self.right.set_title("bend", loc="left")
        self.moving = [self.cloud, self.contour, self.path, self.round, self.title, self.bend]
        self.update(time=10, creep=3, turn=0.0)

    def update(self, time: float, creep: float, turn: float) -> None:
        """Show the endings after ``time`` s, with wheel noise ``creep`` in per cent and turn rate ``turn`` in rad/s."""
        cloud, contour, path, round_cloud, share, bend = self.frames[time, creep, turn]
        self.cloud.set_data(*cloud)
        self.contour.set_data(*contour)
        self.path.set_data(*path)
        self.round.set_data(*round_cloud)
        self.title.set_text(f"{share:.1%} of 10,000 runs inside the 95 % ellipse")
        self.bend.set_text(f"turn noise × distance = {bend:.2g} b")

    def words(self, time: float, creep: float, turn: float) -> str:
        """The text alternative of a frame."""
        *_, share, bend = self.frames[time, creep, turn]
        shape = "an ellipse" if share > 0.945 else "a slightly bent ellipse" if share > 0.9 else "a banana"
        return (
            f"{share:.1%} of the endings lie inside the predicted 95 % ellipse; the cloud has the shape of {shape}. "
            f"Turn noise times distance is {bend:.2g} track widths"
        )


def _whitened(cloud: Array, mean: Array, P: Array) -> Array:
    """The cloud in units of its predicted ellipse, first axis along the last heading."""
    c, s = np.cos(mean[2]), np.sin(mean[2])
    to_robot = np.array([[c, s], [-s, c]])
    L = np.linalg.cholesky(to_robot @ P[:2, :2] @ to_robot.T)
    return np.asarray(np.linalg.solve(L, to_robot @ (cloud[:, :2] - mean[:2]).T).T)


def _arc(turn: float, time: float) -> Array:
    moments = np.linspace(1e-3, time, 60)
    return np.array([ARC.f(np.zeros(3), [SPEED, turn], t)[:2] for t in moments])


class DriveYourself:
    """A robot to drive: two sliders, a Play button, a Reset button.  Needs a live kernel; elsewhere it says so."""

    STEPS = 2  # control periods for each picture: 0.1 s of the world

    def __init__(self, arena: str = "lab", seed: int = 1) -> None:
        self.arena, self.seed = Arena.load(arena), seed
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
        truth, told = np.array(self.truth), np.array(self.told)
        off, bump = np.hypot(*(truth[-1] - told[-1])[:2]), ", and it touches something" if self.world.contact else ""
        title = f"{self.world.time:.1f} s: the wheels' story is {off:.2f} m off{bump}"
        self.stage.show(truth, told, self.cov, self.world.crates, title)

    # What the buttons do.

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

    def widget(self) -> Any:
        """Sliders and buttons above the picture."""
        import ipywidgets as w

        style, wide = {"description_width": "initial"}, w.Layout(width="340px", max_width="100%")
        speed = w.FloatSlider(0.4, min=-0.6, max=1.0, step=0.1, description="Speed [m/s]", style=style, layout=wide)
        turn = w.FloatSlider(0.3, min=-2.0, max=2.0, step=0.1, description="Turn [rad/s]", style=style, layout=wide)
        play = w.Play(min=0, max=100_000, interval=100, show_repeat=False)
        reset = w.Button(description="Back to the start")
        height, width = self._picture({"tick": 0}).shape[:2]
        image = w.Image(format="png", width=width, height=height)
        image.layout = w.Layout(max_width="100%", object_fit="contain")

        def paint(*_: Any) -> None:
            image.value = png(self._picture({"tick": play.value}))

        def tick(_: Any) -> None:
            self.advance(speed.value, turn.value)
            paint()

        def again(_: Any) -> None:
            self.reset()
            paint()

        play.observe(tick, names="value")
        reset.on_click(again)
        paint()
        box = w.VBox([w.HBox([play, reset]), w.Box([speed, turn], layout=w.Layout(flex_flow="row wrap")), image])
        box.speed, box.turn, box.play, box.again, box.image = speed, turn, play, reset, image
        return box

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        if os.environ.get("COURSEKIT_STATIC"):
            words = "In JupyterLab a robot waits here for you to drive it. On this page, watch a recorded drive below."
            return {"text/markdown": f"*{words}*", "text/plain": words}
        return self.widget()._repr_mimebundle_(**kwargs)


def guesses() -> Figure:
    """Three answers to the lab's first question, drawn one above the other."""
    fig = plotting.figure(7.2, 3.3)
    ax = plotting.axes(fig)
    answers = {"A": (0.5, 0.5), "B": (0.9, 0.15), "C": (0.05, 0.55)}
    for row, (name, (along, across)) in zip((2.8, 0.0, -2.8), answers.items(), strict=True):
        ax.plot([0, 10], [row, row], color=plotting.ODOMETRY, ls="--", lw=1)
        plotting.draw_robot(ax, [0, row, 0], plotting.TRUTH, size=0.6)
        plotting.draw_ellipse(ax, [10, row], np.diag([along**2, across**2]), plotting.HIGHLIGHT)
        ax.text(-0.9, row, name, ha="center", va="center", fontsize=14, weight="bold")
    ax.set(xlim=(-1.6, 13), ylim=(-4.5, 4.5), aspect="equal", xlabel="x [m]", yticks=[])
    ax.set_title("Told: straight ahead, 0.5 m/s, 20 s. Where is it?", loc="left")
    return fig


def collapse(curves: dict[str, tuple[Array, Array]], runs: int) -> Figure:
    """Containment against turn noise × distance in track widths, one curve (n,), (n,) for each robot."""
    fig = plotting.figure(7.2, 4.0)
    ax = plotting.axes(fig)
    spread = 2 * np.sqrt(0.95 * 0.05 / runs)
    promise = f"the promise, as well as {runs:,} runs can tell"
    ax.axhspan(0.95 - spread, 0.95 + spread, color=plotting.BAND, alpha=0.25, lw=0, label=promise)
    for (name, (bend, share)), marker in zip(curves.items(), "os^", strict=False):
        ax.plot(bend, share, marker=marker, ms=5, lw=1, label=name)
    ax.set(xscale="log", xlabel="turn noise × distance [track widths]", ylabel="share inside the 95 % ellipse")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_title("Three robots, one curve: when the banana bends, the ellipse breaks its promise", loc="left")
    ax.legend(loc="lower left")
    return fig


def broken(squared_radii: dict[str, float], tracks: dict[str, Array]) -> Figure:
    """Two exhibits: ellipses of some squared radii over a cloud, and half circles (n, 3) stepped in some ways."""
    fig = plotting.figure(7.4, 3.8)
    left, right = plotting.axes(fig, 1, 2)
    draws = np.random.default_rng(3).standard_normal((20_000, 2))
    left.plot(*draws[:2000].T, ls="none", marker=".", ms=2.5, color=plotting.ODOMETRY, mew=0)
    circle = ellipse(np.eye(2)) / np.sqrt(RADIUS_SQUARED)
    colours = (plotting.MEASUREMENT, plotting.ESTIMATE)
    for (name, squared), colour in zip(squared_radii.items(), colours, strict=True):
        share = np.mean(np.sum(draws**2, axis=1) <= squared)
        left.plot(*(np.sqrt(squared) * circle).T, color=colour, label=f"{name}: {share:.0%} inside")
    left.set(aspect="equal", xlim=(-4, 4), ylim=(-4, 5.4), xlabel="standard deviations", ylabel="standard deviations")
    left.set_title("An ellipse sold as 95 %", loc="left")
    left.legend(loc="upper center")
    for (name, track), colour in zip(tracks.items(), colours, strict=True):
        off = np.hypot(*(track[-1, :2] - [0, 2]))
        right.plot(*track[:, :2].T, "o-", ms=4, color=colour, label=f"{name}: ends {off:.2f} m off")
    turn = np.linspace(0, np.pi, 60)
    right.plot(np.sin(turn), 1 - np.cos(turn), color=plotting.TRUTH, lw=1, ls="--", label="the truth")
    right.set(aspect="equal", xlim=(-0.9, 2.5), ylim=(-0.3, 3.1), xlabel="x [m]", ylabel="y [m]")
    right.set_title("Half a circle in ten steps", loc="left")
    right.legend(loc="upper right")
    return fig
