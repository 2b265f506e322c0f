"""The lock stands alone: whatever a locked distribution asks for, a line of the lock answers, extras included."""

import ast
import importlib.metadata
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = ("labs", "visual", "world", "book", "test", "browser", "pdf")


def tool(name):
    spec = importlib.util.spec_from_file_location(name, ROOT / "tools" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


set_up = tool("set_up")


def pins(lock):
    """The lines of the lock that hold on this machine: name → Requirement, with one exact version."""
    lines = [Requirement(line) for line in re.findall(r"^([A-Za-z0-9][^\\\n]*)", lock, re.M)]
    return {canonicalize_name(p.name): p for p in lines if p.marker is None or p.marker.evaluate()}


def asked(requirements, extras):
    """Those of the requirements that hold on this machine for a distribution that is installed with these extras."""
    for requirement in map(Requirement, requirements or []):
        if requirement.marker is None or any(requirement.marker.evaluate({"extra": e}) for e in ("", *extras)):
            yield requirement


def unanswered(lock):
    """Requirements of the project and of each locked distribution that no line of the lock answers in full."""
    locked = pins(lock)
    wanted = [Requirement(d) for d in PROJECT["dependencies"]]
    wanted += [Requirement(d) for extra in EXTRAS for d in PROJECT["optional-dependencies"][extra]]
    wanted += [Requirement(d) for d in tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]]
    wanted = [w for w in wanted if (w.marker is None or w.marker.evaluate()) and w.name != PROJECT["name"]]
    for name, pin in locked.items():
        wanted += asked(importlib.metadata.requires(name), pin.extras)
    for want in wanted:
        pin = locked.get(canonicalize_name(want.name))
        version = pin and next(iter(pin.specifier)).version
        if not pin or not want.extras <= pin.extras or not want.specifier.contains(version, prereleases=True):
            yield str(want)


def test_the_lock_names_versions_and_hashes_and_no_address():
    assert "://" not in LOCK
    block = r"^[a-z0-9._-]+(?:\[[a-z0-9,_-]+\])?==[^\n]+?\\\n(?:    --hash=sha256:[0-9a-f]{64}[ \\]*\n)+"
    assert len(re.findall(block, LOCK, re.M)) == len(re.findall(r"^[a-z0-9]", LOCK, re.M)) > 100


def test_each_requirement_of_each_locked_distribution_is_pinned_with_its_extras():
    assert list(unanswered(LOCK)) == []


def test_a_lock_without_its_extras_is_found_out():
    bare = re.sub(r"^([a-z0-9._-]+)\[[^]]*\]==", r"\1==", LOCK, flags=re.M)
    assert any(line.startswith("coverage[toml]") for line in unanswered(bare))


@pytest.mark.parametrize("name", ["numpy", "webcolors", "setuptools"])
def test_a_lock_that_misses_a_distribution_is_found_out(name):
    short = re.sub(rf"^{name}==[^\n]*\n(?:    [^\n]*\n)*", "", LOCK, flags=re.M)
    assert name in [Requirement(line).name for line in unanswered(short)]


def test_the_installed_versions_are_the_locked_ones():
    """Where this fails, run `make setup` again: the environment is older or newer than the lock."""
    wrong = {
        name: importlib.metadata.version(name)
        for name, pin in pins(LOCK).items()
        if not pin.specifier.contains(importlib.metadata.version(name), prereleases=True)
    }
    assert wrong == {}


# The set-up ------------------------------------------------------------------------------------------------------


def commands_of_the_readme():
    block = re.search(
        r"^Without `make`.*?```sh\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S | re.M
    )
    return [line.split("#")[0].strip() for line in block[1].splitlines()]


def test_the_readme_s_plain_commands_are_those_that_make_setup_runs(monkeypatch):
    ran = []
    monkeypatch.setattr(set_up, "run", lambda command, venv: ran.append([str(word) for word in command]))
    monkeypatch.setattr(set_up, "works", lambda venv: False)
    monkeypatch.setattr(sys, "argv", ["set_up.py"])
    monkeypatch.setattr(sys, "executable", "python3")  # whichever runs the tests, the environment's own too
    set_up.main()
    quiet = {"--quiet", "--disable-pip-version-check", "--clear"}
    python = str(set_up.python_of(Path(".venv").absolute()))
    names = {python: ".venv/bin/python", str(Path(".venv").absolute()): ".venv"}
    plain = [" ".join(names.get(word, word) for word in command if word not in quiet) for command in ran]
    assert plain == commands_of_the_readme()[:3]


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_the_readme_s_plain_commands_run_the_tests_that_make_test_runs():
    bare = {name: value for name, value in os.environ.items() if name not in {"MAKEFLAGS", "MFLAGS", "COVERAGE"}}
    command = ["make", "--dry-run", "--always-make", "test", "JOBS=auto", "VENV=.venv"]
    would_run = subprocess.run(command, cwd=ROOT, env=bare, check=True, capture_output=True, text=True).stdout
    made = [line for line in would_run.splitlines() if " -m pytest " in line]
    plain = [line for line in commands_of_the_readme() if " -m pytest " in line]
    assert plain and [line.split() for line in plain] == [
        [word for word in line.split() if word != "-q" and not word.startswith("--nbmake-timeout")] for line in made
    ]


@pytest.mark.parametrize(
    ("printed", "advice"),
    [
        ("The virtual environment was not created successfully because ensurepip is not\navailable.", "python3-venv"),
        ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "cache purge"),
        ("WARNING: Retrying … NewConnectionError … ERROR: No matching distribution found for bleach", "network"),
        ("ERROR: Could not find a version that satisfies the requirement x (from versions: none)", "network"),
        ("ERROR: No matching distribution found for numpy==2.4.6", "Python 3.11 to 3.14"),
        ("ERROR: Could not install packages due to an OSError: [Errno 28] No space left on device", "disk"),
        ("Error: [Errno 13] Permission denied: '.venv'", "written"),
        ("something nobody has seen", "report the lines above"),
    ],
)
def test_a_step_that_fails_ends_with_what_to_do(printed, advice, tmp_path):
    venv = tmp_path / "venv"
    with pytest.raises(SystemExit) as stop:
        set_up.run([sys.executable, "-c", f"print({printed!r}); raise SystemExit(1)"], venv)
    last = str(stop.value).split("\n", 2)[2]
    assert advice in last and "{" not in last


def test_an_environment_cut_short_is_made_anew_and_a_whole_one_is_kept(tmp_path):
    assert not set_up.works(tmp_path / "nothing")
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True)
    assert not set_up.works(venv)
    assert set_up.works(Path(sys.prefix))


def test_the_set_up_can_be_read_by_a_python_that_is_too_old():
    ast.parse((ROOT / "tools" / "set_up.py").read_text(encoding="utf-8"), feature_version=(3, 6))


def test_an_old_python_is_told_that_it_is_too_old(monkeypatch):
    monkeypatch.setattr(sys, "version_info", (3, 10, 4))
    with pytest.raises(SystemExit, match=r"this is 3\.10") as stop:
        set_up.main()
    assert "make PYTHON=" in str(stop.value)
