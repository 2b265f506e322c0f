"""Small pages: what the browser tests look at without waiting for the book."""

import numpy as np

from coursekit.teaching import plotting
from coursekit.teaching.explore import Slider, explore, guess


class Wave:
    """One line that moves, under a title that says how."""

    def __init__(self):
        self.figure = plotting.figure(7.2, 3.4)
        ax = plotting.axes(self.figure)
        ax.set(xlim=(0, 6), ylim=(-4, 4))
        self.t = np.linspace(0, 6, 50)
        (self.line,) = ax.plot(self.t, self.t)
        self.title = ax.set_title(" ")
        self.moving = [self.line, self.title]

    def update(self, time, height, shape):
        self.line.set_ydata(height * {"sine": np.sin, "cosine": np.cos}[shape](self.t - time))
        self.title.set_text(f"{shape} of height {height} after {time} s")

    @staticmethod
    def facts(time, height, shape):
        return {"swing": f"{2 * height} m"}


def wave():
    return explore(
        Wave,
        name="wave",
        alt="A {shape} of height {height} after {time} s.",
        time=Slider([0, 1, 2, 3, 4], label="Time since the beginning of everything", unit="s", start=1, play=True),
        height=Slider([1, 2, 3], label="Height", unit="metres above the middle"),
        shape=Slider(["sine", "cosine"], label="Shape"),
    )


def page(explorers=2):
    body = wave().html() * explorers
    return f'<!doctype html><meta charset="utf-8"><title>Two waves</title><body>{body}<p><a href="other.html">away</a>'


def question(sigma=None):
    return (
        '<!doctype html><meta charset="utf-8"><title>A question</title>'
        + guess("How far is it?", 2.5, sigma=sigma, unit="m", why="Because it was built there.")._repr_html_()
    )
