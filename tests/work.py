"""How much work a call is, counted and not timed: the same number on a slow machine and on a busy one."""

import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeVar

import pytest

Result = TypeVar("Result")


def within(most_calls: int, work: Callable[[], Result]) -> Result:
    """``work()``; the test fails when more functions than that were called, in Python and in C together."""
    count = 0

    def tally(frame: FrameType, event: str, argument: Any) -> None:
        nonlocal count
        count += event in ("call", "c_call")
        if count > most_calls:  # nothing is raised here: this runs inside whatever was called
            sys.setprofile(before)

    before = sys.getprofile()
    sys.setprofile(tally)
    try:
        result = work()
    finally:
        sys.setprofile(before)
    if count > most_calls:
        pytest.fail(f"more than {most_calls:,} calls")
    return result
