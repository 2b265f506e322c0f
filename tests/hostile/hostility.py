"""What is wrong with an argument: values of every wrong kind, and good values in other clothes."""

from __future__ import annotations

import datetime
import decimal
from collections.abc import Iterator
from typing import Any

import numpy as np

import coursekit as ck


class ByName:
    """Something that is asked by names, and has a length: neither a list nor a mapping."""

    def __len__(self) -> int:
        return 3

    def __getitem__(self, name: str) -> float:
        return {"x": 1.0}[name]


NOT_NUMBERS: dict[str, Any] = {
    "nothing": None,
    "an object": object(),
    "a text": "seven",
    "a number as text": "7",
    "bytes": b"\x00\xff",
    "a dictionary": {"x": 1.0},
    "a class": ck.Gaussian,
    "a function": len,
    "a complex number": 1j,
    "a date": datetime.date(2026, 1, 1),
    "a time span": np.timedelta64(1, "s"),
    "a decimal": decimal.Decimal("1.5"),
    "a set": {1.0, 2.0},
    "something asked by names": ByName(),
    "a table with named columns": np.zeros(3, dtype=[("x", float)]),
    "ragged rows": [[1.0, 2.0], [3.0]],
    "texts": ["a", "b", "c"],
    "a number beyond all floats": 10**400,
    "a Gaussian": ck.Gaussian([0.0, 0.0], np.eye(2)),
    "many Gaussians": ck.Gaussian(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))),
    "a cloud of particles": ck.Particles(np.zeros((4, 2))),
    "a rejection": ck.Rejected("no"),
    "a motion model": ck.DifferentialDrive(),
    "a sensor model": ck.RangeOnly([1.0, 1.0]),
    "a camera": ck.Camera(1.0, 1.0, 0.0, 0.0, 4, 4),
}
NUMBERS: dict[str, Any] = {
    "NaN": np.nan,
    "infinity": np.inf,
    "minus infinity": -np.inf,
    "zero": 0.0,
    "minus one": -1.0,
    "a half": 0.5,
    "huge": 1e308,
    "the smallest number": 5e-324,
    "a huge integer": 10**18,
    "True": True,
    "an empty list": [],
    "an empty array": np.empty((0, 2)),
    "an array of no dimension": np.array(2.0),
    "one number too many axes": np.ones((1, 1, 1, 1)),
}


def variants(value: Any) -> Iterator[tuple[str, Any]]:
    """Arrays that are like a good one, but for one thing."""
    if isinstance(value, (list, tuple)) and value and not isinstance(value[0], (int, float, str)):
        yield "one fewer", value[:-1]
        yield "one more", [*value, value[0]]
        yield "a stranger among them", [*value[:-1], object()]
    if not isinstance(value, np.ndarray):
        return
    for name, number in (("NaN", np.nan), ("infinity", np.inf), ("minus infinity", -np.inf), ("something huge", 1e308),
                         ("something subnormal", 5e-324), ("something negative", -3.0)):  # fmt: skip
        if value.dtype.kind == "f":
            spoilt = value.copy()
            spoilt.flat[-1] = number
            yield f"{name} in the last place", spoilt
            yield f"nothing but {name}", np.full_like(value, number)
    yield "complex", value.astype(complex)
    yield "objects", np.full(value.shape, None, dtype=object)
    yield "texts", value.astype(str)
    yield "booleans", value.astype(bool)
    yield "zeros", np.zeros_like(value)
    yield "masked", np.ma.masked_array(value, mask=np.ones(value.shape, bool))
    yield "one axis more", value[None]
    if value.ndim:
        yield "empty", value[:0]
        yield "one row fewer", value[:-1]
        yield "one column fewer", value[..., :-1]
        yield "one row more", np.concatenate([value, value[:1]])
        yield "one column more", np.concatenate([value, value[..., :1]], axis=-1)
        yield "one entry", value.ravel()[:1]
        yield "lying down", value.T
        yield "backwards", value[::-1]


def clothes(value: Any) -> Iterator[tuple[str, Any]]:
    """The same numbers in another form: the answer has to be the same."""
    if not isinstance(value, np.ndarray):
        return
    padded = np.zeros((*value.shape[:-1], 2 * value.shape[-1]), value.dtype) if value.ndim else value
    if value.ndim:
        padded[..., ::2] = value
        yield "every other one of a larger array", padded[..., ::2]
        yield "a view from behind", value[::-1].copy()[::-1]
    yield "column by column", np.asfortranarray(value)
    frozen = value.copy()
    frozen.flags.writeable = False
    yield "read-only", frozen
    if value.dtype.kind == "f":
        yield "bytes in the other order", value.astype(value.dtype.newbyteorder())
        yield "lists", value.tolist()
        yield "long doubles", value.astype(np.longdouble)
