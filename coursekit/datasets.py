"""Where recordings live: in the project's data folder, in a folder of yours, in a cache, or at their public origin.

>>> log = load("landmark_log")              # the world's own log, in the project
>>> clouds = load("icp_clouds")             # doctest: +SKIP
>>> clouds.source.shape                     # doctest: +SKIP
(5750, 3)

Recordings that other people made are not part of the project: some state no licence.  ``load`` looks for them in
the folder that ``$COURSEKIT_DATA`` names (laid out as in ``data/README.md``), then in a cache, then fetches them
from the commit they are known by.  What is cached or fetched must match its hash; a folder of yours is believed,
so you can put another log of the same kind in the same place.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pooch

from coursekit.recordings import Clouds, Log, Mrclam, read_cloud, read_landmark_log, read_mrclam

__all__ = ["Clouds", "DatasetUnavailable", "Log", "Mrclam", "load", "locate", "names", "project_file",
           "read_cloud", "read_landmark_log", "read_mrclam"]  # fmt: skip

DOWNLOAD_TIMEOUT = 30.0  # seconds without an answer


class DatasetUnavailable(RuntimeError):
    """A recording is neither in $COURSEKIT_DATA nor in the cache, and could not be fetched."""


@dataclass(frozen=True)
class Origin:
    """A folder of a public GitHub repository at one commit, and the sha256 of the files we read from it."""

    repository: str
    commit: str
    folder: str
    sha256: dict[str, str]

    def url(self, name: str) -> str:
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{self.folder}/{name}"


# Local folder → origin.  data/README.md says what each is.
ORIGINS = {
    "landmark_log": Origin(
        "jaiselsingh1/prob_rob_labs_ros_2_group18",
        "b0d0649cafa4fd8c34a87d1c96fc02ff99b34521",
        "pictures",
        {"landmark_data_cyan.csv": "cbe61d296ba03221a4fbf7a34ef66c139b84ac8cbbc75f3fb3c923404e3741c5"},
    ),
    "icp_clouds": Origin(
        "zhexin1904/EECE5550",
        "4583587bdd21c73b5278b112e5ca05ea7b62e896",
        "HW2/ICP/data",
        {
            "pclX.txt": "ef3db2510f3581fe3c9f2be0083b34ccafcda3a257baaf21f94da236bd807629",
            "pclY.txt": "07eb04b55031e4ff524647ae3c26d2bd6655f193545e334a5b32d347af52d6fc",
        },
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
    ),
}


def load(name: str) -> Any:
    """A recording by name.

    ==================  ==================================================================================
    landmark_log        the world's own drive around a cylinder → ``Log``; part of the project
    landmark_log_real   the same kind of drive, recorded by others in Gazebo → ``Log``
    icp_clouds          two clouds of 5750 points, ``source`` = pclX and ``target`` = pclY → ``Clouds``
    mrclam7_robot1      15 minutes of a real robot among 15 landmarks, with Vicon truth → ``Mrclam``
    ==================  ==================================================================================

    Raises ValueError for a name that is none of these, DatasetUnavailable when the recording is not here and
    cannot be fetched, FileNotFoundError when the project's own data folder is missing.
    """
    if name not in _LOADERS:
        raise ValueError(f"no data set named {name!r}; there are: {', '.join(names())}")
    return _LOADERS[name]()


def names() -> list[str]:
    """What ``load`` knows."""
    return sorted(_LOADERS)


def project_file(relative: str) -> Path:
    """A file of the project's ``data`` folder, as in ``project_file("arenas/lab.toml")``.

    Raises FileNotFoundError, with the remedy, when the package was installed without that folder.
    """
    folder = Path(__file__).resolve().parents[1] / "data"
    if not (folder / relative).exists():
        remedy = "" if folder.is_dir() else (
            "; coursekit was installed without the project's data folder: "
            "clone the repository and install it from there with pip install -e ."
        )  # fmt: skip
        raise FileNotFoundError(f"{folder / relative}: there is no such file{remedy}")
    return folder / relative


def locate(folder: str) -> Path:
    """The folder with the files of an origin ("landmark_log", "icp_clouds", "mrclam7_robot1"), fetched if need be.

    Raises DatasetUnavailable naming the file, the places that were searched and what to do.
    """
    if folder not in ORIGINS:
        raise ValueError(f"no folder named {folder!r}; there are: {', '.join(ORIGINS)}")
    origin, searched = ORIGINS[folder], []
    if root := os.environ.get("COURSEKIT_DATA"):
        yours = Path(root).expanduser() / folder
        missing = [name for name in origin.sha256 if not (yours / name).is_file()]
        if not missing:
            return yours
        searched.append(f"$COURSEKIT_DATA, which has no {folder}/{missing[0]}")
    else:
        searched.append("$COURSEKIT_DATA, which is not set")
    cache = Path(pooch.os_cache("coursekit")) / folder
    pooch.get_logger().setLevel("WARNING")  # its progress lines would land in a lab's output
    for name, digest in origin.sha256.items():
        if (cache / name).is_file() and hashlib.sha256((cache / name).read_bytes()).hexdigest() == digest:
            continue
        try:
            pooch.retrieve(
                origin.url(name),
                f"sha256:{digest}",
                fname=name,
                path=cache,
                downloader=pooch.HTTPDownloader(timeout=DOWNLOAD_TIMEOUT),
            )
        except Exception as error:  # whatever stops a download, the reader needs the same remedy
            why = (
                str(error) if isinstance(error, ValueError) else type(error).__name__
            )  # a hash that differs, or no network
            searched += [f"the cache {cache}", f"{origin.url(name)} ({why})"]
            raise DatasetUnavailable(
                f"{folder}/{name} is not here and could not be fetched.  Looked in: {'; '.join(searched)}.  To get it, "
                f"connect to the network once, or put the file at {folder}/{name} in a folder of yours and set "
                f"COURSEKIT_DATA to that folder."
            ) from error
    return cache


def _clouds() -> Clouds:
    folder = locate("icp_clouds")
    return Clouds(read_cloud(folder / "pclX.txt"), read_cloud(folder / "pclY.txt"))


_LOADERS: dict[str, Callable[[], Any]] = {
    "landmark_log": lambda: read_landmark_log(project_file("landmark_log.csv")),
    "landmark_log_real": lambda: read_landmark_log(locate("landmark_log") / "landmark_data_cyan.csv"),
    "icp_clouds": _clouds,
    "mrclam7_robot1": lambda: read_mrclam(locate("mrclam7_robot1"), robot=1),
}
