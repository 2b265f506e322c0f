"""Exercises that are answered on the page: their editors, and the Python that goes with them.

Under each exercise stands an editor with what a student gets, and a button that runs the package's own check in the
reader's browser.  Where the site has no Python to give (see ``tools/engine.py``), a link to the lab stands there.
"""

from __future__ import annotations

import ast
import html
import io
import re
import shutil
import sys
import zipfile
from functools import cache
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
import editions

ROOT = Path(__file__).resolve().parents[1]
OURS = ROOT / "book" / "python"  # the worker, its engine, and the part of SciPy that checks use
CHECK = re.compile(r"exercises\.check\(\s*[\"']([\w.]+)[\"'],\s*(\w+)\s*\)")
STAMP = (2020, 1, 1, 0, 0, 0)  # the same sources give the same archive
EDITOR = """\
<div class="answer-editor" hidden>
<label for="{id}">Your <code>{function}</code></label>
<textarea id="{id}" aria-describedby="{id}-help" wrap="off" spellcheck="false" autocapitalize="off" autocomplete="off">
{stub}</textarea>
<div class="answer-row">
<button type="button" class="answer-check">Check</button>
<button type="button" class="answer-stop" hidden>Stop</button>
<button type="button" class="answer-reset">Reset</button>
</div>
<div role="status"><p class="answer-state"></p><p class="answer-verdict" hidden></p></div>
<pre class="answer-printed" role="group" tabindex="0" aria-label="What your code printed" hidden></pre>
<p class="answer-help" id="{id}-help"><span>Tab indents, and Esc before Tab leaves the field. Ctrl+Enter checks.</span>
The lab's imports are there. The first check on a page fetches Python ({size:.0f} MB). Your code stays in this
browser.</p>
</div>
"""
OPEN = '<p class="answer-open"><a href="{url}" download>{words}</a></p>'


def imports(cells: list[nbformat.NotebookNode]) -> str:
    """The import statements of some code cells, each once."""
    found: dict[str, None] = {}
    for cell in cells:
        if cell.cell_type == "code":
            plain = re.sub(r"^[%!].*", "", cell.source, flags=re.MULTILINE)
            found |= {
                ast.unparse(s): None for s in ast.parse(plain).body if isinstance(s, (ast.Import, ast.ImportFrom))
            }
    return "\n".join(found)


def editor(name: str, function: str, stub: str, known: str, url: str, size: float | None) -> str:
    """What stands under an exercise, as HTML.

    name : the exercise's, as in "lab04.innovation".   function : what the answer has to define.
    stub : what the editor holds at first.   known : the lab's import statements.
    url : of the lab as a notebook.   size : of the Python that the site gives, in MB; None where it gives none.
    """
    if size is None:
        return (
            f'<div class="answer">{OPEN.format(url=url, words="Download this lab and answer it in JupyterLab")}</div>'
        )
    here = "answer-" + name.replace(".", "-")
    data = {"check": name, "function": function, "imports": known}
    attributes = " ".join(f'data-{key}="{html.escape(value)}"' for key, value in data.items())
    inside = EDITOR.format(id=here, function=function, stub=html.escape(stub), size=size)
    notebook = OPEN.format(url=url, words="Or download this lab for JupyterLab")
    return f'<div class="answer" {attributes}>\n{inside}{notebook}</div>'


def offer(notebook: nbformat.NotebookNode, name: str, size: float | None) -> None:
    """Put an editor above each solution that has a check.

    Raises ValueError when a solution can't be emptied.
    """
    url = f"../_sources/notebooks/{name}"
    for i in range(len(notebook.cells) - 1, 0, -1):
        asked, solution = CHECK.search(notebook.cells[i].source), notebook.cells[i - 1]
        if asked is None or editions.TAG not in solution.metadata.get("tags", []):
            continue
        known = imports(notebook.cells[: i - 1])
        body = editor(asked[1], asked[2], editions.empty(solution.source), known, url, size)
        cell = nbformat.v4.new_markdown_cell(
            f"```{{raw}} html\n{body}\n```", id=f"{solution.get('id', i)}-answer"[-64:]
        )
        notebook.cells.insert(i - 1, cell)


@cache
def checks() -> bytes:
    """The package, and the part of SciPy that its checks use, as the archive that a page's Python imports from."""
    sources = {path.relative_to(ROOT): path for path in sorted((ROOT / "coursekit").rglob("*.py"))}
    sources |= {path.relative_to(OURS): path for path in sorted(OURS.rglob("*.py"))}
    with zipfile.ZipFile(archive := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as files:
        for name, path in sources.items():
            files.writestr(zipfile.ZipInfo(name.as_posix(), STAMP), path.read_bytes(), zipfile.ZIP_DEFLATED)
    return archive.getvalue()


def megabytes(python: Path | None) -> float | None:
    """What a reader fetches at the first check; None without Python."""
    return None if python is None else (sum(p.stat().st_size for p in python.iterdir()) + len(checks())) / 1e6


def install(python: Path | None, site: Path) -> None:
    """Give the site its Python, and nothing that is left of an older one."""
    folder = site / "_static" / "python"
    if python is None:
        shutil.rmtree(folder, ignore_errors=True)
        return
    shutil.copytree(python, folder, dirs_exist_ok=True)
    for script in OURS.glob("*.js"):
        shutil.copy(script, folder)
    (folder / "checks.zip").write_bytes(checks())
