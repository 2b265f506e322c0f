"""Sphinx extension: exercises, theorems and figures are counted anew on each page.

Sphinx counts them through the whole book when sections have no numbers.  JupyterLab, which sees one lab at a time,
starts at 1; so does the book, with this.  A reference that leads to another page's equation, figure or exercise says
whose number that is: "Lab 4 (3)".
"""

from __future__ import annotations

import copy
import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment


def resume(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Give Sphinx the numbers that it counted last time: where they are the same, a page need not be written again."""
    env.toc_fignumbers = getattr(env, "counted_through", env.toc_fignumbers)
    return []


def restart(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Number the things of each kind 1, 2, 3 … within a page, in the order that Sphinx found."""
    env.counted_through = copy.deepcopy(env.toc_fignumbers)  # type: ignore[attr-defined]
    for kinds in env.toc_fignumbers.values():
        for numbers in kinds.values():
            in_order = sorted(numbers, key=lambda name: numbers[name])
            numbers.update({name: (i,) for i, name in enumerate(in_order, 1)})
    return []


def say_whose(app: Sphinx, document: nodes.document, docname: str) -> None:
    """Put the lab before a number that is counted on another lab's page."""
    if docname == "formulas":  # where each lab's formulas stand under its name
        return
    for reference in document.findall(nodes.reference):
        lab = re.match(r"(?:.*/)?0?(\d+b?)_\w+\.html#", reference.get("refuri", ""))
        text = reference.astext()
        if lab and re.fullmatch(r"\(\d+\)|(Exercise|Figure|Fig\.) \d+", text):
            last = next(iter(reference.findall(nodes.Text)))
            last.parent.replace(last, nodes.Text(f"Lab {lab[1]} " + last.astext()))


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("env-get-updated", resume, priority=100)  # before Sphinx counts
    app.connect("env-get-updated", restart, priority=900)  # after Sphinx has counted
    app.connect("doctree-resolved", say_whose)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
