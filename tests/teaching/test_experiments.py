import os
import re
import signal
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from coursekit.teaching.experiments import monte_carlo
from coursekit.world.arena import Arena
from coursekit.world.robot import World


def draw(rng):
    return float(rng.normal())


def fail_late(rng):
    if rng.normal() == np.random.default_rng(2).normal():
        raise ValueError("this run went wrong")
    return 0


class Fussy(Exception):
    """Cannot be pickled: it holds on to something that belongs to its process."""

    def __init__(self, what, why):
        super().__init__(f"{what}: {why}")
        self.lock = threading.Lock()


def fail_fussily(rng):
    raise Fussy("wheel", "lost")


def leave(rng):
    raise SystemExit(3)


def die(rng):
    os.kill(os.getpid(), signal.SIGKILL)


def hand_out_a_lock(rng):
    return threading.Lock()


def wander(rng):
    """Half a second in the physics world: a drive whose every bit hangs on its seed."""
    world = World(Arena.load("lab"), rng)
    for _ in range(10):
        world.step(0.5, 0.4)
    return world.pose.tobytes()


def die_once(folder, rng):
    """The first worker that is given the run which draws this number dies in the middle of it."""
    number = float(rng.normal())
    mark = folder / "died"
    if number == np.random.default_rng(3).normal() and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.fixture(scope="module")
def cluster():
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as local,
        Client(local) as client,
    ):
        yield client


def notes(caught):
    return " ".join(caught.value.__notes__)


def test_a_seed_names_a_run_for_ever():
    assert monte_carlo(draw, [7, 3, 7]) == [float(np.random.default_rng(s).normal()) for s in (7, 3, 7)]


def test_a_number_of_seeds_counts_from_zero():
    assert monte_carlo(draw, 3) == monte_carlo(draw, [0, 1, 2]) == monte_carlo(draw, np.int64(3))


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
@pytest.mark.parametrize("batch", [1, 2, 9])
def test_an_executor_changes_where_runs_happen_and_nothing_else(pool, batch):
    with pool(2) as executor:
        assert monte_carlo(draw, 5, executor, batch=batch) == monte_carlo(draw, 5)


def test_the_same_seeds_give_the_same_bytes_on_a_cluster_in_a_pool_and_here(cluster):
    here = monte_carlo(wander, 4)
    assert len(set(here)) == 4
    assert monte_carlo(wander, 4, cluster) == here
    assert monte_carlo(wander, 4, cluster, batch=3) == here
    with ProcessPoolExecutor(2) as pool:
        assert monte_carlo(wander, 4, pool) == here


def test_a_cluster_runs_lambdas_too(cluster):
    assert monte_carlo(lambda rng: float(rng.normal()), 3, cluster) == monte_carlo(draw, 3)


def test_a_worker_of_a_cluster_that_dies_loses_no_run(cluster, tmp_path):
    assert monte_carlo(partial(die_once, tmp_path), 8, cluster) == monte_carlo(draw, 8)
    assert (tmp_path / "died").exists()


def test_the_page_on_many_runs_runs_as_it_is_written(cluster, tmp_path, monkeypatch, capsys):
    """Only the address is another, and the hundred thousand are fewer."""
    page = (Path(__file__).parents[2] / "book" / "many_runs.md").read_text(encoding="utf-8")
    module, *cells = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    Path("drives.py").write_text(module, encoding="utf-8")
    names = {"__name__": "__main__"}
    for cell in cells:
        for of_the_page, here in {
            "tcp://head:8786": cluster.scheduler.address,
            "100_000, 1000": "6, 3",
            "first + 1000": "first + 3",
            "drive, 40": "drive, 3",
        }.items():
            cell = cell.replace(of_the_page, here)
        exec(cell, names)
    names["client"].close()
    assert names["errors"].tolist() == monte_carlo(names["drive"], 6)
    assert "6 drives, median error 0." in capsys.readouterr().out


def test_an_error_carries_the_seed_of_its_run_from_wherever_it_was(cluster):
    with ThreadPoolExecutor(2) as threads, ProcessPoolExecutor(2) as processes:
        for executor in (None, threads, processes, cluster):
            with pytest.raises(ValueError, match="went wrong") as caught:
                monte_carlo(fail_late, [2], executor)
            assert "in the run with seed 2" in notes(caught)
        with pytest.raises(ValueError, match="went wrong") as caught:
            monte_carlo(fail_late, [0, 1, 2], processes, batch=3)
        assert "in the run with seed 2" in notes(caught)


@pytest.mark.parametrize(("run", "message"), [(fail_fussily, "Fussy: wheel: lost"), (leave, "SystemExit: 3")])
def test_an_error_that_cannot_travel_is_told_in_words(run, message):
    with ProcessPoolExecutor(1) as pool, pytest.raises(RuntimeError, match=message) as caught:
        monte_carlo(run, [5], pool)
    assert "in the run with seed 5" in notes(caught)


def test_a_result_that_cannot_travel_is_told_with_its_seed():
    with ProcessPoolExecutor(1) as pool, pytest.raises(TypeError, match="pickle") as caught:
        monte_carlo(hand_out_a_lock, [6], pool)
    assert "in the run with seed 6" in notes(caught)


def test_a_pool_whose_worker_died_is_explained():
    with ProcessPoolExecutor(1) as pool, pytest.raises(BrokenProcessPool) as caught:
        monte_carlo(die, [4, 5], pool)
    assert "seed 4" in notes(caught) and "a dask Client would start the lost runs again" in notes(caught)


def test_a_lambda_or_an_inner_function_in_a_process_pool_is_explained():
    def inner(rng):
        return 0

    with ProcessPoolExecutor(1) as pool:
        for run in (lambda rng: 0, inner):
            with pytest.raises(TypeError, match=r"run: .*cannot be sent to a process pool.*top of a \.py file"):
                monte_carlo(run, 2, pool)


def test_an_error_cancels_the_runs_that_have_not_begun():
    begun = []

    def run(rng):
        begun.append(1)
        raise ValueError("at once")

    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="at once"):
        monte_carlo(run, 2000, pool)
    assert len(begun) < 2000


@pytest.mark.parametrize("batch", [1, 4])
def test_progress_counts_runs_on_a_bar_and_is_silent_when_not_asked_for(batch, capsys):
    with ThreadPoolExecutor(1) as pool:
        assert monte_carlo(draw, 6, pool, progress=True, batch=batch) == monte_carlo(draw, 6, progress=True)
    assert capsys.readouterr().err.count("6/6") >= 2
    monte_carlo(draw, 6)
    assert capsys.readouterr().err == ""


def test_no_seeds_no_function_no_executor_and_no_batch_are_refused():
    for seeds in ([], 0, -1):
        with pytest.raises(ValueError, match="at least one"):
            monte_carlo(draw, seeds)
    with pytest.raises(TypeError, match=r"run: expected a function run\(rng\)"):
        monte_carlo(0.5, 3)
    with pytest.raises(TypeError, match="executor: expected a concurrent"):
        monte_carlo(draw, 3, 4)
    with pytest.raises(ValueError, match="batch: expected"):
        monte_carlo(draw, 3, batch=0)
