"""How a camera looked at the map, from pairs of points: straight down, or tilted if the pairs say so.

Source: Schwarz (1978) for the criterion that decides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coursekit.geometry import Array
from coursekit.visual.homography import fit_homography, project
from coursekit.visual.similarity import fit_similarity, log_likelihood

LEAST_SPREAD = 0.004  # px: no residual tells apart what is finer; it is the error that interpolation adds to a position


class View(NamedTuple):
    """Where a picture lies on the map: its pixels' ``homography`` (3, 3), and ``pose`` [x, y, yaw, scale] with ``cov``.

    The pose is that of the picture's centre: the map's pixel under it, the heading and the scale there.
    """

    homography: Array
    pose: Array
    cov: Array
    tilted: bool

    def squared(self, pairs: Array) -> Array:
        """Squared distances on the map, (n,), of pairs (n, 4) [u, v on the picture, u, v on the map]."""
        return np.asarray(np.sum((project(self.homography, pairs[:, :2]) - pairs[:, 2:]) ** 2, axis=1))


def straight_down(pairs: Array, centre: Array) -> View:
    """The view of a camera that looks straight down: a similarity of 4 parameters, n > 2 pairs (n, 4)."""
    (a, b, x, y), cov, _ = fit_similarity(pairs[:, :2] - centre, pairs[:, 2:])
    M, scale = np.array([[a, -b], [b, a]]), np.hypot(a, b)
    # [a, b, x, y] → [x, y, yaw, scale], with a = scale cos yaw and b = scale sin yaw
    J = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-b / scale**2, a / scale**2, 0, 0], [a / scale, b / scale, 0, 0]])
    homography = np.vstack([np.column_stack([M, [x, y] - M @ centre]), [0, 0, 1]])
    return View(homography, np.array([x, y, np.arctan2(b, a), scale]), J @ cov @ J.T, tilted=False)


def tilted(pairs: Array, centre: Array, start: Array) -> View:
    """The view of a camera that looks down at an angle: a homography of 8 parameters, near ``start`` (3, 3), n > 4."""
    return View(*fit_homography(start, centre, pairs[:, :2], pairs[:, 2:]), tilted=True)


def likelier(pairs: Array, centre: Array, start: Array) -> View:
    """The tilted view if the Bayesian criterion finds its four further parameters worth it, else the other."""
    down = straight_down(pairs, centre)
    if len(pairs) < 8:
        return down
    try:
        with np.errstate(all="ignore"):
            other = tilted(pairs, centre, start)
    except np.linalg.LinAlgError:  # all on one line: nothing shows a tilt
        return down
    gain = log_likelihood(other.squared(pairs), LEAST_SPREAD**2) - log_likelihood(down.squared(pairs), LEAST_SPREAD**2)
    return other if gain > 2 * np.log(2 * len(pairs)) else down  # ½ · 4 parameters · log of how many numbers
