"""From a colour picture to a landmark's outline, and from the outline to its height and symmetry axis (Lab 1).

``measuring``  ``find_corners`` and ``measure``: the image's coloured region, and what its outline says
``outline``    the fine outline of a landmark, and what of it something nearer hides

Source: the HSV segmentation is textbook (Szeliski 2022, section 3.1.2); outline and checks are Lab 1's own.
"""

from coursekit.landmarks.measuring import COLOURS, LandmarkPixels, find_corners, measure, segment

__all__ = ["COLOURS", "LandmarkPixels", "find_corners", "measure", "segment"]
