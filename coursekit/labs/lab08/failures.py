"""Lab 8's failures: a filter worse than its sensor, two frames mixed up, and pixels that are half a pixel elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from coursekit import particles
from coursekit.gaussian import Gaussian, mahalanobis_squared
from coursekit.geometry import Array, transform, wrap_angle
from coursekit.models import DifferentialDrive, pose_residual
from coursekit.particles import Particles
from coursekit.teaching.failures import Failure
from coursekit.visual import (
    VisualFilter,
    dominant_cluster,
    heaviest,
    inflated,
    log_likelihood,
    mean,
    odometry_from_image,
)
from coursekit.visual.homography import project
from coursekit.visual.similarity import fit_similarity

REPORT = "a student report on locating an underwater robot over a mapped sea floor"
MOTION, CONTROL, DT = DifferentialDrive(4.0, 0.05, (0.4, 0.4, 1e-3)), np.array([20.0, 0.1]), 0.5
SHARP = np.diag([0.02**2, 0.02**2, 1e-4**2])
FILTER = VisualFilter((800, 2560), MOTION)

# --- a filter that is worse than its sensor ----------------------------------------------------------------------


def starved(cloud: Particles, fix: Gaussian, rng: np.random.Generator) -> Particles:
    """The plain filter with the sensor's own covariance: one particle is nearest, and it takes everything."""
    moved = particles.predict(particles.resample(cloud, rng), MOTION, CONTROL, DT, rng)
    return particles.weigh(moved, log_likelihood(fix))


def tuned_by_hand(cloud: Particles, fix: Gaussian, rng: np.random.Generator) -> Particles:
    """The plain filter with 50 px and 0.314 rad, "chosen upon several runs"."""
    moved = particles.predict(particles.resample(cloud, rng), MOTION, CONTROL, DT, rng)
    return particles.weigh(moved, log_likelihood(inflated(fix)))


def mixed(cloud: Particles, fix: Gaussian, rng: np.random.Generator) -> Particles:
    """A share of the particles from the fix, weighed by the motion."""
    return FILTER.step(cloud, CONTROL, DT, fix, rng)


def no_worse_than_its_sensor(step: Callable[..., Particles]) -> bool:
    """30 steps: the filter's median error is at most half as large again as the fix's own."""
    rng = np.random.default_rng(0)
    pose = np.array([800.0, -400.0, 0.3])
    cloud = Particles(pose + rng.standard_normal((500, 3)) * [2, 2, 0.02], angles=(2,))
    errors, sensor = [], []
    for _ in range(30):
        pose = MOTION.sample(pose[None], CONTROL, DT, rng)[0]
        noise = np.linalg.cholesky(SHARP) @ rng.standard_normal(3)
        cloud = step(cloud, Gaussian(pose + noise, SHARP), rng)
        errors.append(np.hypot(*(dominant_cluster(cloud).mean - pose)[:2]))
        sensor.append(np.hypot(*noise[:2]))
    return bool(np.median(errors) < 1.5 * np.median(sensor))


Failure(
    "lab08.starved",
    source="any particle filter whose sensor is much sharper than its cloud; named by Thrun et al. (2001)",
    wrong=starved,
    right=mixed,
    check=no_worse_than_its_sensor,
    lesson="One of a thousand particles has all the weight: the error is the distance of the nearest particle.",
)
Failure(
    "lab08.tuned_by_hand",
    source=REPORT,
    wrong=tuned_by_hand,
    right=mixed,
    check=no_worse_than_its_sensor,
    lesson="All particles keep their weight, and the filter is hundreds of times worse than its fixes.",
)

# --- a wrong match, trusted --------------------------------------------------------------------------------------


def trusting(fix: Gaussian) -> Callable[[Array], Array]:
    """Every match is right."""
    return log_likelihood(fix)


def doubting(fix: Gaussian) -> Callable[[Array], Array]:
    """One match in fifty is wrong, and could be anywhere."""
    return log_likelihood(fix, outlier=0.02, volume=FILTER.volume)


def survives_one_wrong_match(likelihood: Callable[[Gaussian], Callable[[Array], Array]]) -> bool:
    """A cloud that knows the place, one stray particle, and a match 700 px away where the stray happens to be."""
    rng = np.random.default_rng(0)
    states = np.vstack([np.array([800.0, -400.0, 0.3]) + rng.standard_normal((999, 3)), [1500.0, -400.0, 0.3]])
    log_weights = np.append(np.zeros(999), np.log(1e-9))
    wrong = Gaussian(states[-1], np.diag([1.0, 1.0, 1e-4]))
    weighed = particles.weigh(Particles(states, log_weights, angles=(2,)), likelihood(wrong))
    return bool(weighed.weights[:-1].sum() > 0.5)


Failure(
    "lab08.trusting",
    source=REPORT,
    wrong=trusting,
    right=doubting,
    check=survives_one_wrong_match,
    lesson="One wrong picture moves the whole belief to the other side of the map.",
)

# --- headings ----------------------------------------------------------------------------------------------------


def bare_minus(fix: Gaussian) -> Callable[[Array], Array]:
    """The difference of two headings by a bare minus."""
    return lambda states: np.array([-0.5 * mahalanobis_squared(state - fix.mean, fix.cov) for state in states])


def heading_is_a_circle(likelihood: Callable[[Gaussian], Callable[[Array], Array]]) -> bool:
    """Two particles 0.02 rad from the fix, one on either side of ±π, weigh the same."""
    fix = Gaussian(np.array([0.0, 0.0, np.pi]), np.diag([1.0, 1.0, 0.1**2]))
    left, right = likelihood(fix)(np.array([[0, 0, np.pi - 0.02], [0, 0, -np.pi + 0.02]]))
    return bool(abs(left - right) < 1e-9)


