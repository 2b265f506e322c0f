"""Slides of a lab, from its own headlines, equations, figures and sliders, as one page that needs no network.

What becomes a slide: the title; each heading with the first sentences below it and the questions of its cell, their
answers folded; each displayed equation; each picture and each interactive figure, whole; the table of *What we
learned*; the exercises' titles and the project's rubric.  A sentence stands with the equations
or the figure after it.
Page Down and the arrow keys go on; in a slider, the arrow keys move the slider.
"""

from __future__ import annotations

import html
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
import teaching
from lab_text import DISPLAY, FENCE, directives, prose, tags
from web_page import page, plain, render, table

WORDS = 65  # of a paragraph on a slide; a longer one is cut after a sentence
ITEM = re.compile(r"\s*(?:[-*]|\d+\.) ")
INTERACTIVE = re.compile(r'\s*<div class="(?:explorer|guess|touch)')
KEYS = """
const slides = [...document.querySelectorAll('section')];
addEventListener('keydown', event => {
  const step = {ArrowRight: 1, ArrowLeft: -1}[event.key];
  if (!step || event.target.closest('input, select, button, svg, summary')) return;
  const here = slides.findLastIndex(slide => slide.getBoundingClientRect().top < innerHeight / 2);
  slides[Math.min(Math.max(here + step, 0), slides.length - 1)].scrollIntoView();
  event.preventDefault();
});
"""


def sentences(paragraph: str, words: int = WORDS) -> str:
    """The first sentences of a paragraph, whole, with ``words`` words or a little less; one sentence at least."""
    found = re.split(r"(?<=[.?!]) (?=[A-Z*$“])", " ".join(paragraph.split()))
    said = found[0]
    for sentence in found[1:]:
        if len(f"{said} {sentence}".split()) > words:
            break
        said = f"{said} {sentence}"
    return said


@dataclass
class Slide:
    """A heading, and below it pieces of HTML: sentences of so many words, then equations or one figure."""

    heading: str
    pieces: list[str]
    words: int = 0
    figure: str = ""  # or "picture", or "interactive"

    def takes(self, other: Slide) -> bool:
        """May the next slide's pieces stand on this one?  An interactive figure needs all the room that there is."""
        if self.heading != other.heading or self.figure or other.words or other.figure == "interactive":
            return False
        return len(self.pieces) < (2 if other.figure else 3) and self.words <= (WORDS if not other.figure else 45)

    def html(self) -> str:
        """The inside of the slide's section."""
        heading = render(plain(self.heading)).strip().removeprefix("<p>").removesuffix("</p>")
        return f"<h2>{heading}</h2>{''.join(self.pieces)}"


def slides(notebook: nbformat.NotebookNode, lab: teaching.Lab) -> list[Slide]:
    """The slides between a lab's title and its exercises, from a notebook with its outputs."""
    found: list[Slide] = []
    heading = ""
    for cell in notebook.cells:
        pieces = teaching.cut(cell.source) if cell.cell_type == "markdown" else [""]
        for piece in pieces:
            if title := re.match(r"#{2,3} (?:\d+\. )?(.+)", piece):
                heading = title[1]
            if heading.lower().startswith("going further"):
                return found
            if heading.lower().startswith(("exercises", "project", "you will be able")):
                continue
            for slide in _said(heading, piece) if piece else _shown(heading, cell):
                if found and found[-1].takes(slide):
                    found[-1].pieces += slide.pieces
                    found[-1].figure = slide.figure
                else:
                    found.append(slide)
    return found


def _said(heading: str, block: str) -> Iterator[Slide]:
    """Slides of a piece of prose below one heading: what it says or asks first, then its equations."""
    opens, block = block.startswith("#"), re.sub(r"^#+ .*$", "", plain(block), flags=re.M)
    folded = [(t, b) for t, b in directives(block, "dropdown") if t.startswith(("Answer", "What you should"))]
    pieces = [piece for piece in re.split(r"\n{2,}", prose(block).strip()) if len(piece.split()) > 1]
    tables = [piece for piece in pieces if piece.startswith("|")]
    lists = [piece for piece in pieces if ITEM.match(piece) and (folded or "?" in piece)]
    paragraphs = [piece for piece in pieces if piece not in tables and not ITEM.match(piece)]
    said = [sentences(paragraphs[0])] if paragraphs and (opens or "?" in paragraphs[0]) else []
    said += [piece if len(piece.split()) <= 2 * WORDS else sentences(piece) for piece in lists]
    if heading.lower().startswith("what we learned"):
        said = tables
    answers = "".join(f"<details><summary>{t}</summary>{render(b)}</details>" for t, b in folded)
    if said or answers:
        yield Slide(heading, [render("\n\n".join(said)) + answers], len(" ".join(said).split()) + WORDS * bool(folded))
    for equation in DISPLAY.findall(FENCE.sub("", block)):
        yield Slide(heading, [render(equation)])


def _shown(heading: str, cell: nbformat.NotebookNode) -> Iterator[Slide]:
    """A slide for each picture and each interactive figure of a cell."""
    for output in [] if "check" in tags(cell) else cell.get("outputs", []):
        data = output.get("data", {})
        if INTERACTIVE.match(data.get("text/html", "")):
            yield Slide(heading, [data["text/html"]], figure="interactive")
        elif "image/png" in data:
            alt = html.escape(cell.metadata.get("mystnb", {}).get("image", {}).get("alt", ""), quote=True)
            picture = f'<img alt="{alt}" src="data:image/png;base64,{data["image/png"].strip()}">'
            yield Slide(heading, [picture], figure="picture")


def deck(notebook: nbformat.NotebookNode, lab: teaching.Lab) -> str:
    """The whole page.  ``notebook`` has its outputs, as the book's build makes them."""
    core, _, project = teaching.minutes.minutes(lab.path)
    able = render(plain("\n".join(f"- {item}" for item in lab.objectives)))
    title = f"<h1>{html.escape(lab.title)}</h1>{able}<p>Core {core} min · project {project} min</p>"
    exercises = table("| exercise | difficulty |", *((e.title, e.difficulty) for e in lab.exercises))
    rubric = table("| what is scored | points |", *lab.rubric)
    ends = [Slide("Exercises", [render(exercises)]), Slide("Project", [render(rubric)])]
    insides = [title, *(slide.html() for slide in [*slides(notebook, lab), *ends])]
    sections = "".join(
        f'<section{" class=title" if i == 1 else ""}>{inside}<p class="where">{html.escape(lab.title)} · {i} of '
        f"{len(insides)}</p></section>"
        for i, inside in enumerate(insides, 1)
    )
    return page(lab.title, sections, home="../", script=KEYS, kind="slides")
