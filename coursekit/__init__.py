"""coursekit: small, exact, tested estimators for a robot that asks "Where am I?", and the course that teaches them.

The mathematics: ``geometry`` (angles, poses, rotations), ``gaussian`` (beliefs, and whether they are honest),
``models`` (how robots move, with wheels that slip, and what sensors see), ``graph`` (least squares over poses and
landmarks). Beneath all rooms stand ``doors`` (what an argument must be before anybody computes with it), ``results``
(a measurement that was rejected, and why) and ``extras`` (what is optional, and how to install it). The estimators, in
the labs' order:

=====  ===============  ========================================================================================
Lab 1  ``landmarks``    from a picture to a landmark's outline: its edges, left and right, top and foot
Lab 2  ``pinhole``      the camera: from an outline to range and bearing
Lab 3  ``noise``        what a measured range and bearing say about the true ones
Lab 4  ``ekf``          the extended Kalman filter
Lab 5  ``slam``         EKF-SLAM; ``association``: which landmark was that?
Lab 6  ``icp``          two clouds, one motion
Lab 7  ``particles``    the particle filter
Lab 8  ``visual``       a particle filter that matches its camera's image to a map
Lab 9  ``localisation`` an EKF over a real recording
=====  ===============  ========================================================================================

Beside them ``world`` (a simulated world: arenas, robot, cameras, lidar), ``recordings`` and ``datasets`` (logs read
and written, trajectories and their errors, where recordings live), ``teaching`` (``plotting``, ``explore``,
``exercises``, ``failures``, ``experiments``) and ``labs`` (what each lab computes, draws, asks and breaks).

Rooms and names are offered here and imported when first used: ``from coursekit import ekf, Gaussian``.  SI units and
radians; a pose is [x, y, θ]; randomness is an explicit ``numpy.random.Generator``.

One step of the Kalman filter: 0.1 s straight ahead, then a landmark is seen.

>>> import numpy as np
>>> import coursekit as ck
>>> belief = ck.Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2)
>>> belief = ck.ekf.predict(belief, ck.DifferentialDrive(), [0.5, 0.0], 0.1)
>>> result = ck.ekf.correct(belief, ck.RangeBearing([2.0, 1.0]), [2.15, 0.48], np.diag([0.05, 0.02]) ** 2)
>>> bool(result.nis < ck.chi2_band(2)[1]), bool(result.belief.cov[0, 0] < belief.cov[0, 0])
(True, True)

SLAM: two landmarks that nobody told it about.

>>> slam = ck.EkfSlam(ck.Gaussian(np.zeros(3), 1e-6 * np.eye(3)), ck.DifferentialDrive(), ck.Mahalanobis(0.99))
>>> for k in range(3):
...     slam.predict([0.5, 0.0], 0.1)
...     at = [0.05 * (k + 1), 0.0, 0.0]
...     z = np.array([ck.RangeBearing(tag).h(at) for tag in ([2.0, 0.0], [1.0, -1.0])])
...     indices = slam.observe(z, np.diag([0.05, 0.01]) ** 2)
>>> indices, slam.landmarks.round(2) + 0.0
(array([0, 1]), array([[ 2.,  0.],
       [ 1., -1.]]))

ICP: how did the sensor move between two clouds?

>>> target = np.random.default_rng(0).uniform(-2, 2, (200, 2))
>>> source = ck.geometry.transform(ck.geometry.inverse([0.05, -0.02, 0.03]), target)
>>> ck.align(source, target).pose.round(6)
array([ 0.05, -0.02,  0.03])

A particle filter: a thousand guesses, one fix of the position.

>>> rng = np.random.default_rng(0)
>>> cloud = ck.Particles(np.zeros((1000, 3)), angles=(2,))
>>> cloud = ck.particles.predict(cloud, ck.DifferentialDrive(), [0.5, 0.0], 2.0, rng)
>>> cloud = ck.particles.weigh(cloud, ck.particles.log_likelihood(ck.Position(R=0.01 * np.eye(2)), [1.0, 0.0]))
>>> cloud = ck.resample(cloud, rng)
>>> bool(np.linalg.norm(ck.particles.mean(cloud)[:2] - [1.0, 0.0]) < 0.1)
True
"""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from coursekit.extras import explain_what_is_missing

__version__ = "0.1.0"

