r"""Jacobians by differences, for a model that has none: slower than a formula, and right to some nine digits.

∂f/∂xᵢ ≈ (f(x + hᵢ eᵢ) - f(x - hᵢ eᵢ)) / (2 hᵢ), an error of the order hᵢ² from the curve and ε/hᵢ from rounding; the
step hᵢ = ε^(1/3) max(1, |xᵢ|) balances the two.

Source: Dennis & Schnabel (1983), section 5.4, for central differences and their step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST, as_numbers
from coursekit.geometry import Array
from coursekit.models.checks import has_parts

_STEP = float(np.finfo(float).eps ** (1 / 3))


def jacobian(
    function: Callable[[Array], ArrayLike], x: ArrayLike, difference: Callable[[Any, Any], Any] = np.subtract
) -> Array:
    """∂f/∂x by central differences, (..., m, n) for f: (..., n) → (..., m).

    Parameters
    ----------
    function : f, of one state, or of many if x holds many.
    x : (n,) or (..., n), finite.
    difference : f(a) - f(b) → (..., m); give the model's own where f holds an angle, ``models.pose_residual`` for a
        pose or a sensor's ``residual``: across ±π a bare minus gives 2π/h.

    Raises ValueError for an x or a difference that is not finite, and what the function raises; TypeError for what are
    no numbers.

    >>> jacobian(lambda x: np.array([x[0] ** 2, x[0] * x[1]]), [3.0, 2.0]).round(8)
    array([[6., 0.],
           [2., 3.]])

    Source: Dennis & Schnabel (1983), section 5.4.
    """
    x = as_numbers(x, "x")
    for name, called in (("function", function), ("difference", difference)):
        if not callable(called):
            raise TypeError(f"{name}: expected a function, got {called!r}")
    if x.ndim == 0 or not x.size or not np.all(np.abs(x) < LARGEST):
        raise ValueError(f"x: expected finite numbers of shape (..., n), got {x} (none beyond {LARGEST:g})")
    columns = []
    for i in range(x.shape[-1]):
        ahead, behind = x.copy(), x.copy()
        step = _STEP * np.maximum(1.0, np.abs(x[..., i]))
        ahead[..., i] += step
        behind[..., i] -= step
        change = as_numbers(difference(function(ahead), function(behind)), "difference")
        columns.append(change / (ahead[..., i] - behind[..., i])[..., None])  # the step that floats really made
    derivative = np.stack(columns, axis=-1)
    if not np.isfinite(derivative).all():
        raise ValueError(f"function: expected finite numbers around {x}, got differences that are not")
    return derivative


@dataclass(frozen=True)
class Numerical:
    """A model that lacks its Jacobian, with one by differences: F of a motion's f, H of a sensor's h.

    model : a motion model without F, or a sensor model without H; everything else is the model's own.
    difference : of two states, for F, where the state holds an angle: ``models.pose_residual`` for a pose.  H uses the
        sensor's ``residual``.

    Raises TypeError for a model with neither f nor h; F and H raise as ``jacobian`` does.

    >>> from coursekit import ekf
    >>> from coursekit.gaussian import Gaussian
    >>> class Beacon:                                  # [x, y] → the squared distance to the origin
    ...     R = np.array([[0.01]])
    ...     def h(self, x): return np.sum(x**2, axis=-1, keepdims=True)
    ...     def residual(self, z, z_hat): return z - z_hat
    >>> seen = ekf.correct(Gaussian([1.0, 2.0], 0.01 * np.eye(2)), Numerical(Beacon()), [5.2])
    >>> seen.belief.mean.round(3)
    array([1.019, 2.038])

    Source: Dennis & Schnabel (1983), section 5.4.
    """

    model: Any
    difference: Callable[[Any, Any], Any] = np.subtract

    def __post_init__(self) -> None:
        if not callable(self.difference):
            raise TypeError(f"difference: expected a function of two values, got {self.difference!r}")
        if not (hasattr(self.model, "f") or hasattr(self.model, "h")):
            has_parts(self.model, "model", ("f", "h"))

    def F(self, x: ArrayLike, u: Any, dt: float) -> Array:
        """∂f/∂x, (..., n, n)."""
        return jacobian(lambda state: self.model.f(state, u, dt), x, self.difference)

    def H(self, x: ArrayLike) -> Array:
        """∂h/∂x, (..., m, n)."""
        return jacobian(self.model.h, x, self.model.residual)

    if TYPE_CHECKING:  # what ``__getattr__`` finds, for those checkers that ask for each by its name

        @property
        def R(self) -> Array: ...
        def h(self, x: Array) -> Array: ...
        def residual(self, z: Any, z_hat: Any) -> Array: ...
        def f(self, x: Array, u: Any, dt: float) -> Array: ...
        def Q(self, x: Array, u: Any, dt: float) -> Array: ...
        def sample(self, states: Array, u: Any, dt: float, rng: np.random.Generator) -> Array: ...

    def __getattr__(self, name: str) -> Any:
        if name == "model":  # not there yet, while a copy or a pickle is made
            raise AttributeError(name)
        return getattr(self.model, name)
