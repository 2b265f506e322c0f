"""Write the labs for the graders that classes already use.

    python tools/classroom.py nbgrader             dist/nbgrader: a course of nbgrader's, one assignment a lab
    python tools/classroom.py otter                dist/otter: one folder a lab, for otter assign
    python tools/classroom.py otter --to elsewhere --labs notebooks/04_ekf.ipynb

Both hold the solutions, and are for the teacher: ``nbgrader generate_assignment`` and ``otter assign`` take them out.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
import desk
import editions
import graded_cells

CONFIG = """# nbgrader's settings for this course.  A lab's longest cell takes half a minute on a slow machine.
c = get_config()  # noqa: F821
c.CourseDirectory.course_id = "where-am-i"
c.Execute.timeout = 300
c.ClearSolutions.code_stub = {"python": 'raise NotImplementedError("your lines here")'}
"""
# nbgrader takes the number that a cell ends with for points.  A mark of 80 earns all: scenarios are drawn, marks vary.
NBGRADER = {
    "check": "display({call})",
    "score": "card = {call}\ndisplay(card)\nround(min(card.mark / 8, 10), 2)  # of 10 points; a mark of 80 earns all",
}
OTTER = {
    "check": "assert (verdict := {call}), verdict.hint",
    "score": "assert (card := {call}).mark >= 80, card",
}


def nbgrader(master: nbformat.NotebookNode, book: str = "../book") -> nbformat.NotebookNode:
    """A lab for nbgrader's ``source`` folder: its solutions between markers, its checks locked and worth points."""
    editions.student(master)  # raises for a solution that nbgrader would not see either
    lab, answers = _unfolded(master, book)
    for cell in lab.cells:
        if graded_cells.checked(cell):
            cell.source = NBGRADER[_verb(cell)].format(call=cell.source)
    return graded_cells.mark(lab, answers)


def otter(master: nbformat.NotebookNode, book: str = "../book") -> nbformat.NotebookNode:
    """A lab for ``otter assign``: each answer with its check as a question."""
    editions.student(master)
    lab, answers = _unfolded(master, book)
    cells = [_raw("# ASSIGNMENT CONFIG", "name: where-am-i", "generate: true", "export_cell: false")]
    waiting: list[nbformat.NotebookNode] = []
    for cell in lab.cells:
        if cell.id in answers:
            cell.source = _prompted(cell.source)
            waiting.append(cell)
        elif waiting and (found := graded_cells.checked(cell)):
            name, points = found
            cell.source = OTTER[_verb(cell)].format(call=cell.source)
            cells += [
                _raw("# BEGIN QUESTION", f"name: {name}", f"points: {points}"),
                _raw("# BEGIN SOLUTION"), *waiting, _raw("# END SOLUTION"),
                _raw("# BEGIN TESTS"), cell, _raw("# END TESTS"),
                _raw("# END QUESTION"),
            ]  # fmt: skip
            waiting = []
        else:
            cells.append(cell)
    if waiting:
        raise ValueError("an answer without a check: otter would not take its solution out")
    lab.cells = cells
    return lab


def _unfolded(master: nbformat.NotebookNode, book: str) -> tuple[nbformat.NotebookNode, set[str]]:
    """A readable copy whose answers are open and untagged, and the ids of these."""
    lab = editions.readable(nbformat.from_dict(master), book)
    answers = [cell for cell in lab.cells if editions.TAG in cell.metadata.get("tags", [])]
    for cell in answers:
        cell.metadata.tags = [tag for tag in cell.metadata.tags if tag != editions.TAG]
        cell.metadata.pop("jupyter", None)
    return lab, {cell.id for cell in answers}


def _verb(cell: nbformat.NotebookNode) -> str:
    return "score" if "exercises.score(" in cell.source else "check"


def _prompted(source: str) -> str:
    """nbgrader's markers as otter's, each with the placeholder that the student finds in place of the solution."""
    lines = editions.lines_of(source)
    for first, last in reversed(editions.solutions(lines)):
        indent = lines[first][: len(lines[first]) - len(lines[first].lstrip())]
        prompt = ['""" # BEGIN PROMPT', editions.PLACEHOLDER, '""" # END PROMPT']
        marked = ["# BEGIN SOLUTION NO PROMPT", *(line.removeprefix(indent) for line in lines[first + 1 : last])]
        lines[first : last + 1] = [indent + line if line else "" for line in [*marked, "# END SOLUTION", *prompt]]
    return "\n".join(lines)


def _raw(*lines: str) -> nbformat.NotebookNode:
    return nbformat.v4.new_raw_cell("\n".join(lines))


def main(arguments: list[str] | None = None) -> int:
    """Write every lab, each into a folder of its name."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("grader", choices=["nbgrader", "otter"])
    parser.add_argument("--to", type=Path, help="the folder to write; dist/nbgrader or dist/otter by default")
    parser.add_argument("--labs", nargs="+", type=Path, help="these notebooks; all labs by default")
    options = parser.parse_args(arguments)
    folder = options.to or desk.ROOT / "dist" / options.grader
    source, make = (folder / "source", nbgrader) if options.grader == "nbgrader" else (folder, otter)
    for master in options.labs or sorted(desk.MASTERS.glob("[0-9][0-9]_*.ipynb")):
        place = source / master.stem
        place.mkdir(parents=True, exist_ok=True)
        lab = make(nbformat.read(master, as_version=4), desk.way_to_the_book(place))
        nbformat.write(lab, place / master.name)
    if options.grader == "nbgrader":
        (folder / "nbgrader_config.py").write_text(CONFIG, encoding="utf-8")
    print(f"The labs for {options.grader}, solutions included: {desk.shown(folder)}/")
    return 0


if __name__ == "__main__":
    sys.exit(main())
