"""Grade a folder of notebooks: one file for each student, or one folder for each student with a notebook a lab.

    python tools/grade.py submissions                    writes submissions-graded/marks.csv and report.html
    python tools/grade.py submissions --labs lab04       only this lab
    python tools/grade.py submissions --to somewhere     another folder

No notebook is run.  The functions that the exercises and projects ask for are taken out of it, each into a process of
its own behind walls (``tools/grading/walls.py``), and the package's own checks ask them from outside.  What has been
judged is remembered by its code: a second run judges only what has changed, and an interrupted one goes on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import queue
import re
import secrets
import sys
import threading
from dataclasses import asdict
from pathlib import Path

from tqdm import tqdm

sys.path.insert(0, str(Path(__file__).parent))
from grading import report
from grading.bench import Bench
from grading.limits import Limits
from grading.notebook import Notebook, Task, read

ROOT = Path(__file__).resolve().parents[1]
MASTERS = ROOT / "notebooks"
OWN = re.compile(r"\b[Rr]eference\b.*\bcoursekit\b|\bcoursekit\b.*\b[Rr]eference\b|\bproject\.[Rr]eference\b")
SOURCES = [ROOT / "coursekit", ROOT / "tools" / "grading"]


class Lab:
    """A lab as it is handed out: its code, and what is to be graded in it."""

    def __init__(self, master: Path) -> None:
        self.notebook = read(master)
        asked = self.notebook.asked().items()
        self.tasks = [Task(name, kind, target, runs) for name, (kind, target, runs) in asked]


def course(only: list[str] | None = None) -> dict[str, Lab]:
    """The labs by name, as in "lab04"; all of them, or those in ``only``.  Raises ValueError for a name of none."""
    paths = {f"lab{path.stem[:2]}": path for path in sorted(MASTERS.glob("[0-9][0-9]_*.ipynb"))}
    if unknown := set(only or []) - set(paths):
        raise ValueError(f"no lab named {', '.join(sorted(unknown))}; there are {', '.join(paths)}")
    return {name: Lab(path) for name, path in paths.items() if name in (only or paths)}


def students(folder: Path) -> dict[str, list[Path]]:
    """Name → notebooks: a file's name, or a folder's with all notebooks below it."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*.ipynb")):
        inside = path.relative_to(folder).parts
        if path.is_file() and not any(part.startswith(".") for part in inside):
            found.setdefault(inside[0].removesuffix(".ipynb"), []).append(path)
    return found


def labs_of(notebook: Notebook, path: Path, labs: dict[str, Lab]) -> set[str]:
    """The labs that a notebook answers: by its checks, or else by its file's name, or else by what it defines."""
    if asked := {name[:5] for name in notebook.asked()} & set(labs):
        return asked
    if (named := f"lab{path.stem[:2]}") in labs:
        return {named}
    bound = set().union(*(s.binds for s in notebook.statements)) if notebook.statements else set()
    return {name for name, lab in labs.items() if len(bound & {t.target for t in lab.tasks}) >= 2}


