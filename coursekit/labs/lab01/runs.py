"""Lab 1's landmark and its camera: photographs, and what is measured in four hundred of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coursekit.geometry import Array
from coursekit.landmarks import LandmarkPixels, find_corners, measure
from coursekit.pinhole import COURSE_CAMERA
from coursekit.results import Rejected
from coursekit.world.arena import Cylinder
from coursekit.world.backdrop import Image
from coursekit.world.camera import PAINT, View, render, visibility

HEIGHT, RADIUS = 0.5, 0.1  # of every landmark in the course, metres
HERE = np.zeros(3)
COLOUR = "cyan"


def at(distance: float, bearing: float, colour: str = COLOUR) -> Cylinder:
    """A landmark at a distance and bearing from the camera."""
    return Cylinder((distance * np.cos(bearing), distance * np.sin(bearing)), RADIUS, HEIGHT, colour)


def photograph(*cylinders: Cylinder, seed: int, **settings: Any) -> Image:
    """The course's camera's view of landmarks; the same arguments, the same picture."""
    return render(COURSE_CAMERA, HERE, cylinders, rng=np.random.default_rng(seed), **settings)


@dataclass(frozen=True)
class Seen:
    """One random view: what was true (None where the landmark is not in the picture), and what was measured."""

    distance: float
    truth: View | None
    got: LandmarkPixels | Rejected

    @property
    def kind(self) -> str:
        """Which of four things a view is, known from the world."""
        if self.truth is None:
            return "out of sight"
        if self.truth.cut:
            return "cut off"
        # A hundredth of the width is less than a pixel for all that is measured here.
        return "occluded" if self.truth.hidden > 0.01 else "whole"


def look_around(rng: np.random.Generator, views: int) -> list[Seen]:
    """Views of a landmark 0.7 to 12 m away, within ±0.6 rad, of any colour, in any light; half have a neighbour."""
    seen = []
    for k in range(views):
        heading, distance, bearing = rng.uniform(-np.pi, np.pi), rng.uniform(0.7, 12.0), rng.uniform(-0.6, 0.6)
        first, second = rng.permutation(list(PAINT))[:2]
        things = [at(distance, heading + bearing, str(first))]
        if k % 2:
            nearer = max(0.6, distance * rng.uniform(0.4, 0.9))
            things.append(at(nearer, heading + bearing + rng.uniform(-0.15, 0.15), str(second)))
        pose = np.array([0.0, 0.0, heading])
        settings: dict[str, Any] = {"light": rng.uniform(0.3, 1.2), "noise": rng.uniform(0, 5)}
        image = render(COURSE_CAMERA, pose, things, rng=rng, blur=rng.uniform(0.3, 1.0), **settings)
        truth = visibility(COURSE_CAMERA, pose, things)[0]
        seen.append(Seen(distance, truth, measure(find_corners(image, str(first)), COURSE_CAMERA)))
    return seen


def errors_of(views: Sequence[Seen]) -> Array:
    """Rows [distance m, height error px, axis error px] of the whole landmarks that were measured, (n, 3)."""
    rows = [
        (s.distance, s.got.height_px - s.truth.height_px, s.got.axis_px - s.truth.axis_px)
        for s in views
        if s.kind == "whole" and s.truth is not None and isinstance(s.got, LandmarkPixels)
    ]
    return np.array(rows).reshape(-1, 3)


def far_heights(noise: float, views: int, rng: np.random.Generator) -> Array:
    """Height errors [px] of landmarks 8 to 12 m away, alone in view, at one level of image noise [grey levels]."""
    errors = []
    for _ in range(views):
        landmark = at(rng.uniform(8.0, 12.0), rng.uniform(-0.4, 0.4))
        (truth,) = visibility(COURSE_CAMERA, HERE, [landmark])
        image = photograph(landmark, seed=int(rng.integers(2**32)), noise=noise)
        got = measure(find_corners(image, COLOUR), COURSE_CAMERA)
        if isinstance(got, LandmarkPixels) and truth is not None:
            errors.append(got.height_px - truth.height_px)
    return np.array(errors)
