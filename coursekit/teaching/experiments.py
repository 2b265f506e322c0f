"""Seeded Monte-Carlo runs: on one core, on any executor, or on a cluster."""

from __future__ import annotations

import os
import pickle
import warnings
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import nullcontext
from importlib import import_module
from typing import Any, Protocol, TypeVar

import numpy as np

from coursekit.doors import count, several

Result = TypeVar("Result")


class Cluster(Protocol):
    """What a ``dask.distributed.Client`` offers: an executor whose workers may be anywhere."""

    def get_executor(self) -> Any: ...


def monte_carlo(
    run: Callable[[np.random.Generator], Result],
    seeds: int | Iterable[int],
    executor: Executor | Cluster | None = None,
    *,
    progress: bool = False,
    batch: int = 1,
) -> list[Result]:
    """``[run(default_rng(seed)) for seed in seeds]``, in the order of the seeds wherever they were run.

    Parameters
    ----------
    run : ``run(rng) → result``; it draws all its randomness from ``rng``, so a seed names a run for ever.
    seeds : the seeds, or their number n for 0 … n-1.
    executor : any ``concurrent.futures.Executor``, or a ``dask.distributed.Client``.  A process pool needs ``run`` at
        the top of a module; a client sends lambdas and functions from notebooks as well, and when a worker dies, its
        runs are done again by another.
    progress : show a bar with the runs that are done.
    batch : runs that are sent together; some tens, when there are many short ones.

    Raises ValueError when there are no seeds and for a batch < 1, TypeError for a run that cannot be called or that a
    process pool cannot send, and for an executor that is none.  An error inside a run carries a note with its seed;
    runs that have not begun are then cancelled.

    >>> steps = monte_carlo(lambda rng: rng.normal(scale=2.0, size=100).sum(), 400)     # m; a random walk of 100 steps
    >>> bool(abs(np.std(steps) - 2.0 * np.sqrt(100)) < 3)
    True
    """
    if not callable(run):
        raise TypeError(f"run: expected a function run(rng), got {run!r}")
    seeds = _seeds(seeds)
    if isinstance(batch, bool):
        raise ValueError(f"batch: expected at least 1, got {batch!r}")
    batch = count(batch, "batch")
    with _bar(len(seeds)) if progress else nullcontext() as bar:
        done = bar.update if bar is not None else _nothing
        if executor is None:
            results = []
            for seed in seeds:
                results.append(_run_seed(run, seed))
                done(1)
            return results
        pool = executor.get_executor() if hasattr(executor, "get_executor") else executor
        _check_pool(run, pool)
        batches = [seeds[i : i + batch] for i in range(0, len(seeds), batch)]
        return [result for part in _gather(run, batches, pool, done) for result in part]


def lab_seed(lab: int, made_by: str | None = None) -> int:
    """The one seed that a lab's randomness hangs on: its number, shifted by the environment's COURSEKIT_SEED_OFFSET.

    ``make fresh OFFSET=1000`` runs every lab with other seeds: what a lab claims has to hold for those as well.

    Parameters
    ----------
    lab : the number of the lab.
    made_by : the version of the course that made this copy of the lab, as the editions for learners have it; where
        another version runs it, a warning says so.

    Raises ValueError when the offset is no whole number ≥ 0.

    >>> lab_seed(4) == 4 + int(os.environ.get("COURSEKIT_SEED_OFFSET", 0))
    True
    """
    here = import_module("coursekit").__version__
    if made_by not in (None, here):
        warnings.warn(
            f"This copy of Lab {lab} was made by version {made_by} of the course, and coursekit {here} runs it: "
            f"a figure or a check may differ.  Take a copy of today's lab, or install coursekit {made_by}.",
            stacklevel=2,
        )
    offset = os.environ.get("COURSEKIT_SEED_OFFSET", "0")
    if not offset.isdigit():
        raise ValueError(f"COURSEKIT_SEED_OFFSET: expected a whole number ≥ 0, got {offset!r}")
    return lab + int(offset)


