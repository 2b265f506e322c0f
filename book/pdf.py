"""The whole book as one PDF: every built page, as paper shows it, printed by a headless Chromium.

    python book/pdf.py            from book/_build/html, to book/_build/html/where-am-i.pdf

A chapter is taken from its page after the page's own scripts have run, so formulas are set and drawings are drawn.
Folds are open, an explorer is three of its frames (``print/chapter.js`` says which), links between pages lead through
the document.  The document is printed twice: the first time says on which page each heading stands.
"""

from __future__ import annotations

import argparse
import html
import json
import re
import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

from bs4 import BeautifulSoup

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
import edition

BOOK = Path(__file__).resolve().parent
HTML = BOOK / "_build" / "html"
NAME = "where-am-i.pdf"
BROWSERS = ["chromium", "chromium-browser", "google-chrome"]
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking", "--disable-sync"]
READY = "async () => { await window.MathJax?.startup?.promise; await document.fonts.ready; }"
LOADED = "() => Promise.all([...document.images].map(image => image.decode().catch(() => {})))"


def browser() -> str | None:
    """The Chromium that is installed here; None without one, or without what drives it."""
    try:
        import playwright.sync_api  # noqa: F401
        import pypdf  # noqa: F401
    except ImportError:
        return None
    return next(filter(None, map(shutil.which, BROWSERS)), None)


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address under which this machine, and no other, can see a folder."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, format: str, *words: Any) -> None:
            pass

        def end_headers(self) -> None:  # a draft changes within the second that "Last-Modified" can tell
            self.send_header("Cache-Control", "no-store")
            super().end_headers()

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()


def chapters(site: Path) -> dict[str, str]:
    """The pages in the order of the sidebar, the front page first: name of the file → prefix of its ids."""
    soup = BeautifulSoup((site / "index.html").read_text(encoding="utf-8"), "html.parser")
    links = [link["href"].split("#")[0] for link in soup.select("nav.bd-links a.internal")]
    names = dict.fromkeys(["index.html", *(name for name in links if name.endswith(".html") and "://" not in name)])
    return {name: Path(name).stem for name in names if (site / name).exists()}


def contents(headings: list[dict[str, Any]], pages: list[int]) -> str:
    """The table of contents; ``pages`` are the headings' page numbers, as many."""
    lines = [
        f'<li class="level-{h["level"]}"><a href="#{h["id"]}" data-page="{page or "000"}">'
        f"<span>{html.escape(h['text'])}</span><i></i></a></li>"
        for h, page in zip(headings, pages, strict=True)
        if h["level"] <= 2
    ]
    return f'<section class="contents"><h1>Contents</h1><ol>{"".join(lines)}</ol></section>'


def document(parts: list[dict[str, Any]], pages: list[int], styles: list[str], root: str) -> str:
    """The book as one page of HTML.  ``root`` is where the site lies under the server's address."""
    headings = [h for part in parts for h in part["headings"]]
    heads = ""
    for i, part in enumerate(parts):
        head = json.dumps(part["headings"][0]["text"], ensure_ascii=False)
        heads += f"@page c{i} {{ @top-right {{ content: {head}; font: 8.5pt sans-serif }} }}"
        heads += f'[id="{part["prefix"]}"] {{ page: c{i} }}'
    sheets = "".join(f'<link rel="stylesheet" href="{sheet}">' for sheet in styles)
    title = (
        f'<section class="title-page"><img src="{root}_static/logo.svg" alt=""><h1>Where Am I?</h1>'
        f"<p>Robot localisation and mapping, lab by lab</p>"
        f"<p><small>{html.escape(edition.words())}</small></p></section>"
    )
    return (
        f'<!doctype html><html lang="en" data-theme="light"><head><meta charset="utf-8"><title>Where Am I?</title>'
        f"{sheets}<style>{(BOOK / 'print' / 'print.css').read_text(encoding='utf-8')}{heads}</style></head><body>"
        f"{title}{contents(headings, pages)}{''.join(part['html'] for part in parts)}</body></html>"
    )


def heading_pages(printed: bytes) -> list[int]:
    """The page, counted from 1, of each entry of the outline after the title and the contents."""
    from pypdf import PdfReader

    reader = PdfReader(BytesIO(printed))

    def walk(entries: list[Any]) -> Iterator[int]:
        for entry in entries:
            if isinstance(entry, list):
                yield from walk(entry)
            else:
                yield (reader.get_destination_page_number(entry) or 0) + 1

    return list(walk(reader.outline))[2:]


