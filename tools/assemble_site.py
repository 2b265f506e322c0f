"""Put the published editions together: the newest at the root, each version's last in a folder of its own.

    python tools/assemble_site.py sites/site-v*.zip --to public

    public/             the newest edition
    public/v1.2/        the last of 1.2.0, 1.2.1, …; also for the newest, so that a page can be cited for good
    public/…/versions.json   in the root and in each folder: which edition this is, and which others there are

Each ZIP holds one site in one folder, as ``book/along.py`` makes it.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import zipfile
from pathlib import Path

LIMIT = 1_000_000_000  # bytes; what GitHub Pages takes


def version_of(archive: Path) -> tuple[int, int, int]:
    """(1, 2, 3) for ``site-v1.2.3.zip``.  Raises ValueError for another name."""
    if not (found := re.fullmatch(r"site-v(\d+)\.(\d+)\.(\d+)\.zip", archive.name)):
        raise ValueError(f"expected site-v1.2.3.zip, got {archive.name}")
    return int(found[1]), int(found[2]), int(found[3])


def latest(archives: list[Path]) -> dict[str, Path]:
    """The last archive of each minor version, ``v1.2`` → its path, the newest first."""
    newest_first = sorted(archives, key=version_of, reverse=True)
    chosen: dict[str, Path] = {}
    for archive in newest_first:
        chosen.setdefault("v{}.{}".format(*version_of(archive)), archive)
    return chosen


def unpack(archive: Path, folder: Path) -> None:
    """The site in the archive, without the one folder that it stands in there."""
    with zipfile.ZipFile(archive) as site:
        for name in site.namelist():
            inside = name.split("/", 1)[1]
            target = (folder / inside).resolve()
            if not inside or name.endswith("/"):
                continue
            if not target.is_relative_to(folder.resolve()):
                raise ValueError(f"{archive.name} holds {name}, which lies outside its folder")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(site.read(name))


def listing(here: str, root: str, names: list[str]) -> str:
    """What a page asks for: its own edition, the way to the root, all editions with the newest first."""
    versions = [{"name": name, "folder": "" if i == 0 else f"{name}/"} for i, name in enumerate(names)]
    return json.dumps({"here": here, "root": root, "versions": versions})


def assemble(archives: list[Path], to: Path) -> list[str]:
    """Write the whole of what is published; → the names of its editions, the newest first.

    Raises ValueError for no archive, for one of another name, and for more than can be published.
    """
    if not archives:
        raise ValueError("expected at least one site-v1.2.3.zip, got none")
    chosen = latest(archives)
    names = list(chosen)
    shutil.rmtree(to, ignore_errors=True)
    for name, archive in chosen.items():
        for folder, root in [(to / name, "../")] + ([(to, "./")] if name == names[0] else []):
            unpack(archive, folder)
            (folder / "versions.json").write_text(listing(name, root, names), encoding="utf-8")
    size = sum(path.stat().st_size for path in to.rglob("*") if path.is_file())
    if size > LIMIT:
        raise ValueError(f"{size / 1e9:.2f} GB, expected {LIMIT / 1e9:.0f} GB at most: leave out {names[-1]}")
    return names


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("archives", nargs="+", type=Path)
    parser.add_argument("--to", type=Path, required=True)
    options = parser.parse_args()
    try:
        print("editions: " + ", ".join(assemble(options.archives, options.to)))
    except ValueError as error:
        sys.exit(str(error))
