"""Bring notebooks into the form in which they are committed: no outputs, no counts, nothing an editor left behind.

python tools/clean_notebooks.py                      all labs
python tools/clean_notebooks.py --check file.ipynb   change nothing; say which are not clean, and fail
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import nbformat

ROOT = Path(__file__).resolve().parents[1]
METADATA = {
    "kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"},
    "language_info": {"name": "python"},
}
# What the book reads from a cell, and what JupyterLab folds for everybody.
KEPT = {"tags", "mystnb", "jupyter"}
SOLUTION_TAG = "exercise-solution"
FOLDED = {SOLUTION_TAG, "check", "hide-input"}


def clean(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A clean copy: sources, ids, tags and text alternatives, and the course's own metadata."""
    fresh = nbformat.from_dict(notebook)
    fresh.metadata = nbformat.from_dict(METADATA)
    fresh.cells = [cell for cell in fresh.cells if cell.source.strip()]
    for cell in fresh.cells:
        cell.source = cell.source.strip("\n")
        cell.metadata = {key: value for key, value in cell.metadata.items() if key in KEPT}
        cell.pop("attachments", None)
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
            fold(cell)
    fresh.nbformat, fresh.nbformat_minor = 4, 5
    _, fresh = nbformat.validator.normalize(fresh)  # cells without an id get one
    return fresh


def fold(cell: nbformat.NotebookNode) -> None:
    """Fold in JupyterLab the code that the book folds, and no other."""
    editor = {key: value for key, value in cell.metadata.pop("jupyter", {}).items() if key != "source_hidden"}
    if FOLDED & set(cell.metadata.get("tags", [])):
        editor["source_hidden"] = True
    if editor:
        cell.metadata["jupyter"] = editor


def text(notebook: nbformat.NotebookNode) -> str:
    """A notebook as its file holds it."""
    return nbformat.writes(notebook) + "\n"


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("notebooks", nargs="*", type=Path, help="all labs by default")
    parser.add_argument("--check", action="store_true", help="change nothing")
    options = parser.parse_args(arguments)
    changed = 0
    for path in options.notebooks or sorted((ROOT / "notebooks").glob("*.ipynb")):
        before = path.read_text(encoding="utf-8")
        after = text(clean(nbformat.reads(before, as_version=4)))
        if after != before:
            changed += 1
            print(f"{path}: {'not clean' if options.check else 'cleaned'}")
            if not options.check:
                path.write_text(after, encoding="utf-8")
    return 1 if options.check and changed else 0


if __name__ == "__main__":
    sys.exit(main())
