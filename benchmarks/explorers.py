"""How many slider events a second each lab's explorers answer, from event to encoded picture, in the kernel.

    python benchmarks/explorers.py [01 02 …]      # the labs to measure; all of them by default

Each explorer's live widget is built and its controls are moved through the grid in a fixed random order; the
figure is the median over the events.  Encoding is included, the journey to the browser is not.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests import notebooks

EVENTS = 60


def events_per_second(explorer):
    """Median and slowest-tenth rate over a fixed random walk on the grid."""
    widget, rng, times = explorer.widget(), np.random.default_rng(0), []
    controls = list(widget.controls.values())
    while len(times) < EVENTS:
        control = controls[rng.integers(len(controls))]
        index = int(rng.integers(len(control.options)))
        if index == control.index:
            continue
        start = time.perf_counter()
        control.index = index
        times.append(time.perf_counter() - start)
    return 1 / np.median(times), 1 / np.quantile(times, 0.9)


def main(numbers):
    print(f"{'lab':28s} {'explorer':64s} {'median':>9s} {'slow 10%':>9s}   [events/s]")
    for path in notebooks.NOTEBOOKS:
        if numbers and path.stem[:2] not in numbers:
            continue
        for explorer in notebooks.run(path).explorers:
            median, slow = events_per_second(explorer)
            print(f"{path.stem:28s} {repr(explorer)[:64]:64s} {median:9.0f} {slow:9.0f}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
