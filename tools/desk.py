"""Put the labs on the learner's desk: copies to write in, which nothing here ever overwrites.

    python tools/desk.py                    the labs with their solutions emptied, into my_labs/
    python tools/desk.py solved             the labs with their solutions, into my_labs/solved/
    python tools/desk.py --to elsewhere     into another folder

A copy that nobody has changed follows its lab.  Beside one that has been changed, a newer lab is put under a name of
its own: 03_noise_model.new.ipynb.  What was written here is remembered in .desk.json, by the text of the cells: an
editor changes outputs and metadata when it saves, and that is no change.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import tempfile
from pathlib import Path

import nbformat

sys.path.insert(0, str(Path(__file__).parent))
import editions

ROOT = Path(__file__).resolve().parents[1]
MASTERS = ROOT / "notebooks"
DESK = ROOT / "my_labs"
SOLVED = DESK / "solved"
EDITIONS = {"student": (editions.student, DESK), "solved": (editions.solved, SOLVED)}
RECORD = ".desk.json"


def digest(notebook: nbformat.NotebookNode) -> str:
    """A fingerprint of what the cells say; empty cells, outputs, metadata and line endings do not count."""
    said = [(c.cell_type, "\n".join(editions.lines_of(c.source)).strip()) for c in notebook.cells]
    return hashlib.sha256(json.dumps([cell for cell in said if cell[1]]).encode()).hexdigest()


def digest_of(path: Path) -> str | None:
    """The fingerprint of a file; None for one that is no readable notebook."""
    try:
        return digest(nbformat.read(path, as_version=4))
    except Exception:  # whatever is in a learner's file, it is kept
        return None


class Desk:
    """A folder of copies, and the fingerprints of all that was ever put into it: name of a lab → fingerprints."""

    def __init__(self, folder: Path, masters: list[Path]):
        _refuse_sources(folder, masters)
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        try:
            self.written = {name: list(d) for name, d in json.loads((folder / RECORD).read_text("utf-8")).items()}
        except FileNotFoundError:
            self.written = {}
        except (ValueError, AttributeError, TypeError):
            print(f"{shown(folder / RECORD)} can't be read: every copy counts as changed by you.", file=sys.stderr)
            self.written = {}

    def place(self, name: str, edition: nbformat.NotebookNode) -> str:
        """Bring a lab onto the desk.  What happened: "new", "updated", "kept", or a sentence for the learner."""
        path, fresh = self.folder / name, digest(edition)
        known = self.written.setdefault(name, [])
        if not os.path.lexists(path):
            self._write(path, name, edition, fresh)
            return "new"
        found = digest_of(path)
        if found == fresh:
            if fresh not in known:
                self._remember(name, fresh)
            return "kept"
        if found in known:
            self._write(path, name, edition, fresh)
            return "updated"
        if fresh in known:  # this edition was here before: the learner has begun, or has seen it beside
            return "kept" if found else f"{shown(path)} can't be read as a notebook: rename it, and you get a new copy."
        beside = self._beside(path, [*known, fresh])
        self._write(beside, name, edition, fresh)
        why = "the lab has changed, and so have you changed your copy" if found else "it can't be read as a notebook"
        return f"{shown(path)}: {why}.  Yours is left as it is; the lab of today is in {beside.name}."

    def _beside(self, path: Path, known: list[str]) -> Path:
        """The first name beside a copy that is free, or holds an earlier offer that nobody has changed."""
        number = 1
        while True:
            beside = path.with_suffix(f".new{number if number > 1 else ''}.ipynb")
            if not os.path.lexists(beside) or digest_of(beside) in known:
                return beside
            number += 1

    def _write(self, path: Path, name: str, edition: nbformat.NotebookNode, fresh: str) -> None:
        # The copy first: a copy that the record does not know, but that equals its lab, is recognised.
        replace(path, nbformat.writes(edition) + "\n")
        self._remember(name, fresh)

    def _remember(self, name: str, fresh: str) -> None:
        self.written[name] = [*self.written.get(name, []), fresh]
        replace(self.folder / RECORD, json.dumps(self.written, indent=1) + "\n")


def replace(path: Path, text: str) -> None:
    """Write a file whole or not at all, and never through a link to somewhere else."""
    handle, draft = tempfile.mkstemp(prefix=".", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        os.chmod(draft, 0o644)
        os.replace(draft, path)
    except BaseException:
        os.unlink(draft)
        raise


def _refuse_sources(folder: Path, masters: list[Path]) -> None:
    """Raises ValueError for the labs' own folder, a folder in it, and any folder that holds the labs."""
    folder = folder.resolve()
    inside = [folder, *folder.parents]
    holding = [parent for master in masters for parent in master.resolve().parents]
    if any(_same(MASTERS, f) for f in inside) or any(_same(folder, parent) for parent in holding):
        raise ValueError(f"expected a folder of your own, got {folder}, where the labs themselves are")


def _same(a: Path, b: Path) -> bool:
    return a == b or (a.exists() and b.exists() and os.path.samefile(a, b))


def shown(path: Path) -> str:
    """A path as one would type it here."""
    try:
        return Path(os.path.relpath(path)).as_posix()
    except ValueError:  # another drive
        return str(path)


def way_to_the_book(folder: Path) -> str:
    """The link from a folder of copies to the book's pages."""
    try:
        return Path(os.path.relpath(ROOT / "book", folder.resolve())).as_posix()
    except ValueError:
        return (ROOT / "book").as_uri()


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("edition", nargs="?", choices=EDITIONS, default="student")
    parser.add_argument("--to", type=Path, help="the folder to write")
    parser.add_argument("--labs", nargs="+", type=Path, help="these notebooks; all labs by default")
    options = parser.parse_args(arguments)
    make, usual = EDITIONS[options.edition]
    folder = options.to or usual
    masters = options.labs or sorted(MASTERS.glob("[0-9][0-9]*_*.ipynb"))
    happened, failed = [], False
    try:
        desk = Desk(folder, masters)
        for master in masters:
            try:
                edition = make(nbformat.read(master, as_version=4), way_to_the_book(folder))
            except (ValueError, nbformat.reader.NotJSONError) as error:
                print(f"{master.name}, {error}", file=sys.stderr)
                failed = True
                continue
            happened.append(desk.place(master.name, edition))
    except (OSError, ValueError) as error:
        print(f"Nothing more is written to {shown(folder)}: {error}", file=sys.stderr)
        return 1
    for sentence in happened:
        if sentence not in {"new", "updated", "kept"}:
            print(sentence)
    counts = {word: happened.count(word) for word in ("new", "updated") if word in happened}
    news = f" ({', '.join(f'{n} {word}' for word, n in counts.items())})" if counts else ""
    if options.edition == "solved":
        print(f"Solved labs: {shown(folder)}/{news}.")
    else:
        print(f"Your copies of the labs: {shown(folder)}/{news}.  What you write there is never overwritten.")
        print(f"Stuck?  `make solved` (python tools/desk.py solved) puts solved labs into {shown(SOLVED)}/.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
