"""Of a notebook that is only read, an answer takes along what it needs, and nothing else."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent.parent / "tools"))
from grading.notebook import Notebook, Task, parse, read

TASK = Task("lab04.innovation", "exercise", "innovation")


def needs(target, *cells, given=()):
    return [source.strip() for _, source in parse(list(cells)).needed(target, parse(list(given)))]


def test_helpers_constants_and_imports_come_along_and_the_rest_stays():
    cells = ("import math, os", "G = 9.81\nother = 1", "def helper(x):\n    return math.sin(G * x)", "while True: pass")
    assert needs("f", *cells, "def f(x):\n    return helper(x)") == [
        "import math", "G = 9.81", cells[2], "def f(x):\n    return helper(x)"
    ]  # fmt: skip


def test_a_functions_own_variables_need_nothing_of_the_notebook():
    assert (
        len(needs("f", "for x in iter(int, 1):\n    y = x", "def f(x):\n    y = [x for x in range(3)]\n    return y"))
        == 1
    )


def test_what_changes_a_name_comes_along():
    cells = (
        "table = []",
        "table.append(3)",
        "class F:\n    pass",
        "F.run = lambda self: table[0]",
        "setattr(F, 'x', 1)",
    )
    assert len(needs("F", *cells)) == len(cells)


def test_a_call_on_a_module_changes_nothing():
    assert (
        len(needs("f", "import numpy as np", "np.testing.assert_allclose(slow(), 1)", "def f():\n    return np.pi"))
        == 2
    )


def test_the_labs_own_imports_stand_first_for_a_notebook_that_lost_them():
    assert (
        needs("f", "def f():\n    return np.pi", given=["import numpy as np\nimport math"])[0] == "import numpy as np"
    )


def test_the_later_definition_counts_as_in_a_run_from_top_to_bottom():
    assert needs("f", "def f():\n    return 1", "def f():\n    return 2")[-1].endswith("2")


def test_ipythons_lines_are_left_out_and_python_that_looks_like_them_stays():
    notebook = parse(
        ["%matplotlib inline\n!ls\nnp.sin?\nx = 1", "%%bash\nrm -r .", "y = (5\n% 2)", 't = """\n!no\n"""']
    )
    assert not notebook.trouble and [s.binds for s in notebook.statements if s.binds] == [{"x"}, {"y"}, {"t"}]
    assert any("!no" in s.source for s in notebook.statements)


def test_a_broken_cell_costs_itself_alone():
    notebook = parse(["x = 1", "def f(:", "y = 2", "\0"])
    assert [s.binds for s in notebook.statements if s.binds] == [{"x"}, {"y"}]
    assert [t.split(" is")[0] for t in notebook.trouble] == ["Code cell 2, line 1", "Code cell 4"]


def test_two_statements_on_a_line_are_two():
    assert needs("b", "a = 1; b = 2") == ["b = 2"]


def test_an_answer_has_the_labs_name_or_the_one_in_the_students_own_check():
    assert parse(["innovation = min"]).answer(TASK) == "innovation"
    assert parse(["mine = min", 'exercises.check("lab04.innovation", mine)']).answer(TASK) == "mine"
    assert parse(['exercises.check("lab04.innovation", mine)']).answer(TASK) is None
    assert Notebook().answer(TASK) is None


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"cells": 3}', '{"cells": [{"cell_type": "code"}]}', "[" * 100_000, "\udc80"]
)
def test_a_file_that_is_no_notebook_is_a_sentence(tmp_path, content):
    path = tmp_path / "a.ipynb"
    path.write_bytes(content.encode("utf-8", "surrogatepass"))
    assert "no notebook that can be read" in read(path).trouble[0]


def test_sources_as_lists_and_as_texts_are_read(tmp_path):
    path = tmp_path / "a.ipynb"
    cells = [{"cell_type": "code", "source": ["x = 1\n", "y = 2"]}, {"cell_type": "markdown", "source": "no"}]
    path.write_text(json.dumps({"cells": cells}), encoding="utf-8-sig")
    assert [s.source.strip() for s in read(path).statements] == ["x = 1", "y = 2"]
