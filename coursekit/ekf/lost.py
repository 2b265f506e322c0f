"""When a filter has left its own gate: ``Lost``, a result with its reason.

A filter's innovations tell whether it still knows where it is.  νᵀ S⁻¹ ν has a mean of one per number while S is right;
a filter that ran away, that has the wrong map, or whose noise is far too small, has tens or thousands.  ``Watch`` is
told the NIS of each correction, of an EKF or of particles, and says when they are beyond what chance explains.

>>> watch = Watch()
>>> for nis in [1.3, 2.8, 0.4, 900.0, 950.0, 800.0]:      # of range and bearing; then somebody swaps the map
...     watch.looked(nis, dof=2)
>>> watch.lost.reason
'3 of the last 20 looks surprise too much; in the last, νᵀ S⁻¹ ν is 800 over 2 numbers'
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from coursekit.doors import count, number
from coursekit.ekf.filter import gate_threshold
from coursekit.results import Rejected

_LOOKS = 20  # corrections that are judged together; a filter is lost when more than half of them are beyond chance
_RUNAWAY, _IN_A_ROW = 50.0, 3  # or when so many in a row are beyond chance by this factor
_INFLATION = 4.0  # innovations twice as long as they should be are a poor R, not yet a lost filter
_CHANCE = 0.999
_UNUSED = 50  # looks in a row of which nothing could be used


@dataclass(frozen=True)
class Lost(Rejected):
    """Why a filter is not to be believed any more, and since when.  It counts as false, like every ``Rejected``.

    reason : one sentence.     since : seconds of driving, summed over ``predict``, until it was noticed.

    >>> bool(Lost("nothing fits", since=12.5)), Lost("nothing fits", since=12.5).since
    (False, 12.5)
    """

    since: float = 0.0


class Broken(ValueError):
    """A filter's own numbers are broken; ``observe`` turns this into ``Lost``."""


class Watch:
    """Keeps the last innovations of a filter and says when they are beyond what chance explains.

    lost : ``Lost`` with its reason once they are, and from then on; None before.
    time : seconds, which whoever drives adds up; ``Lost.since`` is taken from it.

    A filter is lost when more than half of its last 20 looks lie beyond the 99.9 % gate by a factor of four, when three
    in a row lie beyond it by fifty, and when of fifty looks in a row nothing could be used.  (Innovations twice as long
    as they should be are a poor R, and not yet a lost filter.)

    >>> watch = Watch()
    >>> for nis in [1.3, 2.8, 0.4] + 11 * [95.0]:      # of range and bearing; then somebody swaps the map
    ...     watch.looked(nis, dof=2)
    >>> watch.lost is None, watch.lost.reason[:26]
    (False, '11 of the last 20 looks su')

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 5.4, for the NIS; the thresholds are this package's own.
    """

    def __init__(self) -> None:
        self.lost: Lost | None = None
        self.time = 0.0
        self._recent: deque[float] = deque(maxlen=_LOOKS)
        self._unused = 0

    def looked(self, nis: float, dof: int, unused: bool = False) -> None:
        """One look: its normalised innovation squared over ``dof`` numbers, and whether nothing of it could be used.

        Raises TypeError for what are no numbers, ValueError for a dof below 0.
        """
        nis, dof = number(nis, "nis"), count(dof, "dof", least=0)
        self._unused = self._unused + 1 if unused else 0
        if dof:
            self._recent.append(nis / gate_threshold(_CHANCE, dof))
        beyond = sum(not excess < _INFLATION for excess in self._recent)
        last = list(self._recent)[-_IN_A_ROW:]
        if 2 * beyond > _LOOKS or (len(last) == _IN_A_ROW and not min(last) < _RUNAWAY):
            self.give_up(f"{beyond} of the last {_LOOKS} looks surprise too much; in the last, νᵀ S⁻¹ ν is {nis:.3g} "
                         f"over {dof} numbers")  # fmt: skip
        if self._unused >= _UNUSED:
            self.give_up(f"of {_UNUSED} looks in a row no measurement was a landmark of the map or a new one")

    def give_up(self, reason: str) -> None:
        """Lost from now on; the first reason stands."""
        if self.lost is None:
            self.lost = Lost(reason, self.time)
