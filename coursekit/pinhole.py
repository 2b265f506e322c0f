r"""Lab 2: from a landmark's height and symmetry axis in pixels to its range and bearing.

The camera is level.  Its frame is the robot's: X forward along the optical axis, Y left, Z up; the image's u runs
right and v down, and pixel (0, 0) has its centre at u = v = 0.  A landmark is an upright cylinder, L metres high, of
radius ρ; its axis stands at depth X and at the bearing φ_c from the camera.  What is measured, exactly:

``height_px``
    from the highest to the lowest point of the outline.  With the eye between the floor and the landmark's top, both
    belong to the rim's point of *least depth*, one radius nearer than the axis: height_px = f_y L / (X - ρ).
``axis_px``
    the column on which the landmark's axis would be drawn: axis_px = c_x - f_x tan φ_c.  The outline spans the
    angles φ_c ± asin(ρ/r_c) at a distance r_c from the camera, so φ_c is the mean of the two edges' *angles*.

Source: Hartley & Zisserman (2004), section 6.1, for the projection; the corrections are derived in Lab 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, together
from coursekit.geometry import Array


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion: focal lengths, principal point, image size, all in pixels.

    Points are [X, Y, Z] in the camera's frame (ahead, left, up; metres), pixels are [u, v].

    >>> Camera(fx=530, fy=530, cx=319.5, cy=239.5, width=640, height=480).project([4.0, 1.0, 0.3])
    array([187.  , 199.75])

    Raises ValueError for a focal length or a size that is not positive, and for anything not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def __post_init__(self) -> None:
        for name in ("fx", "fy", "cx", "cy", "width", "height"):
            value = _finite(getattr(self, name), name, positive=name not in ("cx", "cy"))
            if value.ndim:
                raise ValueError(f"{name}: expected one number, got an array of shape {value.shape}")
        if int(self.width) != self.width or int(self.height) != self.height:
            raise ValueError(f"width, height: expected whole pixels, got {self.width} × {self.height}")
        object.__setattr__(self, "width", int(self.width))  # 640.0 is as good as 640, but no array can be that long
        object.__setattr__(self, "height", int(self.height))

    def project(self, p_camera: ArrayLike) -> Array:
        """Pixels [u, v] of points [X, Y, Z] in the camera's frame: (..., 3) metres → (..., 2).

        Raises ValueError for points that are not in front of the camera: they have no image.
        """
        x, y, z = self._in_front(p_camera)
        return np.stack([self.cx - self.fx * y / x, self.cy - self.fy * z / x], axis=-1)

    def project_jacobian(self, p_camera: ArrayLike) -> Array:
        """∂(u, v)/∂(X, Y, Z): (..., 3) → (..., 2, 3).  Raises as ``project``."""
        x, y, z = self._in_front(p_camera)
        zero = np.zeros_like(x)
        du = [self.fx * y / x**2, -self.fx / x, zero]
        dv = [self.fy * z / x**2, zero, -self.fy / x]
        return np.stack([np.stack(du, axis=-1), np.stack(dv, axis=-1)], axis=-2)

    def unproject(self, pixels: ArrayLike, depth: ArrayLike) -> Array:
        """The points [X, Y, Z] at a depth X behind pixels [u, v]: (..., 2) and (...) → (..., 3).

        Raises ValueError for pixels that are not finite, of another shape, and for a depth that is not positive.
        """
        pixels, x = _finite(pixels, "pixels"), _finite(depth, "depth", positive=True)
        if pixels.ndim == 0 or pixels.shape[-1] != 2:
            raise ValueError(f"pixels: expected shape (..., 2), got {pixels.shape}")
        u, v, x = together(pixels[..., 0], pixels[..., 1], x)
        return np.stack([x, x * (self.cx - u) / self.fx, x * (self.cy - v) / self.fy], axis=-1)

    def bearing(self, u: ArrayLike) -> Array:
        """The angle, left of the optical axis, of everything drawn in column u.  Radians, any shape.

        Raises ValueError for columns that are not finite.
        """
        return np.arctan((self.cx - _finite(u, "u")) / self.fx)

    def column(self, bearing: ArrayLike) -> Array:
        """The column u of everything at an angle left of the optical axis, radians, any shape: undoes ``bearing``.

        Raises ValueError for an angle outside (-π/2, π/2): nothing there is in front of the camera.
        """
        bearing = _finite(bearing, "bearing")
        if not np.all(np.abs(bearing) < np.pi / 2):
            raise ValueError(f"bearing: expected angles in (-π/2, π/2), in front of the camera, got {bearing}")
        return self.cx - self.fx * np.tan(bearing)

    def _in_front(self, p_camera: ArrayLike) -> tuple[Array, Array, Array]:
        p = _finite(p_camera, "p_camera")
        if p.ndim == 0 or p.shape[-1] != 3:
            raise ValueError(f"p_camera: expected points of shape (..., 3), got {p.shape}")
        if not np.all(p[..., 0] > 1 / LARGEST):
            raise ValueError(f"p_camera: expected finite points with x > 0, in front of the camera, got {p}")
        return p[..., 0], p[..., 1], p[..., 2]


class CylinderPixels(NamedTuple):
    """What a cylinder leaves in the image, in pixels.  The height and the axis are ``range_bearing``'s input."""

    height_px: Array
    axis_px: Array
    left_px: Array
    right_px: Array


