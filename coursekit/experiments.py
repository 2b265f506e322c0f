"""Seeded Monte-Carlo runs, on one core or on any executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from functools import partial
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")


def monte_carlo(
    run: Callable[[np.random.Generator], Result], seeds: int | Iterable[int], executor: Executor | None = None
) -> list[Result]:
    """``[run(default_rng(seed)) for seed in seeds]``, in the order of the seeds wherever they were run.

    Parameters
    ----------
    run : ``run(rng) → result``; it draws all its randomness from ``rng``, so a seed names a run for ever.
    seeds : the seeds, or their number n for 0 … n-1.
    executor : any ``concurrent.futures.Executor``; a process pool needs ``run`` at the top of a module.

    Raises ValueError when there are no seeds; an error inside a run carries a note with its seed.
    """
    seeds = list(range(seeds) if isinstance(seeds, int) else seeds)
    if not seeds:
        raise ValueError("seeds: expected at least one")
    one = partial(_run_seed, run)
    results: Iterator[Result] = iter(executor.map(one, seeds) if executor else map(one, seeds))
    return list(results)


def _run_seed(run: Callable[[np.random.Generator], Result], seed: int) -> Result:
    try:
        return run(np.random.default_rng(seed))
    except Exception as error:
        error.add_note(f"in the run with seed {seed}")
        raise
