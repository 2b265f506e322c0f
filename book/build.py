"""Build the book: run the labs, gather the sources, hand them to Sphinx.

    python book/build.py                     everything, into book/_build/html
    python book/build.py --only 03           while writing Lab 3: only that lab is run

Every warning is an error.  See ``execute`` for what is run again and when.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import sys
import time
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import nbformat
from joblib import cpu_count
from PIL import Image
from pybtex.database import BibliographyData, parse_file
from sphinx.cmd.build import main as sphinx

sys.path.insert(0, str(Path(__file__).parent))
import cover
from execute import ROOT, LabFailed, execute, read, recordings

BOOK = ROOT / "book"
BUILD = BOOK / "_build"
SOURCE = BUILD / "source"  # what Sphinx reads: the book's pages and the labs with their outputs
HTML = BUILD / "html"
# What a reader sees in place of a folded cell.
FOLDED = {"exercise-solution": "a solution", "check": "the check"}


def labs(only: list[str] | None = None) -> list[Path]:
    """The labs that exist, in order; with ``only``, those whose names begin so."""
    found = sorted((ROOT / "notebooks").glob("[0-9][0-9]_*.ipynb"))
    return [path for path in found if not only or path.name.startswith(tuple(only))]


def prepare(notebook: nbformat.NotebookNode, name: str) -> nbformat.NotebookNode:
    """A lab as a page: solutions and checks folded under a name of their own, links to the book's pages turned.

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
        for tag, name in FOLDED.items():
            if tag in cell.metadata.get("tags", []):
                cell.metadata.tags = [*cell.metadata.tags, "hide-cell"]
                prompts = {"code_prompt_show": f"Show {name}", "code_prompt_hide": f"Hide {name}"}
                cell.metadata.mystnb = {**prompts, **cell.metadata.get("mystnb", {})}
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


def bibliography(files: list[Path]) -> BibliographyData:
    """All entries of all files.  Raises ValueError when two files give one key to two sources."""
    merged = BibliographyData()
    for path in files:
        for name, entry in parse_file(path, "bibtex").entries.items():
            if name not in merged.entries:
                merged.add_entry(name, entry)
            elif merged.entries[name].fields.get("title") != entry.fields.get("title"):
                raise ValueError(f"{path.name}: the key {name!r} already names another source")
    return merged


def write_if_changed(path: Path, content: bytes) -> None:
    """Leave a file that is right alone: Sphinx reads again what is newer than its last build."""
    if not path.exists() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def gather(notebooks: dict[Path, nbformat.NotebookNode]) -> None:
    """Put all that Sphinx reads into one folder, and nothing else."""
    sources = {path.relative_to(BOOK): path.read_bytes() for path in BOOK.glob("*.md")}
    for path, notebook in notebooks.items():
        sources[Path("notebooks") / path.name] = nbformat.writes(prepare(notebook, path.name)).encode()
        if picture := thumbnail(notebook):
            sources[Path("images") / f"{path.stem}.webp"] = picture
    references = bibliography([BOOK / "references.bib", *sorted((BOOK / "references").glob("*.bib"))])
    sources[Path("references.bib")] = references.to_string("bibtex").encode()
    sources[Path("images/cover.html")] = cover.explorer().html().encode()
    for old in SOURCE.rglob("*"):
        if old.is_file() and old.relative_to(SOURCE) not in sources:
            old.unlink()
    for name, content in sources.items():
        write_if_changed(SOURCE / name, content)


def offer_clean_notebooks(notebooks: list[Path]) -> None:
    """What a reader downloads from a page is the lab as committed: without outputs."""
    for path in notebooks:
        shutil.copyfile(path, HTML / "_sources" / "notebooks" / path.name)


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
        gather({path: read(path) for path in labs()} | execute(chosen, options.jobs, BUILD / "executed", also=here))
    except LabFailed as failed:
        print(failed, file=sys.stderr)
        return 1
    strict = ["-W", "--keep-going", "-q"]
    status = sphinx([*strict, "-b", "html", "-c", str(BOOK), "-d", str(BUILD / "doctrees"), str(SOURCE), str(HTML)])
    if status == 0:
        remove_old_pages(labs())
        offer_clean_notebooks(labs())
        report()
        print(f"the book is in {os.path.relpath(HTML / 'index.html')} ({time.perf_counter() - began:.0f} s)")
    return status


if __name__ == "__main__":
    sys.exit(main())