def range_bearing(
    height_px: ArrayLike,
    axis_px: ArrayLike,
    camera: Camera,
    landmark_height: ArrayLike,
    radius: ArrayLike = 0.0,
    camera_offset: ArrayLike = 0.0,
) -> tuple[Array, Array]:
    r"""Range and bearing of an upright cylinder's axis, from the robot's centre.

    The rim's nearest point has depth f_y L / height_px, the axis one radius ρ more: X.  The axis is
    Y = X (c_x - axis_px)/f_x to the left.  From the robot's centre, o metres behind the camera,

        r = √((X + o)² + Y²),   φ = atan2(Y, X + o).

    Parameters
    ----------
    height_px, axis_px : pixels, see the top of this module.  All arguments broadcast.
    landmark_height, radius : L and ρ of the cylinder, metres.  Radius 0 leaves out the near-rim correction, and
        the range of a cylinder seen at bearing φ comes out ρ / cos φ short.
    camera_offset : o, how far ahead of the robot's centre the camera stands, metres.

    Returns range (metres) and bearing (radians, positive to the left), each in the inputs' broadcast shape.
    Raises TypeError for a camera that is no ``Camera``, ValueError for heights that are not positive, a negative
    radius, and anything not finite.

    Source: derived in Lab 2; the projection is Hartley & Zisserman (2004), section 6.1.

    >>> r, phi = range_bearing(53.0, 319.5, COURSE_CAMERA, landmark_height=0.5, radius=0.1, camera_offset=0.07)
    >>> round(float(r), 3), float(phi)
    (5.17, 0.0)
    """
    x, y, _, _ = _axis_position(height_px, axis_px, camera, landmark_height, radius, camera_offset)
    return np.hypot(x, y), np.arctan2(y, x)


def range_bearing_jacobian(
    height_px: ArrayLike,
    axis_px: ArrayLike,
    camera: Camera,
    landmark_height: ArrayLike,
    radius: ArrayLike = 0.0,
    camera_offset: ArrayLike = 0.0,
) -> Array:
    """∂(range, bearing)/∂(height_px, axis_px), (..., 2, 2): what one pixel of error does.

    Parameters and errors as for ``range_bearing``; rows in m/px and rad/px.

    >>> J = range_bearing_jacobian(53.0, 319.5, COURSE_CAMERA, landmark_height=0.5)
    >>> np.diagonal(J).round(4)                         # 5 m ahead: 9 cm a pixel of height, 2 mrad a column
    array([-0.0943, -0.0019])
    """
    x, y, dx_dheight, t = _axis_position(height_px, axis_px, camera, landmark_height, radius, camera_offset)
    dy_dheight = t * dx_dheight
    dy_daxis = -(x - np.asarray(camera_offset, dtype=float)) / camera.fx
    d = np.hypot(x, y)
    d_range = [(x * dx_dheight + y * dy_dheight) / d, y * dy_daxis / d]
    d_bearing = [(x * dy_dheight - y * dx_dheight) / d**2, x * dy_daxis / d**2]
    return np.stack([np.stack(d_range, axis=-1), np.stack(d_bearing, axis=-1)], axis=-2)


