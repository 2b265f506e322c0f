"""The labs for classes: nbgrader's metadata in the student edition, and sources for nbgrader and otter."""

import json
import re
import sys
from functools import cache
from pathlib import Path

import nbformat
import pytest

from coursekit.teaching import exercises, projects
from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import classroom
import editions
import graded_cells

every_lab = pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda p: p.stem)


@cache
def read(path):
    return nbformat.read(path, as_version=4)


@cache
def made(edition, path):
    return edition(read(path))


def graded(notebook):
    return [c for c in notebook.cells if c.metadata.get("nbgrader", {}).get("grade")]


def answers(notebook):
    return [c for c in notebook.cells if c.metadata.get("nbgrader", {}).get("solution")]


@every_lab
@pytest.mark.parametrize("edition", [editions.student, classroom.nbgrader], ids=["student", "nbgrader"])
def test_each_check_is_locked_and_worth_points_and_follows_its_answer(path, edition):
    notebook = made(edition, path)
    number = path.stem[:2]
    names = {name.replace(".", "-") for name in exercises.names() if name.startswith(f"lab{number}.")}
    ids = [c.metadata.nbgrader.grade_id for c in notebook.cells if "nbgrader" in c.metadata]
    assert len(set(ids)) == len(ids) and all(re.fullmatch(r"[\w-]+", name) for name in ids)
    assert {c.metadata.nbgrader.grade_id for c in graded(notebook)} == names | {f"lab{number}-project"}
    assert sum(c.metadata.nbgrader.points for c in graded(notebook)) == len(names) + 10
    for cell in graded(notebook):
        before = ids[ids.index(cell.metadata.nbgrader.grade_id) - 1]
        assert before == f"{cell.metadata.nbgrader.grade_id}-answer"
        assert cell.metadata.nbgrader.locked and cell.metadata.editable is False and cell.metadata.deletable is False
    assert len(answers(notebook)) == len(graded(notebook))
    nbformat.validate(notebook)


@every_lab
def test_nbgraders_source_has_its_solutions_between_markers_and_its_answers_open(path):
    notebook = made(classroom.nbgrader, path)
    for cell in answers(notebook):
        assert editions.solutions(editions.lines_of(cell.source))
        assert editions.TAG not in cell.metadata.get("tags", []) and "jupyter" not in cell.metadata
    marked = [c for c in notebook.cells if "SOLUTION" in c.source]
    assert marked == answers(notebook)


@every_lab
def test_otters_source_has_each_solution_where_otter_takes_it_out(path):
    notebook = made(classroom.otter, path)
    inside, blocks, left = None, 0, []
    for cell in notebook.cells:
        if cell.cell_type == "raw" and (found := re.match(r"# (BEGIN|END) (SOLUTION|TESTS)", cell.source)):
            inside = found[2] if found[1] == "BEGIN" else None
        elif "SOLUTION" in cell.source:
            assert inside == "SOLUTION"
            emptied = re.sub(r"[ ]*# BEGIN SOLUTION NO PROMPT\n.*?# END SOLUTION\n", "", cell.source, flags=re.S)
            assert "SOLUTION" not in emptied and editions.PLACEHOLDER in emptied
            blocks += 1
        else:
            left.append(cell.source)
    assert blocks == len(answers(made(editions.student, path)))
    said = "\n".join(left)
    for cell in read(path).cells:
        lines = editions.lines_of(cell.source)
        for first, last in editions.solutions(lines) if cell.cell_type == "code" else []:
            assert "\n".join(lines[first + 1 : last]) not in said


def test_an_answer_for_otter_still_runs_with_its_solution_in_it():
    space = {}
    exec(classroom._prompted("def double(x):\n    ### BEGIN SOLUTION\n    return 2 * x\n    ### END SOLUTION\n"), space)
    assert space["double"](3) == 6


def test_an_answer_without_a_check_is_refused_for_otter():
    cell = nbformat.v4.new_code_cell(
        "def f():\n    ### BEGIN SOLUTION\n    return 1\n    ### END SOLUTION", metadata={"tags": [editions.TAG]}
    )
    with pytest.raises(ValueError, match="without a check"):
        classroom.otter(nbformat.v4.new_notebook(cells=[cell]))


@pytest.mark.parametrize("grader", ["nbgrader", "otter"])
def test_a_folder_for_each_lab_is_written(tmp_path, grader, capsys):
    assert classroom.main([grader, "--to", str(tmp_path), "--labs", str(notebooks.NOTEBOOKS[4])]) == 0
    (written,) = tmp_path.rglob("*.ipynb")
    assert written.parent.name == written.stem == "04_ekf" and json.loads(written.read_text("utf-8"))["cells"]
    assert (tmp_path / "nbgrader_config.py").exists() == (grader == "nbgrader")


# --- checks in a grader -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("variable", ["NBGRADER_EXECUTION", "COURSEKIT_GRADING"])
def test_in_a_grader_a_check_that_does_not_pass_raises_its_hint_and_one_that_passes_does_not(monkeypatch, variable):
    monkeypatch.setenv(variable, "autograde")
    with pytest.raises(AssertionError, match=r"F P|transpose|turned"):
        exercises.check("lab04.predict_covariance", lambda P, F, Q: F.T @ P @ F + Q)
    assert exercises.check("lab04.predict_covariance", lambda P, F, Q: F @ P @ F.T + Q)
    monkeypatch.delenv(variable)
    assert not exercises.check("lab04.predict_covariance", lambda P, F, Q: F.T @ P @ F + Q)


def test_in_a_grader_a_project_that_earns_nothing_raises_what_went_wrong(monkeypatch):
    monkeypatch.setenv("NBGRADER_EXECUTION", "autograde")
    runs = lambda project, design, seeds, bar: [projects.Outcome(seed, trouble="it raised") for seed in seeds]  # noqa: E731
    monkeypatch.setattr(projects, "_run_apart", runs)
    with pytest.raises(AssertionError, match="it raised"):
        projects.score("lab04", object, seed=1, runs=1)
    monkeypatch.delenv("NBGRADER_EXECUTION")
    assert projects.score("lab04", object, seed=1, runs=1).mark == 0


def test_other_code_is_no_check():
    assert graded_cells.checked(nbformat.v4.new_code_cell("exercises.names()")) is None
    assert graded_cells.checked(nbformat.v4.new_markdown_cell('exercises.check("lab04.innovation", f)')) is None
