"""A page's plain figures, made light: WebP for PNG, fetched when the reader comes near, and marked for the dark.

A drawing is kept without loss, a photograph nearly so.  Lines on white paper get the class ``drawing``: in dark mode
the style sheet turns their paper black and keeps their hues.  A camera's image is never turned.
"""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image

LOSSLESS, LOSSY = {"lossless": True, "quality": 40, "method": 3}, {"quality": 88, "method": 3}
PICTURE = re.compile(r'<img [^>]*?src="(?P<at>(?:\.\./)*_images/(?P<stem>[\w.-]+?))\.(?P<kind>png|webp)"[^>]*>')
LINKED = re.compile(r'(href="(?:\.\./)*_images/[\w.-]+?)\.png(?=")')  # a figure leads to itself, alone
PAPER = 0.3  # the least share of white in a drawing
# A square of so many pixels is part of a photograph when it has so many colours and no white; a drawing has few such.
BLOCK, COLOURS, PHOTOGRAPH = 16, 20, 0.06
WHITE = 250  # a frame of 256 colours has its white a shade darker


def is_drawing(image: Image.Image) -> bool:
    """True for lines on white paper, False where a part is a camera's image or a map of colours."""
    pixels = np.asarray(image.convert("RGB")).astype(np.int32)

    def squares(values: np.ndarray) -> np.ndarray:
        height, width = (n // BLOCK for n in values.shape)
        cut = values[: height * BLOCK, : width * BLOCK].reshape(height, BLOCK, width, BLOCK)
        return cut.swapaxes(1, 2).reshape(-1, BLOCK * BLOCK)

    white = squares((pixels >= WHITE).all(axis=2))
    colours = 1 + (np.diff(np.sort(squares(pixels @ [1 << 16, 1 << 8, 1]), axis=1), axis=1) > 0).sum(axis=1)
    photographic = (colours >= COLOURS) & ~white.any(axis=1)
    return bool(white.mean() >= PAPER and photographic.mean() <= PHOTOGRAPH)


def encode(path: Path) -> None:
    """Write a PNG's WebP beside it, the lossy one where that is much smaller."""
    image = Image.open(path).convert("RGB")
    kinds = []
    for options in (LOSSLESS, LOSSY):
        image.save(code := BytesIO(), "WEBP", **options)
        kinds.append(code.getvalue())
    exact, near = kinds
    path.with_suffix(".webp").write_bytes(exact if len(exact) <= 1.5 * len(near) else near)


def lighten(pages: dict[Path, str], folder: Path) -> dict[Path, str]:
    """The pages with light pictures, each with its size, so that nothing moves when it comes."""
    images = folder / "_images"
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(encode, sorted(images.glob("*.png"))))
    told: dict[str, str] = {}

    def describe(stem: str) -> str:
        if stem not in told:
            with Image.open(images / f"{stem}.webp") as image:
                mark = ' class="drawing"' if is_drawing(image) else ""
                told[stem] = f'{mark} width="{image.width}" height="{image.height}" loading="lazy"'
        return told[stem]

    def turn(match: re.Match[str]) -> str:
        tag = match[0].replace(f"{match['stem']}.png", f"{match['stem']}.webp")
        said = describe(match["stem"])
        if ' width="' in tag or ' height="' in tag:
            said = re.sub(r' (?:width|height)="\d+"', "", said)
        if 'class="' in tag and "drawing" in said:
            tag = tag.replace('class="', 'class="drawing ', 1)
            said = said.replace(' class="drawing"', "")
        return tag.replace("<img ", f"<img{said} ", 1)

    turned = {path: LINKED.sub(r"\1.webp", PICTURE.sub(turn, page)) for path, page in pages.items()}
    for path in images.glob("*.png"):
        path.unlink()
    return turned
