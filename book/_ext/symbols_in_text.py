"""Sphinx extension: the first use of a symbol in a section opens its entry in the lab's table of symbols.

The table stands folded at the top of each lab (see ``tools/symbols.py``).  On the page, the first ``$r$`` of a section
becomes a button: hover, focus or tap shows "range: distance from the robot to the landmark [m]".  In JupyterLab the
text stays as it is.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
import symbols
from talking import talks


def entries(path: Path) -> dict[str, symbols.Symbol]:
    """A lab's symbols by their letters."""
    return {letter: row for row in symbols.table(path) for letter in row.letters}


def _words(text: str) -> list[nodes.Node]:
    """A cell of the table as nodes: what stands between dollars is mathematics."""
    found: list[nodes.Node] = []
    for i, piece in enumerate(re.split(r"\$([^$]+)\$", text)):
        if piece:
            found.append(nodes.math(piece, piece) if i % 2 else nodes.Text(piece))
    return found


def explain(document: nodes.document, rows: dict[str, symbols.Symbol]) -> None:
    """Give the first use of each symbol in each section its entry."""
    for section in document.findall(nodes.section):
        seen: set[str] = set()
        for formula in list(section.findall(nodes.math)):
            letter, parent = formula.astext().strip(), formula.parent
            inside = formula
            while inside is not None and not isinstance(inside, (nodes.section, nodes.title, nodes.table)):
                inside = inside.parent
            if letter not in rows or letter in seen or inside is not section or talks(formula):
                continue
            seen.add(letter)
            row = rows[letter]
            words = re.sub(r"\s*\(Labs? \d.*?\)", "", row.meaning) + (f" [{row.unit}]" if row.unit else "")
            opened = nodes.raw("", '<span class="symbol" tabindex="0">', format="html")
            told = nodes.raw("", '<span class="symbol-entry" role="note">', format="html")
            closed = nodes.raw("", "</span></span>", format="html")
            at = parent.index(formula)
            parent[at : at + 1] = [opened, formula.deepcopy(), told, *_words(words), closed]


def resolve(app: Sphinx, document: nodes.document, docname: str) -> None:
    path = Path(app.srcdir) / f"{docname}.ipynb"
    if app.builder.format == "html" and path.exists():
        explain(document, entries(path))


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("doctree-resolved", resolve)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
