"""Every lab's sliders and exercises, found by running the lab: a new one cannot be forgotten.

(nbmake runs the notebooks in a real kernel beside this; it would pass one whose slider raises.)
"""

import pytest

from coursekit import exercises
from coursekit.explore import sweep
from tests import labs

every_lab = pytest.mark.parametrize(
    "path", [pytest.param(p, marks=pytest.mark.xdist_group(p.stem)) for p in labs.NOTEBOOKS], ids=lambda p: p.stem
)


@every_lab
def test_every_explorer_survives_a_sweep_of_its_whole_grid(path):
    problems = {repr(e): found for e in labs.run(path).explorers if (found := sweep(e))}
    assert not problems


@every_lab
def test_a_lab_has_two_explorers_or_more_and_none_too_large_to_publish(path):
    explorers = labs.run(path).explorers
    assert len(explorers) >= 2
    assert not [repr(e) for e in explorers if len(e) > 200]


@every_lab
def test_live_widgets_follow_each_of_their_controls(path):
    for explorer in labs.run(path).explorers:
        widget = explorer.widget()
        pictures = {widget.image.value}
        for control in widget.controls.values():
            for index in range(len(control.options)):
                control.index = index
                pictures.add(widget.image.value)
            assert widget.error.value == ""
        assert len(pictures) > 1


@every_lab
def test_the_labs_own_solutions_pass_their_checks(path):
    lab = labs.run(path)
    assert lab.verdicts
    assert [repr(v) for v in lab.verdicts if not v.passed] == []


@every_lab
def test_a_lab_checks_every_exercise_that_was_written_for_it(path):
    number = path.stem[:2]
    written = {name for name in exercises.names() if name.startswith(f"lab{number}.")}
    assert set(labs.run(path).checked) == written
    assert 3 <= len(written) <= 6
