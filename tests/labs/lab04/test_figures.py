"""What Lab 4's picture of one update shows of an EKF: a straight band in place of the range's ring."""

import numpy as np
from matplotlib.colors import to_hex

from coursekit import ekf
from coursekit.gaussian import Gaussian
from coursekit.labs.lab04 import figures, runs
from coursekit.models import RangeOnly
from coursekit.teaching import plotting


def test_the_ekfs_band_is_straight_and_holds_the_places_that_explain_the_range_along_the_line_of_sight():
    """Two straight edges across the line from the mean to the landmark, √5.99 σ to either side of what was measured."""
    prior, R, landmark = Gaussian([0.1, -0.2], [[0.25, 0.1], [0.1, 0.16]]), np.array([[0.15**2]]), runs.LANDMARKS[1]
    beacon = RangeOnly(landmark, R, position=(0, 1))
    z = beacon.h(prior.mean) + 0.4
    fig = figures.update_as_contours(prior, ekf.correct(prior, beacon, z).belief, z, R, 1)
    drawn = [c for c in fig.axes[1].collections if len(c.get_edgecolor())]
    shown = [c for c in drawn if to_hex(c.get_edgecolor()[0]) == plotting.ESTIMATE.lower()]
    edges = np.concatenate([path.vertices for c in shown for path in c.get_paths()])
    sight = (prior.mean - landmark) / np.linalg.norm(prior.mean - landmark)
    off = (edges - landmark) @ sight - z[0]  # along the line of sight: the range that a place explains, minus measured
    np.testing.assert_allclose(np.abs(off), np.sqrt(5.99) * 0.15, atol=0.01)  # the grid of the drawing is 25 mm
    assert np.any(off > 0) and np.any(off < 0)
