r"""Which column is which: the names of a header, matched by what they mean.

People who write the same log name its columns ``measured_d``, ``d_meas``, ``meas_d`` or ``Range (m)``.  A name is cut
into words; one word says the quantity, another whether it was measured, is true or is the error, and a unit at the
end says how to bring it to metres, radians and seconds.

>>> match(["timestamp", "d_meas", "theta_meas [deg]", "d_true"])["measured_theta"]
Column(place=2, scale=0.017453292519943295)
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping, Sequence
from typing import NamedTuple

_QUANTITIES = {
    "d": "d dist distance range r rho ranges",
    "theta": "theta bearing angle phi alpha θ φ",
    "stamp": "stamp timestamp time t unix clock",
    "color": "color colour",
}
_ROLES = {
    "measured": "measured meas measurement measure m z obs observed est estimated estimate sensor detected det",
    "true": "true truth gt groundtruth ground actual real ref reference expected",
    "err": "err error errors e diff difference residual",
}
_UNITS = {
    "m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "cm": 0.01, "mm": 1e-3,
    "rad": 1.0, "radian": 1.0, "radians": 1.0, "deg": math.pi / 180, "degree": math.pi / 180,
    "degrees": math.pi / 180, "°": math.pi / 180,
    "s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
    "nsec": 1e-9, "nanosec": 1e-9, "nanoseconds": 1e-9, "m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1 / 3.6,
    "rad/s": 1.0, "deg/s": math.pi / 180, "°/s": math.pi / 180,
}  # fmt: skip
_WORDS = {
    word: meaning for table in (_QUANTITIES, _ROLES) for meaning, words in table.items() for word in words.split()
}


_BESIDE = {"landmark", "tag", "marker", "camera", "cylinder", "to"}  # what a range may be to, and who saw it


class Column(NamedTuple):
    """Where a column stands in a row, and what its numbers are multiplied by to be in SI units."""

    place: int
    scale: float


def match(header: Sequence[str], skip: Container[str] = ()) -> dict[str, Column]:
    """The columns of a log of range and bearing, by their meaning: measured_d, err_theta, stamp, …

    A name that is one of these meanings as it stands goes before those that only mean it; the meanings in ``skip`` are
    not looked for.  Raises ValueError when two columns mean the same, since nobody knows which to believe; two errors
    are left out instead, since most logs do not need one.
    """
    found: dict[str, list[int]] = {}
    for index, name in enumerate(header):
        for meaning in [name] if name in _EXACT else _meaning(name):
            if meaning not in skip:
                found.setdefault(meaning, []).append(index)
    for meaning, places in found.items():
        found[meaning] = [index for index in places if header[index] == meaning] or places
        if len(names := [header[index] for index in found[meaning]]) > 1 and not meaning.startswith("err"):
            which = f"{names[0]} twice or more" if len(set(names)) == 1 else ", ".join(names)
            raise ValueError(f"{meaning}: expected one column for it, the header names {which}; say which by columns=")
    return {meaning: Column(at[0], unit(header[at[0]])) for meaning, at in found.items() if len(at) == 1}


_EXACT = {"stamp", "color", *(f"{role}_{quantity}" for role in _ROLES for quantity in ("d", "theta"))}


def chosen(header: Sequence[str], columns: Mapping[str, str], meanings: Sequence[str]) -> dict[str, Column]:
    """The columns that somebody mapped by hand: meaning → the name in the header.

    Raises ValueError for a meaning that is none of ``meanings`` and for a name that the header lacks or has twice.
    """
    if strange := [key for key in columns if key not in meanings]:
        raise ValueError(f"columns: expected keys among {', '.join(meanings)}, got {', '.join(map(repr, strange))}")
    for meaning, name in columns.items():
        if list(header).count(name) != 1:
            which = "lacks it" if name not in header else "has it twice"
            raise ValueError(f"columns: {name!r} is to be {meaning}, but the header {which}: {','.join(header)}")
    return {meaning: Column(list(header).index(name), unit(name)) for meaning, name in columns.items()}


def unit(name: str) -> float:
    """What a column's unit, the last word of its name, is worth in metres, radians or seconds; 1 where it names none.

    >>> unit("range_cm"), unit("bearing [deg]").__round__(4), unit("d_m"), unit("range")
    (0.01, 0.0175, 1.0, 1.0)
    """
    last = re.split(r"[\s_\[\](){}]+", name.strip().rstrip("])}").lower())[-1]
    return _UNITS.get(last, 1.0)


def words(name: str) -> list[str]:
    """The words of a column's name in lower case, without its unit.

    >>> words("trueRange [m]"), words("theta_meas"), words("unix_time")
    (['true', 'range'], ['theta', 'meas'], ['unix', 'time'])
    """
    name = re.sub(r"[\[({].*?[\])}]", " ", name)
    name = re.sub(r"([a-z])([A-Z])", r"\1_\2", name).lower()
    parts = [part for part in re.split(r"[^a-zθφ]+", name) if part]
    return parts[:-1] if len(parts) > 1 and parts[-1] in _UNITS else parts


def _meaning(name: str) -> list[str]:
    """What a name means, in a list; an empty one where it means nothing that is known, or more than one thing."""
    parts = [part for part in words(name) if part not in _BESIDE]
    meanings = [_WORDS[part] for part in parts if part in _WORDS]
    if "t" in parts and {"d", "theta"} & set(meanings):  # d_t is no time
        meanings = ["true" if part == "t" else _WORDS[part] for part in parts if part in _WORDS]
    quantities = [m for m in dict.fromkeys(meanings) if m in _QUANTITIES]
    roles = [m for m in dict.fromkeys(meanings) if m in _ROLES]
    if quantities == ["stamp"] and len(parts) <= 2:
        return ["stamp"]
    if quantities == ["color"]:
        return ["color"]
    if "err" in roles:  # an "error of the measured range" is an error
        roles = ["err"]
    if len(quantities) != 1 or quantities[0] not in ("d", "theta"):
        return []
    if not roles and len(parts) == 1:
        roles = ["measured"]  # a bare "range" is what the sensor said
    return [f"{roles[0]}_{quantities[0]}"] if len(roles) == 1 else []
