"""Sphinx extension: the first use of a glossary term in each part of a lab leads to its entry.

The notebooks stay as they are.  On the page a term has a dotted line, its definition as its title, and a link.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from talking import talks

GLOSSARY = "glossary"
# Common words of other meanings, or so frequent that a link each time would be noise.
QUIET = {"arc", "state", "normal", "range", "bearing", "robust", "control", "marginal", "correct", "delay", "fix",
         "predict", "landmark", "pose", "consistent", "closed form", "residual", "first estimates", "bias"}  # fmt: skip
PASSED_OVER = (nodes.title, nodes.reference, nodes.literal, nodes.math, nodes.table, nodes.raw, nodes.literal_block)


def definitions(text: str) -> dict[str, str]:
    """The terms of a glossary in Markdown, each with its definition in plain words."""
    found: dict[str, str] = {}
    body = re.search(r"^```\{glossary\}\n(.*?)^```", text, re.M | re.S)
    for block in re.split(r"\n\s*\n", body[1] if body else ""):
        lines = block.strip("\n").splitlines()
        terms = [line for line in lines if not line.startswith(" ")]
        words = " ".join(line.strip() for line in lines if line.startswith(" "))
        words = re.sub(r"\s*\*?(\[Lab \w+\]\([^)]*\)|Lab \w+)\*?\s*$", "", words)
        found |= dict.fromkeys(terms, words)
    return found


def pattern(terms: dict[str, str]) -> re.Pattern[str]:
    """Any of the terms, the longest first, in the singular or with an s; capitals count only where there are two."""
    spelled = [
        re.escape(term) if re.search(r"[A-Z].*[A-Z]", term) else f"(?i:{re.escape(term)})"
        for term in sorted(terms, key=len, reverse=True)
        if term not in QUIET
    ]
    return re.compile(rf"(?<![\w-])({'|'.join(spelled)})(?:s\b|(?![\w-]))") if spelled else re.compile(r"(?!)")


def _texts(section: nodes.section) -> list[nodes.Text]:
    """The running text of a part, in order, without titles, code, formulas, tables, links and what talks to figures."""
    found = []
    for text in section.findall(nodes.Text):
        above, fits = text.parent, False
        while above is not None and above is not section and not isinstance(above, PASSED_OVER):
            fits = fits or isinstance(above, nodes.paragraph)
            above = above.parent
        if fits and above is section and not talks(text):
            found.append(text)
    return found


def link(document: nodes.document, terms: dict[str, str], address: dict[str, str]) -> None:
    """Link the first use of each term in each part of a lab; ``address`` leads from a term to its entry."""
    names, any_term = {term.lower(): term for term in terms}, pattern(terms)
    for part in document.findall(nodes.section):
        if not isinstance(part.parent, nodes.section) or isinstance(part.parent.parent, nodes.section):
            continue  # a part is a heading of the second level
        seen: set[str] = set()
        for text in _texts(part):
            pieces: list[nodes.Node] = []
            at, whole = 0, text.astext()
            for found in any_term.finditer(whole):
                term = names[found[1].lower()]
                if terms[term] in seen or term not in address:
                    continue
                seen.add(terms[term])
                entry = nodes.reference(
                    "", found[0], refuri=address[term], internal=True, reftitle=terms[term], classes=["term"]
                )
                pieces += [nodes.Text(whole[at : found.start()]), entry]
                at = found.end()
            if pieces:
                text.parent.replace(text, [p for p in [*pieces, nodes.Text(whole[at:])] if p.astext()])


def resolve(app: Sphinx, document: nodes.document, docname: str) -> None:
    if app.builder.format != "html" or not docname.startswith("notebooks/") or GLOSSARY not in app.env.found_docs:
        return
    terms = definitions(Path(app.env.doc2path(GLOSSARY)).read_text(encoding="utf-8"))
    page = app.builder.get_relative_uri(docname, GLOSSARY)
    objects = app.env.domaindata["std"]["objects"]
    address = {term: f"{page}#{objects['term', term][1]}" for term in terms if ("term", term) in objects}
    link(document, terms, address)


def labs_follow_the_glossary(
    app: Sphinx, env: BuildEnvironment, added: set[str], changed: set[str], removed: set[str]
) -> list[str]:
    """When the glossary has changed, the labs' links to it are made anew."""
    return [name for name in env.found_docs if name.startswith("notebooks/")] if GLOSSARY in added | changed else []


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("doctree-resolved", resolve)
    app.connect("env-get-outdated", labs_follow_the_glossary)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
