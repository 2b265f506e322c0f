"""A class of sinners is graded: a sin costs its student the points that it concerns, and nobody else's evening."""

import csv
import os
import socket
import sys
import tempfile
import threading
import time
from pathlib import Path

import nbformat
import pytest

from tests.grading import sins

sys.path.insert(0, str(Path(__file__).parent.parent.parent / "tools"))
import grade
from grading.limits import Limits

ROOT = Path(__file__).parent.parent.parent
pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="graded where processes can be walled in"),
    pytest.mark.xdist_group("grading"),
]
SINS = sins.FIRST | sins.FURTHER
EXERCISES = ("lab04.innovation", "lab04.predict_covariance")
LIMITS = Limits(seconds=4.0, project_seconds=30.0, memory=500, file_size=5)


def notebook(cells):
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])


def hand_in(folder, name, cells):
    folder.mkdir(exist_ok=True)
    nbformat.write(notebook(cells), folder / f"{name}.ipynb")


class Class:
    """A graded class: marks, and what each student was told."""

    def __init__(self, folder, limits=LIMITS, jobs=2):
        labs = grade.course(["lab04"])
        self.memory = grade.Memory(folder.with_name(folder.name + "-judged"), [str(limits)])
        self.people = {p.name: p for p in grade.collect(folder, labs, self.memory.seed)}
        self.walls = grade.judge_all(list(self.people.values()), self.memory, limits, jobs, quiet=True)

    def points(self, name, exercise):
        return self.people[name].results[exercise].points

    def told(self, name, exercise):
        return " ".join(self.people[name].results[exercise].verdict["said"])


@pytest.fixture(scope="module")
def outside():
    """A file's name, where nobody may write, and a port that counts its connections."""
    with tempfile.TemporaryDirectory() as folder, socket.create_server(("127.0.0.1", 0)) as server:
        met = []

        def serve():
            while True:
                try:
                    met.append(server.accept()[1])
                except OSError:
                    return

        threading.Thread(target=serve, daemon=True).start()
        yield Path(folder, "outside.txt"), server.getsockname()[1], met
        server.shutdown(socket.SHUT_RDWR)


@pytest.fixture(scope="module")
def sinners(tmp_path_factory, outside):
    folder = tmp_path_factory.mktemp("class") / "handed-in"
    file, port, _ = outside
    solved = ROOT / "notebooks" / "04_ekf.ipynb"
    for name, sin in SINS.items():
        cells = [c.replace("FILE", repr(str(file))).replace("PORT", str(port)).replace("SOLVED", repr(str(solved)))
                 for c in sin.cells]  # fmt: skip
        hand_in(folder, name, cells)
    (folder / "is no notebook.ipynb").write_text("\x00\x01")
    (folder / "is a list.ipynb").write_text("[]")
    began = time.monotonic()
    graded = Class(folder)
    graded.seconds = time.monotonic() - began
    return graded


@pytest.mark.parametrize("name", SINS)
def test_a_sin_costs_its_points_and_no_others(sinners, name):
    sin = SINS[name]
    if name == "reads the solved lab" and "Landlock" not in sinners.walls:
        pytest.skip("only the kernel keeps a process from reading")
    told = sinners.told(name, EXERCISES[0])
    assert sinners.points(name, EXERCISES[0]) == sin.points, told
    assert sin.told in told
    assert sinners.points(name, EXERCISES[1]) == sin.second, sinners.told(name, EXERCISES[1])


def test_what_was_forbidden_did_not_happen(sinners, outside):
    file, _, met = outside
    assert not file.exists() and met == []


@pytest.mark.parametrize("name", ["is no notebook", "is a list"])
def test_what_is_no_notebook_is_said_and_earns_nothing(sinners, name):
    student = sinners.people[name]
    assert "no notebook that can be read" in " ".join(student.remarks)
    assert all(r.points == 0 for r in student.results.values())


def test_a_notebook_that_is_not_python_names_the_cell(sinners):
    assert "Code cell 2, line 1 is not Python" in " ".join(sinners.people["is not Python"].remarks)


def test_the_walls_that_held_are_told(sinners):
    assert "time, memory and file limits" in sinners.walls and "audit hook" in sinners.walls


def generous(monkeypatch):
    """Puts a judge in place that gives everybody all points; returns the list of those who asked it."""
    asked = []

    class Generous(grade.Bench):
        def verdict(self, work):
            asked.append(work)
            return {"share": 1.0, "said": ["</li>"], "mark": None}

    monkeypatch.setattr(grade, "Bench", Generous)
    return asked


def test_a_second_run_judges_only_what_has_changed(tmp_path, monkeypatch):
    folder = tmp_path / "class"
    for name in ("ada", "bob"):
        hand_in(folder, name, (sins.IMPORTS, sins.RIGHT, *sins.CHECKS[:1]))
    asked = generous(monkeypatch)
    assert Class(folder).points("ada", EXERCISES[0]) == 1 and len(asked) == 2
    hand_in(folder, "ada", (sins.IMPORTS, "# a remark elsewhere", sins.RIGHT, "print('a cell')", *sins.CHECKS[:1]))
    hand_in(folder, "bob", (sins.IMPORTS, sins.WRONG, *sins.CHECKS[:1]))
    again = Class(folder)
    assert len(asked) == 3 + 1  # bob's function has changed; ada's stands in another cell, which hints would name
    Class(folder)
    assert len(asked) == 4 and again.points("bob", EXERCISES[0]) == 1