def renumbered(printed: bytes) -> bytes:
    """Chromium names the parts of a table by how many nodes it has seen so far; here they are counted from 1."""
    names = sorted(set(re.findall(rb"\(node(\d{8})\)", printed)))
    numbers = {name: b"(node%08d)" % i for i, name in enumerate(names, 1)}
    return re.sub(rb"\(node(\d{8})\)", lambda found: numbers[found[1]], printed)


def entries(item: Any) -> Iterator[Any]:
    """The entries of an outline, each before those below it."""
    while item is not None:
        yield item.get_object()
        yield from entries(item.get("/First"))
        item = item.get("/Next")


def finish(printed: bytes, headings: list[str], path: Path) -> int:
    """Write the PDF with the book's name and the commit's date, so that one commit gives one file; → its pages."""
    from pypdf import PdfWriter
    from pypdf.generic import NameObject, TextStringObject

    writer = PdfWriter(clone_from=BytesIO(renumbered(printed)))
    date = edition.date().strftime("D:%Y%m%d%H%M%SZ")
    writer.add_metadata({"/Title": "Where Am I?", "/Author": "The Where Am I? authors", "/Subject": edition.words()})
    writer.add_metadata({"/CreationDate": date, "/ModDate": date})
    # Chromium says the heading at the top of a page twice.
    outline = writer.root_object["/Outlines"].get_object()
    for entry, text in zip(entries(outline["/First"]), ["Where Am I?", "Contents", *headings], strict=True):
        entry[NameObject("/Title")] = TextStringObject(text)
    writer.page_mode = "/UseOutlines"
    writer.write(path)
    return len(writer.pages)


def make(site: Path, path: Path, only: list[str] | None = None) -> int:
    """Print the site into ``path``; ``only`` those pages whose names begin so.  → the number of pages of paper.

    Raises RuntimeError where no Chromium is installed, for a formula that is an error, and for a lost heading.
    """
    from playwright.sync_api import sync_playwright

    if (program := browser()) is None:
        raise RuntimeError(f"expected playwright, pypdf and one of {', '.join(BROWSERS)}: no PDF without them")
    names = {n: p for n, p in chapters(site).items() if not only or p.startswith(tuple(only))}
    with served(site.parent) as root, sync_playwright() as playwright:
        base = f"{root}{site.name}/"
        chromium = playwright.chromium.launch(executable_path=program, args=FLAGS)
        tab = chromium.new_context(bypass_csp=True, color_scheme="light").new_page()
        tab.set_default_timeout(300_000)
        parts, styles = [], {}
        script = (BOOK / "print" / "chapter.js").read_text(encoding="utf-8")
        for name, prefix in names.items():
            tab.goto(urljoin(base, name), wait_until="load")
            tab.evaluate(READY)
            about = {"prefix": prefix, "online": edition.site(), "site": base}
            about["chapters"] = {urljoin(base, n): p for n, p in names.items()}
            parts.append(tab.evaluate(script, about) | {"prefix": prefix})
            if wrong := parts[-1]["wrong"]:
                raise RuntimeError(f"{name}: expected formulas, got {wrong}")
            styles |= dict.fromkeys(tab.eval_on_selector_all("link[rel=stylesheet]", "links => links.map(l => l.href)"))
        draft, count = site.parent / "print.html", sum(len(part["headings"]) for part in parts)
        pages = [0] * count
        for _ in range(2):
            draft.write_text(document(parts, pages, list(styles), f"/{site.name}/"), encoding="utf-8")
            tab.goto(urljoin(root, draft.name), wait_until="load")
            tab.evaluate(LOADED)
            printed = tab.pdf(prefer_css_page_size=True, print_background=True, outline=True, tagged=True)
            pages = heading_pages(printed)
            if len(pages) != count:
                raise RuntimeError(f"expected {count} headings in the outline, got {len(pages)}")
        chromium.close()
    draft.unlink()
    return finish(printed, [h["text"] for part in parts for h in part["headings"]], path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--to", type=Path, default=HTML / NAME)
    parser.add_argument("--only", nargs="+", metavar="PAGE", help="these pages alone, by how their names begin")
    options = parser.parse_args()
    count = make(HTML, options.to, options.only)
    print(f"{options.to}: {count} pages, {options.to.stat().st_size / 1e6:.1f} MB")
