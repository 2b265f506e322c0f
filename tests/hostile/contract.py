"""The contract as one table: what people call, with arguments that are right.

``CALLS`` maps a name to a function that makes the callable and its arguments anew, so that no call sees what another
did to them.  ``test_contract`` replaces one argument at a time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

import coursekit as ck
from coursekit import association, ekf, experiments, graph, icp, models, noise, particles, pinhole, recordings, slam
from coursekit.gaussian import ellipse, nis, with_margin
from coursekit.geometry import homogeneous, is_rotation, rotation, so3_exp, so3_log
from coursekit.models import range_bearing

Call = tuple[Callable[..., Any], dict[str, Any]]
CALLS: dict[str, Callable[[], Call]] = {}


def call(name: str, function: Callable[..., Any], /, **arguments: Callable[[], Any] | Any) -> None:
    """One row; an argument that is a function without a name of its own is made anew for each call."""
    CALLS[name] = lambda: (
        function,
        {k: v() if getattr(v, "__name__", "") == "<lambda>" else v for k, v in arguments.items()},
    )


def state(object_: Any) -> list[Any]:
    """What a filter hands out."""
    return [object_.mean, object_.cov, object_.landmarks]


def after(make: Callable[[], Any], method: str) -> Callable[..., Any]:
    """A filter's method on a fresh filter: what it leaves behind; an error must leave the filter as it was."""

    def run(**arguments: Any) -> Any:
        filter_ = make()
        before = state(filter_)
        try:
            result = getattr(filter_, method)(**arguments)
        except Exception:
            for kept, now in zip(before, state(filter_), strict=True):
                np.testing.assert_array_equal(kept, now, "an error changed the filter")
            raise
        return result, state(filter_)

    return run


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def cov(*sigmas: float) -> np.ndarray:
    return np.diag(sigmas) ** 2


def belief(n: int = 3) -> ck.Gaussian:
    return ck.Gaussian(0.1 * np.arange(n), cov(*([0.1] * n)))


def cloud() -> particles.Particles:
    return particles.Particles(rng().normal(0, 0.3, (40, 3)), angles=(2,))


def room(d: int = 2) -> np.ndarray:
    return np.random.default_rng(1).uniform(-2, 2, (60, d))


def log() -> noise.Log:
    at = np.linspace(1.0, 6.0, 30)
    return noise.Log(at + 0.05 * np.sin(9 * at), 0.02 * np.cos(7 * at), at, 0.0 * at, stamp=0.1 * np.arange(30))


def map_image() -> np.ndarray:
    blobs = cv2.GaussianBlur(rng().integers(0, 256, (200, 240), dtype=np.uint8), (0, 0), 3.0)
    return cv2.normalize(blobs, None, 0, 255, cv2.NORM_MINMAX)


def picture() -> np.ndarray:
    image = np.full((120, 160, 3), 128, np.uint8)
    image[20:101, 60:91] = (255, 255, 0)
    return image


def filter_of(kind: type) -> Callable[[], Any]:
    def make() -> Any:
        made = kind(ck.Gaussian(np.zeros(3), 1e-4 * np.eye(3)), ck.DifferentialDrive(), association.Known())
        made.observe([[2.0, 0.1], [1.5, -0.8]], cov(0.05, 0.01), ids=["a", "b"])
        return made

    return make


POSE, POINTS = [0.5, -0.2, 0.3], [[1.0, 0.5], [0.2, 2.0]]
CONTROL, STATES = [0.5, 0.2], [[0.5, -0.2, 0.3], [0.1, 0.0, -3.0]]


def a(value: Any) -> Callable[[], np.ndarray]:
    """An array, made anew."""
    return lambda: np.array(value, dtype=float)


call("geometry.wrap_angle", ck.wrap_angle, angle=a([0.1, 4.0]))
call("geometry.compose", ck.compose, a=a(POSE), b=a(STATES))
call("geometry.inverse", ck.inverse, a=a(STATES))
call("geometry.between", ck.between, a=a(POSE), b=a(STATES))
call("geometry.transform", ck.transform, pose=a(POSE), points=a(POINTS))
call("geometry.rotation", rotation, angle=a([0.1, 4.0]))
call("geometry.so3_exp", so3_exp, rotation_vector=a(POSE))
call("geometry.so3_log", so3_log, R=lambda: so3_exp(POSE))
call("geometry.is_rotation", is_rotation, R=lambda: so3_exp(POSE), tolerance=1e-6)
call("geometry.homogeneous", homogeneous, pose=a(POSE))

