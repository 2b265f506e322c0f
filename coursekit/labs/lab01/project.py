"""Lab 1's project: a landmark finder, from an image to a height and an axis, or to a reason why not.

The design is a function::

    def my_finder(image, low, high, camera):
        return height_px, axis_px       # pixels
        return "cut off …"              # or a reason that begins with "nothing", "cut off" or "occluded"

``image`` is (480, 640, 3) uint8, BGR; ``low`` and ``high`` are the landmark's hues in OpenCV's half degrees.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.geometry import Array
from coursekit.labs.lab01.runs import HERE, at
from coursekit.landmarks import COLOURS, LandmarkPixels, find_corners, measure
from coursekit.pinhole import COURSE_CAMERA, Camera
from coursekit.teaching import plotting
from coursekit.teaching.criteria import clean, small
from coursekit.teaching.projects import Criterion, Project
from coursekit.world.arena import Cylinder
from coursekit.world.backdrop import Image
from coursekit.world.camera import View, render, visibility

KINDS = (
    "whole",
    "whole",
    "whole",
    "whole",
    "cut off",
    "cut off",
    "occluded",
    "occluded",
    "nothing",
)  # of the views in a run
CLEAR = 6.0  # pixels that a whole landmark keeps from the image's edge and from its neighbour
NO_MEASUREMENT = 10.0  # px: the error of a run in which nothing was measured


@dataclass(frozen=True)
class Photo:
    """One view: the image, the landmark's colour, of which kind it is, and the true view (None for "nothing")."""

    image: Image
    colour: str
    kind: str
    truth: View | None


def make(rng: np.random.Generator) -> list[Photo]:
    """Nine views, one of each entry in ``KINDS``, in any light, with noise and blur."""
    return [_photo(rng, kind) for kind in KINDS]


def _photo(rng: np.random.Generator, kind: str) -> Photo:
    while True:
        colour, other = (str(name) for name in rng.permutation(list(COLOURS))[:2])
        r, bearing = rng.uniform(0.9, 9.0), rng.uniform(-0.6, 0.6)
        neighbour = at(max(0.6, r * rng.uniform(0.4, 1.4)), bearing + rng.uniform(-0.2, 0.2), other)
        things = [neighbour] if kind == "nothing" else [at(r, bearing, colour), neighbour]
        truth = None
        if kind != "nothing":
            truth, beside = visibility(COURSE_CAMERA, HERE, things)
            if truth is None or _kind(truth, beside) != kind:
                continue
        image = _render(rng, things)
        return Photo(image, colour, kind, truth)


def _render(rng: np.random.Generator, things: list[Cylinder]) -> Image:
    light, noise, blur = rng.uniform(0.4, 1.2), rng.uniform(0.0, 3.0), rng.uniform(0.3, 1.0)
    return render(COURSE_CAMERA, HERE, things, rng=rng, light=light, noise=noise, blur=blur)


def _kind(view: View, beside: View | None) -> str:
    """Which kind a view is; empty for one on which two good finders may differ."""
    room = min(view.left_px, 639 - view.right_px, view.top_px, 479 - view.bottom_px)
    width = view.right_px - view.left_px
    seen = min(view.right_px, 639) - max(view.left_px, 0)
    gap = CLEAR if beside is None else max(beside.left_px - view.right_px, view.left_px - beside.right_px)
    if view.cut:
        return "cut off" if seen > 12 and view.hidden == 0 else ""
    if view.hidden * width > 3 and 0.1 < view.hidden < 0.8 and room > CLEAR:
        return "occluded"
    return "whole" if view.hidden == 0 and room > CLEAR and gap >= CLEAR else ""


