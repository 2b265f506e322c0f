"""Nothing that came as data is run, nothing listens to strangers, nothing unknown is installed."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    p for folder in ("coursekit", "tools", "book") for p in (ROOT / folder).rglob("*.py") if "_build" not in p.parts
]
# Where something is unpickled or run on purpose, and why that is no stranger's.
OWN = "an error of this very process, to see whether it travels"
DESIGN = "the learner's own design, in a process that is isolated"
READER = "the reader's own answer, in the reader's own browser"
STUDENT = "a student's answer, or what the grader asks of it, in a process behind the grader's walls"
ALLOWED = {
    ("coursekit/teaching/experiments.py", "pickle.loads"): OWN,
    ("coursekit/teaching/judging.py", "cloudpickle.load"): DESIGN,
    ("coursekit/teaching/on_page.py", "compile"): READER,
    ("coursekit/teaching/on_page.py", "exec"): READER,
    ("tools/grading/student.py", "compile"): STUDENT,
    ("tools/grading/student.py", "exec"): STUDENT,
    ("tools/grading/student.py", "pickle.loads"): STUDENT,
}
FORBIDDEN = re.compile(
    r"^((cloud)?pickle|marshal|shelve|dill|joblib)\.(loads?|Unpickler|open)$|^(eval|exec|compile|__import__)$"
    r"|^os\.(system|popen)$|^yaml\.(load|unsafe_load|full_load)$|^(pd|pandas)\.read_pickle$"
)


def calls(path):
    """Each call in a file: its dotted name and its keywords."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), {k.arg: ast.unparse(k.value) for k in node.keywords}


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_nothing_that_is_data_is_run_or_unpickled(path):
    name = path.relative_to(ROOT).as_posix()
    for called, keywords in calls(path):
        if FORBIDDEN.search(called):
            assert (name, called) in ALLOWED, f"{name} calls {called}"
        if called in ("np.load", "numpy.load"):
            assert keywords.get("allow_pickle") == "False", f"{name} loads an array without allow_pickle=False"
        assert keywords.get("shell") != "True", f"{name} hands {called} to a shell"


def test_a_forbidden_call_would_be_seen(tmp_path):
    (tmp_path / "bad.py").write_text("import pickle\npickle.load(open('x', 'rb'))\neval('1')\nre.compile('x')\n")
    found = [called for called, _ in calls(tmp_path / "bad.py") if FORBIDDEN.search(called)]
    assert sorted(found) == ["eval", "pickle.load"]


def test_jupyter_and_the_book_listen_on_this_machine_only_and_jupyter_keeps_its_token():
    config = (ROOT / "tools" / "jupyter_lab_config.py").read_text(encoding="utf-8")
    assert 'c.ServerApp.ip = "127.0.0.1"' in config
    for opened in ("token", "password", "allow_origin", "disable_check_xsrf", "allow_remote_access", "0.0.0.0"):
        assert opened not in config
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "http.server --bind 127.0.0.1" in makefile and "token=" not in makefile.replace(" ", "").lower()


def test_everything_that_is_installed_is_named_with_its_hash():
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    pinned = re.findall(r"^[\w.\[\]-]+==[^\\\n]*\\\n((?:    --hash=sha256:[0-9a-f]{64}.*\n)+)", lock, re.M)
    assert len(pinned) == len(re.findall(r"^[A-Za-z0-9]", lock, re.M)) > 50
    assert "--require-hashes" in (ROOT / "tools" / "set_up.py").read_text(encoding="utf-8")


def test_known_holes_in_what_is_locked_are_looked_up_every_week():
    scheduled = (ROOT / ".github" / "workflows" / "scheduled.yml").read_text(encoding="utf-8")
    assert "pip-audit" in scheduled and "requirements.lock" in scheduled
