"""The student edition: solutions gone, everything else in its place, and the emptied lab still runs."""

import sys
from pathlib import Path

import nbformat
import pytest

from coursekit import exercises
from tests import labs

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import student_edition as tool

CELL = """def double(x):
    \"\"\"Twice x.\"\"\"
    ### BEGIN SOLUTION
    secret = 2
    return secret * x
    ### END SOLUTION
"""


def a_notebook(*sources, tags=("exercise-solution",)):
    cells = [nbformat.v4.new_code_cell(s, metadata={"tags": list(tags)}) for s in sources]
    return nbformat.v4.new_notebook(cells=cells)


def test_a_solution_is_replaced_by_a_placeholder_and_the_signature_stays():
    namespace = {}
    emptied = tool.empty(CELL)
    assert "secret" not in emptied and "SOLUTION" not in emptied
    exec(emptied, namespace)
    with pytest.raises(NotImplementedError, match="your lines here"):
        namespace["double"](1)


def test_two_solutions_in_one_cell_are_emptied_one_by_one():
    source = CELL + "\nkept = 7\n\n" + CELL.replace("double", "twice")
    emptied = tool.empty(source)
    assert emptied.count("NotImplementedError") == 2 and "kept = 7" in emptied and "def twice" in emptied


def test_code_without_markers_comes_back_letter_by_letter():
    source = "a = 1\n\n\nb = '### a comment'  \n"
    assert tool.empty(source) == source


@pytest.mark.parametrize(
    "source",
    [
        CELL.replace("    ### END SOLUTION\n", ""),
        CELL.replace("    ### BEGIN SOLUTION\n", ""),
        CELL.replace("    ### END SOLUTION\n", "    ### BEGIN SOLUTION\n"),
        "def f(x):\n    ### BEGIN SOLUTION\n    ### BEGIN SOLUTION\n    return x\n    ### END SOLUTION\n",
        "### BEGIN SOLUTION\nanswer = 42\n### END SOLUTION",
    ],
    ids=["never ended", "never begun", "begun twice", "nested", "outside a function"],
)
def test_markers_that_do_not_pair_inside_a_function_are_an_error_that_names_the_cell(source):
    with pytest.raises(ValueError, match=r"cell 1: .*(partner|inside a function)"):
        tool.student_edition(a_notebook("a = 1", source))


def test_an_edition_leaves_the_original_alone_and_carries_no_outputs():
    original = a_notebook(CELL)
    original.cells[0].outputs = [nbformat.v4.new_output("stream", text="4")]
    original.cells.append(nbformat.v4.new_markdown_cell("[notation](../book/notation.md)"))
    edition = tool.student_edition(original)
    assert "secret" in original.cells[0].source and original.cells[0].outputs
    assert edition.cells[0].outputs == [] and edition.cells[0].metadata.tags == []
    assert edition.cells[1].source == "[notation](../../book/notation.md)"


def test_the_command_writes_each_lab_and_stops_at_one_it_cannot_empty(tmp_path, capsys):
    good, bad = tmp_path / "01_good.ipynb", tmp_path / "02_bad.ipynb"
    nbformat.write(a_notebook(CELL), good)
    nbformat.write(a_notebook("### BEGIN SOLUTION"), bad)
    assert tool.main(["--to", str(tmp_path / "out"), str(good)]) == 0
    assert "secret" not in (tmp_path / "out" / "01_good.ipynb").read_text()
    assert tool.main(["--to", str(tmp_path / "out"), str(bad)]) == 1
    assert "02_bad.ipynb, cell 0" in capsys.readouterr().err


@pytest.mark.parametrize("path", labs.NOTEBOOKS, ids=lambda p: p.stem)
def test_an_emptied_lab_answers_every_check_with_nothing_here_yet(path):
    """Only the cells that exercises need are run: imports, the emptied cells, and their checks."""
    edition = tool.student_edition(nbformat.read(path, as_version=4))
    sources = [c.source for c in edition.cells if c.cell_type == "code"]
    stubs = [s for s in sources if "your lines here" in s]
    checks = [s for s in sources if "exercises.check(" in s]
    namespace = {}
    with exercises.collecting() as verdicts:
        for source in [sources[0], *stubs, *checks]:
            exec(source, namespace)
    assert stubs and verdicts
    assert all("Nothing here yet" in v.hint for v in verdicts)
