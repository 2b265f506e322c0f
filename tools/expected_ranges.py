"""What a lab prints, and between which values it lies over several seeds: what an instructor should expect to see.

    python tools/expected_ranges.py                          show what is stored
    python tools/expected_ranges.py --write                  run the labs with the offsets below, and store it
    python tools/expected_ranges.py --write --offsets 0 7    with these offsets of the labs' seeds

Each lab is run up to its exercises, in a kernel of its own, once for each offset.  A printed line that is the same text
in each run, with other numbers in it, is stored with the lowest and the highest value of each number.  A lab takes from
three seconds to a minute; two run at a time.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
from lab_text import ROOT, Part, labs, parts, tags

STORE = ROOT / "book" / "teaching" / "expected_ranges.json"
OFFSETS = [0, 1000, 2000]
NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")


@dataclass
class Printed:
    """One printed line: the part of the lab, the cell's id, and the text with {} for each number; the numbers."""

    part: str
    cell: str
    text: str
    numbers: list[str]


def taught(path: Path) -> list[Part]:
    """A lab's parts up to its exercises: what is shown in class."""
    found: list[Part] = []
    for part in parts(path):
        if part.heading.lower().startswith("exercises"):
            break
        found.append(part)
    return found


def split(line: str) -> tuple[str, list[str]]:
    """A line with {} for each of its numbers, blanks drawn together, and the numbers as they were printed."""
    plain = " ".join(line.replace("{", "(").replace("}", ")").split())
    return NUMBER.sub("{}", plain), NUMBER.findall(plain)


def run(path: Path, offset: int) -> list[Printed]:
    """What a lab prints with its seed shifted.

    A check that fails is reported on standard error.  Raises nbclient's CellExecutionError for any other error.
    """
    from nbclient import NotebookClient
    from traitlets.config import Config

    chosen = [(part.heading, cell) for part in taught(path) for cell in part.cells if cell.cell_type == "code"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.from_dict(cell) for _, cell in chosen])
    for cell in notebook.cells:
        if "check" in tags(cell):  # a claim about chance fails now and then: that is said, and the run goes on
            cell.metadata.tags = [*cell.metadata.tags, "raises-exception"]
    client = NotebookClient(
        notebook,
        timeout=600,
        kernel_name="python3",
        config=Config(KernelManager={"transport_encryption": "auto"}),
        resources={"metadata": {"path": str(path.parent)}},
    )
    client.execute(env=os.environ | {"COURSEKIT_SEED_OFFSET": str(offset), "OPENBLAS_NUM_THREADS": "1"})
    found = []
    for (heading, _), cell in zip(chosen, notebook.cells, strict=True):
        if "check" in tags(cell):
            for output in cell.outputs:
                if output.output_type == "error":
                    said = f"{path.stem}, offset {offset}: a check of “{heading}” failed"
                    print(f"{said}\n{cell.source}", file=sys.stderr)
            continue
        said = "".join(output.get("text", "") for output in cell.outputs if output.output_type == "stream")
        said += "".join(map(_guess, cell.outputs))
        found += [Printed(heading, cell.id, *split(line)) for line in said.splitlines() if line.strip()]
    return found


def _guess(output: nbformat.NotebookNode) -> str:
    """The question of a guess and its answer; nothing for another output."""
    data = output.get("data", {})
    found = re.search(r'"truth": ([^,]+), "unit": "([^"]*)"', data.get("text/html", ""))
    return f"\n{data['text/plain']} {float(found[1]):.3g} {found[2]}" if found else ""


def number(printed: str) -> float:
    """The value of a printed number."""
    return float(printed.replace("−", "-").replace(",", ""))


def ranges(runs: list[list[Printed]]) -> list[dict[str, object]]:
    """The lines that all runs share and whose numbers differ, with the lowest and highest of each number."""
    found: list[dict[str, object]] = []
    others: list[dict[tuple[str, str, int], list[str]]] = [_by_place(lines) for lines in runs[1:]]
    for place, printed in _by_place(runs[0]).items():
        each = [printed, *(lines[place] for lines in others if place in lines)]
        if len(each) < len(runs) or all(values == printed for values in each) or "e-" in " ".join(printed):
            continue  # the same whatever the seed, or as small as rounding
        columns = list(zip(*each, strict=True))
        part = next(line.part for line in runs[0] if line.cell == place[0])
        low, high = ([choose(column, key=number) for column in columns] for choose in (min, max))
        found.append({"part": part, "text": place[1], "low": low, "high": high})
    return found


def _by_place(lines: list[Printed]) -> dict[tuple[str, str, int], list[str]]:
    """(cell, text, which of the lines with this text) → numbers."""
    found: dict[tuple[str, str, int], list[str]] = {}
    for line in lines:
        again = sum(cell == line.cell and text == line.text for cell, text, _ in found)
        found[line.cell, line.text, again] = line.numbers
    return found


def shown(entry: dict[str, object]) -> str:
    """A stored line with its ranges in it: NEES 2.9 … 3.1."""
    low, high = entry["low"], entry["high"]
    assert isinstance(low, list) and isinstance(high, list)
    both = [a if a == b else f"{a} … {b}" for a, b in zip(low, high, strict=True)]
    return str(entry["text"]).format(*both)


def stored() -> dict[str, object]:
    """{"offsets": […], "labs": {stem of the notebook: lines}}; empty where nothing was measured yet."""
    return json.loads(STORE.read_text("utf-8")) if STORE.exists() else {"offsets": [], "labs": {}}


def keep(path: Path, offsets: list[int], printed: list[list[Printed]]) -> None:
    """Store what one lab printed; what was measured with other offsets is dropped."""
    known = stored()
    old = known["labs"] if known["offsets"] == offsets else {}
    assert isinstance(old, dict)
    fresh = {"offsets": offsets, "labs": dict(sorted((old | {path.stem: ranges(printed)}).items()))}
    STORE.write_text(json.dumps(fresh, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("notebooks", nargs="*", type=Path, help="all labs by default")
    parser.add_argument("--write", action="store_true", help="run the labs and store what they print")
    parser.add_argument("--offsets", nargs="+", type=int, default=OFFSETS, help="two or more")
    parser.add_argument("--jobs", type=int, default=2, help="labs to run at a time")
    options = parser.parse_args(arguments)
    if options.write:
        for path in options.notebooks or labs():
            with ThreadPoolExecutor(options.jobs) as pool:
                keep(path, options.offsets, [*pool.map(partial(run, path), options.offsets)])
            print(f"{path.stem}: run {len(options.offsets)} times", file=sys.stderr, flush=True)
    known = stored()
    kept = known["labs"]
    assert isinstance(kept, dict)
    for name, entries in kept.items():
        print(f"{name}, seeds shifted by {', '.join(map(str, known['offsets']))}")  # type: ignore[call-overload]
        for entry in entries:
            print("   ", shown(entry))
    return 0


if __name__ == "__main__":
    sys.exit(main())