call("gaussian.Gaussian", ck.Gaussian, mean=a([1.0, 2.0]), cov=a([[4.0, 0.5], [0.5, 1.0]]))
call("gaussian.Gaussian.many", ck.Gaussian, mean=a([[1.0, 2.0]] * 3), cov=a([[[4.0, 0.5], [0.5, 1.0]]] * 3))
call("gaussian.nees", ck.nees, belief=lambda: belief(), truth=a(POSE), residual=models.pose_residual)
call("gaussian.nis", nis, innovation=a([0.3, 0.02]), innovation_cov=a([[0.01, 0.001], [0.001, 0.004]]))
call("gaussian.chi2_band", ck.chi2_band, dof=3, runs=20, confidence=0.95)
call("gaussian.ellipse", ellipse, cov=a([[4.0, 0.5], [0.5, 1.0]]), confidence=0.9, points=13)
call("gaussian.with_margin", with_margin, cov=a([[4.0, 2.0], [2.0, 1.0]]), share=1e-12)

C = pinhole.COURSE_CAMERA
call("pinhole.Camera", pinhole.Camera, fx=530.0, fy=530.0, cx=319.5, cy=239.5, width=640, height=480)
call("pinhole.Camera.project", C.project, p_camera=a([[4.0, 1.0, 0.3], [2.0, 0.0, 0.0]]))
call("pinhole.Camera.project_jacobian", C.project_jacobian, p_camera=a([4.0, 1.0, 0.3]))
call("pinhole.Camera.unproject", C.unproject, pixels=a([[300.0, 200.0]]), depth=a([2.0]))
call("pinhole.Camera.bearing", C.bearing, u=a([10.0, 600.0]))
call("pinhole.Camera.column", C.column, bearing=a([0.1, -0.2]))
SEEN = {"camera": C, "landmark_height": 0.5, "radius": 0.1, "camera_offset": 0.07}
call("pinhole.range_bearing", ck.range_bearing, height_px=a([53.0, 70.0]), axis_px=a([319.5, 200.0]), **SEEN)
call("pinhole.range_bearing_jacobian", pinhole.range_bearing_jacobian, height_px=53.0, axis_px=319.5, **SEEN)
call("pinhole.project_cylinder", pinhole.project_cylinder, range_=a([5.0, 3.0]), bearing=a([0.1, -0.1]), **SEEN)

OUTLINE = [[300, 100], [340, 100], [340, 300], [300, 300]]
call("landmarks.find_corners", ck.find_corners, image_bgr=lambda: picture(), colour="cyan")
call("landmarks.measure", ck.measure, corners=a(OUTLINE), camera=C, aspect=0.2)

call("noise.Log", noise.Log, range=a([1.0, 2.2, 3.0]), bearing=a([0.0, 0.1, 0.0]), true_range=a([1.1, 2.0, 3.0]),
     true_bearing=a([0.0, 0.0, 0.1]), stamp=a([0.0, 0.1, 0.2]))  # fmt: skip
call("noise.fit_piecewise", ck.fit_piecewise, log=lambda: log(), range_limits=(1.0, 10.0), bearing_limit=0.6,
     inflation=3.0)  # fmt: skip
call("noise.fit_calibrated", ck.fit_calibrated, log=lambda: log())
call("noise.Piecewise.R", ck.fit_piecewise(log()).R, range=a([2.0, 12.0]), bearing=a([0.1, 0.7]))
CALIBRATED = ck.fit_calibrated(log())
call("noise.Calibrated.R", CALIBRATED.R, range=a([2.0, 12.0]), bearing=a([0.1, 0.7]), turn_rate=0.1, speed=0.2)
call("noise.Calibrated.correct", CALIBRATED.correct, range=a([2.0, 12.0]), bearing=a([0.1, 0.7]), turn_rate=0.1,
     speed=0.2)  # fmt: skip
call("noise.Calibrated.log_likelihood", CALIBRATED.log_likelihood, log=lambda: log())
call("noise.autocorrelation", noise.autocorrelation, x=lambda: rng().normal(size=50), lags=10)
call("noise.effective_samples", noise.effective_samples, x=lambda: rng().normal(size=50))

