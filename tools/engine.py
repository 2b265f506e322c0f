"""Python for the reader's browser: Pyodide, fetched once, checked, and kept in the user's cache.

    python tools/engine.py        says where it lies, or why it is not to be had

Pyodide comes through npm, and its archive must have the digest that is written here.  NumPy's wheel comes from where
Pyodide keeps its packages, and must have the digest that Pyodide's own lock names.  Without a network, or without npm,
the book is built all the same, and its pages offer the lab for JupyterLab instead.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pooch

NAME = "pyodide@314.0.7"
INTEGRITY = "sha512-0YvXxEhfEdpLfb/XkM2BFAeMROq0iMUX2bzzH9pOttyMcWkwq+HbE5uyuGD82LN7y2q+SNvi/6V5JEsOlD2R1A=="
PARTS = ["pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json"]
PATIENCE = 120  # seconds for a download


class EngineUnavailable(Exception):
    """Python for the pages is not to be had; the message says why."""


def pack(name: str) -> bytes:
    """A package's archive, from npm.  Raises ``EngineUnavailable``."""
    npm = shutil.which("npm")
    if npm is None:
        raise EngineUnavailable("there is no npm here")
    with tempfile.TemporaryDirectory() as folder:
        try:
            command = [npm, "pack", name, "--silent", "--pack-destination", folder]
            subprocess.run(command, check=True, capture_output=True, timeout=PATIENCE)
        except (OSError, subprocess.SubprocessError) as error:
            raise EngineUnavailable(f"npm has no {name} ({error})") from None
        return next(Path(folder).glob("*.tgz")).read_bytes()


def download(url: str) -> bytes:
    """What lies at an address.  Raises ``EngineUnavailable``."""
    try:
        with urllib.request.urlopen(url, timeout=PATIENCE) as answer:
            content: bytes = answer.read()
            return content
    except OSError as error:
        raise EngineUnavailable(f"{url} cannot be fetched ({error})") from None


def unpack(archive: bytes, integrity: str = INTEGRITY) -> dict[str, bytes]:
    """The parts of Pyodide that a page loads.  Raises ``EngineUnavailable`` for an archive with another digest."""
    kind, _, expected = integrity.partition("-")
    if base64.b64encode(hashlib.new(kind, archive).digest()).decode() != expected:
        raise EngineUnavailable(f"the archive of {NAME} is not the one that was chosen: its {kind} differs")
    with tarfile.open(fileobj=io.BytesIO(archive)) as members:
        return {part: _content(members, f"package/{part}") for part in PARTS}


def _content(archive: tarfile.TarFile, name: str) -> bytes:
    member = archive.extractfile(name)
    assert member, "an archive with the right digest has all its parts"
    return member.read()


def numpy_wheel(parts: dict[str, bytes], get: Callable[[str], bytes] = download) -> tuple[str, bytes]:
    """NumPy's wheel for this Pyodide: its file name and its content.

    Raises ``EngineUnavailable`` when it cannot be fetched, or has not the digest that Pyodide's lock names.
    """
    entry = json.loads(parts["pyodide-lock.json"])["packages"]["numpy"]
    # Pyodide knows its own place for packages.
    place = re.search(rb"https://[^\"'`$]+/pyodide/", parts["pyodide.mjs"])
    if place is None:
        raise EngineUnavailable("Pyodide does not say where its packages are")
    version = NAME.partition("@")[2]
    wheel = get(f"{place[0].decode()}v{version}/full/{entry['file_name']}")
    if hashlib.sha256(wheel).hexdigest() != entry["sha256"]:
        raise EngineUnavailable(f"{entry['file_name']} is not the one that Pyodide's lock names: its sha256 differs")
    return entry["file_name"], wheel


def fetch(cache: Path | None = None) -> Path | None:
    """The folder with all that a page's Python needs; None, with a line that says why, where it is not to be had."""
    cache = cache or Path(pooch.os_cache("coursekit"))
    folder, kept = cache / NAME.replace("@", "-"), cache / f"{NAME.replace('@', '-')}.tgz"
    if folder.exists():
        return folder
    try:
        archive = kept.read_bytes() if kept.exists() else pack(NAME)
        parts = unpack(archive)
        cache.mkdir(parents=True, exist_ok=True)
        kept.write_bytes(archive)  # so that a build without a network asks npm once
        name, wheel = numpy_wheel(parts)
    except EngineUnavailable as why:
        print(f"The pages go without Python: {why}", file=sys.stderr)
        return None
    partial = Path(tempfile.mkdtemp(dir=cache))
    for part, content in {**parts, name: wheel}.items():
        (partial / part).write_bytes(content)
    partial.rename(folder)  # a fetch that is cut off leaves nothing half written
    return folder


if __name__ == "__main__":
    print(fetch() or "no Python for the pages")
