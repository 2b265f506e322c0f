"""Several measurements of one moment weigh a cloud at once; one that cannot be used is named, and spoils no other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import several
from coursekit.models import SensorModel
from coursekit.models.checks import one_each, unusable
from coursekit.particles.cloud import Particles, weigh
from coursekit.particles.likelihood import log_likelihood
from coursekit.results import Rejected


@dataclass(frozen=True, eq=False)
class Weighed:
    """What several measurements of one moment did to a cloud.

    cloud : after it.     used : which measurements were used, in order.
    rejected : which were not → ``Rejected`` with its reason.
    """

    cloud: Particles
    used: tuple[int, ...]
    rejected: dict[int, Rejected]


def weigh_together(
    cloud: Particles,
    sensors: Sequence[SensorModel],
    z: Sequence[ArrayLike],
    R: ArrayLike | Sequence[ArrayLike] | None = None,
) -> Weighed:
    """Bayes' rule with k measurements whose errors are independent:  w⁽ⁱ⁾ ∝ w⁽ⁱ⁾ ∏ N(zₖ; hₖ(x⁽ⁱ⁾), Rₖ).

    Parameters
    ----------
    sensors : k models, see ``models``; one with ``unusable(z)`` is asked, which answers with a reason or "".
    z : k measurements, each (m,) in its sensor's units; a table (k, m) will do.
    R : (m, m) for all, or k of them; by default each sensor's own.

    A measurement that cannot be used (not finite, a range of -2 m) is a result: ``rejected`` gives its reason, and the
    others weigh the cloud.

    Raises ValueError for numbers of sensors, z and R that differ, and as ``log_likelihood`` and ``weigh`` do.

    Source: Thrun, Burgard & Fox (2005), section 6.6.

    >>> from coursekit.models import RangeOnly
    >>> beacons = [RangeOnly([3.0, 0.0], position=(0, 1)), RangeOnly([0.0, 2.0], position=(0, 1))]
    >>> seen = weigh_together(Particles([[0.0, 0.0], [1.0, 0.0]]), beacons, [[3.0], [-1.0]])
    >>> seen.cloud.weights.round(3).tolist(), seen.rejected[1].reason
    ([1.0, 0.0], 'a range of -1 m')
    """
    if not isinstance(cloud, Particles):
        raise TypeError(f"cloud: expected Particles, got {type(cloud).__name__}")
    sensors = several(sensors, "sensors")
    k, total = len(sensors), np.zeros(len(cloud))
    rejected: dict[int, Rejected] = {}
    for i, (sensor, z_i, R_i) in enumerate(zip(sensors, z, one_each(R, z, k), strict=True)):
        if reason := unusable(sensor, z_i):
            rejected[i] = Rejected(reason)
        else:
            total += log_likelihood(sensor, z_i, R_i)(cloud.states)
    used = tuple(i for i in range(k) if i not in rejected)
    return Weighed(weigh(cloud, total) if used else cloud, used, rejected)
