"""The book's reference pages that are made, not written: API, failures, formulas, the course's map, speed."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from reference import api, course_map, formulas, gallery, speed


def pages(notebooks: Iterable[Path], cache: Path) -> dict[Path, bytes]:
    """Every page and picture by its place among the book's sources.

    notebooks : the labs that are in the book; what names another lab is left out.     cache : for pictures.
    """
    labs = sorted(notebooks)
    made: dict[str, str | bytes] = {}
    for room in (api.pages, formulas.pages, course_map.pages):
        made |= room(labs)
    made |= gallery.pages(labs, cache)
    made |= speed.pages()
    return {Path(name): page.encode() if isinstance(page, str) else page for name, page in made.items()}
