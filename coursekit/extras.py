"""What may be installed beside NumPy and SciPy, and the one sentence that is said when it is missing.

The estimators need NumPy and SciPy alone.  The simulated world, pictures and the labs need more: an extra of the
package's, as in ``pip install 'coursekit[world]'``.  ``python -m coursekit`` shows which are here.

>>> EXTRAS["world"]
{'pymunk': 'pymunk'}
"""

from __future__ import annotations

import sys
from importlib.machinery import PathFinder
from typing import Any

# Of each extra the modules that are imported, and the distribution that has them.
EXTRAS: dict[str, dict[str, str]] = {
    "world": {"pymunk": "pymunk"},
    "visual": {"cv2": "opencv-python-headless"},
    "labs": {
        "anywidget": "anywidget",
        "cloudpickle": "cloudpickle",
        "IPython": "ipython",
        "ipywidgets": "ipywidgets",
        "jupyterlab": "jupyterlab",
        "jupyterlab_myst": "jupyterlab-myst",
        "matplotlib": "matplotlib",
        "pooch": "pooch",
        "tqdm": "tqdm",
    },
    "ros": {"rosbags": "rosbags"},
    "cluster": {"distributed": "distributed"},
}
_HOME = {module: (extra, name) for extra, modules in EXTRAS.items() for module, name in modules.items()}


def missing(extra: str) -> list[str]:
    """The distributions of an extra that are not installed; empty when it is complete.

    Raises KeyError for an extra that there is not.

    >>> set(missing("world")) <= {"pymunk"}
    True
    """
    return [name for module, name in EXTRAS[extra].items() if PathFinder.find_spec(module) is None]


def version(distribution: str) -> str:
    """The version of what is installed, or "" for what is not.

    >>> version("numpy") >= "2", version("no-such-thing")
    (True, '')
    """
    from importlib import metadata  # here: ``import coursekit`` shall cost nothing

    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


class _Missing:
    """Asked last, when no other finder has a module: if a module of coursekit wants it, the error says which extra.

    Others' imports are none of our business: a library that tries ``import tqdm`` gets Python's own error.
    """

    @staticmethod
    def find_spec(name: str, path: Any = None, target: Any = None) -> None:
        if name not in _HOME:
            return
        frame: Any = sys._getframe(1)
        while frame and _module_of(frame).partition(".")[0] == "importlib":
            frame = frame.f_back
        asking = _module_of(frame) if frame else ""
        if asking.partition(".")[0] == "coursekit":
            extra, distribution = _HOME[name]
            sentence = f"{asking} needs {distribution}: pip install 'coursekit[{extra}]'"
            raise ModuleNotFoundError(sentence, name=name) from None


def _module_of(frame: Any) -> str:
    return str(frame.f_globals.get("__name__", ""))


def explain_what_is_missing() -> None:
    """Let the package's failed imports name the extra; done once, by ``import coursekit``."""
    if _Missing not in sys.meta_path:
        sys.meta_path.append(_Missing)
