"""What stopped a student's function, in plain words: the line, the shapes in it, and what the message means."""

from __future__ import annotations

import linecache
import re
from types import FrameType
from typing import Any

import numpy as np

# (the exception's name, a pattern of its message, what it means).  The first that fits is taken.
MEANINGS = [
    ("ValueError", r"solve\w*: .*core dimension|same number of rows",
     "solve(A, B) finds the X with A X = B, so B needs as many rows as A. When X stands on the left, as in X A = B, "
     "take the transpose of both sides first"),
    ("ValueError", r"core dimension|not aligned",
     "in a product A @ B, A needs as many columns as B has rows. Is a transpose missing, or is the order reversed"),
    ("ValueError", r"broadcast together|broadcast input array|could not be broadcast",
     "entry by entry (+, -, *, /, =) two shapes must be equal, or 1 where they differ; matrices are multiplied by @"),
    ("ValueError", r"truth value of an array",
     "`if`, `and` and `or` want one True or False, and here is an array of them: use np.where, & and |"),
    ("ValueError", r"inhomogeneous|array element with a sequence",
     "the rows of an array must be equally long, and one entry must be one number"),
    ("ValueError", r"must match exactly|dimensions? .*must match|same number of dimensions",
     "arrays that are put together must agree in all directions but the one along which they are joined"),
    ("TypeError", r"converted to Python scalars|only .*array.* scalar",
     "the functions of `math` take one number at a time; for arrays there are np.arctan, np.sqrt, np.cos and so on"),
    ("TypeError", r"positional argument|unexpected keyword|required keyword",
     "the function must take the arguments that the exercise names, in that order"),
    ("TypeError", r"NoneType",
     "something is None there: a function without `return`, or a list's .sort() or .append(), gives back nothing"),
    ("TypeError", r"'list'|'tuple'|sequence by non-int",
     "lists do not calculate: turn them into arrays with np.array first"),
    ("UFuncTypeError", r"Cannot cast",
     "an array of whole numbers cannot take decimals in place: write a = a - b, or make the array of floats"),
    ("IndexError", r"too many indices", "the array has fewer axes than there are indices"),
    ("IndexError", r"out of bounds|out of range", "indices count from 0, so the last of n entries is number n - 1"),
    ("IndexError", r"must be of integer|only integers|valid indices", "an index must be a whole number, not a float"),
    ("IndexError", r"boolean index did not match", "a mask must be as long as the array from which it selects"),
    ("LinAlgError", r"ingular", "that matrix has no inverse: some of its rows depend on others"),
    ("LinAlgError", r"positive definite", "Cholesky's method takes covariances only: symmetric, variances > 0"),
    ("LinAlgError", r"square|dimensional", "this function wants a square matrix, and was given another shape"),
    ("ZeroDivisionError", "", "something divides by zero: for which input, and what is the limit there"),
    ("RecursionError", "", "the function calls itself without an end"),
    ("NameError", "", "the name is unknown there: is it misspelt, or made in a cell not yet run"),
]  # fmt: skip


def explain(error: BaseException, answer: Any) -> str:
    """A sentence or two on what stopped ``answer``.

    error : caught, with its traceback.
    answer : the function that was called; the innermost line of its own file is the one that is shown.
    """
    frame, line = _place(error, answer)
    kind, message = type(error).__name__.lstrip("_"), " ".join(str(error).split())
    kinds = {c.__name__.lstrip("_") for c in type(error).__mro__}
    said = f"Your function stopped with {kind}: {message}"
    if line:
        said += f" (in `{line}`)"
    said = said.rstrip(".") + "."
    for name, pattern, meaning in MEANINGS:
        if name in kinds and re.search(pattern, message):
            end = "?" if re.search(r"\b[Ii]s (a|it)\b|what is|for which", meaning) else "."
            said += f" That means: {meaning}{end}"
            break
    if shapes := _shapes(frame, line):
        said += f" Shapes there: {shapes}."
    return said


def _place(error: BaseException, answer: Any) -> tuple[FrameType | None, str]:
    """The innermost frame in the student's own file, and the text of its line."""
    own, found, number = getattr(getattr(answer, "__code__", None), "co_filename", None), None, 0
    step = error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == own:
            found, number = step.tb_frame, step.tb_lineno
        step = step.tb_next
    return found, linecache.getline(own, number).strip() if found is not None and own else ""


def _shapes(frame: FrameType | None, line: str) -> str:
    """The arrays whose names stand in the line, as "P (3, 3), H (2, 3)"."""
    if frame is None:
        return ""
    known = {**frame.f_globals, **frame.f_locals}
    names = dict.fromkeys(re.findall(r"[^\W\d]\w*", line))
    return ", ".join(f"{n} {known[n].shape}" for n in names if isinstance(known.get(n), np.ndarray))
