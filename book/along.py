"""What a reader takes along: the book as one PDF, and the site as one ZIP that works from ``file://``.

    python book/along.py          into the built site, with links to both on its front page

Without a Chromium there is no PDF, and no link to one.  One commit gives one ZIP, byte for byte.
"""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
import edition
import pdf

ZIP = "where-am-i.zip"
FOLDER = "where-am-i"
PACKED = {".webp", ".png", ".pdf", ".woff2"}  # small already
LINKS = re.compile(r'(<div class="take-along">).*?(</div>)', re.DOTALL)


def link(site: Path, files: dict[str, str]) -> None:
    """Name these files of the site on its front page, with their sizes: name → what it is.

    Raises ValueError when the front page has no place for them.
    """
    front = site / "index.html"
    named = [
        f'<a href="{name}">{what}</a> ({(site / name).stat().st_size / 1e6:.0f} MB)' for name, what in files.items()
    ]
    before = front.read_text(encoding="utf-8")
    if not LINKS.search(before):
        raise ValueError(f'{front.name}: expected <div class="take-along">, found none')
    words = f"<p>Take it along: {' · '.join(named)}.</p>" if named else ""
    front.write_text(LINKS.sub(lambda found: found[1] + words + found[2], before, count=1), encoding="utf-8")


def pack(site: Path, path: Path) -> None:
    """The site as a ZIP, in one folder, in the order of names, dated as the commit is."""
    date = max(edition.date().timetuple()[:6], (1980, 1, 1, 0, 0, 0))
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(site.rglob("*")):
            if file.is_file() and file.name not in (ZIP, ".buildinfo"):
                entry = zipfile.ZipInfo(f"{FOLDER}/{file.relative_to(site).as_posix()}", date)
                entry.compress_type = zipfile.ZIP_STORED if file.suffix in PACKED else zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, file.read_bytes())


def main(site: Path = pdf.HTML) -> None:
    files = {}
    (site / pdf.NAME).unlink(missing_ok=True)
    if pdf.browser():
        pages = pdf.make(site, site / pdf.NAME)
        files = {pdf.NAME: f"the whole book as a PDF of {pages} pages"}
    else:
        print("No Chromium here, or not what drives it: the book goes without a PDF.", file=sys.stderr)
    link(site, files)  # as the ZIP has them
    pack(site, site.parent / ZIP)
    (site.parent / ZIP).replace(site / ZIP)
    link(site, files | {ZIP: "this site as a ZIP, to unpack and read without a network"})
    print(f"{', '.join(f'{name}: {(site / name).stat().st_size / 1e6:.1f} MB' for name in [*files, ZIP])}")


if __name__ == "__main__":
    main()
