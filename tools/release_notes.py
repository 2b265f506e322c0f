"""What the changelog says of a release, and whether everything agrees that it is this one.

python tools/release_notes.py v0.1.0
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def notes(changelog: str, version: str) -> str:
    """The section of one version, without its heading.

    Raises ValueError when the version has no section, or one without a date.
    """
    section = re.search(rf"^## \[{re.escape(version)}\] - (\S+)\n(.*?)(?=^## |\Z)", changelog, re.M | re.S)
    if not section or not re.fullmatch(r"\d{4}-\d{2}-\d{2}", section[1]):
        raise ValueError(f"CHANGELOG.md has no dated section '## [{version}] - YYYY-MM-DD'")
    return section[2].strip() + "\n"


def disagreements(version: str) -> list[str]:
    """The files that name another version."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    citation = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.M)
    named = {"pyproject.toml": project, "CITATION.cff": citation and citation[1]}
    return [f"{file} says {other}" for file, other in named.items() if other != version]


if __name__ == "__main__":
    tag = sys.argv[1].removeprefix("v")
    if wrong := disagreements(tag):
        sys.exit(f"The tag says {tag}, but " + ", ".join(wrong))
    try:
        print(notes((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), tag), end="")
    except ValueError as error:
        sys.exit(str(error))
