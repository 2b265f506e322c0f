"""Lab 2's project: a camera model, from the pixels of a cylinder to its range and bearing and their covariance.

The design is a function::

    def my_camera_model(height_px, left_px, right_px, camera, landmark_height, radius, camera_offset, sigma):
        return z, R        # [range, bearing] (2,) m and rad, from the robot's centre; their covariance (2, 2)

``sigma`` is the standard deviation of each of the three pixel numbers, whose errors are independent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coursekit.gaussian import chi2_band
from coursekit.geometry import Array, wrap_angle
from coursekit.labs.lab02.runs import HEIGHT, OFFSET, RADIUS
from coursekit.landmarks import LandmarkPixels, find_corners, measure
from coursekit.pinhole import COURSE_CAMERA, Camera, project_cylinder, range_bearing, range_bearing_jacobian
from coursekit.teaching import plotting
from coursekit.teaching.criteria import Judge, clean, small
from coursekit.teaching.projects import Criterion, Judgement, Outcome, Project
from coursekit.world.arena import Cylinder
from coursekit.world.camera import render

EXACT, RENDERED, NOISY = 10, 2, 30  # views of each kind in a run
EXACTLY = 1e-6  # m: what an exact formula keeps well below, and a good approximation does not


@dataclass(frozen=True)
class Photo:
    """One view: [height, left, right] px, who made it and of what, σ [px], and the true [range, bearing] (2,)."""

    pixels: Array
    camera: Camera
    landmark: tuple[float, float, float]
    sigma: float
    truth: Array


def make(rng: np.random.Generator) -> list[Photo]:
    """Ten views without noise, two rendered and read by Lab 1, thirty with Gaussian noise: in this order."""
    camera = Camera(
        rng.uniform(400, 650), rng.uniform(700, 900), rng.uniform(300, 340), rng.uniform(220, 260), 640, 480
    )
    landmark = rng.uniform(0.3, 0.8), rng.uniform(0.05, 0.2), rng.uniform(0.05, 0.3)
    exact = [_computed(rng, camera, landmark, 0.0) for _ in range(EXACT)]
    rendered = [_rendered(rng) for _ in range(RENDERED)]
    return exact + rendered + [_computed(rng, camera, landmark, float(rng.uniform(0.1, 0.3))) for _ in range(NOISY)]


def _computed(rng: np.random.Generator, camera: Camera, landmark: tuple[float, float, float], noise: float) -> Photo:
    truth = np.array([rng.uniform(1.0, 5.0), rng.uniform(-0.45, 0.45)])
    seen = project_cylinder(truth[0], truth[1], camera, *landmark)
    pixels = np.array([seen.height_px, seen.left_px, seen.right_px]) + noise * rng.standard_normal(3)
    return Photo(pixels, camera, landmark, noise or 0.3, truth)


def _rendered(rng: np.random.Generator) -> Photo:
    while True:
        r, bearing = rng.uniform(1.2, 5.0), rng.uniform(-0.35, 0.35)
        there = Cylinder((r * np.cos(bearing) - OFFSET, r * np.sin(bearing)), RADIUS, HEIGHT, "cyan")
        corners = find_corners(render(COURSE_CAMERA, np.zeros(3), [there], rng=rng), "cyan")
        got = measure(corners, COURSE_CAMERA)
        if isinstance(got, LandmarkPixels):
            pixels = np.array([got.height_px, corners[:, 0].min(), corners[:, 0].max()])
            return Photo(pixels, COURSE_CAMERA, (HEIGHT, RADIUS, OFFSET), 0.1, np.array([r, bearing]))


def run(design: Any, scenario: list[Photo], watch: Any) -> dict[str, Array]:
    """Read every view: how far off the axis is [m], and the noisy views' errors in standard deviations."""
    errors, distances, covs = [], [], []
    for photo in scenario:
        given = *map(float, photo.pixels), photo.camera, *photo.landmark, photo.sigma
        answer = watch.call("my_camera_model()", design, *given)
        if answer is None:
            watch.numbers("what my_camera_model() returns", None, (2,))
        z, R = watch.call("z, R = my_camera_model()", _pair, answer)
        z, R = watch.numbers("z", z, (2,)), watch.covariance("R", R, 2)
        errors.append([photo.truth[0] - z[0], wrap_angle(photo.truth[1] - z[1])])
        distances.append(abs(photo.truth[0] * np.exp(1j * photo.truth[1]) - z[0] * np.exp(1j * z[1])))
        covs.append(R)
        watch.advance()
    off, e, P = np.array(distances), np.array(errors)[-NOISY:], np.array(covs)[-NOISY:]
    scaled = e / np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    return {
        "range": np.array([photo.truth[0] for photo in scenario[:EXACT]]),
        "off": off[:EXACT],
        "inexact": (off[:EXACT] > EXACTLY).astype(float),
        "rendered": off[EXACT:-NOISY],
        "scaled": scaled,
        "z2_range": scaled[:, 0] ** 2,
        "z2_bearing": scaled[:, 1] ** 2,
        "nees": np.sum(e * np.linalg.solve(P, e[..., None])[..., 0], axis=-1),
    }


