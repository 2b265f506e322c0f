"""Questions that a lab asks and does not answer.

A question in *A picture and a question*, in *Play first*, at a checkpoint or in an exercise's text has an answer that
unfolds: a ``{dropdown}`` in the same cell after it, or in a later one before the next such question's cell.  An
answer's title begins with "Answer" or "What you should have seen".  A ``guess(`` cell answers as well.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from lab_text import FENCE, labs, parts

PARTS = ("a picture and a question", "play first", "exercises", "project")
ANSWER = re.compile(r"^(`{3,}|:{3,})\{dropdown\} *(Answer|What you should have seen)", re.M)


def asks(source: str) -> bool:
    """Does a cell ask, in what stands open?"""
    open_text = FENCE.sub(lambda m: "" if m["kind"] == "dropdown" else m[0], source)
    open_text = re.sub(r"\$\$.*?\$\$|\$[^$]*\$|`[^`]*`|\"[^\"]*\"|“[^”]*”", "", open_text, flags=re.S)
    return "?" in open_text


def unanswered(path: Path) -> list[str]:
    """The first words of each cell whose question nothing answers."""
    left: list[str] = []
    for part in parts(path):
        pending: str | None = None
        for cell in part.cells:
            if cell.cell_type == "code" and re.search(r"\bguess\(", cell.source):
                pending = None
            if cell.cell_type != "markdown":
                continue
            counts = part.heading.lower().startswith(PARTS) or re.search(r"^#+ Checkpoint", cell.source, re.M)
            if counts and asks(cell.source):
                if pending:
                    left.append(pending)
                pending = " ".join(re.sub(r"^[`:#].*$", "", cell.source, flags=re.M).split()[:12])
            if ANSWER.search(cell.source):
                pending = None
        if pending:
            left.append(pending)
    return left


def main() -> int:
    """Print them; 1 when there are any."""
    found = {path.name: left for path in labs() if (left := unanswered(path))}
    for name, left in found.items():
        print(name, *left, sep="\n    ")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
