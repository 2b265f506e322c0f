"""Build the book: run the labs, gather the sources, hand them to Sphinx.

    python book/build.py                     everything, into book/_build/html
    python book/build.py --only 03           while writing Lab 3: only that lab is run

Every warning is an error.  See ``execute`` for what is run again and when.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import time
from base64 import b64decode
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import nbformat
from joblib import cpu_count
from PIL import Image
from sphinx.cmd.build import main as sphinx

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
sys.path.insert(0, str(Path(__file__).parent))
import answers
import cover
import edition
import finish
import reference
from conf import MATHJAX
from execute import ROOT, LabFailed, execute, read, recordings

sys.path.insert(0, str(ROOT / "tools"))
import assemble_site
import citations
import editions
import engine

BOOK = ROOT / "book"
BUILD = BOOK / "_build"
SOURCE = BUILD / "source"  # what Sphinx reads: the book's pages and the labs with their outputs
HTML = BUILD / "html"
# The first cell of a lab that a reader downloads, or opens on Colab or a hub.
FETCH = """# Where the course is not installed, this fetches it and installs what it needs, as locked.
import importlib.util
from pathlib import Path

if importlib.util.find_spec("coursekit") is None:
    if not Path("where-am-i").exists():
        !git clone --quiet --depth 1 --branch {ref} {repository} where-am-i
    %run where-am-i/tools/install_here.py"""
# What a reader sees in place of a folded cell.
FOLDED = {"exercise-solution": "a solution", "check": "the check"}


def labs(only: list[str] | None = None) -> list[Path]:
    """The labs that exist, in order; with ``only``, those whose names begin so."""
    found = sorted((ROOT / "notebooks").glob("[0-9][0-9]*_*.ipynb"))
    return [path for path in found if not only or path.name.startswith(tuple(only))]


def prepare(notebook: nbformat.NotebookNode, name: str, python: float | None = None) -> nbformat.NotebookNode:
    """A lab as a page: solutions and checks folded under a name of their own, links to the book's pages turned.

    python : the MB of the Python that the site gives for exercises; None where it gives none.

    Raises ``LabFailed`` when a cell shows a picture and has no text alternative for it.
    """
    for i, cell in enumerate(notebook.cells, 1):
        shows = any("image/png" in output.get("data", {}) for output in cell.get("outputs", []))
        if shows and not cell.metadata.get("mystnb", {}).get("image", {}).get("alt"):
            raise LabFailed(
                f'{name}, cell {i} shows a picture without words: set {{"mystnb": {{"image": {{"alt": "…"}}}}}}'
            )
        if cell.cell_type == "markdown":
            cell.source = cell.source.replace("](../book/", "](../")
        for tag, fold in FOLDED.items():
            if tag in cell.metadata.get("tags", []):
                cell.metadata.tags = [*cell.metadata.tags, "hide-cell"]
                prompts = {"code_prompt_show": f"Show {fold}", "code_prompt_hide": f"Hide {fold}"}
                cell.metadata.mystnb = {**prompts, **cell.metadata.get("mystnb", {})}
    answers.offer(notebook, name, python)
    return notebook


def thumbnail(notebook: nbformat.NotebookNode) -> bytes | None:
    """A lab's first picture, small, for its card on the front page; None for a lab that has not been run."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                picture = Image.open(BytesIO(b64decode(output.data["image/png"]))).convert("RGB")
                picture.thumbnail((560, 420))
                picture.save(small := BytesIO(), "WEBP", quality=80)
                return small.getvalue()
    return None


def write_if_changed(path: Path, content: bytes) -> None:
    """Leave a file that is right alone: Sphinx reads again what is newer than its last build."""
    if not path.exists() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def _link_labs(page: Path, notebooks: Iterable[Path]) -> str:
    """A page with its links to labs as they are in the book's own folder; a lab that is not there is not linked."""
    names = {path.name for path in notebooks}

    def link(found: re.Match[str]) -> str:
        return f"[{found[1]}](notebooks/{found[2]})" if found[2] in names else found[1]

    return re.sub(r"\[([^\]]+)\]\(\.\./notebooks/([^)]+)\)", link, page.read_text(encoding="utf-8"))


