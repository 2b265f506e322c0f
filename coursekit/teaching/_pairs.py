"""Two mistakes at once: a wrong value that no single misconception produces, explained by one of two."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

Array = np.ndarray

# Common slips, on top of the truth or of a misconception: what to say, and what they do to a value.
SLIPS: dict[str, Callable[[Array], Array]] = {
    "Only the sign is wrong: which way round is the difference, or the turn?": np.negative,
    "That is the answer's square; take the root.": np.square,
    "That is the answer's root: one square is missing.": np.sqrt,
    "Your result is upside down: it is one over what was asked for.": np.reciprocal,
    "Those are degrees; the course measures angles in radians.": np.degrees,
    "Your angle went through a conversion from degrees, but it was in radians already.": np.radians,
    "A factor 2 too much: what was counted twice?": lambda a: 2 * a,
    "A factor 2 is lost: yours is one half of it.": lambda a: a / 2,
    "That is one minus the answer: the other side was counted.": lambda a: 1 - a,
    "Those are the tangents of the angles; one arc tangent is missing.": np.tan,
    "Rows and columns are exchanged: transpose it.": np.transpose,
    "The numbers are right, but they stand in reverse order.": lambda a: a[::-1] if a.ndim else a,
}


def two_mistakes(got: Array, expected: Array, wrong: Mapping[str, Array], tolerance: float = 1e-6) -> str | None:
    """The hint that explains ``got``, or None.

    Two mistakes meet in separate entries of an array, in separate terms of a sum, or in separate factors of a
    product; or the second is a slip (SLIPS) made on the whole value.  The hint is that of the first misconception in
    the order of ``wrong``, so the one that is easiest to see should stand first.

    expected : the truth, and ``wrong`` : hint → the value of one misconception, any shape.
    """
    with np.errstate(all="ignore"):
        for said, slip in SLIPS.items():
            if near(got, slip(expected), tolerance):
                return said
        shaped = {hint: value for hint, value in wrong.items() if value.shape == got.shape == expected.shape}
        for hint, one in shaped.items():
            if any(_both(got, expected, one, other, tolerance) for said, other in shaped.items() if said != hint):
                return f"{hint} There is a second mistake, too."
        for hint, one in wrong.items():
            if any(near(got, slip(one), tolerance) for slip in SLIPS.values()):
                return f"{hint} There is a second mistake, too."
        for hint, one in shaped.items():
            if _in_some_entries(got, expected, one, tolerance):
                return f"{hint} There is a second mistake, too."
    return None


def near(a: Array, b: Array, tolerance: float) -> bool:
    """Equal shapes, and equal values but for rounding; NaN equals NaN."""
    return a.shape == b.shape and bool(alike(a, b, tolerance).all())


def alike(a: Array, b: Array, tolerance: float) -> Array:
    """Entry by entry.  np.isclose does the same and takes ten times as long, and pairs of hints are many."""
    with np.errstate(all="ignore"):
        close = np.abs(a - b) <= tolerance * (1 + np.abs(b))
    return (close & np.isfinite(b)) | (a == b) | (np.isnan(a) & np.isnan(b))


def _both(got: Array, expected: Array, one: Array, other: Array, tolerance: float) -> bool:
    """In separate entries, terms or factors."""
    entries = np.where(alike(one, expected, tolerance), other, one)
    product = np.where(expected == 0, one + other, one * other / expected)
    return any(near(got, both, tolerance) for both in (entries, one + other - expected, product))


def _in_some_entries(got: Array, expected: Array, one: Array, tolerance: float) -> bool:
    """Wrong in the way of this misconception wherever it differs from the truth.  The rest may be wrong in any way.

    Whole numbers are left out, because these agree by chance.
    """
    differs = ~alike(one, expected, tolerance)
    values = one[differs]
    return bool(
        differs.any()
        and not differs.all()
        and np.all(np.isfinite(values) & (values != np.round(values)))
        and near(got[differs], values, tolerance)
    )
