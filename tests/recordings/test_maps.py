"""Maps of landmarks go to CSV and back."""

import numpy as np
import pytest

from coursekit.recordings import read_map, write_map


def test_a_map_comes_back_to_the_bit_whether_named_or_numbered(tmp_path):
    places = np.random.default_rng(0).normal(size=(5, 2))
    for landmarks in (places, dict(zip([9, 6, 7, 20, 8], places, strict=True))):
        write_map(landmarks, tmp_path / "map.csv")
        back = read_map(tmp_path / "map.csv")
        named = landmarks if isinstance(landmarks, dict) else dict(enumerate(landmarks))
        assert [*back] == [*named]
        for key, place in named.items():
            np.testing.assert_array_equal(back[key], place)


def test_covariances_are_written_beside_the_places(tmp_path):
    cov = np.array([[[0.04, 0.01], [0.01, 0.09]]])
    write_map({3: [1.0, 2.0]}, tmp_path / "map.csv", cov)
    assert (tmp_path / "map.csv").read_text() == "id,x,y,var_x,cov_xy,var_y\n3,1.0,2.0,0.04,0.01,0.09\n"
    assert [*read_map(tmp_path / "map.csv")] == [3]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("id,x\n1,2\n", "lacks y"),
        ("id,x,y\n1,2,3\n1,4,5\n", "each landmark once, 1 comes twice"),
        ("id,x,y\n1.5,2,3\n", "whole numbers"),
        ("id,x,y\na,2,3\n", "whole numbers"),
        ("id,x,y\n1,nan,3\n", "finite metres"),
        ("id,x,y\n1,b,3\n", "finite metres"),
    ],
)
def test_a_file_that_is_no_map_says_why(text, message, tmp_path):
    (tmp_path / "map.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_map(tmp_path / "map.csv")


def test_places_that_cannot_be_are_refused(tmp_path):
    for landmarks in ({1: [1.0]}, np.zeros((2, 3)), {1: [np.nan, 0.0]}, {}):
        with pytest.raises(ValueError, match="landmarks: expected"):
            write_map(landmarks, tmp_path / "map.csv")
    with pytest.raises(ValueError, match="cov: expected finite"):
        write_map({1: [1.0, 2.0]}, tmp_path / "map.csv", np.eye(2))
