"""What runs in a student's process: the student's code, and answers to a judge's questions.

The code is data until it arrives here.  Nothing of the judge is in this process: no seed, no scenario, no verdict.  So
whatever the code replaces, prints or kills, it can earn points only by giving the right answers.
"""

from __future__ import annotations

import io
import itertools
import linecache
import os
import pickle
import socket
import sys
import tempfile
import types
from pathlib import Path
from typing import Any

from coursekit.teaching import exercises, judging
from grading import walls, wire
from grading.limits import Limits

KEPT = {
    "PATH",
    "LANG",
    "LC_ALL",
    "COURSEKIT_DATA",
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "PYTHONPATH",
    "XDG_CACHE_HOME",
}


class Nowhere(io.TextIOBase):
    """Where prints go: 200 MB of them cost nothing."""

    def write(self, text: str) -> int:
        return len(text)


class Answering:
    """The student's names, and what the judge has asked to keep."""

    def __init__(self, in_force: list[str]) -> None:
        self.in_force = in_force
        self.objects: list[Any] = []
        self.stopped: list[str] = []

    def keep(self, value: Any) -> int:
        self.objects.append(value)
        return len(self.objects) - 1

    def find(self, number: int, member: str) -> Any:
        return getattr(self.objects[number], member) if member else self.objects[number]

    def load(self, statements: list[tuple[str, str]], target: str) -> dict[str, Any]:
        """Run the statements that an answer needs, (where, source) each, and keep the answer as object 0."""
        main = types.ModuleType("__main__")
        main.__dict__.update(display=lambda *_, **__: None, get_ipython=lambda: None)
        sys.modules["__main__"] = main
        for where, source in statements:
            _remember(where, source)
            try:
                exec(compile(source, where, "exec"), main.__dict__)
            except BaseException as error:  # a student's code may raise anything
                self.stopped.append(
                    f"{where} stopped with {type(error).__name__}: {' '.join(str(error).split())[:300]}"
                )
        found = target in main.__dict__
        self.keep(main.__dict__.get(target))
        return {"found": found, "callable": found and callable(self.objects[0]), "stopped": self.stopped}

    def check(self, arguments: tuple, options: dict[str, Any]) -> dict[str, Any]:
        """What an exercise's check sees of the answer."""
        try:
            return {"result": wire.pack(exercises.call(self.objects[0], *arguments, **options), self.keep)}
        except exercises.Misconception as hint:
            return {"hint": str(hint)}

    def call(self, what: str, number: int, member: str, arguments: tuple) -> dict[str, Any]:
        """What a project's watch sees of a design."""
        watch = judging.Watch()
        try:
            found = watch.call(what, lambda *given: self.find(number, member)(*given), *arguments)
            reply = {"result": wire.pack(found, self.keep)}
        except judging.Trouble as trouble:
            reply = {"trouble": str(trouble)}
        return reply | {"remarks": list(watch.remarks), "seconds": watch.times}

    def attribute(self, number: int, name: str) -> dict[str, Any]:
        try:
            return {"result": wire.pack(judging.Watch().attribute(self.objects[number], name), self.keep)}
        except judging.Trouble as trouble:
            return {"trouble": str(trouble)}
        except Exception as error:  # a property is a student's code, too
            return {"trouble": f"{name} raised {type(error).__name__}: {error}"}

    def walls(self) -> dict[str, Any]:
        return {"in_force": self.in_force}


def _remember(where: str, source: str) -> None:
    """Lines for hints to quote; a cell comes statement by statement, each with blank lines for what stood before."""
    known = linecache.cache[where][2] if where in linecache.cache else []
    both = itertools.zip_longest(known, source.splitlines(keepends=True), fillvalue="\n")
    linecache.cache[where] = (0, None, [new if new.strip() else old for old, new in both], where)


def live(link: socket.socket, readable: list[Path], limits: Limits, in_force: list[str]) -> None:
    """A student's process from its fork to its end: behind its walls, question by question."""
    setup = pickle.loads(wire.receive(link))
    folder = Path(setup["folder"])
    _forget_the_world(link, folder)
    answering = Answering([*in_force, *walls.close_in(folder, readable, limits, setup["seconds"])])
    while True:
        question, arguments = pickle.loads(wire.receive(link))
        wire.send(link, wire.as_json(getattr(answering, question)(*arguments)))


def _forget_the_world(link: socket.socket, folder: Path) -> None:
    """No open file but the link to the judge, an environment of six names, a folder of its own; prints go nowhere."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nowhere, standard)
    os.closerange(3, link.fileno())
    os.closerange(link.fileno() + 1, 4096)
    sys.stdin, sys.stdout, sys.stderr = open(0), Nowhere(), Nowhere()  # noqa: SIM115
    for name in set(os.environ) - KEPT:
        del os.environ[name]
    os.environ.update(HOME=str(folder), TMPDIR=str(folder), MPLCONFIGDIR=str(folder), MPLBACKEND="agg")
    tempfile.tempdir = None
    os.chdir(folder)
