"""What Lab 9 computes, in five parts.

``sources``      the three recordings, or stand-ins where they are not there
``standins``     a drive, clouds and a log with the same faults
``believing``    one drive, many filters that know more or less of its instruments
``anywhere``     a particle filter that begins anywhere in the room
``mapping``      SLAM on the drive, with the landmarks' ids or without
"""

from coursekit.labs.lab09.runs.anywhere import SIZES, Cloud, locate
from coursekit.labs.lab09.runs.believing import KNOWN, SCALES, SYMBOLS, Followed, believed, follow
from coursekit.labs.lab09.runs.mapping import Map, mapped
from coursekit.labs.lab09.runs.sources import Recordings, commanded, corrected, dead_reckoning, recordings

__all__ = [
    "KNOWN",
    "SCALES",
    "SIZES",
    "SYMBOLS",
    "Cloud",
    "Followed",
    "Map",
    "Recordings",
    "believed",
    "commanded",
    "corrected",
    "dead_reckoning",
    "follow",
    "locate",
    "mapped",
    "recordings",
]