def project_cylinder(
    range_: ArrayLike,
    bearing: ArrayLike,
    camera: Camera,
    landmark_height: ArrayLike,
    radius: ArrayLike = 0.0,
    camera_offset: ArrayLike = 0.0,
) -> CylinderPixels:
    """The image of an upright cylinder at a range and bearing from the robot's centre: undoes ``range_bearing``.

    Nothing is clipped: columns may lie outside the image.  All arguments broadcast; metres and radians in, pixels
    out.  Raises TypeError for a camera that is no ``Camera``, ValueError where the cylinder is not wholly in front of
    the camera, and for anything not finite.

    >>> seen = project_cylinder(5.17, 0.0, COURSE_CAMERA, landmark_height=0.5, radius=0.1, camera_offset=0.07)
    >>> round(float(seen.height_px), 6), float(seen.axis_px)
    (53.0, 319.5)
    """
    _is_camera(camera)
    range_, bearing = _finite(range_, "range_", positive=True), _finite(bearing, "bearing")
    range_, bearing, h, r, offset = together(range_, bearing, *_landmark(landmark_height, radius, camera_offset))
    x, y = range_ * np.cos(bearing) - offset, range_ * np.sin(bearing)
    if not np.all(x > r):
        raise ValueError(f"expected a cylinder wholly in front of the camera, got its axis at depth {x}, radius {r}")
    phi, half_width = np.arctan2(y, x), np.arcsin(r / np.hypot(x, y))
    return CylinderPixels(
        height_px=camera.fy * h / (x - r),
        axis_px=camera.column(phi),
        left_px=camera.column(phi + half_width),
        right_px=camera.column(phi - half_width),
    )


def _axis_position(
    height_px: ArrayLike,
    axis_px: ArrayLike,
    camera: Camera,
    landmark_height: ArrayLike,
    radius: ArrayLike,
    camera_offset: ArrayLike,
) -> tuple[Array, Array, Array, Array]:
    """The axis [x, y] in the robot's frame, ∂x/∂height_px, and the ratio y/x as the camera sees it."""
    _is_camera(camera)
    height_px, axis_px = _finite(height_px, "height_px", positive=True), _finite(axis_px, "axis_px")
    h, r, offset = _landmark(landmark_height, radius, camera_offset)
    height_px, axis_px, h, r, offset = together(height_px, axis_px, h, r, offset)
    depth = h * camera.fy / height_px + r
    t = (camera.cx - axis_px) / camera.fx
    return depth + offset, depth * t, -h * camera.fy / height_px**2, t


def _is_camera(camera: Camera) -> None:
    if not isinstance(camera, Camera):
        raise TypeError(f"camera: expected a pinhole.Camera, got {type(camera).__name__}")


def _landmark(landmark_height: ArrayLike, radius: ArrayLike, camera_offset: ArrayLike) -> tuple[Array, Array, Array]:
    r = _finite(radius, "radius")
    if np.any(r < 0):
        raise ValueError(f"radius: expected metres ≥ 0, got {radius!r}")
    return _finite(landmark_height, "landmark_height", positive=True), r, _finite(camera_offset, "camera_offset")


def _finite(value: ArrayLike, name: str, *, positive: bool = False) -> Array:
    wanted = f"{name}: expected finite{' positive' if positive else ''} numbers, got "
    try:
        array = np.asarray(value)
        array = array.astype(float, copy=False) if array.dtype.kind in "biuf" else np.full(1, np.nan)
    except ValueError:
        raise ValueError(f"{wanted}{value!r}") from None
    if np.asarray(value).dtype.kind not in "biuf":
        raise ValueError(f"{wanted}{value!r}")
    bad = ~(np.abs(array) < LARGEST) | ((array <= 1 / LARGEST) if positive else False)
    if np.any(bad):
        where = f" (entry {tuple(int(i) for i in np.argwhere(bad)[0])} of shape {array.shape})" if array.ndim else ""
        raise ValueError(f"{wanted}{array[bad].flat[0]}{where}")
    return array


COURSE_CAMERA = Camera(fx=530.0, fy=530.0, cx=319.5, cy=239.5, width=640, height=480)
"""The camera of every lab: 640 × 480 pixels and, but for half a pixel, the focal length at which every height in the
report's log is a whole number of pixels; it sees 0.54 rad to either side."""