def gather(notebooks: dict[Path, nbformat.NotebookNode], python: Path | None = None) -> None:
    """Put all that Sphinx reads into one folder, and nothing else; ``python`` is what pages run answers with."""
    size = answers.megabytes(python)
    sources = {path.relative_to(BOOK): _link_labs(path, notebooks).encode() for path in BOOK.glob("*.md")}
    for path, notebook in notebooks.items():
        sources[Path("notebooks") / path.name] = nbformat.writes(prepare(notebook, path.name, size)).encode()
        if picture := thumbnail(notebook):
            sources[Path("images") / f"{path.stem}.webp"] = picture
    references = citations.bibliography(citations.files())
    sources[Path("references.bib")] = references.to_string("bibtex").encode()
    sources |= reference.pages(notebooks, BUILD / "pictures")
    sources[Path("images/cover.html")] = cover.explorer().html().encode()
    for old in SOURCE.rglob("*"):
        if old.is_file() and old.relative_to(SOURCE) not in sources:
            old.unlink()
    for name, content in sources.items():
        write_if_changed(SOURCE / name, content)


def offer_editions(notebooks: list[Path]) -> None:
    """What a reader downloads from a page: the lab to fill in, and the solved one.

    Raises ValueError for a lab whose solutions can't be emptied.
    """
    folder = HTML / "_sources" / "notebooks"
    for path in notebooks:
        lab = nbformat.read(path, as_version=4)
        nbformat.write(alone(editions.student(lab)), folder / path.name)
        nbformat.write(alone(editions.solved(lab)), folder / f"{path.stem}.solved.ipynb")


def alone(lab: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """A lab far from its repository: it fetches the course where that is missing, and its links lead to the site.

    Unchanged where nobody said where the repository is.
    """
    if not (repository := edition.repository()):
        return lab
    for cell in lab.cells:
        if cell.cell_type == "markdown":
            cell.source = re.sub(r"\]\(\.\./book/(\w+)\.md", rf"]({edition.site()}\1.html", cell.source)
    fetch = FETCH.format(repository=repository, ref=edition.ref())
    lab.cells.insert(0, nbformat.v4.new_code_cell(fetch, id="fetch-the-course"))
    return lab


def name_edition() -> None:
    """Put version and commit into each page's foot, and write the list of editions, of which this is the only one.

    Not by Sphinx, which would write every page anew after each commit; ``tools/assemble_site.py`` lists several.
    """
    for page in HTML.rglob("*.html"):
        foot = f'<p class="edition">{edition.words()}.</p>'
        text = page.read_text(encoding="utf-8")
        write_if_changed(page, re.sub(r'<p class="edition">[^<]*</p>', foot, text).encode())
    name = "v" + ".".join(edition.version().split(".")[:2])
    (HTML / "versions.json").write_text(assemble_site.listing(name, "./", [name]), encoding="utf-8")


def remove_old_pages(notebooks: list[Path]) -> None:
    """A lab that was renamed or removed leaves no page behind."""
    for page in (HTML / "notebooks").glob("*.html"):
        if page.stem not in {path.stem for path in notebooks}:
            page.unlink()


def report() -> None:
    """Say what a reader has to fetch."""
    for page in sorted(HTML.glob("notebooks/*.html")):
        text = page.read_text(encoding="utf-8")
        frames = set(re.findall(r"_static/explorers/(\w+\.webp)", text))
        size = sum((HTML / "_static" / "explorers" / name).stat().st_size for name in frames)
        print(f"  {page.stem}: page {page.stat().st_size / 1e3:.0f} kB, {len(frames)} frames {size / 1e6:.1f} MB")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="NN", help="run only these labs")
    parser.add_argument("--jobs", type=int, default=cpu_count(), help="labs to run at a time")
    options = parser.parse_args(arguments)
    began = time.perf_counter()
    chosen = labs(options.only)
    here, missing = recordings()
    for why in missing:
        print(f"The labs go without a recording, and say so.  {why}", file=sys.stderr)
    if missing and os.environ.get("CI"):
        return 1  # what is published shows everything
    try:
        # A lab that was not asked for is there as it is written, so that links to it lead somewhere.
        pages = {path: read(path) for path in labs()}
        python = engine.fetch()
        gather(pages | execute(chosen, options.jobs, BUILD / "executed", also=here), python)
    except LabFailed as failed:
        print(failed, file=sys.stderr)
        return 1
    strict = ["-W", "--keep-going", "-q"]
    status = sphinx([*strict, "-b", "html", "-c", str(BOOK), "-d", str(BUILD / "doctrees"), str(SOURCE), str(HTML)])
    if status == 0:
        remove_old_pages(labs())
        offer_editions(labs())
        answers.install(python, HTML)
        finish.finish(HTML, MATHJAX.parent)
        name_edition()
        report()
        print(f"the book is in {os.path.relpath(HTML / 'index.html')} ({time.perf_counter() - began:.0f} s)")
    return status


if __name__ == "__main__":
    sys.exit(main())
