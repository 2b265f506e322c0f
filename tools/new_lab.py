"""Begin a new lab as a copy of another one, under names of its own: every check is green from the first minute.

    python tools/new_lab.py 10 loop_closing "Closing the loop"             a copy of Lab 7
    python tools/new_lab.py 10 loop_closing "Closing the loop" --like 08   of another

It writes the notebook, coursekit/labs/labNN, tests/labs/labNN, the teaching guide, a card on the book's front page and
the notation page.  Replace the copy piece by piece, and keep the checks green.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import symbols
from lab_text import ROOT, labs


def renamed(text: str, old: str, new: str) -> str:
    """A text of lab "09" as one of lab "10": names, seeds and labels; what the prose calls other labs stays."""
    text = text.replace(f"lab{old}", f"lab{new}").replace(f"lab_seed({int(old)})", f"lab_seed({int(new)})")
    text = re.sub(rf"\b(eq|ex|fig|sec)-(?:lab{int(old)}-|{old}-)?(?=[a-z])", rf"\1-lab{int(new)}-", text)
    return re.sub(rf"\bLab {int(old)}\b", f"Lab {int(new)}", text)


def begin(number: str, name: str, title: str, like: Path, root: Path = ROOT) -> list[Path]:
    """Write the copy; what was written.

    Raises ValueError for a number or a name that does not fit, FileExistsError when there is such a lab.
    """
    if not re.fullmatch(r"\d\d", number) or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise ValueError(f"expected two digits and a name in small letters, got {number!r} and {name!r}")
    if [*root.glob(f"notebooks/{number}_*.ipynb")]:
        raise FileExistsError(f"there is a lab {number} already")
    old = like.name[:2]
    notebook = root / "notebooks" / f"{number}_{name}.ipynb"
    heading = f"# Lab {int(number)}: "
    text = renamed(like.read_text("utf-8"), old, number)
    notebook.write_text(re.sub(rf"{heading}[^\"\\]*", heading + title, text, count=1), "utf-8")
    written = [notebook]
    for floor in ("coursekit/labs", "tests/labs"):
        here, there = root / floor / f"lab{old}", root / floor / f"lab{number}"
        shutil.copytree(here, there, ignore=shutil.ignore_patterns("__pycache__"))
        written += sorted(there.rglob("*.py"))
    guide = root / "book" / "teaching" / f"lab{number}.md"
    shutil.copy(root / "book" / "teaching" / f"lab{old}.md", guide)
    for path in [*written[1:], guide]:
        path.write_text(renamed(path.read_text("utf-8"), old, number), encoding="utf-8")
    guide.write_text(re.sub(r"^# .*", heading + title, guide.read_text("utf-8"), count=1), "utf-8")
    front = root / "book" / "index.md"
    cards = re.search(r"```\{lab-map\}\n(.*?)```", front.read_text("utf-8"), re.S)
    if not cards:
        raise ValueError(f"{front}: expected the cards of the labs in a {{lab-map}}")
    with_card = front.read_text("utf-8").replace(cards[1], f"{cards[1]}{notebook.stem}: {title}.\n")
    front.write_text(with_card, encoding="utf-8")
    return [*written, guide, front]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("number", help="two digits")
    parser.add_argument("name", help="in small letters, as in loop_closing")
    parser.add_argument("title")
    parser.add_argument("--like", default="07", help="the number of the lab to copy")
    options = parser.parse_args(arguments)
    known = {path.name[:2]: path for path in labs() if path.name[2] == "_"}
    try:
        like = known[options.like]
        written = begin(options.number, options.name, options.title, like)
    except (KeyError, ValueError, FileExistsError) as error:
        print(f"No lab is begun: {error}", file=sys.stderr)
        return 1
    print(*(path.relative_to(ROOT) for path in written), sep="\n")
    return symbols.main(["--write"])


if __name__ == "__main__":
    sys.exit(main())
