"""A map that was there before, and a filter that is kept in a file: ``add``, ``save`` and ``load`` of every filter.

The file is NumPy's ``.npz``: plain arrays and one text in JSON, no pickle, so that opening a stranger's map runs none
of a stranger's code.  Motion model and rule of association are code, and are given again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, cast
from zipfile import BadZipFile

import numpy as np

from coursekit.ekf.lost import Lost
from coursekit.gaussian import Gaussian, check_belief, factored
from coursekit.models import MotionModel
from coursekit.slam._map_covariance import MapCovariance
from coursekit.slam.observations import Association


class Stored:
    """The part of every filter that knows a map beforehand, and is kept in a file."""

    def add(self: Any, landmarks: Mapping[Any, Gaussian]) -> None:
        """Put landmarks of a map that was there before on this one.  They are confirmed at once, in this order.

        landmarks : id → the belief over [x, y] m in this map's frame; independent of the pose and of each other.

        ``rows`` tells their rows.  A rule other than ``Known`` recognises them by where they are.

        Raises ValueError for an id that is on the map already and a belief that is not over two numbers, TypeError for
        what is no belief.

        >>> from coursekit.models import DifferentialDrive
        >>> from coursekit.slam import EkfSlam, Known
        >>> slam = EkfSlam(Gaussian(np.zeros(3), 0.01 * np.eye(3)), DifferentialDrive(), Known())
        >>> slam.add({"door": Gaussian([2.0, 0.0], 1e-4 * np.eye(2))})
        >>> slam.observe([[1.9, 0.0]], np.diag([0.05, 0.01]) ** 2, ids=["door"]), slam.rows
        (array([0]), {'door': 0})
        >>> bool(slam.pose.mean[0] > 0.05)               # the door is nearer than expected: so the robot is further
        True

        Source: Thrun, Burgard & Fox (2005), section 7.4, for localisation in a map that is known.
        """
        for name, place in landmarks.items():
            check_belief(place, f"landmarks[{name!r}]")
            if place.mean.shape != (2,):
                raise ValueError(f"landmarks[{name!r}]: expected a belief over [x, y], got one over {place.mean.size} "
                                 "numbers")  # fmt: skip
            if name in self._labels:
                raise ValueError(f"landmarks: {name!r} is on the map already")
        k, first = len(landmarks), len(self._index)
        corner = np.zeros((2 * k, 2 * k))
        for i, place in enumerate(landmarks.values()):
            corner[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = place.cov
        self._grow(np.array([place.mean for place in landmarks.values()]).reshape(-1, 2),
                   np.zeros((2 * k, len(self._x))), corner)  # fmt: skip
        confirmed = first - len(self._tentative)
        self._index += range(confirmed, confirmed + k)
        self._labels.update({name: first + i for i, name in enumerate(landmarks)})

    def save(self: Any, path: str | Path) -> None:
        """Write the filter to a file from which ``load`` goes on as if it had never stopped; no pickle is in it.

        path : ends in ``.npz``; an existing file is overwritten.  Motion model and rule are code, and are not saved.

        Raises ValueError for another ending, TypeError for ids that are neither text nor whole numbers.

        >>> from tempfile import TemporaryDirectory
        >>> from coursekit.models import DifferentialDrive
        >>> from coursekit.slam import EkfSlam, Known
        >>> slam = EkfSlam(Gaussian(np.zeros(3), 1e-6 * np.eye(3)), DifferentialDrive(), Known())
        >>> indices = slam.observe([[2.0, 0.0]], np.diag([0.05, 0.01]) ** 2, ids=["door"])
        >>> with TemporaryDirectory() as folder:
        ...     slam.save(Path(folder) / "hall.npz")
        ...     again = EkfSlam.load(Path(folder) / "hall.npz", DifferentialDrive(), Known())
        >>> again.rows, bool(np.all(again.cov == slam.cov))
        ({'door': 0}, True)
        """
        path = Path(path)
        if path.suffix.lower() != ".npz":
            raise ValueError(f"path: expected one that ends in .npz, got {str(path)!r}")
        for name in self._labels:
            if type(name) not in (str, int):
                raise TypeError(f"ids: expected texts or whole numbers, which a file can hold, got {name!r}")
        watch, lost = self._watch, self._watch.lost
        notes = {
            "filter": type(self).__name__,
            "n_init": self.n_init,
            "max_misses": self.max_misses,
            "nis": self.nis,
            "dof": self.dof,
            "ids": list(self._labels.items()),
            "seconds": watch.time,
            "unused": watch._unused,
            "recent": list(watch._recent),
            "lost": None if lost is None else [lost.reason, lost.since],
        }
        tentative = [[j, *counts] for j, counts in self._tentative.items()]
        np.savez_compressed(
            path, notes=json.dumps(notes), x=self._x, P=np.tril(self._P.stored),
            index=np.array(self._index, dtype=np.intp), tentative=np.array(tentative, dtype=np.intp).reshape(-1, 3),
            **self._own_numbers(),
        )  # fmt: skip

    @classmethod
    def load(cls, path: str | Path, motion: MotionModel, associate: Association) -> Self:
        """The filter that ``save`` of this class wrote, with its settings, map, ids and what it watches.

        Raises ValueError for a file that is none, or another class's; FileNotFoundError where there is none.
        """
        numbers, pose = _read(path, cls.__name__)
        notes, made = numbers["notes"], cast(Any, cls)
        slam: Self = made(pose, motion, associate, n_init=notes["n_init"], max_misses=notes["max_misses"])
        _restore(slam, numbers)
        return slam

    def _own_numbers(self) -> dict[str, Any]:
        """Arrays of a subclass that belong in its file."""
        return {}

    def _take_own_numbers(self, numbers: Mapping[str, Any]) -> None:
        """The way back."""


def _restore(slam: Any, numbers: dict[str, Any]) -> None:
    """Fill a fresh filter with what a file holds."""
    notes = numbers["notes"]
    slam._x, slam._P = numbers["x"], MapCovariance(numbers["P"])
    slam._index = numbers["index"].tolist()
    slam._tentative = {j: (seen, missed) for j, seen, missed in numbers["tentative"].tolist()}
    slam._labels = dict(notes["ids"])
    slam.nis, slam.dof = notes["nis"], notes["dof"]
    watch = slam._watch
    watch.time, watch._unused = notes["seconds"], notes["unused"]
    watch._recent.extend(notes["recent"])
    watch.lost = Lost(*notes["lost"]) if notes["lost"] else None
    slam._take_own_numbers(numbers)


def _read(path: str | Path, kind: str) -> tuple[dict[str, Any], Gaussian]:
    """What the file of a filter of this kind holds, and the belief over the pose."""
    try:
        with np.load(Path(path), allow_pickle=False) as file:
            numbers: dict[str, Any] = {name: file[name] for name in file.files}
        numbers["notes"] = json.loads(str(numbers["notes"]))
        x, P = numbers["x"], numbers["P"]
        if P.shape != (len(x), len(x)) or not (np.isfinite(x).all() and np.isfinite(P).all()):
            raise ValueError(f"expected a finite x (n,) and P (n, n), got {x.shape} and {P.shape}")
        made_by = numbers["notes"]["filter"]
        pose_cov = P[:3, :3] + np.tril(P[:3, :3], -1).T
        pose = Gaussian(x[:3], factored(pose_cov)[0])
    except (ValueError, KeyError, TypeError, AttributeError, BadZipFile, EOFError) as error:
        raise ValueError(f"{path}: expected a map that {kind}.save wrote: {error}") from None
    if made_by != kind:
        raise ValueError(f"{path}: expected a map that {kind}.save wrote, got one of {made_by}: use {made_by}.load")
    return numbers, pose
