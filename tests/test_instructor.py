"""What instructors get: guides that say what the labs say, a schedule that adds up, a bank without answers, slides."""

import re
import sys
from pathlib import Path

import nbformat
import pytest

from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import expected_ranges
import instructor
import minutes
import slides
import teaching
import web_page

ROOT = Path(__file__).parent.parent
WRITTEN = ROOT / "book" / "teaching"
HEADINGS = ["Before class", "What to say", "Questions to ask", "What they believe, and what helps", "What goes wrong"]
every_lab = pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda p: p.stem)


@pytest.fixture(scope="module")
def labs():
    return instructor.labs()


# --- what a person wrote ----------------------------------------------------------------------------------------


@every_lab
def test_a_lab_has_a_written_guide_of_one_form_and_its_own_title(path):
    text = (WRITTEN / f"lab{path.stem[:2]}.md").read_text(encoding="utf-8")
    assert text.splitlines()[0] == f"# {teaching.read(path).title}"
    assert re.findall(r"^## (.*)$", text, re.M) == [*HEADINGS, "Where to stop"]
    assert len(text.splitlines()) <= 70


def test_the_schedules_name_every_lab_and_their_minutes_are_those_of_the_labs(labs):
    source = (WRITTEN / "syllabus.md").read_text(encoding="utf-8")
    for schedule in re.split(r"^## ", source, flags=re.M)[1:4]:
        cores = {number for group in re.findall(r"\{core:([\d+]+)\}", schedule) for number in group.split("+")}
        assert cores == {lab.number for lab in labs}
    of = {lab.number: lab for lab in labs}
    assert "{" not in instructor.syllabus(source, of)
    both = sum(minutes.minutes(of[number].path)[0] for number in ("01", "02"))
    assert instructor.syllabus("{core:01+02} min", of) == f"{both} min"
    with pytest.raises(KeyError):
        instructor.syllabus("{core:77}", of)


def test_the_matrix_of_objectives_has_a_column_for_each_lab_and_each_lab_examines_something(labs):
    rows = re.findall(r"^\| (?!---)(.*) \|$", (WRITTEN / "objectives.md").read_text(encoding="utf-8"), re.M)
    head, *rows = [[cell.strip() for cell in row.split("|")] for row in rows]
    assert head[1:] == [str(int(lab.number)) for lab in labs]
    assert {cell for row in rows for cell in row[1:]} <= {"", "I", "P", "E"}
    for column in range(1, len(head)):
        assert "E" in [row[column] for row in rows]


def test_the_page_for_a_class_states_the_hours_of_the_labs(labs):
    text = (ROOT / "book" / "running_a_class.md").read_text(encoding="utf-8")
    core, further, project = (sum(m) / 60 for m in zip(*(minutes.minutes(lab.path) for lab in labs)))
    said = re.search(r"cores take ([\d.]+) hours together, the ten projects ([\d.]+), what is optional (\d+\.\d)", text)
    assert [float(hours) for hours in said.groups()] == pytest.approx([core, project, further], abs=0.06)


def test_the_image_for_a_hub_is_built_from_what_the_wheel_is_made_of():
    import handout

    text = (ROOT / "hub" / "Containerfile").read_text(encoding="utf-8")
    copied = [word for line in re.findall(r"^COPY (?!--from)(.*) \S+$", text, re.M) for word in line.split()]
    assert set(copied) == {*handout.SOURCES, "requirements.lock"}


# --- what the labs say ------------------------------------------------------------------------------------------


