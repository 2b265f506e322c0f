import numpy as np
import pytest

from coursekit.gaussian import chi2_band
from coursekit.teaching import plotting


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
    assert "50 %" in ax.get_title(loc="left") + ax.get_title()


@pytest.mark.parametrize("values", [(2.5, 3.5), (2.95, 3.05), (0.9, 12.0), (2.1, 8.0), (0.01, 5000.0), (3.0, 3.0)])
def test_the_consistency_strip_has_two_plain_numbers_on_its_axis_whatever_the_span(values):
    ax = axes()
    plotting.consistency_strip(ax, range(2), values, dof=3, runs=1000)
    for limits in (ax.get_ylim(), values):
        if limits[0] < limits[1]:
            ax.set_ylim(limits)
        ax.figure.canvas.draw()
        bottom, top = ax.get_ylim()
        labels = [
            w.get_text() for w, y in zip(ax.get_yticklabels(), ax.get_yticks(), strict=True) if bottom <= y <= top
        ]
        assert len(labels) >= 2
        assert [float(word) for word in labels]
        assert len(labels) <= 7


def test_a_strip_whose_counts_change_has_a_band_that_changes_and_leaves_out_what_was_not_measured():
    narrow, wide = chi2_band(2, 100), chi2_band(2, 4)
    value = 0.5 * (narrow[1] + wide[1])  # surprising as an average of a hundred, not as one of four
    assert plotting.consistency_strip(axes(), range(3), [value, value, np.nan], dof=2, runs=[100, 4, 0]) == 0.5


@pytest.mark.parametrize("name", ["TRUTH", "ESTIMATE", "MEASUREMENT", "ODOMETRY", "PREDICTION", "BAND"])
def test_each_role_has_a_colour_of_its_own(name):
    roles = ["TRUTH", "ESTIMATE", "MEASUREMENT", "ODOMETRY", "PREDICTION", "BAND"]
    assert [getattr(plotting, r) for r in roles].count(getattr(plotting, name)) == 1


def test_a_figure_belongs_to_nobody_elses_state():
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    plotting.figure().subplots()
    assert dict(mpl.rcParams) == before
