"""Arenas: what stands where, read from a TOML file.

An arena is plain data, frozen: walls and cylinders that stay, crates that can be pushed, tags that a camera can
read, and the pose the robot starts from.  Lengths are metres, angles radians, masses kilograms.

>>> from dataclasses import replace
>>> arena = Arena("yard", cylinders=(Cylinder((3, 0), colour="cyan"),))
>>> replace(arena, start=(1, 0, 0)).start
(1.0, 0.0, 0.0)
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

COLOURS = ("red", "green", "blue", "cyan", "magenta", "yellow")
"""What a landmark in an arena's file may be painted with."""

Point = tuple[float, float]
Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder on the floor: the landmark of labs 1 to 4.  ``position`` is that of its axis."""

    position: Point
    radius: float = 0.1
    height: float = 0.5
    colour: str = "cyan"

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self, position: ArrayLike, radius: float = 0.1, height: float = 0.5, colour: str = "cyan"
        ) -> None: ...

    def __post_init__(self) -> None:
        _keep(self, position=_numbers(self.position, "position", "[x, y]", 2))
        _keep(self, radius=_positive(self.radius, "radius"), height=_positive(self.height, "height"))
        if not isinstance(self.colour, str) or not self.colour:
            raise ValueError(f"colour: expected a name, got {self.colour!r}")


@dataclass(frozen=True)
class Wall:
    """A straight wall without thickness, seen and touched from both sides."""

    start: Point
    end: Point

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, start: ArrayLike, end: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        _keep(self, start=_numbers(self.start, "start", "[x, y]", 2), end=_numbers(self.end, "end", "[x, y]", 2))
        if self.start == self.end:
            raise ValueError(f"end: expected a point other than the start, got {list(self.end)} for both")


@dataclass(frozen=True)
class Crate:
    """A box that a robot can push.  ``pose`` [x, y, θ] of its centre, ``size`` [length, width]: along its x, its y."""

    pose: Pose
    size: Point = (0.4, 0.4)
    mass: float = 1.0

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(self, pose: ArrayLike, size: ArrayLike = (0.4, 0.4), mass: float = 1.0) -> None: ...

    def __post_init__(self) -> None:
        _keep(self, pose=_numbers(self.pose, "pose", "[x, y, θ]", 3), mass=_positive(self.mass, "mass"))
        size = _numbers(self.size, "size", "[length, width]", 2)
        if min(size) <= 0:
            raise ValueError(f"size: expected two lengths > 0, got {list(size)}")
        _keep(self, size=size)

    @property
    def corners(self) -> np.ndarray:
        """The four corners in the crate's frame, counter-clockwise, (4, 2)."""
        return 0.5 * np.array(self.size) * [[1, 1], [-1, 1], [-1, -1], [1, -1]]


@dataclass(frozen=True)
class Tag:
    """A square AprilTag (family 36h11) that stands upright and can be seen from one side.

    ``yaw`` is the direction its face looks to, ``size`` the side of its black border, ``height`` that of its
    centre above the floor.  A sheet of paper: neither wheels nor lidar notice it.
    """

    id: int
    position: Point
    yaw: float
    size: float = 0.16
    height: float = 0.25

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self, id: int, position: ArrayLike, yaw: float, size: float = 0.16, height: float = 0.25
        ) -> None: ...

    def __post_init__(self) -> None:
        if isinstance(self.id, bool) or not isinstance(self.id, (int, np.integer)) or not 0 <= self.id <= 586:
            raise ValueError(f"id: expected a whole number from 0 to 586, got {self.id!r}")
        _keep(self, id=int(self.id), position=_numbers(self.position, "position", "[x, y]", 2))
        _keep(self, yaw=_number(self.yaw, "yaw"), size=_positive(self.size, "size"))
        _keep(self, height=_positive(self.height, "height"))


