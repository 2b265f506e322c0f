r"""Tables: equally long columns under names, and their way to CSV and back, to the bit and the type.

A table is a dict of arrays with a row for each entry along their first axis.  CSV has no types, so ``write_csv`` gives
each its own spelling: 7 is an integer, 7.0 a float (the shortest text that reads back to every bit), True a truth
value, and what stands in quotes is text.  Text is quoted where it could be taken for something else.

>>> import tempfile
>>> path = Path(tempfile.mkdtemp(), "table.csv")
>>> write_csv({"id": ["1", "2"], "seen": [True, False], "ticks": [2**62 + 1, -1], "range": [0.1 + 0.2, np.inf]}, path)
>>> print(path.read_text(encoding="utf-8"), end="")
id,seen,ticks,range
"1",True,4611686018427387905,0.30000000000000004
"2",False,-1,inf
>>> {name: column.tolist() for name, column in read_csv(path).items()}["id"]
['1', '2']

A spreadsheet that saves the file drops the quotes, and with them the difference between the text 1 and the number.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coursekit.recordings.rows import lines_of, read_text

Table = dict[str, np.ndarray]

_INTEGER = re.compile(r"[-+]?\d+", re.ASCII)
_FIELD = re.compile(r'(?:"([^"]*(?:""[^"]*)*)"|([^",\r\n][^,\r\n]*|))(,|\r\n|\r|\n|\Z)')


def as_table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Rows to columns, in the order of the first row; a row may name its columns in another order.

    Raises ValueError when a row has other columns than the first, when the entries of a column differ in shape, and
    for what is neither number, truth value nor text.

    >>> as_table([{"id": 1, "range": 2.5}, {"range": 2.0, "id": 4}])
    {'id': array([1, 4]), 'range': array([2.5, 2. ])}
    """
    rows = list(rows)
    for i, row in enumerate(rows):
        if row.keys() != rows[0].keys():
            raise ValueError(f"row {i}: expected the columns {list(rows[0])}, got {list(row)}")
    return {key: plain([row[key] for row in rows], key) for key in (rows[0] if rows else ())}


def plain(values: ArrayLike, name: str) -> np.ndarray:
    """The values as an array of numbers, truth values or text.  Raises ValueError for what would need a pickle."""
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise ValueError(f"{name}: expected rows of one shape, got {error}") from None
    if array.dtype.kind not in "biufU":
        raise ValueError(f"{name}: expected numbers or text, got {array.dtype}, which only a pickle could hold")
    if array.dtype.kind == "U" and not isinstance(values, np.ndarray):  # NumPy makes text of [1, "a"]
        strangers = [v for v in np.asarray(values, dtype=object).ravel() if not isinstance(v, str)]
        if strangers:
            raise ValueError(f"{name}: expected all text or all numbers, got {strangers[0]!r} among text")
    return array


def write_csv(table: Mapping[str, ArrayLike], path: str | Path) -> None:
    """Write a table with a header, in UTF-8, so that ``read_csv`` gives back every bit and the kind of each column.

    Columns are (n,): integers, floats of at most 64 bits, truth values or text.  Raises ValueError for a column that is
    not one value a row (``Recording.save`` holds those), that is too wide, or of unequal length.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "ticks.csv")
    >>> write_csv({"time": [0.0, 0.1], "ticks": [3, 4]}, path)
    >>> path.read_text().splitlines()
    ['time,ticks', '0.0,3', '0.1,4']
    """
    columns = {key: plain(values, key) for key, values in table.items()}
    for key, values in columns.items():
        if values.ndim != 1:
            raise ValueError(f"{key}: a CSV holds one value a row, got shape {values.shape}")
        if values.dtype.kind == "f" and values.dtype.itemsize > 8:
            raise ValueError(f"{key}: expected numbers of at most 64 bits, got {values.dtype}")
    if len({len(values) for values in columns.values()}) != 1:
        raise ValueError(f"expected columns of one length, got { {k: len(v) for k, v in columns.items()} }")
    written = [
        [_spelt(v, v) if isinstance(v, str) else repr(v) for v in column.tolist()] for column in columns.values()
    ]
    lines = [",".join(_spelt(key, "x") for key in columns), *map(",".join, zip(*written, strict=True))]
    Path(path).write_bytes(("\n".join(lines) + "\n").encode())


