"""The last step of the build: each page that Sphinx wrote is made valid, light and closed to other sites.

* Formulas are typeset here, once, where Node.js is found; elsewhere each reader's browser does it, as MathJax is made.
* The theme's icon font and its script (1.7 MB) become a few inline drawings.
* What the theme and the extensions leave invalid, or closed to a screen reader, is mended.
* A content security policy lets a page run its own scripts and nobody else's.

A page that carries a policy has been finished, and is left alone.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import shutil
import subprocess
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from urllib.parse import quote

import pictures

TYPESETTER = Path(__file__).with_name("typeset.js")
FINISHED = '<meta http-equiv="Content-Security-Policy"'

# --- formulas ----------------------------------------------------------------------------------------------

FORMULA = re.compile(
    r'(?P<open><(?P<tag>span|div) class="math[^>]*>(?:\s*<span class="eqno">.*?</span>)?)\s*'
    r"\\(?P<kind>[(\[])(?P<tex>.*?)\\[)\]](?P<close>\s*</(?P=tag)>)",
    re.DOTALL,
)
MATHJAX = re.compile(
    r'\s*<script>window\.MathJax = .*?</script>|\s*<script defer="defer" src="[^"]*tex-svg[^"]*"></script>'
)


def typeset(pages: dict[Path, str], mathjax: Path) -> dict[Path, str]:
    """The pages with their formulas as drawings; as they are where there is no Node.js.

    Raises ValueError for a formula that MathJax does not understand.
    """
    node = shutil.which("node") or shutil.which("nodejs")
    if node is None:
        return pages
    asked = [
        [{"tex": html.unescape(m["tex"]), "display": m["kind"] == "["} for m in FORMULA.finditer(page)]
        for page in pages.values()
    ]
    done = subprocess.run(
        [node, str(TYPESETTER), str(mathjax)], input=json.dumps(asked), capture_output=True, text=True, encoding="utf-8"
    )
    if done.returncode:
        raise ValueError(done.stderr)
    answer = json.loads(done.stdout)
    finished = {}
    for (path, page), drawn in zip(pages.items(), answer["pages"], strict=True):
        formulas = iter(drawn["formulas"])
        page = FORMULA.sub(lambda m, each=formulas: m["open"] + next(each) + m["close"], page)
        if drawn["formulas"]:
            page = page.replace("</head>", f"<style>{answer['style']}</style></head>", 1)
            page = re.sub(r"<body[^>]*>", lambda m, shapes=drawn["shapes"]: m[0] + shapes, page, count=1)
        finished[path] = MATHJAX.sub("", page)
    return finished


# --- icons -------------------------------------------------------------------------------------------------

ICON = re.compile(r'<(i|span)\s+class="(?P<classes>[^"]*\bfa-[^"]*)"(?P<others>[^>]*)>\s*</\1>')
# The theme puts these before titles and links by its font; the colours can be read on white and on black.
BESIDE_WORDS = {
    "admonition-default": ("bell", "#4f86c6"), "admonition-note": ("circle-info", "#4f86c6"),
    "admonition-attention": ("circle-exclamation", "#c46a1f"),
    "admonition-caution": ("triangle-exclamation", "#c46a1f"),
    "admonition-warning": ("triangle-exclamation", "#c46a1f"), "admonition-danger": ("triangle-exclamation", "#d0453f"),
    "admonition-error": ("circle-xmark", "#d0453f"), "admonition-hint": ("lightbulb", "#3a9455"),
    "admonition-tip": ("lightbulb", "#3a9455"), "admonition-important": ("circle-exclamation", "#8a6fd1"),
    "admonition-seealso": ("share", "#3a9455"), "admonition-todo": ("pencil", "#808080"),
    "external-link": ("arrow-up-right-from-square", "#808080"), "download": ("download", "#808080"),
    "search-minus": ("magnifying-glass-minus", "#808080"), "breadcrumb": ("angle-right", "#808080"),
}  # fmt: skip


class Icons:
    """Font Awesome's drawings by name, read from the script that the theme brings."""

    def __init__(self, script: str) -> None:
        self.script = script
        self.find = cache(self._find)

    def _find(self, name: str) -> tuple[int, int, str]:
        """Width, height and path.  Raises ValueError for a name that is not there."""
        shape = r"\[(\d+),(\d+),\[[^\]]*\],\"\w+\",\"([^\"]+)\"\]"
        found = re.findall(rf'[{{,]"?{re.escape(name)}"?:{shape}', self.script)
        if not found:  # an older name of it stands in the list of the newer one
            found = re.findall(
                rf"\[(\d+),(\d+),\[[^\]]*\"{re.escape(name)}\"[^\]]*\],\"\w+\",\"([^\"]+)\"\]", self.script
            )
        if not found:
            raise ValueError(f"the theme has no icon {name!r}")
        width, height, path = found[-1]  # brands first, then the outlined ones, then the solid ones
        return int(width), int(height), path

    def inline(self, match: re.Match[str]) -> str:
        """An icon's empty element as a drawing with the same classes."""
        classes = match["classes"].split()
        sizes = {"fa-lg", "fa-fw", "fa-sm", "fa-xs", "fa-solid", "fa-brands", "fa-regular"}
        name = next(c for c in classes if c.startswith("fa-") and c not in sizes)
        width, height, path = self.find(name.removeprefix("fa-"))
        says = " ".join(c for c in [*classes, "icon"] if c not in {"fas", "fab", "far", "fa-solid", "fa-brands"})
        others = re.sub(r'\s*title="[^"]*"', "", match["others"])  # a drawing that is hidden has no title
        return (
            f'<svg class="{says}"{others} viewBox="0 0 {width} {height}" aria-hidden="true">'
            f'<path fill="currentColor" d="{path}"/></svg>'
        )

    def style(self) -> str:
        """A style sheet that puts drawings where the theme's style sheet would put letters of its icon font."""
        rules = []
        for place, (name, colour) in BESIDE_WORDS.items():
            width, height, path = self.find(name)
            drawing = (
                f"<svg xmlns='http://www.w3.org/2000/svg' width='16' height='16' viewBox='0 0 {width} {height}'>"
                f"<path fill='{colour}' d='{path}'/></svg>"
            )
            variable = "--pst-breadcrumb-divider" if place == "breadcrumb" else f"--pst-icon-{place}"
            rules.append(f'{variable}:url("data:image/svg+xml,{quote(drawing, safe=" =:/")}")')
        return ":root{--fa-font-solid:1em/1 sans-serif;" + ";".join(rules) + "}\n"


