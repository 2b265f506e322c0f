"""Write what an instructor needs into a folder: solved labs, guides, slides, a syllabus, objectives, a question bank.

    python tools/instructor.py                 everything, into instructor/
    python tools/instructor.py --only 04       the guide and the slides of one lab
    python tools/instructor.py --without-slides

What a person wrote stands in book/teaching/; the rest is taken from the labs.  The slides show the labs' figures, so
labs that the book's build has not run since their last change are run.
"""

from __future__ import annotations

import argparse
import html
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "book"))
import desk
import expected_ranges
import slides
import teaching
from lab_text import ROOT
from teaching import Lab
from web_page import copy_mathjax, page, plain, render, table

WRITTEN = ROOT / "book" / "teaching"
FOLDER = ROOT / "instructor"


def labs() -> list[Lab]:
    """The labs, in order, without the second notebooks."""
    return [teaching.read(path) for path in sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.ipynb"))]


def guide(lab: Lab) -> str:
    """A lab's teaching guide in Markdown: what a person wrote, then what the lab itself says."""
    written = (WRITTEN / f"lab{lab.number}.md").read_text(encoding="utf-8")
    title, _, advice = written.partition("\n")
    core, further, project = teaching.minutes.minutes(lab.path)
    times = f"**Minutes:** core {core}" + (f", going further {further}" if further else "") + f", project {project}."
    able = "\n".join(f"- {item}" for item in lab.objectives)
    spent = table("| part | minutes |", *((name, round(time)) for name, time in lab.minutes_by_part()))
    exercises = table("| exercise | difficulty | points |", *((e.title, e.difficulty, e.points) for e in lab.exercises))
    turns = "\n\n".join(
        f"**{e.title}** (`{e.check}`)\n\n" + "\n".join(f"- {html.escape(hint, quote=False)}" for hint in e.hints)
        for e in lab.exercises
    )
    rubric = table("| what is scored | points |", *lab.rubric)
    return "\n\n".join(
        [
            title,
            f"{times} {lab.needs}",
            f"Students will be able to\n\n{able}",
            advice.strip(),
            f"## Minutes, part by part\n\n{spent}",
            f"## Questions of the lab, with their answers\n\n{_asked(lab, answers=True)}",
            f"## Exercises\n\n{exercises}\n\nWhat their checks say to the wrong turns that people take:\n\n{turns}",
            f"## Project: the rubric\n\n{rubric}\n\nThe limits for all points and for none stand in the lab.",
            f"## Expected numbers\n\n{_expected(lab)}",
        ]
    )


def _asked(lab: Lab, *, answers: bool) -> str:
    said = []
    for i, question in enumerate(lab.questions, 1):
        said.append(f"**{lab.number}.{i}** {question.where}\n\n{question.text}")
        if answers:
            said.append(f"<details><summary>Answer</summary>\n\n{question.answer}\n\n</details>")
    return "\n\n".join(said)


def _expected(lab: Lab) -> str:
    """The lines that a lab prints, with their ranges over the seeds that were tried."""
    known = expected_ranges.stored()
    lines, offsets = known["labs"].get(lab.path.stem, []), known["offsets"]  # type: ignore[attr-defined]
    if not lines:
        return "Nothing was measured. `python tools/expected_ranges.py --write` does it."
    runs = f"{len(offsets)} runs, the lab's seed shifted by {', '.join(map(str, offsets))}"  # type: ignore[arg-type]
    return (
        f"The lowest and the highest value in {runs}. More seeds will go a little beyond both.\n\n"
        f"```text\n" + "\n".join(expected_ranges.shown(line) for line in lines) + "\n```"
    )


def syllabus(source: str, of: dict[str, Lab]) -> str:
    """The written syllabus with its minutes: {core:00+01} is the sum of the cores of Labs 0 and 1.

    Raises KeyError for a lab that does not exist.
    """

    def minutes(found: re.Match[str]) -> str:
        which = ("core", "further", "project").index(found[1])
        return str(sum(teaching.minutes.minutes(of[number].path)[which] for number in found[2].split("+")))

    return re.sub(r"\{(core|further|project):([\d+]+)\}", minutes, source)


def objectives(source: str, every: list[Lab]) -> str:
    """The written matrix, and below it what each lab promises."""
    promised = "\n\n".join(f"**{lab.title}**\n\n" + "\n".join(f"- {o}" for o in lab.objectives) for lab in every)
    return f"{source}\n\n## What each lab promises\n\n{promised}"


def question_bank(every: list[Lab]) -> tuple[str, str]:
    """(the questions, the answers), under the same numbers."""
    asked = "\n\n".join(f"## {lab.title}\n\n{_asked(lab, answers=False)}" for lab in every)
    told = "\n\n".join(
        f"## {lab.title}\n\n" + "\n\n".join(f"**{lab.number}.{i}** {q.answer}" for i, q in enumerate(lab.questions, 1))
        for lab in every
    )
    return f"# Questions\n\n{asked}", f"# Answers\n\n{told}"


def write(folder: Path, name: str, markdown: str) -> None:
    """A page of the folder from Markdown."""
    path = folder / f"{name}.html"
    path.parent.mkdir(parents=True, exist_ok=True)
    heading = re.search(r"^# (.+)$", markdown, re.M)
    text = page(heading[1] if heading else name, render(plain(markdown)), home="../" * name.count("/") or "./")
    path.write_text(text, encoding="utf-8")


def write_slides(folder: Path, every: list[Lab], jobs: int) -> None:
    """The labs' slides.  Raises ``execute.LabFailed`` for a lab that does not run to its end."""
    import execute

    here, _ = execute.recordings()
    cache = ROOT / "book" / "_build" / "executed"
    done = execute.execute([lab.path for lab in every], jobs, cache, also=here)
    (folder / "slides").mkdir(exist_ok=True)
    for lab in every:
        text = slides.deck(done[lab.path], lab)
        (folder / "slides" / f"lab{lab.number}.html").write_text(text, encoding="utf-8")


def index(every: list[Lab], with_slides: bool) -> str:
    """The first page: a row for each lab."""
    rows = [
        (
            lab.title,
            f"[guide](guides/lab{lab.number}.html)",
            f"[slides](slides/lab{lab.number}.html)" if with_slides else "",
            f"[solved](solved/{lab.path.name})",
        )
        for lab in every
    ]
    return (
        "# Materials for instructors\n\n"
        "These pages hold the answers. `make handout` writes what students may have.\n\n"
        "- [Syllabus for 4, 8 and 12 weeks](syllabus.html)\n- [Objectives across the labs](objectives.html)\n"
        f"- [Question bank](questions.html), and [its answers](answers.html)\n\n{table('| lab | | | |', *rows)}"
    )


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--to", type=Path, default=FOLDER, help="the folder to write")
    parser.add_argument("--only", nargs="+", metavar="NN", help="these labs")
    parser.add_argument("--without-slides", action="store_true", help="run no lab")
    parser.add_argument("--jobs", type=int, default=2, help="labs to run at a time")
    options = parser.parse_args(arguments)
    folder, all_labs = options.to, labs()
    every = [lab for lab in all_labs if not options.only or lab.number in options.only]
    folder.mkdir(parents=True, exist_ok=True)
    copy_mathjax(folder)
    desk.main(["solved", "--to", str(folder / "solved")])
    for lab in every:
        write(folder, f"guides/lab{lab.number}", guide(lab))
    of = {lab.number: lab for lab in all_labs}
    write(folder, "syllabus", syllabus((WRITTEN / "syllabus.md").read_text("utf-8"), of))
    write(folder, "objectives", objectives((WRITTEN / "objectives.md").read_text("utf-8"), all_labs))
    for name, text in zip(("questions", "answers"), question_bank(all_labs), strict=True):
        write(folder, name, text)
    if not options.without_slides:
        write_slides(folder, every, options.jobs)
    write(folder, "index", index(every, not options.without_slides))
    print(f"Materials for instructors: {desk.shown(folder)}/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
