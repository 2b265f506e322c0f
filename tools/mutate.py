"""Would the tests notice?  Breaks the code of a room in many small ways and runs the room's own tests on each.

python tools/mutate.py geometry                      # every mutant of coursekit/geometry.py
python tools/mutate.py slam --sample 50              # fifty of coursekit/slam, the same fifty each time
python tools/mutate.py slam --again                  # those that survived last time, after the tests have grown

A *mutant* is the room with one thing changed: a + for a -, a < for a <=, a number one larger, an argument left out.  It
is killed when a test fails, and survives when none does.  What survives is printed, to be judged one by one: does it
change what the docstring promises?  Then a test is missing.  Messages of errors are left alone.

Needs the package mutmut, ``pip install 'coursekit[mutation]'``, and an operating system that can fork.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLACE = ROOT / "mutants"
ROOMS = ("geometry", "gaussian", "models", "pinhole", "landmarks", "noise", "ekf", "slam", "icp", "particles", "visual",
         "graph")  # fmt: skip
KILLED, SURVIVED, UNTOUCHED = (1, 3), (0,), (5, 33)  # exit codes of pytest, and mutmut's own for "no test gets there"


def prepared(room: str) -> Path:
    """A copy of the project in a folder of its own, told which files to break and which tests to ask."""
    place = PLACE / room
    for name in ("coursekit", "tests", "data", "tools"):
        shutil.copytree(ROOT / name, place / name, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", place)
    # A mutant is chosen by one more call, so the tests that count calls count nothing here.
    (place / "tests" / "work.py").write_text("def within(most_calls, work):\n    return work()\n", encoding="utf-8")
    code = room if (ROOT / "coursekit" / room).is_dir() else f"{room}.py"
    tests = [t.relative_to(ROOT).as_posix() for t in (*ROOT.glob(f"tests/test_{room}*.py"), ROOT / "tests" / room)
             if t.exists()]  # fmt: skip
    hostile = "tests/hostile/test_contract.py"
    config = {
        "source_paths": ["coursekit"],
        "only_mutate": [f"coursekit/{code}" + ("/*" if "." not in code else "")],
        "do_not_mutate_patterns": [r"raise \w+"],
        "also_copy": ["data", "tools"],
        # The room's name chooses its rows of the table of hostile arguments.
        "pytest_add_cli_args": ["-p", "no:cacheprovider", "-m", "not slow", "-k", room],
        "pytest_add_cli_args_test_selection": [*tests, f"coursekit/{code}", hostile],
    }
    lines = [f"{key}=" + "".join(f"\n    {value}" for value in values) for key, values in config.items()]
    (place / "setup.cfg").write_text("\n".join(["[mutmut]", *lines, ""]), encoding="utf-8")
    return place


def mutmut(place: Path, *arguments: str) -> str:
    # Threads would not survive the fork.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONPATH": ""}
    command = [sys.executable, "-c", "from mutmut.__main__ import cli; cli()", *arguments]
    run = subprocess.run(command, cwd=place, env=environment, text=True, capture_output=True, check=False)
    return run.stdout


def verdicts(place: Path) -> dict[str, int | None]:
    """The exit code of the tests for each mutant, None where it has not been tried."""
    found: dict[str, int | None] = {}
    for meta in sorted((place / "mutants").rglob("*.meta")):
        found.update(json.loads(meta.read_text(encoding="utf-8"))["exit_code_by_key"])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("room", choices=ROOMS)
    parser.add_argument("--sample", type=int, help="try so many, drawn at random, in place of all")
    parser.add_argument("--seed", type=int, default=17, help="of the draw")
    parser.add_argument("--again", action="store_true", help="try only those that survived the last time")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args()
    if (PLACE / chosen.room).exists() and not chosen.again:
        shutil.rmtree(PLACE / chosen.room)
    before = verdicts(PLACE / chosen.room)
    place = prepared(chosen.room)
    if chosen.again:
        names = [name for name, code in before.items() if code is not None and code not in KILLED]
    else:
        said = mutmut(
            place, "run", "--max-children", "1", "none"
        )  # makes the mutants, and finds out which test runs which
        names = sorted(verdicts(place))
        if not names:
            raise SystemExit(said)
        if chosen.sample and chosen.sample < len(names):
            names = random.Random(chosen.seed).sample(names, chosen.sample)
    if names:
        mutmut(place, "run", "--max-children", str(chosen.workers), *names)
    after = verdicts(place)
    tried = {name: after[name] for name in ({*before} if chosen.again else names) if after.get(name) is not None}
    alive = sorted(name for name, code in tried.items() if code in SURVIVED + UNTOUCHED)
    for name in alive:
        print(mutmut(place, "show", name))
    print(f"{chosen.room}: {len(tried) - len(alive)} of {len(tried)} killed, of {len(after)} mutants in all")


if __name__ == "__main__":
    main()
