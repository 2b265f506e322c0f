"""What lab 7 says of a lost robot's filter, on seeds that the lab does not show."""

import nbformat
import numpy as np
import pytest

from tests import notebooks


def cell(lab, start):
    """The source of the lab's code cell that begins so."""
    found = [c.source for c in lab.cells if c.cell_type == "code" and c.source.startswith(start)]
    assert len(found) == 1
    return found[0]


@pytest.fixture(scope="module")
def names():
    """What the lab's own cells define."""
    lab = nbformat.read(notebooks.FOLDER / "07_particle_filter.ipynb", as_version=4)
    defined = {}
    exec(cell(lab, "import numpy"), defined)
    exec(cell(lab, "def localise("), defined)
    exec(cell(lab, "def as_needed(").split("rng = ")[0], defined)
    exec(cell(lab, "def nees_over_time(").split("seeds = ")[0], defined)
    return defined


@pytest.mark.slow
def test_of_150_other_drives_seven_in_ten_are_too_sure_with_4000_particles_and_one_in_twenty_with_60000(names):
    def share(N, size):
        nees = [np.mean(names["nees_over_time"](N, size, seed)[4:]) for seed in range(910_000, 910_150)]
        return np.mean(np.array(nees) > 6)

    assert 0.6 < share(4000, lambda cloud, rng: 4000) < 0.8
    assert 0.01 < share(60_000, names["as_needed"]) < 0.1
