"""What nbgrader reads in a cell's metadata: answers, and locked checks with their points."""

from __future__ import annotations

import re
from collections.abc import Collection

import nbformat

POINTS = {"check": 1, "score": 10}
CHECK = re.compile(r'exercises\.(check|score)\(\s*"(lab\d\d)(?:\.(\w+))?"')


def checked(cell: nbformat.NotebookNode) -> tuple[str, int] | None:
    """(name, points) of the exercise or project that a cell checks, as in ("lab04-innovation", 1); None for others."""
    found = CHECK.search(cell.source) if cell.cell_type == "code" else None
    return (f"{found[2]}-{found[3] or 'project'}", POINTS[found[1]]) if found else None


def mark(notebook: nbformat.NotebookNode, answers: Collection[str]) -> nbformat.NotebookNode:
    """Give the cells whose ids are in ``answers``, and those that check them, nbgrader's metadata; in place.

    An answer bears the name of the check that follows it.  A check is locked: JupyterLab neither edits nor deletes it.
    """
    name = ""
    for cell in reversed(notebook.cells):
        if found := checked(cell):
            name, points = found
            cell.metadata.update(editable=False, deletable=False)
            cell.metadata.nbgrader = _metadata(name, grade=True, points=points)
        elif cell.id in answers:
            cell.metadata.nbgrader = _metadata(f"{name}-answer" if name else f"answer-{cell.id}")
            name = ""
    return notebook


def _metadata(name: str, *, grade: bool = False, **points: int) -> nbformat.NotebookNode:
    said = {
        "schema_version": 3,
        "grade_id": name,
        "grade": grade,
        "solution": not grade,
        "locked": grade,
        "task": False,
    }
    return nbformat.from_dict(said | {"cell_type": "code"} | points)
