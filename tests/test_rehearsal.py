"""The rehearsal of the labs finds what it is there to find, in the kernel that runs them."""

import subprocess
import sys

import nbformat
import pytest
from matplotlib.figure import Figure

from coursekit.teaching import explore
from tests import rehearsal


def line(power):
    figure = Figure(figsize=(4, 3))
    axes = figure.add_axes((0.25, 0.25, 0.5, 0.5))  # far from the rim, whatever the style
    axes.plot([0, 1 / (power - 10)])
    axes.set_ylim(-1, 1)
    axes.set(xticks=[], yticks=[])
    return figure


def explorer(values):
    return explore.explore(line, alt="1 over {power} - 10", power=values)


def test_a_sound_explorer_passes():
    assert rehearsal.faults(explorer([1, 2, 3])) == []


def test_an_explorer_too_large_to_publish_is_named():
    assert "more than 200" in rehearsal.faults(explorer(range(1000, 1201)))[0]


def test_a_slider_that_raises_is_named_for_its_pictures_and_for_its_live_form():
    found = rehearsal.faults(explorer([1, 2, 10]))
    assert [f for f in found if "raises ZeroDivisionError" in f] and [f for f in found if "live, ZeroDivision" in f]


@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("from coursekit import exercises\nexercises.check('lab02.bearing_of_column', lambda u, camera: 0 * u)", "✗"),
        (
            "from coursekit.explore import explore\nfrom tests.test_rehearsal import line\n"
            "explore(line, alt='{power}', power=[1, 2, 10])",
            "raises ZeroDivisionError",
        ),
    ],
    ids=["check", "slider"],
)
def test_a_lab_fails_in_its_kernel_where_nbmake_alone_would_pass_it(tmp_path, cell, said):
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell)])
    book.metadata["kernelspec"] = {"name": "python3", "display_name": "Python", "language": "python"}
    nbformat.write(book, tmp_path / "lab.ipynb")
    plain = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--nbmake", str(tmp_path / "lab.ipynb")]
    failed = subprocess.run([*plain, "-p", "tests.rehearsal"], cwd=rehearsal.ROOT, capture_output=True, text=True)
    assert failed.returncode == 1 and said in failed.stdout
