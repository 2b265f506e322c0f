"""How fast, against whom: a page of what ``make bench`` stored in ``benchmarks/results``."""

from __future__ import annotations

import json
from itertools import takewhile
from pathlib import Path
from typing import Any

from reference.limits import limit

RESULTS = Path(__file__).resolve().parents[2] / "benchmarks" / "results"
# One row of a result: a job that ours and a peer did in turns.  ``peer`` may be null: then only ours was measured, and
# ``spread`` is that of ours, not of the ratio.
FIELDS = {
    "benchmark": str, "row": str, "unit": str, "ours": (int, float), "peer": (int, float, type(None)),
    "peer_name": (str, type(None)), "peer_version": (str, type(None)), "ratio": (int, float, type(None)),
    "spread": (list, type(None)), "rounds": int, "threads": int, "date": str, "commit": str, "machine": str,
}  # fmt: skip


def read(folder: Path = RESULTS) -> list[dict[str, Any]]:
    """Every row of every file.  Raises ValueError for a row that lacks a field or has one of another kind."""
    found = []
    for path in sorted(folder.glob("*.json")):
        for row in json.loads(path.read_text(encoding="utf-8")):
            for name, kind in FIELDS.items():
                if name not in row or not isinstance(row[name], kind):
                    raise ValueError(f"{path.name}: {name}: expected {kind}, got {row.get(name, 'nothing')!r}")
            found.append(row)
    return found


def _number(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _figure(value: float | None, unit: str) -> str:
    return "" if value is None else f"{_number(value)} {unit}"


def _together(jobs: list[str]) -> str:
    """One name for some jobs: the words that they begin with."""
    if len(jobs) == 1:
        return jobs[0]
    alike = takewhile(lambda words: len(set(words)) == 1, zip(*(job.split() for job in jobs)))
    return " ".join([*(words[0] for words in alike), "…"]).replace("`", "")


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as Markdown tables, one for each benchmark."""
    blocks = []
    for name in dict.fromkeys(row["benchmark"] for row in rows):
        mine = [row for row in rows if row["benchmark"] == name]
        about = mine[0]
        lines = ["| job | ours | peer | the peer takes, times ours | rounds |", "| --- | --- | --- | --- | --- |"]
        for row in mine:
            peer = f"{_figure(row['peer'], row['unit'])} ({row['peer_name']} {row['peer_version'] or ''})".replace(
                " )", ")"
            )
            ratio = "" if row["ratio"] is None else f"{row['ratio']:.2f}"
            ours = _figure(row["ours"], row["unit"])
            if row["spread"] and ratio:
                ratio += f" ({row['spread'][0]:.2f} to {row['spread'][1]:.2f})"
            elif row["spread"]:
                ours += f" ({_number(row['spread'][0])} to {_number(row['spread'][1])})"
            lines.append(f"| {row['row']} | {ours} | {peer if row['peer_name'] else ''} | {ratio} | {row['rounds']} |")
        when = (
            f"Measured on {about['date']} at commit `{about['commit'][:10]}`, threads: {about['threads']}, on "
            f"{about['machine']}."
        )
        said: dict[str, list[str]] = {}  # jobs by the sentence that they share
        for job in dict.fromkeys(row["row"] for row in mine):
            said.setdefault(limit(name, job), []).append(job.partition(" (wanted")[0])
        behind = [f"- *{_together(jobs)}*: {sentence}" for sentence, jobs in said.items() if sentence]
        blocks.append("\n".join([f"## {name}", "", *lines, "", "What limits ours:", "", *behind, "", when]))
    return "\n\n".join(blocks)


def pages() -> dict[str, str]:
    """The page ``how_fast.md``."""
    return {"how_fast.md": f"# How fast, against whom\n\n{ABOUT}\n\n{table(read()) or NOTHING}\n"}


ABOUT = """`make bench` measures the package beside other people's programs. Both do the same job on the same numbers,
in one process and in turns, so that whatever else the machine does slows both alike.

The figure to look at is the ratio: 2 means that the peer takes twice as long, 0.5 that it takes half as long. It is the
median over the rounds. In brackets stands how far the rounds' ratios spread, from the tenth to the ninetieth
percentile; where there is no peer, how far our own figures spread. Times depend on the machine, ratios much less. A
benchmark of speed says nothing about what else the peers can do."""
NOTHING = """No result is stored in this copy of the book: the folder `benchmarks/results` is empty. Run `make bench` to
measure on your own machine."""
