"""Sphinx extension: what other programs show of a page: its description, and a card for those who pass it on.

A card is a picture of 1200 × 630 pixels with the page's title, its first sentence and, for a lab, its first figure.
Where the site's own address is known (``html_baseurl``) the links are absolute, as the readers of cards want them, the
page for addresses that lead nowhere finds its way back, and a site map is written.
"""

from __future__ import annotations

import html
import re
import textwrap
from pathlib import Path
from typing import Any

from docutils import nodes
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont
from sphinx.application import Sphinx

SIZE, FOLDER = (1200, 630), "_static/cards"
INK, SOFT, BLUE, ORANGE = "#1c2733", "#4b5966", "#0072B2", "#D55E00"
ENOUGH = 60  # characters that say something


def describe(document: nodes.document | None, title: str) -> str:
    """A page in at most 200 characters: its first paragraphs, up to the end of a word."""
    words = ""
    for paragraph in document.findall(nodes.paragraph) if document is not None else ():
        if isinstance(paragraph.parent, nodes.section | nodes.document):
            words = " ".join([words, *paragraph.astext().split()]).strip()
        if len(words) >= ENOUGH:
            break
    return textwrap.shorten(words or title, 200, placeholder=" …")


def _font(size: int, weight: str = "normal") -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(
        font_manager.findfont(font_manager.FontProperties(family="DejaVu Sans", weight=weight)), size
    )


def draw(title: str, words: str, figure: Path | None) -> Image.Image:
    """A page's card."""
    card = Image.new("RGB", SIZE, "white")
    pen = ImageDraw.Draw(card)
    pen.rectangle([0, 0, 18, SIZE[1]], fill=BLUE)
    pen.text((70, 52), "Where Am I?", font=_font(30, "bold"), fill=ORANGE)
    width = 1060
    if figure is not None and figure.exists():
        picture = Image.open(figure).convert("RGB")
        picture.thumbnail((500, 400))
        card.paste(picture, (SIZE[0] - 40 - picture.width, (SIZE[1] - picture.height) // 2))
        width = 560
    lines = textwrap.wrap(title, width // 31)[:4]
    pen.multiline_text((70, 130), "\n".join(lines), font=_font(50, "bold"), fill=INK, spacing=14)
    below = 130 + 66 * len(lines) + 30
    rows = textwrap.wrap(words, width // 15)[: (SIZE[1] - below - 70) // 36]
    pen.multiline_text((70, below), "\n".join(rows), font=_font(24), fill=SOFT, spacing=9)
    return card


def tags(page: dict[str, str], base: str) -> str:
    """The head's elements for a page's ``title``, ``words``, ``name`` and ``card``."""
    address = base + page["name"] + ".html" if base else ""
    said = {
        "og:type": "article", "og:site_name": "Where Am I?", "og:title": page["title"], "og:description": page["words"],
        "og:url": address, "og:image": page["card"], "og:image:width": str(SIZE[0]), "og:image:height": str(SIZE[1]),
        "og:image:alt": f"Card of the page: {page['title']}",
    }  # fmt: skip
    rows = [f'<meta property="{key}" content="{html.escape(value)}">' for key, value in said.items() if value]
    named = {"description": page["words"], "twitter:card": "summary_large_image"}
    return "\n".join([*(f'<meta name="{k}" content="{html.escape(v)}">' for k, v in named.items()), *rows])


def write_page(app: Sphinx, pagename: str, template: str, context: dict[str, Any], document: Any) -> None:
    if app.builder.name != "html":
        return
    base = app.config.html_baseurl.rstrip("/") + "/" if app.config.html_baseurl else ""
    title = html.unescape(re.sub(r"<[^>]+>", "", context.get("title") or "")) or pagename.capitalize()
    words = describe(document, f"{title}: {app.config.html_title} Robot localisation and mapping, lab by lab")
    stem = pagename.removeprefix("notebooks/")
    file = Path(app.outdir) / FOLDER / f"{stem.replace('/', '-')}.jpg"
    file.parent.mkdir(parents=True, exist_ok=True)
    draw(title, words, Path(app.srcdir) / "images" / f"{stem}.webp").save(file, quality=82)
    up = base or "../" * pagename.count("/")
    page = {"title": title, "words": words, "name": pagename, "card": f"{up}{FOLDER}/{file.name}"}
    context["metatags"] = context.get("metatags", "") + tags(page, base)
    if pagename == "404" and base:
        context["metatags"] += f'<base href="{base}">'  # it is shown at any depth


def write_map(app: Sphinx, exception: Exception | None) -> None:
    """The list of pages for search engines."""
    if exception is None and app.builder.name == "html" and app.config.html_baseurl:
        base = app.config.html_baseurl.rstrip("/") + "/"
        rows = "".join(f"<url><loc>{base}{name}.html</loc></url>" for name in sorted(app.env.found_docs - {"404"}))
        text = f'<?xml version="1.0" encoding="UTF-8"?><urlset xmlns="http://www.sitemaps.org/schemas/sitemap/0.9">{rows}</urlset>'
        (Path(app.outdir) / "sitemap.xml").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("html-page-context", write_page)
    app.connect("build-finished", write_map)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
