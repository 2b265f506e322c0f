"""Where recordings live: in the project's data folder, in a folder of yours, in a cache, or at their public origin.

>>> log = load("landmark_log")              # the world's own log, in the project
>>> clouds = load("icp_clouds")             # doctest: +SKIP
>>> clouds.source.shape                     # doctest: +SKIP
(5750, 3)

Recordings that other people made are not part of the project: some state no licence.  ``load`` looks for them in
the project's data folder and in the one that ``$COURSEKIT_DATA`` names (both laid out as in ``data/README.md``), then
in a cache, then fetches them from the commit they are known by.  What is cached or fetched must match its hash; a
folder is believed, so you can put another log of the same kind in the same place.  A file is fetched under another name
and gets its own when it is whole, so a download that breaks off leaves nothing behind that could be taken for it.

``list()`` is a table of what there is, ``about(name)`` says whose it is and what to cite.
"""

from __future__ import annotations

import builtins
import os
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from coursekit.recordings import Clouds, Log, Mrclam, read_cloud, read_landmark_log, read_mrclam
from coursekit.recordings.fetching import NotFetched, Origin

__all__ = ["Clouds", "DatasetUnavailable", "Log", "Mrclam", "about", "list", "load", "locate", "project_file",
           "read_cloud", "read_landmark_log", "read_mrclam"]  # fmt: skip


class DatasetUnavailable(RuntimeError):
    """A recording is neither in a folder nor in the cache, and could not be fetched."""


# Local folder → origin.  data/README.md says what each is.
ORIGINS = {
    "landmark_log": Origin(
        "jaiselsingh1/prob_rob_labs_ros_2_group18",
        "b0d0649cafa4fd8c34a87d1c96fc02ff99b34521",
        "pictures",
        {"landmark_data_cyan.csv": "cbe61d296ba03221a4fbf7a34ef66c139b84ac8cbbc75f3fb3c923404e3741c5"},
        249_556,
        citation="jaiselsingh1 and others: prob_rob_labs_ros_2_group18. GitHub, 2025",
    ),
    "icp_clouds": Origin(
        "zhexin1904/EECE5550",
        "4583587bdd21c73b5278b112e5ca05ea7b62e896",
        "HW2/ICP/data",
        {
            "pclX.txt": "ef3db2510f3581fe3c9f2be0083b34ccafcda3a257baaf21f94da236bd807629",
            "pclY.txt": "07eb04b55031e4ff524647ae3c26d2bd6655f193545e334a5b32d347af52d6fc",
        },
        464_402,
        citation="zhexin1904: EECE5550, homework of a course on mobile robotics. GitHub, 2023",
    ),
    "mrclam7_robot1": Origin(
        "ericguerrero/MUSI-lab-session-1",
        "bdd68804c10fd1016da19913a8036d1d74cc812a",
        "data/MRCLAM_Dataset7",
        {
            "Barcodes.dat": "4b4f4d9e65c452f58a6df2e02f25b5aced4300bd32cfbdb0acd8439692f09683",
            "Landmark_Groundtruth.dat": "eb401c2c97f8bcf827dd3c0695b4c8a71c495a217b0aa6f5465fe84bfda71345",
            "Robot1_Groundtruth.dat": "bc03c2f7ff2735a013fd7e7538de3e3b015f216d1074dc5c27747efdf6409371",
            "Robot1_Measurement.dat": "83620487d6116c46d1695f7efa7bacf2c9998d700fe291a14cd34c090d082018",
            "Robot1_Odometry.dat": "3f91fa6b20e11fe294b637e638569d8b593972f4ae86c434951638ad595a5e38",
        },
        5_273_641,
        "educational use only",
        citation="K. Y. K. Leung, Y. Halpern, T. D. Barfoot, H. H. T. Liu: The UTIAS multi-robot cooperative "
        "localization and mapping dataset. International Journal of Robotics Research 30(8), 969-974, 2011",
    ),
}


