"""The checks themselves: right answers pass, stubs fail, and each plausible wrong answer gets its own hint."""

import importlib
import pkgutil
import sys
import time

import numpy as np
import pytest

import tests.exercises
from coursekit import exercises
from coursekit.exercises import Misconception, call, check, close, expect

ANSWERS = {
    name: answers
    for module in pkgutil.iter_modules(tests.exercises.__path__)
    if module.name.startswith("lab")
    for name, answers in importlib.import_module(f"tests.exercises.{module.name}").ANSWERS.items()
}
WRONG = [(name, description) for name, answers in ANSWERS.items() for description in answers.wrong]


def test_every_exercise_has_its_list_of_answers():
    assert set(exercises.names()) == set(ANSWERS)


@pytest.mark.parametrize("name", ANSWERS)
def test_the_lists_hold_five_wrong_answers_with_hints_of_their_own(name):
    fragments = [fragment for _, fragment in ANSWERS[name].wrong.values()]
    assert len(fragments) >= 5
    assert len(set(fragments)) == len(fragments)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", ANSWERS)
def test_both_right_answers_pass(name, seed):
    for answer in (ANSWERS[name].reference, ANSWERS[name].second):
        verdict = check(name, answer, seed=seed)
        assert verdict.passed, verdict.hint


@pytest.mark.parametrize("name", ANSWERS)
def test_the_empty_stub_fails(name):
    assert not check(name, ANSWERS[name].stub, seed=0)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("name", "description"), WRONG)
def test_each_wrong_answer_fails_with_its_own_hint(name, description, seed):
    answer, fragment = ANSWERS[name].wrong[description]
    verdict = check(name, answer, seed=seed)
    assert not verdict.passed
    assert fragment in verdict.hint
    others = [f for d, (_, f) in ANSWERS[name].wrong.items() if d != description]
    assert not [f for f in others if f in verdict.hint]


@pytest.mark.parametrize("name", ANSWERS)
def test_a_check_answers_within_a_second(name):
    start = time.perf_counter()
    check(name, ANSWERS[name].reference)
    assert time.perf_counter() - start < 1.0


def test_an_unknown_name_is_refused_with_the_list_of_names():
    with pytest.raises(ValueError, match=r"no exercise named 'lab99\.nothing'; there are"):
        check("lab99.nothing", lambda: 0)


def test_call_reports_an_argument_changed_in_place():
    def doubles(x):
        x *= 2
        return x

    with pytest.raises(Misconception, match="changes its argument"):
        call(doubles, np.ones(3))


def test_call_keeps_the_callers_arguments_safe():
    given = np.ones(3)
    with pytest.raises(Misconception):
        call(lambda x: x.sort(), given)
    np.testing.assert_array_equal(given, np.ones(3))


@pytest.mark.parametrize(
    ("answer", "hint"),
    [
        (3.0, "Give the function itself"),
        (lambda x: None, "returns None"),
        (lambda x: 1 / 0, "ZeroDivisionError"),
        (lambda x, y: x, "TypeError"),
    ],
)
def test_call_turns_what_goes_wrong_into_a_hint(answer, hint):
    with pytest.raises(Misconception, match=hint):
        call(answer, 1.0)


def test_close_names_the_misconception_whose_value_was_given():
    hints = {"misconceptions": {"That is in degrees.": np.degrees(0.3)}, "otherwise": "Something else."}
    with pytest.raises(Misconception, match="in degrees"):
        close(np.degrees(0.3), 0.3, **hints)
    with pytest.raises(Misconception, match=r"Something else\."):
        close(0.4, 0.3, **hints)
    close(0.3, 0.3, **hints)


def test_close_does_not_blame_a_right_answer_where_a_misconception_happens_to_agree():
    close(0.0, 0.0, misconceptions={"That is in degrees.": np.degrees(0.0)}, otherwise="Something else.")


@pytest.mark.parametrize(("got", "hint"), [(np.ones(3), "shape"), (np.array([1.0, np.nan]), "NaN"), ("two", "array")])
def test_close_speaks_of_shapes_nan_and_types(got, hint):
    with pytest.raises(Misconception, match=hint):
        close(got, np.ones(2), otherwise="Not equal.")


def test_expect_passes_silently_and_fails_with_its_hint():
    expect(True, "unseen")
    with pytest.raises(Misconception, match="seen"):
        expect(False, "seen")


def test_a_verdict_reads_as_text_and_as_a_card_that_escapes_what_it_quotes():
    verdict = exercises.Verdict("lab00.x", False, "got <b>")
    assert "not yet" in repr(verdict)
    assert "&lt;b&gt;" in verdict._repr_html_()
    assert not verdict
    assert exercises.Verdict("lab00.x", True)


ODD = ["", "abc", b"x", {}, {"a": 1}, set(), ..., object(), 10**400, 1j, [[1], [2, 3]], (np.zeros((2, 2)), "x"), print]


@pytest.mark.parametrize("name", ANSWERS)
def test_whatever_an_answer_returns_is_a_verdict_and_never_an_exception(name):
    for odd in ODD:
        verdict = check(name, lambda *a, odd=odd: odd)
        assert not verdict and verdict.hint, odd


def test_a_function_that_wants_to_end_the_session_is_a_hint():
    with pytest.raises(Misconception, match="SystemExit"):
        call(lambda: sys.exit("done"))


def test_close_does_not_drop_an_imaginary_part():
    for got in (0.3 + 1j, np.array([0.3 + 0j]), [0.3 + 1j]):
        with pytest.raises(Misconception, match="complex"):
            close(got, [0.3], otherwise="Something else.")
