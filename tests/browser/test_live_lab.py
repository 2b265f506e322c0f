"""A lab in JupyterLab: run it from top to bottom, move a slider, see the picture change.

The lab is the first one, or the one that COURSEKIT_LIVE_LAB names ("03").
"""

import json
import os
import secrets
import shutil
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

from tests import notebooks

pytestmark = pytest.mark.browser
TOKEN = secrets.token_hex(16)
START, RUN, STILL = 45, 240, 10  # seconds: to open it, to run it, to stand still before it counts as stuck
SETTINGS = {
    # All cells are in the page, so that a test can see them; no questions, no news.
    "notebook-extension/tracker": {"windowingMode": "none"},
    "apputils-extension/notification": {"checkForUpdates": False, "doNotDisturbMode": True, "fetchNews": "false"},
}
IDLE = '.jp-NotebookPanel:not(.lm-mod-hidden) .jp-Notebook-ExecutionIndicator[data-status="idle"]'


def chosen_lab():
    wanted = os.environ.get("COURSEKIT_LIVE_LAB", "")
    found = [path for path in notebooks.NOTEBOOKS if path.name.startswith(wanted)]
    if not found:
        pytest.fail(f"no lab begins with {wanted!r}")
    return found[0]


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


@pytest.fixture
def jupyter(tmp_path):
    """The address of a JupyterLab with a copy of the lab, and with a home of its own."""
    shutil.copy(chosen_lab(), tmp_path / "lab.ipynb")
    for name, values in SETTINGS.items():
        path = tmp_path / "settings" / "@jupyterlab" / f"{name}.jupyterlab-settings"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(values))
    port = free_port()
    home = {
        "JUPYTERLAB_SETTINGS_DIR": "settings",
        "JUPYTERLAB_WORKSPACES_DIR": "workspaces",
        "JUPYTER_CONFIG_DIR": "config",
        "JUPYTER_RUNTIME_DIR": "runtime",
        "IPYTHONDIR": "ipython",
    }
    environment = os.environ | {name: str(tmp_path / folder) for name, folder in home.items()}
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--ServerApp.ip=127.0.0.1",
               f"--ServerApp.port={port}", "--ServerApp.port_retries=0", f"--IdentityProvider.token={TOKEN}",
               f"--ServerApp.root_dir={tmp_path}"]  # fmt: skip
    with open(tmp_path / "server.log", "w") as log:
        server = subprocess.Popen(command, env=environment, stdout=log, stderr=log, cwd=tmp_path)
    try:
        address = f"http://127.0.0.1:{port}"
        wait_for_answer(f"{address}/api?token={TOKEN}", server, tmp_path / "server.log")
        yield address
    finally:
        server.terminate()
        server.wait(20)


def wait_for_answer(address, server, log):
    give_up = time.monotonic() + START
    while time.monotonic() < give_up:
        if server.poll() is not None:
            break
        try:
            urllib.request.urlopen(address, timeout=2)
            return
        except OSError:
            time.sleep(0.3)
    pytest.fail(f"JupyterLab did not start:\n{log.read_text()[-2000:]}")


# How far the lab has come: which code cells have a number, which are waiting, what went wrong, is the kernel idle.
PROGRESS = """(idle) => {
  const prompts = [...document.querySelectorAll(".jp-CodeCell .jp-InputArea-prompt")].map((p) => p.textContent);
  const errors = document.querySelectorAll('.jp-OutputArea [data-mime-type="application/vnd.jupyter.error"]');
  return {
    done: prompts.length > 0 && prompts.every((p) => /\\[\\d+\\]/.test(p)),
    busy: prompts.some((p) => p.includes("*")) || !document.querySelector(idle),
    errors: [...errors].map((e) => e.innerText),
  };
}"""


def ran_to_its_end(page):
    """True when every cell has been run; False when the lab stands still before that.  An error fails the test."""
    give_up, last_busy = time.monotonic() + RUN, time.monotonic()
    while time.monotonic() < give_up:
        progress = page.evaluate(PROGRESS, IDLE)
        assert progress["errors"] == []
        if progress["done"] and not progress["busy"]:
            return True
        if progress["busy"]:
            last_busy = time.monotonic()
        elif time.monotonic() - last_busy > STILL:
            return False
        page.wait_for_timeout(300)
    pytest.fail(f"the lab was still running after {RUN} s")


def run_lab(page, address):
    """Open the lab and run it.  A fresh server loses the order to run now and then: it may be given three times."""
    from playwright.sync_api import TimeoutError as Late

    for attempt in range(3):
        try:
            page.goto(f"{address}/lab/tree/lab.ipynb?reset&token={TOKEN}")
            page.locator(IDLE).wait_for(timeout=START * 1000)
            page.locator("#jp-main-statusbar").get_by_text("| Idle").wait_for(timeout=START * 1000)
            page.get_by_role("menuitem", name="Run", exact=True).click()
            page.get_by_role("menuitem", name="Run All Cells", exact=True).click()
        except Late:
            if attempt == 2:
                raise
        else:
            if ran_to_its_end(page):
                return
    pytest.fail("the lab did not start in three attempts")


def test_a_lab_runs_in_jupyterlab_and_its_picture_follows_a_slider(page, jupyter):
    page.set_viewport_size({"width": 1440, "height": 1000})
    run_lab(page, jupyter)

    # The first explorer with a slider; its handle takes the keyboard, and says its name and its value.
    box = page.locator(".jp-OutputArea .explorer:has(input[type=range])").first
    slider, picture = box.locator("input[type=range]").first, box.locator("img")
    picture.scroll_into_view_if_needed()
    before, value = picture.get_attribute("src"), slider.get_attribute("aria-valuetext")
    assert slider.evaluate("(s) => s.labels[0].textContent.trim()")
    slider.focus()
    page.keyboard.press("ArrowLeft" if int(slider.input_value()) > 0 else "ArrowRight")
    page.wait_for_function("([image, src]) => image.src !== src", arg=[picture.element_handle(), before])
    assert slider.get_attribute("aria-valuetext") != value
    assert picture.evaluate("async (i) => { await i.decode(); return i.naturalWidth; }") > 300

    # Exercises answer with their cards.
    cards = page.locator(".jp-OutputArea [role=status]").all_inner_texts()
    assert [card for card in cards if "Correct" in card]
    assert [card for card in cards if "Not yet" in card] == []
