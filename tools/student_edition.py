"""Write the student edition of the labs: the same notebooks, with what stands between the solution markers emptied.

    python tools/student_edition.py                 all labs, into dist/student/
    python tools/student_edition.py --to elsewhere notebooks/02_range_and_bearing.ipynb

The markers are nbgrader's, inside a function, so that an emptied lab still runs from top to bottom:

    def range_from_height(height_px, axis_px, camera, landmark_height):
        ### BEGIN SOLUTION
        …
        ### END SOLUTION
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import nbformat

ROOT = Path(__file__).resolve().parents[1]
STUDENT = ROOT / "dist" / "student"
SOLUTION = re.compile(
    r"^(?P<indent>[ \t]*)### BEGIN SOLUTION[ \t]*\n(?:(?!^[ \t]*### BEGIN SOLUTION).)*?^[ \t]*### END SOLUTION[ \t]*$",
    re.MULTILINE | re.DOTALL,
)
MARKER = re.compile(r"### (BEGIN|END) SOLUTION")


def empty(source: str) -> str:
    """A cell with each solution replaced by a placeholder.

    Raises ValueError when a marker has no partner, or stands outside a function.
    """

    def placeholder(match: re.Match[str]) -> str:
        if not match["indent"]:
            raise ValueError("solution markers belong inside a function, or the emptied lab would stop there")
        return f'{match["indent"]}raise NotImplementedError("your lines here")'

    emptied = SOLUTION.sub(placeholder, source)
    if stray := MARKER.search(emptied):
        raise ValueError(f"{stray[0]!r} has no partner")
    return emptied


def student_edition(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A copy for students: solutions emptied, nothing run, links as seen from two folders down.

    Raises ValueError that names the cell by its number, counted from 0.
    """
    edition = nbformat.from_dict(notebook)
    for i, cell in enumerate(edition.cells):
        if cell.cell_type == "markdown":
            cell.source = cell.source.replace("](../book/", "](../../book/")
        if cell.cell_type != "code":
            continue
        try:
            cell.source = empty(cell.source)
        except ValueError as error:
            raise ValueError(f"cell {i}: {error}") from None
        cell.outputs, cell.execution_count = [], None
        cell.metadata.tags = [tag for tag in cell.metadata.get("tags", []) if tag != "exercise-solution"]
    return edition


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("notebooks", nargs="*", type=Path, help="all labs by default")
    parser.add_argument("--to", type=Path, default=STUDENT, help="the folder to write")
    options = parser.parse_args(arguments)
    paths = options.notebooks or sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.ipynb"))
    options.to.mkdir(parents=True, exist_ok=True)
    for path in paths:
        try:
            edition = student_edition(nbformat.read(path, as_version=4))
        except ValueError as error:
            print(f"{path.name}, {error}", file=sys.stderr)
            return 1
        nbformat.write(edition, options.to / path.name)
        print(options.to / path.name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
