import numpy as np
import pytest

from coursekit.icp import normals, surface
from coursekit.icp.surface import pieces


def test_normals_of_a_sphere_point_along_its_radii_and_of_a_circle_too():
    rng = np.random.default_rng(0)
    for d, n in ((2, 200), (3, 2000)):
        x = rng.normal(size=(n, d))
        x /= np.linalg.norm(x, axis=1)[:, None]
        assert np.abs(np.sum(normals(x) * x, axis=1)).min() > 0.97


def test_where_sampling_is_finer_than_noise_more_neighbours_make_the_surface():
    rng = np.random.default_rng(1)
    line = np.stack([np.linspace(0, 10, 3000), rng.normal(0, 0.02, 3000)], axis=1)  # 3 mm apart, 20 mm of noise
    found = pieces(line, line[::50])
    assert found.points > 8 and found.is_surface
    assert np.median(np.abs(normals(line)[:, 1])) > 0.99


def test_a_ball_and_a_thread_are_no_surface():
    rng = np.random.default_rng(2)
    ball, thread = rng.normal(size=(500, 3)), np.linspace(0, 1, 200)[:, None] * [1.0, 2.0, 3.0]
    assert not pieces(ball, ball).is_surface
    assert not pieces(thread, thread).is_surface


def test_few_points_make_pieces_of_what_there_is():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert np.abs(normals(corner)) == pytest.approx(np.tile([0, 0, 1.0], (3, 1)))


@pytest.mark.parametrize("place", [0.3, 1 / 3, 0.7, 123.456])
@pytest.mark.parametrize("d", [2, 3])
def test_copies_of_one_point_are_no_surface_however_their_mean_is_rounded(d, place):
    copies = np.full((50, d), place) * np.arange(1, d + 1)
    found = pieces(copies, copies)
    assert not found.flat.any() and np.all(found.variances == 0)


def test_a_cloud_that_is_noisier_than_dense_has_as_many_normals_as_points_for_far_fewer_neighbourhoods(monkeypatch):
    """Of 6,000 points 1 mm apart with 20 mm of noise: neighbourhoods of hundreds, and not one for each point."""
    rng, made = np.random.default_rng(3), []
    line = np.stack([np.linspace(0, 6, 6000), rng.normal(0, 0.02, 6000)], axis=1)
    principal = surface._principal
    monkeypatch.setattr(
        surface, "_principal", lambda cloud, at, tree, k: made.append(len(at) * k) or principal(cloud, at, tree, k)
    )
    found = normals(line)
    assert found.shape == line.shape and np.median(np.abs(found[:, 1])) > 0.99
    assert sum(made) < 100 * len(line)


def test_a_ball_is_given_the_normals_of_few_neighbours_since_more_are_no_surface_either():
    ball = np.random.default_rng(4).normal(size=(3000, 3))
    assert pieces(ball, ball[:200]).points == surface.NEIGHBOURS[3]


def test_copies_of_a_point_get_its_normal():
    rng = np.random.default_rng(5)
    floor = rng.uniform(-1, 1, (200, 3)) * [1, 1, 0]
    found = normals(np.vstack([floor, np.tile(floor[7], (50, 1))]))
    assert np.abs(found[200:]) == pytest.approx(np.tile([0, 0, 1.0], (50, 1)))
