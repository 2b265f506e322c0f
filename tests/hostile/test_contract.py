"""Hostile arguments at every door: one is replaced at a time, and the rest of the call stays good.

``verdict`` says what may come of it; ``test_drawn`` draws the arguments instead of taking them from a table.
"""

import contextlib
import re
import signal
import time

import pytest

from tests.hostile.contract import CALLS
from tests.hostile.hostility import clothes
from tests.hostile.verdict import PROMISED, Hung, complaint, hostile, same, sound, time_limit, tried
from tests.test_docstrings import NAMES


@pytest.mark.parametrize("name", CALLS)
def test_one_hostile_argument_gives_an_error_that_names_it_or_a_sound_result(name):
    kind, what = tried(name, {})
    assert kind == "result" and (sound(what) or any(name.startswith(start) for start in PROMISED))
    wrong = [
        f"{argument} = {what}: {why}"
        for argument, what, bad in hostile(name)
        if (why := complaint(name, {argument: bad}))
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", CALLS)
def test_the_same_numbers_in_another_form_give_the_same_answer(name):
    _, good = CALLS[name]()
    expected = tried(name, {})[1]
    for argument, value in good.items():
        for form, same_numbers in clothes(value):
            kind, got = tried(name, {argument: same_numbers})
            assert kind == "result", f"{argument} as {form}: {got!r}"
            assert same(expected, got, exactly=False), f"{argument} as {form}: {got!r}"


def test_the_table_holds_the_whole_contract():
    """All but what opens files, see ``test_files``, and what judges a learner's answer, which may be anything."""
    elsewhere = re.compile(
        r"(datasets|localisation|exercises)\.|recordings\.(read|write)_|noise\.load_log|.*\.Recording$"
    )
    rooms = {"association.Known", "explore.explore"}
    missing = [name for name in NAMES if name not in {*CALLS, *rooms} and not elsewhere.match(name)]
    assert not missing


TIMED = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no interval timers")


@TIMED
def test_a_call_that_does_not_end_is_stopped_and_named(monkeypatch):
    def busy(x):
        while True:
            with contextlib.suppress(Exception):
                x += 1

    monkeypatch.setitem(CALLS, "busy", lambda: (busy, {"x": 1.0}))
    monkeypatch.setattr("tests.hostile.verdict.SECONDS", 0.1)
    assert complaint("busy", {"x": 2.0}) == "Hung: no end after 0.1 s"


@TIMED
def test_a_call_that_only_waits_is_stopped_too():
    with pytest.raises(Hung), time_limit(0.01):
        time.sleep(60)
