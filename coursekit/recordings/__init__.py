"""Recordings: readers that turn text into checked arrays, and the places where the data sets live.

A recording is somebody's file, so nothing in it is taken on trust.  A file of the wrong kind (missing, empty,
binary, short of a column) is an error that says so.  A broken *row* (text in a number, NaN, a field too many, all
zeros, a stamp that runs backwards) is dropped, counted and named: never repaired, and never averaged in.  Nothing
is unpickled.

``datasets``      where recordings live: the project, a folder of yours, a cache, or their public origin
``landmark_log``  the log of a drive around one landmark → ``Log``
``clouds``        clouds of points from and to text, PLY, PCD and NPY; ``cloud_files`` knows the two headers
``mrclam``        one robot's run from the UTIAS multi-robot data set → ``Mrclam``
``recording``     a drive of the world or of a robot of yours → ``Recording``
``bags``          ROS 1 and ROS 2 bags and MCAP files, without ROS → ``Recording``; ``bag_writing`` is the way back
``carmen``        logs of the CARMEN toolkit → ``Recording``
``csv_log``       any CSV of a drive, with a mapping → ``Recording``
``trajectories``  poses with their stamps, to and from TUM and KITTI files → ``Trajectory``; ``trajectory_errors``
                  measures one against another
``maps``          landmarks to and from CSV
``tables``        columns under names, to CSV and back
``columns``       which column is which: names matched by their meaning
``degrees``       where the log itself says that an angle is in degrees, and no radians: ``UnitWarning``
``rows``          what the readers share: text into rows, and what becomes of broken ones

``datasets`` loads by name; the readers take any path.
"""

from coursekit.recordings.bag_writing import write_bag
from coursekit.recordings.bags import read_bag, read_images
from coursekit.recordings.carmen import read_carmen
from coursekit.recordings.clouds import Clouds, read_cloud, write_cloud
from coursekit.recordings.csv_log import read_csv_log
from coursekit.recordings.degrees import UnitWarning
from coursekit.recordings.landmark_log import LOG_COLUMNS, Log, read_landmark_log
from coursekit.recordings.maps import read_map, write_map
from coursekit.recordings.mrclam import ROBOTS, Mrclam, read_mrclam
from coursekit.recordings.recording import Recording
from coursekit.recordings.rows import BrokenRow
from coursekit.recordings.tables import read_csv, write_csv
from coursekit.recordings.trajectories import Trajectory, read_kitti, read_tum, write_kitti, write_tum
from coursekit.recordings.trajectory_errors import TrajectoryError, absolute_error, matched, relative_error

__all__ = [
    "LOG_COLUMNS",
    "ROBOTS",
    "BrokenRow",
    "Clouds",
    "Log",
    "Mrclam",
    "Recording",
    "Trajectory",
    "TrajectoryError",
    "UnitWarning",
    "absolute_error",
    "matched",
    "read_bag",
    "read_carmen",
    "read_cloud",
    "read_csv",
    "read_csv_log",
    "read_images",
    "read_kitti",
    "read_landmark_log",
    "read_map",
    "read_mrclam",
    "read_tum",
    "relative_error",
    "write_bag",
    "write_cloud",
    "write_csv",
    "write_kitti",
    "write_map",
    "write_tum",
]
