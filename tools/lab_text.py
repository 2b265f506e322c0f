"""A lab taken apart: its parts, its prose, its questions, its symbols.  What the other tools and the tests count."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import nbformat

ROOT = Path(__file__).resolve().parents[1]
FENCE = re.compile(
    r"^(?P<mark>`{3,}|:{3,})(?P<head>\{(?P<kind>[\w:-]+)\}[^\n]*)\n(?P<body>.*?)^(?P=mark)[ \t]*$", re.M | re.S
)
DISPLAY = re.compile(r"\$\$.*?\$\$", re.S)
HEADING = re.compile(r"^## (?:\d+\. )?(.+)$", re.M)


@dataclass
class Part:
    """One second-level part of a lab: its heading, and its cells in order."""

    heading: str
    cells: list[nbformat.NotebookNode] = field(default_factory=list)

    @property
    def optional(self) -> bool:
        """Is it marked as *Going further*?"""
        return self.heading.lower().startswith("going further")

    @property
    def project(self) -> bool:
        """Is it the lab's project?"""
        return self.heading.lower().startswith("project")


def labs() -> list[Path]:
    """The notebooks, in order."""
    return sorted((ROOT / "notebooks").glob("[0-9][0-9]*.ipynb"))


def parts(path: Path) -> list[Part]:
    """A lab's parts.  A cell that holds a heading in its middle belongs to the part that it opens."""
    found = [Part("")]
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "markdown":
            for heading in HEADING.findall(FENCE.sub("", cell.source)):
                found.append(Part(heading))
        found[-1].cells.append(cell)
    return found


def tags(cell: nbformat.NotebookNode) -> set[str]:
    """A cell's tags."""
    return set(cell.metadata.get("tags", []))


def directives(source: str, kind: str) -> list[tuple[str, str]]:
    """(title, body) of each directive of a kind in a markdown cell, as in ```` ```{dropdown} title ````."""
    return [(m["head"].partition("}")[2].strip(), m["body"]) for m in FENCE.finditer(source) if m["kind"] == kind]


def prose(source: str, folded: bool = False) -> str:
    """The words of a markdown cell: no display equations, no fences' marks; what is folded only when asked for."""
    if not folded:
        source = FENCE.sub(lambda m: "" if m["kind"] == "dropdown" else m[0], source)
    source = DISPLAY.sub(" ", source)
    source = re.sub(r"^(`{3,}|:{3,}).*$|^:\w+:.*$|^\(\S+\)=$", "", source, flags=re.M)
    return re.sub(r"\{[\w:-]+\}`[^`]*`", " ", source)
