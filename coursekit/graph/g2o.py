r"""Graphs in g2o's text format: poses, landmarks and what was measured between them, in the plane.

The format holds information matrices, Ω = Σ⁻¹, as upper triangles by rows: Ω₁₁ Ω₁₂ Ω₁₃ Ω₂₂ Ω₂₃ Ω₃₃.  Between poses
it means the error z⁻¹ ⊕ (x_i⁻¹ ⊕ x_j), whose place is told in the frame of the *measured* pose z; an ``Edge`` tells it
in the frame of pose i.  The two differ by the measured turn, so Ω is turned on the way in and out, and χ² stays.

Source: Kümmerle, Grisetti, Strasdat, Konolige & Burgard (2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from coursekit.doors import as_numbers
from coursekit.gaussian import symmetrize
from coursekit.geometry import Array, rotation
from coursekit.graph.least_squares import Edge, Factor, PointEdge, between_poses, point_from

SIZES = {"VERTEX_SE2": 4, "VERTEX_XY": 3, "EDGE_SE2": 11, "EDGE_SE2_XY": 7}  # numbers after each tag


@dataclass(frozen=True, eq=False)
class Graph:
    """poses (n, 3) [m, m, rad], landmarks (m, 2) [m], and the measurements between poses and of landmarks from poses.

    An ``Edge`` counts the poses, a ``PointEdge`` the poses (i) and the landmarks (j), each from 0.
    """

    poses: Array
    edges: tuple[Edge, ...]
    landmarks: Array
    sightings: tuple[PointEdge, ...]

    @property
    def factors(self) -> list[Factor]:
        """For ``optimize([*poses, *landmarks], …)``; a prior on one pose is still wanted."""
        n = len(self.poses)
        steps = [between_poses(e.i, e.j, e.pose, e.cov) for e in self.edges]
        return steps + [point_from(s.i, n + s.j, s.point, s.cov) for s in self.sightings]


def read_g2o(path: str | Path) -> Graph:
    """A file with VERTEX_SE2, VERTEX_XY, EDGE_SE2 and EDGE_SE2_XY → ``Graph``, vertices in the order of the file.

    Other lines that are no vertex and no edge (FIX, parameters) are left out.  Raises FileNotFoundError, or ValueError,
    with the line, for another kind of vertex or edge, numbers that are missing or not finite, a vertex that is told
    twice or not at all, and an information matrix that is not positive definite.

    Source: Kümmerle, Grisetti, Strasdat, Konolige & Burgard (2011).

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "two.g2o")
    ...     write_g2o(path, [[0, 0, 0], [1, 0, 0]], [Edge(0, 1, [1.0, 0.0, 0.1], 0.01 * np.eye(3))])
    ...     read_g2o(path).edges[0].pose
    array([1. , 0. , 0.1])
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: there is no such file")
    poses, landmarks = dict[int, Array](), dict[int, Array]()
    measured = list[tuple[int, str, list[int], Array]]()
    for line, text in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        tag, *entries = text.split() or ["#"]
        if not tag.startswith(("VERTEX", "EDGE")):
            continue
        if tag not in SIZES:
            raise ValueError(f"{path}: line {line}: expected one of {', '.join(SIZES)}, got {tag}")
        ids, numbers = _parsed(path, line, tag, entries)
        if tag.startswith("EDGE"):
            measured.append((line, tag, ids, numbers))
        elif ids[0] in poses or ids[0] in landmarks:
            raise ValueError(f"{path}: line {line}: vertex {ids[0]} is told twice")
        else:
            (poses if tag == "VERTEX_SE2" else landmarks)[ids[0]] = numbers
    row = {name: k for table in (poses, landmarks) for k, name in enumerate(table)}
    edges, sightings = list[Edge](), list[PointEdge]()
    for line, tag, (i, j), numbers in measured:
        d = 3 if tag == "EDGE_SE2" else 2
        if i not in poses or j not in (poses if d == 3 else landmarks):
            raise ValueError(
                f"{path}: line {line}: {tag} between vertices {i} and {j}, of which one is not in the file"
            )
        z, info = numbers[:d], np.zeros((d, d))
        info[np.triu_indices(d)] = numbers[d:]
        info = info + np.triu(info, 1).T
        try:
            if d == 3:
                edges.append(Edge(row[i], row[j], z, _inverse(_turned(info, z[2]))))
            else:
                sightings.append(PointEdge(row[i], row[j], z, _inverse(info)))
        except (ValueError, np.linalg.LinAlgError):
            raise ValueError(f"{path}: line {line}: the information matrix is not positive definite:\n{info}") from None
    return Graph(
        np.array([*poses.values()]).reshape(-1, 3), tuple(edges),
        np.array([*landmarks.values()]).reshape(-1, 2), tuple(sightings),
    )  # fmt: skip


