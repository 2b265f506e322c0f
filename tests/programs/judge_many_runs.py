"""Is the filter honest?  Its NEES over many seeds."""

import numpy as np

from coursekit import Gaussian, Position, chi2_band, ekf, monte_carlo, nees


def run(rng: np.random.Generator) -> float:
    truth = rng.normal(size=2)
    belief = Gaussian([0.0, 0.0], [[1.0, 0.0], [0.0, 1.0]])
    for _ in range(5):
        belief = ekf.correct(belief, Position(), truth + 0.1 * rng.standard_normal(2)).belief
    return float(nees(belief, truth))


low, high = chi2_band(2, runs=100, confidence=0.9999)
assert low < np.mean(monte_carlo(run, 100)) < high
assert len(monte_carlo(run, (3, 5, 8))) == 3
