r"""Constants that nobody knows, as part of the state: a filter learns them from the innovations while it drives.

A radio's "metres" may be 7 % too long, or begin 0.3 m before its antenna.  Taken at its word it moves every fix; with
its scale and offset in the state it calibrates itself, if the robot sees several beacons from several places.

>>> from coursekit.models import DifferentialDrive
>>> drive = WithConstants(DifferentialDrive(), drift=(1e-3,))            # state [x, y, θ, s]
>>> radio = ScaledRange([3.0, 4.0], position=(0, 1), scale=3)
>>> radio.h([0.0, 0.0, 0.0, 1.07])
array([5.35])

Source: Bar-Shalom, Li & Kirubarajan (2001), section 11.9, for estimating a parameter by augmenting the state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, count, generator
from coursekit.geometry import Array
from coursekit.models.checks import has_parts, right_by_construction
from coursekit.models.sensors import RangeOnly


@right_by_construction
@dataclass(frozen=True)
class ScaledRange:
    """Distance to a landmark [x, y] by a radio that says  s · distance + o  [m], with s, o or both in the state.

    position : the state's entries that hold x and y.
    scale, offset : the entries that hold s (about 1) and o [m]; None where it is known, s = 1 or o = 0.  R (1, 1), m².

    Scale and offset are told apart only by ranges of different lengths; and with one beacon the robot may as well be
    nearer.  ``WithConstants`` gives a motion model the entries that it does not know.

    Raises ValueError for a landmark or R that cannot be, entries that are taken twice, and a state without them.

    >>> ScaledRange([3.0, 4.0], position=(0, 1), scale=3, offset=4).H([0.0, 0.0, 0.0, 1.1, 0.2]).round(2)
    array([[-0.66, -0.88,  0.  ,  5.  ,  1.  ]])

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 11.9.
    """

    landmark: Array
    R: Array = field(default_factory=lambda: np.diag([0.1**2]))
    position: tuple[int, int] = (0, 1)
    scale: int | None = 3
    offset: int | None = None

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self,
            landmark: ArrayLike,
            R: ArrayLike = ...,
            position: tuple[int, int] = (0, 1),
            scale: int | None = 3,
            offset: int | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        true = RangeOnly(self.landmark, self.R, self.position)
        for name, value in (("_true", true), ("landmark", true.landmark), ("R", true.R)):
            object.__setattr__(self, name, value)
        for name in ("scale", "offset"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, count(getattr(self, name), name, least=-1))
        taken = [*self.position, *(i for i in (self.scale, self.offset) if i is not None)]
        if len(set(taken)) < len(taken) or min(taken) < 0:
            raise ValueError(f"expected different entries of the state, counted from 0, got position={self.position}, "
                             f"scale={self.scale}, offset={self.offset}")  # fmt: skip
        object.__setattr__(self, "_last", max(taken))

    def h(self, x: ArrayLike) -> Array:
        """(..., n) → (..., 1)."""
        x = self._state(x)
        r, s = self._range(x), self._entry(x, self.scale, 1.0)
        return np.asarray(s * r + self._entry(x, self.offset, 0.0))

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (..., 1, n).  On top of the landmark as ``RangeOnly``."""
        x = self._state(x)
        sensor: RangeOnly = self.__dict__["_true"]
        H = np.asarray(self._entry(x, self.scale, 1.0))[..., None] * sensor.H(x)
        if self.scale is not None:
            H[..., self.scale] = self._range(x)
        if self.offset is not None:
            H[..., self.offset] = 1.0
        return H

    residual = staticmethod(RangeOnly.residual)

    def _state(self, x: ArrayLike) -> Array:
        x, last = as_numbers(x, "state"), self.__dict__["_last"]
        if x.ndim == 0 or x.shape[-1] <= last:
            raise ValueError(f"state: expected shape (..., n) with n > {last}, got {x.shape}")
        return x

    def _range(self, x: Array) -> Array:
        sensor: RangeOnly = self.__dict__["_true"]
        return sensor.h(x)

    @staticmethod
    def _entry(x: Array, index: int | None, known: float) -> Any:
        return known if index is None else x[..., index, None]


@dataclass(frozen=True)
class WithConstants:
    """A motion model with k more entries at the end of its state, which stay what they are but for a slow drift.

    motion : any motion model.     drift : of each new entry its standard deviation after a second, in its unit per √s;
    0 for a true constant, a little more for a filter that shall not fall asleep.

    Raises ValueError for a drift that is negative or not finite, TypeError for a motion that is none.

    >>> from coursekit.models import DifferentialDrive
    >>> WithConstants(DifferentialDrive(), drift=(0.01, 0.0)).f([0.0, 0.0, 0.0, 1.1, 0.2], [1.0, 0.0], 1.0)
    array([1. , 0. , 0. , 1.1, 0.2])

    Source: Bar-Shalom, Li & Kirubarajan (2001), section 11.9.
    """

    motion: Any
    drift: tuple[float, ...]

    def __post_init__(self) -> None:
        has_parts(self.motion, "motion", ("f", "F", "Q"))
        drift = as_numbers(self.drift, "drift")
        if drift.ndim != 1 or not drift.size or not np.all((drift >= 0) & (drift < LARGEST)):
            raise ValueError(f"drift: expected standard deviations ≥ 0, one for each constant, got {self.drift}")

    def f(self, x: ArrayLike, u: Any, dt: float) -> Array:
        """(..., n + k) → (..., n + k)."""
        x = self._state(x)
        return np.concatenate([self.motion.f(x[..., : -len(self.drift)], u, dt), x[..., -len(self.drift) :]], axis=-1)

    def F(self, x: ArrayLike, u: Any, dt: float) -> Array:
        """∂f/∂x, (..., n + k, n + k)."""
        x = self._state(x)
        return self._block(self.motion.F(x[..., : -len(self.drift)], u, dt), np.eye(len(self.drift)))

    def Q(self, x: ArrayLike, u: Any, dt: float) -> Array:
        """The model's own noise and the drift of the rest, (..., n + k, n + k)."""
        x = self._state(x)
        return self._block(self.motion.Q(x[..., : -len(self.drift)], u, dt), np.diag(np.square(self.drift)) * dt)

    def sample(self, states: ArrayLike, u: Any, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (m, n + k) → (m, n + k)."""
        states, k, rng = self._state(states), len(self.drift), generator(rng)
        moved = self.motion.sample(states[..., :-k], u, dt, rng)
        drift = math.sqrt(dt) * np.asarray(self.drift) * rng.standard_normal((len(states), k))
        return np.concatenate([moved, states[..., -k:] + drift], axis=-1)

    def _state(self, x: ArrayLike) -> Array:
        x = as_numbers(x, "state")
        if x.ndim == 0 or x.shape[-1] <= len(self.drift):
            raise ValueError(f"state: expected shape (..., n + {len(self.drift)}), got {x.shape}")
        return x

    @staticmethod
    def _block(A: Array, B: Array) -> Array:
        n, k = A.shape[-1], len(B)
        both = np.zeros((*A.shape[:-2], n + k, n + k))
        both[..., :n, :n], both[..., n:, n:] = A, B
        return both
