"""A judge at work, seen from the grader: started, given a task at a time, and replaced when it does not come back."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from grading.limits import Limits

TOOLS = Path(__file__).resolve().parents[1]
START = 120.0  # seconds until a judge has the course imported, on a very busy machine
OVER = 60.0  # seconds that a judge may take beyond what it allows the student's code
LOST = "The judge itself had to be ended while it looked at this answer: look at the answer by eye."


class Bench:
    """A judge in a process of its own; a context manager that ends it."""

    def __init__(self, limits: Limits, labs: list[str]) -> None:
        self.limits, self.labs, self.walls, self._process = limits, labs, [], None

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: Any) -> None:
        self._end()

    def verdict(self, work: dict[str, Any]) -> dict[str, Any]:
        """The judge's verdict on one task; a judge that is lost costs this task alone."""
        if self._process is None:
            self._start()
        allowed = self.limits.project_seconds if work["kind"] == "project" else self.limits.seconds
        try:
            self._process.stdin.write(json.dumps(work).encode() + b"\n")
            self._process.stdin.flush()
            return self._line(self.limits.seconds + allowed + OVER)
        except (OSError, ValueError):
            self._end()
            return {"share": 0.0, "said": [LOST], "mark": None}

    def _start(self) -> None:
        # Without what makes checks raise, and with the course and the grader on the path.
        environment = {k: v for k, v in os.environ.items() if k not in ("NBGRADER_EXECUTION", "COURSEKIT_GRADING")}
        paths = [str(TOOLS.parent), str(TOOLS), os.environ.get("PYTHONPATH", "")]
        environment |= {"PYTHONPATH": os.pathsep.join(filter(None, paths)), "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "grading.judge", *map(json.dumps, (asdict(self.limits), self.labs))],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, start_new_session=True,
        )  # fmt: skip
        try:
            self.walls = self._line(START)["walls"]
        except (OSError, ValueError):
            self._end()
            raise RuntimeError("the judge did not start; what it said stands above") from None

    def _line(self, timeout: float) -> dict[str, Any]:
        """The judge's next line.  Raises TimeoutError, or ValueError when the judge has ended."""
        with selectors.DefaultSelector() as waiting:
            waiting.register(self._process.stdout, selectors.EVENT_READ)
            if not waiting.select(timeout):
                raise TimeoutError
        return json.loads(self._process.stdout.readline())

    def _end(self) -> None:
        if self._process is not None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            self._process.stdin.close()
            self._process.stdout.close()
        self._process = None
