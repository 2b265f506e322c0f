from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from coursekit.geometry import wrap_angle
from coursekit.recordings.datasets import project_file
from coursekit.world.arena import COLOURS, Arena, Crate, Cylinder, Tag, Wall
from coursekit.world.robot import World

NAMES = sorted(path.stem for path in project_file("arenas").glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_arena_loads_under_its_own_name_and_a_robot_can_start_in_it(name):
    arena = Arena.load(name)
    assert arena.name == name
    assert World(arena, seed=0).pose == pytest.approx(arena.start)
    assert arena == Arena.load(project_file(f"arenas/{name}.toml"))


def test_the_lab_has_one_landmark_of_each_colour_and_crates():
    arena = Arena.load("lab")
    assert sorted(c.colour for c in arena.cylinders) == sorted(COLOURS)
    assert {(c.radius, c.height) for c in arena.cylinders} == {(0.1, 0.5)}
    assert len(arena.crates) >= 2


def test_field_and_hallway_hold_one_cyan_cylinder_with_twenty_metres_behind_the_start():
    for name in ("field", "hallway"):
        arena = Arena.load(name)
        (cylinder,) = arena.cylinders
        assert cylinder.colour == "cyan"
        west = min(min(w.start[0], w.end[0]) for w in arena.walls)
        assert cylinder.position[0] - west > 20.5


def test_the_eight_tags_stand_where_the_report_says_and_face_the_middle():
    table = {3: (2.5, 0), 2: (2.5, 1), 4: (1, 1.5), 17: (-0.3, 1.5)}
    table |= {0: (-1.3, 0.6), 16: (-1.2, 0.2), 15: (-0.3, -1.2), 1: (0.1, -1.2)}
    tags = Arena.load("tags").tags
    assert {tag.id: tag.position for tag in tags} == table
    for tag in tags:
        to_the_middle = np.arctan2(-tag.position[1], -tag.position[0])
        assert abs(wrap_angle(tag.yaw - to_the_middle)) < 1e-5


def test_arenas_are_values_frozen_hashable_and_equal_when_their_entries_are():
    arena = Arena("a", cylinders=[Cylinder([1, 2])], crates=[Crate(np.array([1, 1, 0]))])
    same = Arena("a", cylinders=(Cylinder((1.0, 2.0), 0.1),), crates=(Crate((1, 1, 0)),))
    assert arena == same and hash(arena) == hash(same)
    assert arena != replace(arena, start=(0, 1, 0))
    with pytest.raises(FrozenInstanceError):
        arena.name = "b"


NAMED = 'name = "a"\n'
CYLINDER = NAMED + "[[cylinders]]\nposition = [1, 2]\n"
CRATE = NAMED + "[[crates]]\npose = [0, 0, 0]\n"
TAG = "[[tags]]\nposition = [0, 0]\nyaw = 0\n"
WRONG_FILES = {
    "misspelt key": (NAMED + "[[cylinders]]\npositon = [1, 2]", ["cylinders[0].positon", "position"]),
    "misspelt table": (NAMED + "[[cylinder]]\nposition = [1, 2]", ["cylinder", "cylinders"]),
    "missing key": (NAMED + "[[walls]]\nstart = [1, 2]", ["walls[0].end", "expected a value"]),
    "no name": ("start = [0, 0, 0]", ["name", "expected a value"]),
    "text for a number": (CYLINDER + 'radius = "wide"', ["cylinders[0].radius", "'wide'"]),
    "negative radius": (CYLINDER + "radius = -0.1", ["cylinders[0].radius", "> 0", "-0.1"]),
    "three coordinates": (
        NAMED + "[[walls]]\nstart = [1, 2, 3]\nend = [0, 0]",
        ["walls[0].start", "[x, y]", "[1, 2, 3]"],
    ),
    "not a number": (NAMED + "start = [0, nan, 0]", ["start", "finite", "nan"]),
    "truth for a number": (CRATE + "mass = true", ["crates[0].mass", "True"]),
    "flat crate": (CRATE + "size = [1, 0]", ["crates[0].size", "> 0"]),
    "unknown colour": (CYLINDER + 'colour = "cyann"', ["cylinders[0].colour", "cyan,", "'cyann'"]),
    "tag twice": (NAMED + TAG + "id = 1\n" + TAG + "id = 1", ["tags", "[1]"]),
    "tag outside the family": (NAMED + TAG + "id = 587", ["tags[0].id", "586", "587"]),
    "wall without length": (NAMED + "[[walls]]\nstart = [1, 2]\nend = [1, 2]", ["walls[0].end"]),
    "a table that is a number": (NAMED + "walls = 3", ["walls", "[[walls]]", "3"]),
    "not TOML": ("name = =\n", ["line 1"]),
}


@pytest.mark.parametrize("case", WRONG_FILES)
def test_a_wrong_file_is_told_by_file_key_expectation_and_finding(case, tmp_path):
    text, fragments = WRONG_FILES[case]
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError) as caught:
        Arena.load(path)
    for fragment in ["wrong.toml", *fragments]:
        assert fragment in str(caught.value)


