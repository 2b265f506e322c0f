"""A particle filter between two beacons."""

import numpy as np

from coursekit import DifferentialDrive, Particles, RangeOnly, effective_sample_size, particles, resample

rng = np.random.default_rng(1)
cloud = Particles(rng.uniform([-1, -1, -3], [3, 3, 3], (2000, 3)), angles=(2,))
for step in range(20):
    cloud = particles.predict(cloud, DifferentialDrive(), [0.5, 0.0], 0.1, rng)
    for beacon in ([3.0, 0.0], (0.0, 3.0)):
        radio = RangeOnly(beacon, R=[[0.01]], position=(0, 1))
        truth = [0.05 * (step + 1), 0.0, 0.0]
        cloud = particles.weigh(cloud, particles.log_likelihood(radio, radio.h(truth)))
    if effective_sample_size(cloud.weights) < 1000:
        cloud = resample(cloud, rng)
small = Particles([[0.0, 1.0], [2.0, 3.0]], [0.0, -1.0])
assert abs(particles.mean(cloud)[0] - 1.0) < 0.3 and len(small) == 2
