"""The flat surface of the package: rooms and names, imported when first used, and the short paths of modules."""

import ast
import doctest
import importlib
import inspect
import pickle
import subprocess
import sys

import pytest

import coursekit

SHORT = {short: place for short, place in coursekit._MODULES.items() if short != place}


def in_a_fresh_process(program):
    return subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout.strip()


def test_importing_the_package_imports_nothing_heavy():
    loaded = in_a_fresh_process("import sys, coursekit; print(*sys.modules)").split()
    assert "coursekit" in loaded
    assert not {"numpy", "scipy", "matplotlib", "cv2", "importlib.metadata"} & set(loaded)
    assert [name for name in loaded if name.startswith("coursekit.")] == ["coursekit.extras"]


def test_the_table_the_types_and_all_offer_the_same():
    places = {**coursekit._MODULES, **{name: f"{home}.{name}" for name, home in coursekit._HOME.items()}}
    tree = ast.parse(inspect.getsource(coursekit))
    (typed,) = [n for n in tree.body if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING"]
    assert places == {
        alias.asname or alias.name: f"{statement.module}.{alias.name}".partition(".")[2]
        for statement in typed.body
        for alias in statement.names
    }
    assert sorted(places) == sorted(coursekit.__all__)


@pytest.mark.parametrize("name", coursekit.__all__)
def test_every_name_is_offered_to_autocompletion_and_is_what_stands_in_its_place(name):
    assert name in dir(coursekit)
    if name in coursekit._MODULES:
        assert getattr(coursekit, name) is importlib.import_module(f"coursekit.{coursekit._MODULES[name]}")
    else:
        home = importlib.import_module(f"coursekit.{coursekit._HOME[name]}")
        assert getattr(coursekit, name) is getattr(home, name)


@pytest.mark.parametrize("short_first", [True, False])
def test_a_short_path_and_the_real_one_give_the_same_module_whichever_comes_first(short_first):
    lines = []
    for short, place in SHORT.items():
        ways = [f"import coursekit.{short} as a", f"import coursekit.{place} as b"]
        lines += ways if short_first else ways[::-1]
        lines += [f"from coursekit import {short} as c", "print(a is b is c, a.__name__, a.__spec__.name)"]
    said = in_a_fresh_process("\n".join(lines)).splitlines()
    assert said == [f"True coursekit.{place} coursekit.{place}" for place in SHORT.values()]


def test_what_stands_below_a_short_path_is_the_same_module_too():
    below = importlib.import_module("coursekit.explore.sliders")
    assert below is importlib.import_module("coursekit.teaching.explore.sliders")


def test_a_class_from_a_short_path_is_the_class_itself_and_can_be_pickled():
    from coursekit.association import Mahalanobis
    from coursekit.slam.association import Mahalanobis as Real

    assert Mahalanobis is Real
    assert pickle.loads(pickle.dumps(Mahalanobis(0.95))) == Real(0.95)


def test_a_name_that_is_not_offered_is_an_ordinary_error():
    with pytest.raises(AttributeError, match="module 'coursekit' has no attribute 'nothing'"):
        coursekit.nothing  # noqa: B018
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("coursekit.nothing")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("coursekit.association.nothing")


def test_the_recipes_of_the_first_page_run():
    found = doctest.testmod(coursekit)
    assert found.failed == 0 and found.attempted > 12
