"""What a student's code may not do while it is checked: run for ever, or call what the exercise rules out."""

from __future__ import annotations

import ctypes
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

AGAIN = 0.05  # seconds until the next signal: a bare ``except:`` inside the loop may have swallowed the first


class OutOfTime(BaseException):
    """The time is over.  No ``Exception``, so that a student's ``except Exception`` does not swallow it."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise OutOfTime inside the ``with`` block once it has run for ``seconds``; Ctrl-C goes on working.

    On the main thread of a POSIX system an alarm signal does it, which also ends a sleep.  On Windows and on other
    threads a second thread plants the exception; Python code sees it at its next step, a sleep only at its end.
    In a browser there is neither an alarm nor a thread, so there is no limit either; the page has a button that stops.
    """
    if sys.platform in ("emscripten", "wasi"):
        yield
        return
    on_main = threading.current_thread() is threading.main_thread()
    with _by_signal(seconds) if on_main and hasattr(signal, "setitimer") else _by_thread(seconds):
        yield


@contextmanager
def _by_signal(seconds: float) -> Iterator[None]:
    def ring(*_: Any) -> None:
        raise OutOfTime

    before = signal.signal(signal.SIGALRM, ring)
    left, interval = signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, left, interval)
        signal.signal(signal.SIGALRM, before)


class _Settled(BaseException):
    """Takes the place of an OutOfTime that came too late; never leaves this file."""


@contextmanager
def _by_thread(seconds: float) -> Iterator[None]:
    here, over, lock = ctypes.c_ulong(threading.get_ident()), threading.Event(), threading.Lock()
    planted = False

    def plant(exception: type[BaseException]) -> None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(here, ctypes.py_object(exception))

    def watch() -> None:
        nonlocal planted
        wait = seconds
        while not over.wait(wait):
            with lock:
                if not over.is_set():
                    planted = True
                    plant(OutOfTime)
            wait = AGAIN

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        # What was planted too late is replaced, and raised here.  To plant nothing in its place would leave Python 3.11
        # with a note of an exception that never comes, and the next profiler or debugger would run for ever.
        try:
            with lock:
                over.set()
                if planted:
                    plant(_Settled)
            for _ in range(1_000_000 * planted):
                pass
        except _Settled:
            pass


@contextmanager
def ruled_out(functions: Mapping[str, Sequence[Callable]], answer: Any, error: type[Exception]) -> Iterator[None]:
    """Inside the ``with`` block these functions raise ``error(reason)`` instead of doing their work.

    functions : reason → what it rules out.  Every module of its package that holds one under its own name, and every
    name in the globals of ``answer``, meets the stand-in; all is put back at the end.
    """
    put_back: list[tuple[dict[str, Any], str, Any]] = []
    try:
        for reason, ruled in functions.items():
            stand_in = _raising(error(reason))
            for function in ruled:
                root = function.__module__.split(".")[0]
                at_home = [m for name, m in sys.modules.items() if name.split(".")[0] == root]
                spaces = [(vars(m), function.__name__) for m in at_home]
                own = getattr(answer, "__globals__", {})
                for space, name in spaces + [(own, name) for name, value in own.items() if value is function]:
                    if space.get(name) is function:
                        put_back.append((space, name, function))
                        space[name] = stand_in
        yield
    finally:
        for space, name, function in put_back:
            space[name] = function


def _raising(error: Exception) -> Callable:
    def stand_in(*_: Any, **__: Any) -> None:
        raise error

    return stand_in
