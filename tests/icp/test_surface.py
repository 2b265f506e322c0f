import numpy as np
import pytest

from coursekit.icp import normals
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
