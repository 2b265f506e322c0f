"""Sphinx extension: a page with exercises to answer loads what they need, and no other page does."""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx


def load(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:
    """Name the style in a page that offers to answer, and the script in one that has editors."""
    body = context.get("body", "")
    if '<div class="answer"' in body:
        app.add_css_file("answers.css")
    if '<div class="answer-editor"' in body:
        app.add_js_file("answers.js", loading_method="defer")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("html-page-context", load)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
