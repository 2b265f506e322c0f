import numpy as np
import pytest

from coursekit import plotting
from coursekit.gaussian import chi2_band


def axes():
    return plotting.axes(plotting.figure())


def test_a_robot_points_where_it_looks():
    outline = plotting.robot_outline([1.0, 2.0, np.pi / 2], size=1.0)
    nose = outline[0]
    np.testing.assert_allclose(nose, [1.0, 2.6])
    assert plotting.draw_robot(axes(), [0, 0, 0]).get_xy().shape == (5, 2)


def test_an_ellipse_is_drawn_around_its_mean():
    line = plotting.draw_ellipse(axes(), [3.0, -1.0, 0.2], np.diag([0.04, 0.01, 0.5]))
    np.testing.assert_allclose(np.mean(line.get_xydata()[:-1], axis=0), [3.0, -1.0], atol=1e-9)


def test_the_consistency_strip_counts_the_steps_inside_its_band():
    low, high = chi2_band(3, 50)
    values = [low * 0.9, 3.0, 3.0, high * 1.1]
    ax = axes()
    assert plotting.consistency_strip(ax, range(4), values, dof=3, runs=50) == 0.5
    assert "50%" in ax.get_title(loc="left") + ax.get_title()


@pytest.mark.parametrize("name", ["TRUTH", "ESTIMATE", "MEASUREMENT", "ODOMETRY", "PREDICTION", "BAND"])
def test_each_role_has_a_colour_of_its_own(name):
    roles = ["TRUTH", "ESTIMATE", "MEASUREMENT", "ODOMETRY", "PREDICTION", "BAND"]
    assert [getattr(plotting, r) for r in roles].count(getattr(plotting, name)) == 1


def test_a_figure_belongs_to_nobody_elses_state():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    plotting.figure().subplots()
    assert dict(mpl.rcParams) == before
