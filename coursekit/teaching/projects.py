"""Projects: a student builds the whole system from an empty cell, and is scored on drives that it has not seen.

``exercises.score("lab04", MyFilter)`` runs the design in a process of its own, on freshly drawn scenarios, and answers
with a card: a mark out of 100 by a published rubric, the error, the NEES with its band, the time per step, what went
wrong first and when, and a picture of one run beside the package's own.

A lab describes its project by a ``Project``: how a scenario is drawn, how a design is run on it, what is judged.
The design may be a class or a function, written in a notebook or anywhere else.  It may raise, loop for ever, return
NaN or change its arguments: each of these is a finding on the card, never an error in the notebook.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any

import numpy as np

from coursekit.geometry import Array
from coursekit.teaching._grader import in_a_grader
from coursekit.teaching.score_card import score_card

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Judgement = tuple[float, str]
"""A share of the points in [0, 1], and one sentence that says why."""


@dataclass(frozen=True)
class Outcome:
    """What one run of a design gave.

    values : named arrays; empty when the run did not come to its end.
    trouble : why it did not, and at which step; empty when it did.
    remarks : what the design did wrong on its way without being stopped, each with its step.
    seconds : median time of one call.
    """

    seed: int
    values: dict[str, Array] = field(default_factory=dict)
    trouble: str = ""
    remarks: tuple[str, ...] = ()
    seconds: float = float("nan")


@dataclass(frozen=True)
class Criterion:
    """One line of a rubric.

    points : what it is worth; a project's points add up to 100.
    judge : ``judge(outcomes of the design, outcomes of the reference) → (share, sentence)``, called with the runs that
        came to their end, at least one.
    """

    label: str
    points: int
    judge: Callable[[list[Outcome], list[Outcome]], Judgement]


@dataclass(frozen=True)
class Project:
    """The whole of a lab, to be built and scored.

    make : ``make(rng) → scenario``, a fresh one for each run.
    run : ``run(design, scenario, watch) → values``: drives the design through a scenario.  It calls the student's code
        through ``watch`` only (see ``judging.Watch``), and returns named arrays.
    reference : the package's own design, run on the same scenarios.
    criteria : the rubric.
    draw : ``draw(values, values of the reference) → Figure``, one run beside the package's.
    runs : how many scenarios.     patience : seconds without a finished step before a run counts as hanging.
    """

    name: str
    title: str
    make: Callable[[np.random.Generator], Any]
    run: Callable[[Any, Any, Any], dict[str, Array]]
    reference: Any
    criteria: tuple[Criterion, ...]
    draw: Callable[[dict[str, Array], dict[str, Array]], Figure]
    runs: int = 20
    patience: float = 10.0

    def __post_init__(self) -> None:
        if (total := sum(c.points for c in self.criteria)) != 100:
            raise ValueError(f"{self.name}: expected a rubric of 100 points, got {total}")


@dataclass(frozen=True)
class Score:
    """The card.  ``mark`` out of 100; ``lines`` of the rubric as (label, points, of how many, sentence)."""

    project: Project
    outcomes: tuple[Outcome, ...]
    references: tuple[Outcome, ...]
    lines: tuple[tuple[str, float, int, str], ...]
    findings: tuple[str, ...]

    @property
    def mark(self) -> int:
        """Points of all lines, rounded to a whole number."""
        return round(sum(points for _, points, _, _ in self.lines))

    def figure(self) -> Figure | None:
        """The design's first finished run beside the package's; None when no run came to its end."""
        for mine, theirs in zip(self.outcomes, self.references, strict=False):
            if mine.values and theirs.values:
                return self.project.draw(mine.values, theirs.values)
        return None

    def __repr__(self) -> str:
        rows = [f"{self.project.title}: {self.mark} of 100"]
        rows += [f"  {points:5.1f} of {most:3d}  {label}: {why}" for label, points, most, why in self.lines]
        return "\n".join([*rows, *(f"  ! {finding}" for finding in self.findings)])

    def _repr_html_(self) -> str:
        runs = ([], []) if _published() else (self.outcomes, self.references)  # a page is the same whoever built it
        pace = _median([o.seconds for o in runs[0]]), _median([o.seconds for o in runs[1]])
        return score_card(self.project.title, self.mark, self.lines, self.findings, pace, self.figure())


def _published() -> bool:
    """Whether this runs for a page of the book."""
    return bool(os.environ.get("COURSEKIT_STATIC"))


def _median(values: list[float]) -> float:
    known = [v for v in values if np.isfinite(v)]
    return float(np.median(known)) if known else float("nan")


def find(name: str) -> Project:
    """The project of a lab, as in ``find("lab04")``.  Raises ValueError for a name that is no lab's with a project."""
    try:
        return importlib.import_module(f"coursekit.labs.{name}.project").PROJECT
    except ModuleNotFoundError as error:
        if not str(error.name).startswith("coursekit.labs"):
            raise
        raise ValueError(f"no project named {name!r}; a project is named after its lab, as in 'lab04'") from None


