"""Build the source archive and, from it, the wheel; try the wheel in a bare environment, with NumPy and SciPy alone.

    .venv/bin/python tools/try_wheel.py
    .venv/bin/python tools/try_wheel.py --pyright     the types, too, as pyright sees them in an installed package

What is tried are the programs of ``tests/programs``: filters, SLAM, ICP, particles.  Nothing of the checkout is seen
by them, and nothing is written into it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import venv
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BARE = {"coursekit", "numpy", "scipy"}
BUILD = "import os, sys; from setuptools import build_meta as b; os.chdir(sys.argv[1]); print(b.{hook}(sys.argv[2]))"
CHECKER = "basedpyright"  # pyright with its own JavaScript in the wheel


def build(hook: str, source: Path, to: Path) -> Path:
    """What setuptools builds of a folder."""
    command = [sys.executable, "-c", BUILD.format(hook=hook), source, to]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=_clean())
    return to / done.stdout.splitlines()[-1]


def copy_of_the_checkout(to: Path) -> Path:
    """The files that git knows or would add: a build leaves its traces in the folder that it is made from."""
    listed = ["git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(listed, check=True, stdout=subprocess.PIPE, text=True).stdout.split("\0"):
        if name and (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    return to


def bare(folder: Path, *wanted: str | Path) -> Path:
    """The Python of a new environment that holds these, and nothing else: not even pip."""
    venv.create(folder, with_pip=False)
    python = next(p for p in (folder / "bin/python", folder / "Scripts/python.exe") if p.exists())
    pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--quiet", "--only-binary", ":all:", *wanted], check=True)
    listed = subprocess.run([*pip, "list", "--format=json"], check=True, stdout=subprocess.PIPE, text=True).stdout
    print("installed:", ", ".join(f"{one['name']} {one['version']}" for one in json.loads(listed)), flush=True)
    if CHECKER not in wanted and {one["name"] for one in json.loads(listed)} != BARE:
        sys.exit(f"The wheel brings other packages than {', '.join(sorted(BARE))}.")
    return python


def _clean() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}


def main() -> None:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "dist").mkdir()
        archive = build("build_sdist", copy_of_the_checkout(folder / "checkout"), folder / "dist")
        with tarfile.open(archive) as opened:
            opened.extractall(folder / "unpacked", filter="data")
        (source,) = (folder / "unpacked").iterdir()
        wheel = build("build_wheel", source, folder / "dist")
        print(
            f"built: {archive.name} {archive.stat().st_size // 1024} kB, {wheel.name} {wheel.stat().st_size // 1024} kB"
        )
        programs = shutil.copytree(ROOT / "tests" / "programs", folder / "programs")
        pinned = [f"{name}=={version(name)}" for name in ("numpy", "scipy")]
        extra = [CHECKER] if "--pyright" in sys.argv[1:] else []
        python = bare(folder / "venv", wheel, *pinned, *extra)
        for program in sorted(programs.glob("[!_]*.py")):
            subprocess.run([python, "-I", program], check=True, cwd=folder)
            print(f"ran: {program.name}", flush=True)
        subprocess.run([python, "-I", "-m", "coursekit"], check=True, cwd=folder)
        if extra:
            (folder / "pyrightconfig.json").write_text('{"typeCheckingMode": "standard"}')
            check = [python.with_name(CHECKER), "--level", "error", "--pythonpath", python, "programs"]
            subprocess.run(check, check=True, cwd=folder)


if __name__ == "__main__":
    main()