def _spelt(text: str, mistaken: str) -> str:
    """Text as a field: quoted where it would end early, vanish, or be ``mistaken`` for a number."""
    if re.search(r'[,"\r\n\ufeff]', text) or not text or _kind(mistaken) != "text":
        return '"' + text.replace('"', '""') + '"'
    return text


def read_csv(path: str | Path) -> Table:
    """A CSV file → columns, (n,) each, of the kind that their spelling says: see the head of this module.

    A column is of integers, floats or truth values where every entry is one, and of text elsewhere or where an entry
    stands in quotes.  Lines end with \\n, \\r\\n or \\r; a byte-order mark is not part of the first name.

    Raises ValueError naming file and line for a row of the wrong length, and for an empty file, one that is binary or
    not UTF-8, a quote that is not closed, and a header whose names are not distinct.

    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "ticks.csv")
    >>> _ = path.write_text("time,ticks,seen\\n0,3,True\\n0.1,4,False\\n")
    >>> read_csv(path)
    {'time': array([0. , 0.1]), 'ticks': array([3, 4]), 'seen': array([ True, False])}
    """
    path = Path(path)
    header, *rows = _rows(read_text(path), path)
    names = [text for text, _ in header[1]]
    if len(set(names)) != len(names):
        raise ValueError(f"{path}: expected a header of distinct names in the first line, got {names}")
    for line, row in rows:
        if len(row) != len(names):
            raise ValueError(f"{path}, line {line}: expected {len(names)} values, got {len(row)}")
    return {name: _parsed([row[i] for _, row in rows]) for i, name in enumerate(names)}


def _rows(text: str, path: Path) -> list[tuple[int, list[tuple[str, bool]]]]:
    """The lines that are not blank: their numbers, and for each field its text and whether it stood in quotes."""
    if '"' not in text:  # then a field is what stands between commas, which is quicker
        return [(n, [(field, False) for field in line.split(",")]) for n, line in enumerate(lines_of(text), 1) if line]
    rows, row, place, line, start = [], [], 0, 1, 1
    while place <= len(text):
        found = _FIELD.match(text, place)
        if not found:
            raise ValueError(f"{path}, line {line}: expected a quote that is closed before the next comma")
        quoted, bare, end = found.groups()
        row.append((bare, False) if quoted is None else (quoted.replace('""', '"'), True))
        line += len(re.findall(r"\r\n|\r|\n", found[0]))
        if end != ",":
            if row != [("", False)]:
                rows.append((start, row))
            row, start = [], line
        place = found.end() if end else len(text) + 1
    return rows


def _parsed(column: list[tuple[str, bool]]) -> np.ndarray:
    entries = [text for text, _ in column]
    if any(quoted for _, quoted in column):
        return np.array(entries, dtype=str)
    if entries and all(entry in ("True", "False") for entry in entries):
        return np.array([entry == "True" for entry in entries])
    # Python refuses to read a number of many thousand digits; an integer of 64 bits has 20 at the most, and a sign.
    if entries and all(len(entry) <= 64 and _INTEGER.fullmatch(entry) for entry in entries):
        integers = [int(entry) for entry in entries]
        for kind in (np.int64, np.uint64):
            if np.iinfo(kind).min <= min(integers) and max(integers) <= np.iinfo(kind).max:
                return np.array(integers, dtype=kind)
    try:
        floats = np.array([float(entry) for entry in entries])
    except ValueError:
        return np.array(entries, dtype=str)
    return np.array(entries, dtype=str) if any("_" in entry for entry in entries) else floats


def _kind(entry: str) -> str:
    if entry in ("True", "False"):
        return "truth"
    if _INTEGER.fullmatch(entry):
        return "integer"
    try:
        float(entry)
    except ValueError:
        return "text"
    return "text" if "_" in entry else "float"
