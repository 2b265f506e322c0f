"""Lab 8: a particle filter that sees.  One picture gives a fix, many fixes and a motion model give a pose.

matching     ``MapMatcher(map_image).locate(image)``: SIFT, FLANN, RANSAC, and a covariance from the residuals
features     SIFT on maps of any size, tile by tile
views        did the camera look straight down (``similarity``) or was it tilted (``homography``)?  The pairs decide
frames       the map image's poses and the odometry's, converted in one place
prediction   ``log_prediction``: the density of a cloud that has moved, a sum over its particles
filtering    ``VisualFilter``: mixture Monte-Carlo localisation, for a sensor much sharper than the cloud
estimates    one pose from a cloud: ``dominant_cluster`` and others
calibration  from commands to pixels, measured
direct       ``DirectMatcher``: every particle's own window of the map against the picture, on a pyramid
"""

from coursekit.visual.calibration import MotionCalibration, calibrate
from coursekit.visual.direct import DirectMatcher
from coursekit.visual.estimates import dominant_cluster, heaviest, mean
from coursekit.visual.filtering import (
    REPORT_SPREAD,
    VisualFilter,
    follow,
    inflated,
    log_likelihood,
)
from coursekit.visual.frames import image_from_odometry, odometry_from_image
from coursekit.visual.matching import Fix, MapMatcher
from coursekit.visual.prediction import log_prediction

__all__ = [
    "REPORT_SPREAD",
    "DirectMatcher",
    "Fix",
    "MapMatcher",
    "MotionCalibration",
    "VisualFilter",
    "calibrate",
    "dominant_cluster",
    "follow",
    "heaviest",
    "image_from_odometry",
    "inflated",
    "log_likelihood",
    "log_prediction",
    "mean",
    "odometry_from_image",
]
