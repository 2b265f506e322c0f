r"""A filter over a recording: events in the order of their stamps, and instruments that are calibrated on the way.

A real robot's numbers are not what their names say.  On the MRCLAM recording that the course uses, a command is carried
out a fifth of a second after its stamp, the robot turns at 0.93 of the rate that it was told and runs at 0.94 of the
speed, it veers to the right by 0.06 rad in a metre, and the "range" is, as in the report of labs 1 to 3, a depth: it
lacks the 1/cos of the bearing.  None of it is told to this filter.  Seven more numbers stand in its state and are
learnt from the innovations, while it drives:

    x = [x, y, θ, κ, λ, b, p, δ, γ, β]:  the robot runs at λ v and turns at κ ω + γ v, δ seconds after it was told;
    its camera looks β to the left, and says range · cos(bearing)ᵖ + b.

The delay δ is not a luxury.  A robot that is told to turn left and right, and does so late, looks to a filter without δ
like one that turns too little: with δ = 0 this one learns κ = 0.83, where the true heading's changes, regressed on the
integrated commands 0.2 s earlier, say 0.93.  Commands and sightings fix only the delay from the one to the other.  It
is booked on the drive, since the odometry of these recordings is what was *commanded*, and motors take time; a camera
whose stamps are late by ε instead would move the estimate by v ε and ω ε.  Where the commands come from a pilot that
answers to the robot's heading, a Q and an R that are too large let δ come out some hundredths of a second too large.

With wide priors the filter starts from instruments as one wishes for.  The truth is used for nothing but the start and
the score.

A recording of ten seconds that is made up: straight ahead at 0.1 m/s, past one landmark.

>>> import numpy as np
>>> from coursekit.models import RangeBearing
>>> from coursekit.recordings import Mrclam
>>> t = np.arange(0, 10, 0.1)
>>> truth = np.stack([t, 0.1 * t, 0 * t, 0 * t], axis=-1)
>>> seen = [[s, 6, *RangeBearing([2.0, 1.0]).h([0.1 * s, 0.0, 0.0])] for s in t[5::10]]
>>> run = Mrclam(np.stack([t, 0 * t + 0.1, 0 * t], axis=-1), np.array(seen), {6: np.array([2.0, 1.0])}, truth, {})
>>> track = localise(run, start_of(run))
>>> bool(track.rmse(run) < 0.1), truth_at(run, 5.05).round(3), len([*events(run)]) > 10
(True, array([0.505, 0.   , 0.   ]), True)

What the first half taught about the instruments serves any other estimator, here a cloud of particles that starts from
anywhere; its motion looks up by itself what was commanded.

>>> from coursekit import particles
>>> rng, learnt = np.random.default_rng(1), localise(part(run, 0, 5), start_of(run)).mean[-1, 3:]
>>> drive, tag = CalibratingDrive(run.odometry, sigma_drift=(0.0,) * 7), CalibratingRangeBearing(run.landmarks[6])
>>> poses = rng.uniform([-1, -1, -np.pi], [3, 3, np.pi], (5000, 3))
>>> cloud = particles.Particles(np.column_stack([poses, np.tile(learnt, (5000, 1))]), angles=(2,))
>>> for now, until, sightings in moments(run):
...     cloud = particles.predict(cloud, drive, now, until - now, rng) if until > now else cloud
...     cloud = particles.weigh_together(cloud, [tag] * len(sightings), [z for _, z in sightings]).cloud
...     if particles.effective_sample_size(cloud.weights) < 2500:
...         cloud = particles.resample(cloud, rng)
>>> bool(particles.covariance(cloud)[:2, :2].trace() < 4)
True

``instruments``  the drive and the camera that are calibrated
``clock``        a recording in the order of its stamps
``following``    the filter

Source: Leung, Halpern, Barfoot & Liu (2011) for the recordings; Bar-Shalom, Li & Kirubarajan (2001), section 11.9, for
estimating a parameter by augmenting the state.
"""

from coursekit.labs.lab09.localisation.clock import LONGEST_STEP, events, moments, part, start_of, truth_at
from coursekit.labs.lab09.localisation.following import Refusal, Track, localise
from coursekit.labs.lab09.localisation.instruments import IDEAL, CalibratingDrive, CalibratingRangeBearing

__all__ = [
    "IDEAL",
    "LONGEST_STEP",
    "CalibratingDrive",
    "CalibratingRangeBearing",
    "Refusal",
    "Track",
    "events",
    "localise",
    "moments",
    "part",
    "start_of",
    "truth_at",
]
