from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from coursekit.experiments import monte_carlo


def draw(rng):
    return float(rng.normal())


def fail_late(rng):
    if rng.integers(10) == np.random.default_rng(2).integers(10):
        raise ValueError("this run went wrong")
    return 0


def test_a_seed_names_a_run_for_ever():
    assert monte_carlo(draw, [7, 3, 7]) == [float(np.random.default_rng(s).normal()) for s in (7, 3, 7)]


def test_a_number_of_seeds_counts_from_zero():
    assert monte_carlo(draw, 3) == monte_carlo(draw, [0, 1, 2])


@pytest.mark.parametrize("pool", [ThreadPoolExecutor, ProcessPoolExecutor])
def test_an_executor_changes_where_runs_happen_and_nothing_else(pool):
    with pool(2) as executor:
        assert monte_carlo(draw, 5, executor) == monte_carlo(draw, 5)


def test_an_error_carries_the_seed_of_its_run():
    with pytest.raises(ValueError, match="went wrong") as caught:
        monte_carlo(fail_late, [2])
    assert "seed 2" in caught.value.__notes__[0]


def test_no_seeds_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        monte_carlo(draw, [])