@every_lab
def test_a_guide_holds_the_labs_objectives_exercises_answers_and_rubric(path):
    lab = teaching.read(path)
    text = instructor.guide(lab)
    source = "\n".join(cell.source for cell in nbformat.read(path, as_version=4).cells)
    assert len(lab.objectives) >= 3 and all(item in text for item in lab.objectives)
    assert [e.check for e in lab.exercises] == re.findall(r'exercises\.check\(\s*"([\w.]+)"', source)
    assert all(len(e.hints) >= 3 and all(hint[:20] in text for hint in e.hints[:1]) for e in lab.exercises)
    assert len(lab.questions) >= 4 and source.count("### Checkpoint") <= len(lab.questions)
    assert all("?" in question.text and len(question.answer) > 20 for question in lab.questions)
    assert sum(points for _, points in lab.rubric) == 100
    told = sum(time for _, time in lab.minutes_by_part())
    assert told == pytest.approx(sum(minutes.minutes(path)), abs=9)


def test_the_questions_give_no_answer_away_and_have_the_numbers_of_the_answers(labs):
    asked, told = instructor.question_bank(labs)
    number = re.compile(r"^\*\*(\d\d\.\d+)\*\*", re.M)
    assert number.findall(asked) == number.findall(told)
    for question in (q for lab in labs for q in lab.questions):
        assert question.answer.splitlines()[0] in told and question.answer.splitlines()[0] not in asked


def test_hints_are_whole_sentences_of_the_check_and_of_what_it_calls():
    hints = teaching.hints_of("04")["lab04.predict_covariance"]
    assert any("wants a transpose" in hint for hint in hints)
    assert all(re.match(r"[A-Z].*[.?]$", hint, re.S) for some in teaching.hints_of("00").values() for hint in some)


# --- pages and slides -------------------------------------------------------------------------------------------

PICTURE = {"image/png": "iVBORw0KGgo=", "text/plain": "<Figure>"}


def a_lab(tmp_path):
    """A lab with its outputs, and how an instructor reads it."""
    cells = [
        nbformat.v4.new_markdown_cell("# Lab 4: Tiny\n\n## A picture and a question\n\nWhere is it? Look. Then guess."),
        nbformat.v4.new_code_cell("fig", metadata={"mystnb": {"image": {"alt": 'A "line" that rises.'}}}),
        nbformat.v4.new_markdown_cell("## You will be able to\n\n- see;\n- doubt.\n\nYou need Lab 3."),
        nbformat.v4.new_markdown_cell(
            "## Derive\n\nBy {cite}`kalman1960` the truth is {eq}`eq-lab4-b`. It is short.\n\n"
            "$$ a < b $$ (eq-lab4-b)\n\n"
            "### Checkpoint\n\n1. Is it [so](#set:x?a=1)?\n\n```{dropdown} Answer\n1. It is secret.\n```"
        ),
        nbformat.v4.new_code_cell("explorer"),
        nbformat.v4.new_markdown_cell("## Exercises\n\n```{exercise} Do it (easy)\n:label: ex\nMuch text.\n```"),
        nbformat.v4.new_code_cell('exercises.check("lab04.predict_covariance", f)', metadata={"tags": ["check"]}),
        nbformat.v4.new_markdown_cell("## What we learned\n\n| a | b |\n| --- | --- |\n| {eq}`eq-lab4-b` | two |"),
        nbformat.v4.new_markdown_cell("## Going further\n\nOn and on."),
    ]
    cells[1].outputs = [nbformat.v4.new_output("display_data", data=PICTURE)]
    cells[4].outputs = [nbformat.v4.new_output("display_data", data={"text/html": '<div class="explorer">move</div>'})]
    notebook = nbformat.v4.new_notebook(cells=cells)
    nbformat.write(notebook, tmp_path / "04_tiny.ipynb")
    return notebook, teaching.read(tmp_path / "04_tiny.ipynb")


