"""What an instructor wants to know of a lab, taken from the lab: objectives, minutes, exercises, questions, rubric.

Nothing here is written twice: the notebook, the checks of its exercises and the criteria of its project are the source.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
import minutes
from lab_text import FENCE, HEADING, ROOT, directives, prose

POINTS = {"easy": 1, "medium": 2, "hard": 3, "open": 3}
WRONG_TURNS = 5  # of an exercise, at most, in a guide; its check knows more


@dataclass
class Exercise:
    """An exercise: title, difficulty, the name of its check, the hints of its check for the wrong turns people take."""

    title: str
    difficulty: str
    check: str
    hints: list[str] = field(default_factory=list)

    @property
    def points(self) -> int:
        """What it counts: 1 for an easy one to 3 for a hard or an open one."""
        return POINTS[self.difficulty]


@dataclass
class Question:
    """Questions that a lab asks in class, and their answer, in Markdown."""

    where: str
    text: str
    answer: str


@dataclass
class Lab:
    """A lab as an instructor sees it."""

    path: Path
    title: str
    objectives: list[str]
    needs: str
    exercises: list[Exercise]
    questions: list[Question]

    @property
    def number(self) -> str:
        """Two digits, "04"."""
        return self.path.stem[:2]

    @property
    def rubric(self) -> list[tuple[str, int]]:
        """(what is scored, points) of the lab's project."""
        from coursekit.teaching import projects

        return [(c.label, c.points) for c in projects.find(f"lab{self.number}").criteria]

    def minutes_by_part(self) -> list[tuple[str, float]]:
        """(heading, minutes) of each part, by the rule of ``minutes``."""
        spent: dict[str, float] = {}
        for heading, cell in blocks(self.path):
            project = heading.lower().startswith("project")
            spent[heading] = spent.get(heading, 0.0) + minutes.cell_minutes(cell, project)
        return [(heading, time) for heading, time in spent.items() if heading and time >= 0.5]


def read(path: Path) -> Lab:
    """A lab from its notebook.  Raises ValueError for one without a title or without objectives."""
    notebook = nbformat.read(path, as_version=4)
    text = "\n\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    title = re.search(r"^# (.+)$", text, re.M)
    able = re.search(r"^## You will be able to\n+((?:[-*] .*\n(?:  .*\n)*)+)", text, re.M)
    if not title or not able:
        raise ValueError(f"{path.name}: expected a title and a list under 'You will be able to'")
    needs = re.search(r"^(?:You need|Builds on|It builds on) .*(?:\n(?!\n|`).*)*", text, re.M)
    items = [" ".join(item.split()).rstrip(";.") for item in re.split(r"^[-*] ", able[1], flags=re.M) if item.strip()]
    return Lab(path, title[1], items, needs[0] if needs else "", [*_exercises(path)], [*_questions(path)])


def _exercises(path: Path) -> Iterator[Exercise]:
    cells = nbformat.read(path, as_version=4).cells
    hints = hints_of(path.stem[:2])
    for i, cell in enumerate(cells):
        for title, _ in directives(cell.source, "exercise") if cell.cell_type == "markdown" else []:
            check = next(c for later in cells[i:] if (c := re.search(r'exercises\.check\(\s*"([\w.]+)"', later.source)))
            name, difficulty = re.fullmatch(r"(.*?) \((easy|medium|hard|open).*\)", title).groups()  # type: ignore[union-attr]
            yield Exercise(name, difficulty, check[1], hints.get(check[1], [])[:WRONG_TURNS])


def hints_of(number: str) -> dict[str, list[str]]:
    """The name of each check of a lab → the hints that it may give, as they stand in its source."""
    source = ROOT / "coursekit" / "labs" / f"lab{number}" / "exercises.py"
    body = ast.parse(source.read_text(encoding="utf-8")).body
    functions = {f.name: f for f in body if isinstance(f, ast.FunctionDef)}
    found: dict[str, list[str]] = {}
    for function in functions.values():
        called = {n.id for n in ast.walk(function) if isinstance(n, ast.Name)} & set(functions)
        hints = [hint for f in [function, *(functions[name] for name in sorted(called))] for hint in _sentences(f)]
        for decorator in function.decorator_list:
            if isinstance(decorator, ast.Call) and decorator.args and isinstance(decorator.args[0], ast.Constant):
                found[str(decorator.args[0].value)] = [*dict.fromkeys(hints)]
    return found


def _sentences(function: ast.FunctionDef) -> Iterator[str]:
    """The whole sentences in a function, without its docstring and without those that a value is put into."""
    parts_of_others = {id(c) for n in ast.walk(function) if isinstance(n, ast.JoinedStr) for c in ast.walk(n)}
    for node in ast.walk(ast.Module(function.body[ast.get_docstring(function) is not None :], [])):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts_of_others:
            said = node.value.strip()
            if re.match(r"[A-Z].{25,}[.?]$", said):
                yield said


def blocks(path: Path) -> Iterator[tuple[str, nbformat.NotebookNode]]:
    """(heading of the part, cell) in order, with markdown cells cut before their headings."""
    heading = ""
    for cell in nbformat.read(path, as_version=4).cells:
        for source in cut(cell.source) if cell.cell_type == "markdown" else [cell.source]:
            if cell.cell_type == "markdown" and (found := HEADING.match(source)):
                heading = found[1]
            piece = nbformat.from_dict(cell)
            piece.source = source
            yield heading, piece


def _questions(path: Path) -> Iterator[Question]:
    """The opening, Play first, and each checkpoint: what is asked, and what unfolds below."""
    asked: list[str] = []
    for heading, cell in blocks(path):
        checkpoint = cell.source.startswith("### Checkpoint")
        if heading.lower().startswith(("exercises", "project", "going further")) or cell.cell_type != "markdown":
            continue
        if not checkpoint and not heading.lower().startswith(("a picture", "play first")):
            asked = []
            continue
        text = prose(re.sub(r"^#+ .*$", "", cell.source, flags=re.M)).strip()
        asked = [text] if checkpoint or HEADING.match(cell.source) else [*asked, text]
        answers = [b for t, b in directives(cell.source, "dropdown") if t.startswith(("Answer", "What you should"))]
        if answers:
            where = f"Checkpoint in “{heading}”" if checkpoint else heading
            yield Question(where, _asking("\n\n".join(asked)), answers[0].strip())
            asked = []


def cut(source: str) -> list[str]:
    """A markdown cell cut before each of its headings of the second and third level."""
    marks = [0]
    hidden = FENCE.sub(lambda m: "x" * len(m[0]), source)
    marks += [m.start() for m in re.finditer(r"^#{2,3} ", hidden, re.M) if m.start()]
    return [source[a:b] for a, b in zip(marks, [*marks[1:], len(source)])]


def _asking(text: str) -> str:
    """The paragraphs and items from the first that asks something."""
    pieces = re.split(r"\n{2,}", text)
    first = next((i for i, piece in enumerate(pieces) if "?" in piece), len(pieces) - 1)
    return "\n\n".join(pieces[first:])
