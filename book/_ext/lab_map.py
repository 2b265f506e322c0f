"""Sphinx extension: the map of the labs on the front page.

    ```{lab-map}
    00_the_world: Dead reckoning, and why not knowing looks like a banana.
    01_pixels_to_landmark: …
    ```

gives a card for each line whose lab exists, with the lab's picture where there is one, so that a line may be
written before its lab is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class LabMap(SphinxDirective):
    """Cards, one for each lab that is in the book."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        cards = []
        for line in filter(str.strip, self.content):
            name, _, words = line.partition(":")
            document = f"notebooks/{name.strip()}"
            if document in self.env.found_docs:
                number = name.strip().split("_")[0].removeprefix("0")  # 0 … 9, and 5b for a second notebook
                cards += [f":::{{grid-item-card}} Lab {number}", f":link: {document}", ":link-type: doc"]
                if (Path(self.env.srcdir) / "images" / f"{name.strip()}.webp").exists():
                    cards += [f":img-top: images/{name.strip()}.webp", f":img-alt: The first picture of Lab {number}"]
                cards += [":class-card: lab-card", "", words.strip(), ":::", ""]
        if not cards:
            return []
        lines = ["::::{grid} 1 2 2 3", ":gutter: 3", "", *cards, "::::"]
        box = nodes.container()
        self.state.nested_parse(StringList(lines, self.env.docname), self.content_offset, box)
        return box.children


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("lab-map", LabMap)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