class _Dataset(NamedTuple):
    what: str
    read: Callable[[], Any]
    folder: str = ""  # of ORIGINS; "" for the project's own
    file: str = ""  # below the project's data folder


def load(name: str) -> Any:
    """A recording by name.

    ==================  ==================================================================================
    landmark_log        the world's own drive around a cylinder → ``Log``; part of the project
    landmark_log_real   the same kind of drive, recorded by others in Gazebo → ``Log``
    icp_clouds          two clouds of 5750 points, ``source`` = pclX and ``target`` = pclY → ``Clouds``
    mrclam7_robot1      15 minutes of a real robot among 15 landmarks, with Vicon truth → ``Mrclam``
    ==================  ==================================================================================

    What has to be fetched shows a progress bar.  Raises ValueError for a name that is none of these,
    DatasetUnavailable when the recording is not here and cannot be fetched, FileNotFoundError when the project's own
    data folder is missing.

    >>> load("landmark_log")
    Log(1842 samples, 1.26 to 22.09 m, 0 rows dropped)
    """
    return _named(name).read()


class Listing(builtins.list[str]):
    """Names of data sets that show themselves as a table: name, what it is, size, licence, and where it was found."""

    @property
    def rows(self) -> builtins.list[tuple[str, str, str, str, str]]:
        """The table's rows, without its head."""
        rows = []
        for name in self:
            data = _DATASETS[name]
            origin = ORIGINS.get(data.folder)
            own = _project_data() / data.file
            size = origin.size if origin else own.stat().st_size if own.is_file() else 0
            licence = origin.licence if origin else "BSD-3-Clause, the project's"
            rows.append((name, data.what, f"{size / 1e6:.1f} MB", licence, _found(data)))
        return rows

    def __repr__(self) -> str:
        table = [_HEAD, *self.rows]
        widths = [max(len(row[i]) for row in table) for i in range(len(_HEAD))]
        return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths)).rstrip() for row in table)

    def _repr_html_(self) -> str:
        def line(row: tuple[str, ...], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in row) + "</tr>"

        return f"<table>{line(_HEAD, 'th')}{''.join(line(row, 'td') for row in self.rows)}</table>"


_HEAD = ("name", "what it is", "size", "licence", "found")


def list() -> Listing:
    """The names that ``load`` knows, in alphabetical order; shown, they are a table of what, size, licence and where.

    Raises nothing: files are looked for and not opened, and nothing is fetched.

    >>> [*list()]
    ['icp_clouds', 'landmark_log', 'landmark_log_real', 'mrclam7_robot1']
    >>> print(list())                                                                       # doctest: +SKIP
    name               what it is                                        size    licence      found
    icp_clouds         two clouds of 5750 points, one moved              0.5 MB  none stated  in the cache
    """
    return Listing(sorted(_DATASETS))


def about(name: str) -> str:
    """What a data set is, whose it is, its licence and what to cite; ``name`` is one of ``list()``.

    Raises ValueError for a name that is none of these.

    >>> print(about("landmark_log"))
    landmark_log: 1842 samples of range and bearing to one cylinder, from the world.
    Licence: BSD-3-Clause, the project's.  Found: in the project.
    """
    (_, what, _, licence, found), data = Listing([_named(name) and name]).rows[0], _DATASETS[name]
    lines = [f"{name}: {what}.", f"Licence: {licence}.  Found: {found}."]
    if origin := ORIGINS.get(data.folder):
        lines.append(f"Origin: https://github.com/{origin.repository} @ {origin.commit}, {origin.folder}.")
        lines.append(f"Cite: {origin.citation}.")
    return "\n".join(lines)


def project_file(relative: str) -> Path:
    """A file of the project's ``data`` folder, as in ``project_file("arenas/lab.toml")``.

    Raises FileNotFoundError for a file that is not there.
    """
    if not (path := _project_data() / relative).exists():
        raise FileNotFoundError(f"{path}: there is no such file in the project's data")
    return path


