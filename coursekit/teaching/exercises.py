r"""Exercises that answer at once: property checks on fresh inputs, with a hint for each misconception.

A lab calls ``check("lab02.range_from_height", my_function)`` and shows what comes back.  A check draws new
inputs each time, so an answer that was typed in cannot pass; it knows the wrong turns that people take, so a
wrong answer is told *which* wrong turn it took; and it never prints the right answer.

The checks of lab NN live in ``coursekit.labs.labNN.exercises``; writing one takes three verbs:

``call``    runs the student's function on copies and catches what it raises, returns or changes in place,
``close``   compares with the truth and, when wrong, with what each misconception, or two of them, would have produced,
``expect``  states any other property.

A verdict must not depend on the draw.  So a check begins with inputs on which every misconception shows, and then
goes through the rest of what its exercise allows: all directions, both signs, zeros, the smallest sizes.

``score("lab04", MyFilter)`` marks a lab's project, a whole system; see ``projects``.
"""

from __future__ import annotations

import abc
import contextvars
import copy
import html
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from coursekit.teaching._explain_error import explain
from coursekit.teaching._grader import in_a_grader
from coursekit.teaching._guard import OutOfTime, ruled_out, time_limit
from coursekit.teaching._labs import import_each
from coursekit.teaching._pairs import near, two_mistakes
from coursekit.teaching.projects import score as score

Check = Callable[[Any, np.random.Generator], None]
ROUNDS = 5  # fresh inputs per check; a lucky guess has to be lucky five times
VOTES = 3  # wrong rounds that choose the hint
LIMIT = 10.0  # seconds per check; right answers need well under one

_checks: dict[str, Check] = {}
_listener: contextvars.ContextVar[list[Verdict] | None] = contextvars.ContextVar("verdicts", default=None)


class Misconception(Exception):
    """A check did not hold; the message is the hint that the student reads."""


class Elsewhere(abc.ABC):
    """An answer that runs in another process, as a grader wants it: ``call`` asks it, and never sees its code."""

    @abc.abstractmethod
    def call(self, arguments: tuple, **options: Any) -> Any:
        """What ``exercises.call(function, *arguments, **options)`` gives there; raises ``Misconception`` likewise."""


@dataclass(frozen=True)
class Verdict:
    """What a check says: a card in JupyterLab, one line of text elsewhere.  True when it passed."""

    name: str
    passed: bool
    hint: str = ""

    def __bool__(self) -> bool:
        return self.passed

    def __repr__(self) -> str:
        return f"✓ {self.name}: correct." if self.passed else f"✗ {self.name}: not yet. {self.hint}"

    def _repr_html_(self) -> str:
        colour, mark, word = ("#1b7f4b", "✓", "Correct") if self.passed else ("#b3541e", "✗", "Not yet")
        hint = f'<div style="margin-top:.3em">{html.escape(self.hint)}</div>' if self.hint else ""
        return (
            f'<div role="status" style="border-left:.35em solid {colour};padding:.5em .9em;margin:.3em 0">'
            f'<b style="color:{colour}">{mark} {word}</b> <code>{html.escape(self.name)}</code>{hint}</div>'
        )


def check(name: str, answer: Any, seed: int | None = None) -> Verdict:
    """Judge an answer: five rounds on fresh inputs, well under a second.

    Parameters
    ----------
    name : the exercise, as in "lab02.range_from_height"; ``names()`` lists them.
    answer : what the exercise asked for, most often a function.
    seed : fixes the inputs; the default draws new ones each time.

    Raises ValueError for a name that is no exercise.  A wrong answer is a verdict, never an exception, and so is
    one that does not come to an end within ``LIMIT`` seconds.  Only in a grader that goes by exceptions, as nbgrader
    does, a wrong answer raises AssertionError with the hint.

    >>> check("lab04.predict_covariance", lambda P, F, Q: F @ P @ F.T + Q)
    ✓ lab04.predict_covariance: correct.
    """
    if name not in names():
        raise ValueError(f"no exercise named {name!r}; there are: {', '.join(names())}")
    rng, hints = np.random.default_rng(seed), list[str]()
    try:
        with time_limit(LIMIT):
            for _ in range(ROUNDS):
                try:
                    _checks[name](answer, rng)
                except Misconception as wrong:
                    hints.append(str(wrong))
                if len(hints) == VOTES:
                    break
        # On one draw in some hundreds two wrong turns end at the same number: the hint is that of most draws.
        verdict = Verdict(name, not hints, Counter(hints).most_common(1)[0][0] if hints else "")
    except OutOfTime:
        verdict = Verdict(name, False, f"Your code was stopped: it had not finished after {LIMIT:g} s. Is there a loop "
                                       "whose condition never becomes false?")  # fmt: skip
    except Exception as error:  # the check itself stumbled over what it was given
        verdict = Verdict(name, False, f"What came back cannot be compared ({type(error).__name__}: {error}). Is it of "
                                       "the kind that the exercise asks for, numbers in an array?")  # fmt: skip
    if (listening := _listener.get()) is not None:
        listening.append(verdict)
    if not verdict and in_a_grader():
        raise AssertionError(verdict.hint)
    return verdict


