"""The map of the course: which lab needs which, and how long each takes, read from the labs themselves."""

from __future__ import annotations

import html
import re
import sys
import textwrap
from pathlib import Path

from reference.api import lab_number
from reference.formulas import text, title

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
import minutes

WIDE, HIGH, GAP_X, GAP_Y = 132, 74, 14, 40
CLASS = ' class="course-number"'


def needs(words: str) -> set[str]:
    """The labs that a lab says it needs, between its time and its table of symbols."""
    part = re.search(r"^\*\*Time:\*\*[^\n]*\n(.*?)(?=^```|^## )", words, re.M | re.S)
    return set(re.findall(r"\bLab (\d)", part[1])) if part else set()


def reduced(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """The arrows that are left when those are removed that a longer way replaces."""

    def before(lab: str) -> set[str]:
        return graph[lab].union(*(before(other) for other in graph[lab]))

    return {lab: direct - set().union(*(before(other) for other in direct)) for lab, direct in graph.items()}


def levels(graph: dict[str, set[str]]) -> dict[str, int]:
    """How many labs stand, one before the other, before each."""
    depth: dict[str, int] = {}
    for lab in sorted(graph):
        depth[lab] = 1 + max((depth[other] for other in graph[lab]), default=-1)
    return depth


def _lines(words: str) -> list[str]:
    """A title on at most two lines of a box; a long one ends at its comma."""
    lines = textwrap.wrap(words, 20)
    return lines if len(lines) <= 2 else textwrap.wrap(words.partition(",")[0], 20)[:2]


def drawing(labs: list[Path]) -> str:
    """The map as HTML: boxes from top to bottom, an arrow from each lab to those that it unlocks, and a table."""
    main = {lab_number(path): path for path in labs if lab_number(path).isdigit()}
    graph = {number: needs(text(path)) & set(main) for number, path in main.items()}
    rows: dict[int, list[str]] = {}
    for number, depth in levels(graph).items():
        rows.setdefault(depth, []).append(number)
    broad = max(map(len, rows.values())) * (WIDE + GAP_X)
    place = {
        number: ((broad - len(row) * (WIDE + GAP_X)) / 2 + i * (WIDE + GAP_X), depth * (HIGH + GAP_Y))
        for depth, row in rows.items()
        for i, number in enumerate(row)
    }
    parts = []
    for number, direct in reduced(graph).items():
        x, y = place[number]
        for other in direct:
            x0, y0 = place[other]
            parts.append(
                f'<path d="M{x0 + WIDE / 2:.0f} {y0 + HIGH} C{x0 + WIDE / 2:.0f} {y0 + HIGH + 26} '
                f'{x + WIDE / 2:.0f} {y - 26} {x + WIDE / 2:.0f} {y - 6}" marker-end="url(#course-arrow)"/>'
            )
    for number, (x, y) in place.items():
        path = main[number]
        core = minutes.minutes(path)[0]
        lines = [f"Lab {number}", *_lines(title(path)), f"{core} min"]
        words = "".join(
            f'<text x="{x + WIDE / 2:.0f}" y="{y + (HIGH - 16 * len(lines)) / 2 + 12 + 16 * i:.0f}"'
            f"{CLASS if i == 0 else ''}>{html.escape(line)}</text>"
            for i, line in enumerate(lines)
        )
        box = f'<rect x="{x:.0f}" y="{y:.0f}" width="{WIDE}" height="{HIGH}" rx="8"/>'
        parts.append(f'<a href="notebooks/{path.stem}.html">{box}{words}</a>')
    tall = len(rows) * (HIGH + GAP_Y) - GAP_Y
    arrow = (
        '<marker id="course-arrow" viewBox="0 0 8 8" refX="4" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0L8 4L0 8z"/></marker>'
    )
    return (
        f'<svg class="course-map" viewBox="-2 -2 {broad + 4 - GAP_X} {tall + 4}" role="group" '
        f'aria-label="Which lab unlocks which; the table below says the same">'
        f"<defs>{arrow}</defs>{''.join(parts)}</svg>\n"
    )


def table(labs: list[Path]) -> str:
    """The same in a table: minutes, what a lab needs, what it unlocks."""
    wants = {lab_number(path): needs(text(path)) for path in labs}
    lines = ["| lab | core | going further | project | needs | unlocks |", "| --- | --- | --- | --- | --- | --- |"]
    for path in labs:
        number = lab_number(path)
        spent = [f"{m}\N{NO-BREAK SPACE}min" if m else "" for m in minutes.minutes(path)]
        after = sorted(other for other, before in wants.items() if number in before)
        before = sorted(wants[number]) or (["5"] if number == "5b" else [])
        name = f"[Lab {number}](notebooks/{path.name}) {title(path)}"
        lines.append(f"| {name} | {' | '.join(spent)} | {', '.join(before)} | {', '.join(after)} |")
    total = [sum(m) for m in zip(*(minutes.minutes(path) for path in labs))] or [0, 0, 0]
    lines.append("| together | " + " | ".join(f"{m / 60:.0f} h" for m in total) + " | | |")
    return "\n".join(lines)


def pages(labs: list[Path]) -> dict[str, str]:
    """What ``course_map.md`` takes in: the drawing and the table."""
    return {"images/course_map.html": drawing(labs), "images/course_table.txt": table(labs) + "\n"}
