"""The labs' own files, found by their name: a new lab registers nothing."""

import importlib
import importlib.util
import pkgutil


def import_each(name: str) -> None:
    """Import ``coursekit.labs.labNN.name`` of every lab that has such a file."""
    labs = importlib.import_module("coursekit.labs")
    for lab in pkgutil.iter_modules(labs.__path__, f"{labs.__name__}."):
        if importlib.util.find_spec(f"{lab.name}.{name}"):
            importlib.import_module(f"{lab.name}.{name}")