ODD = Arena(
    'a "yard"\\\n\x7f ü',
    walls=(Wall((0, 1e22), (1e-300, 0.1)),),
    cylinders=(Cylinder((1 / 3, -0.0), 0.07, 0.4, "red"),),
    crates=(Crate((1, 2, 0.3), (0.2, 0.5), 2.5), Crate((np.pi, 0, 0))),
    tags=(Tag(np.int64(7), (1, 2), -0.1, 0.2, 0.3),),
    start=(0.1, 0.2, 0.3),
)


@pytest.mark.parametrize("arena", [ODD, Arena("empty"), *map(Arena.load, NAMES)], ids=lambda arena: arena.name[:6])
def test_an_arena_that_is_saved_comes_back_equal(arena, tmp_path):
    arena.save(tmp_path / "B.TOML")
    assert Arena.load(tmp_path / "B.TOML") == arena


def test_an_arena_no_file_can_hold_is_refused_and_nothing_is_written(tmp_path):
    path = tmp_path / "a.toml"
    with pytest.raises(ValueError, match=r"cylinders\[0\].colour: expected one of red"):
        Arena("a", cylinders=(Cylinder((1, 2), colour="mauve"),)).save(path)
    with pytest.raises(ValueError, match="name: expected text"):
        Arena("\ud800").save(path)
    with pytest.raises(ValueError, match=r"path: expected one that ends in \.toml"):
        ODD.save(tmp_path / "a.txt")
    assert not list(tmp_path.iterdir())


def test_a_file_that_an_editor_saved_with_a_mark_or_other_line_ends_is_read(tmp_path):
    path = tmp_path / "b.toml"
    ODD.save(path)
    text = path.read_bytes()
    for saved in (b"\xef\xbb\xbf" + text, text.replace(b"\n", b"\r\n")):
        path.write_bytes(saved)
        assert Arena.load(path) == ODD
    path.write_bytes(text.decode().encode("utf-16"))
    with pytest.raises(ValueError, match=r"b\.toml: expected text in UTF-8"):
        Arena.load(path)


def test_an_unknown_arena_is_told_which_there_are():
    with pytest.raises(FileNotFoundError, match="corridor, field"):
        Arena.load("atlantis")
    with pytest.raises(FileNotFoundError):
        Arena.load("nowhere/at_all.toml")


def test_things_check_themselves_without_a_file_too():
    with pytest.raises(ValueError, match="position"):
        Cylinder((0, np.inf))
    with pytest.raises(ValueError, match="id"):
        Tag(True, (0, 0), 0.0)
    with pytest.raises(ValueError, match="walls"):
        Arena("a", walls=(Cylinder((0, 0)),))
    with pytest.raises(ValueError, match="end"):
        Wall((0, 0), (0.0, 0.0))


def test_a_crates_corners_run_counter_clockwise_round_its_centre():
    corners = Crate((5, 5, 1), (0.6, 0.2)).corners
    assert corners.mean(axis=0) == pytest.approx([0, 0])
    x, y = corners.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert area == pytest.approx(0.12)


@pytest.mark.parametrize("radius", ["2020-01-01", "{a = 1}", "9" * 400, "[1]", "true", '"1"'])
def test_a_file_with_something_else_where_a_number_belongs_says_where(tmp_path, radius):
    path = tmp_path / "odd.toml"
    path.write_text(f'name = "odd"\n[[cylinders]]\nposition = [1, 2]\nradius = {radius}\n')
    with pytest.raises(ValueError, match=r"odd\.toml: cylinders\[0\]\.radius: expected a finite number"):
        Arena.load(path)
