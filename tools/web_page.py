"""Markdown to a page that opens from a disk: equations by the MathJax of the lock, nothing from elsewhere."""

from __future__ import annotations

import html
import re
import shutil
from importlib.metadata import distribution
from pathlib import Path

from markdown_it import MarkdownIt
from mdit_py_plugins.dollarmath import dollarmath_plugin

MATHJAX = "sphinx-mathjax-offline/static/mathjax/tex-svg-full.js"
STYLE = Path(__file__).with_name("web_page.css")
LABEL = r"(?:eq-)?(?:lab\d+-)?([\w-]+)"  # of an equation; what it is called where nothing is numbered
SETTINGS = "window.MathJax = {tex: {tags: 'none'}, svg: {fontCache: 'global'}, options: {enableMenu: false}};"


def _mathematics(content: str, how: dict[str, bool]) -> str:
    return f"\\[{html.escape(content)}\\]" if how["display_mode"] else f"\\({html.escape(content)}\\)"


_markdown = MarkdownIt("commonmark", {"html": True}).enable("table")
_markdown.use(dollarmath_plugin, renderer=_mathematics, double_inline=True, allow_labels=True)


def plain(source: str) -> str:
    """Markdown of a lab without what only the book knows: talking links, roles, labels, links to other labs."""
    source = re.sub(r"\[([^\]]+)\]\(#(?:set|read|colour):[^)]*\)", r"\1", source, flags=re.S)
    source = re.sub(r"\[([^\]]+)\]\((?:\.\./book/)?[\w.]+\.(?:ipynb|md)(?:#[\w-]*)?\)", r"\1", source)
    source = re.sub(rf"\{{eq\}}`{LABEL}`", r"(\1)", source)
    source = re.sub(r"[ \t]*\{cite(?::\w+)?\}`[^`]*`", "", source)
    return re.sub(rf"\$\$ *\({LABEL}\)", r"\\tag{\1} $$", source)


def render(source: str) -> str:
    """Markdown with mathematics and tables as HTML."""
    return str(_markdown.render(source))


def table(head: str, *rows: tuple[object, ...]) -> str:
    """A table in Markdown."""
    width = head.count("|") - 1
    lines = [f"| {' | '.join(str(cell).replace('|', '&#124;') for cell in row)} |" for row in rows]
    return "\n".join([head, "|" + " --- |" * width, *lines])


def page(title: str, body: str, *, home: str = "", script: str = "", kind: str = "text") -> str:
    """A whole page; ``home`` leads to the folder that holds mathjax.js."""
    program = f"<script>{script}</script>" if script else ""
    back = f'<nav><a href="{home}index.html">All materials</a></nav>' if kind == "text" and home else ""
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE.read_text("utf-8")}</style>'
        f'<script>{SETTINGS}</script><script defer src="{home}mathjax.js"></script></head>'
        f'<body class="{kind}">{back}<main>{body}</main>{program}</body></html>\n'
    )


def copy_mathjax(folder: Path) -> None:
    """Put the one file that draws equations into a folder."""
    shutil.copy(str(distribution("sphinx-mathjax-offline").locate_file(MATHJAX)), folder / "mathjax.js")
