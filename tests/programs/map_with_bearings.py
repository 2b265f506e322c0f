"""SLAM with a sensor of one's own, bearings alone; the map is saved, and the next day begins with it."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coursekit import DifferentialDrive, Gaussian, InvariantSlam, Known, wrap_angle

Array = NDArray[np.float64]


class Compass:
    """The bearing of a lamp that is some 3 m away."""

    R = np.array([[1e-4]])

    def h(self, pose: Array, lamp: Array) -> list[float]:
        return [np.arctan2(lamp[1] - pose[1], lamp[0] - pose[0]) - pose[2]]

    def residual(self, z: Any, z_hat: Any) -> Array:
        return wrap_angle(np.subtract(z, z_hat))

    def start(self, name: str, z: Array, pose: Gaussian) -> Gaussian | None:
        return Gaussian([3.0, z[0]], [[2.0, 0.0], [0.0, 1e-4]])


drive, compass = DifferentialDrive(), Compass()
slam = InvariantSlam(Gaussian([0.0, 0.0, 0.0], [[1e-6, 0, 0], [0, 1e-6, 0], [0, 0, 1e-6]]), drive, Known())
for step in range(40):
    here = np.array([0.05 * step, 0.0, 0.0])
    slam.sense(compass, [compass.h(here, np.array([2.0, 1.0]))], ids=["lamp"])
    slam.predict((0.5, 0.0), 0.1)
with TemporaryDirectory() as folder:
    slam.save(Path(folder) / "room.npz")
    again = InvariantSlam.load(Path(folder) / "room.npz", drive, Known())
again.add({"door": Gaussian([4.0, 0.0], [[0.01, 0.0], [0.0, 0.01]])})
assert again.rows == {"lamp": 0, "door": 1}
assert np.linalg.norm(again.landmarks[0] - [2.0, 1.0]) < 0.2
