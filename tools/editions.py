"""The two editions of a lab: the student's, with its solutions emptied, and the solved one, with its solutions folded.

A solution is what stands between nbgrader's markers, inside a function, so that an emptied lab still runs from top to
bottom:

    def range_from_height(height_px, axis_px, camera, landmark_height):
        ### BEGIN SOLUTION
        …
        ### END SOLUTION

Letter case, the number of #, spaces and line endings do not matter.  Whatever else looks like a marker, or like a
solution that would stay, is refused: a student edition never holds a solution that nobody noticed.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
import citations
import clean_notebooks
import graded_cells

from coursekit import __version__

TAG = clean_notebooks.SOLUTION_TAG
EXPECTED = "expected ### BEGIN SOLUTION … ### END SOLUTION inside a function"
PLACEHOLDER = 'raise NotImplementedError("your lines here")'
STUCK = (
    "*Stuck?* `make solved` (without make, `python tools/desk.py solved`) puts the solved labs into `my_labs/solved/`. "
    "On this lab's page in the book, the solution unfolds under the exercise."
)
SEED = re.compile(r"^(SEED = experiments\.lab_seed\((\d+))\)$", re.M)
MARKER = re.compile(r"[ \t]*#+[ \t]*(BEGIN|END)[ \t_-]*SOLUTION[ \t:]*#*[ \t]*", re.IGNORECASE)
# What an author may have meant for a marker: a slip of the pen, another tool's markers, a marker beside code.
SUSPECT = re.compile(
    r"#[#\W_]*(?i:BEGIN|START|END|STOP|FINISH)[\W_]*(?i:SOL\w*NS?\b|ANSWER|HIDDEN|MARK\W*SCHEME)"
    r"|\b(?:BEGIN|END)[ \t_-]+(?:SOLUTION|HIDDEN[ \t_-]*TESTS?)\b|#[#\W_]*SOLUTION\b"
)
# A line that two authors would write alike is no leak; a longer one, or several lines in a row, is.
TELLING = 50


def lines_of(source: str) -> list[str]:
    """The lines of a cell, whatever ends them."""
    return source.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def solutions(lines: list[str]) -> list[tuple[int, int]]:
    """(first, last) line of each solution, its markers included.

    Raises ValueError for a marker without its partner, in a string, beside code, or nearly spelled.
    """
    blocks, begun = [], None
    marked = {i: found[1].upper() for i, line in enumerate(lines) if (found := MARKER.fullmatch(line))}
    comments = _comment_lines(lines) if marked else set()
    for i, line in enumerate(lines):
        here = f"line {i + 1}, {line.strip()!r}"
        if i not in marked:
            if SUSPECT.search(line):
                raise ValueError(f"{here}: looks like a marker; {EXPECTED}, each on a line of its own")
        elif i not in comments:
            raise ValueError(f"{here}: a marker inside a string; {EXPECTED}")
        elif marked[i] == "BEGIN":
            if begun is not None:
                raise ValueError(f"{here}: the marker on line {begun + 1} has no partner yet; {EXPECTED}")
            begun = i
        else:
            if begun is None:
                raise ValueError(f"{here}: has no partner before it; {EXPECTED}")
            blocks.append((begun, i))
            begun = None
    if begun is not None:
        raise ValueError(f"line {begun + 1}, {lines[begun].strip()!r}: has no partner; {EXPECTED}")
    return blocks


def _comment_lines(lines: list[str]) -> set[int]:
    """The lines, counted from 0, on which Python sees a comment."""
    reader = io.StringIO("\n".join(lines) + "\n").readline
    try:
        return {t.start[0] - 1 for t in tokenize.generate_tokens(reader) if t.type == tokenize.COMMENT}
    except (tokenize.TokenError, SyntaxError) as error:
        raise ValueError(f"holds solution markers and is not Python: {error}") from None


def empty(source: str) -> str:
    """A cell with each solution replaced by a placeholder.

    Raises ValueError when a marker is not as it should be, or when the emptied cell would not run.
    """
    lines = lines_of(source)
    blocks = solutions(lines)
    for first, last in reversed(blocks):
        body = [line for line in lines[first + 1 : last] if line.strip() and not line.lstrip().startswith("#")]
        if not body:
            raise ValueError(f"line {first + 1}: the solution has no lines; {EXPECTED}")
        indent = body[0][: len(body[0]) - len(body[0].lstrip())]
        lines[first : last + 1] = [indent + PLACEHOLDER]
    if blocks:
        _demand_that_it_runs("\n".join(lines))
    return "\n".join(lines)


def _demand_that_it_runs(emptied: str) -> None:
    try:
        tree = ast.parse(emptied)
    except SyntaxError as error:
        raise ValueError(f"without its solution it is not Python (line {error.lineno}: {error.msg})") from None
    functions = [n for n in ast.walk(tree) if isinstance(n, (ast.FunctionDef, ast.AsyncFunctionDef))]
    for i, line in enumerate(lines_of(emptied), 1):
        if line.strip() == PLACEHOLDER and not any(f.lineno < i <= (f.end_lineno or 0) for f in functions):
            raise ValueError(f"the solution is not inside a function, and the emptied lab would stop there; {EXPECTED}")


def student(notebook: nbformat.NotebookNode, book: str = "../book") -> nbformat.NotebookNode:
    """A copy for students: solutions emptied, a pointer under each, checks locked as nbgrader reads it, nothing run.

    book : where the book's folder lies, seen from the folder of the copy.

    Raises ValueError that names the cell by its number, counted from 1, and says what was expected.
    """
    edition = nbformat.from_dict(notebook)
    kept: list[list[str]] = []
    taken: list[tuple[int, list[str]]] = []
    pointers, answers = [], set()
    for i, cell in enumerate(edition.cells, 1):
        tags = cell.metadata.get("tags", [])
        lines = lines_of(cell.source)
        try:
            if odd := [tag for tag in tags if "solution" in tag.lower() and tag != TAG]:
                raise ValueError(f"expected the tag {TAG!r}, got {odd[0]!r}")
            if cell.cell_type == "code":
                cell.source, blocks = empty(cell.source), solutions(lines)
            elif TAG in tags or any(SUSPECT.search(line) for line in lines):
                raise ValueError(f"a solution in a {cell.cell_type} cell, which is not emptied; {EXPECTED}")
            else:
                blocks = []
            if TAG in tags and not blocks:
                raise ValueError(f"tagged {TAG!r} and without markers; {EXPECTED}")
        except ValueError as error:
            raise ValueError(f"cell {i}: {error}") from None
        taken += [(i, _words(lines[first + 1 : last])) for first, last in blocks]
        kept.append(_words(lines_of(cell.source)))
        if blocks:
            answers.add(cell.get("id", ""))
            cell.metadata.tags = [tag for tag in tags if tag != TAG]
            checked = i < len(edition.cells) and "check" in edition.cells[i].metadata.get("tags", [])
            pointers.append(i + checked)
    _demand_that_nothing_is_quoted(taken, kept)
    for i in reversed(pointers):
        pointer = nbformat.v4.new_markdown_cell(STUCK, id=f"{edition.cells[i - 1].get('id', i)}-stuck"[-64:])
        edition.cells.insert(i, pointer)
    return graded_cells.mark(readable(edition, book), answers)


def _words(lines: list[str]) -> list[str]:
    """What the lines say: neither indents and blanks, nor comments on lines of their own."""
    said = [re.sub(r"\s+", "", line) for line in lines]
    return [line for line in said if line and not line.startswith("#")]


def _demand_that_nothing_is_quoted(taken: list[tuple[int, list[str]]], kept: list[list[str]]) -> None:
    for number, solution in taken:
        if len("".join(solution)) < TELLING:
            continue
        for other, said in enumerate(kept, 1):
            if any(said[k : k + len(solution)] == solution for k in range(len(said))):
                raise ValueError(f"cell {other}: repeats the solution of cell {number}, and would give it away")


def solved(notebook: nbformat.NotebookNode, book: str = "../book") -> nbformat.NotebookNode:
    """A copy with the solutions in it, folded, and with "(solved)" in its title."""
    edition = nbformat.from_dict(notebook)
    for cell in edition.cells:
        if cell.cell_type == "markdown" and (title := re.search(r"^# .*", cell.source, re.MULTILINE)):
            cell.source = cell.source.replace(title[0], f"{title[0].rstrip()} (solved)", 1)
            break
    return readable(edition, book)


def readable(edition: nbformat.NotebookNode, book: str) -> nbformat.NotebookNode:
    """What both editions share: sources in words, links to the book, folded cells, a version, nothing run."""
    cited: list[str] = []
    for cell in edition.cells:
        if cell.cell_type == "markdown":
            cell.source = citations.spell_out(cell.source, cited).replace("](../book/", f"]({book}/")
    if cited:
        edition.cells.append(nbformat.v4.new_markdown_cell(citations.listed(cited), id="sources"))
    return _signed(clean_notebooks.clean(edition))


def _signed(edition: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """Say which version of the course made the copy: in its metadata, and to ``lab_seed``, which may run as another."""
    for cell in edition.cells:
        if cell.cell_type == "code" and (seed := SEED.search(cell.source)):
            cell.source = SEED.sub(rf'\1, made_by="{__version__}")', cell.source)
            edition.metadata["coursekit"] = {"version": __version__, "lab": int(seed[2])}
    return edition