# --- validity, and what a screen reader hears ----------------------------------------------------------------

SUMMARY = re.compile(r"(<summary)([^>]*)(>)(.*?)(</summary>)", re.DOTALL)
STYLE = re.compile(r"<style>.*?</style>", re.DOTALL)
FOLD = re.compile(r'(<a class="[^"]*reference internal" href="[^"]*">)([^<]*)(</a><details[^>]*>)<summary>')
VIEWPORT = re.compile(r'\s*<meta name="viewport"[^>]*>')
# A formula is a box, and a browser may begin a line after any box, with a full stop if need be.
MATH = r'<span class="math[^>]*>(?:(?!</?span\b).)*</span>'
ENTRY = rf'<span class="symbol-entry"[^>]*>(?:(?!</?span\b).|{MATH})*</span>'
WITH_ENTRY = rf'<span class="symbol"[^>]*>{MATH}{ENTRY}</span>'
FORMULA_IN_TEXT = re.compile(rf"([(\[“]*)({WITH_ENTRY}|{MATH})([.,;:!?)\]’”]*)", re.DOTALL)
CELL = re.compile(r"<(t[dh])\b.*?</\1>", re.DOTALL)
LITERAL = re.compile(r'<code class="[^"]*\bliteral\b.*?</code>', re.DOTALL)


def _summary(match: re.Match[str]) -> str:
    attributes = match[2].replace(' aria-label="Toggle hidden content"', "")  # it would hide "Show the solution"
    words = re.sub(r"<(/?)p\b", r"<\1span", match[4])
    return match[1] + attributes + match[3] + words + match[5]


def _kept(formula: re.Match[str]) -> str:
    """A formula together with the bracket before it and the sign after it."""
    return f'<span class="kept">{formula[0]}</span>' if formula[1] or formula[3] else formula[0]


def _foldable(name: re.Match[str]) -> str:
    """A name that is too long for its column goes on after an underscore, a point or a bracket, not within a word."""
    return re.sub(r"(?<=\w)([_.(])(?=\w[^<>]*<)", r"\1<wbr>", name[0])


def mend(page: str) -> str:
    """The page as valid HTML whose parts have names."""
    first = VIEWPORT.search(page)
    if first:
        page = VIEWPORT.sub("", page)
        page = page.replace("</title>", f"</title>{first[0]}", 1)
    page = re.sub(r"<title>\s*(.*?) &#8212; \1\s*</title>", r"<title>\1</title>", page)
    page = FOLD.sub(r'\1\2\3<summary aria-label="Pages of: \2">', page)
    page = SUMMARY.sub(_summary, page)
    # Every exercise's body has the same id, and nothing leads to it.
    page = re.sub(r'<section id="(?:exercise|solution|proof)-content">', "<section>", page)
    page = page.replace('<div role="list" class="citation-list">', '<div class="citation-list">')
    page = page.replace(' role="doc-biblioentry"', "")
    page = re.sub(r'<th class="head">\s*(?:<p>\s*</p>)?\s*</th>', '<td class="head"></td>', page)
    page = page.replace(
        '<div id="pst-primary-sidebar" ', '<div id="pst-primary-sidebar" role="region" aria-label="The book" '
    )
    page = re.sub(r'(<button class="btn search-button-field[^>]*?) aria-label="Search"', r"\1", page)
    page = FORMULA_IN_TEXT.sub(_kept, page)
    page = CELL.sub(lambda cell: LITERAL.sub(_foldable, cell[0]), page)
    page = page.replace("\\_", "_") if "doi.org" in page and re.search(r'href="[^"]*\\_', page) else page
    return _single_ids(_gather_styles(page))


