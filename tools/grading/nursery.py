"""Makes students' processes quickly: forks of one that has the course imported, and that knows nothing.

The judge forks the nursery before it is told any seed, and asks it for a process over a socket.  Three generations:

    nursery → guard → student's process

The guard leaves the network, forks the student's process into a world of processes of its own, and ends it when the
judge lets go of the lifeline, or is killed itself.
"""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import socket
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

from grading import student, walls, wire
from grading.limits import Limits


class Nursery:
    """A process that makes processes.  Begin it before anything secret is known."""

    def __init__(self, readable: list[Path], limits: Limits) -> None:
        self.link, theirs = socket.socketpair()
        self.pid = os.fork()
        if self.pid == 0:
            self.link.close()
            _apart(lambda: _tend(theirs, readable, limits))
        theirs.close()

    def process(self, seconds: float) -> Process:
        """A new process for one student's code, with so much processor time."""
        mine, theirs = socket.socketpair()
        watched, lifeline = os.pipe()
        socket.send_fds(self.link, [b"!"], [theirs.fileno(), watched])
        theirs.close()
        os.close(watched)
        return Process(mine, lifeline, seconds)


class Process:
    """The judge's end of a student's process; a context manager that ends it."""

    def __init__(self, link: socket.socket, lifeline: int, seconds: float) -> None:
        self.link, self.lifeline, self.broken = link, lifeline, False
        self.folder = Path(tempfile.mkdtemp(prefix="graded-")).resolve()
        wire.send(link, pickle.dumps({"folder": str(self.folder), "seconds": seconds}))

    def ask(self, question: str, *arguments: Any, timeout: float | None = None) -> dict[str, Any]:
        """A question and its answer.  Raises EOFError or OSError when the process is gone or silent, or the answer is
        none; after that, nothing more is asked."""
        if self.broken:
            raise EOFError("there was no answer before")
        self.broken = True
        self.link.settimeout(timeout)
        try:
            wire.send(self.link, pickle.dumps((question, arguments)))
            answer = wire.from_json(wire.receive(self.link))
        except ValueError as error:
            raise EOFError(str(error)) from None
        if not isinstance(answer, dict):
            raise EOFError("a message that no answer looks like")
        self.broken = False
        return answer

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: Any) -> None:
        os.close(self.lifeline)
        self.link.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def _apart(work: Any) -> None:
    """Do the work of a forked process and end it, whatever happens."""
    try:
        work()
    finally:
        os._exit(0)


def _tend(link: socket.socket, readable: list[Path], limits: Limits) -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for guards
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    while True:
        asked, handles, _, _ = socket.recv_fds(link, 1, 2)
        if not asked:
            return
        theirs, watched = handles
        if os.fork() == 0:
            link.close()
            _apart(partial(_guard, theirs, watched, readable, limits))
        os.close(theirs)
        os.close(watched)


def _guard(handle: int, watched: int, readable: list[Path], limits: Limits) -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    os.setsid()  # the end of the judge's own group of processes does not end the guard before its work is done
    in_force = walls.alone()
    pid = os.fork()
    if pid == 0:
        _apart(lambda: student.live(socket.socket(fileno=handle), readable, limits, in_force))
    os.close(handle)
    os.read(watched, 1)  # returns when the lifeline is let go
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
