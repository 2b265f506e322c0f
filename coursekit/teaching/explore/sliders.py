"""What may be turned: the values of a parameter, and the grid of all their combinations."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coursekit.doors import several

Values = dict[str, Any]


@dataclass(frozen=True)
class Slider:
    """The values that one parameter may take, in order.

    values : numbers (a slider), or strings or booleans (a set of buttons); at least two, all different.
    label : what the reader sees; the parameter's name by default.    unit : "m", "rad", "%".
    start : the value shown first; the middle one of the numbers, the first of anything else.
    play : True adds a button that runs through the values, for time.

    Raises TypeError for any other kind of value, ValueError for fewer than two, equal or infinite ones.

    >>> distance = Slider([1.0, 2.0, 4.0], label="Distance", unit="m")
    >>> distance.start, distance.text(4.0)
    (2.0, '4 m')
    """

    values: Sequence[Any]
    label: str = ""
    unit: str = ""
    start: Any = None
    play: bool = False

    def __post_init__(self) -> None:
        for name in ("label", "unit"):
            if not isinstance(getattr(self, name), str):
                raise TypeError(f"{name}: expected a text, got {getattr(self, name)!r}")
        values = tuple(v.item() if isinstance(v, np.generic) else v for v in several(self.values, "values"))
        for v in values:
            if not isinstance(v, (bool, int, float, str)):
                raise TypeError(f"values: expected numbers, strings or booleans, got {v!r}")
            if isinstance(v, float) and not math.isfinite(v):
                raise ValueError(f"values: expected finite numbers, got {values}")
        if len(values) < 2 or len(set(values)) < len(values):
            raise ValueError(f"values: expected at least two different values, got {values}")
        start = self.start
        if start is None:
            start = values[0] if isinstance(values[0], (str, bool)) else values[(len(values) - 1) // 2]
        if not isinstance(start, (bool, int, float, str, np.generic)) or start not in values:
            raise ValueError(f"start: expected one of {values}, got {start!r}")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "start", start)

    @property
    def is_choice(self) -> bool:
        """True when the values are names or yes/no: buttons say that better than a slider."""
        return any(isinstance(v, (str, bool)) for v in self.values)

    def text(self, value: Any) -> str:
        """A value as the reader sees it, with its unit."""
        if isinstance(value, bool):
            return "on" if value else "off"
        number = f"{value:.4g}".replace("-", "−") if isinstance(value, float) else str(value)
        return f"{number} {self.unit}".rstrip()


def grid(sliders: Mapping[str, Slider]) -> Iterator[Values]:
    """Every combination of values; the last parameter runs fastest."""
    for combination in itertools.product(*(s.values for s in sliders.values())):
        yield dict(zip(sliders, combination, strict=True))


def start(sliders: Mapping[str, Slider]) -> Values:
    """The values shown first."""
    return {name: slider.start for name, slider in sliders.items()}
