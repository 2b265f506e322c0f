"""One map and one matcher for all tests of the visual particle filter: its features take a second."""

import cv2
import pytest

from coursekit.visual import MapMatcher
from coursekit.world import seafloor


@pytest.fixture(scope="session")
def sea():
    """The sea floor in grey, (800, 2560)."""
    return cv2.cvtColor(seafloor.load(), cv2.COLOR_BGR2GRAY)


@pytest.fixture(scope="session")
def matcher(sea):
    return MapMatcher(sea)
