"""Sphinx extension: exercises, theorems and figures are counted anew on each page.

Sphinx counts them through the whole book when sections have no numbers.  JupyterLab, which sees one lab at a time,
starts at 1; so does the book, with this.
"""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment


def restart(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Number the things of each kind 1, 2, 3 … within a page, in the order that Sphinx found."""
    for kinds in env.toc_fignumbers.values():
        for numbers in kinds.values():
            in_order = sorted(numbers, key=lambda name: numbers[name])
            numbers.update({name: (i,) for i, name in enumerate(in_order, 1)})
    return []


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("env-get-updated", restart, priority=900)  # after Sphinx has counted
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
