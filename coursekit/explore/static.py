"""The static half of an explorer: every frame in one piece of HTML, and a few lines of JavaScript to swap them."""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files

from coursekit.explore.painting import LIVE_DPI, STATIC_DPI, Picture, Words, is_drawing, webp
from coursekit.explore.sliders import Slider, grid, start


def static_html(sliders: Mapping[str, Slider], picture: Picture, alt: Words) -> str:
    """Render the grid and wrap it: labelled inputs, the first frame, every frame's address and words."""
    combinations = list(grid(sliders))
    first = combinations.index(start(sliders))
    shown_first = picture(combinations[first], STATIC_DPI)
    lossless = is_drawing(shown_first)
    with ThreadPoolExecutor(2) as pool:  # encoding leaves the interpreter free to draw the next frame
        drawn = (picture(values, STATIC_DPI) for values in combinations)
        frames = list(pool.map(lambda frame: webp(frame, lossless), drawn))
    alts = [alt(values) for values in combinations]
    height, width = shown_first.shape[:2]
    identity = "explorer-" + hashlib.sha256("".join(frames + alts).encode()).hexdigest()[:12]
    controls = "".join(_control_html(identity, name, slider) for name, slider in sliders.items())
    data = {"frames": frames, "alts": alts, "sizes": [len(s.values) for s in sliders.values()]}
    texts = [[s.text(v) for v in s.values] for s in sliders.values()]
    # "<" is escaped so that no text can end the script element early.
    payload = json.dumps(data | {"texts": texts}, ensure_ascii=False).replace("<", "\\u003c")
    script = files("coursekit.explore").joinpath("explorer.js").read_text(encoding="utf-8")
    style = files("coursekit.explore").joinpath("explorer.css").read_text(encoding="utf-8")
    shown_width = round(width * LIVE_DPI / STATIC_DPI)
    return (
        f'<div class="explorer" id="{identity}" role="group" aria-label="Interactive figure"'
        f' style="max-width:{shown_width}px">'
        f"<style>{style}</style>"
        f'<img src="{frames[first]}" alt="{html.escape(alts[first], quote=True)}"'
        f' width="{width}" height="{height}" decoding="sync">'
        f'<div class="explorer-controls">{controls}</div><p class="explorer-words" aria-live="polite"></p>'
        f"<noscript>The sliders need JavaScript; the picture shows {html.escape(alts[first])}.</noscript>"
        f'<script type="application/json" class="explorer-data">{payload}</script>'
        f'<script>({script.strip()})(document.getElementById("{identity}"));</script></div>'
    )


def _control_html(identity: str, name: str, slider: Slider) -> str:
    label, first = html.escape(slider.label or name), slider.values.index(slider.start)
    text = html.escape(slider.text(slider.start))
    if slider.is_choice:
        buttons = "".join(
            f'<label><input type="radio" name="{identity}-{name}" value="{i}"{" checked" if i == first else ""}>'
            f"<span>{html.escape(slider.text(v))}</span></label>"
            for i, v in enumerate(slider.values)
        )
        return f'<fieldset class="explorer-control" data-name="{name}"><legend>{label}</legend>{buttons}</fieldset>'
    play = f'<button type="button" class="explorer-play" aria-label="Play {label}">▶</button>' if slider.play else ""
    return (
        f'<div class="explorer-control" data-name="{name}"><label for="{identity}-{name}">{label}</label>{play}'
        f'<input type="range" id="{identity}-{name}" min="0" max="{len(slider.values) - 1}" step="1" value="{first}"'
        f' aria-valuetext="{text}" autocomplete="off"><output for="{identity}-{name}">{text}</output></div>'
    )
