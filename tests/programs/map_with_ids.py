"""EKF-SLAM whose measurements carry ids."""

from coursekit import DifferentialDrive, Gaussian, InvariantSlam, Known

slam = InvariantSlam(Gaussian([0, 0, 0], [[1e-6, 0, 0], [0, 1e-6, 0], [0, 0, 1e-6]]), DifferentialDrive(), Known())
for step in range(10):
    slam.predict([0.5, 0.0], 0.1)
    ahead = 2.0 - 0.05 * (step + 1)
    slam.observe([[ahead, 0.0]], [[0.0025, 0.0], [0.0, 0.0001]], ids=["door"])
rows: dict[str, int] = slam.rows
assert rows == {"door": 0} and abs(slam.landmarks[rows["door"], 0] - 2.0) < 0.1
