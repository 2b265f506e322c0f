"""Several measurements of one moment, corrected at once; one that cannot be used is named, and spoils no other.

The measurements are put on top of each other: z = [z₁; z₂; …], H = [H₁; H₂; …], R = diag(R₁, R₂, …).  All are
linearised at the belief *before* any of them, so that their order does not matter.  A gate asks each by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from coursekit.doors import several
from coursekit.ekf.filter import Correction, conditioned, correct, gate_threshold, noise_of, wrapped
from coursekit.gaussian import Gaussian, check_belief
from coursekit.geometry import Array
from coursekit.models import SensorModel
from coursekit.models.checks import Undefined, expected, one_each, unusable
from coursekit.results import Rejected


@dataclass(frozen=True)
class JointCorrection(Correction):
    """What several measurements of one moment did together: a ``Correction`` by those that were used.

    used : which measurements were used, in order; innovation, innovation_cov and nis are of these.
    rejected : which were not → ``Rejected`` with its reason.
    each : the NIS of every measurement by itself (k,), before any was used; NaN for one that could not be compared.
    """

    used: tuple[int, ...]
    rejected: dict[int, Rejected]
    each: Array


def correct_together(
    belief: Gaussian,
    sensors: Sequence[SensorModel],
    z: Sequence[ArrayLike],
    R: ArrayLike | Sequence[ArrayLike] | None = None,
    *,
    gate: float | None = None,
) -> JointCorrection:
    """Condition a belief on k measurements of one moment, all linearised at this belief.

    A measurement that cannot be used is a *result*: it is named in ``rejected`` with its reason, and the others are
    used.  Such are: numbers that are not finite, what the sensor calls ``unusable`` (a range of -2 m), a landmark right
    under the robot, which has no bearing from there, and, with a gate, a surprise beyond it.

    Parameters
    ----------
    belief : one, over the state.
    sensors : k models, see ``models``; one with ``unusable(z)`` is asked, which answers with a reason or "".
    z : k measurements, each (m,) in its sensor's units; a table (k, m) will do.
    R : (m, m) for all, or k of them; by default each sensor's own.
    gate : the share of honest measurements that is let in, a probability; None lets all in, however surprising.

    Raises ValueError for numbers of sensors, z and R that differ, for many beliefs at once, for a gate outside (0, 1),
    and as ``correct`` does for shapes, an R that is no covariance and models with a part missing: those are no bad
    measurements.

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 5.2, with stacked measurements; section 5.4 for the gate.

    >>> from coursekit.models import RangeBearing
    >>> belief = Gaussian(np.zeros(3), np.diag([0.1, 0.1, 0.05]) ** 2)
    >>> tags = [RangeBearing([3.0, 1.0]), RangeBearing([2.0, -1.0]), RangeBearing([1.0, 2.0])]
    >>> seen = correct_together(belief, tags, [[3.2, 0.3], [-2.0, -0.5], [np.nan, 1.1]])
    >>> seen.used, {i: why.reason for i, why in seen.rejected.items()}
    ((0,), {1: 'a range of -2 m', 2: 'not finite: [nan 1.1]'})
    """
    check_belief(belief)
    if belief.mean.ndim > 1:
        raise ValueError(f"belief: expected one, got {belief.mean.shape[:-1]} of them: correct them one by one")
    sensors = several(sensors, "sensors")
    k = len(sensors)
    threshold = None if gate is None else lambda m: gate_threshold(gate, m)
    each, rejected, parts = np.full(k, np.nan), {}, {}
    for i, (sensor, z_i, R_i) in enumerate(zip(sensors, z, one_each(R, z, k), strict=True)):
        if reason := unusable(sensor, z_i):
            rejected[i] = Rejected(reason)
            continue
        try:
            alone = correct(belief, sensor, z_i, R_i)
        except Undefined as undefined:
            rejected[i] = Rejected(str(undefined))
            continue
        each[i], m = alone.nis, alone.innovation.size
        if threshold is not None and alone.nis > threshold(m):
            rejected[i] = Rejected(f"outside the gate: NIS {alone.nis:.1f} > {threshold(m):.1f}")
        else:
            parts[i] = sensor, alone, noise_of(R_i, sensor, m)
    if not parts:
        return JointCorrection(belief, np.zeros(0), np.zeros((0, 0)), 0.0, (), rejected, each)
    H = np.concatenate([expected(sensor, belief.mean)[1] for sensor, _, _ in parts.values()])
    nu = np.concatenate([alone.innovation for _, alone, _ in parts.values()])
    mean, posterior, S, nis = conditioned(belief, H, block_diag(*(noise for *_, noise in parts.values())), nu)
    for sensor, *_ in parts.values():
        mean = wrapped(sensor, mean) if hasattr(sensor, "wrap_state") else mean
    return JointCorrection(Gaussian.trusted(mean, *posterior), nu, S, nis, tuple(parts), rejected, each)
