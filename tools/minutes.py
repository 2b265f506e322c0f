"""How long a lab takes: computed from what a reader has to read, look at, move and write.

    python tools/minutes.py            a table of all labs
    python tools/minutes.py --write    put the figures into the labs

A lab states its time in one line of *You will be able to*:

    **Time:** core 70 min · going further 20 min · project 60 min.

The rule, in minutes: a word of prose 1/80, a line of visible code 1/5, a displayed equation 1.5, a figure 1,
an explorer or a touched figure 3, an exercise 5 (easy), 8 (medium), 12 (hard) or 16 (open), a line of a project's
solution 1.  Folded text counts half: about every second reader opens it; the table of symbols is not counted.

The weights were fitted to the times that readers new to robotics needed for an earlier edition of labs 0 to 8, from
70 to 195 minutes: the rule meets eight of the nine within a quarter, and gives the easiest half as much again.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
from lab_text import FENCE, directives, labs, parts, prose, tags

WORD, CODE, EQUATION, FIGURE, EXPLORER, BUILD = 1 / 80, 1 / 5, 1.5, 1.0, 3.0, 1.0
EXERCISE = {"easy": 5, "medium": 8, "hard": 12, "open": 16}
FOLDED = 0.5
TABLE = "Symbols of this lab"  # to look things up in, not to read
STATED = re.compile(r"^\*\*Time:\*\* core (\d+) min(?: · going further (\d+) min)?(?: · project (\d+) min)?\.$", re.M)


def lines(source: str) -> int:
    """Lines of code that hold something."""
    return sum(bool(line.strip()) and not line.strip().startswith("#") for line in source.splitlines())


def cell_minutes(cell: nbformat.NotebookNode, project: bool) -> float:
    """What one cell costs a reader."""
    if cell.cell_type == "markdown":
        words = len(prose(cell.source).split())
        folded = [body for title, body in directives(cell.source, "dropdown") if title != TABLE]
        hidden = sum(len(prose(body, folded=True).split()) for body in folded)
        outside = FENCE.sub(lambda m: "" if m["kind"] == "dropdown" else m[0], cell.source)
        equations = len(re.findall(r"\$\$.*?\$\$", outside, re.S))
        exercises = sum(EXERCISE[_difficulty(title)] for title, _ in directives(cell.source, "exercise"))
        return WORD * (words + FOLDED * hidden) + EQUATION * equations + exercises
    if cell.cell_type != "code" or tags(cell) & {"check"}:
        return 0.0
    if "exercise-solution" in tags(cell):
        return BUILD * lines(cell.source) if project else 0.0
    shows = cell.metadata.get("mystnb", {}).get("image") is not None
    code = 0 if tags(cell) & {"hide-input"} else lines(cell.source)
    return CODE * code + FIGURE * shows + EXPLORER * len(re.findall(r"\bexplore\(|\btouch\(", cell.source))


def _difficulty(title: str) -> str:
    found = re.search(r"\b(easy|medium|hard|open)\b", title, re.I)
    if not found:
        raise ValueError(f"exercise {title!r}: expected a difficulty, easy, medium, hard or open")
    return found[1].lower()


def minutes(path: Path) -> tuple[int, int, int]:
    """(core, going further, project), each to five minutes."""
    core = further = project = 0.0
    for part in parts(path):
        spent = sum(cell_minutes(cell, part.project) for cell in part.cells)
        if part.optional:
            further += spent
        elif part.project:
            project += spent
        else:
            core += spent
    return tuple(5 * round(m / 5) for m in (core, further, project))  # type: ignore[return-value]


def line(path: Path) -> str:
    """The line that the lab should hold."""
    core, further, project = minutes(path)
    extra = (f" · going further {further} min" if further else "") + (f" · project {project} min" if project else "")
    return f"**Time:** core {core} min{extra}."


def stated(path: Path) -> str | None:
    """The line that the lab holds, or None."""
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "markdown" and (found := STATED.search(cell.source)):
            return found[0]
    return None


def write(path: Path) -> bool:
    """Put the line right; True when it changed.  Raises ValueError when the lab has no such line."""
    right, notebook = line(path), nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "markdown" and (found := STATED.search(cell.source)):
            if found[0] == right:
                return False
            cell.source = cell.source.replace(found[0], right)
            nbformat.write(notebook, path)
            return True
    raise ValueError(f"{path.name}: expected a line such as {right!r} under 'You will be able to'")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("notebooks", nargs="*", type=Path, help="all labs by default")
    parser.add_argument("--write", action="store_true", help="put the figures into the labs")
    options = parser.parse_args(arguments)
    for path in options.notebooks or labs():
        if options.write and write(path):
            print(f"{path.name}: put right")
        print(f"{path.name:36s} {line(path)}   stated: {stated(path)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