def locate(folder: str) -> Path:
    """The folder with the files of an origin ("landmark_log", "icp_clouds", "mrclam7_robot1"), fetched if need be.

    Raises DatasetUnavailable naming the file, the places that were searched and what to do.
    """
    if folder not in ORIGINS:
        raise ValueError(f"no folder named {folder!r}; there are: {', '.join(ORIGINS)}")
    origin, searched = ORIGINS[folder], []
    for place, root in _folders().items():
        missing = [name for name in origin.sha256 if not (root / folder / name).is_file()]
        if not missing:
            return root / folder
        if place != _PROJECT:
            searched.append(f"{place}, which has no {folder}/{missing[0]}")
    if _YOURS not in _folders():
        searched.append(f"{_YOURS}, which is not set")
    cache = _cache() / folder
    for name in origin.sha256:
        try:
            origin.fetch(name, cache)
        except NotFetched as error:
            searched += [f"the cache {cache}", f"{origin.url}{name} ({error})"]
            raise DatasetUnavailable(
                f"{folder}/{name} is not here and could not be fetched.  Looked in: {'; '.join(searched)}.  To get it, "
                f"connect to the network once, or put the file at {folder}/{name} in a folder of yours and set "
                f"COURSEKIT_DATA to that folder.  Nothing was left half-written."
            ) from error
    return cache


_PROJECT, _YOURS = "in the project", "$COURSEKIT_DATA"


def _folders() -> dict[str, Path]:
    """The folders that are believed, by what they are called."""
    folders = {_PROJECT: _project_data()}
    if root := os.environ.get("COURSEKIT_DATA"):
        folders[_YOURS] = Path(root).expanduser()
    return folders


def _project_data() -> Path:
    """The project's own data: beside the package in a checkout, inside the package where a wheel was installed."""
    inside = Path(__file__).resolve().parents[1] / "data"
    return inside if inside.is_dir() else inside.parents[1] / "data"


def _cache() -> Path:
    import pooch  # a folder needs no cache

    return Path(pooch.os_cache("coursekit"))


def _found(data: _Dataset) -> str:
    files = [f"{data.folder}/{name}" for name in ORIGINS[data.folder].sha256] if data.folder else [data.file]
    for place, root in _folders().items():
        if all((root / file).is_file() for file in files):
            return place
    if not data.folder:
        return "missing"
    try:
        cache = _cache()
    except ModuleNotFoundError as missing:
        return f"not here, and {missing}"
    return "in the cache" if all((cache / file).is_file() for file in files) else "not here; load fetches it"


def _named(name: str) -> _Dataset:
    if name not in _DATASETS:
        raise ValueError(f"no data set named {name!r}; there are: {', '.join(_DATASETS)}")
    return _DATASETS[name]


def _clouds() -> Clouds:
    folder = locate("icp_clouds")
    return Clouds(read_cloud(folder / "pclX.txt"), read_cloud(folder / "pclY.txt"))


_DATASETS: dict[str, _Dataset] = {
    "landmark_log": _Dataset(
        "1842 samples of range and bearing to one cylinder, from the world",
        lambda: read_landmark_log(project_file("landmark_log.csv")),
        file="landmark_log.csv",
    ),
    "landmark_log_real": _Dataset(
        "1842 samples of range and bearing to one cylinder, from Gazebo",
        lambda: read_landmark_log(locate("landmark_log") / "landmark_data_cyan.csv"),
        "landmark_log",
    ),
    "icp_clouds": _Dataset("two clouds of 5750 points, one a moved copy of the other", _clouds, "icp_clouds"),
    "mrclam7_robot1": _Dataset(
        "15 minutes of a real robot among 15 landmarks, with Vicon truth",
        lambda: read_mrclam(locate("mrclam7_robot1"), robot=1),
        "mrclam7_robot1",
    ),
}
