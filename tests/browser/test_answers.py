"""Exercises answered on the page, by the book's own page, script, worker and checks, in a browser's Python."""

import importlib
import json
import pkgutil
import re
import sys
import threading
from functools import partial
from http.server import ThreadingHTTPServer

import pytest

import coursekit
import tests.labs
from tests.browser import bed
from tests.browser.bed import answers
from tests.browser.conftest import Quiet

sys.path.insert(0, str(bed.ROOT / "tools"))
import engine

pytestmark = pytest.mark.browser

RIGHT = "def innovation(z, z_hat):\n    return np.array([z[0] - z_hat[0], wrap_angle(z[1] - z_hat[1])])\n"
BARE = "def innovation(z, z_hat):\n    print('called')\n    return z - z_hat\n"
FOREVER = "def innovation(z, z_hat):\n    while True:\n        pass\n"
# Answers with functions that a page has not, SciPy's and those that need OpenCV: they are told so.
ELSEWHERE = {
    "lab03.calibrate, another minimum",
    "lab03.calibrate, more 0",
    "lab05.judge_map, second",
    "lab06.best_rotation, second",
    "lab06.pair_up, scipy's mark",
    "lab06.pair_up, second",
    "lab08.best_estimate, more 0",
    "lab08.best_estimate, reference",
    "lab08.odometry_from_image, reference",
}


