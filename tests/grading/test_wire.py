"""What a student's process sends is numbers and texts, whatever it tries; and numbers arrive as they were."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent.parent.parent / "tools"))
from grading import wire

KEPT = []


def keep(value):
    KEPT.append(value)
    return len(KEPT) - 1


def over(value):
    return wire.unpack(wire.from_json(wire.as_json(wire.pack(value, keep))))


@pytest.mark.parametrize(
    "value",
    [None, True, 3, -0.5, "text", 1 + 2j, [1, (2.0, "b")], {"left", "top"}, frozenset({1}), {"a": [1], 2: None}, ()],
    ids=lambda value: type(value).__name__,
)
def test_a_plain_value_arrives_as_it_was(value):
    got = over(value)
    assert got == value and type(got) is type(value)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int64, np.float32, float, complex])
def test_an_array_arrives_with_its_type_and_shape(dtype):
    array = np.arange(6).reshape(2, 3).astype(dtype)
    for sent in (array, array.T, array[:0], array[0, 0]):
        got = over(sent)
        assert type(got) is type(sent) and got.dtype == sent.dtype and np.array_equal(got, sent)


def test_nan_and_infinity_arrive():
    assert np.array_equal(over(np.array([np.nan, np.inf])), [np.nan, np.inf], equal_nan=True)
    assert over(float("inf")) == np.inf


def test_an_object_stays_where_it_is_and_its_stand_in_has_the_name_of_its_type():
    class Belief:
        pass

    got = over([Belief()])[0]
    assert type(got).__name__ == "Belief" and isinstance(got, wire.Thing) and isinstance(KEPT[got.number], Belief)
    with pytest.raises(TypeError):
        np.asarray(got, dtype=float)


def test_arrays_of_objects_do_not_travel():
    assert isinstance(over(np.array([object()])), wire.Thing)


@pytest.mark.parametrize(
    "forged",
    [
        {"array": "|O", "shape": [1], "bytes": "AAAAAAAAAAA="},
        {"array": "<U1", "shape": [1], "bytes": "QQAAAA=="},
        {"array": "<f8", "shape": [10**12], "bytes": ""},
        {"array": "<f8", "shape": ["x"], "bytes": ""},
        {"array": "nonsense(", "shape": [], "bytes": ""},
        {"list": 3},
        {"unknown": 1},
        [1, 2],
        {"dict": [[1]]},
        {"set": [{"list": []}]},
    ],
    ids=str,
)
def test_what_no_answer_looks_like_is_refused(forged):
    with pytest.raises(ValueError):
        wire.unpack(forged)


def test_lists_in_lists_end_somewhere():
    deep = []
    for _ in range(100):
        deep = [deep]
    got = over(deep)
    for _ in range(wire.DEEPEST):
        got = got[0]
    assert isinstance(got, wire.Thing)
    with pytest.raises(ValueError):
        wire.from_json(b"[" * 10**6)
    forged = json.loads('{"list": [' * 50 + "1" + "]}" * 50)
    with pytest.raises(ValueError):
        wire.unpack(forged)
