"""The learner's desk: copies are made where there are none, follow their labs, and are never overwritten."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from tests import notebooks

sys.path.insert(0, str(Path(__file__).parent.parent / "tools"))
import desk as tool

ROOT = Path(__file__).resolve().parent.parent

CELL = "def double(x):\n    ### BEGIN SOLUTION\n    return secret * x\n    ### END SOLUTION"
NAME = "03_noise_model.ipynb"


@pytest.fixture
def master(tmp_path):
    """A lab with a folder of its own; ``master(text)`` changes its first cell."""
    path = tmp_path / "labs" / NAME
    path.parent.mkdir()

    def change(title):
        cells = [nbformat.v4.new_markdown_cell(title), nbformat.v4.new_code_cell(CELL)]
        cells[1].metadata.tags = ["exercise-solution"]
        nbformat.write(nbformat.v4.new_notebook(cells=cells), path)
        return path

    change.path = change("# Lab 3: the first")
    return change


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "mine" / "my_labs"


@pytest.fixture
def lay(master, folder, capsys):
    """Run the command; what it said, on both channels."""

    def run(*arguments, status=0):
        assert tool.main([*arguments, "--to", str(folder), "--labs", str(master.path)]) == status
        captured = capsys.readouterr()
        return captured.out + captured.err

    return run


def sources(path):
    return [cell.source for cell in nbformat.read(path, as_version=4).cells]


def save(path, change):
    """Save a copy as an editor does: run, with metadata of its own, the file's format as it likes."""
    notebook = nbformat.read(path, as_version=4)
    for cell in notebook.cells:
        cell.metadata.update(trusted=True, collapsed=False)
        if cell.cell_type == "code":
            cell.execution_count, cell.outputs = 3, [nbformat.v4.new_output("stream", text="hello")]
    notebook.metadata.language_info = {"name": "python", "version": "3.11.9"}
    change(notebook.cells)
    path.write_text(json.dumps(notebook), encoding="utf-8")


def write_an_answer(cells):
    cells[1].source = "def double(x):\n    return 2 * x"


def listing(folder):
    return sorted(path.name for path in folder.glob("*.ipynb"))


# --- making and keeping -----------------------------------------------------------------------------------------


def test_a_missing_folder_is_made_and_its_copies_hold_no_solution(lay, folder):
    said = lay()
    assert listing(folder) == [NAME] and "secret" not in (folder / NAME).read_text()
    assert "1 new" in said and "never overwritten" in said and "make solved" in said
    assert len(said.strip().splitlines()) == 2


def test_solved_copies_are_one_command_away(lay, folder):
    lay("solved")
    assert "secret" in sources(folder / NAME)[1] and "(solved)" in sources(folder / NAME)[0]


@pytest.mark.parametrize("change", [write_an_answer, lambda cells: cells.pop(), lambda cells: cells.reverse()])
def test_what_a_learner_wrote_is_never_overwritten(lay, folder, change):
    lay()
    save(folder / NAME, change)
    before = (folder / NAME).read_bytes()
    for _ in range(3):
        lay()
    assert (folder / NAME).read_bytes() == before and listing(folder) == [NAME]


def test_a_copy_that_was_only_run_follows_its_lab(lay, master, folder):
    lay()
    save(folder / NAME, lambda cells: cells.append(nbformat.v4.new_code_cell("  \n")))
    master("# Lab 3: the second")
    assert "1 updated" in lay()
    assert sources(folder / NAME)[0] == "# Lab 3: the second" and listing(folder) == [NAME]


def test_line_endings_of_another_system_are_no_change_by_the_learner(lay, master, folder):
    lay()
    save(folder / NAME, lambda cells: [c.update(source=c.source.replace("\n", "\r\n")) for c in cells])
    path = folder / NAME
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    master("# Lab 3: the second")
    assert "1 updated" in lay()


