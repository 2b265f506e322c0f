"""What Lab 5 computes, in two parts.

``drives``      drives among eight tags, and what a filter makes of them
``true_parts``  which part makes a filter too sure?  True parts swapped into its drives, one at a time
"""

from coursekit.labs.lab05.runs.drives import (
    ARENA,
    DT,
    LOOK,
    MOTION,
    STARTS,
    TAGS,
    Drive,
    Look,
    Slam,
    Track,
    drive,
    follow,
    glimpse,
    map_error,
    mapped,
    per_coordinate,
    photograph,
    reported,
    times_shown,
)
from coursekit.labs.lab05.runs.true_parts import (
    TAG_AT,
    as_factors,
    fresh,
    heading,
    longest_blind,
    motion,
    redrawn,
    smoothed_verdict,
    verdict,
)

__all__ = [
    "ARENA",
    "DT",
    "LOOK",
    "MOTION",
    "STARTS",
    "TAGS",
    "TAG_AT",
    "Drive",
    "Look",
    "Slam",
    "Track",
    "as_factors",
    "drive",
    "follow",
    "fresh",
    "glimpse",
    "heading",
    "longest_blind",
    "map_error",
    "mapped",
    "motion",
    "per_coordinate",
    "photograph",
    "redrawn",
    "reported",
    "smoothed_verdict",
    "times_shown",
    "verdict",
]
