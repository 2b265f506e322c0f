"""A noise model from a log of one's own."""

import numpy as np

from coursekit import Log, fit_calibrated, wrap_angle

rng = np.random.default_rng(2)
true_range, true_bearing = rng.uniform(1, 9, 600), rng.uniform(-0.5, 0.5, 600)
measured = true_range * 1.02 + 0.02 * true_range * rng.standard_normal(600)
log = Log(measured.tolist(), (true_bearing + 0.01 * rng.standard_normal(600)).tolist(), true_range, true_bearing)
model = fit_calibrated(log[::2])
corrected, _ = model.correct([5.0, 6.0], [0.0, 0.1])
assert model.R(5.0, 0.0).shape == (2, 2) and corrected.shape == (2,)
assert model.log_likelihood(log) > 0.0 and abs(wrap_angle(7.0)) < 3.2
