"""Which edition of the book this is: version, commit, date, and where its repository and its site are.

The repository's address stands in ``pyproject.toml``, under ``[project.urls]``, as ``repository``; on a forge's runner
that says which it works for, it need not.  Without an address every link that needs one is left out.
"""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


@cache
def _project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def _git(*words: str) -> str:
    """What git says of the checkout; nothing where there is neither."""
    try:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def version() -> str:
    """The version in pyproject.toml, ``0.1.0``."""
    return _project()["version"]


@cache
def commit() -> str:
    """The commit's first ten digits; nothing outside a checkout."""
    return _git("rev-parse", "--short=10", "HEAD")


@cache
def date() -> datetime:
    """The date of the commit, in UTC, or the one that ``SOURCE_DATE_EPOCH`` asks for; 1980 where neither is known."""
    seconds = os.environ.get("SOURCE_DATE_EPOCH") or _git("log", "-1", "--format=%ct") or "315532800"
    return datetime.fromtimestamp(int(seconds), UTC)


@cache
def ref() -> str:
    """What a checkout of this edition is called: its tag, or ``main`` where it has none."""
    return _git("describe", "--tags", "--exact-match", "HEAD") or "main"


def words() -> str:
    """``Version 0.1.0, commit 0123456789``, and whether files have changed since."""
    changed = " with changes" if _git("status", "--porcelain", "--untracked-files=no") else ""
    return f"Version {version()}" + (f", commit {commit()}{changed}" if commit() else "")


def repository() -> str:
    """``https://github.com/owner/name``; nothing where nobody said.

    Raises ValueError for an address that is not of this form: the links to Binder and Colab are made from its parts.
    """
    runner = os.environ.get("GITHUB_REPOSITORY", "")
    address = _project().get("urls", {}).get("repository") or (runner and f"https://github.com/{runner}")
    if address and not re.fullmatch(r"https://github\.com/[\w.-]+/[\w.-]+", address):
        raise ValueError(f"repository: expected https://github.com/owner/name, got {address!r}")
    return address


def site() -> str:
    """Where the site is published, with a slash at its end; nothing where that is not known."""
    if not (address := repository()):
        return ""
    owner, name = address.split("/")[-2:]
    return f"https://{owner.lower()}.github.io/{name}/"