def test_another_class_is_asked_with_other_numbers_and_one_class_with_the_same(tmp_path):
    first, second = (grade.Memory(tmp_path / name, []) for name in ("a", "b"))
    assert first.seed != second.seed and grade.Memory(tmp_path / "a", []).seed == first.seed


def test_a_student_is_a_file_or_a_folder_of_notebooks(tmp_path):
    hand_in(tmp_path, "ada", ())
    (tmp_path / "bob").mkdir()
    hand_in(tmp_path / "bob" / "04", "04_ekf", ())
    hand_in(tmp_path / "bob" / ".ipynb_checkpoints", "04_ekf-checkpoint", ())
    hand_in(tmp_path / "bob", "00_the_world", ())
    assert {name: len(paths) for name, paths in grade.students(tmp_path).items()} == {"ada": 1, "bob": 2}


def test_the_table_and_the_page_hold_every_student_and_nothing_of_theirs_acts(tmp_path, monkeypatch):
    generous(monkeypatch)
    folder = tmp_path / "class"
    hand_in(folder, "=cmd()", (sins.SECOND, "x = '</li><script>alert(1)</script>' y", *sins.CHECKS))
    hand_in(folder, "<b>ada", (sins.SECOND, *sins.CHECKS))
    assert grade.main([str(folder), "--labs", "lab04", "--to", str(tmp_path / "out"), "--jobs", "1"]) == 0
    rows = list(csv.DictReader((tmp_path / "out" / "marks.csv").open(encoding="utf-8-sig")))
    assert [row["student"] for row in rows] == ["<b>ada", "'=cmd()"]
    assert [row["total"] for row in rows] == ["1", "1"] and {row["of"] for row in rows} == {"15"}
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page and "<b>ada" not in page and "&lt;b&gt;ada" in page
    assert "http" not in page and "color-scheme: light dark" in page


def test_a_folder_without_notebooks_and_an_unknown_lab_are_refused(tmp_path, capsys):
    for arguments in ([str(tmp_path / "nowhere")], [str(tmp_path)], [str(tmp_path), "--labs", "lab77"]):
        with pytest.raises(SystemExit):
            grade.main(arguments)
    assert "no lab named lab77" in capsys.readouterr().err


# --- projects ---------------------------------------------------------------------------------------------------


DESIGN = """class MyFilter:
    def __init__(self, mean, cov):
        self.mean, self.cov = mean, cov

    def predict(self, control, control_cov, dt):
        BODY

    def correct(self, landmark, z, R):
        pass"""


@pytest.fixture(scope="module")
def projects(tmp_path_factory):
    """Projects of lab 4, one run each: the package's own filter, and designs with a sin."""
    folder = tmp_path_factory.mktemp("projects") / "handed-in"
    own = (
        "import numpy as np\nfrom coursekit.labs.lab04.project import Reference\n\nclass MyFilter(Reference):\n    pass"
    )
    score = 'exercises.score("lab04", MyFilter, runs=1)'
    looks = (
        "import sys\n        frame = sys._getframe()\n        while frame:\n"
        "            if 'scenario' in frame.f_locals:\n"
        "                self.mean = frame.f_locals['scenario'].truth[1]\n            frame = frame.f_back"
    )
    for name, design in {
        "sound": own,
        "loops": DESIGN.replace("BODY", "while True:\n            pass"),
        "ends": DESIGN.replace("BODY", "import os\n        os._exit(0)"),
        "looks": DESIGN.replace("BODY", looks),
        "forges": "from coursekit.teaching import judging\njudging.attempt = None\n"
        + DESIGN.replace("BODY", "self.mean = None"),
    }.items():
        hand_in(folder, name, ("from coursekit import exercises", design, score))
    return grade_projects(folder)


def grade_projects(folder):
    """Only the projects, one run each."""
    lab = grade.course(["lab04"])["lab04"]
    lab.tasks = [grade.Task(t.name, t.kind, t.target, 1) for t in lab.tasks if t.kind == "project"]
    memory = grade.Memory(folder.with_name("judged"), [])
    people = {p.name: p for p in grade.collect(folder, {"lab04": lab}, memory.seed)}
    grade.judge_all(list(people.values()), memory, Limits(seconds=4.0, project_seconds=30.0), 1, quiet=True)
    return people


def result(projects, name):
    return projects[name].results["lab04.project"]


def test_a_sound_design_earns_all_points(projects):
    assert result(projects, "sound").points == 10, result(projects, "sound").verdict


def test_a_design_that_is_the_packages_own_is_remarked_on(projects):
    assert "Reference" in " ".join(projects["sound"].remarks) and not projects["loops"].remarks


@pytest.mark.parametrize(
    ("name", "told"), [("loops", "endless loop"), ("ends", "ended the process"), ("forges", "mean is None")]
)
def test_a_sinful_design_is_told_what_it_did_and_earns_nothing(projects, name, told):
    assert result(projects, name).points == 0 and told in " ".join(result(projects, name).verdict["said"])


def test_a_design_cannot_look_up_the_truth(projects):
    assert result(projects, "looks").verdict["mark"] <= 10  # what it gets for leaving its arguments alone
