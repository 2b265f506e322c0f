"""The archive for a class without answers: all that a lab needs, and no line of a solution."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import handout

NAMES = [path.name for path in [*notebooks.NOTEBOOKS, *notebooks.OPTIONAL]]
one_worker = pytest.mark.xdist_group("handout")

PAGE = """<div class="body"><div class="take-along"><p><a href="book.pdf">with solutions</a></p></div>
<div class="cell tag_exercise-solution tag_hide-cell docutils container"><details><div><pre>
<span class="k">return</span> <span class="n">x</span> <span class="o">&lt;</span> 2</pre></div></details></div>
<div class="cell tag_check docutils container"><div><pre><span class="n">exercises</span><span class="o">.</span>
<span class="n">check</span><span class="p">(</span>"lab02.x", x)</pre></div><div class="output">Correct</div></div>
<div class="cell tag_check docutils container"><div><pre>assert True</pre></div></div>
<ul><li><a href="../_sources/notebooks/02_x.ipynb" title="a">Lab to fill in</a>
</li><li><a href="../_sources/notebooks/02_x.solved.ipynb"
  class="b">Solved lab</a>
</li></ul></div>"""


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """The archive without the book, unpacked, and its wheel unpacked beside it."""
    folder = tmp_path_factory.mktemp("handout")
    assert handout.main(["--without-book", "--to", str(folder)]) == 0
    (archive,) = folder.glob("*.zip")
    zipfile.ZipFile(archive).extractall(folder)
    (inside,) = (path for path in folder.iterdir() if path.is_dir())
    (wheel,) = inside.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(folder / "installed")
    return inside


@one_worker
def test_the_archive_holds_every_lab_the_wheel_the_lock_and_what_to_do(unpacked):
    assert {path.name for path in (unpacked / "labs").iterdir()} == set(NAMES)
    assert (unpacked / "requirements.lock").read_bytes() == (handout.ROOT / "requirements.lock").read_bytes()
    (wheel,) = unpacked.glob("*.whl")
    said = (unpacked / "README.md").read_text(encoding="utf-8")
    assert wheel.name in said and "{" not in said


@one_worker
def test_no_line_of_a_solution_and_no_way_to_one_is_in_the_archive(unpacked):
    assert [*handout.leaks(unpacked)] == []
    for path in (unpacked / "labs").iterdir():
        text = path.read_text(encoding="utf-8")
        assert "SOLUTION" not in text and "make solved" not in text
        assert "your lines here" in text or path.name not in {lab.name for lab in notebooks.NOTEBOOKS}


def test_a_solution_that_is_left_in_a_page_a_lab_or_an_index_is_found(tmp_path):
    secret = [*handout.telling_lines()]
    assert len(secret) > 100
    line = next(line for line in secret if "<" not in line and '"' not in line)
    (tmp_path / "a.html").write_text(f"<pre><span>{line[:10]}</span> {line[10:]}</pre>", encoding="utf-8")
    (tmp_path / "index.js").write_text(f"x = '{line}'", encoding="utf-8")
    lab = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(f"    {line}")])
    nbformat.write(lab, tmp_path / "b.ipynb")
    (tmp_path / "c.html").write_text("<p>nothing</p>", encoding="utf-8")
    assert [said.split(" holds")[0] for said in handout.leaks(tmp_path)] == ["a.html", "b.ipynb", "index.js"]


def test_a_page_loses_its_solutions_its_verdicts_and_the_solved_lab_and_nothing_else():
    left = handout.without_solutions(PAGE)
    assert not [word for word in ("return", "Correct", "Solved lab", "with solutions") if word in left]
    assert "assert True" in left and "Lab to fill in" in left
    assert left.count("<div") == left.count("</div") and left.count("<li") == left.count("</li")
    with pytest.raises(ValueError, match="expected </div>"):
        handout.without_solutions(PAGE.replace("</div>", ""))


def test_of_the_book_only_what_can_be_searched_or_is_drawn_goes_along(tmp_path):
    names = ["a.html", "a.solved.ipynb", "a.ipynb", "book.pdf", "site.zip", "objects.inv", "a.webp", "folder.zip"]
    (tmp_path / "folder.zip").mkdir()
    left_behind = ["a.solved.ipynb", "book.pdf", "site.zip", "objects.inv"]
    assert handout._not_for_a_class(str(tmp_path), names) == left_behind


def test_an_archive_with_the_book_wants_the_book(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(handout, "BOOK", tmp_path / "not_there")
    monkeypatch.setattr(handout, "build_wheel", lambda folder: folder / "coursekit.whl")
    assert handout.main(["--to", str(tmp_path / "dist")]) == 1
    assert "make book" in capsys.readouterr().err and not [*(tmp_path / "dist").iterdir()]


def from_the_wheel(unpacked):
    """An environment in which the package is the wheel's and the checkout is nowhere."""
    kept = {name: value for name, value in os.environ.items() if name not in {"COURSEKIT_DATA", "PYTHONPATH"}}
    return kept | {"PYTHONPATH": str(unpacked.parent / "installed"), "OPENBLAS_NUM_THREADS": "1"}


@one_worker
def test_the_wheel_brings_its_own_data(unpacked, tmp_path):
    program = (
        "import coursekit; from coursekit import datasets; from coursekit.world.arena import Arena\n"
        "from coursekit.labs.lab04 import runs\n"
        "print(coursekit.__file__); print(len(datasets.load('landmark_log')), len(Arena.load('lab').cylinders))\n"
        "print(datasets.project_file('seafloor.jpg').stat().st_size > 1e5, runs.recorded().truth.shape[0])"
    )
    said = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=from_the_wheel(unpacked), capture_output=True, text=True
    )
    place, *rest = said.stdout.split()
    assert place.startswith(str(unpacked.parent)), said.stderr
    assert rest == ["1842", "6", "True", "60"]


@pytest.mark.slow
@one_worker
@pytest.mark.parametrize("name", NAMES)
def test_a_lab_of_the_archive_runs_from_the_wheel_alone(unpacked, name):
    path = unpacked / "labs" / name
    client = NotebookClient(
        nbformat.read(path, as_version=4), timeout=300, resources={"metadata": {"path": str(path.parent)}}
    )
    client.nb.cells.insert(0, nbformat.v4.new_code_cell("import coursekit; print(coursekit.__file__)"))
    client.execute(env=from_the_wheel(unpacked))
    assert client.nb.cells[0].outputs[0].text.startswith(str(unpacked.parent))