def test_a_newer_lab_is_put_beside_a_copy_that_was_changed_once_and_with_a_word(lay, master, folder):
    lay()
    save(folder / NAME, write_an_answer)
    mine = (folder / NAME).read_bytes()
    master("# Lab 3: the second")
    said = lay()
    assert "03_noise_model.new.ipynb" in said and "left as it is" in said
    assert (folder / NAME).read_bytes() == mine
    assert sources(folder / "03_noise_model.new.ipynb")[0] == "# Lab 3: the second"
    assert "new.ipynb" not in lay(), "said once"

    (folder / "03_noise_model.new.ipynb").unlink()
    lay()
    assert listing(folder) == [NAME], "who throws the offer away is not asked again"


def test_an_offer_that_was_changed_is_not_overwritten_either_and_one_that_was_not_is_replaced(lay, master, folder):
    lay()
    save(folder / NAME, write_an_answer)
    for title in ["# Lab 3: the second", "# Lab 3: the third"]:
        master(title)
        lay()
    assert listing(folder) == ["03_noise_model.ipynb", "03_noise_model.new.ipynb"]
    assert sources(folder / "03_noise_model.new.ipynb")[0] == "# Lab 3: the third"

    save(folder / "03_noise_model.new.ipynb", write_an_answer)
    offer = (folder / "03_noise_model.new.ipynb").read_bytes()
    master("# Lab 3: the fourth")
    assert "03_noise_model.new2.ipynb" in lay()
    assert (folder / "03_noise_model.new.ipynb").read_bytes() == offer
    assert sources(folder / "03_noise_model.new2.ipynb")[0] == "# Lab 3: the fourth"


def test_without_its_record_the_desk_takes_every_copy_for_the_learners_own(lay, master, folder):
    lay()
    before = (folder / NAME).read_bytes()
    master("# Lab 3: the second")
    (folder / tool.RECORD).write_text("{broken")
    said = lay()
    assert "counts as changed by you" in said and "03_noise_model.new.ipynb" in said
    assert (folder / NAME).read_bytes() == before


@pytest.mark.parametrize("content", [b"", b"{broken", b"\xff\xfe\x00", b"[1, 2]", b'{"cells": 3}'])
def test_a_broken_copy_is_kept_and_talked_about(lay, master, folder, content):
    lay()
    (folder / NAME).write_bytes(content)
    assert "can't be read as a notebook" in lay()
    master("# Lab 3: the second")
    assert "03_noise_model.new.ipynb" in lay()
    assert (folder / NAME).read_bytes() == content


def test_an_interrupted_write_leaves_the_old_copy_whole(lay, master, folder, monkeypatch):
    lay()
    before = (folder / NAME).read_bytes()
    master("# Lab 3: the second")
    monkeypatch.setattr(tool.os, "replace", lambda a, b: (_ for _ in ()).throw(OSError("no space left")))
    assert "no space left" in lay(status=1)
    assert (folder / NAME).read_bytes() == before and not list(folder.glob("*.part")) + list(folder.glob(".*.part"))
    monkeypatch.undo()
    lay()
    assert sources(folder / NAME)[0] == "# Lab 3: the second"


def test_a_copy_that_the_record_missed_is_recognised(lay, master, folder):
    """The machine went down between the copy and the record."""
    lay()
    (folder / tool.RECORD).write_text("{}")
    lay()
    master("# Lab 3: the second")
    assert "1 updated" in lay()


def test_a_lab_that_can_not_be_emptied_stops_nothing_but_itself(master, folder, capsys):
    bad = master.path.with_name("04_bad.ipynb")
    nbformat.write(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("### BEGIN SOLUTION")]), bad)
    assert tool.main(["--to", str(folder), "--labs", str(bad), str(master.path)]) == 1
    assert "04_bad.ipynb, cell 1: " in capsys.readouterr().err
    assert listing(folder) == [NAME]


# --- where it does not write ------------------------------------------------------------------------------------


