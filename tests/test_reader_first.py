"""A learner gets through a lab alone: every question is answered, the minutes are honest, a symbol has one meaning."""

import re
import sys
from pathlib import Path

import nbformat
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import minutes
import questions
import symbols
from lab_text import labs, parts

LABS = [path for path in labs() if re.match(r"\d\d_", path.name)]
every_lab = pytest.mark.parametrize("path", LABS, ids=lambda p: p.stem)
every_notebook = pytest.mark.parametrize("path", labs(), ids=lambda p: p.stem)


@every_notebook
def test_every_question_has_an_answer_that_unfolds(path):
    assert questions.unanswered(path) == []


@every_lab
def test_a_lab_says_how_long_it_takes_and_its_core_fits_an_evening(path):
    assert minutes.stated(path) == minutes.line(path), "python tools/minutes.py --write"
    core, _, _ = minutes.minutes(path)
    assert 50 <= core <= 75


@every_lab
def test_a_lab_opens_with_its_symbols(path):
    assert len(symbols.table(path)) >= 5


def test_a_symbol_has_one_meaning_or_says_so():
    assert symbols.problems(labs()) == []


@every_notebook
def test_all_randomness_hangs_on_one_declared_seed(path):
    code = [c.source for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]
    assert len(re.findall(r"^SEED = experiments\.lab_seed\(\d+\)$", "\n".join(code), re.M)) == 1
    fixed = [s for source in code for s in re.findall(r"(?:default_rng|seed=|SeedSequence)\(?\s*\d+", source)]
    assert fixed == []


@every_lab
def test_a_lab_ends_with_a_project_that_is_scored(path):
    (project,) = [part for part in parts(path) if part.project]
    code = "\n".join(c.source for c in project.cells if c.cell_type == "code")
    assert f'exercises.score("lab{path.name[:2]}", ' in code and "### BEGIN SOLUTION" in code


@pytest.fixture
def lab(tmp_path):
    def write(*sources):
        notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell(s) for s in sources])
        nbformat.write(notebook, tmp_path / "03_some_lab.ipynb")
        return tmp_path / "03_some_lab.ipynb"

    return write


def test_a_question_without_an_answer_is_found_and_one_with_an_answer_is_not(lab):
    asked = "## Play first\n\nWhich way does it grow?"
    assert questions.unanswered(lab(asked, "## Derive\n\nDoes it?")) == ["Which way does it grow?"]
    assert questions.unanswered(lab(asked, "```{dropdown} What you should have seen\nForward.\n```", "## Derive")) == []
    folded = "## Play first\n\n```{dropdown} Answer\nWhy not?\n```"
    assert questions.unanswered(lab(folded)) == []
    checkpoint = "## Derive\n\n### Checkpoint\n\nIs $P = ?$ symmetric?"
    assert len(questions.unanswered(lab(checkpoint))) == 1


def test_minutes_grow_with_what_a_reader_has_to_do(lab):
    short = minutes.minutes(lab("## Derive\n\n" + "word " * 800))
    assert short == (10, 0, 0)
    assert minutes.minutes(lab("## Derive\n\n" + "word " * 800, "## Going further\n\n" + "word " * 800))[1] == 10
    more = "\n\n```{exercise} Turn it (hard)\n:label: ex\n" + "word\n" * 10 + "```"
    assert minutes.minutes(lab("## Exercises\n\n" + "word " * 800 + more))[0] >= 20


def test_a_symbol_that_changes_its_meaning_unannounced_is_found(lab, tmp_path):
    def table(meaning):
        rows = f"| symbol | meaning | unit | shape |\n| --- | --- | --- | --- |\n| $n$ | {meaning} | | |\n"
        return f"## You will be able to\n\n```{{dropdown}} Symbols of this lab\n{rows}```"

    first = lab(table("steps")).rename(tmp_path / "01_a.ipynb")
    assert symbols.problems([first, lab(table("steps"))]) == []
    assert len(symbols.problems([first, lab(table("pixels"))])) == 1
    assert symbols.problems([first, lab(table("pixels (Lab 1: steps)"))]) == []
    assert len(symbols.problems([lab(table("steps") + "\n" + table("pixels"))])) == 1


def test_the_notation_page_is_made_from_the_labs_tables():
    text = symbols.NOTATION.read_text(encoding="utf-8")
    assert text == symbols.page(text, labs()), "python tools/symbols.py --write"
