"""The house stands as it was drawn: floors, docstrings, tests for every room, nothing left behind."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "coursekit"
MODULES = sorted(p for p in PACKAGE.rglob("*.py"))

# Each room's floor, from the ground up.  A room may know the rooms below its floor, and what STORY adds.
FLOORS = [
    {"doors", "geometry", "gaussian", "results", "extras"},
    {"models", "recordings"},
    {"landmarks", "pinhole", "noise", "ekf", "slam", "icp", "particles", "visual", "graph", "world"},
    {"teaching"},
    {"labs"},
]
FLOOR = {room: height for height, rooms in enumerate(FLOORS) for room in rooms}
# Where the story itself joins two rooms of one floor.
STORY = {
    ("geometry", "doors"),
    ("gaussian", "doors"),
    ("gaussian", "geometry"),
    ("landmarks", "pinhole"),
    ("slam", "ekf"),
    ("icp", "graph"),
    ("visual", "particles"),
    # The camera's intrinsics are a description, not an estimator.
    ("world", "pinhole"),
}
# What teaches draws, slides and judges; it has no estimator in it.
NO_ESTIMATORS = {"teaching": FLOORS[0]}
LAB_FILES = {"project", "runs", "figures", "explorers", "exercises", "failures"}


def dotted(path):
    """A module's dotted name below coursekit; "" for the surface itself."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {dotted(p): p for p in MODULES}


def imports(path):
    """The modules of coursekit that a file imports, dotted, wherever in the file that happens."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "coursekit":
            base = node.module.partition(".")[2]
            for alias in node.names:
                below = f"{base}.{alias.name}".strip(".")
                yield below if below in NAMES else base
        elif isinstance(node, ast.Import):
            yield from (a.name.partition(".")[2] for a in node.names if a.name.split(".")[0] == "coursekit")


def room(name):
    return name.split(".")[0]


# Without the surface and ``python -m coursekit``, which know the whole house.
HOUSE = {name: set(imports(path)) for name, path in NAMES.items() if name not in ("", "__main__")}


def test_every_room_has_a_floor_and_every_floor_its_rooms():
    assert {room(name) for name in HOUSE} == set(FLOOR)


@pytest.mark.parametrize("name", HOUSE)
def test_inside_the_house_everything_is_imported_by_the_path_where_it_stands(name):
    assert HOUSE[name] <= set(HOUSE)


@pytest.mark.parametrize("name", HOUSE)
def test_no_room_knows_its_neighbours_or_a_floor_above(name):
    here = room(name)
    known = {room(other) for other in HOUSE[name]} - {here}
    assert not {other for other in known if FLOOR[other] >= FLOOR[here] and (here, other) not in STORY}
    assert known <= NO_ESTIMATORS.get(here, known)


@pytest.mark.parametrize("name", [name for name in HOUSE if name.startswith("labs.lab")])
def test_a_lab_has_the_files_that_every_lab_has_and_knows_no_other_lab(name):
    _, lab, *file = name.split(".")
    assert not {other for other in HOUSE[name] if room(other) == "labs" and other.split(".")[1] != lab}
    assert not file or file[0] in LAB_FILES or (lab, file[0]) == ("lab09", "localisation")


def test_no_module_waits_for_itself():
    graph = {name: set(others) - {name} for name, others in HOUSE.items()}
    while leaves := {name for name, needs in graph.items() if not needs & set(graph)}:
        for name in leaves:
            del graph[name]
    assert not graph


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_randomness_is_explicit_and_nothing_is_inverted(path):
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\bnp\.random\.(?!Generator|default_rng|SeedSequence|Philox|PCG64)\w+", text)
    assert not re.search(r"\blinalg\.inv\(", text)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_public_definition_has_a_docstring(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "the module"
    if dotted(path).startswith("labs.") and path.stem == "exercises":
        return  # a check is described by its exercise, in the lab
    bare = [
        node.name
        for node in tree.body
        if isinstance(node, (ast.FunctionDef, ast.ClassDef))
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]
    assert not bare


def test_every_room_of_the_package_has_tests_of_its_name():
    tests = {p.relative_to(ROOT / "tests").parts[0] for p in (ROOT / "tests").rglob("test_*.py")}
    assert {room(name) for name in HOUSE} <= {name.removeprefix("test_").removesuffix(".py") for name in tests}
