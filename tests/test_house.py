"""The house stands as it was drawn: floors, licences, a lock without addresses, nothing left behind."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "coursekit"
MODULES = sorted(p for p in PACKAGE.rglob("*.py"))

GROUND = {"geometry", "gaussian", "results"}
LABS = {"landmarks", "pinhole", "noise", "ekf", "association", "slam", "icp", "particles", "visual"}
# Where the story itself joins two labs.
STORY = {
    ("slam", "association"),
    ("slam", "ekf"),
    ("association", "ekf"),
    ("visual", "particles"),
    ("landmarks", "pinhole"),
}
SHOW = {"explore", "plotting", "exercises", "scenes", "failures"}


def imports(path):
    """The coursekit modules that a file imports, each by the first name after the dot."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "coursekit":
            parts = node.module.split(".")
            yield from [parts[1]] if len(parts) > 1 else [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from (a.name.split(".")[1] for a in node.names if a.name.startswith("coursekit."))


def room(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_floor_knows_the_floors_above_it(path):
    here, known = room(path), set(imports(path)) - {room(path)}
    if here in GROUND:
        assert known <= GROUND
    if here == "models":
        assert known <= GROUND
    if here in LABS:
        others = {other for other in known & LABS if (here, other) not in STORY}
        assert not others
        assert not known & SHOW
    if here == "world":
        # The camera's intrinsics are a description, not an estimator.
        assert not known & (LABS - {"pinhole"}) and not known & SHOW
    if here in {"explore", "plotting"}:
        assert not known & LABS


def test_the_package_has_no_circles():
    graph = {room(p): set() for p in MODULES}
    for path in MODULES:
        graph[room(path)] |= set(imports(path)) & set(graph) - {room(path)}
    while leaves := {name for name, needs in graph.items() if not needs & set(graph)}:
        for name in leaves:
            del graph[name]
    assert not graph


def test_the_lock_names_versions_and_hashes_and_no_address():
    lock = (ROOT / "requirements.lock").read_text()
    assert "://" not in lock
    blocks = re.findall(r"^([a-z0-9._-]+)==[^\n]+?\\\n((?:    --hash=sha256:[0-9a-f]{64}[ \\]*\n)+)", lock, re.M)
    assert len(blocks) == len(re.findall(r"^[a-z0-9]", lock, re.M)) > 100


def test_everything_pyproject_asks_for_is_locked():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    locked = set(re.findall(r"^([a-z0-9._-]+)==", (ROOT / "requirements.lock").read_text(), re.M))
    asked = project["dependencies"] + [
        d for e in ("book", "test", "browser") for d in project["optional-dependencies"][e]
    ]
    names = {re.match(r"[A-Za-z0-9._-]+", d)[0].lower().replace("_", "-") for d in asked}
    assert names <= locked


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_randomness_is_explicit_and_nothing_is_inverted(path):
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\bnp\.random\.(?!Generator|default_rng|SeedSequence|Philox|PCG64)\w+", text)
    assert not re.search(r"\blinalg\.inv\(", text)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_every_public_definition_has_a_docstring(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "the module"
    if room(path) == "exercises" and path.stem != "__init__":
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
    tested = {p.stem.removeprefix("test_") for p in (ROOT / "tests").rglob("test_*.py")}
    tested |= {p.parent.name for p in (ROOT / "tests").glob("*/test_*.py")}
    rooms = {room(p) for p in MODULES} - {"__init__"}
    # Scenes are swept lab by lab; a private module is tested with the one it belongs to.
    assert {r for r in rooms if not r.startswith("_")} - {"scenes"} <= tested
