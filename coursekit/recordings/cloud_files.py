"""PLY and PCD: a header that says what follows, and the points as text or as bytes.

Source: Turk (1994), the PLY format; Rusu & Cousins (2011), the PCD format (version 0.7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from coursekit.geometry import Array

PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
PLY_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
PCD_WORDS = {"VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA"}


def chosen(path: Path, fields: Sequence[Any], columns: Sequence[int | str] | None) -> list[Any]:
    """Which of the fields are the coordinates: those asked for, or x, y and perhaps z, or all of two or three."""
    if columns is not None:
        if len(columns) not in (2, 3) or any(name not in fields for name in columns):
            raise ValueError(f"{path}: columns: expected two or three of {list(fields)}, got {list(columns)}")
        return list(columns)
    if all(isinstance(name, int) for name in fields):
        if len(fields) not in (2, 3):
            raise ValueError(
                f"{path}: expected two or three columns, got {len(fields)}; say which by columns=(0, 1, 2)"
            )
        return list(fields)
    plain = {str(name).strip("/\"' ").lower().partition("[")[0].strip("_ "): name for name in reversed(fields)}
    if "x" not in plain or "y" not in plain:
        raise ValueError(f"{path}: expected fields x, y and perhaps z, got {list(fields)}; say which by columns=(…)")
    return [plain[axis] for axis in "xyz" if axis in plain]


def coordinates(path: Path, fields: Mapping[Any, Array], columns: Sequence[int | str] | None) -> Array:
    """The columns that hold the coordinates, as floats (n, 2) or (n, 3)."""
    names = chosen(path, list(fields), columns)
    if any(np.ndim(fields[name]) != 1 or fields[name].dtype.kind not in "fiu" for name in names):
        raise ValueError(f"{path}: expected one real number in each of the fields {names}")
    return np.stack([fields[name].astype(float) for name in names], axis=1)


def _cut_off(path: Path, promised: int, held: int) -> ValueError:
    return ValueError(f"{path}: the file is cut off: its header promises {promised} points, it holds {held}")


# --- PLY --------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Element:
    """A table of a PLY file.  properties : (name, type), or (name, (type of the length, type of an entry)) of lists."""

    name: str
    count: int
    properties: list[tuple[str, Any]]

    @property
    def lists(self) -> bool:
        return any(isinstance(kind, tuple) for _, kind in self.properties)


def read_ply(path: Path, content: bytes, columns: Sequence[int | str] | None) -> Array:
    """The element ``vertex``; what stands before it is skipped, what follows (faces) is not read."""
    head, mark, body = content.partition(b"end_header")
    if not mark:
        raise ValueError(f"{path}: the file is cut off: its header does not end")
    body = body[2:] if body.startswith(b"\r\n") else body[1:]
    order, elements = _ply_header(path, head.decode("ascii", errors="replace").split("\n"))
    if "vertex" not in [e.name for e in elements]:
        raise ValueError(f"{path}: expected an element vertex, got {[e.name for e in elements]}")
    k = [e.name for e in elements].index("vertex")
    vertex, before = elements[k], elements[:k]
    if vertex.lists:
        raise ValueError(f"{path}: a vertex with a list is not read")
    if order == "":
        lines = iter(body.decode("ascii", errors="replace").splitlines())
        rows = [line.split() for line in islice(lines, sum(e.count for e in before), None) if line.strip()]
        table = _numbers(path, rows[: vertex.count], vertex.count, len(vertex.properties))
        return coordinates(path, dict(zip([n for n, _ in vertex.properties], table.T, strict=True)), columns)
    start = 0
    for element in before:
        start += _bytes_of(path, body[start:], element, order)
    kind = np.dtype([(name, order + code) for name, code in vertex.properties])
    held = max(len(body) - start, 0) // kind.itemsize
    if held < vertex.count:
        raise _cut_off(path, vertex.count, held)
    found = np.frombuffer(body, kind, vertex.count, start)
    return coordinates(path, {name: found[name] for name, _ in vertex.properties}, columns)


def _ply_header(path: Path, lines: list[str]) -> tuple[str, list[Element]]:
    order, elements = None, list[Element]()
    try:
        for line in lines[1:]:
            match line.split():
                case ["format", name, "1.0"]:
                    order = PLY_FORMATS[name]
                case ["element", name, count] if int(count) >= 0:
                    elements.append(Element(name, int(count), []))
                case ["property", "list", length, kind, name]:
                    elements[-1].properties.append((name, (PLY_TYPES[length], PLY_TYPES[kind])))
                case ["property", kind, name]:
                    elements[-1].properties.append((name, PLY_TYPES[kind]))
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    raise ValueError
    except (KeyError, IndexError, ValueError):
        raise ValueError(f"{path}: a line of the PLY header cannot be read: {line.strip()!r}") from None
    if order is None:
        raise ValueError(f"{path}: expected one of the formats {', '.join(PLY_FORMATS)} in the PLY header, got none")
    return order, elements


def _bytes_of(path: Path, body: bytes, element: Element, order: str) -> int:
    """How long a binary element is: lists have to be walked through."""
    if not element.lists:
        return element.count * sum(np.dtype(code).itemsize for _, code in element.properties)
    at = 0
    for _ in range(element.count):
        for _, code in element.properties:
            if isinstance(code, tuple):
                size = np.dtype(code[0]).itemsize
                if at + size > len(body):
                    raise ValueError(f"{path}: the file is cut off in its element {element.name}")
                at += size + int(np.frombuffer(body, order + code[0], 1, at)[0]) * np.dtype(code[1]).itemsize
            else:
                at += np.dtype(code).itemsize
    return at


def ply_bytes(points: Array) -> bytes:
    """Points (n, 2) or (n, 3) as a binary PLY file, in doubles."""
    names = "\n".join(f"property double {axis}" for axis in "xyz"[: points.shape[1]])
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{names}\nend_header\n"
    return head.encode() + points.astype("<f8").tobytes()


# --- PCD --------------------------------------------------------------------------------------------------------------
def is_pcd(content: bytes) -> bool:
    """Does it begin like a PCD header, with or without its comment?"""
    return content.lstrip().startswith((b"# .PCD", b"VERSION", b"FIELDS"))


def read_pcd(path: Path, content: bytes, columns: Sequence[int | str] | None) -> Array:
    """The points as they are stored: the viewpoint in the header is not applied."""
    header, start = dict[str, list[str]](), 0
    while "DATA" not in header:
        end = content.find(b"\n", start)
        if end < 0:
            raise ValueError(f"{path}: the file is cut off: its header does not end")
        word, *rest = content[start:end].decode("ascii", errors="replace").split() or ["#"]
        if word in PCD_WORDS:
            header[word] = rest
        elif not word.startswith("#"):
            raise ValueError(f"{path}: a line of the PCD header cannot be read: {content[start:end]!r}")
        start = end + 1
    try:
        names, sizes = header["FIELDS"], [int(size) for size in header["SIZE"]]
        counts = [int(count) for count in header.get("COUNT", ["1"] * len(names))]
        n = int(header["POINTS"][0]) if "POINTS" in header else int(header["WIDTH"][0]) * int(header["HEIGHT"][0])
        codes = [f"<{ {'F': 'f', 'I': 'i', 'U': 'u'}[t] }{s}" for t, s in zip(header["TYPE"], sizes, strict=True)]
        fields = list(zip(names, codes, counts, strict=True))
        data = header["DATA"][0]
        kind = np.dtype([(f"{k}", code, (count,)) for k, (_, code, count) in enumerate(fields)])
    except (KeyError, IndexError, ValueError, TypeError):
        raise ValueError(
            f"{path}: the PCD header is not complete, or its FIELDS, SIZE, TYPE and COUNT differ"
        ) from None
    single = {name: k for k, (name, _, count) in enumerate(fields) if count == 1}
    if data == "ascii":
        rows = [line.split() for line in content[start:].decode("ascii", errors="replace").splitlines() if line.strip()]
        table = _numbers(path, rows[:n], n, sum(counts))
        first = np.cumsum([0, *counts])
        return coordinates(path, {name: table[:, first[k]] for name, k in single.items()}, columns)
    if data != "binary":
        raise ValueError(f"{path}: expected DATA ascii or binary, got {data}; save it again without compression")
    held = (len(content) - start) // kind.itemsize
    if held < n:
        raise _cut_off(path, n, held)
    found = np.frombuffer(content, kind, n, start)
    return coordinates(path, {name: found[f"{k}"][:, 0] for name, k in single.items()}, columns)


def pcd_bytes(points: Array) -> bytes:
    """Points (n, 2) or (n, 3) as a binary PCD file, in doubles."""
    d, n = points.shape[1], len(points)
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7", "FIELDS " + " ".join("xyz"[:d]),
        "SIZE" + " 8" * d, "TYPE" + " F" * d, "COUNT" + " 1" * d, f"WIDTH {n}", "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {n}", "DATA binary",
    ]  # fmt: skip
    return ("\n".join(lines) + "\n").encode() + points.astype("<f8").tobytes()


def _numbers(path: Path, rows: list[list[str]], count: int, width: int) -> Array:
    """Rows of text as numbers (count, width)."""
    if len(rows) < count or (rows and len(rows[-1]) < width):
        raise _cut_off(path, count, len(rows) - (bool(rows) and len(rows[-1]) < width))
    try:
        return np.array(rows, dtype=float).reshape(count, width)
    except ValueError:
        raise ValueError(f"{path}: expected {width} numbers in each of {count} rows of points") from None
