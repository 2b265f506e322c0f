"""Make the course importable in the kernel that runs this: on Colab, on a JupyterHub, under a lone notebook.

    %run where-am-i/tools/install_here.py

The first cell of a published lab does so where ``coursekit`` is missing.  What the labs compute with is installed as
it is locked, each file checked against its hash.  What the running kernel itself is made of (IPython, ipywidgets and
what they bring) stays as it is where it is there.
"""

from __future__ import annotations

import importlib.metadata
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
KERNEL = {"ipython", "ipywidgets"}
EDITOR = {"jupyterlab", "jupyterlab-myst"}  # the page in which the notebook is open


def pins(lock: str) -> dict[str, str]:
    """The lock's entries that hold on this machine: name → its lines, hashes included."""
    entries = re.findall(r"^(?=[A-Za-z0-9])(?:.*\\\n)*.*\n", lock, re.M)
    found = {}
    for entry in entries:
        requirement = Requirement(entry.split("\\")[0])
        if requirement.marker is None or requirement.marker.evaluate():
            found[canonicalize_name(requirement.name)] = entry
    return found


def closure(roots: set[str], lock: str) -> set[str]:
    """The roots, and all that they bring, by the lock's "# via" comments."""
    brought_by = {
        canonicalize_name(name): set(re.findall(r"[\w.-]+", via))
        for name, via in re.findall(r"^([A-Za-z0-9][\w.-]*)(?:.*\\\n)*.*\n((?: +# .*\n?)*)", lock, re.M)
    }
    found = set(roots)
    while more := {name for name, parents in brought_by.items() if parents & found} - found:
        found |= more
    return found


def wanted(lock: str, dependencies: list[str], installed: dict[str, str]) -> list[str]:
    """The lock's entries that are to be installed beside what is ``installed``: name → version."""
    direct = {canonicalize_name(Requirement(d).name) for d in dependencies}
    kernel = closure(KERNEL, lock)
    entries = pins(lock)
    names = closure(direct - EDITOR, lock) & set(entries)
    return [
        entries[name]
        for name in sorted(names)
        if not (name in kernel and name in installed) and f"=={installed.get(name)} " not in f"{entries[name]} "
    ]


def needed() -> list[str]:
    """What the labs compute with: the package's own dependencies and those of its extras for learners."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [line for extra in ("world", "visual", "labs") for line in project["optional-dependencies"][extra]]
    return [line for line in project["dependencies"] + extras if not line.startswith(project["name"])]


def install() -> None:
    """Install what is missing, make ``coursekit`` importable; say so when a restart is needed first.

    Raises CalledProcessError when pip does; its own words stand above.
    """
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    installed = {canonicalize_name(d.metadata["Name"]): d.version for d in importlib.metadata.distributions()}
    entries = wanted(lock, needed(), installed)
    sys.path.insert(0, str(ROOT))
    if not entries:
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "requirements.txt"
        file.write_text("".join(entries), encoding="utf-8")
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--require-hashes", "-r", str(file)]
        subprocess.run(pip, check=True)
    importlib.invalidate_caches()
    if loaded := sorted({"numpy", "scipy", "matplotlib"} & set(sys.modules)):
        print(f"Restart the kernel, then run this cell again: it had already loaded another {', '.join(loaded)}.")


if __name__ == "__main__":
    install()
