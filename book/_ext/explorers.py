"""Sphinx extension: an explorer's frames become files.

A lab's explorer arrives with every frame inside it, as a data address, so that it also works in a lone notebook.
A page with several would weigh many megabytes.  When a page is written, each frame goes to
``_static/explorers/<digest>.webp`` and the page keeps a relative address: pages stay light, a reader fetches the
frames that are shown, and all still works from a folder on disk.
"""

from __future__ import annotations

import base64
import hashlib
import re
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pictures

FRAME = re.compile(r"data:image/(webp|png|jpeg);base64,([A-Za-z0-9+/]+=*)")
EXPLORER = re.compile(r'<div class="explorer".*?</script></div>', re.DOTALL)
STYLE = re.compile(r"<style>.*?</style>", re.DOTALL)
FOLDER = "_static/explorers"


def move_frames(page: str, folder: Path, address: str) -> str:
    """The page with its explorers' frames moved into ``folder``, which the page finds at ``address``."""
    folder.mkdir(parents=True, exist_ok=True)

    def move(match: re.Match[str]) -> str:
        content = base64.b64decode(match[2])
        name = f"{hashlib.sha256(content).hexdigest()[:20]}.{match[1]}"
        if not (folder / name).exists():
            (folder / name).write_bytes(content)
        return f"{address}/{name}"

    def lighten(match: re.Match[str]) -> str:
        shown = FRAME.search(match[0])
        drawing = shown is not None and pictures.is_drawing(Image.open(BytesIO(base64.b64decode(shown[2]))))
        explorer = FRAME.sub(move, STYLE.sub("", match[0], count=1))
        mark = ' class="drawing"' if drawing else ""
        return explorer.replace("<img ", f'<img{mark} loading="lazy" ', 1)

    return EXPLORER.sub(lighten, page)


def write_page(app: Sphinx, pagename: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    if 'class="explorer"' in context.get("body", ""):
        up = "../" * pagename.count("/")
        context["body"] = move_frames(context["body"], Path(app.outdir) / FOLDER, up + FOLDER)


def sweep_old_frames(app: Sphinx, exception: Exception | None) -> None:
    """Remove the frames that no page shows any more."""
    if exception is None and app.builder.format == "html":
        pages = "".join(p.read_text(encoding="utf-8") for p in Path(app.outdir).rglob("*.html"))
        for frame in (Path(app.outdir) / FOLDER).glob("*"):
            if frame.name not in pages:
                frame.unlink()


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("html-page-context", write_page)
    app.connect("build-finished", sweep_old_frames)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
