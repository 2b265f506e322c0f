"""What every lab looks like from outside: its rhythm, its cells, its exercises.  Nothing is run here."""

import ast
import re
import sys
from pathlib import Path

import nbformat
import pytest

from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import clean_notebooks

# The rhythm: these second-level headings, in this order.  A heading may go on after its first words
# ("Derive: the near rim"), and a part may be cut in two.
PARTS = [
    "A picture and a question",
    "You will be able to",
    "Play first",
    "Derive",
    "Check the derivation",
    "Use it",
    "Break it",
    "Exercises",
    "What we learned",
]
TAGS = {"beside", "hide-input", "hide-output", "check", "exercise-solution", "project"}
LINES = 15
every_lab = pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda p: p.stem)
every_notebook = pytest.mark.parametrize("path", [*notebooks.NOTEBOOKS, *notebooks.OPTIONAL], ids=lambda p: p.stem)


def cells(path, kind="code"):
    """(number, cell) of one kind, numbered as the editor numbers them, from 1."""
    return [(i, c) for i, c in enumerate(nbformat.read(path, as_version=4).cells, 1) if c.cell_type == kind]


def tags(cell):
    return set(cell.metadata.get("tags", []))


def headings(path, level):
    text = "\n".join(
        re.sub(r"^(```|~~~|:::).*?^\1", "", c.source, flags=re.M | re.S) for _, c in cells(path, "markdown")
    )
    return re.findall(rf"^#{{{level}}} (?:\d+\. )?(.+)$", text, re.M)


def missing_parts(found):
    """The parts of the rhythm that do not come in their order."""
    found, missing = iter(found), []
    for part in PARTS:
        skipped = []
        for heading in found:
            if heading.lower().startswith(part.lower()):
                break
            skipped.append(heading)
        else:
            missing.append(part)
            found = iter(skipped)
    return missing


def exercises_of(path):
    """(number of the cell, the text of its {exercise} directives)."""
    return [
        (i, block)
        for i, c in cells(path, "markdown")
        for block in re.findall(r"^(?:`{3,}|:{3,})\{exercise\}.*?(?=^(?:`{3,}|:{3,})\s*$)", c.source, re.M | re.S)
    ]


@every_notebook
def test_a_lab_is_committed_without_outputs_counts_or_leftovers(path, capsys):
    assert clean_notebooks.main(["--check", str(path)]) == 0, "run tools/clean_notebooks.py"
    ids = [c.id for c in nbformat.read(path, as_version=4).cells]
    assert len(set(ids)) == len(ids)


@every_lab
def test_a_lab_has_the_nine_parts_in_their_order(path):
    assert missing_parts(headings(path, 2)) == []


def test_a_missing_or_misplaced_part_is_noticed():
    assert missing_parts(PARTS) == []
    assert missing_parts(["Derive: a", "Play first"]) != []
    assert missing_parts([p for p in PARTS if p != "Break it"]) == ["Break it"]
    assert missing_parts([PARTS[0], "Play first, with care", *PARTS[1:]]) == []


@every_lab
def test_a_lab_has_one_title_with_its_number(path):
    (title,) = headings(path, 1)
    assert title.startswith(f"Lab {int(path.stem[:2])}: ")


@pytest.mark.parametrize("path", notebooks.OPTIONAL, ids=lambda p: p.stem)
def test_a_second_notebook_says_in_its_title_which_lab_it_takes_further(path):
    (title,) = headings(path, 1)
    assert title.startswith(f"Lab {int(path.stem[:2])}, going further: ")
    assert any(lab.stem[:2] == path.stem[:2] for lab in notebooks.NOTEBOOKS)


@every_notebook
def test_the_first_code_cell_sets_the_style_and_every_generator_has_a_seed(path):
    _, first = cells(path)[0]
    assert "coursekit" in first.source and "plotting.use_style()" in first.source
    for i, cell in cells(path):
        assert "default_rng()" not in cell.source, f"cell {i}"
        assert not re.search(r"np\.random\.(rand|randn|normal|uniform|seed|choice)\(", cell.source), f"cell {i}"
        assert "pyplot" not in cell.source, f"cell {i}"


@every_notebook
def test_cells_stay_short_unless_the_book_folds_them(path):
    long = {
        i: n
        for i, cell in cells(path)
        if not tags(cell) & {"hide-input", "exercise-solution", "check"}
        and (n := sum(bool(line.strip()) for line in cell.source.splitlines())) > LINES
    }
    assert not long


@every_notebook
def test_tags_are_the_ones_that_the_book_knows(path):
    assert {tag for _, cell in cells(path) for tag in tags(cell)} <= TAGS


@every_notebook
def test_a_picture_is_described_in_words_when_a_cell_says_it_shows_one(path):
    """The build refuses a picture without words; here, words must be words, not a placeholder."""
    for i, cell in cells(path):
        if "image" in cell.metadata.get("mystnb", {}):
            assert len(cell.metadata.mystnb["image"].get("alt", "").split()) >= 5, f"cell {i}"


@every_lab
def test_every_exercise_has_a_label_a_difficulty_a_solution_and_a_check(path):
    number, code = path.stem[:2], dict(cells(path))
    found = exercises_of(path)
    assert found
    for i, block in found:
        assert re.search(r"^:label: \S+$", block, re.M), f"cell {i}: no label"
        assert re.search(r"\b(easy|medium|hard|open)\b", block, re.I), f"cell {i}: no difficulty"
        after = [code[j] for j in sorted(code) if j > i][:2]
        assert "exercise-solution" in tags(after[0]), f"cell {i}: no solution after it"
        assert "### BEGIN SOLUTION" in after[0].source, f"cell {i}: no solution markers"
        assert "check" in tags(after[1]), f"cell {i}: no check after its solution"
        assert f'exercises.check("lab{number}.' in after[1].source, f"cell {i}: no check after its solution"
    labels = [re.search(r"^:label: (\S+)$", block, re.M)[1] for _, block in found]
    assert len(set(labels)) == len(labels)


@every_lab
def test_solutions_stand_inside_definitions_and_only_in_cells_tagged_so(path):
    for i, cell in cells(path):
        marked = "### BEGIN SOLUTION" in cell.source
        assert marked == ("exercise-solution" in tags(cell)), f"cell {i}"
        if marked:
            kinds = {type(node) for node in ast.parse(cell.source).body}
            assert kinds <= {ast.FunctionDef, ast.ClassDef, ast.Import, ast.ImportFrom}, (
                f"cell {i}: more than a definition"
            )


def test_labels_are_not_used_twice_in_the_book():
    text = "\n".join(cell.source for path in notebooks.NOTEBOOKS for _, cell in cells(path, "markdown"))
    found = [a or b for a, b in re.findall(r"^\$\$ *\((\S+)\)|^:label: (\S+)$", text, re.M)]
    assert sorted({label for label in found if found.count(label) > 1}) == []
