"""What a lab holds, read from its cells: a new one cannot be forgotten.  (``tests/rehearsal.py`` runs them.)"""

import re

import nbformat
import pytest

from coursekit.teaching import exercises
from tests.notebooks import NOTEBOOKS

every_lab = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)


def code(path):
    return "\n".join(c.source for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code")


@every_lab
def test_a_lab_has_two_explorers_or_more(path):
    assert len(re.findall(r"^(?:\w+ = )?explore\(", code(path), re.M)) >= 2


@every_lab
def test_a_lab_checks_every_exercise_that_was_written_for_it(path):
    number = path.stem[:2]
    written = {name for name in exercises.names() if name.startswith(f"lab{number}.")}
    asked = re.findall(r'exercises\.check\(\s*"([\w.]+)"', code(path))
    assert sorted(asked) == sorted(written)
    assert 3 <= len(written) <= 6
