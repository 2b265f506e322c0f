"""Seeded Monte-Carlo runs, on one core or on any executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")


class _Seeded:
    """``run`` with its generator made from a seed; a class because a process pool has to pickle it."""

    def __init__(self, run: Callable[[np.random.Generator], Result]) -> None:
        self.run = run

    def __call__(self, seed: int) -> Result:
        return self.run(np.random.default_rng(seed))


def monte_carlo(
    run: Callable[[np.random.Generator], Result], seeds: int | Iterable[int], executor: Executor | None = None
) -> list[Result]:
    """``[run(default_rng(seed)) for seed in seeds]``, in the order of the seeds wherever they were run.

    Parameters
    ----------
    run : ``run(rng) → result``; it draws all its randomness from ``rng``, so a seed names a run for ever.
    seeds : the seeds, or their number n for 0 … n-1.
    executor : any ``concurrent.futures.Executor``; a process pool needs ``run`` at the top of a module.

    Raises ValueError when there are no seeds; an error inside a run names its seed.
    """
    seeds = list(range(seeds) if isinstance(seeds, int) else seeds)
    if not seeds:
        raise ValueError("seeds: expected at least one")
    seeded = _Seeded(run)
    results = iter((executor.map if executor else map)(seeded, seeds))
    out: list[Result] = []
    for seed in seeds:
        try:
            out.append(next(results))
        except Exception as error:
            error.add_note(f"in the run with seed {seed}")
            raise
    return out
