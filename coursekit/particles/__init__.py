r"""The particle filter: a belief as a cloud of weighted guesses, moved, weighed and resampled.

Three small functions make a filter.  A cloud of n states x⁽ⁱ⁾ with weights w⁽ⁱ⁾ stands for the belief
Σ w⁽ⁱ⁾ δ(x - x⁽ⁱ⁾); weights live in logs, because a product of twenty likelihoods underflows and a sum does not.

cloud        ``Particles``, and ``predict``, ``weigh``, ``resample``
likelihood   log p(z | x) of every particle, from a sensor model; and the NIS of the cloud
together     several measurements of one moment, and those that cannot be used
resampling   effective sample size; systematic, stratified, residual, multinomial and wheel resampling
summary      mean, covariance, roughening, how many particles are enough

>>> import numpy as np
>>> from coursekit.models import DifferentialDrive, RangeOnly
>>> rng = np.random.default_rng(1)
>>> cloud = Particles(rng.normal(size=(1000, 3)), angles=(2,))
>>> cloud = predict(cloud, DifferentialDrive(), [1.0, 0.1], 0.5, rng)
>>> cloud = weigh(cloud, log_likelihood(RangeOnly([4.0, 0.0], position=(0, 1)), [3.0]))
>>> if effective_sample_size(cloud.weights) < 500:
...     cloud = resample(cloud, rng)
>>> mean(cloud).shape, covariance(cloud).shape
((3,), (3, 3))

Source: Gordon, Salmond & Smith (1993); Thrun, Burgard & Fox (2005), chapter 4; Doucet & Johansen (2011).
"""

from coursekit.particles.cloud import Particles, predict, resample, weigh
from coursekit.particles.likelihood import log_likelihood, nis
from coursekit.particles.resampling import (
    RESAMPLERS,
    Indices,
    Resampler,
    effective_sample_size,
    multinomial,
    residual,
    stratified,
    systematic,
    wheel,
)
from coursekit.particles.summary import as_gaussian, covariance, kld_size, mean, occupied_bins, roughen
from coursekit.particles.together import Weighed, weigh_together

__all__ = [
    "RESAMPLERS",
    "Indices",
    "Particles",
    "Resampler",
    "Weighed",
    "as_gaussian",
    "covariance",
    "effective_sample_size",
    "kld_size",
    "log_likelihood",
    "mean",
    "multinomial",
    "nis",
    "occupied_bins",
    "predict",
    "resample",
    "residual",
    "roughen",
    "stratified",
    "systematic",
    "weigh",
    "weigh_together",
    "wheel",
]
