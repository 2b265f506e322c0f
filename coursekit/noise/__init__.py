"""From residuals to a noise model: what a measured range and bearing say about the true ones (Lab 3).

``models``       what a noise model is, how two are compared, and the report's piecewise model
``calibrated``   bias from geometry, the picture's age, and a spread that grows, fitted to a log
``regression``   mean and spread fitted together by maximum likelihood
``correlation``  how many independent samples a correlated log is worth
"""

from coursekit.noise.calibrated import Calibrated, fit_calibrated
from coursekit.noise.correlation import autocorrelation, effective_samples
from coursekit.noise.models import NoiseModel, Piecewise, aic, fit_piecewise
from coursekit.noise.regression import Spread
from coursekit.recordings import Log
from coursekit.recordings import read_landmark_log as load_log

__all__ = [
    "Calibrated",
    "Log",
    "NoiseModel",
    "Piecewise",
    "Spread",
    "aic",
    "autocorrelation",
    "effective_samples",
    "fit_calibrated",
    "fit_piecewise",
    "load_log",
]
