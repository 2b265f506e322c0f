"""The marks of a class: one CSV for the records, one page to read, which needs no other file and no network."""

from __future__ import annotations

import csv
import html
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from grading.notebook import Task

POINTS = {"exercise": 1.0, "project": 10.0}
FULL = 0.8  # of a project's mark: the scenarios are drawn, so a mark that passes earns all points
STYLE = """
:root { color-scheme: light dark; --line: color-mix(in srgb, currentColor 18%, transparent); --good: #1b7f4b;
  --part: #8a6100; --bad: #b3541e; }
@media (prefers-color-scheme: dark) { :root { --good: #5cc98f; --part: #e0b040; --bad: #f09a68; } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 75rem; margin: 2rem auto; padding: 0 1rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .3rem .6rem; border-bottom: 1px solid var(--line); text-align: right; white-space: nowrap; }
th:first-child, td:first-child, .said { text-align: left; } .said { white-space: normal; }
thead th { position: sticky; top: 0; background: Canvas; vertical-align: bottom; }
.full { color: var(--good); } .some { color: var(--part); } .none { color: var(--bad); } .absent { opacity: .5; }
details { border: 1px solid var(--line); border-radius: .4rem; margin: .6rem 0; padding: .4rem .8rem; }
summary { cursor: pointer; font-weight: 600; } summary span { font-weight: 400; float: right; }
li { margin: .3rem 0; } code { font-size: .9em; overflow-wrap: anywhere; } .small { font-size: .85rem; opacity: .8; }
"""


@dataclass
class Result:
    """A task of a student.  work : what a judge is given; verdict : {share, said, mark}, None while it is not known."""

    task: Task
    work: dict[str, Any] = field(default_factory=dict)
    verdict: dict[str, Any] | None = None

    @property
    def points(self) -> float:
        """What it has earned."""
        share = self.verdict["share"] if self.verdict else 0.0
        most = POINTS[self.task.kind]
        return round(most * (share if self.task.kind == "exercise" else min(share / FULL, 1.0)), 2)


@dataclass
class Student:
    """results : by the task's key.  remarks : on what was handed in."""

    name: str
    files: list[str]
    results: dict[str, Result] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def points(self, tasks: Sequence[Task]) -> float:
        """The sum over some tasks; what was not handed in counts nothing."""
        return round(sum(self.results[t.key].points for t in tasks if t.key in self.results), 2)


def write(folder: Path, people: Sequence[Student], tasks: Sequence[Task], walls: str) -> None:
    """``marks.csv`` and ``report.html``."""
    folder.mkdir(parents=True, exist_ok=True)
    # The mark at the file's head tells spreadsheets that it is UTF-8.
    (folder / "marks.csv").write_text(table(people, tasks), encoding="utf-8-sig", newline="")
    (folder / "report.html").write_text(page(people, tasks, walls), encoding="utf-8")


def _by_lab(tasks: Sequence[Task]) -> dict[str, list[Task]]:
    return {lab: [t for t in tasks if t.lab == lab] for lab in dict.fromkeys(t.lab for t in tasks)}


def _most(tasks: Sequence[Task]) -> float:
    return sum(POINTS[t.kind] for t in tasks)


def table(people: Sequence[Student], tasks: Sequence[Task]) -> str:
    """One row a student: points of each task (empty: the lab was not handed in), of each lab, and of all."""
    text = io.StringIO()
    rows = csv.writer(text)
    labs = _by_lab(tasks)
    rows.writerow(["student", *(t.key for t in tasks), *(f"{lab} total" for lab in labs), "total", "of"])
    for student in people:
        marks = [f"{student.results[t.key].points:g}" if t.key in student.results else "" for t in tasks]
        totals = [f"{student.points(some):g}" for some in [*labs.values(), tasks]]
        rows.writerow([_harmless(student.name), *marks, *totals, f"{_most(tasks):g}"])
    return text.getvalue()


def _harmless(name: str) -> str:
    """A name that no spreadsheet takes for a formula."""
    return f"'{name}" if name.startswith(("=", "+", "-", "@")) else name


def page(people: Sequence[Student], tasks: Sequence[Task], walls: str) -> str:
    """The whole class at a glance, what it stumbled over, and each student's hints."""
    labs = _by_lab(tasks)
    heads = "".join(
        f"<th scope='col'>{lab}<br>of {_most(some):g}</th>" for lab, some in [*labs.items(), ("all", tasks)]
    )
    rows = "".join(
        f"<tr><td><a href='#{_anchor(i)}'>{html.escape(student.name)}</a></td>"
        + "".join(_cell(student, some) for some in [*labs.values(), tasks])
        + "</tr>"
        for i, student in enumerate(people)
    )
    held = f"<p class='small'>What held the students' code: {html.escape(walls)}.</p>" if walls else ""
    return (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Marks</title>"
        f"<meta name='viewport' content='width=device-width'><style>{STYLE}</style></head><body>"
        f"<h1>Marks of {len(people)} students</h1><div class='wide'><table><thead><tr>"
        f"<th scope='col'>student</th>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
        f"{_stumbles(people, tasks)}<h2>Student by student</h2>"
        + "".join(_student(i, student, tasks) for i, student in enumerate(people))
        + f"{held}</body></html>"
    )


def _anchor(number: int) -> str:
    return f"student-{number + 1}"


def _cell(student: Student, tasks: Sequence[Task]) -> str:
    if not any(t.key in student.results for t in tasks):
        return "<td class='absent'>–</td>"
    return f"<td class='{_grade(student.points(tasks) / _most(tasks))}'>{student.points(tasks):g}</td>"


def _grade(share: float) -> str:
    return "full" if share >= 0.999 else "some" if share > 0 else "none"


def _stumbles(people: Sequence[Student], tasks: Sequence[Task]) -> str:
    """Task by task: how many solved it, and the sentence that most of the others were told."""
    rows = ""
    for task in tasks:
        results = [p.results[task.key] for p in people if task.key in p.results]
        solved = sum(r.points >= POINTS[task.kind] for r in results)
        said = Counter(r.verdict["said"][0] for r in results if r.verdict and r.verdict["said"])
        often = f"{said.most_common(1)[0][1]} × {html.escape(said.most_common(1)[0][0])}" if said else ""
        rows += f"<tr><td>{task.key}</td><td>{solved} of {len(results)}</td><td class='said'>{often}</td></tr>"
    return (
        "<h2>Task by task</h2><div class='wide'><table><thead><tr><th scope='col'>task</th><th scope='col'>solved</th>"
        f"<th scope='col' class='said'>said most often</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _student(number: int, student: Student, tasks: Sequence[Task]) -> str:
    items = "".join(f"<li>{html.escape(remark)}</li>" for remark in student.remarks)
    for task in tasks:
        result = student.results.get(task.key)
        if result is None or result.verdict is None:
            continue
        said = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in result.verdict["said"])
        most, mark = POINTS[task.kind], result.verdict.get("mark")
        worth = f"{result.points:g} of {most:g}" + (f" (mark {mark} of 100)" if mark is not None else "")
        items += (
            f"<li><code>{task.key}</code>: <b class='{_grade(result.points / most)}'>{worth}</b><ul>{said}</ul></li>"
        )
    files = ", ".join(html.escape(file) for file in student.files)
    return (
        f"<details><summary>{html.escape(student.name)} "
        f"<span>{student.points(tasks):g} of {_most(tasks):g}</span></summary>"
        f"<p class='small' id='{_anchor(number)}'>{files}</p>"
        f"<ul>{items}</ul></details>"
    )
