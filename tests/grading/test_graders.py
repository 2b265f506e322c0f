"""nbgrader and otter themselves, in an environment of their own: 0 for the empty lab, full marks for the solved one."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import nbformat
import pytest

from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent.parent / "tools"))
import classroom
import graded_cells

ROOT = Path(__file__).parent.parent.parent
pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("graders")]
WHOLE = {"04_ekf"}  # run with all cells; the others as their answers and checks
every_lab = pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda p: p.stem)


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """``run("nbgrader", …)`` there: this environment's packages at the locked versions, and the two graders."""
    folder = tmp_path_factory.mktemp("graders")
    venv.create(folder, with_pip=True)
    scripts = folder / ("Scripts" if os.name == "nt" else "bin")
    site = next(folder.rglob("site-packages"))
    (site / "course.pth").write_text(f"{sysconfig.get_path('purelib')}\n{ROOT}\n")
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    pins = [re.sub(r"\[.*?\]", "", line) for line in re.findall(r"^([A-Za-z0-9][^\\\n]*)", lock, re.M)]
    (folder / "pins.txt").write_text("\n".join(pins), encoding="utf-8")
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]["graders"]
    command = [str(scripts / "python"), "-m", "pip", "install", "--quiet", "-c", str(folder / "pins.txt"), *wanted]
    installed = subprocess.run(command, capture_output=True, text=True)
    if installed.returncode and not os.environ.get("CI"):
        pytest.skip(f"the graders cannot be installed here: {installed.stderr[-300:]}")
    assert installed.returncode == 0, installed.stderr
    environment = os.environ | {"PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}

    def run(*command, cwd):
        done = subprocess.run([str(scripts / command[0]), *command[1:]], cwd=cwd, env=environment, capture_output=True,
                              text=True, timeout=1800)  # fmt: skip
        return done.stdout + done.stderr

    return run


def prepare(path, grader, folder):
    """The lab for a grader in ``folder``; but for one lab, what no answer needs is left out, which takes minutes."""
    place = folder / path.stem
    place.mkdir(parents=True)
    notebook = grader(nbformat.read(path, as_version=4))
    if path.stem not in WHOLE:
        first = next(cell for cell in notebook.cells if cell.cell_type == "code")
        notebook.cells = [c for c in notebook.cells if c is first or c.cell_type == "raw" or "nbgrader" in c.metadata
                          or "SOLUTION" in c.source or graded_cells.checked(c)]  # fmt: skip
    nbformat.write(notebook, place / path.name)
    return place / path.name


@every_lab
def test_nbgrader_gives_the_empty_lab_nothing_and_the_solved_one_all(path, run, tmp_path):
    source = prepare(path, classroom.nbgrader, tmp_path / "source")
    (tmp_path / "nbgrader_config.py").write_text(classroom.CONFIG)
    said = run("nbgrader", "generate_assignment", path.stem, "--create", cwd=tmp_path)
    released = tmp_path / "release" / path.stem / path.name
    assert released.exists(), said
    assert "SOLUTION" not in released.read_text("utf-8")
    for student, handed_in in (("empty", released), ("solved", source)):
        place = tmp_path / "submitted" / student / path.stem
        place.mkdir(parents=True)
        shutil.copy(handed_in, place)
    said = run("nbgrader", "autograde", path.stem, "--create", cwd=tmp_path)
    ask = (
        "from nbgrader.api import Gradebook\n"
        "with Gradebook('sqlite:///gradebook.db') as book:\n"
        f"    print({{s['student']: s['score'] / s['max_score'] for s in book.submission_dicts('{path.stem}')}})"
    )
    assert run("python", "-c", ask, cwd=tmp_path).strip().endswith(str({"empty": 0.0, "solved": 1.0})), said
    checks = len([c for c in nbformat.read(source, as_version=4).cells if graded_cells.checked(c)])
    empty, solved = (run("nbgrader", "validate", str(lab), cwd=tmp_path) for lab in (released, source))
    assert f"VALIDATION FAILED ON {checks} CELL" in empty and "Success" in solved


@every_lab
def test_otter_takes_every_solution_out_and_its_tests_pass_on_the_solved_lab(path, run, tmp_path):
    source = prepare(path, classroom.otter, tmp_path)
    said = run("otter", "assign", "-v", str(source), "dist", cwd=tmp_path)
    assert "All autograder tests passed" in said, said
    student = (tmp_path / "dist" / "student" / path.name).read_text("utf-8")
    assert "SOLUTION" not in student and "PROMPT" not in student
    for cell in nbformat.read(path, as_version=4).cells:
        for solution in re.findall(r"### BEGIN SOLUTION\n(.*?)\n *### END SOLUTION", cell.source, re.S):
            assert nbformat.v4.new_code_cell(solution).source.strip() not in student.replace("\\n", "\n")
