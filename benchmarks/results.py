"""Rows for the book's page "How fast, against whom": jobs done in turns, stored as JSON (``--json FILE``).

A row is one job, ours beside one peer's, or ours alone where a target is absolute.  Its ratio is the median over the
rounds of peer / ours, its spread the tenth and the ninetieth percentile of these ratios (of ours, where there is no
peer); ``book/reference/speed.py`` reads it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import time
from collections.abc import Callable, Mapping
from datetime import date
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]


def parser(about: str | None, rounds: int) -> argparse.ArgumentParser:
    """With what all scripts have: how many rounds, and where the rows go."""
    options = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=rounds)
    options.add_argument("--json", type=Path, metavar="FILE", help="where to store the rows for the book")
    return options


def in_turns(jobs: Mapping[Any, Callable[[], object]], rounds: int, calls: int = 1) -> dict[Any, np.ndarray]:
    """Seconds a call of each job in each round, (rounds,); a round has ``calls`` of each job, one job after the other.

    One round before the first is not counted.
    """
    taken: dict[Any, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds + 1):
        for name, job in jobs.items():
            start = time.perf_counter()
            for _ in range(calls):
                job()
            taken[name].append((time.perf_counter() - start) / calls)
    return {name: np.array(seconds[1:]) for name, seconds in taken.items()}


def version(distribution: str) -> str:
    """Of a peer; "" where it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


class Rows:
    """The rows of one benchmark.  threads : that ours and the peers may use."""

    def __init__(self, benchmark: str, threads: int) -> None:
        self.benchmark, self.threads, self.rows = benchmark, threads, list[dict[str, Any]]()

    def add(self, row: str, unit: str, ours: Any, peer: Any = None, by: tuple[str, str] | None = None) -> None:
        """One job.  ours, peer : of each round, in ``unit``, taken in turns.  by : the peer's name and version."""
        mine = np.atleast_1d(ours).astype(float)
        theirs = None if peer is None else np.atleast_1d(peer).astype(float)
        ratios = None if theirs is None else theirs / mine
        spread = np.quantile(mine if ratios is None else ratios, [0.1, 0.9]).tolist()
        self.rows.append({
            "benchmark": self.benchmark, "row": row, "unit": unit, "ours": float(np.median(mine)),
            "peer": None if theirs is None else float(np.median(theirs)),
            "peer_name": by[0] if by else None, "peer_version": by[1] if by else None,
            "ratio": None if ratios is None else float(np.median(ratios)),
            "spread": spread if len(mine) > 1 else None, "rounds": len(mine), "threads": self.threads,
            "date": date.today().isoformat(), "commit": commit(), "machine": machine(),
        })  # fmt: skip

    def store(self, path: Path | None) -> None:
        """As JSON; nothing where no path is given."""
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(self.rows, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def commit() -> str:
    """Of the checkout; "unknown" without git."""
    try:
        asked = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return asked.stdout.strip()


def machine() -> str:
    """The processor's model and its cores; never the machine's name."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text(encoding="utf-8").splitlines() if about.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{models[0] if models else platform.machine()}, {os.cpu_count()} cores"
