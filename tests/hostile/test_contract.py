"""Hostile arguments at every door: one is replaced at a time, and the rest of the call stays good.

What may happen: an error that the docstring names, raised by the package itself and about its argument, or a sound
result.  What may not: any other exception, a warning, a changed argument, a filter that an error has changed, a result
with NaN in it.
"""

import copy
import dataclasses
import re
import traceback
import warnings
from pathlib import Path

import numpy as np
import pytest

import coursekit
from coursekit.icp import DegenerateGeometry
from coursekit.models.checks import Undefined
from tests.hostile.contract import CALLS
from tests.hostile.hostility import NOT_NUMBERS, NUMBERS, clothes, variants
from tests.test_docstrings import NAMES

PACKAGE = str(Path(coursekit.__file__).parent)


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


def tried(name, argument, value):
    """What happens: ("error", exception) or ("result", it), with whatever the call did wrong on the way."""
    function, arguments = CALLS[name]()
    arguments[argument] = value
    kept = frozen(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            outcome = "result", function(**arguments)
        except Exception as error:
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
SAID = re.compile(r"[Ee]xpected|^[\w\[\]. ]+: |^the positions lie on a line")


def complaint(name, argument, value):
    """Why an outcome is not right; empty when it is."""
    kind, what = tried(name, argument, value)
    if kind == "result":
        promised = any(name.startswith(start) for start in PROMISED)
        return "" if promised or sound(what) else f"a result with NaN or infinity: {what!r}"[:300]
    if isinstance(what, DegenerateGeometry):
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


@pytest.mark.parametrize("name", CALLS)
def test_one_hostile_argument_gives_an_error_that_names_it_or_a_sound_result(name):
    kind, what = tried(name, *next(iter(CALLS[name]()[1].items())))
    assert kind == "result" and (sound(what) or any(name.startswith(start) for start in PROMISED))
    wrong = [
        f"{argument} = {what}: {why}"
        for argument, what, bad in hostile(name)
        if (why := complaint(name, argument, bad))
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", CALLS)
def test_the_same_numbers_in_another_form_give_the_same_answer(name):
    _, good = CALLS[name]()
    expected = tried(name, *next(iter(good.items())))[1]
    for argument, value in good.items():
        for form, same_numbers in clothes(value):
            kind, got = tried(name, argument, same_numbers)
            assert kind == "result", f"{argument} as {form}: {got!r}"
            assert same(expected, got, exactly=False), f"{argument} as {form}: {got!r}"


def test_the_table_holds_the_whole_contract():
    """All but what opens files, see ``test_files``, and what judges a learner's answer, which may be anything."""
    elsewhere = re.compile(
        r"(datasets|localisation|exercises)\.|recordings\.(read|write)_|noise\.load_log|.*\.Recording$"
    )
    rooms = {"association.Known", "explore.explore"}
    missing = [name for name in NAMES if name not in {*CALLS, *rooms} and not elsewhere.match(name)]
    assert not missing
