r"""Lab 4: the extended Kalman filter, as two functions on a Gaussian.

``predict`` carries a belief through the motion, ``correct`` conditions it on a measurement and tells, beside the new
belief, how surprising the measurement was.  ``correct_together`` takes all measurements of one moment at once, and
names those that cannot be used.  ``correct_robustly`` trusts a measurement less the more it surprises: its docstring
says when that is worse than a gate.

>>> import numpy as np
>>> from coursekit.gaussian import Gaussian
>>> from coursekit.models import DifferentialDrive, RangeBearing
>>> belief = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2)
>>> belief = predict(belief, DifferentialDrive(), control=[0.5, 0.0], dt=2.0)
>>> seen = correct(belief, RangeBearing([3.0, 1.0]), z=[2.2, 0.5])
>>> print(seen.belief.mean.round(3), round(seen.nis, 2))
[ 1.032 -0.015 -0.023] 0.12

Of several measurements of one moment, a bad one is named, and the others are used:

>>> tags = [RangeBearing([3.0, 1.0]), RangeBearing([2.0, -1.0])]
>>> seen = correct_together(belief, tags, [[2.2, 0.5], [-1.0, 0.1]])
>>> seen.used, seen.rejected[1].reason
((0,), 'a range of -1 m')

The same two functions carry a hundred runs of an experiment at once, each with a belief of its own:

>>> rng = np.random.default_rng(4)
>>> beliefs = Gaussian(np.zeros((100, 3)), np.tile(belief.cov, (100, 1, 1)))
>>> seen = correct(beliefs, RangeBearing([3.0, 1.0]), z=rng.normal([3.1, 0.3], [0.1, 0.02], (100, 2)))
>>> seen.belief.mean.shape, seen.nis.shape
((100, 3), (100,))

``filter``    the filter
``together``  several measurements of one moment
``lost``      ``Watch``, which tells from the innovations when a filter is not to be believed any more
``joseph``    the careful form of the correction, for a measurement that leaves next to nothing
``batch``     the same algebra for many beliefs at once: what exists only for speed

Source: Thrun, Burgard & Fox (2005), table 3.3; Bar-Shalom, Li & Kirubarajan (2001), sections 5.2 and 10.3.
"""

from coursekit.ekf.filter import Correction, correct, correct_robustly, gate_threshold, predict
from coursekit.ekf.lost import Lost, Watch
from coursekit.ekf.together import JointCorrection, correct_together

__all__ = [
    "Correction",
    "JointCorrection",
    "Lost",
    "Watch",
    "correct",
    "correct_robustly",
    "correct_together",
    "gate_threshold",
    "predict",
]
