"""Lab 9's explorers: commands to shift in time, a filter that knows more or less, a robot that may be anywhere."""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np
from matplotlib.artist import Artist

from coursekit import ekf
from coursekit.geometry import Array
from coursekit.labs.lab09.figures import turn_rates
from coursekit.labs.lab09.runs import KNOWN, Cloud, Followed, believed, commanded, locate, recordings
from coursekit.labs.lab09.runs.anywhere import SHOWN
from coursekit.teaching import plotting
from coursekit.teaching.experiments import lab_seed


class Late:
    """What the robot was told and what it did, and how alike the two are for each delay."""

    DELAYS = tuple(round(0.05 * k, 2) for k in range(-4, 13))  # s
    STRETCHES = ("early", "middle", "late")  # of the recording
    WINDOW, STEP, LENGTH = 0.5, 0.25, 40.0  # s: a turn is measured over half a second; 40 s are shown

    def __init__(self) -> None:
        self.figure = plotting.figure(8.6, 3.6)
        left, right = plotting.axes(self.figure, 1, 2, width_ratios=[1.9, 1])
        self.true, self.told = turn_rates(left)
        left.set_xlim(0, self.LENGTH)
        left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
        self.title = left.set_title(" ")
        likeness = [self.alike(delay) for delay in self.DELAYS]
        right.plot(self.DELAYS, likeness, color=plotting.ODOMETRY)
        (self.dot,) = right.plot([], [], "o", color=plotting.MEASUREMENT, ms=8)
        right.set(xlabel="delay [s]", ylabel="correlation")
        right.set_title("Over the whole recording")
        self.moving: list[Artist] = [self.true, self.told, self.title, self.dot]

    def update(self, delay: float, stretch: str) -> None:
        """A delay in s; which stretch of the recording."""
        t, turned = self.turned()
        begin = self.begin(stretch)
        shown = (t >= begin) & (t < begin + self.LENGTH)
        self.true.set_data(t[shown] - begin, turned[shown])
        self.told.set_data(t[shown] - begin, self.commands(delay)[shown])
        self.dot.set_data([delay], [self.alike(delay)])
        self.title.set_text(f"Delay {delay:.2f} s: correlation {self.alike(delay):.3f}")

    @classmethod
    def words(cls, delay: float, stretch: str) -> str:
        """What a frame shows."""
        return (f"The true and the commanded turn rate over 40 s; with the commands shifted by {delay} s "
                f"their correlation over the whole recording is {cls.alike(delay):.3f}")  # fmt: skip

    @classmethod
    @cache
    def turned(cls) -> tuple[Array, Array]:
        """Times (n,), and the rate at which the robot really turned around each, rad/s."""
        truth = recordings().run.groundtruth
        t = np.arange(truth[0, 0] + 1, truth[-1, 0] - 1, cls.STEP)
        heading = np.interp(np.add.outer([-cls.WINDOW / 2, cls.WINDOW / 2], t), truth[:, 0], np.unwrap(truth[:, 3]))
        return t, (heading[1] - heading[0]) / cls.WINDOW

    @classmethod
    def begin(cls, stretch: str) -> float:
        """Where, in that third of the recording, the robot turned most."""
        t, turned = cls.turned()
        third, width = len(t) // 3, round(cls.LENGTH / cls.STEP)
        first = cls.STRETCHES.index(stretch) * third
        busy = np.convolve(np.abs(turned[first : first + third]), np.ones(width), "valid")
        return float(t[first + int(np.argmax(busy))])

    @classmethod
    @lru_cache(maxsize=32)
    def commands(cls, delay: float) -> Array:
        """The mean turn rate that was commanded ``delay`` earlier, (n,)."""
        t = cls.turned()[0] - delay
        until = commanded(recordings().run.odometry, np.add.outer([-cls.WINDOW / 2, cls.WINDOW / 2], t))[..., 1]
        return np.asarray((until[1] - until[0]) / cls.WINDOW)

    @classmethod
    def alike(cls, delay: float) -> float:
        """The correlation of the two, over the whole recording."""
        return float(np.corrcoef(cls.turned()[1], cls.commands(delay))[0, 1])

    @classmethod
    def slope(cls, delay: float) -> float:
        """What was turned for each commanded radian, by least squares."""
        told = cls.commands(delay)
        return float(told @ cls.turned()[1] / (told @ told))


