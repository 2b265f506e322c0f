"""Inputs that run are inputs that type-check: small programs with lists and tuples, run and checked strictly."""

import importlib
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import coursekit

ROOT = Path(__file__).parent.parent
PROGRAMS = sorted(path for path in (ROOT / "tests" / "programs").glob("*.py") if path.stem != "__init__")
SHORT = {short: place for short, place in coursekit._MODULES.items() if short != place}


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_as_a_user_writes_it_runs(program):
    runpy.run_path(str(program))


def test_mypy_finds_nothing_wrong_in_the_programs():
    mypy = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "tests/programs"]
    told = subprocess.run([*mypy, "--cache-dir=.mypy_cache/programs"], cwd=ROOT, capture_output=True, text=True)
    assert told.returncode == 0, told.stdout
    assert len(PROGRAMS) >= 10 and f"in {len(PROGRAMS) + 1} source files" in told.stdout


@pytest.mark.parametrize("short", SHORT)
def test_a_type_checker_finds_each_short_path(short):
    assert importlib.import_module(f"coursekit.{short}")
    assert (ROOT / "coursekit" / f"{short}.pyi").read_text() == f"from coursekit.{SHORT[short]} import *\n"