def run(design: Any, scenario: list[Photo], watch: Any) -> dict[str, Array]:
    """Show every view to the finder: errors [px] where it measured a whole landmark, and what it said of the rest."""
    errors, missed, trusted, misnamed = [], [], [], []
    for photo in scenario:
        low, high = COLOURS[photo.colour]
        answer = watch.call("my_finder()", design, photo.image, low, high, COURSE_CAMERA)
        measured = not isinstance(answer, str)
        pixels = watch.numbers("what my_finder() returns", answer, (2,)) if measured else np.zeros(2)
        if photo.kind == "whole":
            assert photo.truth is not None
            missed.append(not measured)
            if measured:
                errors.append(np.abs(pixels - [photo.truth.height_px, photo.truth.axis_px]))
        else:
            trusted.append(measured)
            misnamed.append(measured or not answer.lower().startswith(photo.kind))
        watch.advance()
    errors = errors or [np.full(2, NO_MEASUREMENT)]
    return {
        "height": np.array([e[0] for e in errors]),
        "axis": np.array([e[1] for e in errors]),
        "missed": np.array(missed, dtype=float),
        "trusted": np.array(trusted, dtype=float),
        "misnamed": np.array(misnamed, dtype=float),
    }


def reference(image: Image, low: int, high: int, camera: Camera) -> tuple[float, float] | str:
    """The package's own: ``measure`` on ``find_corners``."""
    (colour,) = [name for name, hues in COLOURS.items() if hues == (low, high)]
    got = measure(find_corners(image, colour), camera)
    if isinstance(got, LandmarkPixels):
        return got.height_px, got.axis_px
    return got.reason.replace("no corners", "nothing", 1)


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """Errors of the whole landmarks, and how the other views were answered."""
    fig = plotting.figure(8.2, 3.4)
    left, right = plotting.axes(fig, 1, 2)
    for values, marker, colour, label in (
        (theirs, "+", plotting.ODOMETRY, "the package"),
        (mine, "o", plotting.ESTIMATE, "yours"),
    ):
        left.loglog(
            np.maximum(values["height"], 1e-3), np.maximum(values["axis"], 1e-3), marker, color=colour, label=label
        )
    # Three decades at least, so that each axis has ticks that can be read, and the same for both errors.
    largest = max(1.0, *(float(values[key].max()) for values in (mine, theirs) for key in ("height", "axis")))
    left.set(
        xlim=(7e-4, 1.5 * largest), ylim=(7e-4, 1.5 * largest), xlabel="height error [px]", ylabel="axis error [px]"
    )
    left.set_title("Whole landmarks: left and low is good")
    for axis in (left.xaxis, left.yaxis):
        axis.set_major_formatter("{x:g}")
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=2)
    names = ["whole, refused", "not whole, measured", "wrong reason"]
    wrong = sum(mine[key].sum() for key in ("missed", "trusted", "misnamed"))
    for shift, values, colour in ((0.2, theirs, plotting.ODOMETRY), (-0.2, mine, plotting.ESTIMATE)):
        counts = [values[key].sum() for key in ("missed", "trusted", "misnamed")]
        right.barh(np.arange(3) + shift, counts, height=0.35, color=colour)
    right.set(yticks=range(3), yticklabels=names, xlabel="views of this run", xlim=(0, 4.2))
    right.set_title("Wrong answers" if wrong else "No wrong answer of yours")
    return fig


PROJECT = Project(
    name="lab01",
    title="A landmark finder",
    make=make,
    run=run,
    reference=reference,
    criteria=(
        Criterion("whole landmarks: share refused", 20, small("missed", full=0.06, none=0.6)),
        Criterion("height: median error", 20, small("height", full=0.15, none=1.0, unit="px", average=np.median)),
        Criterion("axis: median error", 20, small("axis", full=0.15, none=1.0, unit="px", average=np.median)),
        Criterion(
            "cut off, occluded or absent: share measured all the same", 20, small("trusted", full=0.03, none=0.5)
        ),
        Criterion("reasons: share misnamed", 10, small("misnamed", full=0.1, none=0.7)),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
    runs=12,
)
