r"""Clouds of points, from and to files: columns of text, PLY, PCD and NumPy's own format.

The format is told by the first bytes, not by the name.  A file that ends early is an error that says how much is
missing; a point without finite coordinates is dropped and counted, and so is one at the origin, which is how drivers
write "nothing there".  Nothing is unpickled.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.geometry import Array
from coursekit.recordings.cloud_files import chosen, coordinates, is_pcd, pcd_bytes, ply_bytes, read_pcd, read_ply
from coursekit.recordings.rows import BrokenRow, lines_of, read_text, summary, to_numbers, usable

WRITERS = {".ply": ply_bytes, ".pcd": pcd_bytes}


class Clouds(NamedTuple):
    """Two clouds to be registered, (n, 3) and (m, 3), metres."""

    source: Array
    target: Array


def read_cloud(path: str | Path, *, columns: Sequence[int | str] | None = None, zeros: bool = False) -> Array:
    r"""Points from a file → (n, 3), or (n, 2) where it holds x and y alone; metres, as the file has them.

    Read are text with two or three columns (spaces, commas, semicolons or tabs between them; # for comments; columns
    are found by the names x, y, z where there is a header), PLY (text, binary of either byte order), PCD (text, binary)
    and NPY.  Faces, colours and other fields are left alone.

    Parameters
    ----------
    path : of the file.
    columns : two or three numbers of columns, from 0, or names of fields, where there are more or other ones.
    zeros : keep points at the origin; otherwise they are dropped, as what a sensor writes for "nothing there".

    Broken rows, NaN and infinity are dropped.  One warning counts what was dropped.  Raises FileNotFoundError, or
    ValueError for a file that is none of these, is cut off, or has no usable point; a compressed PCD is refused.

    Source: Turk (1994), the PLY format; Rusu & Cousins (2011), the PCD format.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "cloud.csv")
    ...     _ = path.write_text("time,x,y\n0.1,1,2\n0.2,4,5\n")
    ...     read_cloud(path)
    array([[1., 2.],
           [4., 5.]])
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    content = path.read_bytes()
    if content.startswith((b"ply\n", b"ply\r")):
        points = read_ply(path, content, columns)
    elif is_pcd(content):
        points = read_pcd(path, content, columns)
    elif content.startswith(b"\x93NUMPY"):
        points = _read_npy(path, columns)
    else:
        points, rejected = _read_text(path, columns, zeros)
        if rejected:
            warnings.warn(f"{path}: {summary(rejected)}", stacklevel=2)
        return points
    finite = np.isfinite(points).all(axis=1)
    away = points.any(axis=1) | zeros
    if not np.all(finite & away):
        counts = f"{np.count_nonzero(~finite)} × NaN or infinity, {np.count_nonzero(~away)} × at the origin"
        if not np.any(finite & away):
            raise ValueError(f"{path}: no usable point of {len(points)}: {counts}")
        warnings.warn(f"{path}: {np.count_nonzero(~(finite & away))} points dropped: {counts}", stacklevel=2)
    return np.ascontiguousarray(points[finite & away])


def write_cloud(path: str | Path, points: ArrayLike) -> None:
    """Points (n, 2) or (n, 3), metres, to a file whose name ends in .ply, .pcd (both binary) or .npy; to the bit.

    ``read_cloud(path, zeros=True)`` reads the same array.  Points in the plane have no field z: some other programs
    want three columns.  An existing file is replaced.  Raises ValueError for another ending, another shape, no points,
    and coordinates that are not finite; TypeError for what is no array of numbers.

    Source: Turk (1994), the PLY format; Rusu & Cousins (2011), the PCD format.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_cloud(Path(folder, "cloud.ply"), [[1, 2, 3], [4, 5, 6]])
    ...     read_cloud(Path(folder, "cloud.ply")).shape
    (2, 3)
    """
    path, points = Path(path), np.ascontiguousarray(as_numbers(points, "points"))
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not len(points):
        raise ValueError(f"points: expected one or more of shape (n, 2) or (n, 3), got {points.shape}")
    if not np.all(np.isfinite(points)):
        raise ValueError("points: expected finite coordinates; leave out what was not seen")
    if path.suffix.lower() == ".npy":
        with path.open("wb") as file:
            np.save(file, points, allow_pickle=False)
    elif path.suffix.lower() in WRITERS:
        path.write_bytes(WRITERS[path.suffix.lower()](points))
    else:
        raise ValueError(f"path: expected a name that ends in .ply, .pcd or .npy, got {path.name!r}")


def _read_npy(path: Path, columns: Sequence[int | str] | None) -> Array:
    try:
        table = np.load(path, allow_pickle=False)
    except (ValueError, EOFError, OSError) as why:
        raise ValueError(f"{path}: no array of numbers can be read from it: {why}") from None
    if table.dtype.names:
        return coordinates(path, {name: table[name].ravel() for name in table.dtype.names}, columns)
    if table.ndim != 2 or table.dtype.kind not in "fiu":
        raise ValueError(f"{path}: expected an array of shape (n, 2) or (n, 3), got {table.dtype} of {table.shape}")
    return coordinates(path, dict(enumerate(table.T)), columns)


def _read_text(path: Path, columns: Sequence[int | str] | None, zeros: bool) -> tuple[Array, list[BrokenRow]]:
    """A row a point: which columns hold x, y and z, from the header or from how many there are."""
    lines = [(k, _entries(text)) for k, text in enumerate(lines_of(read_text(path)), start=1)]
    lines = [(k, entries) for k, entries in lines if entries]
    names: list[int | str] = []
    if lines and not any(_is_number(entry) for entry in lines[0][1]):
        names = [*lines.pop(0)[1]]
    widths = Counter(len(entries) for _, entries in lines if to_numbers(entries)[1] == "" or names)
    width = len(names) or (widths.most_common(1)[0][0] if widths else 3)
    fields = names or list(range(width))
    at = [fields.index(name) for name in chosen(path, fields, columns)] if len(widths) else [0, 1, 2]
    return usable(path, lines, width, at, zeros)


def _entries(text: str) -> list[str]:
    text = re.sub(r"\s*[\[(][^\])]*[\])]", "", text.partition("#")[0]).strip()  # without units: x [m]
    return re.split(r"\s*[,;]\s*|\s+", text) if text else []


def _is_number(entry: str) -> bool:
    return to_numbers([entry])[1] != "text where a number belongs"
