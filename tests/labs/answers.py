"""What the tests keep beside each exercise: who must pass, who must fail, and with which hint."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Answers:
    """stub: the empty answer.  reference, second: two right answers, written differently; more: others.
    wrong: description → (answer, a fragment of the hint that this mistake, and no other, must get).
    both: description → (an answer with two mistakes, fragments of hints of which one must be in what it is told)."""

    stub: Any
    reference: Any
    second: Any
    wrong: Mapping[str, tuple[Any, str]]
    more: Sequence[Any] = ()
    both: Mapping[str, tuple[Any, Sequence[str]]] = field(default_factory=dict)

    @property
    def right(self) -> list[Any]:
        return [self.reference, self.second, *self.more]
