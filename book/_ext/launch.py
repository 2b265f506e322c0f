"""Sphinx extension: each lab can be opened on Binder, on Colab and on a JupyterHub.

All links are made from the repository's address (see ``edition``); without one there are none, and nothing else on a
page changes.  Binder builds the checkout of this edition.  Colab and a hub open the branch ``student``, which holds
the published labs to fill in; their first cell installs the course where it is missing.
"""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import edition
from docutils import nodes  # type: ignore[import-untyped]
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

BRANCH = "student"
HELP = "run_elsewhere"


def binder(repository: str, ref: str, lab: str) -> str:
    """Binder's address for the learner's copy of a lab, ``04_ekf``, at a tag or branch."""
    owner, name = repository.split("/")[-2:]
    return f"https://mybinder.org/v2/gh/{owner}/{name}/{ref}?urlpath=lab/tree/my_labs/{lab}.ipynb"


def colab(repository: str, lab: str) -> str:
    """Colab's address for the published lab to fill in."""
    owner, name = repository.split("/")[-2:]
    return f"https://colab.research.google.com/github/{owner}/{name}/blob/{BRANCH}/{lab}.ipynb"


def hub(address: str, repository: str, lab: str) -> str:
    """The link by which nbgitpuller, on the hub at ``address``, fetches the labs and opens one."""
    name = repository.split("/")[-1]
    where = quote(f"lab/tree/{name}/{lab}.ipynb", safe="")
    return (
        f"{address.rstrip('/')}/hub/user-redirect/git-pull?repo={quote(repository, safe='')}"
        f"&branch={BRANCH}&urlpath={where}"
    )


def buttons(repository: str, ref: str, lab: str, page: str) -> list[dict[str, str]]:
    """What a lab's menu offers.  ``page`` is the address of the page about the three."""
    links = [
        ("Binder", binder(repository, ref, lab), "Your copy of this lab on mybinder.org; nothing is kept there"),
        ("Colab", colab(repository, lab), "This lab on Google Colab"),
        ("JupyterHub", f"{page}#your-hub", "This lab on your own school's hub"),
    ]
    return [
        {"type": "link", "text": text, "url": url, "tooltip": tooltip, "icon": "fas fa-play", "label": f"launch-{text}"}
        for text, url, tooltip in links
    ]


def offer(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:
    """Put the menu beside the download menu of each lab."""
    if page.startswith("notebooks/") and (repository := app.config.course_repository):
        offered = buttons(repository, edition.ref(), Path(page).name, context["pathto"](HELP))
        menu = {
            "type": "group",
            "tooltip": "Run this lab elsewhere",
            "icon": "fas fa-rocket",
            "label": "launch-buttons",
        }
        context["header_buttons"].insert(0, menu | {"buttons": offered})


class HubLinks(SphinxDirective):
    """A form that makes the links for a hub, without a server; a sentence where the repository is not known."""

    def run(self) -> list[nodes.Node]:
        if not (repository := self.config.course_repository):
            words = "This copy of the book was built without the address of a repository, so it can't make the links."
            return [nodes.paragraph("", words)]
        found = sorted(name for name in self.env.found_docs if name.startswith("notebooks/"))
        labs = {name: hub("HUB", repository, Path(name).name).removeprefix("HUB") for name in found}
        rows = "".join(f"<li><a>{escape(Path(name).name)}</a></li>" for name in labs)
        form = (
            '<form class="hub"><label>Your hub\'s address <input type="url" name="hub" required '
            'placeholder="https://hub.example.org"></label> <button>Make the links</button></form>'
            f'<ul class="hub-links" data-paths="{escape(json.dumps(list(labs.values())))}" hidden>{rows}</ul>'
        )
        return [nodes.raw("", form, format="html")]


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_config_value("course_repository", "", "env", str)
    app.add_directive("hub-links", HubLinks)
    app.connect("html-page-context", offer, priority=503)  # after the download menu
    app.add_js_file("editions.js")
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
