"""A site with one lab's exercises, and a Python for it that npm can give: CPython 3.11 and NumPy 1.24 as WebAssembly.

The pages, their script and the worker are the book's own.  Only ``engine.js`` differs: here it is
``python/engine.mjs``, joined with the package python-wasm into one file.
"""

import ast
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from contextlib import suppress
from pathlib import Path

import nbformat
import pooch

sys.path.insert(0, str(Path(__file__).parents[2] / "book"))
import answers

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent / "python"
# What CoWasm's modules ask of Node, by the packages that give it to a browser.
ALIASES = ["path=path-browserify", "stream=stream-browserify"]
POLICY = '<meta http-equiv="Content-Security-Policy" content="default-src \'self\'">'
# Stands where an answer imports what a page has not.
ABSENT = """
class Absent:
    def __init__(self, name):
        self.name = name

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Absent(f"{self.name}.{name}")

    def __call__(self, *_, **__):
        raise ModuleNotFoundError(f"no {self.name}")
"""
PACKAGES = ["python-wasm/dist/python.wasm", "python-wasm/dist/python-stdlib.zip", "python-wasm/dist/numpy.tar.xz"]
PACKAGES += ["@cowasm/kernel/dist/kernel/kernel.wasm"]


def engine():
    """The folder with the test bed's engine, made once and kept in the user's cache; None without npm."""
    npm = shutil.which("npm")
    sources = [path.read_bytes() for path in sorted(HERE.iterdir())]
    digest = hashlib.sha256(b"\0".join(sources)).hexdigest()[:12]
    kept = Path(pooch.os_cache("coursekit")) / f"test-bed-{digest}"
    if kept.exists() or npm is None:
        return kept if kept.exists() else None
    kept.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=kept.parent))
    for source in HERE.iterdir():
        shutil.copy(source, work)
    # Each archive has to have the digest of package-lock.json; no package's own script is run.
    install = [npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund"]
    subprocess.run(install, cwd=work, check=True, capture_output=True, timeout=300)
    bundle = ["node_modules/.bin/esbuild", "engine.mjs", "--bundle", "--format=esm", "--platform=browser"]
    bundle += [
        "--outfile=made/engine.js",
        "--log-level=error",
        *(f"--alias:{alias}" for alias in ALIASES),
        '--define:__dirname="/"',
    ]
    subprocess.run(bundle, cwd=work, check=True, timeout=60)
    for name in PACKAGES:
        shutil.copy(work / "node_modules" / name, work / "made")
    with suppress(OSError):  # another run was quicker
        os.rename(work / "made", kept)
    shutil.rmtree(work)
    return kept


def page(lab, python=12.0):
    """A lab's exercises as the book shows them, without the lab around them."""
    notebook = nbformat.read(ROOT / "notebooks" / lab, as_version=4)
    answers.offer(notebook, lab, python)
    cells = "".join(
        c.source[len("```{raw} html\n") : -len("```")] for c in notebook.cells if "```{raw} html" in c.source
    )
    return (
        '<!doctype html><html lang="en" data-theme="light"><meta charset="utf-8"><title>Exercises</title>'
        '<meta name="viewport" content="width=device-width">'
        f"{POLICY}"
        '<link rel="stylesheet" href="../_static/answers.css"><link rel="icon" href="../_static/logo.svg">'
        f'<main>{cells}</main><script src="../_static/answers.js" defer></script></html>'
    )


def site(folder, lab):
    """Write the site; returns the address of its page below ``folder``."""
    static = folder / "_static"
    answers.install(engine(), folder)
    for name in ("answers.css", "answers.js", "logo.svg"):
        shutil.copy(ROOT / "book" / "_static" / name, static)
    shutil.copy(engine() / "engine.js", static / "python")  # in place of the book's own
    (static / "python" / "checks.zip").write_bytes(with_answers(answers.checks()))
    (folder / "notebooks").mkdir()
    (folder / "notebooks" / "lab.html").write_text(page(lab), encoding="utf-8")
    return "notebooks/lab.html"


def with_answers(checks):
    """The archive of the checks, and the tests' lists of right and wrong answers with it."""
    archive = io.BytesIO(checks)
    with zipfile.ZipFile(archive, "a", zipfile.ZIP_DEFLATED) as files:
        for package in ("tests", "tests/labs"):
            files.writestr(f"{package}/__init__.py", "")
        files.write(ROOT / "tests" / "labs" / "answers.py", "tests/labs/answers.py")
        for path in sorted((ROOT / "tests" / "labs").glob("lab*/answers.py")):
            files.writestr(f"tests/labs/{path.parent.name}/__init__.py", "")
            files.writestr(f"tests/labs/{path.parent.name}/answers.py", without(path.read_text(encoding="utf-8")))
    return archive.getvalue()


def without(source):
    """Answers whose functions stop, where they come from a module that a page has not, as they would stop there."""
    made = source
    for statement in ast.parse(source).body:
        if isinstance(statement, ast.ImportFrom):
            absent = [a.name for a in statement.names if not _on_a_page(statement.module, a.name)]
            present = [a.name for a in statement.names if a.name not in absent]
            lines = [f"from {statement.module} import {', '.join(present)}"] if present else []
            lines += [f"{name} = Absent({f'{statement.module}.{name}'!r})" for name in absent]
            if absent:
                made = made.replace(ast.get_source_segment(source, statement), "\n".join(lines))
    return f"{ABSENT}\n{made}"


def _on_a_page(module, name):
    if not module.startswith("scipy"):
        return (module, name) != ("coursekit", "visual")  # OpenCV stays at home
    path = ROOT / "book" / "python" / Path(*module.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return path.exists() and re.search(rf"^(def {name}\(|{name} =)", path.read_text(encoding="utf-8"), re.M)
