"""What the line about honesty says: how the package did, where the NEES left its band, how often and on which side."""

import numpy as np

from coursekit.teaching.criteria import honest
from coursekit.teaching.projects import Outcome


def said(nees, package=3.0, **options):
    """The sentence for ten runs that all have this NEES, beside a package's that is the same at every step."""
    runs, theirs = ([Outcome(seed, {"nees": np.array(v)}) for seed in range(10)]
                    for v in (nees, np.full(len(nees), package)))  # fmt: skip
    return honest("nees", 3, **options)(runs, theirs)[1]


def test_the_first_step_outside_is_named_as_the_project_names_it_beside_both_counts():
    sentence = said([3.0, 9.0, 9.0, 0.1, 3.0], when=lambda k: f"t = {k / 2} s")
    assert sentence.endswith("First above at t = 0.5 s; 2 steps above, 1 below: too sure of itself")


def test_in_a_long_run_a_single_step_outside_is_not_called_the_first():
    nees = np.full(40, 3.0)
    nees[3] = 0.1
    nees[20:] = 0.1
    assert "First below, 4 in a row, at step 21; 0 steps above, 21 below: too modest" in said(nees)


def test_as_many_steps_above_as_below_get_no_verdict():
    assert said([9.0, 0.1]).endswith("1 steps above, 1 below")


def test_the_package_s_share_and_average_stand_beside_the_design_s():
    sentence = said([3.0, 3.0, 9.0, 9.0], package=2.9)
    assert sentence.startswith("50 % of the steps") and "(the package: 100 %)" in sentence
    assert "averages 6 (the package: 2.9)" in sentence
