"""The judge: asks students' processes, and knows what is right.  It never runs a student's code.

Started as ``python -m grading.judge`` with one task a line on standard input, and one verdict a line as the answer.
The checks and the projects are the package's own, and run here; only the calls of the student's functions travel.
"""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pooch

import coursekit
from coursekit.teaching import exercises, judging, projects
from grading import walls, wire
from grading.limits import Limits
from grading.nursery import Nursery, Process

GONE = (
    "Your code ended the process that ran it, or used more than its share of memory or time. "
    "Does it call exit(), or build something very large?"
)
PATIENCE = 60.0  # seconds for the judge's own side of a question


@dataclass(frozen=True)
class Verdict:
    """share : of the points, in [0, 1].  said : sentences for the student, the most important first."""

    share: float
    said: tuple[str, ...]
    mark: int | None = None


class Answer(exercises.Elsewhere):
    """A student's function, asked in its own process."""

    def __init__(self, process: Process) -> None:
        self.process = process

    def call(self, arguments: tuple, **options: Any) -> Any:
        try:
            reply = self.process.ask("check", arguments, options)
            if "hint" in reply:
                raise exercises.Misconception(str(reply["hint"]))
            return wire.unpack(reply.get("result"))
        except (EOFError, OSError):
            raise exercises.Misconception(GONE) from None


class Watch(judging.Watch):
    """A project's watch whose calls travel.  ``gone`` says why nothing more can be asked."""

    def __init__(self, process: Process, patience: float, deadline: float) -> None:
        super().__init__()
        self.process, self.patience, self.deadline, self.gone = process, patience, deadline, ""

    def call(self, what: str, function: Any, *arguments: Any) -> Any:
        if not isinstance(function, wire.Remote):
            return super().call(what, function, *arguments)
        reply = self._ask("call", what, function.number, function.member, arguments)
        self.times += [t for t in reply.get("seconds", []) if isinstance(t, float)]
        for remark in reply.get("remarks", []):
            self.remark(str(remark))
        return self._result(reply)

    def attribute(self, owner: Any, name: str) -> Any:
        if not isinstance(owner, wire.Remote):
            return super().attribute(owner, name)
        return self._result(self._ask("attribute", owner.number, name))

    def _ask(self, *question: Any) -> dict[str, Any]:
        if (left := self.deadline - time.monotonic()) <= 0:
            self.gone = "your code took more time than all runs together may take"
            raise judging.Trouble(self.gone)
        try:
            return self.process.ask(*question, timeout=min(self.patience, left))
        except TimeoutError:
            self.gone = f"your code did not come back within {self.patience:.0f} s: is there an endless loop?"
        except (EOFError, OSError):
            self.gone = "your code ended the process that ran it, or used more than its share of memory or time"
        raise judging.Trouble(self.gone)

    def _result(self, reply: dict[str, Any]) -> Any:
        if "trouble" in reply:
            raise judging.Trouble(str(reply["trouble"]))
        try:
            return wire.unpack(reply.get("result"), wire.Remote)
        except ValueError as error:
            raise judging.Trouble(f"what came back is no answer ({error})") from None


class Judge:
    """Verdicts on tasks.  ``limits`` hold for each; the nursery is begun before any seed is known.

    labs : those whose modules are imported at once, for students' processes to find them there.
    """

    def __init__(self, limits: Limits, labs: list[str]) -> None:
        self.limits = limits
        exercises.LIMIT = limits.seconds
        root = Path(coursekit.__file__).resolve().parents[1]
        data = [
            root / "data",
            Path(pooch.os_cache("coursekit")),
            Path(os.environ.get("COURSEKIT_DATA") or root / "data"),
        ]
        for lab in labs:
            for file in pkgutil.iter_modules(importlib.import_module(f"coursekit.labs.{lab}").__path__):
                importlib.import_module(f"coursekit.labs.{lab}.{file.name}")
        self.nursery = Nursery(walls.readable(root / "coursekit", data), limits)
        self._references: dict[tuple[str, int], projects.Outcome] = {}

    def walls(self) -> list[str]:
        """What holds a student's process, found out in one that runs no student's code."""
        with self.nursery.process(1.0) as process:
            return process.ask("walls", timeout=PATIENCE)["in_force"]

    def verdict(self, task: dict[str, Any]) -> Verdict:
        """Judge one task: {name, kind, statements, target, seed, runs}."""
        project = task["kind"] == "project"
        seconds = self.limits.project_seconds if project else self.limits.seconds
        with self.nursery.process(seconds) as process:
            try:
                loaded = process.ask("load", task["statements"], task["target"], timeout=self.limits.seconds)
            except TimeoutError:
                late = f"The cells that your answer needs had not finished after {self.limits.seconds:g} s."
                return Verdict(0.0, (late,))
            except (EOFError, OSError):
                return Verdict(0.0, (GONE,))
            before = tuple(str(s)[:400] for s in loaded.get("stopped", []))[:5]
            if not loaded.get("found"):
                missing = f"{task['target']} is not there when its cell has run." if task["target"] else "Not there."
                return Verdict(0.0, (*before, missing))
            judged = self._project(process, task) if project else self._exercise(process, task)
        return judged if judged.share == 1 else Verdict(judged.share, (*judged.said, *before), judged.mark)

    def _exercise(self, process: Process, task: dict[str, Any]) -> Verdict:
        verdict = exercises.check(task["name"], Answer(process), seed=task["seed"])
        return Verdict(float(verdict.passed), (verdict.hint,) if verdict.hint else ())

    def _project(self, process: Process, task: dict[str, Any]) -> Verdict:
        project = projects.find(task["name"])
        seeds = [int(s) for s in np.random.SeedSequence(task["seed"]).generate_state(task["runs"])]
        deadline, gone, outcomes = time.monotonic() + self.limits.project_seconds, "", []
        for seed in seeds:
            if gone:
                outcomes.append(projects.Outcome(seed, trouble="not run, since the run before it did not end"))
                continue
            watch = Watch(process, min(project.patience, self.limits.seconds), deadline)
            try:
                outcomes.append(projects.outcome(judging.attempt(project, wire.Remote(0), seed, watch)))
            except Exception as error:  # the project stumbled over what it was given
                why = f"what came back cannot be used ({type(error).__name__}: {error})|, step {watch.step}"
                outcomes.append(projects.Outcome(seed, trouble=why))
            gone = watch.gone
        score = projects.mark(project, outcomes, [self._reference(project, seed) for seed in seeds])
        ended = any(o.values for o in outcomes)
        lines = [f"{label}: {points:.0f} of {most}. {why}" for label, points, most, why in score.lines if points < most]
        return Verdict(score.mark / 100, tuple(score.findings + ended * tuple(lines)), score.mark)

    def _reference(self, project: projects.Project, seed: int) -> projects.Outcome:
        key = project.name, seed
        if key not in self._references:
            self._references[key] = projects.outcome(judging.attempt(project, project.reference, seed))
        return self._references[key]


def main() -> None:
    """Say what the walls are, then answer task after task."""
    channel = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever else is printed here is no verdict
    judge = Judge(Limits(**json.loads(sys.argv[1])), json.loads(sys.argv[2]))
    channel.write(json.dumps({"walls": judge.walls()}) + "\n")
    for line in sys.stdin:
        channel.write(json.dumps(asdict(judge.verdict(json.loads(line)))) + "\n")


if __name__ == "__main__":
    main()
