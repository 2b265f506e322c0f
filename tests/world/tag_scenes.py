"""Photographs of tags, made up: a textured ground, perspective, uneven light, a soft lens, noise and JPEG."""

import cv2
import numpy as np

from coursekit.world.tag_detector import FAMILIES

FINE = 8  # the scene is drawn so many times finer than it is seen


def texture(rng, shape):
    """Grey levels with detail of every size, as natural pictures have (1/f), stretched to full contrast: (h, w)."""
    f = np.hypot(*np.meshgrid(np.fft.rfftfreq(shape[1]), np.fft.fftfreq(shape[0])))
    spectrum = np.fft.rfft2(rng.standard_normal(shape)) / np.maximum(f, 1 / max(shape))
    plain = np.fft.irfft2(spectrum, s=shape)
    return np.clip(128 + 60 * plain / plain.std(), 0, 255)


def one_tag(rng, family, side, shape=(160, 160)):
    """A tag of about ``side`` pixels → picture (h, w) uint8, id, true corners (4, 2)."""
    dictionary = cv2.aruco.getPredefinedDictionary(FAMILIES[family])
    number, cells = int(rng.integers(len(dictionary.bytesList))), dictionary.markerSize + 2
    paper = cv2.copyMakeBorder(
        cv2.aruco.generateImageMarker(dictionary, number, cells * 20), *[20] * 4, cv2.BORDER_CONSTANT, value=255
    )
    # A tilted square: turned in the picture, foreshortened, and its sides unequal by perspective.
    turn, squash, lean = rng.uniform(-np.pi, np.pi), rng.uniform(0.55, 1.0), rng.uniform(-0.1, 0.1, 2)
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    c, s = np.cos(turn), np.sin(turn)
    seen = square @ np.array([[c, s], [-s, c]]) * [1, squash]
    seen = seen / (1 + square @ lean)[:, None] * side + np.array(shape[::-1]) / 2 + rng.uniform(-5, 5, 2)
    white = 20 * (cells + 1)
    black = np.array([[20, 20], [white, 20], [white, white], [20, white]]) - 0.5
    H = cv2.getPerspectiveTransform(black.astype(np.float32), ((seen + 0.5) * FINE - 0.5).astype(np.float32))
    size = (shape[1] * FINE, shape[0] * FINE)
    ground = cv2.resize(texture(rng, shape), size, interpolation=cv2.INTER_CUBIC)
    hung = cv2.warpPerspective(np.full_like(paper, 255), H, size)
    scene = np.where(hung > 127, 30 + 0.8 * cv2.warpPerspective(paper, H, size), ground)
    scene = cv2.resize(scene, shape[::-1], interpolation=cv2.INTER_AREA)
    v, u = np.mgrid[: shape[0], : shape[1]] / max(shape)
    light = 0.75 + rng.uniform(-0.5, 0.5) * (u - 0.5) + rng.uniform(-0.5, 0.5) * (v - 0.5)
    scene = cv2.GaussianBlur(scene * light, (0, 0), rng.uniform(0.4, 0.8)) + rng.normal(0, 4, shape)
    jpeg = cv2.imencode(".jpg", np.clip(scene, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    return cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE), number, seen
