"""What may come of a call with a hostile argument, and what may not.

What may happen: an error that the docstring names, raised by the package itself and about its argument, or a sound
result.  What may not: any other exception, a warning, a changed argument, a filter that an error has changed, a result
with NaN in it, a call that does not end.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import re
import signal
import traceback
import warnings
from pathlib import Path

import numpy as np

import coursekit
from coursekit.icp import DegenerateGeometry
from coursekit.models.checks import Undefined
from tests.hostile.contract import CALLS
from tests.hostile.hostility import NOT_NUMBERS, NUMBERS, variants

PACKAGE = str(Path(coursekit.__file__).parent)


SECONDS = 2.0  # of the processor; thirty times as many of the clock, for a call that only waits


class Hung(BaseException):
    """A call that did not end: no ``Exception``, so that nobody catches it on the way."""


@contextlib.contextmanager
def time_limit(seconds):
    """Raise ``Hung`` where the block takes longer.  A busy machine is not a hang: the processor's time counts."""
    if not hasattr(signal, "setitimer"):  # Windows
        yield
        return

    def stop(number, frame):
        raise Hung(f"no end after {seconds:g} s")

    timers = (signal.ITIMER_PROF, signal.SIGPROF, seconds), (signal.ITIMER_REAL, signal.SIGALRM, 30 * seconds)
    before = [signal.signal(number, stop) for _, number, _ in timers]
    try:
        for timer, _, after in timers:
            signal.setitimer(timer, after)
        yield
    finally:
        for (timer, number, _), handler in zip(timers, before, strict=True):
            signal.setitimer(timer, 0)
            signal.signal(number, handler)


def sound(result):
    """Are all the numbers in a result finite?"""
    if isinstance(result, (float, np.floating, np.ndarray)):
        array = np.asarray(result)
        return array.dtype.kind not in "fc" or bool(np.isfinite(array).all())
    if isinstance(result, dict):
        return all(map(sound, result.values()))
    if isinstance(result, (list, tuple)):
        return all(map(sound, result))
    if dataclasses.is_dataclass(result) and not isinstance(result, type):
        return all(sound(getattr(result, f.name)) for f in dataclasses.fields(result) if hasattr(result, f.name))
    return True


def frozen(arguments):
    """A copy to compare with afterwards; of what cannot be copied, the thing itself."""
    kept = {}
    for name, value in arguments.items():
        try:
            kept[name] = copy.deepcopy(value)
        except Exception:
            kept[name] = value
    return kept


def same(a, b, exactly=True):
    """Are two things alike, to the last bit or but for rounding?"""
    if isinstance(a, (np.ndarray, float)) and np.asarray(a).dtype.kind in "biuf":
        a, b = np.asarray(a), np.asarray(b)
        return a.tobytes() == b.tobytes() if exactly else np.allclose(a, b, rtol=1e-9, atol=1e-12, equal_nan=True)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(same(x, y, exactly) for x, y in zip(a, b, strict=True))
    if dataclasses.is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(
            same(getattr(a, f.name, None), getattr(b, f.name, None), exactly) for f in dataclasses.fields(a)
        )
    return True


def tried(name, changed):
    """What happens: ("error", exception) or ("result", it), with whatever the call did wrong on the way."""
    function, arguments = CALLS[name]()
    arguments |= changed
    kept = frozen(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            with time_limit(SECONDS):
                outcome = "result", function(**arguments)
        except (Exception, Hung) as error:
            outcome = "error", error
    for other, before in kept.items():
        if other != "rng":
            assert same(before, arguments[other]), f"{other} was changed"
    return outcome


# Where a docstring promises NaN or infinity, or an error of its own.
PROMISED = {
    "geometry.": "NaN in, NaN out",
    "models.pose_residual": "NaN in, NaN out",
    "ekf.correct_together": "`each` is NaN for a measurement that could not be compared",
    "particles.Particles": "a weight of zero has the logarithm -inf",
    "particles.weigh": "a weight of zero has the logarithm -inf",
    "icp.align": "without a pair the RMSE is infinite",
    "icp.scan_to_": "without a pair the RMSE is infinite",
}
DOCUMENTED = {"noise.fit_calibrated": RuntimeError}  # "when the fit does not converge"
SAID = re.compile(r"[Ee]xpected|^[\w\[\]. ]+: |^the positions lie on a line")


def complaint(name, changed):
    """Why the outcome of a call with these arguments changed is not right; empty when it is."""
    kind, what = tried(name, changed)
    if kind == "result":
        promised = any(name.startswith(start) for start in PROMISED)
        return "" if promised or sound(what) else f"a result with NaN or infinity: {what!r}"[:300]
    if isinstance(what, DOCUMENTED.get(name, DegenerateGeometry)):
        return ""
    if type(what) not in (ValueError, TypeError, Undefined):
        return f"{type(what).__name__}: {what}"
    last = traceback.extract_tb(what.__traceback__)[-1]
    if not last.filename.startswith(PACKAGE):
        return f"{type(what).__name__} from {Path(last.filename).name}: {what}"
    return "" if SAID.search(str(what)) else f"{type(what).__name__} does not say what was expected: {what}"


# Arguments that may be anybody's function or model: what that raises is its own affair.
ANYBODYS = {("particles.weigh", "log_likelihood"): callable, ("particles.resample", "method"): callable,
            ("particles.predict", "motion"): lambda bad: hasattr(bad, "sample")}  # fmt: skip


def hostile(name):
    """Each argument of a call with each hostile value; a function is only ever replaced by what cannot be called."""
    _, good = CALLS[name]()
    for argument, value in good.items():
        right = ANYBODYS.get((name, argument), callable if callable(value) else lambda bad: False)
        for what, bad in {**NOT_NUMBERS, **NUMBERS, **dict(variants(value))}.items():
            if not right(bad):
                yield argument, what, bad
