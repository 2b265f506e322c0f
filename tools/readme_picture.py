"""Draw the README's picture, four explorers as their labs show them, into book/_static/readme.png.

python tools/readme_picture.py
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))
from tests import notebooks  # noqa: E402

SHOWN = {"00": 1, "02": 0, "04": 2, "06": 0}  # which explorer of which lab


def main():
    pictures = []
    for number, index in SHOWN.items():
        (path,) = [p for p in notebooks.NOTEBOOKS if p.stem.startswith(number)]
        explorer = notebooks.run(path).explorers[index]
        pictures.append(Image.fromarray(explorer.picture(explorer.start)))
    width, height = 760, 440
    sheet = Image.new("RGB", (2 * width, 2 * height), "white")
    for i, picture in enumerate(pictures):
        picture.thumbnail((width - 30, height - 30))
        corner = np.array([i % 2 * width, i // 2 * height]) + (np.array([width, height]) - picture.size) // 2
        sheet.paste(picture, tuple(corner.tolist()))
    sheet.quantize(128).save(ROOT / "book" / "_static" / "readme.png", optimize=True)


if __name__ == "__main__":
    main()
