"""Lab 8: a particle filter that sees.  One picture gives a fix, many fixes and a motion model give a pose.

matching     ``MapMatcher(map_image).locate(image)``: SIFT, FLANN, RANSAC, and a covariance from the residuals
frames       the map image's poses and the odometry's, converted in one place
calibration  from commands to pixels, measured
direct       ``DirectMatcher``: every particle's own window of the map against the picture, on a pyramid
filtering    ``VisualFilter``: why a sensor this good starves a particle filter, and the cure
"""

from coursekit.visual.calibration import MotionCalibration, calibrate
from coursekit.visual.direct import DirectMatcher
from coursekit.visual.filtering import (
    REPORT_SPREAD,
    VisualFilter,
    follow,
    heaviest,
    inflated,
    log_likelihood,
    mean,
    mode,
)
from coursekit.visual.frames import image_from_odometry, odometry_from_image
from coursekit.visual.matching import Fix, MapMatcher

__all__ = [
    "REPORT_SPREAD",
    "DirectMatcher",
    "Fix",
    "MapMatcher",
    "MotionCalibration",
    "VisualFilter",
    "calibrate",
    "follow",
    "heaviest",
    "image_from_odometry",
    "inflated",
    "log_likelihood",
    "mean",
    "mode",
    "odometry_from_image",
]
