"""Maps of landmarks to and from CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import LARGEST
from coursekit.geometry import Array
from coursekit.recordings.tables import read_csv, write_csv


def write_map(landmarks: Mapping[int, ArrayLike] | ArrayLike, path: str | Path, cov: ArrayLike | None = None) -> None:
    """Write landmarks as CSV with the columns id, x, y, to the bit.

    Parameters
    ----------
    landmarks : id → [x, y], metres; or (n, 2), as ``EkfSlam.landmarks`` has them, whose ids are their rows.
    cov : (n, 2, 2) m², if it is known; three more columns, var_x, cov_xy and var_y.

    Raises ValueError for other shapes, for what is not finite and for no landmark at all.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "map.csv")
    >>> write_map({6: [1.0, 2.5]}, path)
    >>> path.read_text().splitlines()
    ['id,x,y', '6,1.0,2.5']
    """
    named = landmarks if isinstance(landmarks, Mapping) else dict(enumerate(np.asarray(landmarks, dtype=float)))
    places = np.array([np.asarray(place, dtype=float) for place in named.values()])
    if places.ndim != 2 or places.shape[1] != 2 or not np.isfinite(places).all():
        raise ValueError(f"landmarks: expected [x, y] in finite metres for each, got shape {places.shape}")
    table = {"id": np.array([int(key) for key in named]), "x": places[:, 0], "y": places[:, 1]}
    if cov is not None:
        spread = np.asarray(cov, dtype=float)
        if spread.shape != (len(places), 2, 2) or not np.isfinite(spread).all():
            raise ValueError(f"cov: expected finite ({len(places)}, 2, 2), got {spread.shape}")
        table |= {"var_x": spread[:, 0, 0], "cov_xy": spread[:, 0, 1], "var_y": spread[:, 1, 1]}
    write_csv(table, path)


def read_map(path: str | Path) -> dict[int, Array]:
    """Read a map of landmarks: id → [x, y] in metres, (2,), from a CSV with these columns, in any order, and others.

    Raises FileNotFoundError, or ValueError for a file that is no CSV, lacks one of the columns, or has an id that is no
    whole number or comes twice, or a place that is not finite.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "map.csv")
    >>> write_map([[1.0, 2.5], [3.0, 4.0]], path)
    >>> read_map(path)[1]
    array([3., 4.])
    """
    table = read_csv(path)
    if missing := [name for name in ("id", "x", "y") if name not in table]:
        raise ValueError(f"{path}: the header lacks {', '.join(missing)}; it reads {','.join(table)}")
    ids = table["id"]
    if ids.dtype.kind == "U" or not np.all(np.isfinite(ids)) or np.any(np.asarray(ids, dtype=float) % 1 != 0):
        raise ValueError(f"{path}: id: expected whole numbers, got {ids[:3].tolist()} …")
    if len(set(ids.tolist())) != len(ids):
        values, counts = np.unique(ids, return_counts=True)
        raise ValueError(f"{path}: expected each landmark once, {values[counts > 1][0]} comes twice or more")
    if any(table[name].dtype.kind not in "if" or not np.all(np.abs(table[name]) < LARGEST) for name in "xy"):
        raise ValueError(f"{path}: expected x and y in finite metres, got text, NaN or infinity")
    return {int(key): np.array(place, dtype=float) for key, *place in zip(ids, table["x"], table["y"], strict=True)}