def _gather_styles(page: str) -> str:
    """A style sheet that came with a figure stands in the head, once."""
    head, end, body = page.partition("</head>")
    styles = dict.fromkeys(STYLE.findall(body))
    return head + "".join(styles) + end + STYLE.sub("", body)


def _single_ids(page: str) -> str:
    """An id that comes again gets a number: a link leads to the first one, as it did."""
    seen: dict[str, int] = {}

    def count(match: re.Match[str]) -> str:
        seen[match[2]] = n = seen.get(match[2], 0) + 1
        return match[0] if n == 1 else f'{match[1]}id="{match[2]}-{n}"'

    return re.sub(r'(<[a-zA-Z][\w-]*\s(?:[^<>"]*"[^"]*")*?[^<>"]*?)\bid="([^"]+)"', count, page)


THEIR_SEARCH = re.compile(
    r'\s*<script[^>]* src="[^"]*(?:searchtools|language_data|searchindex)\.js[^"]*"[^>]*></script>'
)
BLOCKING = re.compile(r'<script(?P<others>[^>]*) src="(?P<at>[^"]*)"(?P<more>[^>]*)></script>')


def hasten(page: str) -> str:
    """The page without the theme's search (``_ext/sections.py`` is ours); its scripts run in order once it is read."""

    def defer(match: re.Match[str]) -> str:
        if "defer" in match[0] or "documentation_options" in match["at"]:  # inline scripts write into its object
            return match[0]
        return match[0].replace("<script", "<script defer", 1)

    page = THEIR_SEARCH.sub("", page)
    head, end, body = page.partition("</head>")
    return BLOCKING.sub(defer, head) + end + body


# --- the policy ----------------------------------------------------------------------------------------------

SCRIPT = re.compile(r"<script(?![^>]*\bsrc=)(?![^>]*type=\"(?!text/javascript|module))[^>]*>(.*?)</script>", re.DOTALL)
HANDLER = re.compile(r'\son(?:click|submit|change|input)="([^"]*)"')


def _digest(script: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() + "'"


def policy(page: str) -> str:
    """What a page may do: run the site's files, WebAssembly, and its own inline scripts, known by their digests."""
    scripts = sorted({_digest(text) for text in SCRIPT.findall(page) if text})
    handlers = sorted({_digest(html.unescape(text)) for text in HANDLER.findall(page)})
    inline = [*scripts, *(["'unsafe-hashes'", *handlers] if handlers else [])]
    return "; ".join(
        [
            "default-src 'self'",
            " ".join(["script-src 'self' 'wasm-unsafe-eval'", *inline]),
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "font-src 'self' data:",
            "worker-src 'self' blob:",
            "object-src 'none'",
            "base-uri 'self'",
            "form-action 'self'",
        ]
    )


def close(page: str) -> str:
    """The page with its policy, as early as a policy can stand."""
    return re.sub(
        r'(<meta charset="utf-8"\s*/?>)', lambda m: f'{m[1]}{FINISHED} content="{policy(page)}">', page, count=1
    )


# --- all of it -----------------------------------------------------------------------------------------------


def pages(folder: Path) -> Iterable[Path]:
    """Every page of the site, the theme's own snippets left out."""
    return (path for path in sorted(folder.rglob("*.html")) if "_static" not in path.relative_to(folder).parts)


def finish(folder: Path, mathjax: Path) -> int:
    """Finish the pages that are new since the last time; how many there were.

    Raises ValueError for a formula or an icon that is not known.
    """
    texts = {path: path.read_text(encoding="utf-8") for path in pages(folder)}
    new = {path: text for path, text in texts.items() if FINISHED not in text}
    if not new:
        return 0
    icons = Icons((folder / "_static" / "scripts" / "fontawesome.js").read_text(encoding="utf-8"))
    (folder / "_static" / "icons.css").write_text(icons.style(), encoding="utf-8")
    for path, page in pictures.lighten(typeset(new, mathjax), folder).items():
        page = re.sub(
            r'\s*<!-- So that users can add custom icons -->|\s*<script defer src="[^"]*fontawesome\.js[^>]*></script>',
            "",
            page,
        )
        page = close(hasten(mend(ICON.sub(icons.inline, page))))
        path.write_text(page, encoding="utf-8")
    return len(new)