def everything(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("where", ["itself", "above", "link", "link in a link", "dots"])
def test_the_labs_own_folder_and_what_holds_it_are_refused(master, tmp_path, capsys, where):
    own = master.path.parent
    (tmp_path / "link").symlink_to(own)
    (tmp_path / "again").symlink_to(tmp_path / "link")
    to = {
        "itself": own,
        "above": tmp_path,
        "link": tmp_path / "link",
        "link in a link": tmp_path / "again",
        "dots": own / ".." / own.name,
    }[where]
    before = everything(tmp_path)
    assert tool.main(["--to", str(to), "--labs", str(master.path)]) == 1
    assert "expected a folder of your own" in capsys.readouterr().err
    assert everything(tmp_path) == before


@pytest.mark.parametrize("to", [".", "notebooks", "notebooks/mine", "NOTEBOOKS/../notebooks"])
def test_the_course_is_refused_as_a_desk(to, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    assert tool.main(["--to", to]) == 1
    assert "expected a folder of your own" in capsys.readouterr().err
    assert not (ROOT / tool.RECORD).exists() and not (ROOT / "notebooks" / "mine").exists()


def test_a_copy_that_is_a_link_to_the_lab_is_not_written_through(lay, master, folder):
    folder.mkdir(parents=True)
    (folder / NAME).symlink_to(master.path)
    before = master.path.read_bytes()
    lay()
    lay()
    assert master.path.read_bytes() == before and (folder / NAME).is_symlink()
    assert "secret" not in "".join(sources(folder / "03_noise_model.new.ipynb"))


def test_a_folder_that_can_not_be_written_is_an_error_in_words(lay, folder):
    folder.parent.mkdir()
    folder.write_text("a file")
    said = lay(status=1)
    assert "Nothing more is written" in said and "Traceback" not in said


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_desk_that_is_complete_is_no_error(lay, folder):
    lay()
    folder.chmod(0o555)
    try:
        lay()
    finally:
        folder.chmod(0o755)


# --- links and commands -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("edition", ["student", "solved"])
def test_links_to_the_book_lead_there_from_both_folders_and_links_between_labs_stay(edition):
    make, usual = tool.EDITIONS[edition]
    for path in notebooks.NOTEBOOKS:
        notebook = make(nbformat.read(path, as_version=4), tool.way_to_the_book(usual))
        prose = "\n".join(c.source for c in notebook.cells if c.cell_type == "markdown")
        links = set(re.findall(r"\]\(([^)#:]+)[^):]*\)", prose))
        for link in links:
            if link.endswith(".ipynb"):
                assert (ROOT / "notebooks" / link).exists()
            else:
                assert (usual / link).resolve().is_file(), link


def test_make_lab_lays_the_desk_first_and_opens_the_copies():
    dry = ["make", "--no-print-directory", "--dry-run", "READY=Makefile", "--old-file=Makefile", "BIN=bin"]
    said = subprocess.run([*dry, "lab"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[0] == "bin/python tools/desk.py" and len(said) == 2
    assert said[1].startswith("bin/jupyter lab") and "notebooks" not in said[1]
    solved = subprocess.run([*dry, "solved"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    assert solved == ["bin/python tools/desk.py solved"]


def test_jupyterlab_starts_on_the_desk_on_this_machine_only_and_asks_for_no_news():
    from traitlets.config import PyFileConfigLoader

    config = PyFileConfigLoader("jupyter_lab_config.py", path=str(ROOT / "tools")).load_config()
    assert Path(config.ServerApp.preferred_dir) == tool.DESK.resolve()
    assert config.ServerApp.ip == "127.0.0.1"
    assert config.LabApp.news_url is None and "Never" in config.LabApp.check_for_updates_class
    assert "token" not in repr(config).lower() and "password" not in repr(config).lower(), "the default: a fresh token"


def test_the_desk_is_not_committed():
    assert "my_labs/" in (ROOT / ".gitignore").read_text().splitlines()
