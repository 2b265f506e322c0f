"""EKF-SLAM, a robot and its landmarks in one Gaussian (Lab 5).

``ekf_slam``         ``EkfSlam``, the textbook's filter: predict, observe, and what it believes
``consistent_slam``  ``InvariantSlam`` and ``FirstEstimateSlam``, which do not grow sure of what nobody can measure
``calibrating``      ``CalibratingSlam``, for recordings: learns its instruments, keeps its way
``instruments``      what it learns: gains, a range that is a depth, clocks that disagree
``association``      which landmark was that?  Nearest neighbours, gates, and joint compatibility
``known_map``        the same question against a map that is given
``own_sensor``       ``sense``: ranges alone, bearings alone, a sensor of one's own
``stored``           ``add`` a map that was there before; ``save`` and ``load`` without pickle
``plain_slam``       ``PlainSlam``: the same as ``EkfSlam`` in whole matrices, one landmark after the other, to read
"""

from coursekit.ekf.lost import Lost
from coursekit.slam.association import AMBIGUOUS, NEW, Association, Indices, Known, Observations
from coursekit.slam.calibrating import CalibratingSlam, Track
from coursekit.slam.consistent_slam import FirstEstimateSlam, InvariantSlam
from coursekit.slam.ekf_slam import EkfSlam
from coursekit.slam.instruments import Instruments
from coursekit.slam.own_sensor import LandmarkSensor
from coursekit.slam.plain_slam import PlainSlam

__all__ = [
    "AMBIGUOUS",
    "NEW",
    "Association",
    "CalibratingSlam",
    "EkfSlam",
    "FirstEstimateSlam",
    "Indices",
    "Instruments",
    "InvariantSlam",
    "Known",
    "LandmarkSensor",
    "Lost",
    "Observations",
    "PlainSlam",
    "Track",
]
