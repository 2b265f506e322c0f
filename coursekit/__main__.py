"""``python -m coursekit``: which version this is, what is installed beside it, and where data is found."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from pathlib import Path

import coursekit
from coursekit import extras
from coursekit.recordings import datasets


def report() -> Iterator[str]:
    """The lines that are printed."""
    yield f"coursekit {coursekit.__version__} in {Path(__file__).parent}"
    yield f"Python {platform.python_version()}, numpy {extras.version('numpy')}, scipy {extras.version('scipy')}"
    yield "\nExtras"
    for extra, modules in extras.EXTRAS.items():
        if lacking := extras.missing(extra):
            yield f"  {extra:8} lacks {', '.join(lacking)}: pip install 'coursekit[{extra}]'"
        else:
            yield f"  {extra:8} {', '.join(f'{name} {extras.version(name)}'.rstrip() for name in modules.values())}"
    yield "\nData"
    yield f"  $COURSEKIT_DATA is {os.environ.get('COURSEKIT_DATA') or 'not set'}"
    for name, _, _, _, where in datasets.list().rows:
        yield f"  {name:18} {where}"


if __name__ == "__main__":
    print("\n".join(report()))