@pytest.fixture(scope="module")
def serve():
    """Put a folder on this machine's own network; returns its address."""
    servers = []

    def start(folder):
        servers.append(ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))))
        threading.Thread(target=servers[-1].serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{servers[-1].server_port}"

    yield start
    for server in servers:
        server.shutdown()


@pytest.fixture(scope="module")
def lab(tmp_path_factory, serve):
    """The address of Lab 4's exercises."""
    if bed.engine() is None:
        pytest.skip("there is no npm here, which brings the browser's Python")
    folder = tmp_path_factory.mktemp("site")
    page = bed.site(folder, "04_ekf.ipynb")
    return f"{serve(folder)}/{page}"


@pytest.fixture
def ask(page, lab):
    """Lab 4's page, freshly opened; its exercise on the innovation, and all that the tab has asked the server for."""
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.clock.install()
    page.goto(lab)
    yield page.locator('[data-check="lab04.innovation"]'), asked
    page.evaluate("localStorage.clear()")
    assert page.complaints == []


def verdict(box):
    box.locator(".answer-verdict").wait_for(timeout=60_000)
    return box.locator(".answer-verdict").inner_text()


def test_an_answer_is_checked_on_the_page_with_the_hints_of_the_notebook(page, ask):
    box, asked = ask
    assert not [url for url in asked if "/python/" in url], "Python is fetched before anybody asks for it"
    assert "NotImplementedError" in box.locator("textarea").input_value()
    box.get_by_role("button", name="Check").click()
    assert verdict(box) == "✗ Not yet. Nothing here yet: replace the placeholder by your own lines."
    assert [url for url in asked if "/python/" in url]

    box.locator("textarea").fill(BARE)
    box.get_by_role("button", name="Check").click()
    assert "nearly a whole turn" in verdict(box)
    assert set(box.locator(".answer-printed").inner_text().split()) == {"called"}

    box.locator("textarea").fill(RIGHT)
    box.locator("textarea").press("Control+Enter")
    assert verdict(box) == "✓ Correct"
    assert not box.locator(".answer-printed").is_visible()

    box.locator("textarea").fill(FOREVER)
    box.get_by_role("button", name="Check").click()
    page.get_by_text("Checking …").wait_for()
    page.clock.fast_forward(11_000)
    assert "Is there a loop whose condition never becomes false?" in box.locator(".answer-state").inner_text()
    box.get_by_role("button", name="Stop").click()
    assert "Stopped" in box.locator(".answer-state").inner_text()
    assert box.get_by_role("button", name="Check").evaluate("(b) => b === document.activeElement && !b.disabled")


def test_what_was_written_stays_in_this_browser_until_it_is_reset(page, ask):
    box, _ = ask
    area, stub = box.locator("textarea"), box.locator("textarea").input_value()
    assert box.get_by_role("button", name="Reset").is_disabled()
    area.fill(RIGHT)
    page.reload()
    assert area.input_value() == RIGHT
    box.get_by_role("button", name="Reset").click()
    assert area.input_value() == stub
    box.get_by_role("button", name="Bring mine back").click()
    assert area.input_value() == RIGHT
    box.get_by_role("button", name="Reset").click()
    page.reload()
    assert area.input_value() == stub


def test_the_editor_indents_and_lets_the_keyboard_go(page, ask):
    box, _ = ask
    area = box.locator("textarea")
    area.fill("")
    page.keyboard.type("def f(x):")
    page.keyboard.press("Enter")
    page.keyboard.type("if x:  # why")
    page.keyboard.press("Enter")
    page.keyboard.type("return 1")
    assert area.input_value() == "def f(x):\n    if x:  # why\n        return 1"
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("Home")
    page.keyboard.press("Tab")
    assert area.input_value().endswith("\n        return 1")
    page.keyboard.press("Control+z")
    assert area.input_value().endswith("\n    return 1")
    page.keyboard.press("Escape")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Check"


@pytest.mark.parametrize("python", [12.0, None], ids=["from disk", "without a Python"])
def test_where_nothing_can_run_a_page_offers_the_lab_instead(page, tmp_path, python):
    (tmp_path / "_static").mkdir()
    for name in ("answers.css", "answers.js", "logo.svg"):
        (tmp_path / "_static" / name).write_bytes((bed.ROOT / "book" / "_static" / name).read_bytes())
    (tmp_path / "notebooks").mkdir()
    text = bed.page("04_ekf.ipynb", python).replace(bed.POLICY, "")  # which has no 'self' on a disk
    (tmp_path / "notebooks" / "lab.html").write_text(text, encoding="utf-8")
    page.goto((tmp_path / "notebooks" / "lab.html").as_uri())
    assert page.get_by_role("link", name=re.compile("download this lab", re.IGNORECASE)).count() == 5
    assert page.locator("textarea:visible, button:visible").count() == 0
    assert page.complaints == []


@pytest.mark.slow
def test_the_book_s_own_engine_starts_and_runs_python(page, tmp_path, serve):
    """Pyodide as npm gives it, and so without NumPy: the rest is as on a published page."""
    try:
        parts = engine.unpack(engine.pack(engine.NAME))
    except engine.EngineUnavailable as why:
        pytest.skip(str(why))
    (python := tmp_path / "pyodide").mkdir()
    for name, content in parts.items():
        (python / name).write_bytes(content)
    answers.install(python, tmp_path / "site")
    script = tmp_path / "site" / "_static" / "python" / "engine.js"
    text = script.read_text(encoding="utf-8")
    for whole, part in {'["numpy"]': "[]", "from coursekit.teaching import on_page": "import coursekit"}.items():
        assert whole in text
        text = text.replace(whole, part)
    script.write_text(text, encoding="utf-8")
    (tmp_path / "site" / "index.html").write_text(f"<!doctype html>{bed.POLICY}<link rel=icon href=data:,>", "utf-8")
    page.goto(serve(tmp_path / "site") + "/index.html")
    calls = ["coursekit.__version__", "'π' * 3", "str(1 / 0)"]
    assert page.evaluate(ASK.replace("../", ""), calls)[:2] == [coursekit.__version__, "πππ"]


def everybody():
    """(description, expression for the answer, whether it passes, fragments of which its hint has one)."""
    for found in pkgutil.iter_modules(tests.labs.__path__, "tests.labs."):
        if not found.ispkg:
            continue
        module = f"{found.name}.answers"
        for name, a in importlib.import_module(module).ANSWERS.items():
            place = f"importlib.import_module({module!r}).ANSWERS[{name!r}]"
            yield f"{name}, stub", name, f"{place}.stub", False, ["Nothing here yet"]
            for which in ("reference", "second"):
                yield f"{name}, {which}", name, f"{place}.{which}", True, [""]
            for i in range(len(a.more)):
                yield f"{name}, more {i}", name, f"{place}.more[{i}]", True, [""]
            for said, (_, fragment) in a.wrong.items():
                yield f"{name}, {said}", name, f"{place}.wrong[{said!r}][0]", False, [fragment]
            for said, (_, fragments) in a.both.items():
                yield f"{name}, {said}", name, f"{place}.both[{said!r}][0]", False, fragments


# Ask the worker for the values of some expressions.
ASK = """async (calls) => {
  const worker = new Worker("../_static/python/worker.js", { type: "module" });
  const said = [];
  for (const [id, call] of calls.entries()) {
    said.push(await new Promise((done) => {
      worker.onmessage = ({ data }) => { if (data.id === id) done(data.text ?? `error: ${data.error}`); };
      worker.postMessage({ id, call });
    }));
  }
  worker.terminate();
  return said;
}"""


@pytest.mark.slow
def test_every_answer_of_the_tests_gets_its_verdict_in_the_browser_too(page, ask):
    everyone = list(everybody())
    calls = [
        f"on_page.judge({name!r}, 'answer', {f'import importlib{chr(10)}answer = {answer}'!r})"
        for _, name, answer, *_ in everyone
    ]
    said = [json.loads(text) for text in page.evaluate(ASK, calls)]
    told = {answer[0] for answer, one in zip(everyone, said, strict=True) if "This page has Python" in one["hint"]}
    assert told == ELSEWHERE
    surprises = {
        description: one
        for (description, _, _, passes, fragments), one in zip(everyone, said, strict=True)
        if description not in told
        and (one["passed"] != passes or not any(fragment in one["hint"] for fragment in fragments))
    }
    assert surprises == {}