def fingerprint() -> str:
    """Of the course and the grader: what judges differently tomorrow is asked again."""
    digest = hashlib.sha256()
    for path in sorted(p for source in SOURCES for p in source.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


class Memory:
    """What has been judged, and the seed that the whole class is judged with."""

    def __init__(self, folder: Path, settings: list) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.settings = folder, [fingerprint(), settings]
        drawn = folder / "seed"
        if not drawn.exists():
            drawn.write_text(str(secrets.randbits(63)))
        self.seed = int(drawn.read_text())

    def path(self, work: dict) -> Path:
        """Where the verdict on this work is kept."""
        return self.folder / (hashlib.sha256(json.dumps([self.settings, work]).encode()).hexdigest() + ".json")

    def recall(self, work: dict) -> dict | None:
        """The verdict, or None."""
        try:
            return json.loads(self.path(work).read_text("utf-8"))
        except (OSError, ValueError):
            return None

    def keep(self, work: dict, verdict: dict) -> None:
        """Written whole or not at all."""
        draft = self.path(work).with_suffix(f".{threading.get_ident()}")
        draft.write_text(json.dumps(verdict), "utf-8")
        os.replace(draft, self.path(work))


def collect(folder: Path, labs: dict[str, Lab], seed: int) -> list[report.Student]:
    """The class: each student's tasks, those that need no judge already with their verdict."""
    people = []
    for name, paths in students(folder).items():
        student = report.Student(name, [p.relative_to(folder).as_posix() for p in paths])
        for path in paths:
            notebook = read(path)
            student.remarks += [f"{path.name}: {trouble}" for trouble in notebook.trouble]
            for lab in sorted(labs_of(notebook, path, labs)):
                for task in labs[lab].tasks:
                    result = _result(task, notebook, labs[lab], seed, student.remarks)
                    # Of two notebooks of a lab, the later by name counts; one without the answer takes nothing away.
                    if result.work or task.key not in student.results:
                        student.results[task.key] = result
        if not student.results:
            student.remarks.append("None of the lab's exercises was found in what was handed in.")
        people.append(student)
    return people


def _result(task: Task, notebook: Notebook, lab: Lab, seed: int, remarks: list[str]) -> report.Result:
    target = notebook.answer(task)
    if target is None:
        missing = f"There is no {task.target} in the notebook. Was it renamed, or its cell deleted or broken?"
        return report.Result(task, verdict={"share": 0.0, "said": [missing], "mark": None})
    statements = notebook.needed(target, lab.notebook)
    if any(OWN.search(source) for _, source in statements):
        remarks.append(f"{task.key}: names the package's own Reference. Look at it by eye.")
    work = {"name": task.name, "kind": task.kind, "target": target, "statements": statements, "seed": seed}
    return report.Result(task, work=work | {"runs": task.runs})


def judge_all(people: list[report.Student], memory: Memory, limits: Limits, jobs: int, quiet: bool = False) -> str:
    """Give every task its verdict; returns what the walls were made of, as the last judge said."""
    waiting: queue.SimpleQueue[report.Result] = queue.SimpleQueue()
    open_tasks = [r for p in people for r in p.results.values() if r.verdict is None]
    for result in open_tasks:
        result.verdict = memory.recall(result.work)
    open_tasks = [r for r in open_tasks if r.verdict is None]
    for result in open_tasks:
        waiting.put(result)
    said: list[str] = []
    labs = sorted({r.task.lab for r in open_tasks})
    bar = tqdm(total=len(open_tasks), desc="Grading", unit="answer", disable=quiet or not open_tasks)

    def serve() -> None:
        with Bench(limits, labs) as bench:
            while True:
                try:
                    result = waiting.get_nowait()
                except queue.Empty:
                    break
                result.verdict = bench.verdict(result.work)
                memory.keep(result.work, result.verdict)
                bar.update()
            said.append(", ".join(bench.walls))

    threads = [threading.Thread(target=serve, daemon=True) for _ in range(min(jobs, len(open_tasks)))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    bar.close()
    return said[-1] if said else ""


def main(arguments: list[str] | None = None) -> int:
    """Grade, write, and say where."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("submissions", type=Path)
    parser.add_argument("--to", type=Path, help="the folder to write; SUBMISSIONS-graded by default")
    parser.add_argument("--labs", nargs="+", help="as in lab04; all by default")
    parser.add_argument("--jobs", type=int, default=min(os.cpu_count() or 1, 8), help="judges that work side by side")
    usual = Limits()
    for name, value in asdict(usual).items():
        unit = "MB" if isinstance(value, int) else "s"
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(value), default=value, help=f"{unit}; {value}")
    options = parser.parse_args(arguments)
    if not hasattr(os, "fork"):
        parser.error("this system cannot wall a process in; on Windows, grade in WSL or in the course's container")
    if not options.submissions.is_dir():
        parser.error(f"expected a folder of notebooks, got {options.submissions}")
    try:
        labs = course(options.labs)
    except ValueError as error:
        parser.error(str(error))
    limits = Limits(**{name: getattr(options, name) for name in asdict(usual)})
    folder = options.to or options.submissions.with_name(options.submissions.resolve().name + "-graded")
    memory = Memory(folder / ".judged", [asdict(limits)])
    people = collect(options.submissions, labs, memory.seed)
    if not people:
        parser.error(f"no notebook in {options.submissions}")
    walls = judge_all(people, memory, limits, options.jobs)
    tasks = [t for lab in labs.values() for t in lab.tasks if any(t.key in p.results for p in people)]
    report.write(folder, people, tasks, walls)
    print(f"{len(people)} students, {len(tasks)} tasks: {folder / 'marks.csv'}, {folder / 'report.html'}")
    if walls and "Landlock" not in walls:
        print(
            f"Only these walls held the students' code on this system: {walls}. See the page on grading.",
            file=sys.stderr,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
