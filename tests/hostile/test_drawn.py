"""Hostile arguments that nobody thought of: hypothesis draws one at a time, and ``verdict`` judges what comes of it."""

import functools

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.hostile.contract import CALLS
from tests.hostile.drawn import replacements
from tests.hostile.verdict import ANYBODYS, complaint

quiet = settings(deadline=None, database=None, suppress_health_check=list(HealthCheck))
few = settings(quiet, derandomize=True, max_examples=12)
many = settings(quiet, derandomize=False, max_examples=1000)


@functools.cache
def changes(name):
    """One or two arguments of a call, and what is to stand in their place."""
    _, good = CALLS[name]()
    places = {
        argument: replacements(value).filter(wrong_for(name, argument, value)) for argument, value in good.items()
    }
    one = st.sampled_from(sorted(places)).flatmap(lambda argument: st.fixed_dictionaries({argument: places[argument]}))
    return one | st.tuples(one, one).map(lambda pair: pair[0] | pair[1])


def wrong_for(name, argument, value):
    """A function may only be replaced by what cannot be called."""
    right = ANYBODYS.get((name, argument), callable if callable(value) else lambda bad: False)
    return lambda bad: not right(bad)


def judge(name, data):
    changed = data.draw(changes(name))
    assert not (why := complaint(name, changed)), f"{changed}: {why}"


@pytest.mark.parametrize("name", CALLS)
@few
@given(data=st.data())
def test_whatever_is_drawn_gives_an_error_that_names_it_or_a_sound_result(name, data):
    judge(name, data)


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
@many
@given(data=st.data())
def test_whatever_else_is_drawn_gives_an_error_that_names_it_or_a_sound_result(name, data):
    judge(name, data)