def write_g2o(
    path: str | Path,
    poses: ArrayLike,
    edges: Sequence[Edge],
    landmarks: ArrayLike = (),
    sightings: Sequence[PointEdge] = (),
) -> None:
    """A graph as a file for ``read_g2o`` and other programs: poses (n, 3) [m, m, rad], landmarks (m, 2) [m].

    The first pose is written as fixed; landmarks are numbered after the poses.  Numbers have all their digits.  Raises
    ValueError for poses and landmarks of another shape or not finite, and for edges that name what is not there.

    Source: Kümmerle, Grisetti, Strasdat, Konolige & Burgard (2011).

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "one.g2o")
    ...     write_g2o(path, [[0, 0, 0]], [], [[2, 1]], [PointEdge(0, 0, [2.0, 1.0], 0.25 * np.eye(2))])
    ...     print(path.read_text().splitlines()[-1])
    EDGE_SE2_XY 0 1 2.0 1.0 4.0 0.0 4.0
    """
    poses = as_numbers(poses, "poses")
    points = np.empty((0, 2)) if np.size(landmarks) == 0 else as_numbers(landmarks, "landmarks")
    for name, table, d in (("poses", poses, 3), ("landmarks", points, 2)):
        if table.ndim != 2 or table.shape[1] != d or not np.all(np.isfinite(table)):
            raise ValueError(f"{name}: expected finite numbers of shape (n, {d}), got shape {table.shape}")
    n, m = len(poses), len(points)
    if any(not (0 <= e.i < n and 0 <= e.j < n) for e in edges) or any(
        not (0 <= s.i < n and 0 <= s.j < m) for s in sightings
    ):
        raise ValueError(f"edges: expected them between poses 0 … {n - 1} and landmarks 0 … {m - 1}")
    lines = [_line("VERTEX_SE2", [k], pose) for k, pose in enumerate(poses)]
    lines += [_line("VERTEX_XY", [n + k], point) for k, point in enumerate(points)]
    lines += ["FIX 0"] if n else []
    for e in edges:
        info = _turned(_inverse(e.cov), -e.pose[2])
        lines.append(_line("EDGE_SE2", [e.i, e.j], [*e.pose, *info[np.triu_indices(3)]]))
    for s in sightings:
        lines.append(_line("EDGE_SE2_XY", [s.i, n + s.j], [*s.point, *_inverse(s.cov)[np.triu_indices(2)]]))
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _line(tag: str, ids: Sequence[int], numbers: ArrayLike) -> str:
    return " ".join([tag, *map(str, ids), *(repr(float(x)) for x in np.asarray(numbers))])


def _parsed(path: Path, line: int, tag: str, entries: list[str]) -> tuple[list[int], Array]:
    count = 2 if tag.startswith("EDGE") else 1
    try:
        ids, numbers = [int(name) for name in entries[:count]], np.array([float(x) for x in entries[count:]])
    except ValueError:
        ids, numbers = [], np.empty(0)
    if len(ids) + len(numbers) != SIZES[tag] or not np.all(np.isfinite(numbers)):
        raise ValueError(f"{path}: line {line}: expected {SIZES[tag]} finite numbers after {tag}, got {entries}")
    return ids, numbers


def _turned(info: Array, angle: float) -> Array:
    """The information on [x, y, θ] in a frame that is turned by -angle: B Ω Bᵀ."""
    B = np.eye(3)
    B[:2, :2] = rotation(angle)
    return symmetrize(B @ info @ B.T)


def _inverse(matrix: Array) -> Array:
    return symmetrize(np.asarray(np.linalg.solve(matrix, np.eye(len(matrix))), dtype=float))
