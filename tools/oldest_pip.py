"""Would the oldest pip install what is locked, whatever the package index publishes later?

    .venv/bin/python tools/oldest_pip.py

The lock is resolved by the pip that came with the first release of this Python, in a throw-away environment.  It sees
no index, but a folder of stand-ins: for each locked distribution a wheel with its true metadata and no content, and a
later release of each, which must not be taken.  So nothing is downloaded but that pip, and the answer is the same on
any day.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.metadata
import re
import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OLDEST = {(3, 11): "22.3", (3, 12): "23.2.1", (3, 13): "24.2", (3, 14): "25.2"}
LATER = "9999"
BLOCK = re.compile(r"^(?P<pin>(?P<name>[a-z0-9._-]+)[^\\\n]*)\\\n(?:    [^\n]*\n)+", re.M)


def stand_in(folder: Path, name: str, version: str, metadata: str) -> str:
    """Write a wheel that holds metadata alone; its sha256."""
    stem = f"{name.replace('-', '_').replace('.', '_')}-{version}"
    files = {
        f"{stem}.dist-info/METADATA": re.sub(r"^Version: .*$", f"Version: {version}", metadata, count=1, flags=re.M),
        f"{stem}.dist-info/WHEEL": "Wheel-Version: 1.0\nGenerator: none\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    digest = {path: base64.urlsafe_b64encode(hashlib.sha256(text.encode()).digest()) for path, text in files.items()}
    record = "".join(
        f"{path},sha256={digest[path].decode().rstrip('=')},{len(files[path].encode())}\n" for path in files
    )
    wheel = folder / f"{stem}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, text in (files | {f"{stem}.dist-info/RECORD": record}).items():
            archive.writestr(path, text)
    return hashlib.sha256(wheel.read_bytes()).hexdigest()


def with_stand_ins(lock: str, folder: Path) -> str:
    """The lock with the hashes of stand-ins, which are written to `folder`, for what is installed here."""

    def block(match: re.Match[str]) -> str:
        try:
            locked = importlib.metadata.distribution(match["name"])
        except importlib.metadata.PackageNotFoundError:
            return match[0]  # a line for another platform or another Python
        if f"=={locked.version} " not in match["pin"]:
            return match[0]
        metadata = locked.read_text("METADATA") or locked.read_text("PKG-INFO")
        stand_in(folder, match["name"], LATER, metadata)
        sha256 = stand_in(folder, match["name"], locked.version, metadata)
        return f"{match['pin']}--hash=sha256:{sha256}\n"

    return BLOCK.sub(block, lock)


def main() -> None:
    version = OLDEST[sys.version_info[:2]]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        fetch = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
        subprocess.run([*fetch, "--dest", folder, f"pip=={version}"], check=True)
        links = folder / "links"
        links.mkdir()
        lock = folder / "requirements.lock"
        lock.write_text(with_stand_ins((ROOT / "requirements.lock").read_text(encoding="utf-8"), links))
        venv.create(folder / "venv", with_pip=False)
        python = next(p for p in (folder / "venv/bin/python", folder / "venv/Scripts/python.exe") if p.exists())
        pip = [python, folder / f"pip-{version}-py3-none-any.whl" / "pip", "--isolated", "--disable-pip-version-check"]
        install = ["install", "--dry-run", "--no-index", "--find-links", links, "--require-hashes", "-r", lock]
        told = subprocess.run([*pip, *install], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    last = told.stdout.rstrip().splitlines()[-1]
    taken = last.removeprefix("Would install ").split()
    if told.returncode or not last.startswith("Would install ") or any(t.endswith(f"-{LATER}") for t in taken):
        sys.exit(f"{told.stdout[-3000:]}\npip {version} does not install what is locked: see `make lock`.")
    print(f"pip {version} would install the {len(taken)} locked distributions of this machine, and no later one.")


if __name__ == "__main__":
    main()
