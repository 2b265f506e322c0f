"""Lab 2's project: any sound camera model gets its marks, and a wrong one the finding that it deserves."""

from dataclasses import replace

import numpy as np
import pytest

from coursekit.labs.lab02.project import PROJECT, reference
from tests.labs.judge import Judge

SEEDS = range(7_000, 7_006)


def read(pixels, camera, L, rho, o):
    height, left, right = pixels
    phi = np.arctan((camera.cx - np.array([left, right])) / camera.fx).mean()
    X = camera.fy * L / height + rho
    return np.array([np.hypot(X + o, X * np.tan(phi)), np.arctan2(X * np.tan(phi), X + o)])


def spread(pixels, sigma, *known):
    J = np.column_stack([(read(pixels + s, *known) - read(pixels - s, *known)) / 2e-3 for s in 1e-3 * np.eye(3)])
    return sigma**2 * J @ J.T


def by_differences(height, left, right, camera, L, rho, o, sigma):
    pixels = np.array([height, left, right])
    return read(pixels, camera, L, rho, o), spread(pixels, sigma, camera, L, rho, o)


def by_sampling(height, left, right, camera, L, rho, o, sigma):
    """No derivative at all: two thousand noisy pictures of its own."""
    pixels, rng = np.array([height, left, right]), np.random.default_rng(3)
    cloud = np.array([read(pixels + sigma * e, camera, L, rho, o) for e in rng.standard_normal((500, 3))])
    return read(pixels, camera, L, rho, o), np.cov(cloud.T)


def bare_pinhole(height, left, right, camera, L, rho, o, sigma):
    return by_differences(height, left, right, camera, L, 0.0, 0.0, sigma)


def without_offset(height, left, right, camera, L, rho, o, sigma):
    return by_differences(height, left, right, camera, L, rho, 0.0, sigma)


def mean_of_the_columns(height, left, right, camera, L, rho, o, sigma):
    u = (left + right) / 2
    return by_differences(height, u, u, camera, L, rho, o, sigma)[0], by_differences(
        height, left, right, camera, L, rho, o, sigma
    )[1]


def mixed_focal_lengths(height, left, right, camera, L, rho, o, sigma):
    return by_differences(height, left, right, replace(camera, fx=camera.fy), L, rho, o, sigma)


def one_spread_for_all(height, left, right, camera, L, rho, o, sigma):
    return by_differences(height, left, right, camera, L, rho, o, sigma)[0], np.diag([0.1, 0.01]) ** 2


def sigma_for_variance(height, left, right, camera, L, rho, o, sigma):
    z, R = by_differences(height, left, right, camera, L, rho, o, sigma)
    return z, R / sigma


def edges_as_one_column(height, left, right, camera, L, rho, o, sigma):
    """Both edges err together: the axis gets the spread of one edge, √2 too much."""
    z, R = by_differences(height, left, right, camera, L, rho, o, sigma)
    S = np.diag([1.0, np.sqrt(2)])
    return z, S @ R @ S


def degrees(height, left, right, camera, L, rho, o, sigma):
    z, R = by_differences(height, left, right, camera, L, rho, o, sigma)
    return z * [1, 180 / np.pi], R


def swapped(height, left, right, camera, L, rho, o, sigma):
    z, R = by_differences(height, left, right, camera, L, rho, o, sigma)
    return R, z


def no_covariance(height, left, right, camera, L, rho, o, sigma):
    return by_differences(height, left, right, camera, L, rho, o, sigma)[0]


def bearing_without_a_spread(height, left, right, camera, L, rho, o, sigma):
    z, R = by_differences(height, left, right, camera, L, rho, o, sigma)
    return z, np.diag([R[0, 0], 0.0])


def not_a_number(height, left, right, camera, L, rho, o, sigma):
    z, R = by_differences(height, left, right, camera, L, rho, o, sigma)
    return z * np.nan, R


def stub(*arguments):
    raise NotImplementedError


def nothing_returned(*arguments):
    pass


judged = Judge(PROJECT, reference, SEEDS)


@pytest.mark.parametrize("design", [reference, by_differences])
def test_a_sound_camera_model_gets_full_marks_however_it_is_written(design):
    assert judged(design).mark == 100


def test_a_covariance_from_samples_is_as_good_as_one_from_a_derivative():
    assert judged(by_sampling).mark >= 95


@pytest.mark.parametrize(
    ("design", "at_most", "finding"),
    [
        (bare_pinhole, 30, "too sure of itself"),
        (without_offset, 40, "too sure of itself"),
        (mean_of_the_columns, 60, "share off by more than 1 µm"),
        (mixed_focal_lengths, 40, "too sure of itself"),
        (one_spread_for_all, 75, "too modest"),
        (sigma_for_variance, 70, "too modest"),
        (edges_as_one_column, 95, "honesty of the bearing"),
        (degrees, 50, "too sure of itself"),
        (swapped, 0, "z: expected shape (2,), got (2, 2)"),
        (no_covariance, 0, "z: expected shape (2,), got ()"),
        (bearing_without_a_spread, 0, "R is not positive definite"),
        (not_a_number, 0, "z holds NaN"),
        (nothing_returned, 0, "is None; is there a return"),
        (stub, 0, "Nothing here yet"),
    ],
)
def test_a_wrong_camera_model_gets_the_mark_and_the_finding_that_it_deserves(design, at_most, finding):
    score = judged(design)
    assert score.mark <= at_most
    assert finding in repr(score)


def test_a_half_wrong_model_scores_more_than_a_bare_pinhole():
    """The rubric rewards each correction by itself."""
    marks = [judged(design).mark for design in (bare_pinhole, without_offset, mean_of_the_columns, reference)]
    assert marks == sorted(marks) and len(set(marks)) == 4


def test_its_picture_can_be_drawn():
    mine, theirs = judged.outcomes(without_offset)[0].values, judged.outcomes(reference)[0].values
    assert len(PROJECT.draw(mine, theirs).axes) == 2