def score(name: str, design: Any, *, seed: int | None = None, runs: int | None = None) -> Score:
    """Run a design on scenarios that it has not seen, and mark it by the project's rubric.

    Parameters
    ----------
    name : the lab, as in "lab04".
    design : what the project asked for, a class or a function.
    seed : fixes the scenarios; the default draws new ones each time.
    runs : how many scenarios; the project's own number by default.

    Raises ValueError for a name without a project and for ``runs`` < 1, TypeError for a design that cannot be called.
    Whatever the design does is a finding on the card, never an exception.  Only in a grader that goes by exceptions, as
    nbgrader does, a mark of 0 raises AssertionError.

    >>> score("lab04", None)
    Traceback (most recent call last):
    ...
    TypeError: design: expected a class or a function, got NoneType; give MyFilter, not MyFilter(...)
    """
    project = find(name)
    if not callable(design):
        raise TypeError(f"design: expected a class or a function, got {type(design).__name__}; "
                        "give MyFilter, not MyFilter(...)")  # fmt: skip
    runs = project.runs if runs is None else runs
    if runs < 1:
        raise ValueError(f"runs: expected at least 1, got {runs}")
    from tqdm.auto import tqdm  # here, so that checks and projects import in no time

    if seed is None and _published():
        seed = 0  # each build of a page shows the same
    seeds = [int(s) for s in np.random.SeedSequence(seed).generate_state(runs)]
    ran = []
    for title, built in ((project.title, design), ("the package on the same", project.reference)):
        with tqdm(total=runs, desc=title, unit="run", leave=False, disable=in_a_grader()) as bar:
            ran.append(_run_apart(project, built, seeds, bar))
    card = mark(project, *ran)
    if card.mark == 0 and in_a_grader():
        raise AssertionError("\n".join(card.findings))
    return card


def mark(project: Project, outcomes: Sequence[Outcome], references: Sequence[Outcome]) -> Score:
    """Judge outcomes by a rubric.  Runs that did not come to their end take their share of every line's points."""
    finished = [o for o in outcomes if o.values]
    ended = {o.seed for o in finished}
    theirs = [o for o in references if o.seed in ended]
    lines = []
    for criterion in project.criteria:
        share, why = criterion.judge(finished, theirs) if finished else (0.0, "no run came to its end")
        share = min(max(float(share), 0.0), 1.0) * len(finished) / len(outcomes)
        lines.append((criterion.label, criterion.points * share, criterion.points, why))
    return Score(project, tuple(outcomes), tuple(references), tuple(lines), tuple(_findings(outcomes)))


def _findings(outcomes: Sequence[Outcome]) -> list[str]:
    """What stopped runs, each kind once and with the first run that it happened in; then remarks, likewise."""
    findings: dict[str, str] = {}
    for i, outcome in enumerate(outcomes, 1):
        for said in filter(None, [outcome.trouble, *outcome.remarks]):
            what, _, where = said.partition("|")
            findings.setdefault(what, f"{what} (first in run {i}{where})")
    return list(findings.values())


def _run_apart(project: Project, design: Any, seeds: list[int], bar: Any) -> list[Outcome]:
    """Outcomes of all seeds, from a process of its own; a run that hangs is the last."""
    import cloudpickle

    try:
        payload = cloudpickle.dumps(design)
    except Exception as error:  # whatever a design holds on to
        why = (
            f"your design cannot be sent to another process ({type(error).__name__}: {error}). "
            "Does it hold an open file, a figure or a progress bar?"
        )
        return [Outcome(seed, trouble=why) for seed in seeds]
    command = [sys.executable, "-m", "coursekit.teaching.judging", project.name, json.dumps(seeds)]
    # What a design imports from files beside the notebook, the other process has to find as well.
    paths = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=paths
    )
    assert process.stdin and process.stdout
    messages: Queue[dict | None] = Queue()

    def listen() -> None:
        assert process.stdout
        for line in process.stdout:
            messages.put(json.loads(line))
        messages.put(None)

    threading.Thread(target=listen, daemon=True).start()
    outcomes: list[Outcome] = []
    step, heard, starting = 0, time.monotonic(), True
    try:
        process.stdin.write(payload)
        process.stdin.close()
        while len(outcomes) < len(seeds):
            try:
                message = messages.get(timeout=0.2)
            except Empty:
                if time.monotonic() - heard > (60.0 if starting else project.patience):
                    late = f"your code did not come back within {project.patience:.0f} s: is there an endless loop?"
                    outcomes.append(Outcome(seeds[len(outcomes)], trouble=f"{late}|, step {step}"))
                    break
                continue
            heard = time.monotonic()
            if message is None:
                why = f"your code ended the process that ran it|, step {step}"
                outcomes.append(Outcome(seeds[len(outcomes)], trouble=why))
                break
            starting = False
            if "step" in message:
                step = message["step"]
            else:
                outcomes.append(outcome(message))
                step = 0
                bar.update()
    except BrokenPipeError:
        outcomes.append(Outcome(seeds[0], trouble="your code ended the process that ran it"))
    finally:
        process.kill()
        process.wait()
    bar.update(len(seeds) - len(outcomes))
    return outcomes + [
        Outcome(seed, trouble="not run, since the run before it did not end") for seed in seeds[len(outcomes) :]
    ]


def outcome(message: dict) -> Outcome:
    """What a run's message says, as ``judging.attempt`` writes it."""
    values = {name: np.asarray(value, dtype=float) for name, value in message["values"].items()}
    return Outcome(message["seed"], values, message["trouble"], tuple(message["remarks"]), message["seconds"])
