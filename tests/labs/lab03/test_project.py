"""Lab 3's project: a sound design gets its marks, and a wrong one the mark and the finding that it deserves."""

import nbformat
import numpy as np
import pytest

from coursekit.labs.lab03.project import PROJECT, Reference
from coursekit.noise import Log, fit_piecewise
from tests import notebooks
from tests.labs.judge import Judge

card = Judge(PROJECT, Reference, range(900, 904))


def the_labs_solution():
    """The class that stands in the notebook."""
    path = next(p for p in notebooks.NOTEBOOKS if p.stem.startswith("03"))
    source = next(c.source for c in nbformat.read(path, 4).cells if c.source.startswith("class MyNoiseModel"))
    space = {"np": np}
    exec(source, space)
    return space["MyNoiseModel"]


class Right(the_labs_solution()):
    pass


class Report:
    """The report's model: a variance each, and nothing corrected."""

    def __init__(self, r, phi, r_true, phi_true, turn_rate, speed):
        self.model = fit_piecewise(Log(r, phi, r_true, phi_true))

    def correct(self, r, phi, turn_rate, speed):
        return r, phi

    def R(self, r, phi, turn_rate, speed):
        return self.model.R(r, phi)


class Spoilt:
    """The right model, fitted to the log, whose answers are then spoilt."""

    def __init__(self, *log):
        self.right = Right(*log)

    def correct(self, *measured):
        return self.right.correct(*measured)

    def R(self, *measured):
        return self.right.R(*measured)


class OneVariance(Spoilt):
    """Bias and delay right, but one R for all."""

    def R(self, *measured):
        R = super().R(*measured)
        return np.broadcast_to(R.mean(axis=0), R.shape)


class NoDelay(Spoilt):
    """As if every picture were new."""

    def correct(self, r, phi, turn_rate, speed):
        return super().correct(r, phi, 0 * turn_rate, 0 * speed)


class WrongWay(Spoilt):
    """The delay with the wrong sign."""

    def correct(self, r, phi, turn_rate, speed):
        return super().correct(r, phi, -turn_rate, -speed)


class SigmaForVariance(Spoilt):
    def R(self, *measured):
        return np.sqrt(super().R(*measured))


class TooSure(Spoilt):
    def R(self, *measured):
        return 0.2 * super().R(*measured)


class TooModest(Spoilt):
    def R(self, *measured):
        return 5 * super().R(*measured)


class ChangesArguments(Spoilt):
    def correct(self, r, phi, turn_rate, speed):
        now = super().correct(r, phi, turn_rate, speed)
        r *= 2
        return now


class NoCovariance(Spoilt):
    def R(self, *measured):
        return 0 * super().R(*measured)


class Nan(Spoilt):
    def correct(self, r, *others):
        return np.full((2, len(r)), np.nan)


class OneForAll(Spoilt):
    def R(self, *measured):
        return np.eye(2)


class Stub:
    def __init__(self, *log):
        raise NotImplementedError("your lines here")


def test_the_labs_solution_and_the_package_get_95_and_more():
    for design in (Right, Reference):
        assert card(design).mark >= 95, card(design)


@pytest.mark.parametrize(
    ("design", "low", "high", "said"),
    [
        (Report, 5, 30, "too sure"),
        (OneVariance, 30, 75, "too modest"),
        (NoDelay, 10, 50, "in turns it is too sure"),
        (WrongWay, 5, 40, "in turns it is too sure"),
        (SigmaForVariance, 25, 60, "too modest"),
        (TooSure, 30, 60, "near it is too sure"),
        (TooModest, 50, 75, "in turns it is too modest"),
        (ChangesArguments, 88, 91, "changes its arguments in place"),
        (NoCovariance, 0, 0, "not positive definite"),
        (Nan, 0, 0, "NaN"),
        (OneForAll, 0, 0, "expected shape (1500, 2, 2), got (2, 2)"),
        (Stub, 0, 0, "Nothing here yet"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_wrong_design_gets_the_mark_and_the_finding_that_it_deserves(design, low, high, said):
    got = card(design)
    assert low <= got.mark <= high and said in repr(got), got


def test_a_run_is_drawn_beside_the_packages():
    mine, theirs = card.outcomes(Right)[0], card.outcomes(Reference)[0]
    assert len(PROJECT.draw(mine.values, theirs.values).axes) == 2