def _pair(answer: Any) -> tuple[Any, Any]:
    z, R = answer
    return z, R


def reference(
    height_px: float, left_px: float, right_px: float, camera: Camera,
    landmark_height: float, radius: float, camera_offset: float, sigma: float,
) -> tuple[Array, Array]:  # fmt: skip
    """The package's own: ``range_bearing`` of the mean angle's column, and its Jacobian."""
    columns = np.array([left_px, right_px])
    middle = camera.bearing(columns).mean()
    axis = camera.column(middle)
    known = height_px, axis, camera, landmark_height, radius, camera_offset
    # u ↦ θ ↦ mean ↦ u_axis: each edge moves the axis by half of cos²θ / cos²φ_c.
    by_edge = 0.5 * np.cos(camera.bearing(columns)) ** 2 / np.cos(middle) ** 2
    J = range_bearing_jacobian(*known) @ np.array([[1.0, 0.0, 0.0], [0.0, *by_edge]])
    return np.array(range_bearing(*known)), sigma**2 * J @ J.T


def calibrated(key: str, dof: int) -> Judge:
    """Errors in standard deviations, squared and averaged over all noisy views: ``dof`` is right.

    All points inside the band that 99.9 % of honest models keep to, none from a factor of 1.6 beyond it.
    """

    def judge(mine: list[Outcome], theirs: list[Outcome]) -> Judgement:
        values = np.concatenate([o.values[key] for o in mine])
        average, (low, high) = float(values.mean()), chi2_band(dof, runs=len(values), confidence=0.999)
        beyond = max(np.log(average / high), np.log(low / average), 0.0)
        said = f"{average:.3g}, and {dof} is right ({low:.2f} to {high:.2f} for an honest model)"
        side = "" if beyond == 0 else ": too sure of itself" if average > high else ": too modest"
        return float(np.clip(1 - beyond / np.log(1.6), 0.0, 1.0)), said + side

    return judge


def draw(mine: dict[str, Array], theirs: dict[str, Array]) -> Figure:
    """Errors of the exact views over range; the noisy views' errors in standard deviations."""
    fig = plotting.figure(8.6, 3.6)
    left, right = plotting.axes(fig, 1, 2)
    left.semilogy(mine["range"], np.maximum(mine["off"], 1e-17), "o", color=plotting.ESTIMATE, label="yours")
    left.semilogy(theirs["range"], np.maximum(theirs["off"], 1e-17), "+", color=plotting.ODOMETRY, label="the package")
    left.axhline(EXACTLY, color=plotting.TRUTH, lw=0.8, ls=":")
    left.set(xlabel="range [m]", ylabel="axis off by [m]", title="Views without noise: exact lies below the line")
    right.plot(*theirs["scaled"].T, "+", color=plotting.ODOMETRY, label="the package")
    right.plot(*mine["scaled"].T, "o", color=plotting.ESTIMATE, ms=4, label="yours")
    plotting.draw_ellipse(right, [0, 0], np.eye(2), colour=plotting.TRUTH, lw=1)
    right.set_aspect("equal", adjustable="datalim")
    right.set(xlabel="range error [σ]", ylabel="bearing error [σ]", title="Noisy views: 95 % belong in the circle")
    for ax in (left, right):
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
    return fig


PROJECT = Project(
    name="lab02",
    title="A camera model",
    make=make,
    run=run,
    reference=reference,
    criteria=(
        Criterion("views without noise: error", 20, small("off", full=1e-4, none=0.15, unit="m")),
        Criterion("views without noise: share off by more than 1 µm", 15, small("inexact", full=0.0, none=1.0)),
        Criterion("rendered views: error", 15, small("rendered", full=0.01, none=0.1, unit="m")),
        Criterion("honesty of the range: mean (e/σ)²", 15, calibrated("z2_range", 1)),
        Criterion("honesty of the bearing: mean (e/σ)²", 15, calibrated("z2_bearing", 1)),
        Criterion("honesty of both: mean NEES", 10, calibrated("nees", 2)),
        Criterion("behaviour: arguments left alone", 10, clean),
    ),
    draw=draw,
)
