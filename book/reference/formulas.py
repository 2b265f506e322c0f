"""The formula sheet: the tables at the labs' ends, gathered on one page that prints on two."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat

from reference.api import lab_number

EQUATION = r"\$\$((?:(?!\$\$).)*)\$\$ *\({}\)"
ALIGNED = re.compile(r"\\begin\{aligned\}(.*?)\\end\{aligned\}", re.S)


def text(path: Path) -> str:
    """All that a lab says in words and formulas."""
    cells = nbformat.read(path, as_version=4).cells
    return "\n\n".join(cell.source for cell in cells if cell.cell_type == "markdown")


def title(path: Path) -> str:
    """A lab's title without its number."""
    found = re.search(r"^# (?:Lab \w+\s*[·:,]\s*)?(.+)$", text(path), re.M)
    return found[1].strip() if found else path.stem


def rows(words: str) -> list[list[str]]:
    """(formula, meaning, when it fails) of each row of the table under *What we learned*."""
    part = words.partition("## What we learned")[2]
    table = re.match(r"\s*\| formula \|.*\n\|[\s|:-]+\n((?:\|.*\n?)+)", part)
    lines = table[1].splitlines() if table else []
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))] for line in lines]


def shown(cell: str, words: str) -> str:
    """A cell of the table: where it only names an equation, the equation itself."""
    if named := re.fullmatch(r"\{eq\}`([^`]+)`", cell):
        equation = re.search(EQUATION.format(re.escape(named[1])), words, re.S)
        if equation is None:
            raise ValueError(f"the table under 'What we learned' names an equation that the lab has not: {named[1]}")
        return f"$\\displaystyle {' '.join(equation[1].split()).strip(' .,').replace('|', chr(92) + 'vert ')}$ {cell}"
    return cell


def pages(labs: list[Path]) -> dict[str, str]:
    """The page ``formulas.md``."""
    blocks = []
    for path in labs:
        words = text(path)
        if table := rows(words):
            lines = [f"| {shown(cells[0], words)} | {cells[1]} | {cells[2]} |" for cells in table]
            head = "| formula | meaning | when it fails |\n| --- | --- | --- |"
            name = f"[Lab {lab_number(path)}](notebooks/{path.name}) {title(path)}"
            blocks.append(f":::{{container}} formula-lab\n**{name}**\n\n{head}\n" + "\n".join(lines) + "\n:::")
    sheet = "::::{container} formula-sheet\n" + "\n\n".join(blocks) + "\n::::\n" if blocks else ""
    return {"formulas.md": f"# Formula sheet\n\n{ABOUT}\n\n{sheet}"}


ABOUT = """Gathered from the tables at the labs' ends. A number in brackets leads to the equation in its lab. What the
letters mean is on the page [Notation](notation.md). Printed, the sheet takes two pages of A4."""
