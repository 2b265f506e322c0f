"""Answers that arrive as text."""

import json
import signal

import pytest

from coursekit.teaching import _guard, on_page

IMPORTS = "import numpy as np\nfrom coursekit.geometry import wrap_angle, compose\nimport nowhere_to_be_found"
RIGHT = "def mine(z, z_hat):\n    return np.array([z[0] - z_hat[0], wrap_angle(z[1] - z_hat[1])])"


def said(source, function="mine", imports=IMPORTS):
    return json.loads(on_page.judge("lab04.innovation", function, source, imports))


def test_a_right_answer_passes_with_the_lab_s_imports():
    assert said(RIGHT) == {"passed": True, "hint": "", "printed": ""}


@pytest.mark.parametrize(
    ("source", "hint"),
    [
        ("def mine(z, z_hat):\n    return z - z_hat", "nearly a whole turn"),
        ("def mine(z, z_hat):\n    raise NotImplementedError('your lines here')", "Nothing here yet"),
        ("def mine(z, z_hat):\n    return 1 +", "Line 2 is not Python yet: invalid syntax."),
        ("def mine(z, z_hat):\nreturn 1", "Line 2 is not Python yet: expected an indented block"),
        ("def other(z, z_hat):\n    return z - z_hat", "Your code defines no `mine`"),
        ("1 / 0", "Your code stopped with ZeroDivisionError: division by zero (in `1 / 0`)"),
        ("exit()", "Your code stopped with SystemExit"),
        ("def mine(z, z_hat):\n    return z @ np.eye(3)", "(in `return z @ np.eye(3)`)"),
        ("mine = nowhere_to_be_found", "`import nowhere_to_be_found` does not work here"),
        ("def mine(z, z_hat):\n    import nowhere", "open the lab in JupyterLab"),
        ("mine = 7", "Give the function itself"),
        ("\0", "is not Python yet"),
    ],
)
def test_what_goes_wrong_is_a_hint(source, hint):
    verdict = said(source)
    assert not verdict["passed"] and hint in verdict["hint"]


def test_what_an_answer_prints_is_returned_and_not_written(capsys):
    verdict = said(f"print('once')\n{RIGHT}")
    assert verdict["passed"] and verdict["printed"] == "once\n"
    assert len(said(f"print('x' * 10**6)\n{RIGHT}")["printed"]) == on_page.PRINTED
    assert capsys.readouterr() == ("", "")


def test_one_answer_knows_nothing_of_the_one_before():
    assert said(f"helper = 3\n{RIGHT}")["passed"]
    assert "name 'helper' is not defined" in said("def mine(z, z_hat):\n    return helper")["hint"]


def test_an_answer_may_spoil_nothing_but_itself():
    assert not said("np = None\ndef mine(z, z_hat):\n    return np.array(z)")["passed"]
    assert said(RIGHT)["passed"]


def test_imports_that_are_more_than_imports_are_refused():
    with pytest.raises(ValueError, match=r"expected import statements only, got x = 1"):
        said(RIGHT, imports="x = 1")


@pytest.mark.parametrize("platform", ["emscripten", "wasi"])
def test_where_there_is_neither_alarm_nor_thread_no_limit_is_set(platform, monkeypatch):
    monkeypatch.setattr(_guard.sys, "platform", platform)
    monkeypatch.setattr(signal, "setitimer", None)
    monkeypatch.setattr(_guard.threading, "Thread", None)
    with _guard.time_limit(1e-9):
        assert said(RIGHT)["passed"]