def _bar(runs: int) -> Any:
    from tqdm.auto import tqdm  # here, so that who asks for no bar needs none

    return tqdm(total=runs, unit="run")


def _nothing(runs: int) -> None:
    """What is done about finished runs where no bar shows them."""


def _seeds(seeds: int | Iterable[int]) -> list[int]:
    listed = (
        several(seeds, "seeds") if isinstance(seeds, Iterable) else list(range(count(seeds, "seeds", least=-(2**31))))
    )
    listed = [count(seed, "seeds", least=0) if not isinstance(seed, int) or seed < 0 else seed for seed in listed]
    if not listed:
        raise ValueError("seeds: expected at least one")
    return listed


def _check_pool(run: Callable, pool: Any) -> None:
    if not hasattr(pool, "submit"):
        raise TypeError(f"executor: expected a concurrent.futures.Executor or a dask Client, got {pool!r}")
    if isinstance(pool, ProcessPoolExecutor):
        try:
            pickle.dumps(run)
        except Exception as error:  # PicklingError, AttributeError or TypeError, by Python's version
            name = getattr(run, "__qualname__", repr(run))
            raise TypeError(
                f"run: {name} cannot be sent to a process pool, which finds a function by its name in a module "
                f"({error}). Write it with def at the top of a .py file and import it; or use a ThreadPoolExecutor, "
                "or a dask Client, which sends lambdas and functions from notebooks too"
            ) from None


def _gather(
    run: Callable[[np.random.Generator], Result],
    batches: Sequence[list[int]],
    pool: Executor,
    done: Callable[[int], object],
) -> list[list[Result]]:
    """The results of each batch; an error cancels what has not begun."""
    futures: dict[Future[list[Result]], int] = {}
    try:
        for i, batch in enumerate(batches):
            futures[pool.submit(_run_batch, run, batch)] = i
        for future in as_completed(futures):
            batch = batches[futures[future]]
            try:
                future.result()
            except Exception as error:
                _explain(error, batch)
                raise
            done(len(batch))
    finally:
        for future in futures:
            future.cancel()
    return [future.result() for future in futures]


def _explain(error: Exception, batch: list[int]) -> None:
    """Say which seeds, where the run itself could not."""
    if not any(note.startswith("in the run with seed") for note in getattr(error, "__notes__", [])):
        which = f"the run with seed {batch[0]}" if len(batch) == 1 else f"a run with one of the seeds {batch}"
        error.add_note(f"in {which}")
    if isinstance(error, BrokenExecutor):
        error.add_note(
            "A worker process ended before its run did. Was it out of memory, did compiled code crash? Is run written "
            "in a notebook, where a worker cannot find it? A broken pool loses all that it had not done, this seed "
            "among them; a dask Client would start the lost runs again."
        )


def _run_seed(run: Callable[[np.random.Generator], Result], seed: int) -> Result:
    try:
        return run(np.random.default_rng(seed))
    except Exception as error:
        error.add_note(f"in the run with seed {seed}")
        raise


def _run_batch(run: Callable[[np.random.Generator], Result], seeds: list[int]) -> list[Result]:
    """What a worker does.  Its errors have to survive the way back."""
    results = []
    for seed in seeds:
        told = None
        try:
            results.append(_run_seed(run, seed))
        except (Exception, SystemExit) as error:
            if isinstance(error, Exception) and _survives(error):
                raise
            told = RuntimeError(f"{type(error).__name__}: {error}")
            told.add_note(f"in the run with seed {seed}")
        if told:  # raised out here, so that it does not drag the error along as its context
            raise told
    return results


def _survives(error: Exception) -> bool:
    try:
        return type(pickle.loads(pickle.dumps(error))) is type(error)
    except Exception:  # an exception class may do anything in its __init__
        return False
