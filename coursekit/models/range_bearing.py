r"""Range and bearing, once for everybody: h and its inverse g, each with its Jacobians.

From a pose [x, y, θ] a landmark [lx, ly] is seen at the range r [m] and the bearing φ [rad, positive to the left]:

    r = √((lx - x)² + (ly - y)²),        φ = atan2(ly - y, lx - x) - θ,
    g = [x + r cos(θ + φ), y + r sin(θ + φ)]  is where the landmark is.

Every function broadcasts over leading axes: one pose and one landmark, one pose and a map (n, 2), many poses and one
landmark, or ``poses[:, None]`` and a map.  ``models.RangeBearing`` is the same with one landmark and its noise in it.

>>> h([0.0, 0.0, 0.0], [[2.0, 0.0], [0.0, 1.0]]).round(3)
array([[2.   , 0.   ],
       [1.   , 1.571]])
>>> g([0.0, 0.0, 0.0], [2.0, 0.0])
array([2., 0.])

All raise ValueError for a shape that does not fit and for numbers that are not finite, TypeError for what are no
numbers.  One pose on top of its landmark (nearer than ``TOO_NEAR``) is a ValueError too, of the kind ``Undefined``: no
bearing is defined there.
Among many, h gives the range 0 and the bearing -θ for it, and a Jacobian is NaN: the others do not suffer from it.

Source: Thrun, Burgard & Fox (2005), section 6.6; for g, section 10.2.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.geometry import Array, wrap_angle
from coursekit.models._vectors import copies, entries, functions, vector
from coursekit.models.checks import Undefined

TOO_NEAR = 1e-9  # m
_TURNED = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # what of H no pose changes


def h(pose: ArrayLike, landmark: ArrayLike) -> Array:
    """Range and bearing, (..., 3) and (..., 2) → (..., 2); the bearing in (-π, π]."""
    (x, y, theta), (lx, ly) = entries(pose, 3, "state"), entries(landmark, 2, "landmark")
    return seen(lx - x, ly - y, theta)


def H(pose: ArrayLike, landmark: ArrayLike) -> Array:
    """∂h/∂pose, (..., 2, 3)."""
    return by_pose(*_offset(pose, landmark))


def H_landmark(pose: ArrayLike, landmark: ArrayLike) -> Array:
    """∂h/∂landmark, (..., 2, 2): minus the position's columns of H, for only the difference counts."""
    dx, dy, r = _offset(pose, landmark)
    return _matrix(functions(dx), [[dx / r, dy / r], [-dy / (r * r), dx / (r * r)]])


def g(pose: ArrayLike, z: ArrayLike) -> Array:
    """The inverse: the landmark that is seen from the pose as z, (..., 3) and (..., 2) → (..., 2)."""
    (x, y, theta), (r, bearing) = entries(pose, 3, "state"), entries(z, 2, "z [range, bearing]")
    direction = theta + bearing
    m = functions(direction)
    return vector(x + r * m.cos(direction), y + r * m.sin(direction))


def Gx(pose: ArrayLike, z: ArrayLike) -> Array:
    """∂g/∂pose, (..., 2, 3)."""
    (_, _, theta), (r, bearing) = entries(pose, 3, "state"), entries(z, 2, "z [range, bearing]")
    m = functions(theta + bearing)
    c, s = m.cos(theta + bearing), m.sin(theta + bearing)
    return _matrix(m, [[1.0, 0.0, -r * s], [0.0, 1.0, r * c]])


def Gz(pose: ArrayLike, z: ArrayLike) -> Array:
    """∂g/∂z, (..., 2, 2)."""
    (_, _, theta), (r, bearing) = entries(pose, 3, "state"), entries(z, 2, "z [range, bearing]")
    m = functions(theta + bearing)
    c, s = m.cos(theta + bearing), m.sin(theta + bearing)
    return _matrix(m, [[c, -r * s], [s, r * c]])


def residual(z: ArrayLike, z_hat: ArrayLike) -> Array:
    """z - z_hat with the bearing's difference in (-π, π], (..., 2)."""
    (r, bearing), (r_hat, bearing_hat) = entries(z, 2, "z [range, bearing]"), entries(z_hat, 2, "z_hat")
    if type(r) is not float and type(r_hat) is not float and r.shape != r_hat.shape:
        try:
            np.broadcast_shapes(r.shape, r_hat.shape)
        except ValueError:
            raise ValueError(
                f"z: expected a shape that goes with z_hat's {np.shape(z_hat)}, got {np.shape(z)}"
            ) from None
    return vector(r - r_hat, wrap_angle(bearing - bearing_hat))


def unusable(z: ArrayLike) -> str:
    """Why no camera can have measured z [range, bearing]; empty when one can.

    >>> unusable([-2.0, 0.1])
    'a range of -2 m'
    """
    r, bearing = entries(z, 2, "z [range, bearing]", one=True)
    if not r > 0:
        return f"a range of {r:.4g} m"
    return "" if abs(bearing) <= 2 * math.pi else f"a bearing of {bearing:.4g} rad"


def seen(dx: Any, dy: Any, theta: Any) -> Array:
    """h by the offset [Δx, Δy] from the pose to the landmark: floats of one pair, arrays of many."""
    m = functions(dx)
    r = distance(dx, dy) if m is math else np.hypot(dx, dy)
    return vector(r, wrap_angle(m.atan2(dy, dx) - theta))


def by_pose(dx: Any, dy: Any, r: Any) -> Array:
    """H by the offset and its length."""
    H, q = copies(_TURNED, r), r * r
    H[..., 0, 0], H[..., 0, 1] = -dx / r, -dy / r
    H[..., 1, 0], H[..., 1, 1] = dy / q, -dx / q
    return H


def _offset(pose: ArrayLike, landmark: ArrayLike) -> Any:
    (x, y, _), (lx, ly) = entries(pose, 3, "state"), entries(landmark, 2, "landmark")
    dx, dy = lx - x, ly - y
    if functions(dx) is math:
        return dx, dy, distance(dx, dy)
    r = np.hypot(dx, dy)
    return dx, dy, np.where(r < TOO_NEAR, np.nan, r)


def distance(dx: float, dy: float) -> float:
    """The length of one offset.  Raises ``Undefined``, a ValueError, for none."""
    r = math.hypot(dx, dy)
    if r < TOO_NEAR:
        raise Undefined("state: the robot stands on the landmark: no bearing is defined there, and range and bearing "
                        "have no derivative")  # fmt: skip
    return r


def _matrix(m: Any, rows: list[list[Any]]) -> Array:
    """Entries, each a number or an array of one shape or another, as the last two axes of an array."""
    if m is math:
        return np.array(rows)
    shape = np.broadcast_shapes(*(np.shape(entry) for row in rows for entry in row))
    matrix = np.empty((*shape, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrix[..., i, j] = entry
    return matrix