DRIVE, TAG = ck.DifferentialDrive(), ck.RangeBearing([3.0, 1.0])
call("ekf.predict", ekf.predict, belief=lambda: belief(), motion=DRIVE, control=a(CONTROL), dt=0.1)
call("ekf.correct", ekf.correct, belief=lambda: belief(), sensor=TAG, z=a([3.1, 0.3]), R=lambda: cov(0.1, 0.02))
call("ekf.correct_robustly", ekf.correct_robustly, belief=lambda: belief(), sensor=TAG, z=a([3.9, 0.3]),
     R=lambda: cov(0.1, 0.02), gate=0.99)  # fmt: skip
call("ekf.correct_together", ekf.correct_together, belief=lambda: belief(), sensors=lambda: [TAG, TAG],
     z=a([[3.1, 0.3], [3.0, 0.3]]), R=lambda: cov(0.1, 0.02), gate=0.99)  # fmt: skip
call("ekf.Watch", lambda nis, dof: ekf.Watch().looked(nis, dof), nis=3.0, dof=2)
call("ekf.gate_threshold", ekf.gate_threshold, probability=0.99, dof=2)

call("models.DifferentialDrive", ck.DifferentialDrive, sigma_v=0.05, sigma_omega=0.05, sigma_pose=(1e-3, 1e-3, 1e-3))
call("models.ConstantVelocity", ck.ConstantVelocity, sigma_a=0.5)
call("models.RangeBearing", ck.RangeBearing, landmark=a([3.0, 1.0]), R=lambda: cov(0.1, 0.02))
call("models.RangeOnly", ck.RangeOnly, landmark=a([3.0, 1.0]), R=lambda: cov(0.1), position=(0, 1))
call("models.Position", ck.Position, R=lambda: cov(0.1, 0.1), position=(0, 1))
call("models.ScaledRange", models.ScaledRange, landmark=a([3.0, 1.0]), R=lambda: cov(0.1), position=(0, 1), scale=3,
     offset=4)  # fmt: skip
call("models.WithConstants", models.WithConstants, motion=DRIVE, drift=(0.01,))
call("models.Numerical", models.Numerical, model=TAG, difference=np.subtract)
call("models.jacobian", models.jacobian, function=np.square, x=a(POSE), difference=np.subtract)
call("models.pose_residual", models.pose_residual, a=a(POSE), b=a(STATES))
for _owner, _x, _u in ((DRIVE, STATES, CONTROL), (models.SteadyNoiseDrive(), STATES, CONTROL),
                       (ck.ConstantVelocity(), [[0.0, 1.0, 0.0, 2.0]], None)):  # fmt: skip
    for _verb in ("f", "F", "Q"):
        call(f"models.{type(_owner).__name__}.{_verb}", getattr(_owner, _verb), x=a(_x), u=_u and a(_u), dt=0.1)
    call(f"models.{type(_owner).__name__}.sample", _owner.sample, states=a(_x), u=_u and a(_u), dt=0.1,
         rng=lambda: rng())  # fmt: skip
for _sensor, _z in ((TAG, [3.0, 0.2]), (ck.RangeOnly([3.0, 1.0], position=(0, 1)), [3.0]), (ck.Position(), [3.0, 0.2])):
    _name = f"models.{type(_sensor).__name__}"
    call(f"{_name}.h", _sensor.h, x=a(STATES))
    call(f"{_name}.H", _sensor.H, x=a(STATES))
    call(f"{_name}.residual", _sensor.residual, z=a(_z), z_hat=a([_z, _z]))
call("models.range_bearing.g", range_bearing.g, pose=a(POSE), z=a([3.0, 0.2]))
call("models.range_bearing.h", range_bearing.h, pose=a(POSE), landmark=a([3.0, 0.2]))
call("models.range_bearing.unusable", range_bearing.unusable, z=a([3.0, 0.2]))

for _kind in (slam.EkfSlam, slam.FirstEstimateSlam, slam.InvariantSlam, slam.CalibratingSlam):
    _name = f"slam.{_kind.__name__}"
    call(_name, _kind, pose=lambda: belief(), motion=DRIVE, associate=association.Mahalanobis(0.99), n_init=2,
         max_misses=100)  # fmt: skip
    call(f"{_name}.predict", after(filter_of(_kind), "predict"), control=a(CONTROL), dt=0.1)
    call(f"{_name}.observe", after(filter_of(_kind), "observe"), z=a([[2.1, 0.1], [3.0, 1.0]]),
         R=lambda: cov(0.05, 0.01), ids=lambda: ["a", "c"])  # fmt: skip

