"""One archive for a class that gets no answers: notebooks, the package with its data, the lock, the book to read.

    python tools/handout.py                 dist/where-am-i-<version>.zip, with the book as it was built last
    python tools/handout.py --without-book  the same without the book
    python tools/handout.py --to elsewhere

Solutions are cut out of the book's pages, the solved labs are left behind, and the archive is searched before it is
kept: a line of a solution that stands nowhere else is found in it, and nothing is written.
"""

from __future__ import annotations

import argparse
import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
import editions

from coursekit import __version__

ROOT = Path(__file__).resolve().parents[1]
BOOK = ROOT / "book" / "_build" / "html"
README = ROOT / "book" / "teaching" / "handout_readme.md"
TELLING = 40  # letters of a line, blanks left out, by which one would know a solution
READABLE = {".html", ".ipynb", ".js", ".json", ".md", ".txt"}
# What else a page needs.  A PDF or a ZIP of the book would hold its solutions.
DRAWN = {".css", ".gif", ".ico", ".jpg", ".png", ".svg", ".ttf", ".webp", ".woff", ".woff2"}
# What the wheel is made of.
SOURCES = ("coursekit", "data", "pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "LICENSE-TEXT")


def masters() -> list[Path]:
    """The labs, in order."""
    return sorted((ROOT / "notebooks").glob("[0-9][0-9]*_*.ipynb"))


def build_wheel(folder: Path) -> Path:
    """Build the package's wheel from a clean copy of its sources."""
    with tempfile.TemporaryDirectory() as copy:
        for name in SOURCES:
            here, there = ROOT / name, Path(copy, name)
            if here.is_dir():
                shutil.copytree(here, there, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(here, there)
        program = "import sys; from setuptools.build_meta import build_wheel; build_wheel(sys.argv[1])"
        made = subprocess.run(
            [sys.executable, "-c", program, str(folder.resolve())], cwd=copy, capture_output=True, text=True
        )
    if made.returncode:
        raise RuntimeError(f"the wheel could not be built: {made.stderr.strip()[-2000:]}")
    (wheel,) = folder.glob("coursekit-*.whl")
    return wheel


def lab(path: Path) -> nbformat.NotebookNode:
    """A lab for a class without answers: the student edition, without its pointers to the solved labs."""
    edition = editions.student(nbformat.read(path, as_version=4))
    edition.cells = [cell for cell in edition.cells if cell.source != editions.STUCK]
    for cell in edition.cells:
        if cell.cell_type == "markdown":
            cell.source = re.sub(r"\]\(\.\./book/(\w+)\.md", r"](../book/\1.html", cell.source)
    return edition


def without_solutions(page: str) -> str:
    """A page of the book without its solutions, what their checks said, and the link to the solved lab.

    Raises ValueError for a cell of the page that does not end.
    """
    for cell in reversed([*re.finditer(r'<div class="cell [^"]*\btag_(exercise-solution|check)\b[^"]*">', page)]):
        end = _end_of_div(page, cell.start())
        said = _words(page[cell.start() : end])
        if cell[1] == "exercise-solution" or "exercises.check(" in said or "exercises.score(" in said:
            page = page[: cell.start()] + page[end:]
    page = re.sub(r'<div class="take-along">.*?</div>', "", page, flags=re.S)
    return re.sub(r'<li><a href="[^"]*\.solved\.ipynb".*?</li>', "", page, flags=re.S)


def _end_of_div(page: str, start: int) -> int:
    depth = 0
    for tag in re.finditer(r"<(/?)div\b", page[start:]):
        depth += -1 if tag[1] else 1
        if depth == 0:
            return page.index(">", start + tag.start()) + 1
    raise ValueError(f"expected </div> for {page[start : start + 80]!r}")


def _words(text: str) -> str:
    """What a page says, without tags and blanks."""
    return re.sub(r"\s+", "", html.unescape(re.sub(r"<[^>]+>", "", text)))


def telling_lines() -> dict[str, str]:
    """The lines by which one would know a solution → their labs: long, and not elsewhere in a lab or in the package."""
    inside: dict[str, str] = {}
    outside = [_words_of_code(path.read_text("utf-8")) for path in (ROOT / "coursekit").rglob("*.py")]
    for path in masters():
        for cell in nbformat.read(path, as_version=4).cells:
            lines, kept = editions.lines_of(cell.source), set(range(len(cell.source.splitlines())))
            if cell.cell_type == "code":
                for first, last in editions.solutions(lines):
                    kept -= set(range(first, last + 1))
                    inside |= {_words_of_code(line): path.stem for line in lines[first + 1 : last]}
            outside.append("\n".join(_words_of_code(lines[i]) for i in sorted(kept)))
    known = "\n".join(outside)
    return {line: name for line, name in inside.items() if len(line) >= TELLING and line not in known}


def _words_of_code(source: str) -> str:
    return "\n".join(re.sub(r"\s+", "", line.split("  #")[0]) for line in source.splitlines())


def leaks(folder: Path) -> Iterator[str]:
    """Each line of a solution that stands in a readable file of a folder, as a sentence."""
    secret = telling_lines()
    for path in sorted(folder.rglob("*")):
        if path.suffix not in READABLE:
            continue
        text = path.read_text(encoding="utf-8", errors="replace")
        if path.suffix == ".ipynb":
            text = "\n".join("".join(cell["source"]) for cell in json.loads(text)["cells"])
            said = re.sub(r"\s+", "", text)
        else:
            said = _words(text) if path.suffix == ".html" else re.sub(r"\s+", "", text)
        for line, name in secret.items():
            if line in said:
                yield f"{path.relative_to(folder)} holds a line of a solution of {name}: {line[:60]}…"


def _not_for_a_class(folder: str, names: list[str]) -> list[str]:
    """The files of the book that stay behind."""
    files = [name for name in names if not Path(folder, name).is_dir()]
    return [name for name in files if name.endswith(".solved.ipynb") or Path(name).suffix not in READABLE | DRAWN]


def gather(folder: Path, book: Path | None) -> None:
    """Put everything into a folder.  Raises FileNotFoundError without a built book, ValueError for a leak."""
    (folder / "labs").mkdir(parents=True)
    for path in masters():
        nbformat.write(lab(path), folder / "labs" / path.name)
    wheel = build_wheel(folder)
    shutil.copy(ROOT / "requirements.lock", folder)
    if book:
        if not (book / "index.html").exists():
            raise FileNotFoundError(
                f"{book}: the book is not built; `make book` builds it, --without-book goes without"
            )
        shutil.copytree(book, folder / "book", ignore=_not_for_a_class)
        for path in masters():
            nbformat.write(lab(path), folder / "book" / "_sources" / "notebooks" / path.name)
        for page in (folder / "book").rglob("*.html"):
            page.write_text(without_solutions(page.read_text("utf-8")), encoding="utf-8")
    words = {"version": __version__, "wheel": wheel.name, "no_book": "" if book else " (not in this archive)"}
    (folder / "README.md").write_text(README.read_text("utf-8").format(**words), encoding="utf-8")
    if found := [*leaks(folder)]:
        raise ValueError("\n".join(found))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--without-book", action="store_true", help="leave the book out")
    parser.add_argument("--to", type=Path, default=ROOT / "dist", help="the folder to write")
    options = parser.parse_args(arguments)
    options.to.mkdir(parents=True, exist_ok=True)
    name = f"where-am-i-{__version__}"
    with tempfile.TemporaryDirectory() as folder:
        try:
            gather(Path(folder, name), None if options.without_book else BOOK)
        except (FileNotFoundError, ValueError) as error:
            print(f"No archive is written: {error}", file=sys.stderr)
            return 1
        made = Path(shutil.make_archive(str(options.to / name), "zip", folder, name))
    print(f"{made.name}, {made.stat().st_size / 1e6:.1f} MB, is in {options.to}.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