Failure(
    "lab08.unwrapped_yaw",
    source=REPORT,
    wrong=bare_minus,
    right=trusting,
    check=heading_is_a_circle,
    lesson="The robot turns through west, and every particle on the other side of ±π loses its weight.",
)


def unconverted(pose: ArrayLike) -> Array:
    """The picture's yaw taken for the odometry's heading."""
    u, v, yaw = np.asarray(pose, dtype=float)
    return np.array([u, -v, wrap_angle(yaw)])


def goes_where_it_points(convert: Callable[[Array], Array]) -> bool:
    """Ten pixels ahead on the map, converted, is where the motion model goes from the converted pose."""
    for yaw in np.linspace(-3, 3, 9):
        start = np.array([500.0, 400.0, yaw])
        ahead = start + np.array([10 * np.sin(yaw), -10 * np.cos(yaw), 0])
        if np.abs(pose_residual(_ahead(convert(start)), convert(ahead))).max() > 1e-9:
            return False
    return True


def _ahead(pose: Array) -> Array:
    """Ten pixels straight ahead in the odometry's frame."""
    return np.append(transform(pose, np.array([10.0, 0.0])), pose[2])


Failure(
    "lab08.mixed_frames",
    source="what the report's convertYawFromCameraPoseToROSPlane is there to prevent",
    wrong=unconverted,
    right=odometry_from_image,
    check=goes_where_it_points,
    lesson="The cloud moves north while the pictures move east, and turns left whenever the robot turns right.",
)

# --- the estimate ------------------------------------------------------------------------------------------------


def average(cloud: Particles) -> Array:
    """The mean of the cloud, headings as directions."""
    return mean(cloud).mean


def steadier_than_a_particle(estimate: Callable[[Particles], Array]) -> bool:
    """Over 40 resampled clouds 5 px wide the estimate strays by less than 1 px."""
    rng, strays = np.random.default_rng(0), []
    for _ in range(40):
        cloud = particles.resample(Particles(rng.standard_normal((400, 3)) * [5, 5, 0.1], angles=(2,)), rng)
        strays.append(np.hypot(*estimate(cloud)[:2]))
    return bool(np.mean(strays) < 1)


Failure(
    "lab08.greatest_of_equals",
    source=REPORT,
    wrong=heaviest,
    right=average,
    check=steadier_than_a_particle,
    lesson="After resampling all weights are equal: the track jitters with the width of the cloud.",
)

# --- pixels ------------------------------------------------------------------------------------------------------


def default_features(grey: Any) -> tuple[Array, Array]:
    """SIFT as it comes: the doubled picture's pixels are halved without minding where their centres lie."""
    keypoints, descriptors = cv2.SIFT.create(nfeatures=300).detectAndCompute(grey, None)
    return np.array([k.pt for k in keypoints]), descriptors


def precise_features(grey: Any) -> tuple[Array, Array]:
    """SIFT with precise upscaling."""
    keypoints, descriptors = cv2.SIFT.create(nfeatures=300, enable_precise_upscale=True).detectAndCompute(grey, None)
    return np.array([k.pt for k in keypoints]), descriptors


def turns_with_the_picture(features: Callable[[Any], tuple[Array, Array]]) -> bool:
    """Turn the picture by half a turn, find the features again, turn them back: the same places to 0.1 px."""
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.integers(0, 256, (240, 240), dtype=np.uint8), (0, 0), 2.5)
    grey = cv2.normalize(grey, None, 0, 255, cv2.NORM_MINMAX)
    (upright, a), (turned, b) = features(grey), features(np.ascontiguousarray(grey[::-1, ::-1]))
    pairs = cv2.BFMatcher(crossCheck=True).match(a, b)
    shift = np.array([upright[m.queryIdx] - (239 - turned[m.trainIdx]) for m in pairs])
    return bool(np.hypot(*np.median(shift, axis=0)) < 0.1)


Failure(
    "lab08.default_upscale",
    source="OpenCV's SIFT with its default settings",
    wrong=default_features,
    right=precise_features,
    check=turns_with_the_picture,
    lesson="Every feature is a quarter of a pixel off along both axes of its own picture, so a turn shows 0.7 px.",
)


def eight_parameters(source: Array, target: Array) -> Array:
    """The centre through a least-squares homography."""
    homography, _ = cv2.findHomography(source, target, 0)
    return project(homography, np.zeros((1, 2)))[0]


def four_parameters(source: Array, target: Array) -> Array:
    """The centre through a similarity: all that a camera that looks straight down can do."""
    return np.asarray(fit_similarity(source, target)[0][2:])


def steady_at_the_centre(centre: Callable[[Array, Array], Array]) -> bool:
    """Features along one side of the picture, 0.2 px of noise: the centre strays by less than 0.15 px, 60 draws."""
    rng, strays = np.random.default_rng(0), []
    for _ in range(60):
        source = rng.uniform([-190, -190], [-60, 190], (40, 2))
        target = source + [500.0, 400.0] + 0.2 * rng.standard_normal((40, 2))
        strays.append(np.hypot(*(centre(source, target) - [500.0, 400.0])))
    return bool(np.median(strays) < 0.15)


Failure(
    "lab08.eight_parameters",
    source=REPORT + ", after OpenCV's tutorial on features and homography",
    wrong=eight_parameters,
    right=four_parameters,
    check=steady_at_the_centre,
    lesson="The four extra parameters bend the picture to fit the noise, most where there is no feature.",
)
