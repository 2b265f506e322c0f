"""Arguments drawn at random: numbers of every kind, arrays of every shape, and valid objects that hold them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import coursekit as ck
from coursekit import noise, particles, recordings
from tests.hostile.hostility import NOT_NUMBERS, clothes

# Where floats end, where their squares and fourth powers do, and where a turn does.
CORNERS = [0.0, -0.0, 5e-324, 1e-308, 1e-162, 1e-81, 1e-60, 1e-16, np.pi, -np.pi, 2 * np.pi, 2.0**53, 1e59, 1e61, 1e77,
           1e155, 1.7e308, np.nan, np.inf, -np.inf]  # fmt: skip
FLOATS = st.sampled_from(CORNERS) | st.floats(-10, 10) | st.floats()
# Between these somebody may want an array of that length, and would have to wait for it.
INTEGERS = st.integers(-300, 300) | st.integers(2**31, 2**70) | st.integers(-(2**70), -(2**31))
DTYPES = st.sampled_from(["f8", ">f8", "f4", "f2", "longdouble", "i8", "u8", "i1", "bool", "c16"])
ARRAYS = DTYPES.flatmap(
    lambda kind: hnp.arrays(
        kind,
        hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5),
        elements=FLOATS if kind == "f8" else hnp.from_dtype(np.dtype(kind)),
    )
)


@st.composite
def dressed(draw: st.DrawFn, array: np.ndarray) -> Any:
    """The same numbers read-only, not contiguous, as lists, …"""
    return draw(st.sampled_from([array, *(form for _, form in clothes(array))]))


@st.composite
def alike(draw: st.DrawFn, good: np.ndarray) -> np.ndarray:
    """An array of the right shape: a good one scaled, with some entries replaced, or with rows that repeat."""
    array = np.array(good, dtype=float)
    change = draw(st.sampled_from(["scale", "replace", "rows", "shift", "fill"]))
    if change == "fill":
        return np.full_like(array, draw(FLOATS))
    if change == "scale":
        with np.errstate(all="ignore"):
            return array * 10.0 ** draw(st.integers(-320, 308))
    if change == "shift":
        return array + draw(st.floats(-1e70, 1e70))
    if change == "rows" and array.ndim and len(array):
        return array[draw(st.lists(st.integers(0, len(array) - 1), min_size=len(array), max_size=len(array)))]
    for _ in range(draw(st.integers(1, 3)) if array.size else 0):
        array.flat[draw(st.integers(0, array.size - 1))] = draw(FLOATS)
    return array


@st.composite
def made(draw: st.DrawFn, good: Any) -> Any:
    """An object of the same class around drawn numbers, as far as the class takes them; the good one elsewhere."""
    try:
        if isinstance(good, ck.Gaussian):
            spread = draw(alike(np.ones(good.mean.shape[-1:])))
            with np.errstate(all="ignore"):
                return ck.Gaussian(draw(alike(good.mean)), good.cov * spread[:, None] * spread)
        if isinstance(good, particles.Particles):
            return particles.Particles(draw(alike(good.states)), draw(alike(good.log_weights)), good.angles)
        if isinstance(good, recordings.Trajectory):
            return recordings.Trajectory.planar(draw(alike(good.time)), draw(alike(good.poses)))
        if isinstance(good, (noise.Log, ck.Camera)) or dataclasses.is_dataclass(good):
            fields = [f.name for f in dataclasses.fields(good) if f.init and _numeric(getattr(good, f.name))]
            name = draw(st.sampled_from(fields))
            old = getattr(good, name)
            new = draw(alike(np.asarray(old)) if np.ndim(old) else FLOATS | INTEGERS)
            return dataclasses.replace(good, **{name: new})
    except (ValueError, TypeError):
        pass
    return good


def _numeric(value: Any) -> bool:
    return isinstance(value, (int, float, np.ndarray, tuple)) and np.asarray(value).dtype.kind in "biuf"


def replacements(good: Any) -> st.SearchStrategy[Any]:
    """What may stand in an argument's place."""
    anything = st.one_of(
        FLOATS,
        INTEGERS,
        ARRAYS.flatmap(dressed),
        st.builds(lambda x, kind: np.asarray(x, kind)[()], st.floats(-100, 100), st.sampled_from(["f4", "i2", "?"])),
        st.text(max_size=5),
        st.lists(FLOATS | INTEGERS | st.none(), max_size=4),
        st.sampled_from(list(NOT_NUMBERS.values())),
    )
    if isinstance(good, np.ndarray) and good.dtype.kind == "f":
        return anything | st.one_of([alike(good).flatmap(dressed)] * 3)
    if isinstance(good, np.ndarray):
        return anything | hnp.arrays(
            good.dtype, st.just(good.shape), elements=hnp.from_dtype(good.dtype), fill=st.just(7)
        )
    if isinstance(good, bool) or good is None or isinstance(good, str):
        return anything
    if isinstance(good, (int, float)):
        return anything | st.one_of([FLOATS, INTEGERS])
    if isinstance(good, (list, tuple)) and good:
        inside = [
            replacements(entry).map(lambda new, i=i: [*good[:i], new, *good[i + 1 :]]) for i, entry in enumerate(good)
        ]
        return anything | st.one_of(inside)
    if dataclasses.is_dataclass(good) and not isinstance(good, type):
        return anything | st.one_of([made(good)] * 3)
    return anything
