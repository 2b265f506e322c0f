"""How many slider events a second each lab's explorers answer, from event to encoded picture, in the kernel.

    python benchmarks/explorers.py [--rounds 60] [--json FILE] [01 02 …]      # the labs; all of them by default

Each lab's code is run, and each explorer's controls are moved through the grid in a fixed random order; the figure is
the median over the events.  Encoding is included, the journey to the browser is not.
"""

import contextlib
import io
import sys
import time
from pathlib import Path

# Scripts here find each other, the package and the tests from the project's root.
sys.path[0] = str(Path(__file__).resolve().parents[1])

import nbformat  # noqa: E402
import numpy as np  # noqa: E402
from IPython.core.interactiveshell import InteractiveShell  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit.teaching import explore  # noqa: E402
from tests import notebooks  # noqa: E402


def declared(path):
    """The explorers of a lab, whose code runs in a shell of its own."""
    shell = InteractiveShell()
    with explore.collecting() as found, contextlib.redirect_stdout(io.StringIO()):
        for cell in nbformat.read(path, as_version=4).cells:
            if cell.cell_type == "code":
                shell.run_cell(cell.source, silent=True).raise_error()
    return found


def events_per_second(explorer, events):
    """The rate at each step of a fixed random walk on the grid."""
    widget, rng, times = explorer.widget(), np.random.default_rng(0), []
    sizes = [len(slider.values) for slider in explorer.parameters.values()]
    positions = [slider.values.index(slider.start) for slider in explorer.parameters.values()]
    while len(times) < events:
        control = int(rng.integers(len(sizes)))
        position = int(rng.integers(sizes[control]))
        if position == positions[control]:
            continue
        positions[control] = position
        widget._drawn.cache_clear()  # what was drawn before is kept, and would be answered at once
        start = time.perf_counter()
        said, _ = widget.answer(positions)
        times.append(time.perf_counter() - start)
        assert "error" not in said, said["error"]
    return 1 / np.array(times)


def main():
    parser = results.parser(__doc__, rounds=60)
    parser.add_argument("labs", nargs="*", help="01 02 …")
    options = parser.parse_args()
    rows = results.Rows("Sliders in JupyterLab", threads=1)
    print(f"{'lab':28s} {'explorer':64s} {'median':>9s} {'slow 10%':>9s}   [events/s]")
    for path in notebooks.NOTEBOOKS:
        if options.labs and path.stem[:2] not in options.labs:
            continue
        slowest = None
        for explorer in declared(path):
            rates = events_per_second(explorer, options.rounds)
            median, slow = np.median(rates), np.quantile(rates, 0.1)
            print(f"{path.stem:28s} {repr(explorer)[:64]:64s} {median:9.0f} {slow:9.0f}", flush=True)
            if slowest is None or median < np.median(slowest):
                slowest = rates
        if slowest is not None:
            rows.add(f"the slowest explorer of Lab {int(path.stem[:2])} (wanted: at least 30)", "events/s", slowest)
    rows.store(options.json)


if __name__ == "__main__":
    main()
