"""Notebooks come out as they are committed, whatever an editor put into them."""

import sys
from pathlib import Path

import nbformat
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import clean_notebooks as tool


@pytest.fixture
def used():
    """A notebook as JupyterLab saves it after a session."""
    v4 = nbformat.v4
    plot = v4.new_code_cell("fig", metadata={"tags": ["hide-input"], "collapsed": True, "scrolled": False})
    plot.metadata.mystnb = {"image": {"alt": "A line that rises from left to right."}}
    plot.outputs, plot.execution_count = [v4.new_output("stream", text="1")], 7
    cells = [v4.new_markdown_cell("# Lab 1\n"), plot, v4.new_code_cell("  \n")]
    return v4.new_notebook(
        cells=cells, metadata={"widgets": {"state": {}}, "language_info": {"name": "python", "version": "3.11.9"}}
    )


def test_what_the_book_reads_stays_and_the_rest_goes(used):
    fresh = tool.clean(used)
    assert [c.source for c in fresh.cells] == ["# Lab 1", "fig"]
    assert fresh.cells[1].outputs == [] and fresh.cells[1].execution_count is None
    assert set(fresh.cells[1].metadata) == {"tags", "mystnb", "jupyter"}
    assert fresh.metadata == tool.METADATA
    assert used.cells[1].outputs, "the notebook that was given must not change"


@pytest.mark.parametrize("tag", ["hide-input", "check", "exercise-solution"])
def test_a_cell_that_the_book_folds_is_folded_in_jupyterlab_and_no_other(tag):
    v4, folded = nbformat.v4, {"source_hidden": True}
    cells = [
        v4.new_code_cell("a", metadata={"tags": [tag], "jupyter": {"outputs_hidden": True}}),
        v4.new_code_cell("b", metadata={"jupyter": dict(folded)}),
        v4.new_markdown_cell("c", metadata={"tags": [tag]}),
    ]
    fresh = tool.clean(v4.new_notebook(cells=cells)).cells
    assert fresh[0].metadata.jupyter == {"outputs_hidden": True} | folded
    assert "jupyter" not in fresh[1].metadata and "jupyter" not in fresh[2].metadata


def test_cleaning_twice_changes_nothing_more_and_keeps_the_ids(used):
    once = tool.clean(used)
    assert tool.text(tool.clean(once)) == tool.text(once)
    assert [c.id for c in once.cells] == [c.id for c in used.cells[:2]]


def test_check_says_which_file_is_not_clean_and_leaves_it(used, tmp_path, capsys):
    path = tmp_path / "01_lab.ipynb"
    nbformat.write(used, path)
    before = path.read_bytes()
    assert tool.main(["--check", str(path)]) == 1
    assert path.read_bytes() == before and "01_lab.ipynb: not clean" in capsys.readouterr().out
    assert tool.main([str(path)]) == 0
    assert tool.main(["--check", str(path)]) == 0
