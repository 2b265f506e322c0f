"""What Lab 4 computes, in two parts.

``drives``   drives of the filter's own models and of a camera, and what a filter makes of them
``updates``  two other corrections, to stand beside the EKF's
"""

from coursekit.labs.lab04.runs.drives import (
    COLUMNS,
    DT,
    LANDMARKS,
    MOTION,
    POINTS,
    ROOM,
    SENSORS,
    START_COV,
    STEPS,
    WHEELS,
    Drives,
    R,
    Tracks,
    believed,
    homework,
    localise,
    photograph,
    photographed,
    recorded,
    report_noise,
    scaled,
    sensor_noise,
    simulate,
)
from coursekit.labs.lab04.runs.updates import iterated, unscented

__all__ = [
    "COLUMNS",
    "DT",
    "LANDMARKS",
    "MOTION",
    "POINTS",
    "ROOM",
    "SENSORS",
    "START_COV",
    "STEPS",
    "WHEELS",
    "Drives",
    "R",
    "Tracks",
    "believed",
    "homework",
    "iterated",
    "localise",
    "photograph",
    "photographed",
    "recorded",
    "report_noise",
    "scaled",
    "sensor_noise",
    "simulate",
    "unscented",
]