class Knowing:
    """Error and NEES of a filter that learns some of the constants, for three sizes of R."""

    def __init__(self) -> None:
        self.figure = plotting.figure(8.4, 4.2)
        self.error, self.nees = plotting.axes(self.figure, 2, 1, sharex=True)
        (self.off,) = self.error.plot([], [], color=plotting.MEASUREMENT, lw=1, label="error")
        (self.claim,) = self.error.plot([], [], color=plotting.ESTIMATE, lw=1, label="2σ, claimed")
        longest = believed()["", 1.0].time[-1]
        self.error.set(ylabel="position [m]", ylim=(0, 1.0), xlim=(0, longest))
        self.error.legend(loc="upper right", ncols=2)
        bound = ekf.gate_threshold(0.95, 3)
        self.nees.axhspan(1e-2, bound, color=plotting.BAND, alpha=0.15, lw=0)
        self.nees.axhline(3, color=plotting.BAND, lw=1, ls="--")
        (self.line,) = self.nees.plot([], [], color=plotting.ESTIMATE, lw=0.8)
        self.nees.set(yscale="log", ylim=(3e-2, 1e3), xlabel="time [s]", ylabel="NEES")
        self.titles = [self.error.set_title(" "), self.nees.set_title(" ")]
        self.moving: list[Artist] = [self.off, self.claim, self.line, *self.titles]

    def update(self, known: str, r_scale: float) -> None:
        """Which constants are learnt; R as a multiple of the lab's."""
        f = self.follow(known, r_scale)
        self.off.set_data(f.time, np.hypot(*f.error[:, :2].T))
        self.claim.set_data(f.time, 2 * f.sigma)
        self.line.set_data(f.time, np.maximum(f.nees, 1e-2))
        self.titles[0].set_text(f"{f.rmse:.3f} m RMS")
        self.titles[1].set_text(f"NEES {f.nees.mean():.1f}, {f.inside:.0%} of the steps in the green; NIS {f.nis:.2f}")

    @staticmethod
    def follow(known: str, r_scale: float) -> Followed:
        """The filter of one setting."""
        return believed()[KNOWN[known], r_scale]

    @classmethod
    def words(cls, known: str, r_scale: float) -> str:
        """What a frame shows, with its result."""
        f = cls.follow(known, r_scale)
        return (f"Position error and NEES over the recording when the filter learns {known}: {f.rmse:.3f} m RMS, "
                f"NEES {f.nees.mean():.1f} on average, {f.inside:.0%} of the steps below the 95 % bound")  # fmt: skip


class Anywhere:
    """A cloud of particles that begins all over the room, after each of the first minute's sightings."""

    TIMES = (0, 1, 2, 3, 5, 10, 20, 40, 50, 60)  # s

    def __init__(self, constants: Array) -> None:
        self.constants = np.asarray(constants, dtype=float)
        self.history = lru_cache(maxsize=8)(self._history)
        run = recordings().run
        places = np.array(list(run.landmarks.values()))
        self.figure = plotting.figure(6.2, 4.4)
        ax = plotting.axes(self.figure)
        ax.plot(*places.T, "s", color=plotting.WALL, ms=5, label="landmarks")
        still = np.zeros(SHOWN)
        self.cloud = ax.quiver(
            still, still, still + 1, still, color=plotting.ESTIMATE, alpha=0.5, scale=22, width=0.005
        )
        self.robot = plotting.draw_robot(ax, [0, 0, 0], colour=plotting.TRUTH, size=0.7)
        (self.mean,) = ax.plot([], [], "+", color=plotting.MEASUREMENT, ms=14, mew=2.5, zorder=6, label="mean")
        low, high = places.min(axis=0) - 1.2, places.max(axis=0) + 1.2
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="y [m]", aspect="equal")
        ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
        self.title = ax.set_title(" ")
        self.moving: list[Artist] = [self.cloud, self.robot, self.mean, self.title]

    def update(self, time: int, n: int) -> None:
        """Seconds since the start; how many particles."""
        now = self.at(time, n)
        x, y, theta = now.states.T
        self.cloud.set_offsets(np.stack([x, y], axis=-1))
        self.cloud.set_UVC(np.cos(theta), np.sin(theta))
        self.robot.set_xy(plotting.robot_outline(now.truth, 0.7))
        self.mean.set_data([now.mean[0]], [now.mean[1]])
        self.title.set_text(f"{now.time:.0f} s, {now.sightings} sightings: the mean is {now.error:.2f} m off")

    def words(self, time: int, n: int) -> str:
        """What a frame shows, with its result."""
        now = self.at(time, n)
        return (f"Poses of {n} particles as arrows on the map after {now.sightings} sightings; their mean is "
                f"{now.error:.2f} m from the robot")  # fmt: skip

    def at(self, time: int, n: int) -> Cloud:
        """The last cloud up to a time."""
        return [c for c in self.history(n) if c.time <= time][-1]

    def _history(self, n: int) -> list[Cloud]:
        return locate(recordings().run, self.constants, n, np.random.default_rng(lab_seed(9) + n))


def most_alike() -> tuple[float, float, float]:
    """The delay [s] at which the two turn rates are most alike, the slope there, and the slope without a delay."""
    fine = np.arange(-0.2, 0.6, 0.01).round(2)
    best = float(fine[np.argmax([Late.alike(float(d)) for d in fine])])
    return best, Late.slope(best), Late.slope(0.0)