def exercise(name: str) -> Callable[[Check], Check]:
    """Register a check, ``function(answer, rng) → None``, that raises through ``call``, ``close`` or ``expect``."""

    def register(function: Check) -> Check:
        if name in _checks:
            raise ValueError(f"two exercises are named {name!r}")
        _checks[name] = function
        return function

    return register


def names() -> list[str]:
    """Every exercise of every lab."""
    import_each("exercises")
    return sorted(_checks)


def call(
    answer: Any,
    *arguments: Any,
    stops: Mapping[str, str] | None = None,
    none: str = "Your function returns None. Is there a return at its end?",
    without: Mapping[str, Sequence[Callable]] | None = None,
) -> Any:
    """The student's function on copies of the arguments; what it does wrong on the way becomes a hint.

    stops : a piece of an error's text → what it means in this exercise, said after the general explanation.
    none : the hint for an answer that returns None.
    without : hint → functions that the exercise rules out; to call one of them gives the hint.
    """
    if isinstance(answer, Elsewhere):
        return answer.call(arguments, stops=stops, none=none, without=without)
    expect(
        callable(answer), f"Give the function itself, not its result: expected a function, got {type(answer).__name__}."
    )
    given = copy.deepcopy(arguments)
    try:
        # Sums of NaN and the like are judged by their values, not by warnings.
        with np.errstate(all="ignore"), ruled_out(without or {}, answer, Misconception):
            result = answer(*given)
    except Misconception:
        raise
    except NotImplementedError:
        raise Misconception("Nothing here yet: replace the placeholder by your own lines.") from None
    except (Exception, SystemExit) as error:  # whatever a student's code raises is shown to the student
        said = explain(error, answer)
        special = [hint for piece, hint in (stops or {}).items() if piece in said]
        raise Misconception(" ".join([said, *special])) from error
    expect(result is not None, none)
    unchanged = all(_same(a, b) for a, b in zip(given, arguments, strict=True))
    expect(unchanged, "Your function changes its argument in place; the caller still needs it. Work on a copy.")
    return result


def close(
    got: Any,
    expected: Any,
    *,
    misconceptions: Mapping[str, Any] | None = None,
    otherwise: str,
    tolerance: float = 1e-6,
    together: bool = True,
) -> None:
    """Compare with the truth; a wrong answer gets the hint of the misconception whose value it equals.

    misconceptions : hint → the value that this wrong turn produces.
    otherwise : the hint when no known misconception fits.
    together : look for two mistakes at once as well; not for values that agree by chance, such as counts.
    """
    expected = np.asarray(expected, dtype=float)
    # numpy would drop the imaginary part, with a warning at most
    expect(not _is_complex(got), "Some of your numbers are complex; real ones are wanted.")
    try:
        got = np.asarray(got, dtype=float)
    except (TypeError, ValueError):
        raise Misconception(
            f"Expected numbers in an array of shape {expected.shape}, got {type(got).__name__}."
        ) from None
    wrong = {hint: np.asarray(value, dtype=float) for hint, value in (misconceptions or {}).items()}
    wrong = {hint: value for hint, value in wrong.items() if not near(value, expected, tolerance)}
    for hint, value in wrong.items():
        if near(got, value, tolerance):
            raise Misconception(hint)
    if together and got.size and not near(got, expected, tolerance) and (said := two_mistakes(got, expected, wrong)):
        raise Misconception(said)
    if got.shape != expected.shape:
        raise Misconception(f"The shape is {got.shape}, where {expected.shape} is wanted.")
    expect(bool(np.all(np.isfinite(got) | ~np.isfinite(expected))), "Some of your numbers are NaN or infinite.")
    expect(near(got, expected, tolerance), otherwise)


def expect(condition: bool, hint: str) -> None:
    """Go on only if ``condition`` holds; else the student reads ``hint``."""
    if not condition:
        raise Misconception(hint)


@contextmanager
def collecting() -> Iterator[list[Verdict]]:
    """Every verdict given inside the ``with`` block: this is how the tests see what a lab's own answers got."""
    verdicts: list[Verdict] = []
    token = _listener.set(verdicts)
    try:
        yield verdicts
    finally:
        _listener.reset(token)


def _is_complex(got: Any) -> bool:
    try:
        return bool(np.iscomplexobj(got) or np.iscomplexobj(np.asarray(got)))
    except ValueError:
        return False


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return bool(np.array_equal(a, b, equal_nan=a.dtype.kind == "f"))
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_same(a[k], b[k]) for k in a)
    return True if isinstance(a, np.random.Generator) or hasattr(a, "__dict__") else bool(a == b)
