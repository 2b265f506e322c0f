"""CONTRIBUTING.md, followed to the letter in a copy of the house: what it writes is written, what it runs is run."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
FENCE = re.compile(r"^([ ]*)(`{3,})(\w*)\n(.*?)^\1\2[ ]*$", re.M | re.S)
COPIED = ["coursekit", "tests", "tools", "notebooks", "data", "book", "pyproject.toml", "Makefile", "README.md"]
NAMED = re.compile(r"(?:#|//) (cell: )?(\S+)\n")
one_copy = pytest.mark.xdist_group("contributing")


def blocks(kind):
    """The fenced blocks of a kind, without their indent."""
    return [textwrap.dedent(m[4]) for m in FENCE.finditer(TEXT) if m[3] == kind]


def commands(section):
    """The lines to type in a section."""
    (body,) = re.findall(rf"^## {section}\n(.*?)(?=^## )", TEXT, re.M | re.S)
    lines = [line for m in FENCE.finditer(body) if m[3] == "sh" for line in m[4].splitlines()]
    return [line.split("  #")[0].strip() for line in lines if line.strip()]


@pytest.fixture(scope="module")
def house(tmp_path_factory):
    """A copy of the house with a new lab, an explorer, a touched figure, an exercise, a project and a failure."""
    root = tmp_path_factory.mktemp("house")
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("_build", "__pycache__"))
        else:
            shutil.copy(ROOT / name, root)
    (begin,) = commands("A new lab")[:1]
    run(root, begin)
    cells = []
    for code in [*blocks("python"), *blocks("js")]:
        if not (named := NAMED.match(code)):
            continue
        if named[1]:
            cells.append(nbformat.v4.new_code_cell(code[named.end() :].strip(), metadata={"tags": [named[2]]}))
        else:
            write(root / named[2], code[named.end() :])
    (exercise,) = [code for code in blocks("markdown") if "{exercise}" in code]
    add_cells(root / "notebooks" / "10_my_lab.ipynb", [nbformat.v4.new_markdown_cell(exercise.strip()), *cells])
    scenes = root / "coursekit" / "teaching" / "touch" / "__init__.py"
    (title,) = re.findall(r'in `SCENES`, `(".*?": ".*?")`', TEXT)
    scenes.write_text(scenes.read_text("utf-8").replace("SCENES = {", f"SCENES = {{\n    {title},"), encoding="utf-8")
    return root


def write(path, code):
    """A whole file, where the code opens with its docstring or is no Python; else the end of one that is there."""
    whole = code.startswith('"""') or path.suffix == ".js"
    before = "" if whole else path.read_text(encoding="utf-8") + "\n\n"
    path.write_text(before + code, encoding="utf-8")


def add_cells(path, cells):
    notebook = nbformat.read(path, as_version=4)
    notebook.cells += cells
    nbformat.write(notebook, path)


def run(root, line, *more):
    """One line of the text, in the copy, with this Python."""
    program, *arguments = shlex.split(line)
    assert program == ".venv/bin/python"
    environment = os.environ | {"PYTHONPATH": str(root), "PYTHONUTF8": "1", "PYTEST_ADDOPTS": ""}
    done = subprocess.run(
        [sys.executable, *arguments, *more], cwd=root, env=environment, capture_output=True, text=True, encoding="utf-8"
    )
    assert done.returncode == 0, f"{line}\n{done.stdout[-3000:]}{done.stderr[-2000:]}"
    return done.stdout


def test_every_piece_that_the_text_writes_is_found():
    named = [NAMED.match(code)[2] for code in [*blocks("python"), *blocks("js")] if NAMED.match(code)]
    assert sorted(named) == [
        *("check", "coursekit/labs/lab10/exercises.py", "coursekit/labs/lab10/explorers.py"),
        *("coursekit/labs/lab10/failures.py", "coursekit/labs/lab10/project.py", "coursekit/teaching/touch/braking.js"),
        *("exercise-solution", "tests/labs/lab10/answers.py"),
    ]


def test_the_files_and_targets_that_the_text_names_are_there():
    paths = re.findall(r"`((?:tools|tests|coursekit|book|notebooks)/[\w./]+)`", TEXT)
    there = [path for path in paths if "NN" not in path and "lab10" not in path and "10_my_lab" not in path]
    assert len(there) > 10
    assert [path for path in there if not (ROOT / path).exists() and not path.startswith("book/_build")] == []
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    assert set(re.findall(r"`make ([a-z-]+)", TEXT)) | set(re.findall(r"^make ([a-z-]+)", TEXT, re.M)) <= targets


@pytest.fixture(scope="module")
def finished(house):
    """The copy after the tools that the text asks for."""
    run(house, ".venv/bin/python tools/clean_notebooks.py notebooks/10_my_lab.ipynb")
    for line in commands("A new lab")[1:-1]:
        run(house, line)
    return house


@one_copy
@pytest.mark.slow  # it makes a lab and asks all that is asked of one
def test_a_new_lab_with_a_new_exercise_is_green_at_once(finished):
    line, alone = commands("A new lab")[-1], ["-p", "no:cacheprovider", "-k", "10 or symbol or twice"]
    only = line.replace("tests/test_house.py", "").replace("tests/labs/test_labs.py", "")  # all of it below
    said = run(finished, only, *alone)
    assert re.search(r"\d{2,} passed", said), said


@pytest.mark.slow
@one_copy
@pytest.mark.parametrize("section", ["A new lab", "An exercise", "A failure"])
def test_the_tests_that_a_section_asks_for_are_green_in_full(finished, section):
    said = run(finished, commands(section)[-1], "-p", "no:cacheprovider", "-m", "not slow")
    assert " passed" in said, said


@one_copy
def test_what_is_new_works_explorer_touched_figure_project_exercise_and_failure(house):
    program = """
        import numpy as np
        from coursekit.labs.lab10 import exercises as checks, failures
        from coursekit.labs.lab10.explorers import Forgetting
        from coursekit.labs.lab10.project import PROJECT
        from coursekit.teaching.exercises import Misconception
        from coursekit.teaching.explore import Slider, explore, sweep
        from coursekit.teaching.failures import _gallery
        from coursekit.teaching.touch import touch
        from tests.labs.judge import Judge
        from tests.labs.lab10.answers import ANSWERS

        print(sweep(explore(Forgetting, alt="{time} s", time=Slider([0, 1, 8]), noise=[0.1, 0.5])))
        print("robot runs on" in touch("braking", alt="A robot that brakes.")._repr_html_())
        judge = Judge(PROJECT, PROJECT.reference, range(5))
        print(judge(PROJECT.reference).mark, judge(lambda v, a: v / (2 * a)).mark < 60)
        failure = _gallery["lab10.linear_way"]
        print(failure.check(failure.right), failure.check(failure.wrong))
        answers = ANSWERS["lab10.way_to_stop"]
        for answer in answers.right:
            checks.way_to_stop(answer, np.random.default_rng(0))
        for answer, hint in answers.wrong.values():
            try:
                checks.way_to_stop(answer, np.random.default_rng(0))
            except Misconception as said:
                print(hint in str(said))
    """
    (house / "try.py").write_text(textwrap.dedent(program), encoding="utf-8")
    said = run(house, ".venv/bin/python try.py").split()
    assert said == ["[]", "True", "100", "True", "True", "False", *(["True"] * 6)]