@dataclass(frozen=True)
class Arena:
    """Everything that stands somewhere, and where the robot starts, [x, y, θ].

    Raises ValueError for two tags with one id.
    """

    name: str
    walls: tuple[Wall, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()
    crates: tuple[Crate, ...] = ()
    tags: tuple[Tag, ...] = ()
    start: Pose = (0.0, 0.0, 0.0)

    if TYPE_CHECKING:  # what may be given, where the fields say what stands there afterwards

        def __init__(
            self,
            name: str,
            walls: Iterable[Wall] = (),
            cylinders: Iterable[Cylinder] = (),
            crates: Iterable[Crate] = (),
            tags: Iterable[Tag] = (),
            start: ArrayLike = (0.0, 0.0, 0.0),
        ) -> None: ...

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ValueError(f"name: expected a name, got {self.name!r}")
        _keep(self, start=_numbers(self.start, "start", "[x, y, θ]", 3))
        for things, kind in _THINGS.items():
            _keep(self, **{things: tuple(getattr(self, things))})
            for thing in getattr(self, things):
                if not isinstance(thing, kind):
                    raise ValueError(f"{things}: expected {kind.__name__}s, got {thing!r}")
        ids = [tag.id for tag in self.tags]
        if doubles := sorted({i for i in ids if ids.count(i) > 1}):
            raise ValueError(f"tags: expected each id once, got twice or more: {doubles}")

    @classmethod
    def load(cls, source: str | Path) -> Arena:
        """Read an arena: by its name in ``data/arenas``, or from a path that ends in ``.toml``.

        The file holds ``name``, ``start`` and the tables ``[[walls]]``, ``[[cylinders]]``, ``[[crates]]``,
        ``[[tags]]``, whose keys are the fields of the classes above.  An unknown key is an error: it is
        most often a known one, misspelt.

        A byte-order mark, which some editors write, is skipped.

        Raises FileNotFoundError when there is no such file, ValueError that names file, key, what was
        expected and what stood there otherwise.
        """
        path = Path(source)
        if path.suffix.lower() != ".toml":
            from coursekit.recordings.datasets import project_file

            folder = project_file("arenas")
            path = folder / f"{source}.toml"
            if not path.is_file():
                known = ", ".join(sorted(p.stem for p in folder.glob("*.toml")))
                raise FileNotFoundError(f"no arena {str(source)!r}; there are {known}, or give a path ending in .toml")
        try:
            return _arena(tomllib.loads(path.read_text(encoding="utf-8-sig")))
        except UnicodeDecodeError:
            raise ValueError(f"{path}: expected text in UTF-8; save the file as UTF-8") from None
        except ValueError as error:  # TOML's own errors are ValueErrors too; they name line and column
            raise ValueError(f"{path}: {error}") from None

    def save(self, path: str | Path) -> None:
        """Write the arena to a file that ``load`` reads back as an equal one, number by number.

        Parameters
        ----------
        path : ends in ``.toml``, as ``load`` expects it; an existing file is overwritten.

        Raises ValueError for another ending, for a cylinder whose colour no file may have, and for a name that UTF-8
        cannot hold.

        >>> from tempfile import TemporaryDirectory
        >>> yard = Arena("yard", cylinders=(Cylinder((3, 0.1), colour="red"),), start=(1, 0, 0.1))
        >>> with TemporaryDirectory() as folder:
        ...     yard.save(Path(folder) / "yard.toml")
        ...     Arena.load(Path(folder) / "yard.toml") == yard
        True
        """
        path = Path(path)
        if path.suffix.lower() != ".toml":
            raise ValueError(f"path: expected one that ends in .toml, got {str(path)!r}")
        for i, cylinder in enumerate(self.cylinders):
            _check_colour(cylinder.colour, f"cylinders[{i}].")
        lines = [f"name = {_toml(self.name)}", f"start = {_toml(self.start)}  # x [m], y [m], θ [rad]"]
        for things in _THINGS:
            for thing in getattr(self, things):
                lines += ["", f"[[{things}]]", *(f"{f.name} = {_toml(getattr(thing, f.name))}" for f in fields(thing))]
        try:
            text = ("\n".join(lines) + "\n").encode()
        except UnicodeEncodeError:
            raise ValueError(f"name: expected text that UTF-8 can hold, got {self.name!r}") from None
        path.write_bytes(text)


_THINGS: Mapping[str, type] = {"walls": Wall, "cylinders": Cylinder, "crates": Crate, "tags": Tag}


def _arena(table: Mapping[str, Any]) -> Arena:
    values = dict(table)
    for things, kind in _THINGS.items():
        rows = values.get(things, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise ValueError(f"{things}: expected tables headed [[{things}]], got {rows!r}")
        values[things] = tuple(_build(kind, row, f"{things}[{i}].") for i, row in enumerate(rows))
    arena: Arena = _build(Arena, values, "")
    return arena


def _build(kind: type, row: Mapping[str, Any], where: str) -> Any:
    """``kind(**row)``, where whatever is wrong is told with its place in the file."""
    known = [f.name for f in fields(kind)]
    for key in row:
        if key not in known:
            raise ValueError(f"{where}{key}: unknown key; expected one of {', '.join(known)}")
    for f in fields(kind):
        if f.default is MISSING and f.name not in row:
            raise ValueError(f"{where}{f.name}: expected a value, got none")
    _check_colour(row.get("colour", COLOURS[0]), where)
    try:
        return kind(**row)
    except ValueError as error:
        raise ValueError(f"{where}{error}") from None


def _check_colour(colour: Any, where: str) -> None:
    if colour not in COLOURS:
        raise ValueError(f"{where}colour: expected one of {', '.join(COLOURS)}, got {colour!r}")


def _toml(value: Any) -> str:
    """A text, a number or a tuple of numbers as TOML writes it.  Its strings escape what JSON's do, and DEL."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return f"[{', '.join(map(_toml, value))}]" if isinstance(value, tuple) else repr(value)


def _keep(thing: Any, **values: Any) -> None:
    """Set fields of a frozen dataclass while it is being made."""
    for name, value in values.items():
        object.__setattr__(thing, name, value)


def _number(value: Any, name: str) -> float:
    try:
        number = np.nan if isinstance(value, (bool, str)) or np.ndim(value) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not np.isfinite(number):
        raise ValueError(f"{name}: expected a finite number, got {value!r}")
    return number


def _positive(value: Any, name: str) -> float:
    if not (number := _number(value, name)) > 0:
        raise ValueError(f"{name}: expected a number > 0, got {value!r}")
    return number


def _numbers(value: Any, name: str, what: str, count: int) -> Any:
    """A tuple of ``count`` floats, so that the dataclass that holds it compares and hashes by value."""
    try:
        if isinstance(value, str) or len(value) != count:
            raise TypeError
        return tuple(_number(v, name) for v in value)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected {what}, {count} finite numbers, got {value!r}") from None
