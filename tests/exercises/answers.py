"""What the tests keep beside each exercise: who must pass, who must fail, and with which hint."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Answers:
    """stub: the empty answer.  reference, second: two right answers, written differently.
    wrong: description → (answer, a fragment of the hint that this mistake, and no other, must get)."""

    stub: Any
    reference: Any
    second: Any
    wrong: Mapping[str, tuple[Any, str]]