def test_slides_show_what_is_seen_asked_and_derived_and_leave_the_exercises_in_the_lab(tmp_path):
    deck = slides.deck(*a_lab(tmp_path))
    found = re.findall(r"<section.*?</section>", deck, re.S)
    assert len(found) == 8
    assert "<h1>Lab 4: Tiny</h1>" in found[0] and "doubt" in found[0]
    assert "Where is it?" in found[1] and 'alt="A &quot;line&quot; that rises."' in found[1]
    assert r"\tag{b}" in found[2] and "a &lt; b" in found[2] and "(b)" in found[2] and "kalman" not in found[2]
    assert re.search(r"Is it so\?.*<details><summary>Answer</summary>.*secret", found[3], re.S)
    assert '<div class="explorer">move</div>' in found[4]
    assert "two" in found[5] and "Do it" in found[6] and "Much text" not in deck and "On and on" not in deck
    assert "position error" in found[7]


def test_a_sentence_is_never_cut():
    long = "This is a sentence of ten words, and no more. " * 12
    assert slides.sentences(long) == ("This is a sentence of ten words, and no more. " * 6).strip()
    assert slides.sentences("One. Two.") == "One. Two."


def test_everything_is_written_without_running_a_lab_and_no_page_loads_from_elsewhere(tmp_path):
    assert instructor.main(["--to", str(tmp_path), "--without-slides"]) == 0
    pages = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.html")]
    guides = [f"guides/lab{path.stem[:2]}.html" for path in notebooks.NOTEBOOKS]
    others = ["index", "syllabus", "objectives", "questions", "answers"]
    assert sorted(pages) == sorted([*guides, *(f"{name}.html" for name in others)])
    assert len([*(tmp_path / "solved").glob("*.ipynb")]) == len([*notebooks.NOTEBOOKS, *notebooks.OPTIONAL])
    for name in pages:
        text = (tmp_path / name).read_text(encoding="utf-8")
        loaded = re.findall(r'<(?:script|img|link|iframe)[^>]*?(?:src|href)="([^"]+)"', text)
        assert loaded and all((tmp_path / name).parent.joinpath(address).exists() for address in loaded)
        for link in re.findall(r'<a href="([^"#]+)"', text):
            assert "://" in link or (tmp_path / name).parent.joinpath(link).exists(), f"{name}: {link}"


def test_markdown_of_a_lab_is_left_without_what_only_the_book_knows():
    source = "[now](#read:a?b) [Lab 2](02_x.ipynb) {eq}`eq-lab3-bias` {cite}`a,b`.\n\n$$\nx\n$$ (eq-arc)"
    assert web_page.plain(source) == "now Lab 2 (bias).\n\n$$\nx\n\\tag{arc} $$"


# --- expected numbers -------------------------------------------------------------------------------------------


def printed(*lines):
    return [expected_ranges.Printed("Use it", "cell", *expected_ranges.split(line)) for line in lines]


def test_numbers_of_a_printed_line_get_the_range_over_the_runs():
    first = printed("NEES 2.9  of 3", "the same 7", "on lab04 −0.5 to 2 m", "rounding 1e-16", "9,000 draws")
    second = printed(
        "NEES 3.1 of 3", "the same 7", "on lab04 −0.7 to 1 m", "rounding 2e-16", "10,000 draws", "one more 1"
    )
    shown = [expected_ranges.shown(entry) for entry in expected_ranges.ranges([first, second])]
    assert shown == ["NEES 2.9 … 3.1 of 3", "on lab04 −0.7 … −0.5 to 1 … 2 m", "9,000 … 10,000 draws"]


def test_equal_lines_of_one_cell_are_told_apart_by_their_order():
    runs = [printed("row 1", "row 5"), printed("row 2", "row 9")]
    assert [expected_ranges.shown(entry) for entry in expected_ranges.ranges(runs)] == ["row 1 … 2", "row 5 … 9"]


def test_what_is_stored_was_measured_on_several_seeds_of_labs_that_exist():
    known = expected_ranges.stored()
    assert len(set(known["offsets"])) >= 2
    assert set(known["labs"]) <= {path.stem for path in [*notebooks.NOTEBOOKS, *notebooks.OPTIONAL]}
    for path in notebooks.NOTEBOOKS:
        assert known["labs"].get(path.stem), f"tools/expected_ranges.py --write notebooks/{path.name}"
