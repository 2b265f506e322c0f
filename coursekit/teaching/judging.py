"""The other side of ``projects.score``: runs a design in a process of its own and reports line by line.

Started as ``python -m coursekit.teaching.judging lab04 "[seeds]"`` with the design on standard input.  Whatever the
design prints is thrown away; what it changes, raises or leaves undone is written into the outcome of its run.
"""

from __future__ import annotations

import copy
import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

import cloudpickle
import numpy as np

from coursekit.geometry import Array
from coursekit.teaching.projects import Project, find


class Trouble(Exception):
    """A run cannot go on; the message is the sentence that the student reads."""


class Watch:
    """Calls a student's code: on copies of the arguments, timed, its results looked at before they are used.

    ``step`` counts what the project's loop has done; ``said`` is told about it a few times a second.
    """

    def __init__(self, said: Callable[[dict], None] = lambda message: None) -> None:
        self.step = 0
        self.remarks: dict[str, int] = {}
        self.times: list[float] = []
        self._said, self._last = said, time.monotonic()

    def advance(self) -> None:
        """The loop goes on to its next step."""
        self.step += 1
        if time.monotonic() - self._last > 0.2:
            self._last = time.monotonic()
            self._said({"step": self.step})

    def call(self, what: str, function: Callable, *arguments: Any) -> Any:
        """``function(*arguments)``.  ``what`` names it for the student, as in "predict()".

        Raises ``Trouble`` when it raises.  An argument that it changed in place is a remark.
        """
        given = copy.deepcopy(arguments)
        began = time.perf_counter()
        try:
            with np.errstate(all="ignore"):
                result = function(*given)
        except NotImplementedError:
            raise Trouble("Nothing here yet: replace the placeholder by your own lines") from None
        except (Exception, SystemExit) as error:  # a student's code may raise anything
            raise Trouble(f"{what} raised {type(error).__name__}: {error}") from error
        self.times.append(time.perf_counter() - began)
        if not all(_same(a, b) for a, b in zip(given, arguments, strict=True)):
            self.remark(f"{what} changes its arguments in place; work on copies")
        return result

    def attribute(self, owner: Any, name: str) -> Any:
        """``owner.name``.  Raises ``Trouble`` when it has none, or computing it raises."""
        if not hasattr(owner, name):
            raise Trouble(f"your {type(owner).__name__} has no attribute {name}")
        return getattr(owner, name)

    def remark(self, what: str) -> None:
        """Note something wrong that need not stop the run; the first step counts."""
        self.remarks.setdefault(what, self.step)

    def numbers(self, what: str, value: Any, shape: tuple[int | None, ...]) -> Array:
        """``value`` as finite floats of this shape (None for any length); raises ``Trouble`` when it is not."""
        if value is None:
            raise Trouble(f"{what} is None; is there a return at the function's end?")
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise Trouble(f"{what}: expected numbers, got {type(value).__name__}") from None
        fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=False))
        if not fits:
            wanted = (
                "(" + ", ".join("n" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
            )
            raise Trouble(f"{what}: expected shape {wanted}, got {array.shape}")
        if not np.all(np.isfinite(array)):
            raise Trouble(f"{what} holds NaN or infinity")
        return array

    def covariance(self, what: str, value: Any, n: int) -> Array:
        """``value`` as an (n, n) covariance.  Raises ``Trouble`` when it is none, and remarks on a small asymmetry."""
        cov = self.numbers(what, value, (n, n))
        scale = np.sqrt(np.abs(np.diagonal(cov))) + 1e-150  # the product of two is still above zero
        if np.max(np.abs(cov - cov.T) / np.outer(scale, scale)) > 1e-6:
            raise Trouble(f"{what} is not symmetric, so it is no covariance")
        cov = 0.5 * (cov + cov.T)
        if np.linalg.eigvalsh(cov / np.outer(scale, scale))[0] <= 0:
            raise Trouble(f"{what} is not positive definite: some direction has a variance of zero or less")
        return cov


def attempt(project: Project, design: Any, seed: int, watch: Watch | None = None) -> dict:
    """One run, as the message that is sent: seed, values, trouble, remarks, seconds."""
    watch, values, trouble = watch or Watch(), {}, ""
    try:
        values = project.run(design, project.make(np.random.default_rng(seed)), watch)
    except Trouble as stop:
        trouble = f"{stop}|, step {watch.step}"
    remarks = [f"{what}|, step {step}" for what, step in watch.remarks.items()]
    seconds = float(np.median(watch.times)) if watch.times else float("nan")
    as_lists = {name: np.asarray(value).tolist() for name, value in values.items()}
    return {"seed": seed, "values": as_lists, "trouble": trouble, "remarks": remarks, "seconds": seconds}


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return bool(np.array_equal(a, b, equal_nan=a.dtype.kind == "f"))
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return True


def _silent() -> TextIO:
    """Standard output kept for reports; whatever the design prints goes nowhere."""
    channel = os.fdopen(os.dup(1), "w", buffering=1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    return channel


def main() -> None:
    """Run every seed, one line of JSON each."""
    channel = _silent()

    def say(message: dict) -> None:
        channel.write(json.dumps(message) + "\n")

    project, seeds = find(sys.argv[1]), json.loads(sys.argv[2])
    try:
        design = cloudpickle.load(sys.stdin.buffer)
    except Exception as error:  # a design that needs what this process has not
        why = f"your design cannot be rebuilt in another process ({type(error).__name__}: {error})"
        for seed in seeds:
            say({"seed": seed, "values": {}, "trouble": why, "remarks": [], "seconds": float("nan")})
        return
    say({"step": 0})
    for seed in seeds:
        say(attempt(project, design, seed, Watch(say)))


if __name__ == "__main__":
    main()