call("association.Euclidean", association.Euclidean, threshold=0.5)
call("association.Mahalanobis", association.Mahalanobis, gate=0.99, new_landmark_gate=0.9999)
call("association.JointCompatibility", association.JointCompatibility, gate=0.99, new_landmark_gate=0.9999,
     max_nodes=100)  # fmt: skip
call("association.KnownMap", association.KnownMap, landmarks=a(POINTS))
call("association.KnownMap.match", association.KnownMap(POINTS).match, pose=lambda: belief(), z=a([[1.1, 0.4]]),
     R=lambda: cov(0.1, 0.02), rule=association.Mahalanobis(), ids=lambda: ["a"])  # fmt: skip

call("icp.align", icp.align, source=lambda: room()[:40], target=lambda: room(), initial=lambda: np.eye(3),
     metric="point_to_point", search="kdtree", max_distance=1.0, trim=0.9, max_iterations=20, tolerance=1e-9,
     kernel="huber", kernel_scale=0.1, accelerate=False)  # fmt: skip
call("icp.align.planes", icp.align, source=lambda: room(3), target=lambda: room(3), metric="point_to_plane",
     normals=lambda: icp.normals(room(3)))  # fmt: skip
call("icp.Target.of", icp.Target.of, points=lambda: room(), metric="point_to_plane", search="kdtree",
     normals=lambda: icp.normals(room()))  # fmt: skip
call("icp.find_start", icp.find_start, source=lambda: room(), target=lambda: room(), trim=0.7, rotations=4, points=20)
call("icp.scan_to_scan", icp.scan_to_scan, scans=lambda: [room(), room()], motions=a([[0.0, 0.0, 0.0]]),
     start=a(POSE))  # fmt: skip
call("icp.scan_to_map", icp.scan_to_map, scans=lambda: [room(), room()], motions=a([[0.0, 0.0, 0.0]]), start=a(POSE),
     spacing=0.3, cell=0.05)  # fmt: skip
call("icp.point_to_point", icp.point_to_point, p=lambda: room(), q=lambda: room() + 0.1,
     weights=lambda: np.linspace(0.1, 1, 60))  # fmt: skip
call("icp.point_to_plane", icp.point_to_plane, p=lambda: room(), q=lambda: room() + 0.1,
     normals=lambda: icp.normals(room()), weights=lambda: np.linspace(0.1, 1, 60))  # fmt: skip
call("icp.move", icp.move, T=lambda: homogeneous(POSE), points=lambda: room())
call("icp.normals", icp.normals, cloud=lambda: room())
call("icp.voxel_downsample", icp.voxel_downsample, cloud=lambda: room(), cell=0.3)
call("icp.voxel_rows", icp.voxel_rows, cloud=lambda: room(), cell=0.3)

call("particles.Particles", particles.Particles, states=a(STATES), log_weights=a([0.0, -1.0]), angles=(2,))
call("particles.predict", particles.predict, cloud=lambda: cloud(), motion=DRIVE, control=a(CONTROL), dt=0.1,
     rng=lambda: rng())  # fmt: skip
call("particles.weigh", particles.weigh, cloud=lambda: cloud(), log_likelihood=lambda: np.linspace(-3, 0, 40))
call("particles.weigh_together", particles.weigh_together, cloud=lambda: cloud(), sensors=lambda: [TAG, TAG],
     z=a([[3.1, 0.3], [3.0, 0.3]]), R=lambda: cov(0.1, 0.02))  # fmt: skip
call("particles.resample", particles.resample, cloud=lambda: cloud(), rng=lambda: rng(), method="stratified", size=20)
call("particles.effective_sample_size", particles.effective_sample_size, weights=a([0.1, 0.2, 0.7]))
for _verb in ("systematic", "stratified", "multinomial", "residual", "wheel"):
    call(f"particles.{_verb}", getattr(particles, _verb), weights=a([0.1, 0.2, 0.7]), rng=lambda: rng(), size=5)
call("particles.log_likelihood", lambda sensor, z, R: particles.log_likelihood(sensor, z, R)(np.array(STATES)),
     sensor=TAG, z=a([3.1, 0.3]), R=lambda: cov(0.1, 0.02))  # fmt: skip
