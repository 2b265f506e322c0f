"""What every door of the package asks of numbers, counts, sequences and generators."""

import numpy as np
import pytest

from coursekit.doors import LARGEST, as_numbers, count, generator, number, several


@pytest.mark.parametrize("value", [3, 3.0, np.float32(3), np.int8(3), np.array(3.0), True + 2])
def test_one_number_comes_in_many_types_and_out_as_a_float(value):
    assert type(number(value, "x")) is float and number(value, "x") == 3.0


@pytest.mark.parametrize("value", [None, "3", [3.0], (3.0,), np.array([3.0]), 3j, object(), 10**400])
def test_anything_but_one_real_number_is_a_type_error(value):
    with pytest.raises(TypeError, match="x: expected one real number"):
        number(value, "x")


def test_a_count_is_whole_and_neither_too_small_nor_longer_than_any_array():
    assert count(np.int64(1), "n") == 1 and count(0, "n", least=0) == 0 and type(count(np.int8(2), "n")) is int
    assert count(2**31 - 1, "n") == 2**31 - 1
    for wrong in (0, -1, 2**31):
        with pytest.raises(ValueError, match=r"n: expected a whole number (≥ 1|below 2³¹)"):
            count(wrong, "n")
    for wrong in (1.0, "1", None):
        with pytest.raises(TypeError, match="n: expected a whole number"):
            count(wrong, "n")


def test_several_takes_what_can_be_counted_out_and_no_text_and_no_map():
    assert several((1, 2), "s") == several(iter([1, 2]), "s") == several(np.array([1, 2]), "s") == [1, 2]
    for wrong in ("ab", b"ab", {1: 2}, 3, None, np.array(1.0)):
        with pytest.raises(TypeError, match="s: expected several"):
            several(wrong, "s")


def test_a_generator_is_one_and_no_seed():
    rng = np.random.default_rng(0)
    assert generator(rng) is rng
    for wrong in (0, None, np.random.RandomState(0)):
        with pytest.raises(TypeError, match=r"rng: expected a numpy\.random\.Generator"):
            generator(wrong)


def test_numbers_are_real_and_of_one_length_and_those_that_are_right_are_not_copied():
    right = np.array([1.0, 2.0])
    assert as_numbers(right, "a") is right
    assert as_numbers([1, True], "a").dtype == float
    with pytest.raises(ValueError, match="a: expected an array, got rows of different lengths"):
        as_numbers([[1], [2, 3]], "a")
    for wrong in (["1"], [1j], [None], [np.datetime64("2026-01-01")]):
        with pytest.raises(TypeError, match="a: expected real numbers"):
            as_numbers(wrong, "a")


def test_the_largest_number_has_a_finite_fourth_power():
    assert np.isfinite(LARGEST**4)
