"""API pages, one a room: what each room offers, in the order of its ``__all__``, and which labs use it.

Sphinx's autodoc reads the docstrings; this says what stands on which page, and adds "Used in Lab 4" to each name that
the code of a lab calls.
"""

from __future__ import annotations

import ast
import importlib
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import nbformat

# Page → the modules on it.  A name is described once: on the first page that has it.
ROOMS = {
    "geometry": ["geometry"],
    "gaussian": ["gaussian"],
    "models": ["models"],
    "landmarks": ["landmarks"],
    "pinhole": ["pinhole"],
    "noise": ["noise"],
    "ekf": ["ekf"],
    "association": ["slam.association", "slam.known_map"],
    "slam": ["slam"],
    "icp": ["icp"],
    "particles": ["particles"],
    "visual": ["visual"],
    "graph": ["graph"],
    "localisation": ["labs.lab09.localisation"],
    "world": [
        "world.arena", "world.robot", "world.camera", "world.lidar", "world.pilot", "world.recorder", "world.tags",
        "world.seafloor",
    ],
    "datasets": ["recordings.datasets"],
    "recordings": ["recordings"],
    "teaching": [
        "teaching.exercises", "teaching.projects", "teaching.experiments", "teaching.explore", "teaching.touch",
        "teaching.failures", "teaching.plotting",
    ],
    "results": ["results"],
}  # fmt: skip
MEMBERS = "\n   :members:\n   :member-order: bysource"


def offered(module: ModuleType) -> list[str]:
    """The public functions and classes of a module: those of ``__all__``, else those that it defines, in order."""
    names = getattr(module, "__all__", None) or [
        name for name, thing in vars(module).items() if getattr(thing, "__module__", None) == module.__name__
    ]
    things = {name: getattr(module, name) for name in names if not name.startswith("_")}
    return [n for n, thing in things.items() if inspect.isclass(thing) or inspect.isfunction(inspect.unwrap(thing))]


def lab_number(path: Path) -> str:
    """4 for ``04_ekf``, 5b for ``05b_why_too_sure``."""
    return path.stem.split("_")[0].removeprefix("0")


def uses(path: Path) -> set[int]:
    """The objects of coursekit that a notebook's code names, by their ids."""
    cells = nbformat.read(path, as_version=4).cells
    trees = [ast.parse(_python(cell.source)) for cell in cells if cell.cell_type == "code"]
    known: dict[str, Any] = {}
    for node in (n for tree in trees for n in ast.walk(tree)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "coursekit":
            home = importlib.import_module(str(node.module))
            known |= {alias.asname or alias.name: _part(home, alias.name) for alias in node.names}
    return {id(thing) for tree in trees for thing in _named(tree, known)}


def _python(source: str) -> str:
    return "\n".join(line for line in source.splitlines() if not line.startswith(("%", "!")))


def _part(home: Any, name: str) -> Any:
    if not hasattr(home, name):
        return importlib.import_module(f"{home.__name__}.{name}")
    return getattr(home, name)


def _named(tree: ast.AST, known: dict[str, Any]) -> Iterator[Any]:
    """What the names of a tree stand for, as far as they lead through coursekit's modules and classes."""

    def meant(node: ast.AST) -> Any:
        if isinstance(node, ast.Name):
            return known.get(node.id)
        if isinstance(node, ast.Attribute):
            home = meant(node.value)
            return getattr(home, node.attr, None) if isinstance(home, (ModuleType, type)) else None
        return None

    for node in ast.walk(tree):
        if isinstance(node, (ast.Name, ast.Attribute)) and (thing := meant(node)) is not None:
            yield thing


def _entry(module: ModuleType, name: str, where: list[Path]) -> str:
    thing = getattr(module, name)
    links = ", ".join(f":doc:`Lab {lab_number(path)} </notebooks/{path.stem}>`" for path in where)
    used = f"\n\n   *Used in* {links}." if links else ""
    full = f"{thing.__module__}.{thing.__qualname__}"
    if not inspect.isclass(thing):
        return f".. autofunction:: {full}{used}"
    # A part of it that stands in a module of its own, and has no entry, belongs to it.
    parts = [b for b in thing.__bases__ if b.__module__.startswith("coursekit") and not hasattr(module, b.__name__)]
    return f".. autoclass:: {full}{MEMBERS}" + ("\n   :inherited-members:" if parts else "") + used


def pages(labs: list[Path]) -> dict[str, str]:
    """The pages ``api/<room>.md`` and their contents list."""
    used = {path: uses(path) for path in labs}
    done: set[int] = set()
    made, lines = {}, []
    for room, places in ROOMS.items():
        text = [f"# `{room}`"]
        count = 0
        for place in places:
            module = importlib.import_module(f"coursekit.{place}")
            if len(places) > 1:
                text.append(f"## `coursekit.{place}`")
            entries = [f".. automodule:: {module.__name__}\n   :no-index:"]
            for name in offered(module):
                thing = getattr(module, name)
                if id(thing) not in done and thing.__module__.startswith("coursekit"):
                    done.add(id(thing))
                    entries.append(_entry(module, name, [path for path in labs if id(thing) in used[path]]))
            count += len(entries) - 1
            text.append("```{eval-rst}\n" + "\n\n".join(entries) + "\n```")
        first = (importlib.import_module(f"coursekit.{places[0]}").__doc__ or "").split("\n")[0]
        lines.append(f"| [`{room}`]({room}.md) | {first} | {count} |")
        made[f"api/{room}.md"] = "\n\n".join(text) + "\n"
    toctree = "\n".join(ROOMS)
    made["api/index.md"] = (
        f"# The package\n\n{ABOUT}\n\n| room | what it is | names |\n| --- | --- | --- |\n"
        + "\n".join(lines)
        + f"\n\n```{{toctree}}\n:hidden:\n\n{toctree}\n```\n"
    )
    return made


ABOUT = """These pages are made from the docstrings of `coursekit`. Each name says what goes in and comes out, with
shapes and units, what is raised, and where the method comes from. Its example has been run by the tests, and *source*
leads to its code. *Used in* names the labs whose code calls it. What the letters mean is on the page
[Notation](../notation.md)."""
