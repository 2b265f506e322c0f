"""Sphinx extension: the package's docstrings, which are plain text first of all, as reStructuredText.

Lines such as ``dt : seconds, > 0.`` become a list, whether they stand under *Parameters* or under a class; a line may
hold several, with wide gaps between them.  Stars and bars outside code are letters, not markup.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

ENTRY = re.compile(r"^([\w*][^:]{0,60}?) : (.*)$|^(``[^`]+``)  +(.*)$")
GAP = re.compile(r" {3,}(?=[\w*.]+(?:, [\w*.]+)* : )")  # between two entries on one line
SECTION = re.compile(r"^(Parameters|Returns|Attributes|Yields)( \(.*\))?\n-+\n", re.M)
LETTER = re.compile(r"((?!^\* )[*|`]|(?<=\w)_(?=\W|$))", re.M)
MARKED = re.compile(r"(``.*?``|(?<![\w*])\*[A-Za-z](?:[^*`]*[^*`\s])?\*(?![\w*]))", re.S)  # ``code``, *stress*


def _letters(text: str) -> str:
    """Stars, bars and trailing underscores outside ``code`` and *stress* as they are."""
    pieces = MARKED.split(text)
    return "".join(p if i % 2 else LETTER.sub(r"\\\1", p) for i, p in enumerate(pieces))


def _listed(block: str) -> str | None:
    """A block whose first line is an entry, as a list; None for any other."""
    items: list[list[str]] = []
    for line in block.splitlines():
        indented = bool(items) and line.startswith(" ")
        for part in GAP.split(line.strip()):
            if not indented and (found := ENTRY.match(part)):
                items.append([found[3] or f"**{_letters(found[1])}**", found[4] or found[2]])
            elif items:
                items[-1][1] += " " + part
            else:
                return None
    return "\n".join(f"- {name}: {_letters(words)}" for name, words in items)


def restructured(docstring: str) -> str:
    """The docstring with its lists as lists and its letters as letters; examples and tables stay."""
    text = SECTION.sub(r"**\1**\2\n\n", docstring)
    blocks = []
    for block in re.split(r"\n\s*\n", text):
        if block.lstrip().startswith((">>>", "====", "**")):
            blocks.append(block)
        elif (listed := _listed(block)) is not None and not block.startswith(" "):
            blocks.append(listed)
        else:
            blocks.append(_letters(block))
    return "\n\n".join(blocks)


def process(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    lines[:] = [*restructured("\n".join(lines)).splitlines(), ""]


def setup(app: Sphinx) -> dict[str, Any]:
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", process)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
