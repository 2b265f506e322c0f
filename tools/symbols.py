"""The labs' tables of symbols: read, compared with each other, and gathered for the notation page.

Each lab opens with a folded table, in *You will be able to*:

    ```{dropdown} Symbols of this lab
    | symbol | meaning | unit | shape |
    | --- | --- | --- | --- |
    | $r$ | range: distance from the robot to the landmark | m | |
    ```

A symbol has one meaning in a lab.  Where it has another one in an earlier lab, its row says so: "(Lab 2: …)".
"""

from __future__ import annotations

import argparse
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
from lab_text import ROOT, directives, labs

NOTATION = ROOT / "book" / "notation.md"
TITLE = "Symbols of this lab"


@dataclass(frozen=True)
class Symbol:
    """One row.  ``symbol`` is LaTeX without its dollars; ``lab`` the name of its notebook."""

    lab: str
    symbol: str
    meaning: str
    unit: str
    shape: str

    @property
    def letters(self) -> list[str]:
        """The symbols of a row that names several, as in $r$, $\\varphi$."""
        return re.findall(r"\$([^$]+)\$", self.symbol)

    @property
    def core(self) -> str:
        """The meaning without what it says of other labs, folded for comparison."""
        return re.sub(r"\s*\(Labs? \d.*?\)", "", self.meaning).strip().lower()


def table(path: Path) -> list[Symbol]:
    """A lab's rows; empty when it has no table.  Raises ValueError for a row without its four columns."""
    rows = []
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type != "markdown":
            continue
        for title, body in directives(cell.source, "dropdown"):
            if title != TITLE:
                continue
            for line in body.splitlines():
                if not line.startswith("|") or re.match(r"^\|[\s|:-]+\|$|^\| *symbol *\|", line):
                    continue
                columns = [c.strip() for c in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
                if len(columns) != 4 or not columns[0].startswith("$") or not columns[1]:
                    raise ValueError(f"{path.name}: expected | $symbol$ | meaning | unit | shape |, got {line!r}")
                rows.append(Symbol(path.stem, *columns))
    return rows


def problems(paths: list[Path]) -> list[str]:
    """What is wrong, in words: a letter with two meanings in a lab, or one that changes its meaning unannounced."""
    found: list[str] = []
    known: dict[str, Symbol] = {}
    for path in paths:
        here: dict[str, Symbol] = {}
        for row in table(path):
            for letter in row.letters:
                if letter in here:
                    found.append(f"{path.stem}: ${letter}$ means both {here[letter].meaning!r} and {row.meaning!r}")
                here[letter] = row
                before = known.get(letter)
                if before and before.core != row.core and f"Lab {int(before.lab[:2])}" not in row.meaning:
                    found.append(
                        f"{path.stem}: ${letter}$ means {row.meaning!r}, and {before.meaning!r} in {before.lab}; "
                        f"say so in the row, as in '(Lab {int(before.lab[:2])}: …)'"
                    )
        known |= here
    return found


def notation(paths: list[Path]) -> str:
    """One table of all labs, in Markdown: each symbol with each of its meanings and the labs that use it."""
    entries: dict[tuple[str, str], tuple[Symbol, list[str]]] = {}
    for path in paths:
        for row in table(path):
            _, used = entries.setdefault((row.symbol, row.core), (row, []))
            used.append(f"[{int(path.stem[:2])}](../notebooks/{path.name})")
    lines = ["| symbol | meaning | unit | shape | labs |", "| --- | --- | --- | --- | --- |"]
    for row, used in entries.values():
        meaning = re.sub(r"\s*\(Labs? \d.*?\)", "", row.meaning)
        lines.append(f"| {row.symbol} | {meaning} | {row.unit} | {row.shape} | {', '.join(used)} |")
    return "\n".join(lines)


def page(text: str, paths: list[Path]) -> str:
    """The notation page with its table written anew between the two comments."""
    begin, end = "<!-- symbols: tools/symbols.py --write -->", "<!-- end of symbols -->"
    before, after = text[: text.index(begin)], text[text.index(end) :]
    return f"{before}{begin}\n\n{notation(paths)}\n\n{after}"


def main(arguments: list[str] | None = None) -> int:
    """Print what is wrong, 1 when something is; with --write, put the notation page right."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="write the notation page's table")
    options = parser.parse_args(arguments)
    if options.write:
        NOTATION.write_text(page(NOTATION.read_text(encoding="utf-8"), labs()), encoding="utf-8")
    wrong = problems(labs())
    print("\n".join(wrong) or "every symbol has one meaning")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
