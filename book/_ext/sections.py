"""Sphinx extension: the book's search finds sections, by the words that readers use.

A section's entry holds its heading and its prose; code, printed output and tables of versions are left out.
``_static/search.js`` weighs the entries in the reader's browser.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx

SILENT = (
    nodes.literal_block,
    nodes.doctest_block,
    nodes.raw,
    nodes.comment,
    nodes.math_block,
    nodes.image,
    nodes.title,
    nodes.target,
)
LAST = {"bibliography"}  # whose hits come after all others
# What readers ask for, and the words that the course has for it.
SYNONYMS = {
    "overconfident": "too sure nees inconsistent", "overconfidence": "too sure nees inconsistent",
    "consistency": "nees nis honest", "inconsistent": "nees too sure", "underconfident": "too wide nees",
    "slam": "localise and map at once", "data association": "which landmark gate mahalanobis joint compatibility",
    "association": "which landmark gate mahalanobis", "mcl": "particle filter",
    "nees": "normalised estimation error squared", "nis": "normalised innovation squared",
    "monte carlo localisation": "particle filter",
    "monte carlo localization": "particle filter", "localization": "localise localisation",
    "odometry": "dead reckoning wheels", "scan matching": "icp clouds", "registration": "icp clouds",
    "kidnapped": "anywhere lost carried", "outlier": "gate refused rejected trim", "kalman": "kalman filter",
    "depth": "range distance", "camera": "pinhole pixels camera", "feature matching": "sift ransac match",
    "loop closure": "closes loop seen again", "degeneracy": "corridor information",
}  # fmt: skip


def words(node: nodes.Node) -> Iterator[str]:
    """The prose of a node, without what stands in a section below it."""
    for child in node.children:
        if isinstance(child, (*SILENT, nodes.section)):
            continue
        if isinstance(child, nodes.container) and "cell" in child.get("classes", []):
            continue
        if isinstance(child, pending_xref) and child.get("refdomain") == "cite":
            continue
        if isinstance(child, nodes.math):
            yield child.astext() if child.astext().isalnum() else "…"
        elif isinstance(child, nodes.Text):
            yield child.astext()
        else:
            yield from words(child)
            if isinstance(child, nodes.paragraph | nodes.list_item | nodes.entry | nodes.definition):
                yield " "


def entries(name: str, document: nodes.document) -> Iterator[list[str]]:
    """Each section as [page, anchor, heading, page's heading, prose]."""
    top = ""
    for section in document.findall(nodes.section):
        title = section.next_node(nodes.title)
        if title is None or title.parent is not section:
            continue
        heading = title.astext()
        anchor = section["ids"][0] if top else ""
        top = top or heading
        yield [name, anchor, heading, top, " ".join("".join(words(section)).split())]


def write_index(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.name == "html":
        names = sorted(app.env.found_docs - {"404"})
        rows = [row for name in names for row in entries(name, app.env.get_doctree(name))]
        index = {"sections": rows, "synonyms": SYNONYMS, "last": sorted(LAST)}
        text = f"window.bookIndex = {json.dumps(index, ensure_ascii=False, separators=(',', ':'))};\n"
        (Path(app.outdir) / "_static" / "search-index.js").write_text(text, encoding="utf-8")


def add_search(app: Sphinx, pagename: str, template: str, context: dict[str, Any], document: Any) -> None:
    if pagename == "search":
        app.add_js_file("search-index.js")
        app.add_js_file("search.js")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("html-page-context", add_search)
    app.connect("build-finished", write_index)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
