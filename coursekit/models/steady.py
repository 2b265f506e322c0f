"""A differential drive whose noise grows with time and turning, however the drive is cut into steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers, generator, number
from coursekit.geometry import Array
from coursekit.models._vectors import copies, entries, functions, product, square
from coursekit.models.checks import right_by_construction
from coursekit.models.motion import DifferentialDrive, _step, check_controls, control_noise


@right_by_construction
@dataclass(frozen=True)
class SteadyNoiseDrive(DifferentialDrive):
    r"""State and control as ``DifferentialDrive``; for recordings, whose stamps come as they like.

    The deviations are *intensities*: ``sigma_v`` m/√s, ``sigma_omega`` rad/√s, ``sigma_pose`` [m, m, rad]/√s.  Two
    steps of half the length add the variance of one.  ``sigma_turn`` rad/√rad is what a commanded turn of one radian
    adds to the heading's deviation, for wheels slip where they turn: Var θ grows by
    sigma_omega² dt + sigma_turn² |ω| dt.

    The defaults are those of a slow indoor robot: 2 cm and two degrees in a second, seven degrees more in a turn of one
    radian.  Raises ValueError as ``DifferentialDrive``, and for a ``sigma_turn``
    that is negative or not finite.

    >>> drive = SteadyNoiseDrive(sigma_omega=0.04, sigma_turn=0.0, sigma_pose=(0.0, 0.0, 0.0))
    >>> [round(float(drive.Q([0.0, 0.0, 0.0], [0.1, 0.0], dt)[2, 2]), 6) for dt in (1.0, 4.0)]
    [0.0016, 0.0064]

    Source: Thrun, Burgard & Fox (2005), section 5.3.2, for noise that grows with the turn.
    """

    sigma_v: float = 0.02
    sigma_omega: float = 0.03
    sigma_turn: float = 0.12

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= number(self.sigma_turn, "sigma_turn") < LARGEST:
            raise ValueError(f"sigma_turn: expected a finite deviation ≥ 0, got {self.sigma_turn}")

    def root_M(self, u: ArrayLike, dt: float) -> Array:
        """A square root of M, the covariance of the control's mean error over the step, (..., 2, 2)."""
        _, omega = entries(u, 2, "control [v, ω]")
        dt = _step(dt)
        root = copies(np.zeros((2, 2)), omega)
        root[..., 0, 0] = self.sigma_v / math.sqrt(dt)
        turning = self.sigma_omega**2 + self.sigma_turn**2 * abs(omega)
        root[..., 1, 1] = functions(omega).sqrt(turning / dt)
        return root

    def Q(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """G M Gᵀ + diag(σ_pose²) dt, (..., 3, 3)."""
        return square(product(self.G(x, u, dt), self.root_M(u, dt))) + self._pose_cov * _step(dt)

    def linearized(self, x: ArrayLike, u: ArrayLike, dt: float) -> tuple[Array, Array, Array]:
        """f, F and Q at once, for a filter of many states."""
        return self.f(x, u, dt), self.F(x, u, dt), self.Q(x, u, dt)

    def sample(self, states: ArrayLike, u: ArrayLike, dt: float, rng: np.random.Generator) -> Array:
        """One noisy step for each state: (n, 3) → (n, 3)."""
        states, rng = as_numbers(states, "states"), generator(rng)
        if states.ndim > 2:
            raise ValueError(f"states: expected shape (n, 3), got {states.shape}")
        x, y, theta = (math.sqrt(_step(dt)) * sigma for sigma in self.sigma_pose)
        once = DifferentialDrive(0.0, 0.0, (x, y, theta))
        entries(u, 2, "control [v, ω]")
        check_controls(states, u)
        noise = control_noise(self.root_M(u, dt), states, rng)
        return once.sample(self.f(states, np.asarray(u, dtype=float) + noise, dt), [0.0, 0.0], dt, rng)
