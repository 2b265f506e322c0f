"""Text into rows of finite numbers: what cannot be read is dropped, counted and named."""

from __future__ import annotations

import csv
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from coursekit.doors import LARGEST
from coursekit.geometry import Array

BEYOND = "a bearing beyond a full turn; is it in degrees?"


class BrokenRow(NamedTuple):
    """A row that was not used: its line in the file, counted from 1, and why."""

    line: int
    reason: str


def read_text(path: Path) -> str:
    """The text of a file, without a byte-order mark.

    Raises FileNotFoundError, or ValueError for a file that is empty, binary, or text in another encoding than UTF-8:
    that one is named, since a guess would turn a letter into another one without a word.
    """
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    content = path.read_bytes()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        if encoding := _other_encoding(content):
            raise ValueError(f"{path}: expected text in UTF-8, got {encoding}; save as UTF-8 and read it again")
        raise ValueError(f"{path}: expected a text file, got a binary one")
    if not text.strip():
        raise ValueError(f"{path}: the file is empty: it holds neither a header nor rows")
    return text


def _other_encoding(content: bytes) -> str:
    """The name of the encoding that these bytes are text in, or "" where they are no text."""
    if content.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
        return "UTF-32"
    half = len(content) // 2
    if content.startswith((b"\xff\xfe", b"\xfe\xff")) or (
        half and min(content[0::2].count(0), content[1::2].count(0)) == 0 and content.count(0) > 0.8 * half
    ):
        return "UTF-16"
    if re.search(rb"[\0-\x08\x0e-\x1f\x7f]", content):
        return ""
    return "cp1252 (Windows) or another encoding of one byte a letter"


def lines_of(text: str) -> list[str]:
    r"""The lines of a text, which end with \n, \r\n or \r and with nothing else.

    ``str.splitlines`` also breaks at U+2028, VT, FF and others, which a field may hold.
    """
    return re.split(r"\r\n|\r|\n", text)


def split_fields(line: str, delimiter: str = ",") -> list[str]:
    """The fields of one line, read by itself: a stray quote spoils its own row and no other."""
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except csv.Error:  # a field beyond 128 kB
        return [line]


def to_numbers(entries: Sequence[str]) -> tuple[list[float], str]:
    """The entries as finite numbers and no reason, or whatever came out and the reason to drop it."""
    try:
        row = [float(entry) for entry in entries]
    except ValueError:
        commas = any(re.fullmatch(r"\s*[-+]?\d+,\d+\s*", entry) for entry in entries)
        return [], "a decimal comma where a point belongs" if commas else "text where a number belongs"
    if any("_" in entry for entry in entries):  # Python reads 1_000 as a number; no recorder writes it
        return row, "text where a number belongs"
    if not np.all(np.isfinite(row)):
        return row, "NaN or infinity"
    return row, "" if np.all(np.abs(row) < LARGEST) else f"a number beyond {LARGEST:g}"


def read_table(path: Path, width: int, zeros: bool = True) -> tuple[Array, list[BrokenRow]]:
    """Rows of ``width`` numbers between spaces, # for comments: the usable rows, and the others."""
    lines = enumerate(lines_of(read_text(path)), start=1)
    entries = ((line, text.partition("#")[0].split()) for line, text in lines)
    return usable(path, [(line, row) for line, row in entries if row], width, range(width), zeros)


def usable(
    path: Path, lines: Iterable[tuple[int, list[str]]], width: int, columns: Sequence[int], zeros: bool
) -> tuple[Array, list[BrokenRow]]:
    """The rows of ``width`` entries, as the numbers in some of their columns, and the rows that are none."""
    rows, rejected = [], []
    for line, entries in lines:
        row, reason = to_numbers([entries[i] for i in columns] if len(entries) == width else entries)
        if not reason and len(entries) != width:
            reason = f"a row without exactly {width} numbers"
        if not reason and not zeros and not any(row):
            reason = "a row of zeros"
        if reason:
            rejected.append(BrokenRow(line, reason))
        else:
            rows.append(row)
    if not rows:
        raise ValueError(f"{path}: no usable row; {summary(rejected)}")
    return np.array(rows), rejected


def in_order(stamps: Iterable[float]) -> np.ndarray:
    """Mask of the longest subsequence that never decreases; of two as long, the one that starts earlier."""
    stamps = np.asarray(list(stamps))
    kept = np.ones(len(stamps), dtype=bool)
    if np.all(np.diff(stamps) >= 0):
        return kept
    best: list[float] = []  # from the end: -best[k] is the greatest stamp that k more in order can follow
    followers = np.empty(len(stamps), dtype=int)
    for i in reversed(range(len(stamps))):
        followers[i] = bisect_right(best, -stamps[i])
        best[followers[i] : followers[i] + 1] = [-stamps[i]]
    wanted, floor = len(best) - 1, -np.inf
    for i, stamp in enumerate(stamps):
        kept[i] = followers[i] == wanted and stamp >= floor
        if kept[i]:
            wanted, floor = wanted - 1, stamp
    return kept


def summary(rejected: Sequence[BrokenRow]) -> str:
    """How many rows were dropped, for which reasons, and the first one's line."""
    if not rejected:
        return "it holds no rows"
    reasons = ", ".join(f"{count} × {reason}" for reason, count in Counter(row.reason for row in rejected).items())
    return f"{len(rejected)} rows dropped: {reasons} (the first on line {min(rejected).line})"
