"""Sphinx extension: text that sets an explorer, reads from it, and has its colours.  All three are links in Markdown:

    [make R sixteen times too small](#set:tuning?r_scale=1/16)     a button; it keeps the focus
    [92 %](#read:tuning?nees)                                      a fact of the frame that is shown now
    the [truth](#colour:truth)                                     a word in the colour of what it names

so a notebook still reads well where nobody knows about them.  The build warns, and so fails, when a page has no such
explorer, a value is off its grid, a fact or a colour has another name, or the text of a fact is not what the explorer
says at its start.
"""

from __future__ import annotations

import html
import json
import re
from fractions import Fraction
from typing import Any

from docutils import nodes  # type: ignore[import-untyped]
from matplotlib.colors import to_hex, to_rgb
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util import logging

from coursekit.teaching import plotting

logger = logging.getLogger(__name__)
LINK = re.compile(r"#(set|read|colour):(\w+)(?:\?(.+))?")
MARK = re.compile(r'<says data-link="([^"]*)">(.*?)</says>', re.DOTALL)  # a tag of its own: formulas are full of spans
EXPLORER = re.compile(
    r'<div class="explorer" [^>]*data-explorer="(\w+)".*?class="explorer-data">(.*?)</script>', re.DOTALL
)
COLOURS = {
    "truth": plotting.TRUTH,
    "estimate": plotting.ESTIMATE,
    "measurement": plotting.MEASUREMENT,
    "odometry": plotting.ODOMETRY,
    "prediction": plotting.PREDICTION,
    "band": plotting.BAND,
    "highlight": plotting.HIGHLIGHT,
}
PAPER, NIGHT = "#ffffff", "#121212"  # what the theme puts behind its text
READABLE = 4.6  # WCAG asks for a ratio of 4.5


def talks(node: nodes.Node) -> bool:
    """Whether a node stands among the words that set a figure or read from it; a link there would lie in a button."""
    for before in reversed(node.parent[: node.parent.index(node)]):
        if isinstance(before, nodes.raw) and before.astext().startswith(("<says", "</says")):
            return before.astext().startswith("<says")
    return False


def luminance(colour: str) -> float:
    """WCAG's relative luminance."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(colour: str, behind: str) -> float:
    """WCAG's contrast ratio, 1 to 21."""
    dark, light = sorted([luminance(colour), luminance(behind)])
    return (light + 0.05) / (dark + 0.05)


def readable(colour: str, behind: str) -> str:
    """The colour, mixed with black or white until it can be read."""
    towards = 0.0 if luminance(behind) > 0.5 else 1.0
    for k in range(21):
        mixed = to_hex([c + k / 20 * (towards - c) for c in to_rgb(colour)])
        if contrast(mixed, behind) >= READABLE:
            return mixed
    raise AssertionError("black and white can be read on any paper")


class FindLinks(SphinxTransform):
    """Mark the links before anything looks for their targets."""

    default_priority = 800  # MyST resolves anchors at 879

    def apply(self, **options: Any) -> None:
        for link in list(self.document.findall(nodes.reference)):
            if LINK.fullmatch(link.get("refuri", "")):
                says = html.escape(link["refuri"], quote=True)
                opening = nodes.raw("", f'<says data-link="{says}">', format="html")
                link.parent[(i := link.parent.index(link)) : i + 1] = [
                    opening, *link.children, nodes.raw("", "</says>", format="html")
                ]  # fmt: skip


def position(value: str, values: list[Any], texts: list[str]) -> int:
    """Where a value, as the author wrote it, stands on the grid.  Raises ValueError when it does not."""

    def number(text: Any) -> Fraction | None:
        try:
            return Fraction(str(text))
        except (ValueError, ZeroDivisionError):
            return None

    for i, (v, text) in enumerate(zip(values, texts, strict=True)):
        if value in (str(v), text) or (number(value) is not None and number(value) == number(v)):
            return i
    raise ValueError(f"{value} is not among {', '.join(map(str, values))}")


def button(name: str, settings: str, text: str, data: dict[str, Any]) -> str:
    positions = {}
    for setting in settings.split("&"):
        parameter, _, value = setting.partition("=")
        if parameter not in data["names"]:
            raise ValueError(f"the explorer {name!r} has no {parameter!r}, but {', '.join(data['names'])}")
        i = data["names"].index(parameter)
        positions[parameter] = position(value, data["values"][i], data["texts"][i])
    says = html.escape(json.dumps(positions), quote=True)
    # Not a <button>: that is one box, and the phrase has to break across lines like the text that it is part of.
    attributes = f'class="explorer-set" data-sets="{name}" data-positions="{says}"'
    return f'<span role="button" tabindex="0" {attributes}>{text}</span>'


def fact(name: str, key: str, text: str, data: dict[str, Any]) -> str:
    facts = data["facts"][data["first"]]
    if key not in facts:
        raise ValueError(f"the explorer {name!r} knows no {key!r}, but {', '.join(facts) or 'nothing'}")
    if html.unescape(text) != facts[key]:
        raise ValueError(f"the text says {text!r}, the explorer {name!r} begins with {facts[key]!r}")
    return f'<span class="explorer-read" data-reads="{name}" data-fact="{key}">{text}</span>'


def word(name: str, text: str) -> str:
    if name not in COLOURS:
        raise ValueError(f"no colour is called {name!r}, but {', '.join(COLOURS)}")
    inks = {"day": readable(COLOURS[name], PAPER), "night": readable(COLOURS[name], NIGHT), "own": COLOURS[name]}
    return f'<span class="ink" style="{";".join(f"--{k}:{v}" for k, v in inks.items())}">{text}</span>'


def talk(body: str, complain: Any) -> str:
    """The page with its marks turned into buttons, facts and coloured words; ``complain`` hears what is wrong."""
    explorers = {name: json.loads(data) for name, data in EXPLORER.findall(body)}

    def turn(match: re.Match[str]) -> str:
        says, text = html.unescape(match[1]), match[2]
        found = LINK.fullmatch(says)
        assert found, "FindLinks marks nothing else"
        kind, name, rest = found.groups()
        try:
            if kind == "colour":
                return word(name, text)
            if name not in explorers:
                raise ValueError(
                    f"this page has no explorer {name!r}, but {', '.join(explorers) or 'none with a name'}"
                )
            return {"set": button, "read": fact}[kind](name, rest or "", text, explorers[name])
        except ValueError as error:
            complain(f"[{text}]({says}): {error}")
            return text

    return MARK.sub(turn, body)


def write_page(app: Sphinx, pagename: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    if "<says " in context.get("body", ""):
        context["body"] = talk(context["body"], lambda words: logger.warning(words, location=pagename))


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_transform(FindLinks)
    app.connect("html-page-context", write_page)
    app.add_js_file("talking.js")
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