call("particles.nis", particles.nis, cloud=lambda: cloud(), sensor=TAG, z=a([3.1, 0.3]), R=lambda: cov(0.1, 0.02))
call("particles.mean", particles.mean, cloud=lambda: cloud())
call("particles.covariance", particles.covariance, cloud=lambda: cloud())
call("particles.as_gaussian", particles.as_gaussian, cloud=lambda: cloud())
call("particles.roughen", particles.roughen, cloud=lambda: cloud(), rng=lambda: rng(), scale=0.2)
call("particles.kld_size", particles.kld_size, bins=20, error=0.05, confidence=0.99)
call("particles.occupied_bins", particles.occupied_bins, states=a(STATES), bin_size=a([0.5, 0.5, 0.5]))

call("visual.MapMatcher", ck.MapMatcher, map_image=lambda: map_image(), max_features=500, ratio=0.8,
     reprojection=3.0, min_inliers=8, scales=(0.5, 2.0), max_skew=1.25, margin=0.0)  # fmt: skip
MATCHER = ck.MapMatcher(map_image(), max_features=500)
call("visual.MapMatcher.locate", MATCHER.locate, image=lambda: map_image()[30:130, 40:160])
call("visual.MapMatcher.correspondences", MATCHER.correspondences, image=lambda: map_image()[30:130, 40:160])

call("graph.Edge", graph.Edge, i=0, j=1, pose=a(POSE), cov=lambda: cov(0.1, 0.1, 0.1))
call("graph.PointEdge", graph.PointEdge, i=0, j=1, point=a([1.0, 0.5]), cov=lambda: cov(0.1, 0.1))
call("graph.prior", graph.prior, i=0, mean=a(POSE), cov=lambda: cov(0.1, 0.1, 0.1))
call("graph.between_poses", graph.between_poses, i=0, j=1, pose=a(POSE), cov=lambda: cov(0.1, 0.1, 0.1))
call("graph.sight", graph.sight, i=0, j=1, z=a([2.0, 0.1]), R=lambda: cov(0.1, 0.1))
call("graph.point_from", graph.point_from, i=0, j=1, point=a([2.0, 0.1]), cov=lambda: cov(0.1, 0.1))
call("graph.motion_step", graph.motion_step, i=0, j=1, motion=DRIVE, control=a(CONTROL), dt=0.1, near=a(POSE))
FACTORS = [graph.prior(0, np.zeros(3), 0.01 * np.eye(3)), graph.sight(0, 1, [2.0, 0.1], 0.01 * np.eye(2))]
call("graph.optimize", graph.optimize, values=lambda: [np.zeros(3), np.array([1.5, 0.3])], factors=lambda: [*FACTORS],
     iterations=10, tolerance=1e-9)  # fmt: skip
EDGES = [graph.Edge(0, 1, [1.0, 0.0, 0.1], np.eye(3)), graph.Edge(0, 1, [1.2, 0.0, 0.1], np.eye(3))]
call("graph.optimize_pose_graph", graph.optimize_pose_graph, poses=a([[0.0, 0, 0], [1.1, 0, 0.1]]),
     edges=lambda: [*EDGES], iterations=10)  # fmt: skip

call("experiments.monte_carlo", experiments.monte_carlo, run=np.random.Generator.random, seeds=lambda: [1, 2],
     executor=None, batch=1)  # fmt: skip
call("explore.Slider", ck.Slider, values=lambda: [1.0, 2.0, 4.0], label="Distance", unit="m", start=2.0)
WAY = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [2.0, 1.0, 0.2], [3.0, 3.0, 0.3]])
call(
    "recordings.Trajectory",
    recordings.Trajectory,
    time=a([0.0, 1.0]),
    T_world_robot=lambda: np.tile(np.eye(4), (2, 1, 1)),
)
call("recordings.Trajectory.planar", recordings.Trajectory.planar, time=a([0.0, 1.0]), poses=a(STATES))
call(
    "recordings.absolute_error",
    recordings.absolute_error,
    estimate=lambda: WAY + np.array([0.1, 0, 0]),
    truth=a(WAY),
    align="rigid",
)
call("recordings.relative_error", recordings.relative_error, estimate=lambda: WAY + np.array([0.1, 0, 0]),
     truth=a(WAY), delta=1, unit="frames")  # fmt: skip
_way = lambda: recordings.Trajectory.planar(np.arange(4.0), WAY)  # noqa: E731
call("recordings.matched", recordings.matched, estimate=_way, truth=_way, max_difference=0.01)