# What is offered here: modules by their short path, and names by the module that offers them.
_MODULES = {
    "geometry": "geometry",
    "gaussian": "gaussian",
    "models": "models",
    "graph": "graph",
    "landmarks": "landmarks",
    "pinhole": "pinhole",
    "noise": "noise",
    "ekf": "ekf",
    "slam": "slam",
    "association": "slam.association",
    "icp": "icp",
    "particles": "particles",
    "visual": "visual",
    "localisation": "labs.lab09.localisation",
    "world": "world",
    "recordings": "recordings",
    "datasets": "recordings.datasets",
    "teaching": "teaching",
    "plotting": "teaching.plotting",
    "explore": "teaching.explore",
    "exercises": "teaching.exercises",
    "failures": "teaching.failures",
    "experiments": "teaching.experiments",
    "labs": "labs",
}
_NAMES = {
    "geometry": "wrap_angle compose between inverse transform",
    "gaussian": "Gaussian nees chi2_band",
    "models": "DifferentialDrive ConstantVelocity RangeBearing RangeOnly Position pose_residual",
    "results": "Rejected",
    "landmarks": "find_corners measure",
    "pinhole": "Camera range_bearing",
    "noise": "Log load_log fit_piecewise fit_calibrated",
    "slam": "EkfSlam FirstEstimateSlam InvariantSlam",
    "slam.association": "Euclidean Mahalanobis JointCompatibility Known",
    "icp": "align find_start Registration",
    "particles": "Particles resample effective_sample_size",
    "visual": "MapMatcher",
    "world.arena": "Arena",
    "world.robot": "World",
    "teaching.experiments": "monte_carlo",
    "teaching.explore": "Slider",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

if TYPE_CHECKING:  # The same tables for type checkers and editors; a test holds the two equal.
    from coursekit import (
        ekf,
        gaussian,
        geometry,
        graph,
        icp,
        labs,
        landmarks,
        models,
        noise,
        particles,
        pinhole,
        recordings,
        slam,
        teaching,
        visual,
        world,
    )
    from coursekit.gaussian import Gaussian, chi2_band, nees
    from coursekit.geometry import between, compose, inverse, transform, wrap_angle
    from coursekit.icp import Registration, align, find_start
    from coursekit.labs.lab09 import localisation
    from coursekit.landmarks import find_corners, measure
    from coursekit.models import ConstantVelocity, DifferentialDrive, Position, RangeBearing, RangeOnly, pose_residual
    from coursekit.noise import Log, fit_calibrated, fit_piecewise, load_log
    from coursekit.particles import Particles, effective_sample_size, resample
    from coursekit.pinhole import Camera, range_bearing
    from coursekit.recordings import datasets
    from coursekit.results import Rejected
    from coursekit.slam import EkfSlam, FirstEstimateSlam, InvariantSlam, association
    from coursekit.slam.association import Euclidean, JointCompatibility, Known, Mahalanobis
    from coursekit.teaching import exercises, experiments, explore, plotting
    from coursekit.teaching import failures as failures
    from coursekit.teaching.experiments import monte_carlo
    from coursekit.teaching.explore import Slider
    from coursekit.visual import MapMatcher
    from coursekit.world.arena import Arena
    from coursekit.world.robot import World

__all__ = [
    "Arena", "Camera", "ConstantVelocity", "DifferentialDrive", "EkfSlam", "Euclidean", "FirstEstimateSlam",
    "Gaussian", "InvariantSlam", "JointCompatibility", "Known", "Log", "Mahalanobis", "MapMatcher", "Particles",
    "Position", "RangeBearing", "RangeOnly", "Registration", "Rejected", "Slider", "World", "align", "association",
    "between", "chi2_band", "compose", "datasets", "effective_sample_size", "ekf", "exercises", "experiments",
    "explore", "failures", "find_corners", "find_start", "fit_calibrated", "fit_piecewise", "gaussian", "geometry",
    "graph", "icp", "inverse", "labs", "landmarks", "load_log", "localisation", "measure", "models", "monte_carlo",
    "nees", "noise", "particles", "pinhole", "plotting", "pose_residual", "range_bearing", "recordings", "resample",
    "slam", "teaching", "transform", "visual", "world", "wrap_angle",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """A room or a name of the tables, imported when it is first asked for."""
    if name in _MODULES:
        value = import_module(f"coursekit.{_MODULES[name]}")
    elif name in _HOME:
        value = getattr(import_module(f"coursekit.{_HOME[name]}"), name)
    else:
        raise AttributeError(f"module 'coursekit' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _ShortPaths:
    """Finds ``coursekit.association``, which has no file of its own, where it stands: one module, two paths.

    Python asks a finder for a spec, and the spec's loader for a module; this one hands over the module of the real
    path.  Python then writes the new spec onto that module, so its own spec is kept, and put back.
    """

    @classmethod
    def find_spec(cls, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        _, short, *below = [*name.split("."), ""]
        if not name.startswith("coursekit.") or _MODULES.get(short, short) == short:
            return None
        place = ".".join(["coursekit", _MODULES[short], *below]).rstrip(".")
        return ModuleSpec(name, cls, loader_state=place)  # type: ignore[arg-type]

    @staticmethod
    def create_module(spec: ModuleSpec) -> ModuleType:
        module = import_module(spec.loader_state)
        spec.loader_state = module.__spec__
        return module

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        module.__spec__ = module.__spec__ and module.__spec__.loader_state


sys.meta_path.insert(0, _ShortPaths)
explain_what_is_missing()
