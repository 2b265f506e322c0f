"""Runs a lab's code cells in this process, and catches every explorer and every verdict on the way."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import nbformat

from coursekit import exercises, explore

NOTEBOOKS = sorted((Path(__file__).parent.parent / "notebooks").glob("[0-9][0-9]_*.ipynb"))


@dataclass(frozen=True)
class Lab:
    explorers: list[explore.Explorer]
    verdicts: list[exercises.Verdict]
    checked: list[str]


@cache
def run(path: Path) -> Lab:
    """Execute the lab from top to bottom, once a session."""
    cells = [c.source for c in nbformat.read(path, as_version=4).cells if c.cell_type == "code"]
    namespace = {"__name__": "__main__", "display": lambda *shown, **options: None}
    with explore.collecting() as explorers, exercises.collecting() as verdicts:
        for i, source in enumerate(cells):
            exec(compile(source, f"{path.name}, code cell {i}", "exec"), namespace)
    return Lab(list(explorers), list(verdicts), [v.name for v in verdicts])
