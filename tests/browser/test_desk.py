"""The learner's desk in JupyterLab, opened by the very command of `make lab`.

The lab is the one of ``test_live_lab``: the first, or the one that COURSEKIT_LIVE_LAB names.
"""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from tests.browser.test_live_lab import IDLE, START, TOKEN, chosen_lab, free_port, wait_for_answer

pytestmark = pytest.mark.browser
ROOT = Path(__file__).parents[2]
FOLDED = {"hide-input", "check", "exercise-solution"}
EVERY_CELL = {"windowingMode": "none"}  # all cells are in the page, so that a test can see them
PAUSE = 3000  # milliseconds in which JupyterLab would ask about its news


def command_of_make_lab(*arguments):
    """What `make lab` runs once the desk is laid, with this Python's JupyterLab."""
    make = [
        "make",
        "--dry-run",
        "--no-print-directory",
        "--old-file=Makefile",
        "READY=Makefile",
        f"BIN={Path(sys.executable).parent}",
        f"ARGS={shlex.join(arguments)}",
    ]
    said = subprocess.run([*make, "lab"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return shlex.split(said.strip().splitlines()[-1])


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """The address of a JupyterLab on a fresh desk, with a home of its own and nobody's settings but one."""
    home = tmp_path_factory.mktemp("desk")
    for edition, folder in [("student", "my_labs"), ("solved", "my_labs/solved")]:
        subprocess.run([sys.executable, "tools/desk.py", edition, "--to", home / folder], cwd=ROOT, check=True)
    tracker = home / "settings" / "@jupyterlab" / "notebook-extension" / "tracker.jupyterlab-settings"
    tracker.parent.mkdir(parents=True)
    tracker.write_text(json.dumps(EVERY_CELL))
    folders = {"LAB_SETTINGS": "settings", "LAB_WORKSPACES": "workspaces", "_CONFIG": "config", "_RUNTIME": "runtime"}
    environment = os.environ | {f"JUPYTER{name}_DIR": str(home / folder) for name, folder in folders.items()}
    port = free_port()
    command = command_of_make_lab(
        "--no-browser", f"--ServerApp.port={port}", "--ServerApp.port_retries=0", f"--IdentityProvider.token={TOKEN}",
        f"--ServerApp.root_dir={home}", f"--ServerApp.preferred_dir={home / 'my_labs'}",
    )  # fmt: skip
    with open(home / "server.log", "w") as log:
        server = subprocess.Popen(command, env=environment, stdout=log, stderr=log, cwd=ROOT)
    try:
        address = f"http://127.0.0.1:{port}"
        wait_for_answer(f"{address}/api?token={TOKEN}", server, home / "server.log")
        yield address
    finally:
        server.terminate()
        server.wait(20)


def open_lab(page, address, folder):
    """Open a copy; what its cells say, as the reader sees them, and how many of them are folded."""
    page.set_viewport_size({"width": 1440, "height": 1000})
    name = chosen_lab().name
    page.goto(f"{address}/lab/tree/{folder}/{name}?reset&token={TOKEN}")
    page.locator(IDLE).wait_for(timeout=START * 1000)
    page.locator("#jp-main-statusbar").get_by_text("| Idle").wait_for(timeout=START * 1000)
    page.wait_for_function(
        "() => document.querySelectorAll('.jp-Notebook .jp-MarkdownCell:not(.jp-mod-rendered)').length === 0"
    )
    page.wait_for_timeout(PAUSE)
    text = page.locator(".jp-Notebook").evaluate("(n) => n.textContent")
    return text, page.locator(".jp-CodeCell .jp-InputPlaceholder").count()


def secrets():
    """The lines of the lab's solutions that are too long to stand anywhere by chance."""
    cells = nbformat.read(chosen_lab(), as_version=4).cells
    between = re.findall(r"### BEGIN SOLUTION\n(.*?)### END SOLUTION", "\n".join(c.source for c in cells), re.S)
    lines = [line.strip() for block in between for line in block.splitlines()]
    given = "\n".join(c.source for c in cells if "exercise-solution" not in c.metadata.get("tags", []))
    return [line for line in lines if len(line) > 20 and line not in given]


def solutions():
    return sum(c.source.count("### BEGIN SOLUTION") for c in nbformat.read(chosen_lab(), as_version=4).cells)


def folded(but=frozenset()):
    cells = nbformat.read(chosen_lab(), as_version=4).cells
    return sum(bool((FOLDED - but) & set(c.metadata.get("tags", []))) for c in cells)


def test_the_desk_opens_without_a_question_and_shows_the_copies(page, desk):
    page.goto(f"{desk}/lab?token={TOKEN}")
    page.locator(".jp-DirListing-itemText", has_text=chosen_lab().name).wait_for(timeout=START * 1000)
    page.locator(".jp-Launcher").wait_for(timeout=START * 1000)
    page.wait_for_timeout(PAUSE)
    assert page.locator(".Toastify__toast, .jp-Dialog").all_inner_texts() == []
    assert [complaint for complaint in page.complaints if "leaves the site" in complaint] == []


def test_a_copy_holds_no_solution_and_its_cells_are_folded_and_its_sources_are_words(page, desk):
    text, hidden = open_lab(page, desk, "my_labs")
    assert text.count("your lines here") == solutions() > 0 and "Stuck?" in text and secrets()
    assert [line for line in secrets() if line in text] == []
    assert hidden == folded(but={"exercise-solution"})
    assert "Sources" in text
    assert re.findall(r"\{?cite\S*`|\b[a-z]+(?:19|20)\d\d\b", text) == []
    assert page.locator(".Toastify__toast, .jp-Dialog").all_inner_texts() == []


def test_a_solved_copy_has_its_solutions_folded(page, desk):
    text, hidden = open_lab(page, desk, "my_labs/solved")
    assert hidden == folded()
    assert "(solved)" in text and [line for line in secrets() if line in text] == []
