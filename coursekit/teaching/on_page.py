"""Answers that are typed on a page of the book: what the reader's browser asks of Python.

The page's worker calls ``judge`` and shows what it says.  The check is that of ``exercises``, so a page and a notebook
give the same verdict and the same hint.
"""

from __future__ import annotations

import ast
import io
import json
import linecache
import re
from contextlib import redirect_stderr, redirect_stdout
from types import SimpleNamespace
from typing import Any

from coursekit.teaching import exercises
from coursekit.teaching._explain_error import explain

FILE = "<your answer>"
PRINTED = 4000  # characters of what an answer prints; the rest is cut
NOT_HERE = "This page has Python, NumPy and a small part of SciPy. For more, open the lab in JupyterLab."


class _CannotRun(Exception):
    """The text does not get as far as its check; the message is the hint."""


def judge(name: str, function: str, source: str, imports: str = "") -> str:
    """Check an answer that is given as text.

    Parameters
    ----------
    name : the exercise, as in "lab04.innovation".
    function : the name that the text has to define.
    source : what the reader wrote.
    imports : the lab's import statements; an answer may use the names, and only those that it uses are imported.

    Returns JSON: passed (bool), hint (str), and printed (str), what the answer wrote to its output.  A text that is
    not Python, or that stops before its end, is a verdict with a hint, never an exception.

    Raises ValueError for a name that is no exercise.

    >>> said = json.loads(judge("lab04.innovation", "mine", "def mine(z, z_hat):\\n    return z - z_hat"))
    >>> said["passed"], said["hint"]
    (False, 'Two directions a few degrees apart came out as nearly a whole turn: bring it into (-π, π].')
    """
    printed = io.StringIO()
    with redirect_stdout(printed), redirect_stderr(printed):
        try:
            verdict = exercises.check(name, _defined(function, source, imports))
        except _CannotRun as stopped:
            verdict = exercises.Verdict(name, False, str(stopped))
    hint = verdict.hint
    if re.search(r"\b(ModuleNotFound|Import)Error\b", hint):
        hint = f"{hint} {NOT_HERE}"
    return json.dumps({"passed": verdict.passed, "hint": hint, "printed": printed.getvalue()[:PRINTED]})


def _defined(function: str, source: str, imports: str) -> Any:
    """The function that the text defines.  Raises _CannotRun with the reason why there is none."""
    # So that a hint can show the line.
    linecache.cache[FILE] = (len(source), None, source.splitlines(keepends=True), FILE)
    try:
        tree = ast.parse(source, FILE)
        code = compile(tree, FILE, "exec", dont_inherit=True)
    except SyntaxError as error:
        line = f"Line {error.lineno}" if error.lineno else "This"
        raise _CannotRun(f"{line} is not Python yet: {error.msg}.") from None
    except ValueError as error:  # a null byte
        raise _CannotRun(f"This is not Python yet: {error}.") from None
    space: dict[str, Any] = {"__name__": "answer"}
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    for statement in ast.parse(imports).body:
        _import(statement, used, space)
    try:
        exec(code, space)
    except (Exception, SystemExit) as error:
        said = explain(error, SimpleNamespace(__code__=code))
        raise _CannotRun(said.replace("Your function", "Your code", 1)) from None
    if function not in space:
        raise _CannotRun(f"Your code defines no `{function}`. Keep the name that the exercise gave.")
    return space[function]


def _import(statement: ast.stmt, used: set[str], space: dict[str, Any]) -> None:
    """Those names of an import statement that the answer uses."""
    if not isinstance(statement, (ast.Import, ast.ImportFrom)):
        raise ValueError(f"imports: expected import statements only, got {ast.unparse(statement)}")
    names = [alias for alias in statement.names if (alias.asname or alias.name).split(".")[0] in used]
    if not names:
        return
    wanted = ast.unparse(
        ast.Import(names)
        if isinstance(statement, ast.Import)
        else ast.ImportFrom(statement.module, names, statement.level)
    )
    try:
        exec(wanted, space)
    except ImportError as error:
        raise _CannotRun(f"`{wanted}` does not work here ({error}). {NOT_HERE}") from None
