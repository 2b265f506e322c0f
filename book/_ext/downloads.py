"""Sphinx extension: a lab's download menu offers the lab to fill in and, under a name of its own, the solved lab.

The theme offers the source of each page; ``build.py`` puts both editions where these links lead.
"""

from __future__ import annotations

from typing import Any

from sphinx.application import Sphinx


def offer_both_editions(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:
    """Name the link to the lab's source, and add a second one for the solved lab."""
    if not page.startswith("notebooks/"):
        return
    menus = [button for button in context["header_buttons"] if button.get("label") == "download-buttons"]
    for menu in menus:
        others = [b for b in menu["buttons"] if not b["label"].startswith(("download-notebook", "download-source"))]
        menu["tooltip"] = "Download this lab"
        menu["buttons"] = [
            _link(
                context, page, "Lab to fill in", "This lab as a notebook, with its solutions left out", "fas fa-code"
            ),
            _link(context, f"{page}.solved", "Solved lab", "This lab as a notebook, with its solutions", "fas fa-file"),
            *others,
        ]


def _link(context: dict[str, Any], name: str, text: str, tooltip: str, icon: str) -> dict[str, str]:
    url = context["pathto"](f"_sources/{name}.ipynb", 1)
    label = f"download-{text.replace(' ', '-').lower()}"
    return {"type": "link", "url": url, "text": text, "tooltip": tooltip, "icon": icon, "label": label}


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("html-page-context", offer_both_editions, priority=502)  # after the theme has made its menu
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
