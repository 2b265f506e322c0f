"""The sea floor's map: reproducible, rich where things grow and bare where they do not."""

import cv2
import numpy as np
import pytest

from coursekit.world.seafloor import load
from coursekit.world.seafloor_map import paint


@pytest.fixture(scope="module")
def painted():
    return paint()


def test_the_committed_map_is_the_one_that_the_command_makes(painted):
    """Decoded JPEG against decoded JPEG: another processor may round a few pixels differently, no more."""
    _, encoded = cv2.imencode(".jpg", painted, [cv2.IMWRITE_JPEG_QUALITY, 90])
    again = cv2.imdecode(encoded, cv2.IMREAD_COLOR)
    assert load().shape == (800, 2560, 3)
    difference = np.abs(again.astype(int) - load())
    assert np.mean(difference > 2) < 1e-4


def test_the_same_seed_paints_the_same_bytes_and_another_seed_does_not():
    small = (200, 640)
    assert np.array_equal(paint(3, small), paint(3, small))
    assert not np.array_equal(paint(3, small), paint(4, small))


def test_the_bare_stretch_is_nearly_featureless_and_the_rest_is_not(painted):
    grey = cv2.cvtColor(painted, cv2.COLOR_BGR2GRAY).astype(float)
    detail = np.abs(grey - cv2.GaussianBlur(grey, (0, 0), 4))
    bare = detail[:, 1080:1480]
    assert bare.max() < 5 and bare.mean() < 0.5
    assert min(detail[:, :800].mean(), detail[:, 1800:].mean()) > 5
